"""A fleet from logs to its page: what is done is not done again, and what dies is done by the next run, to the bit."""

from __future__ import annotations

import contextlib
import gzip
import importlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("distributed", reason="the extra [fleet] is not installed")
psutil = pytest.importorskip("psutil")

VEHICLES, DRIVES = ("one", "two", "three"), 4
#: Vehicle two has other toe since its third drive.
OFFSET, SINCE = 0.02, 3
NOISE = {
    "x": 0.02,
    "y": 0.02,
    "yaw": 1e-3,
    "vx": 0.03,
    "vy": 0.03,
    "yaw_rate": 2.5e-3,
    "ax": 0.06,
    "ay": 0.06,
    "steer": 4e-4,
}
SAME = ("verdicts.parquet", "vehicles.parquet", "types.parquet", "fleet.json", "index.html")


@pytest.fixture(scope="module")
def fleet(rfl_mpc):
    return importlib.import_module("rfl_mpc.fleet")


@pytest.fixture(scope="module")
def logs(rfl_mpc, tmp_path_factory):
    """A folder a vehicle, a log a drive."""
    rng = np.random.default_rng(4)
    top = tmp_path_factory.mktemp("fleet") / "logs"
    for vehicle in VEHICLES:
        gain = 1.0 + 0.005 * rng.normal()
        (top / vehicle).mkdir(parents=True)
        for drive in range(1, DRIVES + 1):
            told = {"effect.steer_gain": gain, "effect.wind_y": 0.5 * rng.normal()}
            if vehicle == "two" and drive >= SINCE:
                told["effect.steer_offset"] = OFFSET
            log = rfl_mpc.drive("sudoku_turns", set=told, duration=10.5).log.drop(columns="status")
            log = log[["time", "steer_cmd", "accel_cmd", *NOISE]].copy()
            for name, noise in NOISE.items():
                log[name] += noise * rng.normal(size=len(log))
            log.to_csv(top / vehicle / f"drive_{drive}.csv", index=False)
    return top


@pytest.fixture(scope="module")
def undisturbed(fleet, logs, tmp_path_factory):
    return fleet.run(logs, out=tmp_path_factory.mktemp("undisturbed") / "fleet", workers=2, pairs=False)


def contents(out: Path) -> dict[str, bytes]:
    """What a run writes; the page and the words name the folder."""
    return {name: (out / name).read_bytes().replace(str(out).encode(), b"OUT") for name in SAME}


def environment(rfl_mpc) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(Path(rfl_mpc.__file__).parent.parent)}


@pytest.fixture(autouse=True)
def importable(rfl_mpc, monkeypatch):
    """Workers are processes of their own, and import the package as well."""
    monkeypatch.setenv("PYTHONPATH", environment(rfl_mpc)["PYTHONPATH"])


def command(*words) -> list[str]:
    return [sys.executable, "-m", "rfl_mpc", "fleet", *map(str, words), "--no-pairs"]


def test_a_changed_vehicle_is_named_with_its_effect_and_its_drive(undisturbed):
    assert undisturbed.changed == ["two"], str(undisturbed)
    changed = undisturbed.vehicles.query("changed").iloc[0]
    assert changed.effect == "steer_offset" and changed.since_drive == SINCE and changed.since == f"drive_{SINCE}.csv"
    assert changed.low < OFFSET < changed.high and changed.probability > 0.9
    verdicts = undisturbed.verdicts
    assert len(verdicts) == len(VEHICLES) * DRIVES and verdicts.error.isna().all()
    assert set(verdicts.vehicle) == set(VEHICLES) and list(verdicts[verdicts.vehicle == "one"].drive) == [1, 2, 3, 4]
    assert "two: steer_offset" in str(undisturbed) and "1 of 3 vehicles changed (12 drives)" in str(undisturbed)


