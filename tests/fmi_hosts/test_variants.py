"""The controller's variants in the FMU: each drives as natively, with its model packed or named.

What is missing or wrong is said.
"""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
from closed_loop import drive
from instance import ERROR, OK, WARNING, ClosedLoop, Instance, Library
from native import assert_same, read_log, run, settings

KINDS = {"linear": 1, "rt": 2, "rf": 3, "rtl": 4, "rfl": 5, "rfl_s": 6, "gp_nmpc": 9}
SLOW = {"effect.steer_lag": 0.1, "effect.steer_delay": 0.06}
ACTUATOR = {"actuator.dead_time": 0.06, "actuator.time_constant": 0.1}
# A process of 40 points without the lag of the steering loses its vehicle sooner or later: compared is the time before.
CALM = {"speed.lateral_accel": 1.2}
KNOWN = {"actuator": ACTUATOR, "gp_nmpc": CALM}
ROAD, SECONDS = "hairpin_circuit.csv", 12.0


@pytest.fixture(scope="module")
def models(rfl, paths, tmp_path_factory) -> Path:
    """Folder with a small model of each kind, learned from a short drive."""
    folder = tmp_path_factory.mktemp("models")
    run(rfl, "collect", "--quiet", "--runs", 1, "--path", paths / "sudoku_turns.csv", "--out", folder, *settings(SLOW))
    log = folder / "drive_1.csv"
    small = ["--window", 20, "--trees", 3, "--depth", 3, "--points", 40, "--hyperparameter-samples", 80]
    run(rfl, "train", log, "--quiet", "--no-proof", *small, "--all", folder)
    return folder


def packed(fmus: Path, folder: Path, models: Path, start: str) -> Path:
    """The controller's FMU with the models in its resources, and this start file."""
    fmu = folder / "RflMpc.fmu"
    shutil.copy(fmus / "RflMpc.fmu", fmu)
    with zipfile.ZipFile(fmu, "a") as archive:
        for kind in KINDS:
            archive.write(models / f"{kind}.rflm", f"resources/residual/{kind}.rflm")
        archive.writestr("resources/start.toml", start)
    return fmu


@pytest.fixture(scope="module")
def controller(fmus, models, tmp_path_factory) -> Path:
    """An FMU that drives with rfl_s, as `fmu-build --residual` makes it."""
    return packed(fmus, tmp_path_factory.mktemp("packed"), models, 'variant = "rfl_s"\n')


def natively(rfl, road: Path, log: Path, *arguments) -> dict[str, np.ndarray]:
    command = ["drive", "--quiet", "--path", road, "--duration", SECONDS, "--log", log, *settings(SLOW), *arguments]
    run(rfl, *command)
    return read_log(log)


def in_fmpy(controller: Path, fmus: Path, road: Path, **parameters) -> dict[str, np.ndarray]:
    values = SLOW | {name.replace("__", "."): value for name, value in parameters.items()}
    car = fmus / "PassengerCar.fmu"
    return drive(road, duration=SECONDS, settings=values, controller_fmu=controller, vehicle_fmu=car).columns


@pytest.mark.parametrize("variant", ["none", *KINDS, "actuator", "nmpc"])
def test_variant_drives_in_fmpy_as_natively(rfl, fmus, models, controller, paths, tmp_path, variant):
    known = KNOWN.get(variant, {})
    native = natively(
        rfl, paths / ROAD, tmp_path / "log.csv", "--variant", variant, "--models", models, *settings(known)
    )
    assert_same(native, in_fmpy(controller, fmus, paths / ROAD, **{"controller.variant": variant}, **known))


@pytest.mark.parametrize("model", ["pade_1_1", "pade_2_2", "first_order"])
def test_delay_model_by_name_drives_in_fmpy_as_natively(rfl, fmus, controller, paths, tmp_path, model):
    known = ACTUATOR | {"actuator.dead_time_model": model}
    native = natively(rfl, paths / ROAD, tmp_path / "log.csv", "--variant", "actuator", *settings(known))
    assert_same(native, in_fmpy(controller, fmus, paths / ROAD, **{"controller.variant": "actuator"}, **known))


def test_packed_default_drives_unless_the_host_chooses(fmus, models, controller, paths):
    road = paths / ROAD
    default = in_fmpy(controller, fmus, road)
    chosen = in_fmpy(controller, fmus, road, variant="rfl_s")
    assert_same(default, chosen)
    nominal = in_fmpy(controller, fmus, road, variant="none")
    assert not np.array_equal(default["steer_cmd"], nominal["steer_cmd"])
    # A file wins over the packed default, and its kind decides.
    file = in_fmpy(controller, fmus, road, residual__file=str(models / "linear.rflm"))
    assert_same(file, in_fmpy(controller, fmus, road, variant="linear"))


def test_packed_numbers_and_files_are_in_force(fmus, models, tmp_path):
    start = 'variant = "none"\nvehicle_file = "bmw_320i"\n"vehicle.mass" = "1234.5"\n"mpc.sample_time" = "0.04"\n'
    for name, inertia in (("RflMpc", "vehicle.yaw_inertia"), ("PassengerCar", "axle.front.wheel_inertia")):
        lines = start if name == "RflMpc" else "\n".join(start.splitlines()[1:3])
        shutil.copy(fmus / f"{name}.fmu", tmp_path)
        with zipfile.ZipFile(tmp_path / f"{name}.fmu", "a") as archive:
            archive.writestr("resources/start.toml", lines)
        unit = Instance(Library(tmp_path / f"{name}.fmu", tmp_path / name))
        assert unit.initialize() <= WARNING, unit.said
        mass, other = unit.get_reals(["vehicle.mass", inertia])
        assert mass == 1234.5
        assert other != float(unit.library.variables[inertia].start)
        unit.free()


