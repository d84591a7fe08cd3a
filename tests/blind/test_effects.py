"""Every effect changes what is measured, in the direction that the library states."""

import numpy as np
import pytest

from blind import car, effects, road, sensors, truck_design, vehicles
from blind.cases import combined, start_and_drive
from blind.drive import DRIVER, Conditions

SAMPLE, TURN, PUSH, END = 0.02, 1.0, 6.0, 9.0
STEER = 0.03


def measured(is_truck, values):
    """Straight, a step to the left at 1 s, straight and faster from 6 s on; heading east with the wheel in hand."""
    rng = np.random.default_rng(1)
    design = truck_design.design(rng) if is_truck else vehicles.design_car("bmw", rng)
    names = effects.TOLERANCES | (effects.OF_TRUCKS if is_truck else {})
    background = {name: 1.0 if name in effects.FACTORS else 0.0 for name in names}
    whole = combined(background, values)
    count = 800
    x = np.arange(count) * road.SPACING
    way = road.Road(x, 0 * x, 0 * x, 0 * x, np.full(count, 15.0), 0 * x, np.ones(count), 0 * x)
    time = np.arange(0.0, END, SAMPLE)
    steer = np.where((time >= TURN) & (time < PUSH - 1.0), STEER, 0.0)
    accel = np.where(time >= PUSH, 0.8, 0.0)
    conditions = Conditions(way, np.ones(len(DRIVER)), END, SAMPLE, np.zeros((len(time), 2)), np.zeros(5))
    truth = start_and_drive(vehicles.build(design, whole), conditions, (steer, accel))
    assert truth.arrived
    found = sensors.placed(truth, whole)
    found["time"] = np.arange(len(truth.steer)) * truth.h
    return found


def mean(signal, begin, end):
    return lambda m: float(np.mean(m[signal][(m["time"] >= begin) & (m["time"] < end)]))


EARLY, STEADY, STRAIGHT = (TURN, TURN + 0.4), (3.0, 4.9), (0.3, 0.9)
# Effect, value, what is looked at, whether it grows (+1) or shrinks (-1).
CARS = [
    ("steer_delay", 0.1, mean("yaw_rate", *EARLY), -1),
    ("steer_delay", 0.1, mean("steer", *EARLY), -1),
    ("steer_lag", 0.1, mean("steer", *EARLY), -1),
    ("steer_rate_limit", 0.05, mean("steer", *EARLY), -1),
    ("steer_backlash", 0.02, mean("steer", *STEADY), -1),
    ("steer_offset", 0.01, mean("yaw_rate", *STEADY), +1),
    ("steer_gain", 1.1, mean("yaw_rate", *STEADY), +1),
    ("tyre_stiffness_front", 1.3, mean("yaw_rate", *STEADY), +1),
    ("tyre_stiffness_rear", 1.3, mean("yaw_rate", *STEADY), -1),
    ("road_friction", 0.4, mean("yaw_rate", *STEADY), -1),
    ("tyre_relaxation", 2.0, mean("ay", *EARLY), -1),
    ("payload", 300.0, mean("ax", PUSH + 1.0, END), -1),
    ("cg_shift", 0.2, mean("yaw_rate", *STEADY), -1),
    ("yaw_inertia", 1.8, mean("yaw_rate", *EARLY), -1),
    ("roll_stiffness", 1.5, mean("roll", *STEADY), -1),
    ("road_bank", 0.04, mean("vy", *STRAIGHT), -1),
    ("road_grade", 0.04, mean("vx", *STRAIGHT), -1),
    ("wind_x", 12.0, mean("vx", *STRAIGHT), +1),
    ("wind_y", 12.0, mean("ay", *STRAIGHT), +1),
    ("drag", 3.0, mean("vx", *STRAIGHT), -1),
    ("drive_lag", 0.4, mean("ax", PUSH, PUSH + 0.4), -1),
    ("drive_gain", 1.2, mean("ax", PUSH + 1.0, END), +1),
    ("brake_pull", 400.0, mean("yaw_rate", *STRAIGHT), +1),
    ("yaw_rate_bias", 0.02, mean("yaw_rate", *STRAIGHT), +1),
    ("lateral_accel_bias", 0.3, mean("ay", *STRAIGHT), +1),
    ("sensor_delay", 0.1, mean("yaw_rate", *EARLY), -1),
    ("speed_scale", 1.05, mean("vx", *STRAIGHT), +1),
    ("imu_lever_arm", 1.0, mean("ay", TURN, TURN + 0.2), +1),
    ("heading_misalignment", 0.03, mean("vy", *STRAIGHT), -1),
    ("heading_misalignment", 0.03, mean("yaw", *STRAIGHT), +1),
]
TRUCKS = [
    ("trailer_payload", 6000.0, mean("ax", PUSH + 1.0, END), -1),
    ("trailer_stiffness", 1.4, mean("articulation", *STEADY), +1),
    ("hitch_offset", 0.3, mean("articulation", *STEADY), -1),
    ("articulation_friction", 10000.0, mean("articulation", *EARLY), -1),
    ("articulation_bias", 0.02, mean("articulation", *STRAIGHT), +1),
    *[row for row in CARS if row[0] not in ("payload", "brake_pull", "road_friction")],
    ("payload", 2000.0, mean("ax", PUSH + 1.0, END), -1),
    ("brake_pull", 5000.0, mean("yaw_rate", *STRAIGHT), +1),
    ("road_friction", 0.3, mean("yaw_rate", *STEADY), -1),
]


@pytest.fixture(scope="module")
def plain():
    return {is_truck: measured(is_truck, {}) for is_truck in (False, True)}


def check(plain, is_truck, effect, value, look, sign):
    values = {effect: value} | ({"payload_x": 0.0} if effect == "payload" else {})
    change = look(measured(is_truck, values)) - look(plain[is_truck])
    assert sign * change > 1e-6, change


@pytest.mark.parametrize(("effect", "value", "look", "sign"), CARS)
def test_an_effect_of_a_car_acts_as_stated(plain, effect, value, look, sign):
    check(plain, False, effect, value, look, sign)


@pytest.mark.parametrize(("effect", "value", "look", "sign"), TRUCKS)
def test_an_effect_of_a_truck_acts_as_stated(plain, effect, value, look, sign):
    check(plain, True, effect, value, look, sign)


def test_every_effect_is_looked_at():
    assert {row[0] for row in CARS} == set(effects.ids(False))
    assert {row[0] for row in TRUCKS} == set(effects.ids(True))


def test_ids_are_those_of_the_diagnosis():
    """The words of the labels are the library's, its neutral values are ours."""
    import re

    text = (vehicles.ROOT / "src" / "vehicle" / "effects.rs").read_text(encoding="utf-8")
    theirs = dict(re.findall(r"^    (\w+) [A-Z_0-9]+ neutral ([\w.]+),", text, re.M))
    theirs.pop("payload_x")
    assert set(theirs) == set(effects.OF)
    for id, neutral in theirs.items():
        assert effects.OF[id].neutral == (1e6 if neutral == "NO_RATE_LIMIT" else float(neutral))
    assert car.GRAVITY == 9.81
