"""What `rfl diagnose` writes, used by others: its parameter set in fmpy, and the blind demo."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssv

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def found(rfl, paths, tmp_path_factory):
    """The diagnosis of a car that steers late."""
    folder = tmp_path_factory.mktemp("diagnosis")
    late = ["--set", "effect.steer_delay=0.12", "--log", "late.csv"]
    drive = [rfl, "drive", "--quiet", "--duration", "45", "--path", paths / "sudoku_turns.csv", *late]
    subprocess.run(drive, cwd=folder, check=True)
    result = subprocess.run([rfl, "diagnose", "late.csv", "--quiet", "--out", "."], cwd=folder, check=False)
    assert result.returncode == 3
    return folder


def driven(fmus: Path, start_values: dict) -> np.ndarray:
    """The car's yaw rate after a step of the steering."""
    step = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 0.05), (4.0, 0.05)], dtype=[("time", float), ("steer_cmd", float)])
    result = fmpy.simulate_fmu(
        str(fmus / "PassengerCar.fmu"),
        stop_time=4.0,
        output_interval=0.02,
        input=step,
        output=["yaw_rate"],
        start_values=start_values | {"initial.vx": 12.0},
    )
    return result["yaw_rate"]


def test_fmpy_applies_the_parameter_set(found, fmus):
    # read_ssv validates against the standard's schema.
    values = {parameter.name: parameter.value for parameter in read_ssv(str(found / "calibrated.ssv")).parameters}
    assert float(values["effect.steer_delay"]) == pytest.approx(0.12, abs=0.03)
    calibrated, given = driven(fmus, values), driven(fmus, {})
    assert np.abs(calibrated - given).max() > 0.05
    # The vehicle file means the same.
    from_file = driven(fmus, {"vehicle_file": str(found / "calibrated.toml")})
    assert np.abs(calibrated - from_file).max() < 1e-6


def test_the_set_for_the_system_names_the_component(found):
    names = [parameter.name for parameter in read_ssv(str(found / "system.ssv")).parameters]
    assert "PassengerCar.effect.steer_delay" in names and all(name.startswith("PassengerCar.") for name in names)


def test_the_demo_opens_its_draw_after_the_diagnosis(rfl, fmus, tmp_path):
    command = [sys.executable, ROOT / "scripts" / "diagnose_demo.py", "--seed", "3", "--duration", "40", "--rfl", rfl]
    command += ["--fmus", fmus, "--out", tmp_path, "--path", ROOT / "paths" / "sudoku_turns.csv"]
    result = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout.index("drawn and sealed") < result.stdout.index("The draw is opened")
    demo, report = (json.loads((tmp_path / name).read_text()) for name in ("demo.json", "report.json"))
    assert demo["verdict"] in ("right", "in the class", "wrong")
    assert demo["named"] == [effect["id"] for effect in report["verdict"]["effects"]]
    # Nothing of the draw reaches the diagnosis: only what a test car records.
    header = (tmp_path / "drive.csv").read_text().splitlines()[0].split(",")
    assert header == ["time", "steer_cmd", "accel_cmd", "x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay", "steer"]
    files = report["inputs"]["files"]
    assert {"log", "path"} <= set(files)
    assert not any("draw" in Path(file["file"]).name for file in files.values())
