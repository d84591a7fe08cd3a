"""One closed loop, independent masters: the same trajectories.

libcosim, Ecos, fmpy's SSP master and the one on fmuloader are all of the Jacobi kind: both units step on the other's
outputs at t_k, so the car gets its command one communication step late. `jacobi` below is that algorithm in a few
lines, with the two details in which hosts differ, and each host must agree with it to the last bit:

- how a host rounds the length of a step: Ecos and fmpy pass 0.02; libcosim counts nanoseconds and passes the difference
  of two rounded instants;
- what units read before the first step: libcosim and Ecos carry outputs over first, fmpy's SSP master leaves zeros.
"""

from __future__ import annotations

import functools
import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack, closing
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from closed_loop import STEP, Unit, drive
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssv
from wiring import COMMANDS, RECORDED, SYSTEMS, recorded

HERE = Path(__file__).resolve().parent
STEPS = 3000  # one minute
ROADS = ["sudoku_test", "hairpin_circuit"]
PACKAGES = {"libcosim": "libcosimpy", "ecos": "ecospy", "fmuloader": "fmuloader"}
CONTROLLER, CAR = SYSTEMS["ClosedLoop"]

Columns = dict[str, np.ndarray]


def exact_lengths() -> list[float]:
    return [STEP] * STEPS


def libcosim_lengths() -> list[float]:
    """Instants are whole nanoseconds; a length is the difference of two of them as floating-point seconds."""
    instants = [k * round(STEP * 1e9) / 1e9 for k in range(STEPS + 1)]
    return [end - begin for begin, end in pairwise(instants)]


@functools.cache
def jacobi(fmus: Path, road: Path | None, lengths: Callable[[], list[float]], zeros_first=False, system="ClosedLoop"):
    """The loop in Jacobi order; a row holds what is true after a step. Several tests look at one drive."""
    controller_name, vehicle_name = SYSTEMS[system]
    with ExitStack() as stack:
        controller = stack.enter_context(closing(Unit(fmus / f"{controller_name}.fmu", "controller")))
        vehicle = stack.enter_context(closing(Unit(fmus / f"{vehicle_name}.fmu", "vehicle")))
        if road:
            controller.set("path_file", str(road))
            vehicle.set("road_file", str(road))
        controller.initialize()
        for name, start in {"x": "x", "y": "y", "yaw": "yaw", "vx": "speed"}.items():
            vehicle.set(f"initial.{name}", controller.get(f"start.{start}"))
        vehicle.initialize()
        measured = controller.names("input")
        read_state, write_state = vehicle.reader(measured), controller.writer(measured)
        read_command, write_command = controller.reader(COMMANDS), vehicle.writer(COMMANDS)
        read_row = vehicle.reader(RECORDED)
        rows = []
        for k, length in enumerate(lengths()):
            state, command = read_state(), read_command()
            write_state(0 * state if zeros_first and k == 0 else state)
            write_command(0 * command if zeros_first and k == 0 else command)
            controller.step(k * STEP, length)
            vehicle.step(k * STEP, length)
            rows.append([*read_row(), *read_command()])
    return {f"{unit}.{name}": column for (unit, name), column in zip(recorded(system), np.array(rows).T)}


