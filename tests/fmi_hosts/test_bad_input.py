"""Bad input through the real libraries: each has a defined status, and a message that says what, where and what to do.

The words after a case are what a person needs to find in the message: the file, the line, the variable, the remedy.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from instance import DISCARD, ERROR, OK, UNITS, WARNING, Instance

GOOD_ROAD = "x,y\n" + "".join(f"{x},0\n" for x in range(0, 100, 2))


@pytest.fixture
def unit(libraries, request):
    """An instance that is free of whatever the test did to it afterwards."""
    instance = Instance(libraries[request.param])
    assert instance.handle
    yield instance
    instance.free()


@pytest.fixture
def running(libraries, request):
    """An initialised instance."""
    instance = Instance(libraries[request.param])
    assert instance.initialize() <= WARNING, instance.said
    yield instance
    instance.free()


def says(instance: Instance, *words: str) -> None:
    for word in words:
        assert word.lower() in instance.said.lower(), f"'{word}' is not in: {instance.said}"


# --- values

NO_NUMBERS = [math.nan, math.inf, -math.inf]
CONTROLLERS = [unit for unit in UNITS if unit.endswith("RflMpc")]
VEHICLES = [unit for unit in UNITS if unit not in CONTROLLERS]


@pytest.mark.parametrize("running", VEHICLES, indirect=True)
@pytest.mark.parametrize("value", NO_NUMBERS)
def test_input_that_is_no_number(running, value):
    name = running.library.inputs[0]
    assert running.set_reals({name: 0.01}) == OK
    assert running.set_reals({name: value}) == DISCARD
    says(running, f"`{name}`", "finite", "0.01", "stands")
    assert running.get_reals([name]) == [0.01]
    assert running.step(0.0) <= WARNING  # and the instance works on
    assert all(map(math.isfinite, running.get_reals(running.library.outputs)))


@pytest.mark.parametrize("running", CONTROLLERS, indirect=True)
@pytest.mark.parametrize("value", NO_NUMBERS)
def test_measurement_that_is_no_number_is_the_guards(running, value):
    """A sensor drops out: the call's other values count, and the controller drives on."""
    start = dict(zip(["x", "y", "yaw"], running.get_reals(["start.x", "start.y", "start.yaw"]), strict=True))
    status = {int(item.value): item.name for item in running.library.variables["status"].declaredType.items}
    for k in range(5):
        along = {"x": start["x"] + 0.1 * k * math.cos(start["yaw"]), "y": start["y"] + 0.1 * k * math.sin(start["yaw"])}
        assert running.set_reals(start | along | {"vx": 5.0, "vy": value if k > 2 else 0.0}) == OK
        assert running.get_reals(["x"]) == [along["x"]]
        assert running.step(0.02 * k) <= WARNING
        assert status[running.get_integer("status")] == ("bridged" if k > 2 else "optimal")
        assert all(map(math.isfinite, running.get_reals(running.library.outputs)))
    says(running, "`vy`", "is no number", "missing")


@pytest.mark.parametrize("running", VEHICLES, indirect=True)
def test_one_bad_value_among_good_ones_changes_none(running):
    names = running.library.inputs[:2]
    before = running.get_reals(names)
    assert running.set_reals({names[0]: 0.02, names[1]: math.nan}) == DISCARD
    assert running.get_reals(names) == before


@pytest.mark.parametrize(
    ("unit", "name"),
    [
        ("RflMpc", "mpc.q_e1"),
        ("TruckRflMpc", "mpc.q_e1"),
        ("PassengerCar", "vehicle.mass"),
        ("SemiTrailerTruck", "tractor.mass"),
    ],
    indirect=["unit"],
)
def test_parameter_out_of_its_range(unit, name):
    before = float(unit.library.variables[name].start)
    assert unit.set_reals({name: -1e12}) == DISCARD
    says(unit, f"`{name}`", "range", "stands")
    assert unit.initialize() <= WARNING
    assert unit.get_reals([name])[0] > 0 or before == 0


@pytest.mark.parametrize("running", UNITS, indirect=True)
def test_parameter_set_too_late(running):
    name = next(n for n, v in running.library.variables.items() if (v.variability, v.type) == ("fixed", "Real"))
    assert running.set_reals({name: 1.0}) == ERROR
    says(running, f"`{name}`", "fixed", "fmi2Reset")


