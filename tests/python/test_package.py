"""The Python package: the numbers of the command line, tables in, exceptions out, an end when it is told to end."""

from __future__ import annotations

import contextlib
import copy
import csv
import gzip
import json
import os
import pickle
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest

SLOW_STEERING = {"effect.steer_lag": 0.08, "effect.steer_delay": 0.06}
SET = [f"--set={name}={value}" for name, value in SLOW_STEERING.items()]


@pytest.fixture(scope="module")
def told(rfl, tmp_path_factory):
    """A drive of the command line: its log and its results."""
    folder = tmp_path_factory.mktemp("told")
    command = [rfl, "drive", "--path=sudoku_turns", *SET, "--duration=20", "--log=log.csv", "--json=drive.json"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def drive(rfl_mpc, tmp_path_factory):
    before = os.getcwd()
    # Built-in names are no files of the project.
    os.chdir(tmp_path_factory.mktemp("elsewhere"))
    try:
        return rfl_mpc.drive("sudoku_turns", set=SLOW_STEERING, duration=20)
    finally:
        os.chdir(before)


def test_a_drive_is_that_of_the_command_line(drive, told):
    with (told / "log.csv").open() as file:
        head, *rows = csv.reader(file)
    assert list(drive.log.columns) == head and len(drive.log) == len(rows)
    for name, written in zip(head, zip(*rows)):
        if name == "status":
            assert drive.statuses == written and tuple(drive.log["status"]) == written
        else:
            assert np.array_equal(drive.columns[name], [float(one) for one in written], equal_nan=True), name
    results = json.loads((told / "drive.json").read_text())
    same = ("outcome", "reason", "tracking", "classes", "largest", "actuator")
    assert {key: drive.report[key] for key in same} == {key: results[key] for key in same}
    assert drive.outcome == "timed_out" and drive.tracking["max"] == results["tracking"]["max"]
    assert "outcome: timed_out" in str(drive) and "<table>" in drive._repr_html_()


def test_the_controller_decides_step_by_step_as_in_the_drive(rfl_mpc, drive):
    controller = rfl_mpc.Controller("sudoku_turns")
    names = ["x", "y", "yaw", "vx", "vy", "yaw_rate", "steer"]
    first = {name: drive.columns[name][0] for name in names}
    assert np.allclose([first["x"], first["y"], first["yaw"], first["vx"]], controller.start)
    rows = zip(drive.columns["time"], *(drive.columns[name] for name in names))
    for at, (now, *measured) in enumerate(rows):
        command = controller.step(time=now, **dict(zip(names, measured)))
        assert command.steer_cmd == drive.columns["steer_cmd"][at], (at, command)
    assert command.status == drive.statuses[-1] and command.e1 == drive.columns["e1"][-1]
    assert controller.actuator == drive.actuator


VARIANTS = [
    {},
    {"vehicle": "truck_simulation", "path": "truck_test"},
    {"variant": "nmpc"},
    {"set": {"mpc.dither": 1e-3}},
]


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy])
@pytest.mark.parametrize("options", VARIANTS, ids=lambda options: " ".join(map(str, options)) or "default")
def test_a_copy_of_a_controller_goes_on_alone_and_as_the_original_would(rfl_mpc, how, options):
    original, twin = (rfl_mpc.Controller(**{"path": "sudoku_turns", **options}) for _ in range(2))

    def steps(controller, count, begin):
        """A vehicle beside the path; its commands."""
        x, y, yaw, speed = controller.start
        told = []
        for k in range(begin, begin + count):
            pose = {"x": x + 0.02 * speed * k, "y": y + 0.3 + 1e-3 * k, "yaw": yaw + 0.02 * np.sin(k)}
            command = controller.step(**pose, vx=speed, vy=0.0, yaw_rate=0.1 * np.sin(k), time=0.02 * k)
            told.append((command.steer_cmd, command.accel_cmd, command.status, command.station))
        return told

    steps(original, 20, 0)
    steps(twin, 20, 0)
    copied = how(original)
    expected = steps(twin, 20, 20)
    # Neither knows of the other's steps.
    assert steps(copied, 20, 20) == expected
    assert steps(original, 20, 20) == expected
    assert copied.actuator == original.actuator and copied.sample_time == original.sample_time


