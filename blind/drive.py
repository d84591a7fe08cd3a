"""Drives a blind vehicle: driver or recorded commands, steering and drive chains, vehicle, wind and road.

    command -> dead time -> lag, rate limit -> (second order) -> backlash -> sensor -> gain, cubic, offset -> wheels

One compiled loop of even steps `h`; the vehicle by the classic Runge-Kutta method. Commands hold over the steps of a
sample. Dead times are whole steps. Sensors come later, in sensors.py: what is recorded here is true.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from . import car, truck
from .road import SPACING, Road

CAR, TRUCK = 0, 1
SIGNALS = ("x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay", "roll", "articulation", "articulation_rate")
STEPS = {CAR: 0.002, TRUCK: 0.004}  # s
BENT = 0.06  # rad, from which on a variable ratio varies no more
LOST = 12.0  # m from the road
# The chains' numbers.
CHAIN = [
    "dead_time", "lag", "rate_limit", "backlash", "gain", "offset", "angle_limit", "drive_lag", "drive_gain",
    "natural", "damping", "cubic", "brake_moment",
]  # fmt: skip
(_DEAD, _LAG, _RATE, _PLAY, _GAIN, _OFFSET, _LIMIT, _DRIVELAG, _DRIVEGAIN, _NATURAL, _DAMPING, _CUBIC, _PULL) = range(
    len(CHAIN)
)
# The driver's numbers.
DRIVER = [
    "preview", "wheelbase", "understeer", "lag", "integral", "noise", "noise_time", "speed_gain", "speed_noise",
    "brake", "push",
]  # fmt: skip
(_PREVIEW, _BASE, _UNDER, _DLAG, _INTEGRAL, _NOISE, _NTIME, _SPEEDGAIN, _SPEEDNOISE, _BRAKE, _PUSH) = range(len(DRIVER))


@dataclass
class Conditions:
    """What is the same for every vehicle on a drive."""

    road: Road
    driver: np.ndarray  # DRIVER
    duration: float  # s
    sample: float  # s, of the commands
    noise: np.ndarray  # (samples, 2) standard normal: the driver's unrest
    around: np.ndarray  # bank, grade, friction, wind_x, wind_y
    #: Over time, one row a sample: wind added to east and north (m/s), dead time added (s), 1 where the command sticks.
    events: np.ndarray = field(default_factory=lambda: np.zeros((1, 4)))


@dataclass
class Truth:
    """A drive as it was, sampled every `h`."""

    h: float
    signals: np.ndarray  # (steps, SIGNALS)
    steer: np.ndarray  # what a sensor at the actuator would read
    steer_cmd: np.ndarray  # (samples,)
    accel_cmd: np.ndarray
    station: np.ndarray
    offset: np.ndarray  # m left of the road
    #: Whether it stayed on the road and upright.
    arrived: bool


def drive(
    kind: int, p: np.ndarray, chain: np.ndarray, start: np.ndarray, conditions: Conditions, arm: float,
    commands: tuple[np.ndarray, np.ndarray] | None = None,
) -> Truth:  # fmt: skip
    """Drives along the road, or with recorded commands; signals belong to the point `arm` m forward of the CG."""
    h = STEPS[kind]
    samples = round(conditions.duration / conditions.sample)
    steer, accel = commands if commands else (np.zeros(samples), np.zeros(samples))
    steer, accel = steer.copy(), accel.copy()
    per = round(conditions.sample / h)
    signals, angle, places = np.zeros((samples * per, len(SIGNALS))), np.zeros(samples * per), np.zeros((samples, 2))
    events = conditions.events if len(conditions.events) >= samples else np.zeros((samples, 4))
    done = _loop(
        kind, p, chain, start.copy(), conditions.road.columns(), conditions.driver, h, per, conditions.noise,
        conditions.around.copy(), events, arm, commands is not None, steer, accel, signals, angle, places,
    )  # fmt: skip
    return Truth(h, signals, angle, steer, accel, places[:, 0], places[:, 1], done == samples)


@njit(cache=True)
def locate(mind, x, y, road):
    """Moves the driver's place on the road (`mind[0]`) to the nearest one ahead; gives the distance left of it, m."""
    best, last = 1e18, int(mind[0])
    at = last
    for i in range(max(last - 4, 0), min(last + 60, len(road[0]))):
        gap = (road[0][i] - x) ** 2 + (road[1][i] - y) ** 2
        if gap < best:
            best, at = gap, i
    mind[0] = at
    return -(x - road[0][at]) * math.sin(road[2][at]) + (y - road[1][at]) * math.cos(road[2][at])