@pytest.mark.parametrize("running", UNITS, indirect=True)
def test_output_cannot_be_set(running):
    assert running.set_reals({running.library.outputs[0]: 1.0}) == ERROR
    says(running, f"`{running.library.outputs[0]}`", "output", "cannot be set")


@pytest.mark.parametrize("running", UNITS, indirect=True)
def test_unknown_reference(running):
    import ctypes

    value = ctypes.c_double(7.0)
    status = running.call("fmi2GetReal", (ctypes.c_uint * 1)(987654), ctypes.c_size_t(1), ctypes.byref(value))
    assert status == ERROR
    says(running, "987654", "modelDescription.xml")
    assert value.value == 7.0


# --- steps


@pytest.mark.parametrize("running", UNITS, indirect=True)
@pytest.mark.parametrize("length", [0.0, -0.02, math.nan, math.inf])
def test_step_that_is_no_step(running, length):
    assert running.step(0.0, length) == ERROR
    says(running, "step", "greater than zero")
    assert running.step(0.0) <= WARNING


@pytest.mark.parametrize("running", UNITS, indirect=True)
def test_step_from_another_time(running):
    assert running.step(0.0) <= WARNING
    assert running.step(0.0) == ERROR
    says(running, "0.02", "fmi2SetFMUstate")
    assert running.step(1.0) == ERROR
    says(running, "still at 0.02")
    assert running.step(0.02) <= WARNING


@pytest.mark.parametrize("running", UNITS, indirect=True)
def test_time_that_is_no_number(running):
    assert running.step(math.nan) == ERROR
    says(running, "communication point", "finite")
    assert running.step(0.0) <= WARNING


@pytest.mark.parametrize("unit", UNITS, indirect=True)
def test_step_past_the_stop_time(unit):
    assert unit.setup(0.0, 0.03) == OK
    assert unit.enter() == OK
    assert unit.exit() <= WARNING, unit.said
    assert unit.step(0.0) <= WARNING
    assert unit.step(0.02) == ERROR
    says(unit, "stop time", "0.03")


# --- order of calls


@pytest.mark.parametrize("unit", UNITS, indirect=True)
def test_calls_out_of_order(unit):
    assert unit.step(0.0) == ERROR
    says(unit, "fmi2DoStep", "instantiated", "fmi2EnterInitializationMode")
    assert unit.exit() == ERROR
    assert unit.terminate() == ERROR
    assert unit.initialize() <= WARNING, unit.said
    assert unit.enter() == ERROR
    assert unit.setup() == ERROR
    assert unit.step(0.0) <= WARNING
    assert unit.terminate() == OK
    assert unit.step(0.02) == ERROR
    says(unit, "fmi2Reset")
    assert unit.reset() == OK
    assert unit.initialize() <= WARNING


# --- instantiation


@pytest.mark.parametrize("name", UNITS)
def test_wrong_guid(libraries, name):
    instance = Instance(libraries[name], guid="{00000000-0000-0000-0000-000000000000}")
    assert not instance.handle
    says(instance, "guid", libraries[name].description.guid.strip("{}"))


@pytest.mark.parametrize("name", UNITS)
def test_model_exchange_is_refused(libraries, name):
    instance = Instance(libraries[name], kind=0)
    assert not instance.handle
    says(instance, "co-simulation")


@pytest.mark.parametrize("name", UNITS)
@pytest.mark.parametrize("spelling", ["file:{}", "file://{}", "file://localhost{}", "{}", "file://{}/"])
def test_spellings_of_the_resource_location(libraries, name, spelling):
    instance = Instance(libraries[name], resources=spelling.format(libraries[name].folder / "resources"))
    assert instance.handle and instance.initialize() <= WARNING, instance.said
    instance.free()


@pytest.mark.parametrize("encoded", [True, False])
def test_resource_folder_with_spaces_and_umlauts(fmus, tmp_path, encoded):
    from instance import Library

    library = Library(fmus / "RflMpc.fmu", tmp_path / "Größe 100 %")
    folder = library.folder / "resources"
    instance = Instance(library, resources=folder.as_uri() if encoded else f"file://{folder}")
    assert instance.handle and instance.initialize() <= WARNING, instance.said
    instance.free()