def test_a_copy_keeps_what_a_subclass_has(rfl_mpc):
    class Named(rfl_mpc.Controller):
        def __init__(self, names):
            super().__init__("sudoku_turns")
            self.names = names

    original = Named(["a"])
    assert copy.copy(original).names is original.names
    deep = copy.deepcopy([original, original])
    assert deep[0] is deep[1] and deep[0].names == ["a"] and deep[0].names is not original.names


def test_a_time_that_is_none_or_not_later_is_refused(rfl_mpc):
    controller = rfl_mpc.Controller("sudoku_turns")
    x, y, yaw, speed = controller.start
    at = {"x": x, "y": y, "yaw": yaw, "vx": speed, "vy": 0.0, "yaw_rate": 0.0}
    controller.step(**at, time=1.0)
    for bad in (float("nan"), float("inf"), 0.5, 1.0, np.float64(-3)):
        for kind in (ValueError, rfl_mpc.RflError):
            with pytest.raises(kind, match="time: "):
                controller.step(**at, time=bad)
    with pytest.raises(rfl_mpc.RflError, match=r"time: 0.5 s after 1 s; a step is later .* another Controller"):
        copy.copy(controller).step(**at, time=0.5)
    assert controller.step(**at, time=1.02).station < 1.0
    # A step without a time begins a clock anew.
    controller.step(**at)
    assert controller.step(**at, time=0.0).station < 1.0


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_a_command_is_pickled(rfl_mpc, protocol):
    controller = rfl_mpc.Controller("sudoku_turns")
    x, y, yaw, speed = controller.start
    names = [name for name in dir(rfl_mpc.Command) if not name.startswith("_")]
    for offset in (0.2, 30.0):
        command = controller.step(x=x, y=y + offset, yaw=yaw, vx=speed, vy=0.0, yaw_rate=0.0)
        again = pickle.loads(pickle.dumps(command, protocol))
        assert [getattr(again, name) for name in names] == [getattr(command, name) for name in names]
        assert repr(again) == repr(command) == repr(copy.copy(command)) and len(names) == 13
    with pytest.raises(ValueError, match="'fine' is no status"):
        rfl_mpc.Command("fine", command.__reduce__()[1][1])


