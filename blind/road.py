"""Random roads: bends of clothoids, straights and weaves, with a speed for every place.

A road is a curvature over arc length, integrated to places every `SPACING` metres. Roads may cross themselves: nothing
but the driver looks at them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

SPACING = 0.5  # m


@dataclass
class Road:
    """Columns along the road, one value every `SPACING` metres; SI units, ISO 8855."""

    x: np.ndarray
    y: np.ndarray
    yaw: np.ndarray
    curvature: np.ndarray
    speed: np.ndarray
    #: What the driver aims at left of the road: lane changes.
    aim: np.ndarray
    #: Factor on friction, and bank in rad, of the place itself (out-of-library causes only).
    friction: np.ndarray
    bank: np.ndarray

    def columns(self) -> tuple[np.ndarray, ...]:
        return self.x, self.y, self.yaw, self.speed, self.aim, self.friction, self.bank


def draw(
    rng: np.random.Generator,
    length: float,
    lateral: float,
    slow: float,
    fast: float,
    tightest: float,
    aims: float = 1.0,
) -> Road:
    """A road of a length in m, for speeds from `slow` to `fast` m/s with lateral accelerations about `lateral` m/s2.

    No bend is tighter than `tightest` m. `aims` scales the lane changes.
    """
    count = int(length / SPACING)
    curvature, cruise = np.zeros(count), np.zeros(count)
    at, side = 0, 1.0
    while at < count:
        speed = rng.uniform(slow, fast)
        kind = rng.choice(4, p=[0.5, 0.15, 0.25, 0.1])
        if kind == 0:  # a bend
            value = side * min(lateral * rng.uniform(0.5, 1.05) / speed**2, 1.0 / tightest)
            turn = rng.uniform(0.4, 2.2)
            piece = np.full(max(int(turn / abs(value) / SPACING), 20), value)
            side = -side if rng.random() < 0.8 else side
        elif kind == 1:  # a straight
            piece = np.zeros(int(rng.uniform(1.0, 4.0) * speed / SPACING))
        elif kind == 2:  # a weave: the lateral acceleration swings at 0.15 to 0.5 Hz
            waves = rng.integers(2, 5)
            wave = speed / rng.uniform(0.15, 0.5)
            top = min(0.8 * lateral * rng.uniform(0.4, 1.0) / speed**2, 1.0 / tightest)
            piece = top * side * np.sin(2.0 * math.pi * np.arange(0.0, waves * wave, SPACING) / wave)
        else:  # a long gentle bend
            value = side * lateral * rng.uniform(0.15, 0.4) / speed**2
            piece = np.full(int(rng.uniform(3.0, 6.0) * speed / SPACING), value)
            side = -side
        end = min(at + len(piece), count)
        curvature[at:end], cruise[at:end] = piece[: end - at], speed
        at = end
    curvature[: int(15.0 / SPACING)] = 0.0
    # Clothoids: bends grow over half a second at the mean speed.
    curvature = gaussian_filter1d(curvature, 0.18 * (slow + fast) / 2.0 / SPACING)
    yaw = np.concatenate([[0.0], np.cumsum(curvature[:-1]) * SPACING])
    yaw += rng.uniform(-math.pi, math.pi)
    x = np.concatenate([[0.0], np.cumsum(np.cos(yaw[:-1])) * SPACING])
    y = np.concatenate([[0.0], np.cumsum(np.sin(yaw[:-1])) * SPACING])
    return Road(x, y, yaw, curvature, _speeds(curvature, cruise, lateral), _aims(rng, count, aims),
                np.ones(count), np.zeros(count))  # fmt: skip


def _speeds(curvature: np.ndarray, cruise: np.ndarray, lateral: float) -> np.ndarray:
    """The cruising speed, less in bends, reached with ordinary accelerations."""
    speed = np.minimum(cruise, np.sqrt(1.1 * lateral / np.maximum(np.abs(curvature), 1e-6)))
    for i in range(1, len(speed)):
        speed[i] = min(speed[i], math.sqrt(speed[i - 1] ** 2 + 2.0 * 1.6 * SPACING))
    for i in range(len(speed) - 2, -1, -1):
        speed[i] = min(speed[i], math.sqrt(speed[i + 1] ** 2 + 2.0 * 2.2 * SPACING))
    return speed


def _aims(rng: np.random.Generator, count: int, scale: float) -> np.ndarray:
    """Lane changes: the driver's aim jumps every now and then, over some ten metres."""
    aim, at, value = np.zeros(count), 0, 0.0
    while at < count:
        end = min(at + int(rng.uniform(40.0, 160.0) / SPACING), count)
        aim[at:end] = value
        at, value = end, 0.0 if value and rng.random() < 0.6 else scale * rng.uniform(-1.8, 1.8)
    return gaussian_filter1d(aim, 4.0 / SPACING)