def test_no_resource_location_and_no_file(libraries):
    instance = Instance(libraries["RflMpc"], resources="")
    assert instance.handle  # the standard does not forbid it
    assert instance.initialize() == ERROR
    says(instance, "path_file", "path.csv")
    instance.free()


# --- resources


def with_file(unit: Instance, parameter: str, file: Path) -> int:
    assert unit.set_string(parameter, file) == OK
    return unit.initialize()


ROADS = {
    "missing": (None, ["cannot be read", "check the name"]),
    "empty": ("", ["has no points", "header `x,y`"]),
    "one point": ("x,y\n1,2\n", ["1 distinct point", "at least 2"]),
    "all points the same": ("x,y\n" + "1,2\n" * 9, ["1 distinct point", "at least 2"]),
    "NaN": (GOOD_ROAD.replace("20,0\n", "nan,0\n"), ["line 12", "`x`", "not finite", "delete the row"]),
    "infinity": (GOOD_ROAD.replace("20,0\n", "20,inf\n"), ["line 12", "`y`", "not finite"]),
    "text": (GOOD_ROAD.replace("20,0\n", "20,left\n"), ["line 12", "`y`", "`left` is not a number"]),
    "gap": (
        GOOD_ROAD + "".join(f"{x},20\n" for x in range(300, 400, 2)),
        ["line 52", "203", "fill the gap"],
    ),
    "truncated in mid-row": (GOOD_ROAD + "100", ["line 52", "1 values", "2 columns"]),
    "no column y": ("x,z\n0,0\n1,1\n", ["line 1", "`"]),
    "centimetres": ("x,y\n" + "".join(f"{x}e5,0\n" for x in range(50)), ["apart", "hardly in m"]),
    "turns back": ("x,y\n0,0\n2,0\n4,0\n1,0\n6,0\n8,0\n", ["turns back", "driving order"]),
    "a picture": ("\x00\x01PNG\ufffd\n\x00,\x00,\x00\n", ["`"]),
}


@pytest.mark.parametrize("case", ROADS)
@pytest.mark.parametrize("unit", ["RflMpc", "TruckRflMpc"], indirect=True)
def test_road_that_is_none(unit, tmp_path, case):
    content, words = ROADS[case]
    file = tmp_path / "road.csv"
    if content is not None:
        file.write_text(content, encoding="utf-8")
    assert with_file(unit, "path_file", file) == ERROR
    says(unit, "road.csv", "path_file", *words)
    # Not the end: reset, and the packed road is driven.
    assert unit.reset() == OK
    assert unit.initialize() <= WARNING, unit.said


@pytest.mark.parametrize("unit", ["RflMpc"], indirect=True)
def test_repeated_points_are_dropped(unit, tmp_path):
    file = tmp_path / "road.csv"
    file.write_text(GOOD_ROAD.replace("20,0\n", "20,0\n20,0\n20,0\n"))
    # A repair is no warning: hosts stop at one while they initialise.
    assert with_file(unit, "path_file", file) == OK
    assert unit.get_reals(["path.length"]) == [pytest.approx(98.0)]


# Units with a vehicle that is built in for them, and the first section of its file.
VEHICLES = [
    ("RflMpc", "bmw_320i", "vehicle"),
    ("TruckRflMpc", "truck_real", "tractor"),
    ("PassengerCar", "bmw_320i", "vehicle"),
    ("SemiTrailerTruck", "truck_real", "tractor"),
]