def test_a_table_is_diagnosed_as_its_file_is(rfl_mpc, drive, told, rfl, tmp_path):
    from_table = rfl_mpc.diagnose(drive.log, pairs=False, out=tmp_path / "out")
    command = [rfl, "diagnose", told / "log.csv", "--no-pairs", "--json", "--out", tmp_path / "told"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    report = json.loads(done.stdout)
    files = from_table.report.pop("inputs"), report.pop("inputs")
    assert from_table.report == report
    assert files[0]["files"]["log"]["file"] == "<log>"
    statuses = {"none": 0, "effect": 3, "not_in_library": 4, "cannot_tell": 5}
    assert done.returncode == statuses[from_table.verdict["kind"]]
    page = (tmp_path / "out" / "report.html").read_text()
    assert from_table.to_html() == page
    assert sorted(os.listdir(tmp_path / "out")) == sorted(os.listdir(tmp_path / "told"))
    assert "<iframe" in from_table._repr_html_() and from_table.verdict["summary"] in str(from_table)


@pytest.mark.parametrize(
    ("logs", "reference"),
    [
        (lambda frame, file: frame, lambda frame, file: frame),
        (lambda frame, file: frame, lambda frame, file: file),
        (lambda frame, file: file, lambda frame, file: frame.copy()),
        (lambda frame, file: file, lambda frame, file: file),
        (lambda frame, file: [frame[: len(frame) // 2], frame], lambda frame, file: frame),
        (lambda frame, file: frame, lambda frame, file: frame[["time", "steer_cmd", "vx", "yaw_rate"]]),
        (lambda frame, file: frame.assign(ay=np.nan), lambda frame, file: frame.assign(ay=-np.array(np.nan))),
    ],
    ids=["table", "its file", "file and its table", "file", "one of two", "some columns", "gaps"],
)
def test_a_log_is_no_reference_of_itself(rfl_mpc, drive, told, logs, reference):
    """It would hide every fault; the words name both."""
    frame, file = drive.log.drop(columns="status"), told / "log.csv"
    words = "--reference .*: the same drive as .*, which would hide every fault"
    with pytest.raises(rfl_mpc.RflError, match=words):
        rfl_mpc.diagnose(logs(frame, file), reference=reference(frame, file), pairs=False)


@pytest.mark.filterwarnings("ignore:line")
@pytest.mark.parametrize("share", [0.01, 0.02, 0.1, 0.3, 0.8])
@pytest.mark.parametrize("command", ["diagnose", "identify", "train"])
def test_a_packed_log_that_is_cut_off_is_said_with_what_it_lacks_by_that(rfl_mpc, drive, tmp_path, command, share):
    """Of the rows that are there it may be too little; where they do, it is said as well."""
    columns = ["time", "steer_cmd", "steer", "vx", "yaw_rate", "e1", "e1_rate", "e2", "e2_rate", "curvature"]
    packed = gzip.compress(drive.log[columns].to_csv(index=False).encode())
    file = tmp_path / "log.csv.gz"
    file.write_bytes(packed[: int(share * len(packed))])
    options = {"diagnose": {"pairs": False}, "identify": {"check": False}}
    options["train"] = {"kind": "linear", "proof": False, "out": tmp_path / "model.rflm"}
    # An actuator shows in two seconds.
    too_little = share < (0.05 if command == "identify" else 0.5)
    with pytest.raises(rfl_mpc.RflError) if too_little else contextlib.nullcontext() as caught:
        result = getattr(rfl_mpc, command)(file, **options[command])
    words = str(caught.value) if caught else f"{result.report} {result}"
    assert "the packed file is cut off here" in words
    assert not caught or str(file) in words


def test_one_vehicle_is_taken_out_of_a_log_of_several(rfl_mpc, drive, tmp_path):
    log = drive.log[["time", "steer_cmd", "steer", "vx"]]
    late = log.assign(steer=log["steer"].shift(5, fill_value=0.0))
    both = pd.concat([log.assign(vehicle_id="A"), late.assign(vehicle_id="B")])
    file = tmp_path / "both.csv"
    both.to_csv(file, index=False)
    with pytest.raises(rfl_mpc.RflError, match="vehicle_id"):
        rfl_mpc.identify(file, check=False)
    first, second = (rfl_mpc.identify(file, only=f"vehicle_id={one}", check=False).delay.value for one in "AB")
    assert second - first == pytest.approx(0.1, abs=0.01)


def test_another_drive_of_the_same_road_is_a_reference(rfl_mpc, drive):
    frame = drive.log.drop(columns="status")
    noise = 1e-3 * np.random.default_rng(1).normal(size=len(frame))
    assert rfl_mpc.diagnose(frame, reference=frame.assign(yaw_rate=frame["yaw_rate"] + noise), pairs=False).verdict


def test_tables_of_every_kind_are_read_alike(rfl_mpc, drive):
    names = ["time", "steer_cmd", "steer", "vx"]
    columns = {name: drive.columns[name] for name in names}
    frame = pd.DataFrame(columns)
    dated = frame.assign(time=pd.Timestamp("2026-01-01") + pd.to_timedelta(frame["time"], unit="s"))
    degrees = frame.rename(columns={"steer": "steer [deg]"})
    degrees["steer [deg]"] = np.degrees(degrees["steer [deg]"])
    remarked = {**columns, "remark": ["text"] * len(frame)}
    tables = [columns, frame, frame.to_records(index=False), dated, degrees, remarked]
    pyarrow = pytest.importorskip("pyarrow")
    tables.append(pyarrow.Table.from_pandas(frame))
    found = [rfl_mpc.identify(table).dead_time for table in tables]
    assert np.allclose([one[:3] for one in found], found[0][:3], atol=1e-6), found
    assert found[0].excited and found[0].value == pytest.approx(0.06, abs=0.002)


@pytest.mark.parametrize(
    "name",
    [str.upper, str.title, lambda name: name.replace("_", " "), lambda name: f" {name} ", lambda name: f"{name} (-)"],
)
def test_names_in_other_letters_are_read_as_in_a_file(rfl_mpc, drive, told, tmp_path, name):
    frame = drive.log[["time", "steer_cmd", "steer", "accel_cmd", "vx", "yaw_rate", "ax", "ay"]]
    renamed = frame.rename(columns=name)
    plain, other = ([one for one, _ in rfl_mpc._call._columns("<log>", table)] for table in (frame, renamed))
    assert other == list(renamed.columns) and len(plain) == len(other)
    renamed.to_csv(tmp_path / "log.csv", index=False)
    found = [rfl_mpc.identify(table, check=False).dead_time for table in (frame, renamed, tmp_path / "log.csv")]
    assert np.allclose([one[:3] for one in found], found[0][:3], atol=1e-6), found
    # A column with the very name comes first.
    both = frame.assign(VX=7.0, remark=1.0)
    assert "VX" not in [one for one, _ in rfl_mpc._call._columns("<log>", both)]


BEGIN = pd.Timestamp("2026-01-01")


@pytest.mark.parametrize(
    "timed",
    [
        lambda frame, dates: frame.assign(time=dates.dt.tz_localize("Asia/Tokyo")),
        lambda frame, dates: frame.assign(time=dates.astype(object)),
        lambda frame, dates: frame.assign(time=[date.to_pydatetime() for date in dates]).astype({"time": object}),
        lambda frame, dates: frame.assign(time=dates.map(lambda date: date.isoformat() + "+09:00")),
        lambda frame, dates: frame.assign(time=(dates - BEGIN).astype(object)),
        lambda frame, dates: frame.assign(time=frame["time"].astype(str)),
        lambda frame, dates: frame.drop(columns="time").set_index(pd.DatetimeIndex(dates, tz="UTC")),
        lambda frame, dates: frame.set_index("time"),
    ],
    ids=["zone", "objects", "datetimes", "text", "durations", "numbers as text", "index of dates", "index time"],
)
def test_times_of_every_kind_are_seconds(rfl_mpc, drive, timed):
    frame = drive.log[["time", "steer_cmd", "steer", "vx"]]
    table = timed(frame, BEGIN + pd.to_timedelta(frame["time"], unit="s").dt.round("us"))
    found, plain = (rfl_mpc.identify(one).dead_time for one in (table, frame))
    assert np.allclose(found[:3], plain[:3], atol=1e-5)


def test_a_mask_is_a_gap(rfl_mpc):
    steer = np.ma.masked_array([0.1, 0.3, 0.2], mask=[False, True, False])
    ((_, data),) = rfl_mpc._call._columns("<log>", {"steer": steer})
    assert np.array_equal(np.frombuffer(data), [0.1, np.nan, 0.2], equal_nan=True)


def test_times_begin_at_the_first_that_is_known(rfl_mpc):
    dates = pd.Series(pd.to_datetime([None, "2026-01-01T00:00:00", "2026-01-01T00:00:00.02"], format="ISO8601"))
    ((name, data),) = rfl_mpc._call._columns("<log>", {"time": dates})
    assert name == "time" and np.array_equal(np.frombuffer(data), [np.nan, 0.0, 0.02], equal_nan=True)


def test_truth_values_and_numbers_of_numpy_are_those_of_python(rfl_mpc):
    options = {"direct": np.False_, "duration": np.array(1.0), "set": pd.Series({"vehicle.mass": np.float64(1500)})}
    assert rfl_mpc.drive("sudoku_turns", **options).outcome == "timed_out"
    assert rfl_mpc._call.words(direct=np.True_, without=pd.Series(["a", "b"])) == [
        "--direct",
        "--without=a",
        "--without=b",
    ]


def test_a_report_is_saved_as_page_or_numbers_and_nothing_else(rfl_mpc, tmp_path):
    report = rfl_mpc.Report({"verdict": {}}, "", "<html>")
    report.save(tmp_path / "new" / "report.html")
    report.save(tmp_path / "report.JSON")
    assert (tmp_path / "new" / "report.html").read_text() == "<html>"
    assert json.loads((tmp_path / "report.JSON").read_text()) == {"verdict": {}}
    with pytest.raises(rfl_mpc.RflError, match=r"x.pdf: a report is written as .html or .json"):
        report.save(tmp_path / "x.pdf")
    with pytest.raises(rfl_mpc.RflError, match="cannot be written"):
        report.save(tmp_path / "report.JSON" / "report.html")


def test_the_steering_is_identified_as_by_the_command_line(rfl_mpc, drive, told, rfl, tmp_path):
    steering = rfl_mpc.identify(drive.log, into=tmp_path / "mine.toml", check=False)
    command = [rfl, "identify", "log.csv", "--into=told.toml", "--no-check", "--json=told.json"]
    subprocess.run(command, cwd=told, check=True, capture_output=True)
    results = json.loads((told / "told.json").read_text())
    assert {key: results[key] for key in ("dead_time", "lag", "gain", "offset", "rmse")} == {
        key: steering.report[key] for key in ("dead_time", "lag", "gain", "offset", "rmse")
    }
    assert (tmp_path / "mine.toml").read_bytes() == (told / "told.toml").read_bytes()
    known = rfl_mpc.drive("sudoku_turns", tmp_path / "mine.toml", duration=5)
    assert known.outcome == "timed_out" and "dead_time" in repr(steering)


def test_a_model_is_that_of_the_command_line(rfl_mpc, drive, told, rfl, tmp_path):
    shared = {"kind": "rfl", "trees": 2, "depth": 2, "window": 12}
    model = rfl_mpc.train(drive.log, out=tmp_path / "mine.rflm", proof=False, **shared)
    options = [f"--{name}={value}" for name, value in shared.items()]
    command = [rfl, "train", "log.csv", "--out=told.rflm", "--no-proof", *options]
    subprocess.run(command, cwd=told, check=True, capture_output=True)
    assert model.file == tmp_path / "mine.rflm" and model.file.read_bytes() == (told / "told.rflm").read_bytes()
    assert not model.proven and "rfl, training" in str(model)
    driven = rfl_mpc.drive("sudoku_turns", set=SLOW_STEERING, residual=model.file, duration=2)
    assert driven.report["variant"] == "rfl"


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda rfl: rfl.drive("none.csv"), "none.csv: cannot be read"),
        (lambda rfl: rfl.drive(b"none.csv"), "none.csv: cannot be read"),
        (
            lambda rfl: rfl.drive("sudoku"),
            "use a built-in road: sudoku_train, sudoku_test, sudoku_turns, hairpin_circuit",
        ),
        (lambda rfl: rfl.drive(b"r\xe4d.csv"), "a name that is no text in UTF-8"),
        (lambda rfl: rfl.drive(vehicle="none.toml"), "none.toml"),
        (lambda rfl: rfl.drive(set={"vehicle.mas": 1}), "there is no number 'vehicle.mas'"),
        (lambda rfl: rfl.drive(set={"vehicle.mass": -5}), "[100, 100000]"),
        (lambda rfl: rfl.drive(variant="rlf"), "invalid value 'rlf' for '--variant"),
        (lambda rfl: rfl.drive(step="quick"), "--step <STEP>: 'quick' is not a number"),
        (lambda rfl: rfl.drive(step=-1), "--step -1: give a time between 0.001 and 0.2 s"),
        (lambda rfl: rfl.diagnose([]), "give at least one log"),
        (lambda rfl: rfl.diagnose(None), "give at least one log"),
        (lambda rfl: rfl.identify(None), "give at least one log"),
        (lambda rfl: rfl.train(None), "give at least one log"),
        (lambda rfl: rfl.drive(set={"vehicle.mass": np.ones(2)}), "--set vehicle.mass: an array of 2 values"),
        (lambda rfl: rfl.drive(set=pd.Series({"vehicle.mas": 1})), "there is no number 'vehicle.mas'"),
        (lambda rfl: rfl.diagnose({"time": ["0", "soon"], "vx": [1.0, 1.0]}), "column time, row 2: 'soon' is neither"),
        (
            lambda rfl: rfl.diagnose({"time": ["0", "2026-01-01"], "vx": [1.0, 1.0]}),
            "column time: numbers beside dates",
        ),
        (lambda rfl: rfl.diagnose(7), "<log>: int is no log"),
        (lambda rfl: rfl.diagnose("none.csv"), "none.csv"),
        (lambda rfl: rfl.diagnose(b"none.csv"), "none.csv: No such file"),
        *(
            (lambda rfl, command=command, empty=empty: getattr(rfl, command)(empty), "<log>: the table has no rows")
            for command in ("diagnose", "identify", "train")
            for empty in ({"time": [], "vx": []}, pd.DataFrame({"time": [], "vx": [], "steer": []}))
        ),
        (
            lambda rfl: rfl.identify({name: np.arange(9.0) for name in ("time", "steer_cmd", "steer")}, begin=20),
            "no row between the times that begin and end give",
        ),
        (lambda rfl: rfl.diagnose({"a": [1.0], "b": [2.0]}), "no column is a signal of a drive log (columns: a, b)"),
        (lambda rfl: rfl.diagnose({"time": [0.0, 1.0], "vx": [1.0]}), "column 'vx' has 1 values"),
        (lambda rfl: rfl.diagnose({"time": [0.0], "vx": ["fast"]}), "column vx: could not convert"),
        (lambda rfl: rfl.diagnose({"time": [[0.0]], "vx": [1.0]}), "column time: shape (1, 1)"),
        (
            lambda rfl: rfl.diagnose([{"time": 0.0, "vx": 1.0}]),
            "column time: one value and no column; of rows that are dicts",
        ),
        (lambda rfl: rfl.diagnose(pd.Series([1.0, 2.0], name="vx")), "a Series is one column"),
        (lambda rfl: rfl.diagnose(np.ones((9, 3))), "an array has no names"),
        (lambda rfl: rfl.diagnose(pd.DataFrame({("car", "vx"): [1.0]})), "names are of several levels"),
        (
            lambda rfl: rfl.diagnose({"time": np.float32(1.7e9 + np.arange(99)), "vx": np.ones(99)}),
            "float32 counts such times in steps of 128 s",
        ),
        (lambda rfl: rfl.diagnose("none.csv", without=["tyre_softening"]), "none.csv"),
        (lambda rfl: rfl.diagnose({"vx": [0.0], "vx [km/h]": [1.0]}), "the column 'vx' stands twice"),
        (lambda rfl: rfl.identify({"time": [0.0], "steer_cmd": [0.0]}), "steer"),
        (lambda rfl: rfl.train({"time": [0.0], "vx": [1.0]}), "<log>"),
        (lambda rfl: rfl.tune(budget=0), "at least 1"),
        (lambda rfl: rfl.Controller(vehicle="none.toml"), "none.toml"),
    ],
)
def test_bad_input_raises_what_was_wrong_and_where(rfl_mpc, tmp_path, monkeypatch, call, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(rfl_mpc.RflError) as caught:
        call(rfl_mpc)
    assert words in str(caught.value) and not isinstance(caught.value, rfl_mpc.InternalError), caught.value


SENSORS = {("car", "time"): [0.0], ("car", "vx"): [1.0], ("imu", "yaw_rate"): [0.0], ("imu", "vx"): [2.0]}


@pytest.mark.parametrize(
    ("table", "signals"),
    [
        (pd.DataFrame({("car", "time"): [0.0], ("car", "vx"): [1.0], ("imu", "yaw_rate"): [0.0]}), 3),
        (pd.DataFrame({("time", "last"): [0.0], ("vx", "mean"): [1.0], ("yaw_rate", "mean"): [0.0]}), 3),
        (pd.DataFrame({("time", "", ""): [0.0], ("a", "car", "vx"): [1.0], ("a", "imu", "yaw_rate"): [0.0]}), 3),
        (pd.DataFrame({("vx", "mean"): [1.0], ("vx", "std"): [1.0], ("ay", "mean"): [1.0], ("ay", "std"): [1.0]}), 2),
        (pd.DataFrame(SENSORS), 3),
        (SENSORS, 3),
        ({("car", "time"): [0.0], ("imu", "vx"): [1.0]}, 2),
        ({("car", "vx"): [1.0], "remark": [1.0]}, 1),
    ],
    ids=["group first", "signal first", "empty levels", "statistics", "twice", "dict twice", "dict", "dict of both"],
)
def test_advice_on_names_of_several_levels_works_when_it_is_followed(rfl_mpc, table, signals):
    with pytest.raises(rfl_mpc.RflError, match="names are of several levels") as caught:
        rfl_mpc.diagnose(table)
    scope = {"table": table}
    exec(str(caught.value).rsplit(";", 1)[1].removeprefix(" choose, such as ").strip(), scope)
    columns = dict(rfl_mpc._call._columns("<log>", scope["table"]))
    assert len(columns) == signals
    # Of two sensors' columns those of the first one.
    assert "vx" not in columns or np.frombuffer(columns["vx"]) == [1.0]


def test_the_home_folder_may_be_a_tilde(rfl_mpc, drive, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    (tmp_path / "road.csv").write_bytes(rfl_mpc.roads()["sudoku_turns"].read_bytes())
    driven = rfl_mpc.drive("~/road.csv", duration=1, log="~/log.csv")
    assert (tmp_path / "log.csv").is_file() and len(driven.log) == 50
    drive.log[["time", "steer_cmd", "steer"]].to_csv(tmp_path / "drive.csv", index=False)
    assert rfl_mpc.identify(b"~/drive.csv", check=False).dead_time.excited
    rfl_mpc.Report({"verdict": {}}, "", "<html>").save("~/report.html")
    assert (tmp_path / "report.html").is_file()


def test_warnings_and_notes_are_pythons(rfl_mpc, caplog, tmp_path):
    bend = [(20 * np.sin(0.05 * k), 20 * (1 - np.cos(0.05 * k))) for k in range(60)]
    repeated = "x,y\n" + "".join(f"{x},{y}\n{x},{y}\n" for x, y in bend)
    (tmp_path / "road.csv").write_text(repeated)
    with caplog.at_level("INFO", "rfl_mpc"), pytest.warns(rfl_mpc.RflWarning) as caught:
        rfl_mpc.drive(tmp_path / "road.csv", duration=1, set={"mpc.steer_max": 0.05})
    assert "tighter than the vehicle turns" in str(caught[0].message) and caught[0].filename == __file__
    assert "repeat the one before" in caplog.text


def test_progress_is_told_and_can_stop_the_work(rfl_mpc):
    shares = []
    rfl_mpc.drive("sudoku_turns", duration=5, progress=lambda part, share: shares.append((part, share)))
    assert shares == sorted(shares) and {part for part, _ in shares} == {"driving"}

    class Enough(Exception):
        pass

    def stop(part, share):
        raise Enough(part)

    with pytest.raises(Enough, match="driving"):
        rfl_mpc.drive("sudoku_train", progress=stop)


def test_an_interrupt_stops_the_work(rfl_mpc, drive):
    def interrupt(part, share):
        signal.raise_signal(signal.SIGINT)

    # A shell ignores interrupts for what it runs in the background, and Python with it.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    begin = time.process_time()
    with pytest.raises(KeyboardInterrupt):
        rfl_mpc.diagnose(drive.log, progress=interrupt)
    signal.signal(signal.SIGINT, before)
    settled = time.process_time()
    time.sleep(0.5)
    # Nothing goes on behind: the process is idle.
    assert time.process_time() - settled < 0.25, (begin, settled)


def test_the_package_carries_fmus_vehicles_and_roads(rfl_mpc):
    names = {"PassengerCar", "RflMpc", "SemiTrailerTruck", "TruckRflMpc"}
    assert set(rfl_mpc.fmus()) == set(rfl_mpc.fmus("3.0")) == names
    with pytest.raises(rfl_mpc.RflError, match=r"version: '3'; the FMUs are of FMI 2.0 and 3.0"):
        rfl_mpc.fmus("3")
    assert all(file.is_file() for kind in (rfl_mpc.fmus, rfl_mpc.vehicles, rfl_mpc.roads) for file in kind().values())
    for name, file in rfl_mpc.roads().items():
        assert rfl_mpc.Controller(name, "truck_real" if "truck" in name else "c_class").length > 10, file


def test_the_program_is_part_of_it(folder, tmp_path):
    environment = os.environ | ({"PYTHONPATH": str(folder)} if folder else {})
    command = [sys.executable, "-m", "rfl_mpc"]

    def said(*words):
        options = {"cwd": tmp_path, "env": environment, "capture_output": True, "text": True}
        return subprocess.run([*command, *words], check=False, **options)

    version = said("--version")
    assert version.returncode == 0 and version.stdout.startswith("rfl ")
    assert said("drvie").returncode == 2 and "'drive'" in said("drvie").stderr
    assert said("drive", "--path", "none.csv").returncode == 1
    driven = said("drive", "--path", "sudoku_turns", "--duration", "2", "--quiet", "--log", "log.csv.txt")
    assert driven.returncode == 0 and "outcome: timed_out" in driven.stdout, driven.stderr
    with gzip.open(tmp_path / "log.csv.gz", "wt") as file:
        file.write((tmp_path / "log.csv.txt").read_text())
    assert said("diagnose", "log.csv.gz").returncode in (1, 5)
