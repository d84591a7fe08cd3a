"""The outcome of a drive through the FMUs: one word in text, JSON, log, page, JUnit file and exit status."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from closed_loop import road_of
from outcome import (
    COMPLETED,
    LOST,
    STOPPED,
    TIMED_OUT,
    Check,
    Place,
    Referee,
    Requirement,
    beyond,
    check_files,
    exit_status,
    figures_help,
    write_junit,
    write_whole,
)

ROOT = Path(__file__).resolve().parents[2]


def driven(to: float, error=lambda s: 0.0, heading=lambda s: 0.0, speed: float = 10.0, **options) -> Referee:
    """A straight of 100 m, driven at 10 m/s to a station."""
    referee = Referee(100.0, **options)
    for k in range(int(to) + 1):
        referee.see(Place(0.1 * k, float(k), error(k), heading(k)), speed)
    return referee


def test_a_road_is_a_file_or_a_built_in_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert road_of("truck_u_turn") == ROOT / "paths" / "truck_u_turn.csv"
    (tmp_path / "truck_u_turn").write_text("x,y\n0,0\n100,0\n")
    assert road_of("truck_u_turn") == tmp_path / "truck_u_turn"
    assert road_of(Path("no/such.csv")) == tmp_path / "no" / "such.csv"


def test_a_road_is_completed_only_within_its_lane():
    on = driven(100)
    assert on.at_end and on.ending(COMPLETED, "").outcome == COMPLETED
    off = driven(100, lambda s: -2.5 if s == 40 else 0.0).ending(COMPLETED, "the road was driven to its end")
    assert off.outcome == LOST and off.departure.station == 40
    assert "2.50 m right of its path" in off.reason and "later the road was driven" in off.reason
    assert driven(100, heading=lambda s: 1.1 if s > 50 else 0.0).ending(COMPLETED, "").outcome == LOST
    assert driven(100, lambda s: 0.3, lane=0.2).ending(COMPLETED, "").outcome == LOST
    # A start beside the lane has to come in.
    comes = driven(100, lambda s: max(0.0, 3.0 - 0.1 * s)).ending(COMPLETED, "the road was driven to its end")
    assert comes.outcome == COMPLETED and comes.entered_late.time == 1.0
    assert "it began 3.00 m left of its path" in comes.reason and "from 1.00 s on" in comes.reason
    assert driven(100, lambda s: 3.0).ending(TIMED_OUT, "").outcome == LOST


def test_laps_are_counted_and_standing_takes_seconds():
    lap = Referee(100.0)
    for k in range(106):
        lap.see(Place(0.1 * k, float(k % 100), 0.0, 0.0), 10.0)
        assert lap.at_end == (k >= 95)
    standing = driven(50)
    for k in range(60):
        standing.see(Place(5.0 + 0.1 * k, 50.0, 0.0, 0.0), 0.0)
    assert standing.stands and not standing.at_end


def test_exit_statuses_are_those_of_the_program():
    assert [exit_status(word, cut=False) for word in (COMPLETED, STOPPED, LOST, TIMED_OUT)] == [0, 3, 4, 5]
    assert exit_status(TIMED_OUT, cut=True) == 0 and exit_status(LOST, cut=True) == 4
    assert exit_status(COMPLETED, cut=False, met=False) == 6
    # What a test asks for does not fail it.
    for outcome in (COMPLETED, STOPPED, LOST, TIMED_OUT):
        assert [exit_status(outcome, False, met, asked=True) for met in (True, False)] == [0, 6]
    assert Requirement("outcome=stopped").asks_for(STOPPED) and not Requirement("max_e1=1").asks_for(STOPPED)


def test_a_file_is_not_written_twice_nor_over_one_that_is_read(tmp_path):
    road, link, log = tmp_path / "road.csv", tmp_path / "link.csv", tmp_path / "log.csv"
    road.write_text("x,y\n")
    link.symlink_to(road)
    read = {"--path": road, "--vehicle": "c_class"}
    check_files({"--log": log, "--json": tmp_path / "new" / "log.csv", "--junit": None}, read)
    check_files({"--log": Path("/dev/null"), "--json": Path("/dev/null")}, read)
    for file in (road, link, tmp_path / "." / "road.csv"):
        with pytest.raises(ValueError, match=r"--log .* is the file of --path"):
            check_files({"--log": file}, read)
    with pytest.raises(ValueError, match="--log and --json are one file"):
        check_files({"--log": log, "--json": tmp_path / "x" / ".." / "log.csv"}, read)


def test_the_tyres_of_a_vehicle_are_not_written_over(tmp_path):
    vehicle, tyre = tmp_path / "car.toml", tmp_path / "tyres" / "a.tir"
    tyre.parent.mkdir()
    tyre.write_text("")
    vehicle.write_text("[tyre.front]\n  file = 'tyres/a.tir'\n")
    read = {"--path": None, "--vehicle": str(vehicle)}
    check_files({"--log": tmp_path / "tyres" / "b.tir"}, read)
    with pytest.raises(ValueError, match="is read with --vehicle"):
        check_files({"--json": tyre}, read)
    with pytest.raises(ValueError, match="name a file"):
        check_files({"--log": Path("-")}, read)


def test_a_junit_file_is_well_formed_and_tells_errors_from_failures(tmp_path):
    file = tmp_path / "drive.xml"
    checks = [Check("outcome", False, "no \x1broad\x00 <&> \udcff\uffff", error=True), Check("max_e1=1", False, "2")]
    write_junit(file, "suite", [("a\x07b", 1.0, checks)])
    suite = ET.parse(file).getroot()[0]
    assert (suite.get("failures"), suite.get("errors")) == ("1", "1")
    assert suite[0].get("classname") == "a\ufffdb" and suite[0].find("error") is not None
    assert "road\ufffd <&> \ufffd\ufffd" in suite[0].find("error").text


def test_a_place_off_the_lane_is_said_in_enough_digits():
    assert [beyond(*of) for of in ((2.5, 2.0), (0.0042, 0.001), (2.0001, 2.0))] == ["2.50", "0.004", "2.0001"]


def test_figures_are_those_of_the_program(rfl):
    told = subprocess.run([rfl, "drive", "--help"], capture_output=True, text=True, check=True).stdout
    names = re.findall(r"^  (\w+) ", figures_help(), re.MULTILINE)
    block = told[told.index("Figures of --require:") : told.index("Exit status:")]
    assert names and names == re.findall(r"^  (\w+) ", block, re.MULTILINE)


@pytest.mark.parametrize(
    ("text", "words"),
    [("max_e1", "FIGURE<=VALUE"), ("max_e9=1", "there are outcome, max_e1"), ("max_e1=x", "not a number"),
     ("outcome=won", "completed, stopped"), ("outcome<=lost", "outcome=")],
)  # fmt: skip
def test_what_is_no_requirement_is_refused(text, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        Requirement(text)


def test_links_and_devices_are_written_through(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("old")
    link.symlink_to(target)
    write_whole(link, "new")
    assert link.is_symlink() and target.read_text() == "new"
    write_whole(Path("/dev/null"), "away")
    write_whole(target, "newer")
    assert target.read_text() == "newer" and sorted(p.name for p in tmp_path.iterdir()) == ["link", "target"]


def run(script: str, *arguments) -> subprocess.CompletedProcess:
    command = [sys.executable, ROOT / "scripts" / script, *arguments]
    result = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    assert "Traceback" not in result.stderr, result.stderr
    return result


def drive(fmus, folder: Path, *arguments) -> tuple[int, str, dict, list[dict]]:
    """Exit status, text, results and log of a drive of the turns."""
    files = [
        "--log",
        folder / "o" / "drive.csv",
        "--json",
        folder / "o" / "drive.json",
        "--junit",
        folder / "drive.xml",
    ]
    road = [] if "--path" in arguments else ["--path", ROOT / "paths" / "sudoku_turns.csv"]
    result = run("closed_loop.py", "--fmus", fmus, "--quiet", *road, *files, *arguments)
    results = json.loads((folder / "o" / "drive.json").read_text())
    with open(folder / "o" / "drive.csv", newline="") as file:
        log = list(csv.DictReader(file))
    return result.returncode, result.stdout, results, log


def cases(file: Path) -> dict[str, bool]:
    """Test cases of a JUnit file, and whether each is met."""
    return {case.get("name"): case.find("failure") is None for case in ET.parse(file).getroot().iter("testcase")}


def test_the_master_completes_and_its_requirements_are_tests(fmus, tmp_path):
    asked = ("--require", "max_e1<=1", "--require", "mean_e1=1e-6")
    status, said, results, log = drive(fmus, tmp_path, *asked)
    assert status == 6 and results["outcome"] == COMPLETED and results["finished"] and results["exit_status"] == 6
    assert "outcome: completed" in said and "NOT met: mean_e1" in said
    assert cases(tmp_path / "drive.xml") == {"outcome": True, "max_e1<=1": True, "mean_e1=1e-6": False}
    assert list(log[0])[-1] == "status" and log[-1]["status"] == "finished" and "car.status" in log[0]


def test_the_master_says_lost_and_stopped(fmus, tmp_path):
    status, said, results, _ = drive(fmus, tmp_path, "--lane", "0.0002")
    assert (status, results["outcome"], results["finished"]) == (4, LOST, False)
    assert "outcome: lost: the vehicle was" in said and results["left_lane"]["time"] < results["end"]["time"]
    assert cases(tmp_path / "drive.xml") == {"outcome": False}
    status, _, results, _ = drive(fmus, tmp_path, "--set", "car.drive.max_force=0")
    assert (status, results["outcome"]) == (3, STOPPED)


def test_a_plant_that_dies_leaves_log_and_results(fmus, tmp_path):
    high = ("--set", "car.vehicle.cg_height=1.5", "--set", "speed.lateral_accel=8")
    road = ("--path", ROOT / "paths" / "hairpin_circuit.csv")
    status, said, results, log = drive(fmus, tmp_path, *road, *high)
    assert (status, results["outcome"]) == (4, LOST)
    assert "rolled over" in results["reason"] and "rolled over" in said
    assert len(log) > 100 and float(log[-1]["time"]) == results["duration"]


def test_the_demo_is_red_where_red_is_due(fmus, tmp_path):
    # A car that cannot push on: it coasts to a stop.
    text = (ROOT / "vehicles" / "c_class.toml").read_text().replace("max_force = 6500.0", "max_force = 0.0")
    tyre = ROOT / "vehicles" / "tyres" / "c_class.tir"
    (tmp_path / "tyres").mkdir()
    (tmp_path / "tyres" / "c_class.tir").write_bytes(tyre.read_bytes())
    (tmp_path / "weak.toml").write_text(text)
    turns = ROOT / "paths" / "sudoku_turns.csv"
    out, junit = tmp_path / "out", tmp_path / "demo.xml"
    arguments = (
        "--vehicle",
        tmp_path / "weak.toml",
        "--path",
        turns,
        "--path",
        tmp_path / "none.csv",
        "--junit",
        junit,
    )
    result = run("demo.py", "--plain", "--fmus", fmus, "--out", out, "--quiet", *arguments)
    # The road that is not there is bad input; the other one is driven, shown and logged all the same.
    assert result.returncode == 1 and "none.csv" in result.stderr
    assert "outcome: stopped" in result.stderr
    assert json.loads((out / "results.json").read_text())["routes"]["sudoku_turns"]["outcome"] == STOPPED
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "<td class='bad'>stopped</td>" in page and "<p class='bad'>stopped: the vehicle stood" in page
    assert (out / "sudoku_turns.csv").is_file() and cases(junit) == {"outcome": False}

    result = run(
        "demo.py", "--plain", "--fmus", fmus, "--out", out, "--quiet", "--path", turns, "--require", "max_e1=0.0001"
    )
    assert result.returncode == 6 and "NOT met: max_e1" in result.stderr
    assert "<td class='good'>completed</td>" in (out / "index.html").read_text(encoding="utf-8")


def test_the_demo_compares_the_controllers_of_a_slow_steering(fmus, tmp_path):
    learned, out = tmp_path / "learned", tmp_path / "out"
    learned.mkdir()
    # What rfl learn leaves behind where its model was refused.
    numbers = "[controller]\nactuator.dead_time = 0.06\nactuator.time_constant = 0.15\n"
    (learned / "controller.toml").write_text(f'kind = "car"\nvehicle = "c_class"\n\n{numbers}', encoding="utf-8")
    road = ("--path", ROOT / "paths" / "hairpin_circuit.csv", "--duration", "25")
    result = run("demo.py", "--fmus", fmus, "--out", out, "--quiet", "--learned", learned, *road)
    assert result.returncode == 0, result.stderr
    figures = json.loads((out / "results.json").read_text())["slow_steering"]["hairpin_circuit"]
    assert set(figures) == {"default", "identified"}
    assert figures["identified"]["max"] < 0.5 * figures["default"]["max"]
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "<td>refused</td>" in page and "id='slow0'" in page
    assert "refused" in result.stdout