@pytest.fixture
def text(vehicle) -> str:
    """The file of a vehicle."""
    return (Path(__file__).parents[2] / "vehicles" / f"{vehicle}.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(("unit", "vehicle", "section"), VEHICLES, indirect=["unit"])
class TestVehicleFile:
    def test_missing(self, unit, vehicle, section, tmp_path):
        assert with_file(unit, "vehicle_file", tmp_path / "mine.toml") == ERROR
        says(unit, "mine.toml", "cannot be read", vehicle)

    def test_unknown_name(self, unit, vehicle, section):
        assert with_file(unit, "vehicle_file", Path("batmobile")) == ERROR
        says(unit, "batmobile", vehicle)

    def test_truncated(self, unit, vehicle, section, tmp_path, text):
        file = tmp_path / "mine.toml"
        file.write_text(text[: len(text) // 2])
        assert with_file(unit, "vehicle_file", file) == ERROR
        says(unit, "mine.toml", "line", "compare with")

    def test_foreign(self, unit, vehicle, section, tmp_path):
        file = tmp_path / "mine.toml"
        file.write_bytes(bytes(range(256)) * 4)
        assert with_file(unit, "vehicle_file", file) == ERROR
        says(unit, "mine.toml")

    def test_value_that_no_vehicle_has(self, unit, vehicle, section, tmp_path, text):
        lines = text.splitlines()
        at = next(i for i, line in enumerate(lines) if line.startswith("mass"))
        lines[at] = "mass = -3.0"
        file = tmp_path / "mine.toml"
        file.write_text("\n".join(lines))
        assert with_file(unit, "vehicle_file", file) == ERROR
        says(unit, "mine.toml", f"line {at + 1}", f"{section}.mass", "-3", "outside")


@pytest.mark.parametrize(
    ("unit", "vehicle"), [vehicle[:2] for vehicle in VEHICLES if "Mpc" not in vehicle[0]], indirect=["unit"]
)
def test_tyre_file_truncated(unit, vehicle, tmp_path, text):
    vehicles = Path(__file__).parents[2] / "vehicles"
    tyre = next(vehicles.glob("tyres/*.tir"))
    lines = tyre.read_text(encoding="utf-8").splitlines()
    (tmp_path / "half.tir").write_text("\n".join(lines[: len(lines) // 2]))
    lines = [f'file = "{tmp_path / "half.tir"}"' if line.startswith("file") else line for line in text.splitlines()]
    (tmp_path / "mine.toml").write_text("\n".join(lines))
    assert with_file(unit, "vehicle_file", tmp_path / "mine.toml") == ERROR
    says(unit, "mine.toml", "half.tir", "tyre.front", "missing")


@pytest.mark.parametrize("running", ["SemiTrailerTruck"], indirect=True)
def test_jack_knife_ends_the_instance_until_it_is_reset(running):
    """Locked drive wheels in a wet turn: an error with a message, and after a reset a sound instance."""
    assert running.reset() == OK
    wet = {"initial.vx": 22.0, "brake.front_share": 0.0, "brake.trailer_share": 0.0, "effect.road_friction": 0.35}
    assert running.set_reals(wet) == OK
    assert running.initialize() <= WARNING, running.said
    status, k = OK, 0
    while status <= WARNING and k < 3000:
        assert running.set_reals({"steer_cmd": 0.08, "accel_cmd": 0.0 if k < 25 else -5.0}) == OK
        status, k = running.step(0.02 * k), k + 1
    assert status == ERROR
    says(running, "jack-knifed", "hitch.articulation_limit")
    assert all(map(math.isfinite, running.get_reals(running.library.outputs)))
    assert running.reset() == OK
    assert running.initialize() <= WARNING, running.said
    assert running.step(0.0) <= WARNING


# --- FMU states


@pytest.mark.parametrize("running", UNITS, indirect=True)
def test_damaged_states(running, libraries):
    state = running.save()
    data = running.serialize(state)
    assert running.free_state(state) == OK
    cases = {
        "truncated": data[: len(data) // 2],
        "empty": b"",
        "foreign": b"PNG" + data[3:],
        "one bit": data[:-5] + bytes([data[-5] ^ 1]) + data[-4:],
    }
    for name, damaged in cases.items():
        status, _ = running.deserialize(damaged)
        assert status == ERROR, name
    says(running, "truncated", "state")
    assert running.step(0.0) <= WARNING


def test_state_of_the_other_unit(libraries):
    car, controller = Instance(libraries["PassengerCar"]), Instance(libraries["RflMpc"])
    assert max(car.initialize(), controller.initialize()) <= WARNING
    state = car.save()
    status, _ = controller.deserialize(car.serialize(state))
    assert status == ERROR
    says(controller, "another FMU")
    assert controller.restore(state) == ERROR  # a handle of another instance is not followed
    says(controller, "not one of this instance")
    assert car.free_state(state) == OK
    car.free()
    controller.free()
