"""Equations of motion of the blind cars: CommonRoad's multi-body model, compiled, with places to put effects in.

    y' = rate(y, steering angle, given acceleration, surroundings; p)

The model is that of M. Althoff and G. Wuersching, "CommonRoad: Vehicle Models", 2020 (PyPI `commonroad-vehicle-models`,
BSD-3): a body with yaw, roll, pitch and heave, two axles that roll, heave and shift against it, four wheels with
Magic Formula tyres; 29 states. A test holds it against that package. Added here, neutral by default: relaxation of the
slip angles (4 states), scales of each axle's tyres, bank and grade, air, a yaw moment.

The model's axes are x forward, y right, z down, and mirror "left": yaw, steering and lateral signals have the signs of
ISO 8855 as they are; roll and pitch change sign. SI units, radians.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

GRAVITY = 9.81

# Parameters, one array: the names of CommonRoad, then ours.
NAMES = [
    "m", "m_s", "m_uf", "m_ur", "a", "b", "I_Phi_s", "I_y_s", "I_z", "I_xz_s", "K_sf", "K_sdf", "K_sr", "K_sdr",
    "T_f", "T_r", "K_ras", "K_tsf", "K_tsr", "K_rad", "K_zt", "h_raf", "h_rar", "h_s", "I_uf", "I_ur", "I_y_w",
    "K_lt", "R_w", "T_sb", "T_se", "D_f", "D_r", "E_f", "E_r", "p_cx1", "p_dx1", "p_dx3", "p_ex1", "p_kx1",
    "p_hx1", "p_vx1", "r_bx1", "r_bx2", "r_cx1", "r_ex1", "r_hx1", "p_cy1", "p_dy1", "p_dy3", "p_ey1", "p_ky1",
    "p_hy1", "p_hy3", "p_vy1", "p_vy3", "r_by1", "r_by2", "r_by3", "r_cy1", "r_ey1", "r_hy1", "r_vy1", "r_vy3",
    "r_vy4", "r_vy5", "r_vy6", "a_max", "v_switch", "stiffness_f", "stiffness_r", "friction_f", "friction_r",
    "relaxation", "drive_mass", "drag_area", "side_area", "pressure_x", "drag_factor", "yaw_moment",
    "stiffness_left",
]  # fmt: skip
OURS = NAMES.index("stiffness_f")
INDEX = {name: i for i, name in enumerate(NAMES)}
# What of ours is not 0 by default.
NEUTRAL = {"stiffness_f": 1.0, "stiffness_r": 1.0, "friction_f": 1.0, "friction_r": 1.0, "drag_factor": 1.0}
NEUTRAL["stiffness_left"] = 1.0
STATES = 33
AIR_DENSITY = 1.2
# Surroundings: sine of bank (right side low positive), sine of grade (uphill positive), friction factor, wind to east
# and to north in m/s.
BANK, GRADE, FRICTION, WIND_X, WIND_Y = range(5)
# What a step also tells: specific forces forward and to the left at the CG in the plane of the road, yaw acceleration.
FLOWS = 3


def parameters(number: int) -> dict[str, float]:
    """CommonRoad's parameter set 1, 2 or 3, with our additions neutral."""
    from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

    p = setup_vehicle_parameters(number)
    found = {}
    for name in NAMES[:OURS]:
        for of in (p, p.tire, p.longitudinal):
            if hasattr(of, name):
                found[name] = float(getattr(of, name))
                break
    return found | {name: NEUTRAL.get(name, 0.0) for name in NAMES[OURS:]} | {"drive_mass": found["m"]}


def array(p: dict[str, float]) -> np.ndarray:
    """The parameters in the order of the compiled functions."""
    return np.array([p[name] for name in NAMES])


def at_speed(p: dict[str, float], x: float, y: float, yaw: float, speed: float) -> np.ndarray:
    """The car at rest on its springs, straight ahead at a speed."""
    s = np.zeros(STATES)
    s[0], s[1], s[3], s[4] = x, y, speed, yaw
    front = p["m_s"] * GRAVITY * p["b"] / (p["a"] + p["b"]) + p["m_uf"] * GRAVITY
    rear = p["m_s"] * GRAVITY * p["a"] / (p["a"] + p["b"]) + p["m_ur"] * GRAVITY
    s[16], s[21] = front / (2.0 * p["K_zt"]), rear / (2.0 * p["K_zt"])
    # CommonRoad's `init_mb` leaves the body where its springs push it up; here they just carry it.
    s[8] = (s[21] - s[16]) / (p["a"] + p["b"])
    s[11] = s[16] + p["a"] * s[8]
    s[23:27] = speed / p["R_w"]
    return s