def test_the_page_leads_to_the_vehicle_and_its_report(undisturbed):
    text = (undisturbed.out / "index.html").read_text()
    assert '<a href="#v0">two</a>' in text and 'id="v0"' in text
    report = text.split('<a href="reports/')[1].split('"')[0]
    assert "steer_offset" in (undisturbed.out / "reports" / report).read_text()


def test_what_is_done_is_not_done_again(fleet, logs, undisturbed, monkeypatch, tmp_path):
    out = tmp_path / "fleet"
    shutil.copytree(undisturbed.out, out)
    # Touched, not changed.
    for log in logs.rglob("*.csv"):
        os.utime(log)
    monkeypatch.setattr("rfl_mpc.fleet.engine.cluster", lambda *_: pytest.fail("nothing was to be done"))
    again = fleet.run(logs, out=out, pairs=False)
    assert contents(again.out) == contents(undisturbed.out)
    dry = fleet.run(logs, out=out, pairs=False, dry_run=True)
    assert str(dry) == "12 drives of 3 vehicles of 1 types; 0 of them to be diagnosed"
    other = fleet.run(logs, out=out, pairs=True, dry_run=True)
    assert "12 of them to be diagnosed" in str(other)


def test_a_bad_log_is_a_row_with_its_error(fleet, logs, tmp_path):
    """Among the good ones: none there, an empty one, one without a column, a pipe that nobody fills."""
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "other.csv").write_text("time,vx\n0,1\n1,1\n")
    bad = ["absent.csv", "empty.csv", "other.csv", "pipe.csv"]
    rows = [(logs / "one" / "drive_1.csv", "one"), *((tmp_path / name, "bad") for name in bad)]
    (tmp_path / "drives.csv").write_text("log,vehicle\n" + "".join(f"{log},{vehicle}\n" for log, vehicle in rows))
    found = fleet.run(tmp_path / "drives.csv", out=tmp_path / "fleet", workers=1, time_limit=12.0, pairs=False)
    errors = dict(zip(found.verdicts.log.map(lambda log: Path(log).name), found.verdicts.error))
    assert errors["drive_1.csv"] is None or errors["drive_1.csv"] != errors["drive_1.csv"]
    assert (
        errors["absent.csv"]
        == f"{tmp_path / 'absent.csv'}: cannot be read (No such file or directory); check the name and the permission"
    )
    assert not any("Errno" in str(error) for error in errors.values())
    assert "empty" in errors["empty.csv"] and "steer_cmd" in errors["other.csv"]
    assert errors["pipe.csv"] == "no answer within 12 s (--time-limit)"
    assert found.report["errors"] == 4 and "4 drives were not diagnosed, such as" in str(found)