def test_log_of_a_host_can_be_learned_from(rfl, fmus, paths, tmp_path):
    dither = {"mpc.dither": 0.005, "mpc.r_rate": 0.3, "mpc.q_e1_rate": 1.0, "mpc.q_e2": 2.0}
    drive(paths / "sudoku_turns.csv", settings=SLOW | dither, fmus=fmus).write_csv(tmp_path / "host.csv")
    log = tmp_path / "native.csv"
    run(rfl, "drive", "--quiet", "--path", paths / "sudoku_turns.csv", "--log", log, *settings(SLOW | dither))
    for name in ("host", "native"):
        model = tmp_path / f"{name}.rflm"
        run(rfl, "train", tmp_path / f"{name}.csv", "--quiet", "--no-proof", "--trees", 3, "--depth", 3, "--out", model)
    assert (tmp_path / "host.rflm").read_bytes() == (tmp_path / "native.rflm").read_bytes()


# --- what is missing or wrong


@pytest.fixture
def unit(libraries):
    instance = Instance(libraries["RflMpc"])
    yield instance
    instance.free()


def refused(unit: Instance, *words: str) -> None:
    assert unit.initialize() == ERROR
    for word in words:
        assert word.lower() in unit.said.lower(), f"'{word}' is not in: {unit.said}"


@pytest.mark.parametrize("variant", KINDS)
def test_missing_model(unit, variant):
    assert unit.set_integers({"variant": KINDS[variant]}) == OK
    refused(unit, f"residual/{variant}.rflm", f"--kind {variant}", "fmu-build --residual", "residual.file")
    # Not the end: reset, and the nominal controller drives.
    assert unit.reset() == OK
    assert unit.initialize() <= WARNING, unit.said


def test_no_such_variant(unit):
    assert unit.set_integers({"variant": 99}) != OK
    assert unit.initialize() <= WARNING, unit.said


WRONG = {
    "another car": ({"vehicle_file": "bmw_320i"}, {}, ["mass", "train"]),
    "another sample time": ({}, {"mpc.sample_time": 0.01}, ["sample time", "0.01"]),
    "another speed limit of the model": ({}, {"mpc.min_model_speed": 2.0}, ["mpc.min_model_speed"]),
}


@pytest.mark.parametrize("case", WRONG)
def test_model_of_another_controller(unit, models, case):
    strings, reals, words = WRONG[case]
    assert unit.set_string("residual.file", models / "linear.rflm") == OK
    for name, value in strings.items():
        assert unit.set_string(name, value) == OK
    assert unit.set_reals(reals) == OK
    refused(unit, *words)


def test_model_of_another_kind(unit, models):
    assert unit.set_string("residual.file", models / "rfl.rflm") == OK
    assert unit.set_integers({"variant": 6}) == OK
    refused(unit, "rfl.rflm", "kind rfl,", "variant is rfl_s")


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.999])
def test_truncated_model(unit, models, tmp_path, share):
    data = (models / "rfl_s.rflm").read_bytes()
    file = tmp_path / "cut.rflm"
    file.write_bytes(data[: int(share * len(data))])
    assert unit.set_string("residual.file", file) == OK
    refused(unit, "cut.rflm")


def test_damaged_start_file(fmus, models, tmp_path):
    library = Library(packed(fmus, tmp_path, models, 'variant = "rfl_x"\n'), tmp_path / "unpacked")
    instance = Instance(library)
    assert not instance.handle
    assert "start.toml" in instance.said and "rfl_s" in instance.said


@pytest.mark.parametrize("kind", ["rfl_s", "gp_nmpc"])
def test_a_model_may_be_given_as_bytes(of_version, models, paths, kind):
    """FMI 3.0 has bytes: the same drive as with the file, and states that carry the model to an instance without it."""
    libraries, file = of_version("3.0"), models / f"{kind}.rflm"
    rows = []
    for name in ("residual.file", "residual.data"):
        loop = ClosedLoop(libraries, paths / ROAD)
        assert loop.controller.reset() == loop.vehicle.reset() == OK
        if name == "residual.file":
            assert loop.controller.set_string(name, file) == OK
        else:
            assert loop.controller.set_binary(name, file.read_bytes()) == OK
        loop.start()
        assert loop.controller.get_integer("variant") == KINDS[kind]
        rows.append(loop.drive(200))
        loop_of_bytes = loop
    assert rows[0] == rows[1]
    data = loop_of_bytes.controller.serialize(loop_of_bytes.controller.save())
    other = libraries["RflMpc"].make()
    status, state = other.deserialize(data)
    assert (status, other.restore(state)) == (OK, OK), other.said
    assert other.get_binary("residual.data") == file.read_bytes()


def test_damaged_bytes_of_a_model_are_refused_as_its_file_is(of_version, models):
    data = bytearray((models / "rfl_s.rflm").read_bytes())
    data[-1] ^= 1
    unit = of_version("3.0")["RflMpc"].make()
    assert unit.set_binary("residual.data", bytes(data)) == OK
    assert unit.initialize() == ERROR
    assert "residual.data" in unit.said and "checksum" in unit.said
    unit.free()
