"""Rows of the truck's tables, driven in fmpy through both FMUs: the same errors as natively, to the bit.

Each row predicts otherwise; plants are those of the tables, with their delay of the steering. Models are small and
drives short: what is compared is the same code with the same files and parameters in two hosts.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_loop import drive
from native import assert_same, read_log, run, settings

VEHICLE = "truck_simulation"
ROAD, SECONDS = "truck_off_road.csv", 20.0  # a straight, then bends
PLANTS = {
    "low_delay": {"effect.steer_delay": 0.04, "effect.steer_lag": 0.05},
    "high_delay": {"effect.steer_delay": 0.3, "effect.steer_lag": 0.2},
}
# What a nominal controller stands behind the long delay.
DAMPED = {"mpc.r_rate": 300.0, "mpc.q_e1_rate": 3.0, "mpc.q_e2": 1000.0}
OBSERVER = {"observer.disturbance_noise": 0.003, "observer.prediction_noise": 0.03}
PADE = {"actuator.dead_time_model": "pade_1_1"}
ROWS = {
    "MPC": ("none", {}),
    "RFL+S+observer": ("rfl_s", OBSERVER),
    "pade_1_1": ("actuator", PADE),
    "NMPC": ("nmpc", {}),
    "GP-NMPC": ("gp_nmpc", {}),
}


@pytest.fixture(scope="module", params=PLANTS)
def plant(request) -> str:
    return request.param


@pytest.fixture(scope="module")
def models(rfl, paths, plant, tmp_path_factory) -> Path:
    """Folder with a small model of each learned row, from a drive on the plant."""
    folder = tmp_path_factory.mktemp(plant)
    known = settings(PLANTS[plant])
    run(rfl, "collect", "--vehicle", VEHICLE, "--runs", 1, "--path", paths / ROAD, "--out", folder, "--quiet", *known)
    small = ["--trees", 3, "--depth", 3, "--points", 40, "--hyperparameter-samples", 100]
    for kind in (variant for variant, _ in ROWS.values() if variant in ("rfl_s", "gp_nmpc")):
        file = folder / f"{kind}.rflm"
        log = folder / "drive_1.csv"
        run(rfl, "train", log, "--vehicle", VEHICLE, "--kind", kind, "--out", file, "--quiet", "--no-proof", *small)
    return folder


@pytest.fixture(scope="module")
def driven() -> dict[str, np.ndarray]:
    """Commands of the rows driven so far, by plant and row."""
    return {}


@pytest.mark.parametrize("row", ROWS)
def test_row_has_the_same_errors_in_fmpy(rfl, fmus, paths, models, driven, tmp_path, plant, row):
    variant, more = ROWS[row]
    values = PLANTS[plant] | DAMPED | more
    if variant == "actuator":
        delay, lag = PLANTS[plant].values()
        values |= {"actuator.dead_time": delay, "actuator.time_constant": lag}
    road, log = paths / ROAD, tmp_path / "native.csv"
    command = ["drive", "--quiet", "--vehicle", VEHICLE, "--path", road, "--duration", SECONDS, "--log", log]
    run(rfl, *command, "--variant", variant, "--models", models, *settings(values))
    native = read_log(log)

    model = models / f"{variant}.rflm"
    named = {"controller.residual.file": str(model)} if model.is_file() else {}
    chosen = {"controller.variant": variant} | named
    ours = drive(road, VEHICLE, duration=SECONDS, settings=values | chosen, fmus=fmus).columns
    assert_same(native, ours)
    assert {"articulation", "articulation_rate"} <= set(native) & set(ours)
    mae = [float(np.abs(columns["e1"]).mean()) for columns in (native, ours)]
    assert mae[0] == mae[1] > 0.0
    # Each row is another controller.
    assert all(not np.array_equal(ours["steer_cmd"], other) for other in driven.values())
    driven[f"{plant} {row}"] = ours["steer_cmd"]
