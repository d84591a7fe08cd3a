"""What is put into a blind vehicle: effects with the values that are drawn, tolerances, causes outside the library.

Ids, units and signs are those of the diagnosis' library (`rfl diagnose --explain`); how they act on the blind
vehicles is in vehicles.py and sensors.py. Values are drawn between `least` and `most`, in the distance from neutral,
on a logarithmic scale; the drawn case then has to have a dominance between 0.2 and 10 (cases.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Effect:
    """An effect of the library: neutral value, distances from it that are drawn upwards and downwards."""

    id: str
    neutral: float
    up: tuple[float, float] | None
    down: tuple[float, float] | None
    #: Range for trucks where it is another one.
    truck: tuple[tuple[float, float] | None, tuple[float, float] | None] | None = None

    def draw(self, rng: np.random.Generator, is_truck: bool) -> float:
        up, down = self.truck if is_truck and self.truck else (self.up, self.down)
        ways = [(way, sign) for way, sign in ((up, 1.0), (down, -1.0)) if way]
        (least, most), sign = ways[rng.integers(len(ways))]
        return self.neutral + sign * math.exp(rng.uniform(math.log(least), math.log(most)))


# Upwards, downwards; factors as distances from 1.
LIBRARY = (
    Effect("steer_delay", 0.0, (0.03, 0.25), None),
    Effect("steer_lag", 0.0, (0.04, 0.3), None),
    Effect("steer_rate_limit", 1e6, None, None),
    Effect("steer_backlash", 0.0, (0.006, 0.04), None),
    Effect("steer_offset", 0.0, (0.004, 0.03), (0.004, 0.03)),
    Effect("steer_gain", 1.0, (0.03, 0.25), (0.03, 0.25)),
    Effect("tyre_stiffness_front", 1.0, (0.12, 0.7), (0.1, 0.4)),
    Effect("tyre_stiffness_rear", 1.0, (0.12, 0.7), (0.08, 0.3)),
    Effect("road_friction", 1.0, None, (0.15, 0.65)),
    Effect("tyre_relaxation", 0.0, (0.8, 3.0), None, ((1.0, 4.0), None)),
    Effect("payload", 0.0, (80.0, 500.0), None, ((600.0, 4000.0), None)),
    Effect("cg_shift", 0.0, (0.05, 0.25), (0.05, 0.2), ((0.1, 0.4), (0.1, 0.35))),
    Effect("yaw_inertia", 1.0, (0.15, 0.9), (0.12, 0.4)),
    Effect("roll_stiffness", 1.0, (0.15, 0.9), (0.15, 0.4)),
    Effect("road_bank", 0.0, (0.012, 0.08), (0.012, 0.08)),
    Effect("road_grade", 0.0, (0.012, 0.06), (0.012, 0.06)),
    Effect("wind_x", 0.0, (3.0, 15.0), (3.0, 15.0)),
    Effect("wind_y", 0.0, (3.0, 15.0), (3.0, 15.0)),
    Effect("drag", 1.0, (0.4, 4.0), (0.3, 0.8)),
    Effect("drive_lag", 0.0, (0.08, 0.6), None),
    Effect("drive_gain", 1.0, (0.06, 0.3), (0.06, 0.3)),
    Effect("brake_pull", 0.0, (60.0, 700.0), (60.0, 700.0), ((600.0, 7000.0), (600.0, 7000.0))),
    Effect("yaw_rate_bias", 0.0, (0.004, 0.03), (0.004, 0.03)),
    Effect("lateral_accel_bias", 0.0, (0.09, 0.8), (0.09, 0.8)),
    Effect("sensor_delay", 0.0, (0.02, 0.15), None),
    Effect("speed_scale", 1.0, (0.015, 0.08), (0.015, 0.08)),
    Effect("imu_lever_arm", 0.0, (0.2, 1.5), (0.2, 1.5)),
    Effect("heading_misalignment", 0.0, (0.01, 0.06), (0.01, 0.06)),
    Effect("trailer_payload", 0.0, None, None, ((1500.0, 14000.0), None)),
    Effect("trailer_stiffness", 1.0, None, None, ((0.15, 0.7), (0.12, 0.4))),
    Effect("hitch_offset", 0.0, None, None, ((0.08, 0.4), (0.08, 0.4))),
    Effect("articulation_friction", 0.0, None, None, ((2000.0, 12000.0), None)),
    Effect("articulation_bias", 0.0, None, None, ((0.006, 0.04), (0.006, 0.04))),
)
OF = {effect.id: effect for effect in LIBRARY}
TRAILER = ("trailer_payload", "trailer_stiffness", "hitch_offset", "articulation_friction", "articulation_bias")
# Rate limits are drawn between these, rad/s.
RATE_LIMITS = (0.06, 0.35)


def ids(is_truck: bool) -> list[str]:
    """The effects that cars, or trucks, can have."""
    return [effect.id for effect in LIBRARY if is_truck or effect.id not in TRAILER]


def draw(rng: np.random.Generator, effect: str, is_truck: bool) -> dict[str, float]:
    """An effect with a random value; with a payload comes its place."""
    if effect == "steer_rate_limit":
        low, high = (math.log(limit) for limit in RATE_LIMITS)
        return {effect: math.exp(rng.uniform(low, high))}
    value = {effect: OF[effect].draw(rng, is_truck)}
    if effect == "payload":
        value["payload_x"] = rng.uniform(-1.2, 0.6)
    return value


# Tolerances of an ordinary simulator, standard deviations: careful measurement of mass (3 % with fuel and people),
# axle stiffness (4 %), clocks (10 ms), a level road (0.25 deg). Factors relative, the rest in SI units.
TOLERANCES = {
    "mass": 0.03, "yaw_inertia": 0.05, "cg_shift": 0.02, "cg_height": 0.05, "tyre_stiffness_front": 0.04,
    "tyre_stiffness_rear": 0.04, "road_friction": 0.04, "friction_rear": 0.03, "tyre_relaxation": 0.25,
    "roll_stiffness": 0.07, "spring_front": 0.10, "road_bank": 0.0044, "road_grade": 0.0044, "wind_x": 0.7,
    "wind_y": 0.7, "drag": 0.10, "steer_delay": 0.010, "steer_lag": 0.010, "steer_gain": 0.010,
    "steer_offset": 0.0017, "drive_lag": 0.03, "drive_gain": 0.02, "brake_pull": 4.0, "yaw_rate_bias": 0.0012,
    "lateral_accel_bias": 0.03, "sensor_delay": 0.005, "speed_scale": 0.005, "imu_lever_arm": 0.05,
    "heading_misalignment": 0.003, "yaw_rate_scale": 0.004, "ay_scale": 0.008, "ax_bias": 0.05, "roll_bias": 0.003,
}  # fmt: skip
OF_TRUCKS = {
    "trailer_mass": 0.03, "trailer_yaw_inertia": 0.05, "trailer_stiffness": 0.04, "hitch_offset": 0.02,
    "articulation_friction": 300.0, "articulation_bias": 0.002, "brake_pull": 40.0,
}  # fmt: skip
# These are factors: neutral 1.
FACTORS = {effect.id for effect in LIBRARY if effect.neutral == 1.0} | {
    "mass", "cg_height", "friction_rear", "tyre_relaxation", "spring_front", "yaw_rate_scale", "ay_scale",
    "trailer_mass", "trailer_yaw_inertia",
}  # fmt: skip
# These cannot be less than nothing.
POSITIVE = {"sensor_delay", "articulation_friction"}


def background(rng: np.random.Generator, is_truck: bool) -> dict[str, float]:
    """A random vehicle within tolerances, none beyond two deviations. `tyre_relaxation` is a factor here."""
    found = {}
    for name, tolerance in (TOLERANCES | OF_TRUCKS if is_truck else TOLERANCES).items():
        drawn = float(np.clip(rng.normal(), -2.0, 2.0)) * tolerance
        drawn = abs(drawn) if name in POSITIVE else drawn
        found[name] = drawn + (1.0 if name in FACTORS else 0.0)
    return found


# Causes that the library does not have; what they do is in cases.py. Their strength is drawn between 0.5 and 1.
OUTSIDE = (
    "second_order_steering", "friction_patch", "intermittent_delay", "sticking_command", "variable_ratio", "gusts",
    "bank_patch", "braking_pull", "one_sided_tyres",
)  # fmt: skip
OUTSIDE_OF_TRUCKS = OUTSIDE[:-1]
