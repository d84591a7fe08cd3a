"""Worlds that no prior made: how a wild set differs from a usual one.

A usual set draws its tolerances from `effects.py`, as the prior of the diagnosis has them. A wild set has, drawn once:
tolerances of 0.5 to 2 times these, with heavy tails and correlations; tyres of another shape; a vehicle file with a
catalogue's errors. Every drive has crown, banked bends and roughness, and wind that gusts; every logger has its
conventions: level or body frame, roll of either sign, late columns, outliers, gaps, milliseconds, degrees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from . import effects
from .road import SPACING, Road
from .vehicles import Design

GRAVITY = 9.81
# What goes together in a built vehicle: a heavier one has more inertia, one rubber is on both axles.
TOGETHER = (
    ("mass", "yaw_inertia", "trailer_mass", "trailer_yaw_inertia"),
    ("tyre_stiffness_front", "tyre_stiffness_rear", "trailer_stiffness"),
    ("road_friction", "friction_rear"),
)
SHARED = 0.6  # correlation within a group
FREEDOM = 3.0  # of Student's t
FARTHEST = 5.0  # deviations: beyond is no vehicle that passes a works' gate


@dataclass(frozen=True)
class World:
    """What is the same for all cases of a wild set."""

    #: Factor on each tolerance.
    widths: dict[str, float]

    def background(self, rng: np.random.Generator, is_truck: bool) -> dict[str, float]:
        """A random vehicle: heavy tails, correlations."""
        tolerances = effects.TOLERANCES | effects.OF_TRUCKS if is_truck else effects.TOLERANCES
        shared = {name: group for group in TOGETHER for name in group}
        common = {group: rng.normal() for group in TOGETHER}
        found = {}
        for name, tolerance in tolerances.items():
            own = rng.normal()
            if name in shared:
                own = math.sqrt(SHARED) * common[shared[name]] + math.sqrt(1.0 - SHARED) * own
            # A tolerance is a standard deviation, and that of Student's t is more than 1.
            heavy = own / math.sqrt(rng.chisquare(FREEDOM) / (FREEDOM - 2.0))
            off = float(np.clip(heavy, -FARTHEST, FARTHEST)) * tolerance * self.widths[name]
            off = abs(off) if name in effects.POSITIVE else off
            neutral = 1.0 if name in effects.FACTORS else 0.0
            # A factor that would turn its sign is no vehicle's.
            found[name] = max(neutral + off, 0.2) if neutral else off
        return found


def world(rng: np.random.Generator) -> World:
    """Draws the world of a set."""
    names = {**effects.TOLERANCES, **effects.OF_TRUCKS}
    return World({name: math.exp(rng.uniform(math.log(0.5), math.log(2.0))) for name in names})


def reshaped(design: Design, rng: np.random.Generator) -> Design:
    """A car whose tyres have another curve than its file says; the slope at the origin stays."""
    if design.is_truck:
        return design
    p = dict(design.p)
    p["p_cy1"] = max(1.05, p["p_cy1"] * rng.uniform(0.85, 1.15))
    p["p_ey1"] = min(0.9, p["p_ey1"] + rng.uniform(-1.0, 0.5))
    return replace(design, p=p)


def as_catalogued(design: Design, rng: np.random.Generator) -> Design:
    """What a user knows of a car from a catalogue: stiffness and inertia within 10 %, height of the CG within 5 %."""
    if design.is_truck:
        return design
    p = dict(design.p)
    for name, error in (("stiffness_f", 0.10), ("stiffness_r", 0.10), ("I_z", 0.10), ("I_Phi_s", 0.10), ("h_s", 0.05)):
        p[name] *= 1.0 + error * float(np.clip(rng.normal(), -2.0, 2.0))
    return replace(design, p=p)


def surfaced(way: Road, rng: np.random.Generator) -> Road:
    """A road with crown that comes and goes, bends that are banked inwards, and roughness."""
    count = len(way.x)

    def wander(length: float, size: float) -> np.ndarray:
        noise = gaussian_filter1d(rng.normal(size=count), length / SPACING, mode="wrap")
        return size * noise / noise.std()

    crown = wander(rng.uniform(20.0, 60.0), rng.uniform(0.005, 0.02)) + rng.uniform(-0.01, 0.02)
    # Right side low is positive: a left bend is banked to the left.
    inward = -np.clip(0.3 * way.curvature * way.speed**2 / GRAVITY, -0.06, 0.06) * rng.uniform(0.0, 1.0)
    return replace(way, bank=crown + gaussian_filter1d(inward, 15.0 / SPACING) + wander(2.0, rng.uniform(0.0, 0.004)))


def gusts(samples: int, sample: float, rng: np.random.Generator) -> np.ndarray:
    """Events of a drive: wind about its mean, as far as trees and houses let it, m/s."""
    events = np.zeros((samples, 4))
    keep = math.exp(-sample / rng.uniform(1.0, 3.0))
    for column in (0, 1):
        size, unrest = rng.uniform(0.3, 1.5), rng.normal(size=samples) * math.sqrt(1.0 - keep**2)
        for k in range(1, samples):
            unrest[k] += keep * unrest[k - 1]
        events[:, column] = size * unrest
    return events


@dataclass(frozen=True)
class Conventions:
    """How a logger writes what its sensors say."""

    level: bool
    roll_sign: float
    #: Lateness of the satellite receiver's columns, s.
    late: float
    outliers: float  # share of the rows
    gap: bool
    milliseconds: bool
    degrees: bool
    seed: int

    def words(self) -> list[str]:
        """What is not as the documentation asks."""
        all_ = {
            "level frame": self.level, "roll to the other side": self.roll_sign < 0.0, "late place": self.late > 0.0,
            "outliers": self.outliers > 0.0, "gap": self.gap, "ms": self.milliseconds, "degrees": self.degrees,
        }  # fmt: skip
        return [name for name, is_so in all_.items() if is_so]


def conventions(rng: np.random.Generator) -> Conventions:
    """Draws a logger: most have one or two of these."""
    has = lambda share: bool(rng.random() < share)  # noqa: E731
    return Conventions(
        has(0.3), -1.0 if has(0.15) else 1.0, rng.uniform(0.02, 0.08) if has(0.2) else 0.0,
        0.001 if has(0.25) else 0.0, has(0.2), has(0.15), has(0.15), int(rng.integers(2**31)),
    )  # fmt: skip


RECEIVER = ("x", "y", "yaw", "vx", "vy")


def written(columns: dict[str, np.ndarray], felt: np.ndarray, how: Conventions) -> dict[str, np.ndarray]:
    """A log as this logger writes it. `felt`: what of gravity an accelerometer feels sideways in each row, m/s2."""
    rng = np.random.default_rng(how.seed)
    found = {name: np.array(column) for name, column in columns.items()}
    if how.level and "ay" in found:
        found["ay"] = found["ay"] - felt
    if "roll" in found:
        found["roll"] *= how.roll_sign
    if how.late > 0.0:
        for name in RECEIVER:
            if name in found:
                found[name] = np.interp(found["time"] - how.late, found["time"], found[name])
    rows = len(found["time"])
    if how.outliers > 0.0:
        names = [name for name in found if name not in ("time", "steer_cmd", "accel_cmd")]
        for row in rng.choice(rows, max(1, round(how.outliers * rows)), replace=False):
            name = names[rng.integers(len(names))]
            found[name][row] += rng.choice([-1.0, 1.0]) * 30.0 * max(found[name].std(), 1e-3)
    if how.gap:
        first = int(rows * rng.uniform(0.3, 0.7))
        lost = slice(first, first + int(rng.uniform(0.3, 1.5) / np.median(np.diff(found["time"]))))
        found = {name: np.delete(column, lost) for name, column in found.items()}
    if how.degrees:
        for name in ("yaw", "yaw_rate", "roll"):
            if name in found:
                found[name] = np.degrees(found[name])
    if how.milliseconds:
        found["time"] = 1e3 * found["time"]
    return found