@njit(cache=True)
def hands(mind, left, x, y, yaw, vx, road, driver, unrest, jerk, sample, answer):
    """A preview driver's steering angle and acceleration.

    The arc through a point of the road ahead, at the vehicle's own understeer; an integral against steady offsets;
    unrest; a slow hand. `mind` holds the place on the road, the integral, the unrest and the hand.
    """
    road_x, road_y, road_yaw, speed, aim = road[0], road[1], road[2], road[3], road[4]
    at = int(mind[0])
    ahead = min(at + int(max(driver[_PREVIEW] * vx, 6.0) / SPACING), len(road_x) - 1)
    tx = road_x[ahead] - aim[ahead] * math.sin(road_yaw[ahead]) - x
    ty = road_y[ahead] + aim[ahead] * math.cos(road_yaw[ahead]) - y
    side = -tx * math.sin(yaw) + ty * math.cos(yaw)
    lead = driver[_BASE] + driver[_UNDER] * vx * vx
    mind[1] += sample * min(max(aim[at] - left, -1.0), 1.0)
    keep = math.exp(-sample / driver[_NTIME])
    mind[2] = keep * mind[2] + math.sqrt(1.0 - keep * keep) * unrest
    wanted = lead * (2.0 * side / max(tx * tx + ty * ty, 25.0) + driver[_INTEGRAL] * mind[1])
    wanted += lead * driver[_NOISE] * mind[2] / max(vx * vx, 36.0)
    mind[3] = wanted + math.exp(-sample / driver[_DLAG]) * (mind[3] - wanted)
    near = min(at + int(0.6 * vx / SPACING), len(road_x) - 1)
    push = driver[_SPEEDGAIN] * (speed[near] - vx) + driver[_SPEEDNOISE] * jerk
    answer[0], answer[1] = mind[3], min(max(push, -driver[_BRAKE]), driver[_PUSH])


@njit(cache=True)
def _rate(kind, y, steer, accel, around, p, f, flow):
    if kind == 0:
        car.rate(y, steer, accel, around, p, f, flow)
    else:
        truck.rate(y, steer, accel, around, p, f, flow)


@njit(cache=True)
def _loop(
    kind, p, chain, y, road, driver, h, per, noise, around, events, arm, replay,
    steer_cmd, accel_cmd, signals, angle, places,
):  # fmt: skip
    """Gives the number of samples driven."""
    friction, bank = road[5], road[6]
    samples, n = len(steer_cmd), len(y)
    k1, k2, k3, k4, z = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    flow, out = np.zeros(4), np.zeros(11)
    sample = per * h
    held, mind, answer = 0.0, np.zeros(4), np.zeros(2)
    actuator, geared, geared_rate, free, given = 0.0, 0.0, 0.0, 0.0, 0.0
    bank0, friction0, wind_x0, wind_y0 = around[0], around[2], around[3], around[4]
    keep_lag = math.exp(-h / chain[_LAG]) if chain[_LAG] > 0.0 else 0.0
    keep_drive = math.exp(-h / chain[_DRIVELAG]) if chain[_DRIVELAG] > 0.0 else 0.0
    most = chain[_RATE] * h
    for k in range(samples):
        vx = y[3]
        yaw = y[4]
        left = locate(mind, y[0], y[1], road)
        at = int(mind[0])
        places[k, 0], places[k, 1] = at * SPACING, left
        if not replay:
            if abs(left) > LOST or not math.isfinite(vx) or vx < 2.0:
                return k
            hands(mind, left, y[0], y[1], yaw, vx, road, driver, noise[k, 0], noise[k, 1], sample, answer)
            steer_cmd[k] = min(max(answer[0], -chain[_LIMIT]), chain[_LIMIT])
            accel_cmd[k] = answer[1]
        around[0] = bank0 + bank[at]
        around[2] = friction0 * friction[at]
        around[3], around[4] = wind_x0 + events[k, 0], wind_y0 + events[k, 1]
        dead = math.floor((chain[_DEAD] + events[k, 2]) / h + 0.5)
        for j in range(per):
            step = k * per + j
            # The command that arrives now.
            when = step - dead
            if events[k, 3] == 0.0:
                held = steer_cmd[when // per] if when >= 0 else 0.0
            target = min(max(held, -chain[_LIMIT]), chain[_LIMIT])
            wish = target + keep_lag * (actuator - target)
            actuator += min(max(wish - actuator, -most), most)
            if chain[_NATURAL] > 0.0:
                w = chain[_NATURAL]
                geared_rate += h * (w * w * (actuator - geared) - 2.0 * chain[_DAMPING] * w * geared_rate)
                geared += h * geared_rate
            else:
                geared = actuator
            half = 0.5 * chain[_PLAY]
            free = min(max(free, geared - half), geared + half)
            bent = chain[_CUBIC] * free * free * free / (1.0 + (free / BENT) ** 2)
            wheel = chain[_GAIN] * (free + bent) + chain[_OFFSET]
            asked = chain[_DRIVEGAIN] * accel_cmd[k]
            given = asked + keep_drive * (given - asked)
            if kind == 0:
                y[2] = wheel
            moment = chain[_PULL] * max(-given, 0.0)

            _rate(kind, y, wheel, given, around, p, k1, flow)
            k1[5] += moment
            angle[step] = free
            if kind == 0:
                car.observe(y, flow, arm, p, out)
            else:
                truck.observe(y, flow, arm, p, out)
            for i in range(11):
                signals[step, i] = out[i]
            for i in range(n):
                z[i] = y[i] + 0.5 * h * k1[i]
            _rate(kind, z, wheel, given, around, p, k2, flow)
            k2[5] += moment
            for i in range(n):
                z[i] = y[i] + 0.5 * h * k2[i]
            _rate(kind, z, wheel, given, around, p, k3, flow)
            k3[5] += moment
            for i in range(n):
                z[i] = y[i] + h * k3[i]
            _rate(kind, z, wheel, given, around, p, k4, flow)
            k4[5] += moment
            for i in range(n):
                y[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
            if replay and y[3] < 2.0:
                y[3] = 2.0
            if kind == 0:
                for i in range(23, 27):
                    y[i] = max(y[i], 0.0)
            if not (abs(y[3]) < 80.0 and abs(y[5]) < 4.0):
                return k
    return samples