def in_host(host: str, fmus: Path, out: Path, parameters=None, system="ClosedLoop", ssp=None) -> Columns:
    """Runs a host in a process of its own."""
    if importlib.util.find_spec(PACKAGES[host]) is None:
        pytest.skip(f"{PACKAGES[host]} is not installed on this platform")
    command = [sys.executable, HERE / f"host_{host}.py", "--fmus", fmus, "--steps", str(STEPS), "--out", out]
    command += ["--system", system, "--step", str(STEP), "--parameters", json.dumps(parameters or {})]
    command += ["--ssp", ssp] if ssp else []
    # Ecos' library looks for TBB, which pip puts into the environment's lib folder.
    libraries = os.pathsep.join(filter(None, [str(Path(sys.prefix) / "lib"), os.environ.get("LD_LIBRARY_PATH")]))
    environment = os.environ | {"LD_LIBRARY_PATH": libraries}
    result = subprocess.run([str(c) for c in command], env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    return {name: np.array(values) for name, values in json.loads(out.read_text()).items()}


def in_fmpy_ssp(ssp: Path) -> Columns:
    parameters = read_ssv(str(ssp), f"resources/{ssp.stem}.ssv")
    # Half a step less: fmpy adds up the time, and must not make one step more for a rounding error.
    result = simulate_ssp(str(ssp), stop_time=(STEPS - 0.5) * STEP, step_size=STEP, parameter_set=parameters)
    return {f"{unit}.{name}": result[f"{unit}.{name}"] for unit, name in recorded(ssp.stem)}


def assert_same_drive(theirs: Columns, ours: Columns) -> None:
    driven = sum(np.ptp(column) for name, column in ours.items() if name.endswith((".x", ".y")))
    assert driven > 100.0, "the vehicle did not drive"
    for name, column in ours.items():
        assert len(theirs[name]) == len(column) == STEPS
        different = np.flatnonzero(theirs[name] != column)
        worst = np.abs(theirs[name] - column).max()
        assert not len(different), f"{name} differs first in step {different[0]}, at most by {worst}"


@pytest.fixture(scope="module", params=ROADS)
def road(request, paths) -> Path:
    return paths / f"{request.param}.csv"


@pytest.mark.parametrize(
    ("host", "lengths"),
    [("libcosim", libcosim_lengths), ("ecos", exact_lengths), ("fmuloader", exact_lengths)],
)
def test_two_fmus(fmus, road, tmp_path, host, lengths):
    ours = jacobi(fmus, road, lengths)
    with closing(Unit(fmus / "RflMpc.fmu", "start")) as controller:
        controller.set("path_file", str(road))
        controller.initialize()
        start = {n: controller.get(f"start.{m}") for n, m in {"x": "x", "y": "y", "yaw": "yaw", "vx": "speed"}.items()}
    car = {"road_file": str(road)} | {f"initial.{name}": value for name, value in start.items()}
    theirs = in_host(host, fmus, tmp_path / "drive.json", {CONTROLLER: {"path_file": str(road)}, CAR: car})
    assert_same_drive(theirs, ours)


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize(("host", "lengths"), [("libcosim", libcosim_lengths), ("ecos", exact_lengths)])
def test_ssp(fmus, tmp_path, host, lengths, system):
    theirs = in_host(host, fmus, tmp_path / "drive.json", system=system, ssp=fmus / f"{system}.ssp")
    assert_same_drive(theirs, jacobi(fmus, None, lengths, system=system))


@pytest.mark.parametrize("system", SYSTEMS)
def test_ssp_in_fmpy(fmus, system):
    theirs = in_fmpy_ssp(fmus / f"{system}.ssp")
    assert_same_drive(theirs, jacobi(fmus, None, exact_lengths, zeros_first=True, system=system))


def test_rounding_of_a_step_is_all_that_parts_libcosim_from_ecos(fmus, road):
    exact, rounded = jacobi(fmus, road, exact_lengths), jacobi(fmus, road, libcosim_lengths)
    worst = max(np.abs(exact[name] - rounded[name]).max() for name in exact)
    assert 0.0 < worst < 1e-9


@functools.cache
def gauss_seidel(fmus, road, **options) -> Columns:
    return drive(road, duration=STEPS * STEP, fmus=fmus, **options).columns


def test_script_to_copy_has_the_same_jacobi(fmus, road):
    """Row k of the script is what is true at t_k, so its rows begin one step earlier."""
    script, ours = gauss_seidel(fmus, road, jacobi=True), jacobi(fmus, road, exact_lengths)
    for name in RECORDED:
        np.testing.assert_array_equal(script[name][1:], ours[f"{CAR}.{name}"][: STEPS - 1])


def test_jacobi_delays_the_command_by_one_step(fmus, road):
    """The controller, told the states of the Jacobi drive, answers with that drive's commands, one row earlier."""
    driven = gauss_seidel(fmus, road, jacobi=True)
    with closing(Unit(fmus / "RflMpc.fmu", "controller")) as controller:
        controller.set("path_file", str(road))
        controller.initialize()
        names = controller.names("input")
        write, read = controller.writer(names), controller.reader(COMMANDS)
        answers = []
        for k in range(1000):
            write([driven[name][k] for name in names])
            controller.step(k * STEP, STEP)
            answers.append(read().copy())
    for i, name in enumerate(COMMANDS):
        np.testing.assert_array_equal([row[i] for row in answers], driven[name][1:1001])


def test_one_step_of_delay_moves_the_car_little(fmus, road):
    """What the choice of the master algorithm does: measured here, told in docs/fmus.md."""
    direct, delayed = gauss_seidel(fmus, road), gauss_seidel(fmus, road, jacobi=True)
    rows = min(len(direct["e1"]), len(delayed["e1"]))
    apart = np.abs(direct["e1"][: rows - 1] - delayed["e1"][1:rows]).max()
    assert 0.0 < apart < 0.03, f"lateral errors differ by up to {apart:.4f} m"