def test_a_copy_of_a_log_counts_once_and_one_of_two_vehicles_for_neither(fleet, logs, undisturbed, tmp_path):
    copied = tmp_path / "logs"
    shutil.copytree(logs, copied)
    shutil.copytree(undisturbed.out, tmp_path / "fleet")
    shutil.copy(copied / "two" / "drive_4.csv", copied / "two" / "drive_5.csv")
    found = fleet.run(copied, out=tmp_path / "fleet", workers=1, pairs=False)
    (error,) = found.verdicts.error.dropna()
    assert "drive_4.csv, which counts" in error
    columns = ["vehicle", "effect", "value", "low", "high", "probability"]
    pd.testing.assert_frame_equal(found.vehicles[columns], undisturbed.vehicles[columns])

    shutil.move(copied / "two" / "drive_5.csv", copied / "three" / "drive_5.csv")
    found = fleet.run(copied, out=tmp_path / "fleet", workers=1, pairs=False)
    errors = found.verdicts.dropna(subset="error")
    assert set(errors.vehicle) == {"two", "three"} and errors.error.str.contains("whose is it").all()


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_an_error_names_the_file_of_its_row_whoever_had_it_first(fleet, tmp_path, monkeypatch, suffix):
    """Equal files of two vehicles, by two runs and then by one that finds all done; likewise their references."""
    table = pd.DataFrame({"time": [0.0, 1.0], "vx": [1.0, 1.0]})
    good = pd.DataFrame({"time": 0.02 * np.arange(600), "steer_cmd": 0.0, "vx": 10.0, "yaw_rate": 0.0})
    rows = []
    for vehicle in ("one", "two"):
        folder = tmp_path / vehicle
        folder.mkdir()
        for name, of in (("bad", table), ("good", good)):
            file = folder / f"{name}.{suffix}"
            of.to_csv(file, index=False) if suffix == "csv" else of.to_parquet(file)
        rows.append((folder / f"bad.{suffix}", vehicle, ""))
        rows.append((folder / f"good.{suffix}", vehicle, folder / f"bad.{suffix}"))
    frame = pd.DataFrame(rows, columns=["log", "vehicle", "reference"]).astype(str)
    for part in (frame[:2], frame[2:], frame):
        if part is frame:
            monkeypatch.setattr("rfl_mpc.fleet.engine.cluster", lambda *_: pytest.fail("nothing was to be done"))
        verdicts = fleet.run(part, out=tmp_path / "fleet", workers=1, pairs=False).verdicts
        assert len(verdicts) == len(part) and verdicts.error.str.contains("steer_cmd").all()
        for vehicle, error in zip(verdicts.vehicle, verdicts.error):
            assert error.startswith(f"{tmp_path / vehicle / 'bad'}.{suffix}: "), error


def test_a_packed_log_that_is_cut_off_is_said(rfl_mpc, fleet, tmp_path):
    """Too short by that: in its error; else as a finding, in the words and on the page."""
    log = rfl_mpc.drive("sudoku_turns", duration=14).log.drop(columns="status")
    log = log[["time", "steer_cmd", "steer", "vx", "yaw_rate"]] + 1e-4 * np.random.default_rng(1).normal(
        size=(len(log), 5)
    )
    packed = gzip.compress(log.to_csv(index=False).encode())
    for name, share in (("half", 0.5), ("most", 0.9), ("whole", 1.0)):
        (tmp_path / "logs" / name).mkdir(parents=True)
        (tmp_path / "logs" / name / "1.csv.gz").write_bytes(packed[: int(share * len(packed))])
    found = fleet.run(tmp_path / "logs", out=tmp_path / "fleet", workers=2, pairs=False)
    rows = found.verdicts.set_index("vehicle")
    assert "at least 10 s are needed" in rows.error["half"] and "the packed file is cut off here" in rows.error["half"]
    (finding,) = [one for one in rows.findings["most"] if "cut off" in one]
    assert not any("cut off" in one for one in rows.findings["whole"])
    assert f"found in 1 drive, such as drive 1 of most: {finding}" in str(found)
    page = (tmp_path / "fleet" / "index.html").read_text()
    assert f"<td>{finding}</td><td class=number>1</td><td>drive 1 of most</td>" in page


def test_findings_that_differ_in_numbers_are_of_one_kind(fleet):
    findings = importlib.import_module("rfl_mpc.fleet.findings")
    gaps = [f"{count} gaps, the longest of {count / 7:.2f} s" for count in range(1, 9)]
    told = [("v", place, [gap, "line 9: cut off"] if place == 3 else [gap, gap]) for place, gap in enumerate(gaps)]
    first, second = findings.by_kind(told)
    assert first == findings.Finding(gaps[0], [("v", place) for place in range(8)])
    assert second == findings.Finding("line 9: cut off", [("v", 3)])
    many = [findings.Finding(f"kind {letter}", [("v", 0)]) for letter in "abcdefg"]
    assert findings.lines(many)[-1].startswith("2 more kinds of findings")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"workers": "2"}, "workers: '2'; give a whole number"),
        ({"workers": 1.5}, "workers: 1.5; give a whole number"),
        ({"time_limit": None}, "time_limit: None; give a number of seconds"),
        ({"time_limit": float("inf")}, "time_limit: inf; give a number of seconds"),
        ({"trust": "hi"}, "invalid value 'hi' for '--trust"),
        ({"rate": -3}, "invalid value '-3' for '--rate"),
        ({"sources": None}, "None names no drives"),
        ({"sources": 3}, "3 names no drives"),
    ],
)
def test_bad_options_are_said_before_the_first_drive(rfl_mpc, fleet, tmp_path, monkeypatch, options, words):
    monkeypatch.setattr("rfl_mpc.fleet.engine.cluster", lambda *_: pytest.fail("a drive was begun"))
    (tmp_path / "log.csv").write_text("time,steer_cmd,vx\n")
    with pytest.raises(rfl_mpc.RflError) as caught:
        fleet.run(**{"sources": tmp_path / "log.csv", "out": tmp_path / "fleet", **options})
    assert words in str(caught.value)


