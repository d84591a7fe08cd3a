"""Nothing that leaves a step done ends a run.

Many hosts stop at any status but fmi2OK: a road with a note, a repeated point, missing or odd inputs must not look like
failures. The units are called here directly, by a host in C that stops at the first status that is not fmi2OK, and by
the hosts of other people.
"""

from __future__ import annotations

import math
import shutil
import struct
import subprocess
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from closed_loop import Unit
from fmpy import simulate_fmu
from instance import OK, STEP, UNITS, WARNING, Instance, Library
from test_same_drive import CAR, CONTROLLER, in_host
from wiring import SYSTEMS


def half_circle(i: int) -> str:
    """A point of a road with a half circle of 3 m radius."""
    angle = math.radians(10 * min(max(i - 50, 0), 18))
    along = min(i - 50, 0) - max(i - 68, 0)
    return f"{along + 3 * math.sin(angle):.4f},{3 - 3 * math.cos(angle):.4f}\n"


# Roads that are driven although there is something to say of them, and a word of what is said as a warning.
ROADS = {
    "bend": ("".join(half_circle(i) for i in range(120)), "tighter than the vehicle turns"),
    "corner": ("".join(f"{min(i, 100)},{max(0, i - 100)}\n" for i in range(200)), ""),
    "repeated point": ("".join(f"{min(i, 98)},0\n" for i in range(100)), ""),
}
STEPS = 100


@pytest.fixture
def road(request, tmp_path) -> Path:
    """The file of a road by its name above."""
    file = tmp_path / "road.csv"
    file.write_text(f"x,y\n{ROADS[request.param][0]}")
    return file


@pytest.mark.parametrize("name", UNITS)
def test_without_inputs(libraries, name):
    unit = Instance(libraries[name])
    assert unit.initialize() == OK, unit.said
    assert [unit.step(k * STEP) for k in range(STEPS)] == [OK] * STEPS, unit.said
    unit.free()


@pytest.mark.parametrize("name", UNITS)
def test_without_inputs_in_fmpy(fmus, name):
    result = simulate_fmu(str(fmus / f"{name}.fmu"), stop_time=STEPS * STEP, output_interval=STEP)
    assert len(result) == STEPS + 1


@pytest.mark.parametrize("road", ROADS, indirect=True)
@pytest.mark.parametrize("name", ["RflMpc", "TruckRflMpc"])
def test_road_that_gives_notes(libraries, name, road, request):
    unit = Instance(libraries[name])
    assert unit.set_string("path_file", road) == OK
    assert unit.initialize() == OK, unit.said
    assert ROADS[request.node.callspec.params["road"]][1] in unit.said
    assert [unit.step(k * STEP) for k in range(STEPS)] == [OK] * STEPS, unit.said
    unit.free()


@pytest.mark.parametrize("name", UNITS)
def test_input_out_of_its_range(libraries, name):
    unit = Instance(libraries[name])
    assert unit.initialize() == OK, unit.said
    assert unit.set_reals({unit.library.inputs[0]: 1e9}) == OK
    assert "outside its range" in unit.said
    assert [unit.step(k * STEP) for k in range(10)] == [OK] * 10, unit.said
    unit.free()


@pytest.mark.parametrize("road", ["bend"], indirect=True)
def test_warnings_are_statuses_for_who_asks(libraries, road):
    unit = Instance(libraries["RflMpc"])
    assert unit.set_booleans({"mpc.report_warnings": True}) == OK
    assert unit.set_string("path_file", road) == OK
    assert unit.initialize() == WARNING
    assert unit.set_reals({"x": 1e9}) == WARNING
    unit.free()


@pytest.mark.parametrize("name", UNITS)
def test_every_start_value_written_is_no_choice(libraries, name):
    """Some hosts write all start values before they initialise: the vehicle that is named then is the file's still."""
    other, shown = ("truck_real", "tractor.mass") if "Truck" in name else ("bmw_320i", "vehicle.mass")

    def mass(write_starts: bool) -> float:
        unit = Instance(libraries[name])
        for variable in unit.library.description.modelVariables if write_starts else []:
            if variable.causality == "parameter" and variable.type == "Real":
                assert unit.set_reals({variable.name: float(variable.start)}) == OK, unit.said
        assert unit.set_string("vehicle_file", other) == OK
        assert unit.initialize() == OK, unit.said
        value = unit.get_reals([shown])[0]
        unit.free()
        return value

    assert mass(True) == mass(False) != float(libraries[name].variables[shown].start)


@pytest.mark.parametrize("host", ["libcosim", "ecos"])
@pytest.mark.parametrize("road", ROADS, indirect=True)
def test_closed_loop_on_a_road_with_notes(fmus, tmp_path, road, host):
    parameters = {CONTROLLER: {"path_file": str(road)}, CAR: {"initial.vx": 5.0}}
    drive = in_host(host, fmus, tmp_path / "drive.json", parameters)
    assert all(np.isfinite(column).all() for column in drive.values())


