"""FMUs of FMI 3.0: what is in them, what hosts make of them, and the same drives as those of 2.0, bit for bit."""

from __future__ import annotations

import re
import subprocess
import zipfile
from pathlib import Path

import fmpy
import fmpy.validation
import pytest
from fmpy import simulate_fmu
from instance import DISCARD, ERROR, OK, STEP, UNITS, VERSIONS, WARNING, ClosedLoop
from lxml import etree
from test_package import fmutool_reports_nothing
from test_same_drive import assert_same_drive, in_host
from wiring import SYSTEMS

PACKAGE = Path(fmpy.__file__).parent
HEADER = (PACKAGE / "c-code" / "fmi3Functions.h").read_text()
SYMBOLS = set(re.findall(r"fmi3FullName\((fmi3\w+)\)", HEADER))
assert len(SYMBOLS) == 75
ROOT = Path(__file__).resolve().parents[2]
ROADS = {"ClosedLoop": "sudoku_test", "TruckLoop": "off_road"}


@pytest.fixture(scope="module")
def libraries(of_version):
    return of_version("3.0")


def schema_holds(schema: str, content: bytes) -> None:
    etree.XMLSchema(file=str(PACKAGE / "schema" / "fmi3" / schema)).assertValid(etree.fromstring(content))


@pytest.mark.parametrize("name", UNITS)
def test_fmpy_validation_reports_nothing(fmus, name):
    assert fmpy.validation.validate_fmu(str(fmus / "fmi3" / f"{name}.fmu")) == []


@pytest.mark.parametrize("name", UNITS)
def test_fmutool_check_reports_nothing(fmus, name):
    fmutool_reports_nothing(fmus / "fmi3" / f"{name}.fmu", "3.0")


@pytest.mark.parametrize("name", UNITS)
def test_descriptions_keep_to_the_schema(fmus, name):
    with zipfile.ZipFile(fmus / "fmi3" / f"{name}.fmu") as package:
        description = package.read("modelDescription.xml")
        terminals = package.read("terminalsAndIcons/terminalsAndIcons.xml")
        icon = package.read("terminalsAndIcons/icon.png")
        files = package.namelist()
    schema_holds("fmi3ModelDescription.xsd", description)
    schema_holds("fmi3TerminalsAndIcons.xsd", terminals)
    assert icon.startswith(b"\x89PNG")
    assert "documentation/index.html" in files and f"binaries/x86_64-linux/{name}.so" in files
    assert description == (ROOT / "modelDescription" / "fmi3" / f"{name}.xml").read_bytes()


@pytest.mark.parametrize("name", UNITS)
def test_binary_exports_the_standards_functions_and_nothing_else(libraries, name):
    command = ["nm", "-D", "--defined-only", libraries[name].binary]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert {line.split()[-1] for line in told.splitlines()} == SYMBOLS


@pytest.mark.parametrize("name", UNITS)
def test_variables_are_those_of_2_0_bytes_and_time(libraries, of_version, name):
    library, old = libraries[name], of_version("2.0")[name].variables
    ours = library.variables
    scalars = library.in_scalars(ours)
    new = [name for name in ("residual.data", "time") if name in ours]
    assert sorted(scalars) == sorted([*old, *new])
    assert list(ours)[-len(new) :] == new
    kinds = {"Real": "Float64", "Integer": "Int32"}
    for variable in list(ours.values())[: -len(new)]:
        # An array has the reference, and all else, of its first element.
        before = old[library.in_scalars([variable.name])[0]]
        assert variable.type == kinds.get(before.type, before.type), variable.name
        same = ("valueReference", "causality", "variability", "initial", "start", "unit", "min", "max")
        for attribute in same:
            assert getattr(variable, attribute) == getattr(before, attribute), (variable.name, attribute)


@pytest.mark.parametrize(
    ("name", "arrays"),
    {
        "RflMpc": {f"predicted.{what}": 30 for what in ("x", "y", "e1")},
        "TruckRflMpc": {f"predicted.{what}": 60 for what in ("x", "y", "e1")},
        "PassengerCar": {f"wheel.{what}": 4 for what in ("load", "slip", "slip_angle", "speed")},
        "SemiTrailerTruck": {f"wheel.{what}": 6 for what in ("load", "slip", "slip_angle", "speed")},
    }.items(),
)
def test_what_belongs_together_is_an_array(libraries, name, arrays):
    library = libraries[name]
    assert {name: library.size(name) for name in library.variables if library.size(name) > 1} == arrays


def test_arrays_in_fmpy(fmus):
    """The wheels' loads carry the car."""
    file = str(fmus / "fmi3" / "PassengerCar.fmu")
    result = simulate_fmu(file, stop_time=1.0, output_interval=0.5, output=["wheel.load"])
    loads = result["wheel.load"]
    assert loads.shape == (3, 4)
    mass = next(v for v in fmpy.read_model_description(file).modelVariables if v.name == "vehicle.mass")
    assert loads[-1].sum() == pytest.approx(float(mass.start) * 9.81, rel=0.01)