@pytest.mark.parametrize("by", ["option", "manifest"])
def test_a_bad_vehicle_file_is_said_before_the_first_drive(rfl_mpc, fleet, tmp_path, monkeypatch, by):
    monkeypatch.setattr("rfl_mpc.fleet.engine.cluster", lambda *_: pytest.fail("a drive was begun"))
    (tmp_path / "mine.toml").write_text("[vehicle]\nmass = 1500\n")
    column, value = (",vehicle_file", ",mine.toml") if by == "manifest" else ("", "")
    (tmp_path / "drives.csv").write_text(f"log,vehicle{column}\na.csv,v{value}\n")
    vehicle = tmp_path / "mine.toml" if by == "option" else None
    with pytest.raises(rfl_mpc.RflError, match=r"mine.toml, line 1: missing field"):
        fleet.run(tmp_path / "drives.csv", vehicle=vehicle, out=tmp_path / "fleet")


def test_the_exit_status_is_1_if_nothing_was_diagnosed(rfl_mpc, tmp_path):
    (tmp_path / "broken.parquet").write_bytes(b"PAR1")
    words = command(tmp_path / "broken.parquet", "--out", tmp_path / "fleet", "--workers", 1, "--quiet")
    done = subprocess.run(words, check=False, env=environment(rfl_mpc), capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr == "error: no drive was diagnosed\n", done.stderr
    assert "1 drives were not diagnosed" in done.stdout and "broken.parquet" in done.stdout


def test_results_stay_what_they_were_read_as_from_any_folder(rfl_mpc, fleet, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("time,vx\n0,1\n")
    first = fleet.run("a.csv", out="fleet", workers=1)
    unread = fleet.run("a.csv", out="fleet", workers=1)
    (tmp_path / "below").mkdir()
    monkeypatch.chdir(tmp_path / "below")
    assert len(first.verdicts) == 1
    fleet.run(["../a.csv", "../b.csv"], out="../fleet", workers=1)
    assert len(first.verdicts) == 1
    with pytest.raises(rfl_mpc.RflError, match="another run has written here since"):
        _ = unread.verdicts


def test_a_dry_run_has_no_tables(rfl_mpc, fleet, tmp_path):
    (tmp_path / "a.csv").write_text("time,vx\n0,1\n")
    found = fleet.run(tmp_path / "a.csv", out=tmp_path / "fleet", dry_run=True)
    with pytest.raises(rfl_mpc.RflError, match="a dry run has no vehicles"):
        _ = found.vehicles


@pytest.mark.parametrize("begun", [False, True])
def test_a_dry_run_says_which_files_are_missing(fleet, tmp_path, begun):
    (tmp_path / "a.csv").write_text("time,vx\n0,1\n")
    if begun:
        fleet.run(tmp_path / "a.csv", out=tmp_path / "fleet", workers=1)
    rows = [("a.csv", ""), *((f"{number}.csv", "") for number in range(4)), ("a.csv", "r.csv")]
    frame = pd.DataFrame({
        "log": [str(tmp_path / log) for log, _ in rows],
        "vehicle": list("vvvvvw"),
        "reference": [reference and str(tmp_path / reference) for _, reference in rows],
    })  # fmt: skip
    dry = fleet.run(frame, out=tmp_path / "fleet", dry_run=True)
    plan, missing = str(dry).splitlines()
    assert plan == f"6 drives of 2 vehicles of 1 types; {0 if begun else 1} of them to be diagnosed"
    assert missing == "5 files are missing: " + ", ".join(str(tmp_path / f"{k}.csv") for k in range(3)) + " and 2 more"
    assert dry.report["missing"][-1] == str(tmp_path / "r.csv")
    (one,) = str(fleet.run(frame[:2], out=tmp_path / "fleet", dry_run=True)).splitlines()[1:]
    assert one == f"1 file is missing: {tmp_path / '0.csv'}"


def test_a_file_that_cannot_be_written_is_said(rfl_mpc, fleet, tmp_path):
    (tmp_path / "a.csv").write_text("time,vx\n0,1\n")
    (tmp_path / "fleet" / "index.html").mkdir(parents=True)
    with pytest.raises(rfl_mpc.RflError, match=r"index.html.*: Is a directory; what was done is kept") as caught:
        fleet.run(tmp_path / "a.csv", out=tmp_path / "fleet", workers=1)
    assert "Errno" not in str(caught.value)


def test_a_data_frame_says_which_drives_there_are(fleet, tmp_path):
    (tmp_path / "a.csv").write_text("time,vx\n0,1\n")
    frame = pd.DataFrame({"log": [str(tmp_path / "a.csv")], "vehicle": ["v"]})
    assert "1 drives of 1 vehicles" in str(fleet.run(frame, out=tmp_path / "fleet", dry_run=True))


def test_options_may_be_numbers_of_numpy(fleet, tmp_path):
    (tmp_path / "a.csv").write_text("steer_cmd,vx\n0,1\n")
    found = fleet.run(tmp_path / "a.csv", out=tmp_path / "fleet", rate=np.int64(50), workers=np.int64(1))
    assert "yaw_rate" in found.verdicts.error[0]


def started(rfl_mpc, *words, **options) -> subprocess.Popen:
    return subprocess.Popen(
        command(*words), env=environment(rfl_mpc), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True, **options,
    )  # fmt: skip


def wait_for_answers(process: subprocess.Popen, count: int) -> None:
    """Until the progress tells so many."""
    said = ""
    while not any(f" {done}/12" in said for done in range(count, 13)):
        letter = process.stderr.read(1)
        assert letter, f"ended too early: {said}"
        said += letter


def processes(of: int) -> list[psutil.Process]:
    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(of).children(recursive=True)
    return []


def end(group: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


def test_what_is_killed_is_done_again_and_ends_with_the_same_bits(rfl_mpc, fleet, logs, undisturbed, tmp_path):
    """First a child that diagnoses, which costs nothing; then the whole run."""
    out = tmp_path / "fleet"
    process = started(rfl_mpc, logs, "--out", out, "--workers", 2)
    try:
        wait_for_answers(process, 2)
        children = [one for one in processes(process.pid) if "rfl_mpc.fleet.child" in " ".join(one.cmdline())]
        assert children
        children[0].kill()
        wait_for_answers(process, 6)
    finally:
        rest = processes(process.pid)
        process.kill()
        end(process.pid)
        psutil.wait_procs(rest, timeout=20)
    waiting = fleet.run(logs, out=out, dry_run=True, pairs=False).report["waiting"]
    assert 0 < waiting <= 6
    assert contents(fleet.run(logs, out=out, workers=2, pairs=False).out) == contents(undisturbed.out)


def test_a_full_disk_is_said_and_costs_what_was_running(rfl_mpc, fleet, logs, undisturbed, tmp_path):
    out = tmp_path / "fleet"

    def limited() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

    process = started(rfl_mpc, logs, "--out", out, "--workers", 1, preexec_fn=limited)
    _, words = process.communicate(timeout=300)
    end(process.pid)
    assert process.returncode == 1 and "what was done before is kept" in words, words
    assert contents(fleet.run(logs, out=out, workers=2, pairs=False).out) == contents(undisturbed.out)


@contextlib.contextmanager
def scheduler(rfl_mpc, folder: Path, port: int = 0):
    """A scheduler of its own, and a function that starts workers there; both end with the block."""
    file = folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment(rfl_mpc)}
    program = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", str(port), "--no-dashboard"]
    running = [subprocess.Popen([*program, "--scheduler-file", str(file)], **quiet)]
    while not file.exists() or not file.read_text():
        assert running[0].poll() is None
        time.sleep(0.05)
    address = json.loads(file.read_text())["address"]

    def worker() -> subprocess.Popen:
        program = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny"]
        running.append(subprocess.Popen([*program, "--local-directory", str(folder), "--no-dashboard"], **quiet))
        return running[-1]

    try:
        yield address, worker, running[0]
    finally:
        for process in reversed(running):
            process.kill()
            process.wait()


def test_workers_join_and_are_killed_and_at_last_the_scheduler(rfl_mpc, fleet, logs, undisturbed, tmp_path):
    out = tmp_path / "fleet"
    with scheduler(rfl_mpc, tmp_path) as (address, worker, main):
        first = worker()
        process = started(rfl_mpc, logs, "--out", out, "--dask", address)
        try:
            wait_for_answers(process, 2)
            worker()
            wait_for_answers(process, 4)
            first.kill()
            wait_for_answers(process, 7)
            main.kill()
            _, words = process.communicate(timeout=300)
        finally:
            end(process.pid)
    assert process.returncode == 1 and "run again" in words, words
    assert fleet.run(logs, out=out, dry_run=True, pairs=False).report["waiting"] <= 5
    assert contents(fleet.run(logs, out=out, workers=2, pairs=False).out) == contents(undisturbed.out)


def test_two_runs_do_not_share_a_folder(rfl_mpc, fleet, undisturbed, logs, tmp_path):
    store = importlib.import_module("rfl_mpc.fleet.store")
    held = store.Store(tmp_path / "drives.sqlite")
    with pytest.raises(rfl_mpc.RflError, match="another run"):
        fleet.run(logs, out=tmp_path, pairs=False)
    held.close()


def test_help_has_examples_and_errors_are_one_line(rfl_mpc, tmp_path):
    def run(*words):
        env = environment(rfl_mpc)
        return subprocess.run(command(*words), check=False, env=env, capture_output=True, text=True)

    assert "examples:" in run("--help").stdout
    failed = run(tmp_path / "nothing")
    assert failed.returncode == 1 and failed.stderr.startswith("error: ") and failed.stderr.count("\n") == 1
    assert run(tmp_path, "--dask", "tcp://127.0.0.1:9").returncode == 1


def test_cars_and_trucks_are_of_two_types_and_one_drive_is_a_fleet(rfl_mpc, fleet, logs, tmp_path):
    """Without a vehicle file a log's own columns say which of both it is of."""
    log = rfl_mpc.drive("truck_test", "truck_simulation", duration=14).log.drop(columns="status")
    (tmp_path / "logs" / "lorry").mkdir(parents=True)
    log[["time", "steer_cmd", "vx", "yaw_rate", "articulation"]].to_csv(
        tmp_path / "logs" / "lorry" / "1.csv", index=False
    )
    (tmp_path / "logs" / "car").mkdir()
    shutil.copy(logs / "one" / "drive_1.csv", tmp_path / "logs" / "car" / "1.csv")
    found = fleet.run(tmp_path / "logs", out=tmp_path / "fleet", workers=2, pairs=False)
    assert set(found.verdicts.type) == {"C-class hatchback", "tractor and semi-trailer, simulation"}
    assert found.verdicts.error.isna().all()
    assert found.changed == [] and found.report["vehicles"] == 2