class StrictHost:
    """The host in C: commands are gathered, then it runs them in one go."""

    def __init__(self, program: list[str], system: str, libraries: dict[str, Library], platform="linux64") -> None:
        self.program, self.units, self.lines = program, list(reversed(SYSTEMS[system])), []
        self.libraries = libraries
        suffix = {"linux64": ".so", "win64": ".dll"}[platform]
        for name in self.units:
            library = libraries[name]
            binary = library.folder / "binaries" / platform / f"{name}{suffix}"
            self.lines.append(
                f"unit {binary} {name} {library.description.guid} {(library.folder / 'resources').as_uri()}"
            )

    def vr(self, unit: str, name: str) -> str:
        return f"{self.units.index(unit)} {self.libraries[unit].variables[name].valueReference}"

    def wire(self) -> list[str]:
        """Connects all that has the same name, and shows what is connected."""
        plant, controller = self.units
        names = []
        for source, sink in [(plant, controller), (controller, plant)]:
            for name in self.libraries[sink].inputs:
                if name in self.libraries[source].outputs:
                    self.lines += [
                        f"wire {self.vr(source, name)} {self.vr(sink, name)}",
                        f"show {self.vr(source, name)}",
                    ]
                    names.append(name)
        return names

    def run(self) -> np.ndarray:
        """The shown values, a row for each step."""
        result = subprocess.run(
            self.program, input="\n".join(self.lines) + "\n", capture_output=True, text=True, check=False
        )
        assert result.returncode == 0, result.stderr
        rows = [line.split() for line in result.stdout.splitlines()]
        return np.array([[struct.unpack(">d", bytes.fromhex(cell))[0] for cell in row] for row in rows])


@pytest.fixture(scope="module")
def strict_host(tmp_path_factory) -> list[str]:
    """The host in C, compiled."""
    program = tmp_path_factory.mktemp("host") / "host"
    source = Path(__file__).parent / "host.c"
    subprocess.run(["cc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-o", program, source, "-ldl"], check=True)
    return [str(program)]


def start_of(fmus: Path, controller: str) -> dict[str, float]:
    """Where the controller's road begins, as the plant's parameters."""
    with closing(Unit(fmus / f"{controller}.fmu", "start")) as unit:
        unit.initialize()
        names = {"x": "x", "y": "y", "yaw": "yaw", "vx": "speed"}
        return {f"initial.{name}": unit.get(f"start.{start}") for name, start in names.items()}


def strict_drive(program: list[str], system: str, libraries, fmus: Path, steps: int, platform="linux64") -> np.ndarray:
    """A drive of the closed loop; at half time each state goes through its serialised form."""
    host = StrictHost(program, system, libraries, platform)
    plant = host.units[0]
    for name, value in start_of(fmus, host.units[1]).items():
        host.lines.append(f"real {host.vr(plant, name)} {value!r}")
    host.lines.append("init")
    host.wire()
    host.lines += [f"run {steps // 2} {STEP}", "carry 0", "carry 1", f"run {steps - steps // 2} {STEP}"]
    return host.run()


@pytest.mark.parametrize("system", SYSTEMS)
def test_closed_loop_in_a_strict_host(fmus, libraries, strict_host, system):
    drive = strict_drive(strict_host, system, libraries, fmus, 300)
    assert drive.shape[0] == 300 and np.isfinite(drive).all()
    assert np.ptp(drive[:, :2]) > 10.0, "the vehicle did not drive"


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("road", ROADS, indirect=True)
def test_odd_inputs_in_a_strict_host(libraries, strict_host, system, road):
    """No inputs, then one out of range, on a road with something to say of it."""
    host = StrictHost(strict_host, system, libraries)
    controller = host.units[1]
    host.lines += [
        f"string {host.vr(controller, 'path_file')} {road}",
        "init",
        f"show {host.vr(controller, 'steer_cmd')}",
    ]
    host.lines += [f"run 50 {STEP}"]
    host.lines += [f"real {host.vr(unit, libraries[unit].inputs[0])} 1e9" for unit in host.units]
    host.lines += [f"run 10 {STEP}"]
    assert len(host.run()) == 60


@pytest.mark.parametrize("system", SYSTEMS)
def test_windows_under_wine(fmus, libraries, tmp_path, strict_host, system):
    """The win64 libraries drive as those of Linux, where an FMU has them and wine is installed."""
    names = SYSTEMS[system]
    if not all((libraries[name].folder / "binaries/win64").is_dir() for name in names):
        pytest.skip("these FMUs have no win64 libraries: fmu-build --target linux64,win64")
    wine = shutil.which("wine64") or shutil.which("wine") or shutil.which("/usr/lib/wine/wine64")
    if wine is None:
        pytest.skip("wine is not installed")
    program = tmp_path / "host.exe"
    source = Path(__file__).parent / "host.c"
    compiler = ["python", "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu"]
    subprocess.run([*compiler, "-std=c11", "-o", program, source], check=True)
    here = strict_drive(strict_host, system, libraries, fmus, 1000)
    there = strict_drive([wine, str(program)], system, libraries, fmus, 1000, "win64")
    assert np.abs(here - there).max() <= 1e-9, np.abs(here - there).max()
