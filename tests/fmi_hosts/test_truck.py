"""The truck's FMU alone: every way leads to the same bits, in this interface and in a host."""

from __future__ import annotations

import math

import fmpy
import numpy as np
import pytest
from instance import OK, STEP, WARNING, Instance

START = {"initial.vx": 12.0, "effect.steer_delay": 0.3, "effect.sensor_delay": 0.05}


def command(k: int) -> dict[str, float]:
    return {"steer_cmd": 0.05 * math.sin(0.02 * k), "accel_cmd": 0.3 * math.cos(0.013 * k)}


def start(library) -> Instance:
    truck = Instance(library)
    assert truck.set_reals(START) == OK
    assert truck.initialize() <= WARNING, truck.said
    return truck


def drive(truck: Instance, first: int, last: int) -> list[list[float]]:
    rows = []
    for k in range(first, last):
        assert truck.set_reals(command(k)) == OK
        assert truck.step(k * STEP) <= WARNING, truck.said
        rows.append(truck.get_reals(truck.library.outputs))
    return rows


@pytest.fixture(scope="module")
def library(libraries):
    return libraries["SemiTrailerTruck"]


@pytest.fixture(scope="module")
def reference(library) -> list[list[float]]:
    truck = start(library)
    rows = drive(truck, 0, 400)
    truck.free()
    assert rows[-1] != rows[0]
    return rows


def test_reset_starts_anew(library, reference):
    truck = start(library)
    drive(truck, 0, 123)
    assert truck.reset() == OK
    assert truck.set_reals(START) == OK
    assert truck.initialize() <= WARNING
    assert drive(truck, 0, 400) == reference
    truck.free()


def test_saved_and_serialised_states_continue(library, reference):
    truck, other = start(library), start(library)
    drive(truck, 0, 150)
    state = truck.save()
    data = truck.serialize(state)
    assert drive(truck, 150, 400) == reference[150:]
    assert truck.restore(state) == OK, truck.said
    assert drive(truck, 150, 400) == reference[150:]
    status, copy = other.deserialize(data)
    assert status == OK, other.said
    assert other.restore(copy) == OK, other.said
    assert drive(other, 150, 400) == reference[150:]
    assert truck.free_state(state) == OK and other.free_state(copy) == OK
    truck.free()
    other.free()


def test_fmpy_drives_the_same_bits(fmus, library, reference):
    signals = [(k * STEP, *command(k).values()) for k in range(401)]
    inputs = np.array(signals, dtype=[(name, float) for name in ("time", "steer_cmd", "accel_cmd")])
    result = fmpy.simulate_fmu(
        str(fmus / "SemiTrailerTruck.fmu"),
        stop_time=400 * STEP,
        step_size=STEP,
        output_interval=STEP,
        start_values=START,
        input=inputs,
        output=library.outputs,
    )
    ours = dict(zip(library.outputs, np.array(reference).T))
    for name in library.outputs:
        # fmpy interpolates inputs at instants that it sums up itself: equal but for rounding.
        assert np.allclose(result[name][1:], ours[name], rtol=1e-9, atol=1e-9), name


def test_both_trucks_and_the_steps_length(library):
    ends = []
    for length in (0.02, 0.01, 0.1):
        truck = Instance(library)
        assert truck.set_string("vehicle_file", "truck_real") == OK
        assert truck.set_reals({"initial.vx": 15.0}) == OK
        assert truck.initialize() <= WARNING, truck.said
        assert truck.get_reals(["trailer.mass"]) == [8000.0]
        assert truck.set_reals({"steer_cmd": 0.02, "accel_cmd": 0.2}) == OK
        for k in range(round(4.0 / length)):
            assert truck.step(k * length, length) <= WARNING, truck.said
        ends.append(truck.get_reals(["x", "y", "yaw", "articulation", "trailer.x", "trailer.y"]))
        truck.free()
    assert np.allclose(ends[1], ends[0], rtol=0, atol=1e-6) and np.allclose(ends[2], ends[0], rtol=0, atol=1e-6)
