"""The blind truck: tractor and semi-trailer by Lagrange's equations, and tyres of the brush model.

    M q'' + b = Q(tyres, air, road, fifth wheel)          M, b: truck_equations.py

Minimal coordinates, two rolling sprung masses, quasi-static pitch and load transfer, slip angles of three axle groups
that relax, a fifth wheel with dry friction. The wheels' spin is an added mass. Neither the formulation nor the tyre
is that of the diagnosis' truck, which has wheels with springs and spin, a hitch of stiffnesses, and Magic Formula
tyres.

State: X, Y, unused, vx, yaw, yaw rate, roll, roll rate, trailer's yaw, its rate, vy, trailer's roll, its rate, slip
angles of front, rear and trailer, wind-up of the fifth wheel. SI units, ISO 8855.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .truck_equations import mass_and_bias

GRAVITY = 9.81
STATES = 17
NAMES = [
    "m1", "iz1", "ix1", "h1", "mu1", "a", "b", "m2", "iz2", "ix2", "h2", "mu2", "hx", "lx", "dx", "hitch_h",
    "hitch_roll", "hitch_roll_d", "hitch_friction", "kf", "kr", "kt", "df", "dr", "dt", "tf", "tr", "tt", "rf",
    "rr", "rt", "added", "drive_mass", "max_force", "max_power", "max_brake", "brake_f", "brake_t", "c0", "c1",
    "mu0", "mu1t", "n_f", "n_r", "n_t", "stiff_f", "stiff_r", "stiff_t", "relaxation", "rolling", "drag", "side1",
    "side2", "x1", "x2", "yaw_moment", "pitch_k", "base", "understeer",
]  # fmt: skip
(
    _M1, _IZ1, _IX1, _H1, _MU1, _A, _B, _M2, _IZ2, _IX2, _H2, _MU2, _HX, _LX, _DX, _HH, _HK, _HD, _HF,
    _KF, _KR, _KT, _DF, _DR, _DT, _TF, _TR, _TT, _RF, _RR, _RT, _ADDED, _MD, _FMAX, _PMAX, _BMAX, _BF, _BT,
    _C0, _C1, _MU0, _MU1T, _NF, _NR, _NT, _SF, _SR, _ST, _RELAX, _ROLLING, _DRAG, _SIDE1, _SIDE2, _X1, _X2, _MZ, _PK,
    _BASE, _UNDER,
) = range(len(NAMES))  # fmt: skip
FNOMIN = 20000.0  # N
WIND_UP = 0.0002  # rad, at which dry friction is whole: it sticks before
WHEEL = 0.53  # m


def array(p: dict[str, float]) -> np.ndarray:
    """The parameters in the order of the compiled functions."""
    return np.array([p[name] for name in NAMES])


def at_speed(p: dict[str, float], x: float, y: float, yaw: float, speed: float) -> np.ndarray:
    """The truck in one line, straight ahead at a speed."""
    s = np.zeros(STATES)
    s[0], s[1], s[3], s[4], s[8] = x, y, speed, yaw, yaw
    return s


@njit(cache=True)
def _side_force(alpha, load, count, stiffness, friction, along, p):
    """Lateral force in N of one side of an axle group (`count` tyres): brush model, `along` N used up lengthwise."""
    one = max(load, 0.0) / count
    if one < 1.0:
        return 0.0
    slope = stiffness * one * (p[_C0] - p[_C1] * one / 20000.0)
    grip = friction * one * (p[_MU0] - p[_MU1T] * (one / 20000.0 - 1.0))
    left = grip * grip - (along / count) ** 2
    grip = math.sqrt(left) if left > 0.01 * grip * grip else 0.1 * grip
    s = min(slope * abs(math.tan(alpha)) / (3.0 * grip), 1.0)
    force = grip * (3.0 * s - 3.0 * s * s + s * s * s)
    return count * (force if alpha > 0.0 else -force)


@njit(cache=True)
def rate(y, steer, accel, around, p, f, flow):
    """Writes the derivative of the state into `f`; specific forces at the CG and yaw acceleration into `flow`."""
    vx, yaw, r1, phi1, p1 = y[3], y[4], y[5], y[6], y[7]
    yaw2, r2, vy, phi2, p2 = y[8], y[9], y[10], y[11], y[12]
    bend = yaw2 - yaw  # the trailer in the tractor's axes
    sin_b, cos_b, sin_d, cos_d = math.sin(bend), math.cos(bend), math.sin(steer), math.cos(steer)
    # The trailer's velocity in its own axes.
    high1, high2, pin1, pin2 = _above(p)
    sin_1, cos_1, sin_2, cos_2 = math.sin(phi1), math.cos(phi1), math.sin(phi2), math.cos(phi2)
    ux, uy = vx + pin1 * sin_1 * r1, vy - p[_HX] * r1 - pin1 * cos_1 * p1
    wx = ux * cos_b + uy * sin_b - pin2 * sin_2 * r2
    wy = -ux * sin_b + uy * cos_b - p[_LX] * r2 + pin2 * cos_2 * p2

    # Forces along: drive at the rear axle, brakes at all.
    asked = p[_MD] * accel
    drive = min(asked, p[_FMAX], p[_PMAX] / max(vx, 1.0)) if asked > 0.0 else 0.0
    brake = min(-asked, p[_BMAX]) if asked < 0.0 else 0.0
    total = p[_M1] + p[_M2]
    share = total / (total + p[_ADDED])

    # Loads: at rest, and shifted by acceleration.
    ax = (drive - brake) / total
    # The semi-trailer's brakes take their part of its inertia; the pin has the rest.
    pull = p[_M2] * ax + brake * p[_BT]
    pin = (p[_M2] * (GRAVITY * p[_DX] - ax * p[_H2]) + pull * p[_HH]) / (p[_LX] + p[_DX])
    behind = p[_M2] * GRAVITY - pin
    base = p[_A] + p[_B]
    front = (p[_M1] * GRAVITY * p[_B] + pin * (p[_B] - p[_HX]) - p[_M1] * ax * p[_H1] - pull * p[_HH]) / base
    rear = p[_M1] * GRAVITY + pin - front
    fx_f = -brake * p[_BF] - p[_ROLLING] * front
    fx_r = drive - brake * (1.0 - p[_BF] - p[_BT]) - p[_ROLLING] * rear
    fx_t = -brake * p[_BT] - p[_ROLLING] * behind

    # Slip angles, relaxing.
    speed = max(vx, 1.0)
    wanted_f = steer - math.atan((vy + p[_A] * r1) / speed)
    wanted_r = -math.atan((vy - p[_B] * r1) / speed)
    wanted_t = -math.atan((wy - p[_DX] * r2) / max(wx, 1.0))
    f[13] = (wanted_f - y[13]) * speed / p[_RELAX]
    f[14] = (wanted_r - y[14]) * speed / p[_RELAX]
    f[15] = (wanted_t - y[15]) * speed / p[_RELAX]

    # Side forces, left and right: loads shift by the springs' moments and by the force at the roll centre.
    mu = around[2]
    shift_f = (p[_KF] * phi1 + p[_DF] * p1) / p[_TF]
    shift_r = (p[_KR] * phi1 + p[_DR] * p1) / p[_TR]
    shift_t = (p[_KT] * phi2 + p[_DT] * p2) / p[_TT]
    guess_f = 0.5 * front * p[_C0] * p[_SF] * y[13] * 2.0 * 0.9
    guess_r = 0.5 * rear * p[_C0] * p[_SR] * y[14] * 2.0 * 0.9
    guess_t = 0.5 * behind * p[_C0] * p[_ST] * y[15] * 2.0 * 0.9
    guess_f = min(max(guess_f, -mu * 0.8 * front), mu * 0.8 * front)
    guess_r = min(max(guess_r, -mu * 0.8 * rear), mu * 0.8 * rear)
    guess_t = min(max(guess_t, -mu * 0.8 * behind), mu * 0.8 * behind)
    shift_f += guess_f * p[_RF] / p[_TF]
    shift_r += guess_r * p[_RR] / p[_TR]
    shift_t += guess_t * p[_RT] / p[_TT]
    fy_f = _side_force(y[13], 0.5 * front - shift_f, p[_NF], p[_SF], mu, 0.5 * fx_f, p)
    fy_f += _side_force(y[13], 0.5 * front + shift_f, p[_NF], p[_SF], mu, 0.5 * fx_f, p)
    fy_r = _side_force(y[14], 0.5 * rear - shift_r, p[_NR], p[_SR], mu, 0.5 * fx_r, p)
    fy_r += _side_force(y[14], 0.5 * rear + shift_r, p[_NR], p[_SR], mu, 0.5 * fx_r, p)
    fy_t = _side_force(y[15], 0.5 * behind - shift_t, p[_NT], p[_ST], mu, 0.5 * fx_t, p)
    fy_t += _side_force(y[15], 0.5 * behind + shift_t, p[_NT], p[_ST], mu, 0.5 * fx_t, p)

    # Air.
    sin_y, cos_y = math.sin(yaw), math.cos(yaw)
    sin_t, cos_t = math.sin(yaw2), math.cos(yaw2)
    air_x = vx - (around[3] * cos_y + around[4] * sin_y)
    air_y = vy - (around[4] * cos_y - around[3] * sin_y)
    air = math.sqrt(air_x * air_x + air_y * air_y)
    drag, side1 = -p[_DRAG] * air * air_x, -p[_SIDE1] * air * air_y
    air_x = wx - (around[3] * cos_t + around[4] * sin_t)
    air_y = wy - (around[4] * cos_t - around[3] * sin_t)
    side2 = -p[_SIDE2] * math.sqrt(air_x * air_x + air_y * air_y) * air_y

    # What acts on each unit, in its own axes: forward, left, about its CG; gravity on a slope apart.
    own_x = (fx_f * cos_d - fy_f * sin_d + fx_r + drag) * share
    own_y = fx_f * sin_d + fy_f * cos_d + fy_r + side1
    own_n = (fx_f * sin_d + fy_f * cos_d) * p[_A] - fy_r * p[_B] + side1 * p[_X1] + p[_MZ] * min(abs(vx), 1.0)
    other_x, other_y = fx_t * share, fy_t + side2
    other_n = -fy_t * p[_DX] + side2 * p[_X2]
    slope, bank = -GRAVITY * around[1] * share, -GRAVITY * around[0]
    grade1, bank1, grade2, bank2 = p[_M1] * slope, p[_M1] * bank, p[_M2] * slope, p[_M2] * bank
    turn = r1 - r2
    f[16] = turn - abs(turn) * y[16] / WIND_UP
    rub = p[_HF] * y[16] / WIND_UP
    damp = p[_HD] * (p1 - p2)

    # Generalised forces in the tractor's axes.
    tx, ty = other_x + grade2, other_y + bank2
    back_x, back_y = tx * cos_b - ty * sin_b, tx * sin_b + ty * cos_b
    ms1, ms2 = p[_M1] - p[_MU1], p[_M2] - p[_MU2]
    q = np.empty(6)
    q[0] = own_x + grade1 + back_x
    q[1] = own_y + bank1 + back_y
    q[2] = own_n - p[_HX] * back_y + pin1 * sin_1 * back_x - rub
    q[3] = -(p[_DF] + p[_DR]) * p1 - damp - ms1 * high1 * cos_1 * bank - pin1 * cos_1 * back_y
    q[4] = other_n - p[_LX] * ty - pin2 * sin_2 * tx + rub
    q[5] = -p[_DT] * p2 + damp - ms2 * high2 * cos_2 * bank + pin2 * cos_2 * ty

    m, bias = np.empty((6, 6)), np.empty(6)
    mass_and_bias(
        bend, phi1, phi2, vx, vy, r1, p1, r2, p2, p[_MU1], ms1, p[_IZ1], p[_IX1], high1, p[_KF] + p[_KR],
        p[_MU2], ms2, p[_IZ2], p[_IX2], high2, p[_KT], p[_HK], p[_HX], p[_LX], pin1, pin2, GRAVITY, m, bias,
    )  # fmt: skip
    for i in range(6):
        q[i] -= bias[i]
    _solve(m, q)
    f[0], f[1] = vx * cos_y - vy * sin_y, vx * sin_y + vy * cos_y
    f[2] = 0.0
    f[3], f[10] = q[0] + r1 * vy, q[1] - r1 * vx
    f[4], f[5], f[6], f[7] = r1, q[2], p1, q[3]
    f[8], f[9], f[11], f[12] = r2, q[4], p2, q[5]
    # Felt: motion of the CG without gravity; the sprung mass sways.
    sway = -high1 * cos_1 * q[3] * ms1 / p[_M1]
    flow[0], flow[1], flow[2] = q[0] - slope, q[1] + sway - bank, q[2]


@njit(cache=True, inline="always")
def _above(p):
    """Heights above the roll axes of the sprung CGs, and of the pin, m: tractor, trailer, tractor, trailer."""
    axis1 = p[_RR] + (p[_RF] - p[_RR]) * p[_B] / (p[_A] + p[_B])
    sprung1 = (p[_M1] * p[_H1] - p[_MU1] * WHEEL) / (p[_M1] - p[_MU1])
    sprung2 = (p[_M2] * p[_H2] - p[_MU2] * WHEEL) / (p[_M2] - p[_MU2])
    axis_at_pin = p[_RR] + (p[_RF] - p[_RR]) * (p[_B] - p[_HX]) / (p[_A] + p[_B])
    return sprung1 - axis1, sprung2 - p[_RT], p[_HH] - axis_at_pin, p[_HH] - p[_RT]


@njit(cache=True)
def _solve(m, b):
    """Solves m x = b in place by Cholesky's method; m is symmetric and positive."""
    n = len(b)
    for j in range(n):
        for k in range(j):
            m[j, j] -= m[j, k] * m[j, k]
        m[j, j] = math.sqrt(m[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                m[i, j] -= m[i, k] * m[j, k]
            m[i, j] /= m[j, j]
    for i in range(n):
        for k in range(i):
            b[i] -= m[i, k] * b[k]
        b[i] /= m[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= m[k, i] * b[k]
        b[i] /= m[i, i]


@njit(cache=True)
def observe(y, flow, arm, p, out):
    """What is true at the place on the road under a point `arm` forward of the tractor's CG; as car.observe."""
    sin_y, cos_y = math.sin(y[4]), math.cos(y[4])
    out[0], out[1], out[2] = y[0] + arm * cos_y, y[1] + arm * sin_y, y[4]
    out[3], out[4], out[5] = y[3], y[10] + arm * y[5], y[5]
    fx, fy = flow[0] - arm * y[5] * y[5], flow[1] + arm * flow[2]
    dive = -fx * p[_PK]
    out[6] = fx * math.cos(dive) - GRAVITY * math.sin(dive)
    out[7] = fy * math.cos(y[6]) + GRAVITY * math.sin(y[6])
    out[8], out[9], out[10] = y[6], y[4] - y[8], y[5] - y[9]
