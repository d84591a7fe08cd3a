"""One closed loop, three independent masters: the same trajectories.

libcosim and Ecos step both units in parallel on the values at t_k (Jacobi), as does fmpy's SSP master. So they must
agree with `closed_loop.py --jacobi` to the last bit, and with the Gauss-Seidel order to what one step of delay does.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from closed_loop import STEP, drive
from wiring import CAR, COMMANDS, CONTROLLER, RECORDED

HERE = Path(__file__).resolve().parent
STEPS = 3000  # one minute
ROADS = ["sudoku_test", "hairpin_circuit"]
PACKAGES = {"libcosim": "libcosimpy", "ecos": "ecospy"}


def in_fmpy(fmus, road=None, jacobi=True, settings=None):
    return drive(
        road,
        duration=STEPS * STEP,
        jacobi=jacobi,
        settings=settings,
        controller_fmu=fmus / "RflMpc.fmu",
        car_fmu=fmus / "PassengerCar.fmu",
    ).columns


def in_host(host: str, fmus: Path, out: Path, parameters=None, ssp=None) -> dict[str, np.ndarray]:
    """Runs a host in a process of its own; the columns begin after the first step."""
    if importlib.util.find_spec(PACKAGES[host]) is None:
        pytest.skip(f"{PACKAGES[host]} is not installed on this platform")
    command = [sys.executable, HERE / f"host_{host}.py", "--fmus", fmus, "--steps", str(STEPS), "--out", out]
    command += ["--step", str(STEP), "--parameters", json.dumps(parameters or {})]
    command += ["--ssp", ssp] if ssp else []
    # Ecos' library looks for TBB, which pip puts into the environment's lib folder.
    libraries = os.pathsep.join(filter(None, [str(Path(sys.prefix) / "lib"), os.environ.get("LD_LIBRARY_PATH")]))
    environment = os.environ | {"LD_LIBRARY_PATH": libraries}
    result = subprocess.run([str(c) for c in command], env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    return {name: np.array(values) for name, values in json.loads(out.read_text()).items()}


def assert_same_drive(host: dict[str, np.ndarray], fmpy: dict[str, np.ndarray]) -> None:
    """Row k of a host is what holds after its step k, which is fmpy's row k + 1."""
    assert np.ptp(fmpy["x"]) > 100.0, "the car did drive"
    for unit, names in ((CAR, RECORDED), (CONTROLLER, COMMANDS)):
        for name in names:
            ours = fmpy[name][1:]
            theirs = host[f"{unit}.{name}"][: len(ours)]
            worst = np.abs(theirs - ours).max()
            assert np.array_equal(theirs, ours), f"{unit}.{name} differs by up to {worst}"


@pytest.fixture(scope="module", params=ROADS)
def road(request, paths):
    return paths / f"{request.param}.csv"


@pytest.fixture(scope="module")
def jacobi(fmus, road):
    return in_fmpy(fmus, road)


@pytest.mark.parametrize("host", PACKAGES)
def test_two_fmus(host, fmus, road, jacobi, tmp_path):
    start = {f"initial.{name}": float(jacobi[name][0]) for name in ("x", "y", "yaw", "vx")}
    parameters = {CONTROLLER: {"path_file": str(road)}, CAR: {"road_file": str(road)} | start}
    assert_same_drive(in_host(host, fmus, tmp_path / "drive.json", parameters), jacobi)


def test_jacobi_delays_the_command_by_one_step(fmus, road, jacobi):
    """The controller, fed with the states of the Jacobi drive, answers with its commands: one row earlier."""
    from closed_loop import Unit

    unit = Unit(fmus / "RflMpc.fmu", "controller")
    unit.set("path_file", str(road))
    unit.initialize()
    names = unit.names("input")
    write, read = unit.writer(names), unit.reader(COMMANDS)
    answers = []
    for k in range(1000):
        write([jacobi[name][k] for name in names])
        unit.step(k * STEP, STEP)
        answers.append(read().copy())
    unit.close()
    for i, name in enumerate(COMMANDS):
        assert np.array_equal([row[i] for row in answers], jacobi[name][1:1001])


def test_one_step_of_delay_moves_the_car_little(fmus, road, jacobi):
    """How far the two master algorithms are apart: a command that comes 20 ms late."""
    direct = in_fmpy(fmus, road, jacobi=False)
    rows = min(len(direct["x"]), len(jacobi["x"]))
    apart = np.abs(direct["e1"][: rows - 1] - jacobi["e1"][1:rows]).max()
    print(f"{road.stem}: lateral error differs by at most {apart:.4f} m")
    assert 0.0 < apart < 0.10


@pytest.mark.parametrize("host", [*PACKAGES, "fmpy"])
def test_ssp(host, fmus, tmp_path):
    """The packed system, with the parameters that it carries: the car starts on the path."""
    ssp = fmus / "ClosedLoop.ssp"
    car_start = carried(ssp, "PassengerCar.initial.")
    assert len(car_start) == 4
    ours = in_fmpy(fmus, settings=car_start)
    theirs = in_fmpy_ssp(ssp) if host == "fmpy" else in_host(host, fmus, tmp_path / "drive.json", ssp=ssp)
    assert_same_drive(theirs, ours)


def parameter_set(ssp: Path):
    """The system's parameters, as they stand beside it for hosts that take them apart."""
    from fmpy.ssp.ssd import read_ssv

    return read_ssv(str(ssp), "resources/ClosedLoop.ssv")


def carried(ssp: Path, prefix: str) -> dict[str, float]:
    """Values of the car's parameters that the system sets."""
    of = {p.name: float(p.value) for p in parameter_set(ssp).parameters if p.name.startswith(prefix)}
    return {name.partition(".")[2]: value for name, value in of.items()}


def in_fmpy_ssp(ssp: Path) -> dict[str, np.ndarray]:
    """fmpy's SSP master is Jacobi, too, but all connectors begin with 0: the first step is made on zeros."""
    from fmpy.ssp.simulation import simulate_ssp

    result = simulate_ssp(str(ssp), stop_time=(STEPS - 0.5) * STEP, step_size=STEP, parameter_set=parameter_set(ssp))
    columns = {}
    for unit, names in ((CAR, RECORDED), (CONTROLLER, COMMANDS)):
        for name in names:
            columns[f"{unit}.{name}"] = result[f"{unit}.{name}"]
    return columns