@pytest.mark.parametrize("version", VERSIONS)
def test_terminals_of_a_system_fit(of_version, version):
    """What a controller asks for, its vehicle has, by the names of the members. FMI 2.0.4 has the folder, too."""
    libraries = of_version(version)
    for controller, vehicle in SYSTEMS.values():
        buses = []
        for name in (controller, vehicle):
            tree = etree.parse(str(libraries[name].folder / "terminalsAndIcons" / "terminalsAndIcons.xml"))
            schema_holds("fmi3TerminalsAndIcons.xsd", etree.tostring(tree))
            members = {t.get("name"): {m.get("memberName") for m in t} for t in tree.iter("Terminal")}
            assert all(member in libraries[name].variables for bus in members.values() for member in bus)
            buses.append(members)
        assert set(buses[0]) == set(buses[1]) == {"pose", "motion", "command"}
        assert all(buses[0][bus] <= buses[1][bus] for bus in buses[0])


@pytest.mark.parametrize("name", UNITS)
def test_in_fmpy(fmus, name):
    result = simulate_fmu(str(fmus / "fmi3" / f"{name}.fmu"), stop_time=100 * STEP, output_interval=STEP)
    assert len(result) == 101


@pytest.mark.parametrize("host", ["fmuloader", "ecos"])
@pytest.mark.parametrize("system", SYSTEMS)
def test_drives_in_other_hosts_are_those_of_2_0(fmus, tmp_path, host, system):
    """`test_same_drive.py` holds them equal to our own loop with 2.0."""
    drives = [
        in_host(host, fmus / folder, tmp_path / f"{version}.json", system=system)
        for version, folder in VERSIONS.items()
    ]
    assert_same_drive(drives[1], drives[0])


@pytest.mark.parametrize("system", SYSTEMS)
def test_drives_are_those_of_2_0(of_version, paths, system):
    """All real outputs over a minute."""
    drives = []
    for version in VERSIONS:
        loop = ClosedLoop(of_version(version), paths / f"{ROADS[system]}.csv", system)
        libraries = [unit.library for unit in loop.units]
        names = [f"{i} {n}" for i, lib in enumerate(libraries) for n in lib.in_scalars(lib.outputs)]
        drives.append([dict(zip(names, row, strict=True)) for row in loop.drive(3000)])
        drives[-1].append([unit.get_integer(n) for unit in loop.units for n in ("status",)])
        loop.free()
    assert drives[0] == drives[1]
    assert drives[0][-2] != drives[0][0]


def test_a_long_step_ends_where_the_status_changes(libraries):
    """A car that starts to roll; one host allows it, the other does not."""
    ends = []
    for ends_early in (True, False):
        unit = libraries["PassengerCar"].make(ends_early=ends_early)
        assert unit.initialize() == OK
        before = unit.get_integer("status")
        assert unit.set_reals({"accel_cmd": 1.0}) == OK
        assert unit.step(0.0, 1.0) == OK
        assert unit.get_integer("status") != before
        ends.append((unit.last_successful_time.value, unit.flags[2].value))
        unit.free()
    assert 0.0 < ends[0][0] < 0.5 and ends[0][1]
    assert ends[1] == (1.0, False)


def test_early_ends_in_fmpy(fmus):
    file = str(fmus / "fmi3" / "PassengerCar.fmu")
    drive = {"stop_time": 2.0, "output_interval": 0.5, "start_values": {"accel_cmd": 1.0}, "output": ["vx"]}
    whole, early = (simulate_fmu(file, early_return_allowed=allowed, **drive)["time"] for allowed in (False, True))
    assert set(whole) < set(early) and len(early) == len(whole) + 1


def test_a_model_of_too_many_bytes_is_refused(libraries):
    unit = libraries["RflMpc"].make()
    most = 64 << 20
    assert unit.set_binary("residual.data", bytes(most + 1)) == DISCARD
    assert f"takes {most} at most" in unit.said
    assert unit.get_binary("residual.data") == b""
    assert unit.initialize() <= WARNING, unit.said
    unit.free()


def test_time_is_a_variable(libraries):
    unit = libraries["PassengerCar"].make()
    unit.setup(start=2.0)
    assert (unit.enter(), unit.exit()) == (OK, OK), unit.said
    assert unit.get_reals(["time"]) == [2.0]
    state = unit.save()
    assert unit.step(2.0) == OK
    assert unit.get_reals(["time"]) == [2.0 + STEP]
    assert unit.last_successful_time.value == 2.0 + STEP and not any(flag.value for flag in unit.flags)
    assert unit.restore(state) == OK
    assert unit.get_reals(["time"]) == [2.0]
    assert unit.set_reals({"time": 0.0}) == ERROR
    unit.free()


@pytest.mark.parametrize("name", ["RflMpc", "TruckRflMpc"])
def test_resources_are_found_however_hosts_name_the_folder(libraries, name):
    folder = libraries[name].folder / "resources"
    for resources in (str(folder), f"{folder}/", folder.as_uri()):
        unit = libraries[name].make(resources=resources)
        assert unit.initialize() <= WARNING, unit.said
        assert unit.get_reals(["path.length"])[0] > 100.0
        unit.free()


def test_an_instance_of_another_fmu_is_refused_with_the_reason(libraries):
    unit = libraries["PassengerCar"].make(token="{00000000-0000-0000-0000-000000000000}")
    assert unit.handle is None
    assert "instantiation token" in unit.said and "unpack the FMU anew" in unit.said
