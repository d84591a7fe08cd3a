"""FMUs that are there, with other resources and start values: no compiler, no cargo, and they drive."""

from __future__ import annotations

import os
import shutil
import subprocess
import zipfile
from contextlib import closing
from pathlib import Path

import fmpy.validation
import numpy as np
import programs
import pytest
from closed_loop import Unit
from instance import OK, Library
from native import run
from test_same_drive import in_fmpy_ssp
from wiring import SYSTEMS


@pytest.fixture(scope="module")
def fmu_build() -> Path:
    return programs.program("fmu-build")


def change(fmu_build: Path, folder: Path, *arguments) -> subprocess.CompletedProcess:
    """Runs the packer where no other program is to be found."""
    command = [str(argument) for argument in (fmu_build, *arguments)]
    empty = {name: os.environ[name] for name in ("TMPDIR",) if name in os.environ}
    return subprocess.run(command, cwd=folder, env=empty, capture_output=True, text=True, check=False)


def start_values(fmu: Path) -> str:
    with zipfile.ZipFile(fmu) as package:
        return package.read("resources/start.toml").decode()


@pytest.mark.parametrize("system", SYSTEMS)
def test_road_and_vehicle_go_into_fmus_and_ssp(fmu_build, fmus, paths, tmp_path, system):
    controller, plant = SYSTEMS[system]
    road, vehicle = paths / "sudoku_turns.csv", "truck_real" if system == "TruckLoop" else "bmw_320i"
    for name in (controller, plant):
        shutil.copy(fmus / f"{name}.fmu", tmp_path)
    made = change(
        fmu_build, tmp_path, f"{plant}.fmu", f"{controller}.fmu", "--start", f"{controller}.path_file={road}",
        "--vehicle", vehicle, "--out", "packed",
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    packed = tmp_path / "packed"
    with closing(Unit(packed / f"{controller}.fmu", "unit")) as unit:
        unit.initialize()
        assert unit.get("vehicle_file") == vehicle
        begin = unit.get("start.x"), unit.get("start.y")
    drive = in_fmpy_ssp(packed / f"{system}.ssp")
    assert np.hypot(drive[f"{plant}.x"][0] - begin[0], drive[f"{plant}.y"][0] - begin[1]) < 1.0
    assert np.ptp(drive[f"{plant}.x"]) > 20.0


def parameters_in_effect(fmu: Path) -> dict[str, tuple]:
    """Declared starts and values after an initialisation."""
    with closing(Unit(fmu, "unit")) as unit:
        unit.initialize()
        variables = unit.description.modelVariables
        numbers = [v for v in variables if v.causality == "parameter" and v.type in ("Real", "Integer", "Enumeration")]
        return {v.name: (float(v.start), unit.get(v.name)) for v in numbers}


@pytest.mark.parametrize("system", SYSTEMS)
def test_an_fmu_drives_with_its_declared_starts(fmu_build, fmus, tmp_path, system):
    """As shipped, and with a vehicle and start values packed in, also the library's own."""
    controller, plant = SYSTEMS[system]
    vehicle = "truck_real" if system == "TruckLoop" else "genesis"
    given = [fmus / f"{name}.fmu" for name in (plant, controller)]
    shipped = {name: parameters_in_effect(fmus / f"{name}.fmu") for name in (plant, controller)}
    mass = "trailer.mass" if system == "TruckLoop" else "vehicle.mass"
    chosen = {f"{plant}.{mass}": shipped[plant][mass][0], f"{controller}.actuator.time_constant": 0.0}
    starts = [word for name, value in chosen.items() for word in ("--start", f"{name}={value}")]
    made = change(fmu_build, tmp_path, *given, "--vehicle", vehicle, *starts, "--out", "packed")
    assert made.returncode == 0, made.stderr
    for name in (plant, controller):
        packed = parameters_in_effect(tmp_path / "packed" / f"{name}.fmu")
        for values in (shipped[name], packed):
            assert {key: value for key, value in values.items() if value[0] != value[1]} == {}
        assert packed != shipped[name]
        for key, value in chosen.items():
            if key.startswith(f"{name}."):
                assert packed[key.removeprefix(f"{name}.")] == (value, value)


def test_a_packed_road_needs_no_file_beside_the_fmu(fmu_build, fmus, paths, tmp_path):
    """By --start and in a system by --set: the file may go, and the system has no text that a host must set."""
    given = [fmus / f"{name}.fmu" for name in ("PassengerCar", "RflMpc")]
    for option, out in (("--start", "start"), ("--set", "set")):
        shutil.copy(paths / "sudoku_turns.csv", tmp_path / "road.csv")
        made = change(fmu_build, tmp_path, *given, option, "RflMpc.path_file=road.csv", "--out", out)
        assert made.returncode == 0, made.stderr
        (tmp_path / "road.csv").unlink()
        assert 'path_file = "roads/road.csv"' in start_values(tmp_path / out / "RflMpc.fmu")
        drive = in_fmpy_ssp(tmp_path / out / "ClosedLoop.ssp")
        assert np.ptp(drive["PassengerCar.x"]) > 20.0
        with zipfile.ZipFile(tmp_path / out / "ClosedLoop.ssp") as package:
            texts = [package.read(name) for name in package.namelist() if name.endswith((".ssd", ".ssv"))]
        assert all(b"ssv:String" not in text for text in texts)


def test_a_reader_that_has_gone_does_not_end_the_work(fmu_build, fmus, tmp_path):
    reader, writer = os.pipe()
    os.close(reader)
    command = [str(fmu_build), str(fmus / "RflMpc.fmu"), str(fmus / "PassengerCar.fmu"), "--out", "out"]
    made = subprocess.run(command, cwd=tmp_path, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (made.returncode, made.stderr) == (0, "")
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"RflMpc.fmu", "PassengerCar.fmu", "ClosedLoop.ssp"}


def test_a_library_of_another_version_is_not_merged_in_silence(fmu_build, fmus, tmp_path):
    for given, other, words in (("", "fmi3", "of FMI 3.0"), ("fmi3", "", "of FMI 2.0")):
        merged = ["--merge", fmus / other / "RflMpc.fmu"]
        made = change(fmu_build, tmp_path, fmus / given / "RflMpc.fmu", *merged, "--out", "out")
        assert made.returncode != 0 and words in made.stderr, made.stderr
        assert not (tmp_path / "out").exists()


def test_learned_model_goes_in_and_another_one_after_it(fmu_build, fmus, rfl, tmp_path):
    """What was packed before stays, unless it is exchanged."""
    shutil.copy(fmus / "RflMpc.fmu", tmp_path)
    lag = ["--set", "effect.steer_lag=0.1", "--set", "effect.steer_delay=0.06"]
    run(rfl, "drive", *lag, "--duration", "60", "--log", tmp_path / "log.csv")
    for kind in ("linear", "rt"):
        run(rfl, "train", tmp_path / "log.csv", "--kind", kind, "--no-proof", "--out", tmp_path / f"{kind}.rflm")
    first = change(fmu_build, tmp_path, "RflMpc.fmu", "--residual", "linear.rflm", "--out", "first")
    assert first.returncode == 0, first.stderr
    arguments = ["first/RflMpc.fmu", "--residual", "rt.rflm", "--start", "RflMpc.mpc.q_e1=2"]
    second = change(fmu_build, tmp_path, *arguments, "--out", "second")
    assert second.returncode == 0, second.stderr
    assert start_values(tmp_path / "second" / "RflMpc.fmu") == '"mpc.q_e1" = "2"\nvariant = "rt"\n'
    with zipfile.ZipFile(tmp_path / "second" / "RflMpc.fmu") as package:
        models = {name for name in package.namelist() if name.startswith("resources/residual/")}
    assert models == {"resources/residual/linear.rflm", "resources/residual/rt.rflm"}
    with closing(Unit(tmp_path / "second" / "RflMpc.fmu", "unit")) as unit:
        unit.initialize()
        assert unit.items("variant")[unit.get("variant")] == "rt"
        assert unit.get("mpc.q_e1") == 2.0


def test_an_fmu_of_3_0_is_changed_as_one_of_2_0(fmu_build, fmus, paths, tmp_path):
    file = shutil.copy(fmus / "fmi3" / "RflMpc.fmu", tmp_path)
    road = paths / "sudoku_turns.csv"
    starts = ["--start", "RflMpc.mpc.q_e1=2", "--start", f"RflMpc.path_file={road}"]
    made = change(fmu_build, tmp_path, file, *starts, "--out", "packed")
    assert made.returncode == 0, made.stderr
    changed = tmp_path / "packed" / "fmi3" / "RflMpc.fmu"
    assert fmpy.validation.validate_fmu(str(changed)) == []
    assert start_values(changed) == '"mpc.q_e1" = "2"\npath_file = "roads/sudoku_turns.csv"\n'
    unit = Library(changed, tmp_path / "unpacked").make()
    assert unit.get_reals(["mpc.q_e1"]) == [2.0]
    assert unit.initialize() == OK, unit.said
    unit.free()
    mixed = change(fmu_build, tmp_path, file, fmus / "PassengerCar.fmu", "--out", "mixed")
    assert mixed.returncode != 0 and "one version at a time" in mixed.stderr, mixed.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["RflMpc.fmu", "--vehicle", "truck_real"], ["truck_real", "SemiTrailerTruck", "not among"]),
        (["RflMpc.fmu", "--start", "RflMpc.vehicle_file=none.toml"], ["vehicle file", "none.toml"]),
        (["RflMpc.fmu", "--start", "RflMpc.path_file=none.csv"], ["path_file", "none.csv"]),
        (["RflMpc.fmu", "--start", "RflMpc.vehicle_file=vehicles/none.toml"], ["vehicle file", "vehicles/none.toml"]),
        (["none.fmu"], ["none.fmu", "cannot read"]),
        (["RflMpc.fmu", "--only", "RflMpc"], ["cannot be used with"]),
        (["RflMpc.fmu", "--set", "RflMpc.mpc.horizon=9"], ["no system", "PassengerCar and RflMpc", "--start"]),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_is_written(fmu_build, fmus, tmp_path, arguments, words):
    shutil.copy(fmus / "RflMpc.fmu", tmp_path)
    refused = change(fmu_build, tmp_path, *arguments, "--out", "out")
    assert refused.returncode != 0
    assert all(word in refused.stderr for word in words), refused.stderr
    assert not (tmp_path / "out").exists()