(
    _M, _MS, _MUF, _MUR, _A, _B, _IPHI, _IY, _IZ, _IXZ, _KSF, _KSDF, _KSR, _KSDR, _TF, _TR, _KRAS, _KTSF, _KTSR,
    _KRAD, _KZT, _HRAF, _HRAR, _HS, _IUF, _IUR, _IYW, _KLT, _RW, _TSB, _TSE, _DF, _DR, _EF, _ER,
    _CX, _DX1, _DX3, _EX, _KX, _HX, _VX, _RBX1, _RBX2, _RCX, _REX, _RHX,
    _CY, _DY1, _DY3, _EY, _KY, _HY1, _HY3, _VY1, _VY3, _RBY1, _RBY2, _RBY3, _RCY, _REY, _RHY,
    _RVY1, _RVY3, _RVY4, _RVY5, _RVY6, _AMAX, _VSWITCH,
    _SF, _SR, _FF, _FR, _RELAX, _MDRIVE, _CDA, _CSA, _XP, _DRAG, _MZ, _LEFT,
) = range(len(NAMES))  # fmt: skip


@njit(cache=True, inline="always")
def _bend(b, e, slip):
    """The inner arc of the Magic Formula."""
    return math.atan(b * slip - e * (b * slip - math.atan(b * slip)))


@njit(cache=True)
def _tyre(kappa, alpha, gamma, load, stiffness, friction, p):
    """Longitudinal and lateral force of a wheel in N; `kappa` is 1 - R w / u."""
    mu_x = friction * p[_DX1] * (1.0 - p[_DX3] * gamma * gamma)
    d_x = mu_x * load
    b_x = load * p[_KX] / (p[_CX] * d_x)
    f_x = d_x * math.sin(p[_CX] * _bend(b_x, p[_EX], -kappa + p[_HX]) + load * p[_VX])

    lean = 1.0 if gamma > 0.0 else (-1.0 if gamma < 0.0 else 0.0)
    shift = lean * (p[_HY1] + p[_HY3] * abs(gamma))
    lift = lean * load * (p[_VY1] + p[_VY3] * abs(gamma))
    mu_y = friction * p[_DY1] * (1.0 - p[_DY3] * gamma * gamma)
    d_y = mu_y * load
    b_y = stiffness * load * p[_KY] / (p[_CY] * d_y)
    f_y = d_y * math.sin(p[_CY] * _bend(b_y, p[_EY], alpha + shift)) + lift

    b = p[_RBX1] * math.cos(math.atan(p[_RBX2] * kappa))
    at_zero = math.cos(p[_RCX] * _bend(b, p[_REX], p[_RHX]))
    f_x *= math.cos(p[_RCX] * _bend(b, p[_REX], alpha + p[_RHX])) / at_zero
    b = p[_RBY1] * math.cos(math.atan(p[_RBY2] * (alpha - p[_RBY3])))
    at_zero = math.cos(p[_RCY] * _bend(b, p[_REY], p[_RHY]))
    d_v = mu_y * load * (p[_RVY1] + p[_RVY3] * gamma) * math.cos(math.atan(p[_RVY4] * alpha))
    f_y *= math.cos(p[_RCY] * _bend(b, p[_REY], kappa + p[_RHY])) / at_zero
    return f_x, f_y + d_v * math.sin(p[_RVY5] * math.atan(p[_RVY6] * kappa))


