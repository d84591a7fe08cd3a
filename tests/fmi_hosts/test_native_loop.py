"""The loop in Rust (`rfl drive`) and the FMUs in fmpy are the same controller and vehicle: equal to the last bit."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest
from closed_loop import drive
from instance import CLOCKED
from native import read_log

DRIVES = [
    *((road, car) for road in ("sudoku_test", "hairpin_circuit") for car in ("c_class", "bmw_320i", "vw_vanagon")),
    *((road, truck) for road in ("off_road", "sudoku_turns") for truck in ("truck_simulation", "truck_real")),
]
NEEDED = {"time", "steer_cmd", "accel_cmd", "x", "y", "yaw", "vx", "vy", "yaw_rate", "e1", "e2", "station"}


@pytest.mark.parametrize(("road", "name"), DRIVES)
def test_native_loop_equals_fmpy_bit_for_bit(rfl, fmus, paths, tmp_path, road, name):
    path, log = paths / f"{road}.csv", tmp_path / "native.csv"
    vehicle = paths.parent / "vehicles" / f"{name}.toml"
    command = [rfl, "drive", "--path", path, "--vehicle", vehicle, "--duration", "60", "--log", log]
    result = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    native = read_log(log)

    driven = drive(path, vehicle, duration=60.0, fmus=fmus)
    # The same words, and in a log of its own the same column at the same place.
    driven.write_csv(tmp_path / "host.csv")
    host = read_log(tmp_path / "host.csv")
    assert np.array_equal(native.pop("status"), host["status"])
    ours = driven.columns
    shared = [name for name in native if name in ours and name != CLOCKED]
    needed = NEEDED | ({"articulation", "articulation_rate"} if name.startswith("truck") else set())
    assert needed <= set(shared), f"columns are missing: {needed - set(shared)}"
    for name in shared:
        assert len(native[name]) == len(ours[name])
        different = np.flatnonzero(native[name] != ours[name])
        assert not len(different), f"{name} differs first at row {different[0]}"


def test_learned_residual_equals_fmpy_bit_for_bit(rfl, fmus, paths, tmp_path):
    """Collect, train, drive: the model that `rfl train` wrote drives in the FMU as it does natively, and better."""
    slow = {"effect.steer_lag": 0.1, "effect.steer_delay": 0.06}
    settings = [text for name, value in slow.items() for text in ("--set", f"{name}={value}")]
    model, log, road = tmp_path / "residual.rflm", tmp_path / "native.csv", paths / "sudoku_turns.csv"
    for command in (
        ["collect", "--quiet", "--runs", "1", "--out", tmp_path, *settings],
        ["train", tmp_path / "drive_1.csv", "--quiet", "--no-proof", "--out", model],
        ["drive", "--quiet", "--path", road, "--residual", model, "--log", log, *settings],
    ):
        result = subprocess.run([str(c) for c in [rfl, *command]], capture_output=True, text=True, check=False)
        assert result.returncode == 0, result.stdout + result.stderr
    native = read_log(log)
    del native["status"]

    learned = drive(road, settings=slow | {"residual.file": str(model)}, fmus=fmus).columns
    nominal = drive(road, settings=slow, fmus=fmus).columns
    for name in set(native) & set(learned) - {CLOCKED}:
        assert np.array_equal(native[name], learned[name]), name
    assert np.abs(learned["e1"]).mean() < 0.7 * np.abs(nominal["e1"]).mean()