@njit(cache=True)
def rate(x, steer, accel, around, p, f, flow):
    """Writes the derivative of the state `x` into `f`, and specific forces into `flow`."""
    vx, yaw, r, roll, roll_rate, pitch, pitch_rate, vy = x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10]
    sin_d, cos_d = math.sin(steer), math.cos(steer)
    sin_r, cos_r = math.sin(roll), math.cos(roll)
    tracks, arms = (p[_TF], p[_TR]), (p[_A], -p[_B])

    # Slips and forces of the wheels: left front, right front, left rear, right rear.
    fx, fy, fz, down = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    for i in range(4):
        axle, left = i // 2, i % 2 == 0
        side = 1.0 if left else -1.0
        base = 13 + 5 * axle
        lean, lean_rate, height, sink = x[base], x[base + 1], x[base + 3], x[base + 4]
        track, arm = tracks[axle], arms[axle]
        half = 0.5 * track * side
        load = (height + p[_RW] * (math.cos(lean) - 1.0) - half * math.sin(lean)) * p[_KZT]
        along, across = vx + half * r, vy + arm * r
        rolling = along * cos_d + across * sin_d if axle == 0 else along
        rolling = max(rolling, 0.1)
        kappa = 1.0 - p[_RW] * x[23 + i] / rolling
        wanted = math.atan((across - lean_rate * (p[_RW] - height)) / along) - (steer if axle == 0 else 0.0)
        if p[_RELAX] > 0.0:
            alpha = x[29 + i]
            f[29 + i] = (wanted - alpha) * max(vx, 1.0) / p[_RELAX]
        else:
            alpha = wanted
            f[29 + i] = 0.0
        travel = (p[_HS] - p[_RW] + height - x[11]) / cos_r - p[_HS] + p[_RW] + arm * pitch + half * (roll - lean)
        travel_rate = sink - x[12] + arm * pitch_rate + half * (roll_rate - lean_rate)
        d, e = (p[_DF], p[_EF]) if axle == 0 else (p[_DR], p[_ER])
        gamma = roll + side * (d * travel + e * travel * travel)
        stiffness = (p[_SF] if axle == 0 else p[_SR]) * (p[_LEFT] if left else 1.0)
        friction = around[FRICTION] * (p[_FF] if axle == 0 else p[_FR])
        fx[i], fy[i] = _tyre(kappa, alpha, gamma, max(load, 1.0), stiffness, friction, p)
        fz[i] = load
        spring, damper, bar = (p[_KSF], p[_KSDF], p[_KTSF]) if axle == 0 else (p[_KSR], p[_KSDR], p[_KTSR])
        share = (p[_B] if axle == 0 else p[_A]) / (2.0 * (p[_A] + p[_B]))
        down[i] = p[_MS] * GRAVITY * share - travel * spring - travel_rate * damper + side * (roll - lean) * bar / track

    # Joints between body and axles.
    joint = np.empty(2)
    for axle in range(2):
        base = 13 + 5 * axle
        lean, lean_rate, across, height, sink = x[base], x[base + 1], x[base + 2], x[base + 3], x[base + 4]
        centre = (p[_HRAF] if axle == 0 else p[_HRAR]) - p[_RW]
        dz, dy = p[_HS] - p[_RW] + height - x[11], x[27 + axle]
        dy_rate = vy + arms[axle] * r - across
        gap = dz * sin_r - dy * cos_r - centre * math.sin(roll - lean)
        gap_rate = (
            (dz * cos_r + dy * sin_r) * roll_rate
            + (sink - x[12]) * sin_r
            - dy_rate * cos_r
            - centre * math.cos(roll - lean) * (roll_rate - lean_rate)
        )
        joint[axle] = gap * p[_KRAS] + gap_rate * p[_KRAD]
        f[27 + axle] = dy_rate

    # Air, in the car's axes: drag of the whole, side force on the body.
    sin_y, cos_y = math.sin(yaw), math.cos(yaw)
    air_x = vx - (around[WIND_X] * cos_y + around[WIND_Y] * sin_y)
    air_y = vy - (around[WIND_Y] * cos_y - around[WIND_X] * sin_y)
    air = 0.5 * AIR_DENSITY * math.sqrt(air_x * air_x + air_y * air_y)
    drag, push = -air * p[_CDA] * p[_DRAG] * air_x, -air * p[_CSA] * air_y

    front_x, front_y, front_out = fx[0] + fx[1], fy[0] + fy[1], fy[1] - fy[0]
    across_front = front_y * cos_d + front_x * sin_d
    pull = front_x * cos_d - front_y * sin_d + fx[2] + fx[3]
    turn = (
        across_front * p[_A]
        + 0.5 * p[_TF] * (front_out * sin_d + (fx[0] - fx[1]) * cos_d)
        + 0.5 * p[_TR] * (fx[2] - fx[3])
        - (fy[2] + fy[3]) * p[_B]
        + push * p[_XP]
        + p[_MZ] * min(abs(vx), 1.0)
    )
    springs = down[0] + down[1] + down[2] + down[3]
    body_y = (joint[0] + joint[1]) * cos_r + springs * sin_r
    body_l = 0.5 * p[_TF] * (down[0] - down[1]) + 0.5 * p[_TR] * (down[2] - down[3])
    for axle in range(2):
        base = 13 + 5 * axle
        centre = (p[_HRAF] if axle == 0 else p[_HRAR]) - p[_RW]
        arm = p[_HS] - x[11] - p[_RW] + x[base + 3] - centre * math.cos(x[base])
        body_l -= joint[axle] / cos_r * arm
    body_z = springs * cos_r - (joint[0] + joint[1]) * sin_r
    body_m = p[_A] * (down[0] + down[1]) - p[_B] * (down[2] + down[3]) + pull * (p[_HS] - x[11])

    side_g = GRAVITY * around[BANK]
    f[0] = vx * cos_y - vy * sin_y
    f[1] = vx * sin_y + vy * cos_y
    f[2] = 0.0
    specific_x = (pull + drag) / p[_M]
    f[3] = specific_x + r * vy - GRAVITY * around[GRADE]
    f[4] = r
    f[5] = (turn + p[_IXZ] / p[_IPHI] * body_l) / (p[_IZ] - p[_IXZ] * p[_IXZ] / p[_IPHI])
    f[6] = roll_rate
    f[7] = (p[_IXZ] / p[_IZ] * turn + body_l) / (p[_IPHI] - p[_IXZ] * p[_IXZ] / p[_IZ])
    f[8] = pitch_rate
    f[9] = body_m / p[_IY]
    specific_y = (body_y + push) / p[_MS]
    f[10] = specific_y - r * vx - side_g
    f[11] = x[12]
    f[12] = GRAVITY - body_z / p[_MS]
    for axle in range(2):
        base, i = 13 + 5 * axle, 2 * axle
        lean, height = x[base], x[base + 3]
        track = tracks[axle]
        mass, inertia = (p[_MUF], p[_IUF]) if axle == 0 else (p[_MUR], p[_IUR])
        centre = (p[_HRAF] if axle == 0 else p[_HRAR]) - p[_RW]
        lateral = across_front if axle == 0 else fy[2] + fy[3]
        held = down[i] + down[i + 1]
        moment = (
            0.5 * track * (down[i + 1] - down[i])
            - joint[axle] * centre
            + fz[i] * (p[_RW] * math.sin(lean) + 0.5 * track * math.cos(lean) - p[_KLT] * fy[i])
            - fz[i + 1] * (-p[_RW] * math.sin(lean) + 0.5 * track * math.cos(lean) + p[_KLT] * fy[i + 1])
            - lateral * (p[_RW] - height)
        )
        f[base] = x[base + 1]
        f[base + 1] = moment / inertia
        f[base + 2] = (lateral - joint[axle] * cos_r - held * sin_r) / mass - r * vx - side_g
        f[base + 3] = x[base + 4]
        f[base + 4] = GRAVITY - (fz[i] + fz[i + 1] + joint[axle] * sin_r - held * cos_r) / mass

    # Drive and brakes.
    limit = p[_AMAX] if vx <= p[_VSWITCH] else p[_AMAX] * p[_VSWITCH] / vx
    given = min(max(accel, -p[_AMAX]), limit)
    torque = p[_MDRIVE] * p[_RW] * given
    front = p[_TSE] if given > 0.0 else p[_TSB]
    for i in range(4):
        share = front if i < 2 else 1.0 - front
        f[23 + i] = (-p[_RW] * fx[i] + 0.5 * share * torque) / p[_IYW]
    flow[0], flow[1], flow[2] = specific_x, specific_y, f[5]


@njit(cache=True)
def observe(x, flow, arm, p, out):
    """What is true at the place on the road under a point `arm` forward of the CG.

    x, y, yaw, vx, vy, yaw_rate, ax, ay, roll, and nothing of a trailer. Pose and velocity are those of the axles
    below, which the body sways over; accelerations those that the body feels, leaning and diving.
    """
    sin_y, cos_y = math.sin(x[4]), math.cos(x[4])
    roll, dive = -x[6], -x[8]
    front = p[_B] / (p[_A] + p[_B])
    sway = front * x[27] + (1.0 - front) * x[28]
    vy = front * x[15] + (1.0 - front) * x[20]
    out[0], out[1] = x[0] + arm * cos_y + sway * sin_y, x[1] + arm * sin_y - sway * cos_y
    out[2], out[3], out[4], out[5] = x[4], x[3], vy + arm * x[5], x[5]
    fx, fy = flow[0] - arm * x[5] * x[5], flow[1] + arm * flow[2]
    out[6] = fx * math.cos(dive) - GRAVITY * math.sin(dive)
    out[7] = fy * math.cos(roll) + GRAVITY * math.sin(roll)
    out[8], out[9], out[10] = roll, 0.0, 0.0
