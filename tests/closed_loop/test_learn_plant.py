"""`scripts/learn` on plants that are not ours: a Python class and an FMU, and what is said of plants that are none."""

from __future__ import annotations

import csv
import json
import math
import subprocess
import sys
from collections import deque
from dataclasses import replace
from pathlib import Path

import closed_loop
import learn
import numpy as np
import plant
import pytest
from outcome import COMPLETED, LOST

SCRIPT = Path(learn.__file__)
LAG, DEAD_TIME = 0.1, 0.06  # s


class Bicycle:
    """A 1600 kg bicycle with saturating tyres, behind a steering with lag and dead time: no plant of ours."""

    mass, inertia, front, rear = 1600.0, 2500.0, 1.2, 1.6  # kg, kg m2, m, m
    stiffness = (95e3, 125e3)  # N/rad, front and rear
    grip, gravity = 0.9, 9.81
    part = 0.002  # s, of the integration

    def __init__(self, x, y, yaw, speed, gain=1.0, lag=LAG, dead_time=DEAD_TIME) -> None:
        self.x, self.y, self.yaw, self.vx, self.vy, self.yaw_rate, self.steer = x, y, yaw, speed, 0.0, 0.0, 0.0
        self.gain, self.lag = gain, lag
        self.waiting = deque([0.0] * round(dead_time / self.part))

    def outputs(self) -> dict[str, float]:
        return {name: getattr(self, name) for name in ("x", "y", "yaw", "vx", "vy", "yaw_rate", "steer")}

    def side_force(self, axle: int, angle: float) -> float:
        base = self.front + self.rear
        load = self.mass * self.gravity * (self.rear, self.front)[axle] / base
        return self.grip * load * math.tanh(self.stiffness[axle] * angle / (self.grip * load))

    def step(self, steer_cmd: float, accel_cmd: float, seconds: float) -> None:
        h = self.part
        for _ in range(round(seconds / h)):
            self.waiting.append(self.gain * steer_cmd)
            self.steer += h * (self.waiting.popleft() - self.steer) / self.lag
            speed = max(self.vx, 0.5)
            front = self.side_force(0, self.steer - math.atan2(self.vy + self.front * self.yaw_rate, speed))
            rear = self.side_force(1, -math.atan2(self.vy - self.rear * self.yaw_rate, speed))
            c, s = math.cos(self.yaw), math.sin(self.yaw)
            self.x += h * (self.vx * c - self.vy * s)
            self.y += h * (self.vx * s + self.vy * c)
            self.yaw += h * self.yaw_rate
            forward = accel_cmd + self.vy * self.yaw_rate - front * math.sin(self.steer) / self.mass
            aside = (front * math.cos(self.steer) + rear) / self.mass - self.vx * self.yaw_rate
            turn = (self.front * front * math.cos(self.steer) - self.rear * rear) / self.inertia
            self.vx, self.vy, self.yaw_rate = self.vx + h * forward, self.vy + h * aside, self.yaw_rate + h * turn


def ladder(out: Path, rfl: Path, fmus: Path, paths: Path, *arguments: object, ok: bool = True):
    """Runs the script on the short road; gives its report and what it printed."""
    command = [sys.executable, SCRIPT, "--rfl", rfl, "--fmus", fmus, "--path", paths / "sudoku_turns.csv"]
    command += ["--out", out, "--quiet", *arguments]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert (done.returncode == 0) == ok, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    report = out / "learn.json"
    return json.loads(report.read_text()) if report.is_file() else {}, done.stdout + done.stderr


def mean(report: dict, controller: str) -> float:
    """Mean error of a controller over the roads of the proof; all of them were driven to their end."""
    rows = [row for row in report["proof"] if row["controller"] == controller]
    assert all(row["outcome"] == COMPLETED for row in rows), rows
    return sum(row["mean"] for row in rows) / len(rows)


@pytest.fixture(scope="module")
def roads(rfl, tmp_path_factory) -> Path:
    """A short road to prove on."""
    road = tmp_path_factory.mktemp("roads") / "test.csv"
    subprocess.run([rfl, "course", "--random", "car", "--seed", "900", "--out", road], check=True)
    return road


@pytest.fixture(scope="module")
def learned(rfl, fmus, paths, roads, tmp_path_factory):
    """The ladder on the bicycle."""
    out = tmp_path_factory.mktemp("learned")
    report, printed = ladder(
        *(out, rfl, fmus, paths, "--plant", f"{__file__}:Bicycle", "--vehicle", "c_class", "--test", roads),
        *("--roads", 2, "--seed", 3),
    )
    return out, report, printed


def test_what_is_learned_beats_the_default(learned):
    _, report, printed = learned
    print(printed)
    assert report["steering"]["actuator.dead_time"] == pytest.approx(DEAD_TIME, abs=0.01)
    assert report["steering"]["actuator.time_constant"] == pytest.approx(LAG, abs=0.01)
    default, best = mean(report, "default"), mean(report, report["recommended"])
    assert report["recommended"] != "default"
    assert best < 0.8 * default
    assert printed.splitlines()[-1].startswith(f"use ({report['recommended']}): RflMpc.fmu with vehicle_file=")


def test_files_are_there(learned):
    out, report, _ = learned
    logs = [row["log"] for step in ("drive", "collect", "proof") for row in report[step]]
    assert len(logs) == 1 + 3 + 3 * len({row["controller"] for row in report["proof"]})
    for log in logs:
        with open(log, newline="") as file:
            header, *rows = csv.reader(file)
        assert header[:3] == ["time", "steer_cmd", "accel_cmd"] and header[-1] == "status"
        assert len(rows) > 100 and rows[10][-1] not in ("", "0")
    assert (out / "lateral_error.png").is_file() or "no picture" in learned[2]


def test_what_is_recommended_can_be_used(learned, fmus, roads):
    """The parameters of the last line drive as the proof did, to the last bit."""
    _, report, _ = learned
    use = {name: value for name, value in report["use"].items() if name not in ("fmu", "vehicle_file")}
    result = plant.drive(roads, report["use"]["vehicle_file"], Bicycle, use, fmus=fmus)
    row = next(row for row in report["proof"] if row["controller"] == report["recommended"])
    assert result.results()["tracking"]["mae"] == row["mean"]


def test_steering_file_is_read_by_rfl(learned, rfl, roads):
    out, _, _ = learned
    command = [rfl, "drive", "--path", roads, "--controller", out / "controller.toml", "--quiet", "--duration", "1"]
    subprocess.run(command, check=True, capture_output=True)


def test_a_seed_gives_the_same_bits(learned, fmus, tmp_path):
    """A collecting drive is what seed, road and steering make of it, in whatever process."""
    out, report, _ = learned
    settings = report["steering"] | learn.CALM | {"mpc.dither": learn.DITHER["car"], "mpc.dither_seed": 302}
    again = tmp_path / "again.csv"
    learn.make(learn.Job("again", out / "roads" / "collect_1.csv", "c_class", Bicycle, settings, again, fmus))
    assert again.read_bytes() == (out / "collect_2.csv").read_bytes()


def test_a_lost_drive_shows_the_steering(rfl, fmus, paths, roads, tmp_path):
    """1.2 s of delay: the default controller is lost; the next drive begins with what that one showed."""
    report, printed = ladder(
        *(tmp_path, rfl, fmus, paths, "--plant", f"{__file__}:Bicycle", "--test", roads, "--roads", 0),
        *("--set", "plant.lag=0.5", "--set", "plant.dead_time=0.7"),
    )
    print(printed)
    first, second = report["drive"]
    assert first["outcome"] == LOST and second["outcome"] == COMPLETED
    assert sum(second["settings"].values()) == pytest.approx(1.2, abs=0.02)
    assert report["recommended"] != "default"


def test_fmu_is_learned(rfl, fmus, paths, roads, tmp_path):
    report, printed = ladder(
        *(tmp_path, rfl, fmus, paths, "--plant", fmus / "PassengerCar.fmu", "--test", roads, "--roads", 0),
        *("--set", "plant.effect.steer_lag=0.1", "--set", "plant.effect.steer_delay=0.06"),
    )
    print(printed)
    # The car's own lag is 0.05 s.
    assert sum(report["steering"].values()) == pytest.approx(0.21, abs=0.01)
    assert mean(report, report["recommended"]) < 0.8 * mean(report, "default")


def test_fmu_drives_as_in_the_master(fmus, paths):
    """The same bits as closed_loop.py gives."""
    road = paths / "sudoku_turns.csv"
    master = closed_loop.drive(road, "c_class", fmus=fmus)
    ours = plant.drive(road, "c_class", plant.plant_of(str(fmus / "PassengerCar.fmu")), fmus=fmus)
    for name in ("time", "x", "y", "yaw", "steer_cmd", "accel_cmd", "e1", "status"):
        assert (ours.columns[name] == master.columns[name]).all(), name
    assert ours.outcome == master.outcome == COMPLETED


def test_fmu_that_cannot_be_placed_gets_its_road_laid_before_it(fmus, paths):
    """It begins elsewhere and drives the same."""
    road, file = paths / "sudoku_turns.csv", str(fmus / "PassengerCar.fmu")
    placed = plant.drive(road, "c_class", plant.plant_of(file), fmus=fmus)
    elsewhere = {"initial.x": "-7", "initial.y": "3", "initial.yaw": "2"}
    source = plant.plant_of(file, elsewhere)
    assert "cannot be set" in source.notes()[0]
    moved = plant.drive(road, "c_class", source, fmus=fmus)
    assert moved.outcome == COMPLETED
    assert moved.columns["e1"] == pytest.approx(placed.columns["e1"], abs=1e-5)


def test_fmu_of_other_names_and_units(fmus, paths):
    """A factor says what a signal is multiplied by to be ours; commands are divided by it."""
    road, file = paths / "sudoku_turns.csv", str(fmus / "PassengerCar.fmu")
    # What the FMU calls steer is taken for twice the angle: the controller's command reaches it halved.
    source = plant.plant_of(file, {}, ["steer_cmd = 2*steer_cmd", "steer=2*steer"])
    half = plant.drive(road, "c_class", source, fmus=fmus).columns
    vehicle = source(0.0, 0.0, 0.0, 10.0)
    assert vehicle.outputs()["vx"] == pytest.approx(10.0)
    vehicle.close()
    settled = abs(half["curvature"]) > 0.01
    plain = plant.drive(road, "c_class", plant.plant_of(file), fmus=fmus).columns
    ratio = abs(half["steer"][settled]).mean() / abs(plain["steer"][abs(plain["curvature"]) > 0.01]).mean()
    assert ratio == pytest.approx(2.0, rel=0.05)


def test_a_lost_drive_is_no_completed_one(fmus, paths):
    """Steering that goes the wrong way: lost, the log kept until then."""
    result = plant.drive(paths / "sudoku_turns.csv", "c_class", lambda *start: Bicycle(*start, gain=-1.0), fmus=fmus)
    assert result.outcome == LOST and not result.finished and result.fault is None
    assert "of its path" in result.ending.reason
    assert len(result.columns["time"]) > 50


PLANTS = """
from test_learn_plant import Bicycle

class NoYaw(Bicycle):
    def outputs(self):
        told = super().outputs()
        del told["yaw"]
        return told

class Nan(Bicycle):
    moved = False
    def outputs(self):
        return super().outputs() | ({"vy": float("nan")} if self.moved else {})
    def step(self, steer_cmd, accel_cmd, seconds):
        self.moved = True

class Raises(Bicycle):
    count = 0
    def step(self, steer_cmd, accel_cmd, seconds):
        self.count += 1
        if self.count > 60:
            raise ValueError("no tyre left")
        super().step(steer_cmd, accel_cmd, seconds)

class Short(Bicycle):
    def step(self, steer_cmd, accel_cmd):
        pass

class Elsewhere(Bicycle):
    def outputs(self):
        return super().outputs() | {"x": 1000.0}

class Leaves(Bicycle):
    def step(self, steer_cmd, accel_cmd, seconds):
        raise SystemExit(3)

def Function(x, y):
    pass

class Backwards(Bicycle):
    def __init__(self, *start):
        super().__init__(*start, gain=-1.0)
"""


@pytest.mark.parametrize(
    ("name", "words"),
    {
        "missing.py:Car": "no plant at",
        "plants.py:Nobody": "no class or function 'Nobody'; classes there: NoYaw, Nan",
        "broken.py:Car": "broken.py, line 1",
        "car.txt": "FILE.py:CLASS or FILE.fmu",
        "missing.fmu": "no FMU at",
        "broken.py.fmu": "no co-simulation FMU 2.0",
        "plants.py:NoYaw": "NoYaw.outputs() has no 'yaw': a controller needs x, y, yaw",
        "plants.py:Nan": "Nan.outputs() at t = 0.02 s: vy is nan",
        "plants.py:Raises": "Raises.step() at t = 1.20 s raised ValueError: no tyre left (",
        "plants.py:Short": "it is called as Short.step(steer_cmd, accel_cmd, seconds)",
        "plants.py:Elsewhere": "begin where you are told, in metres and radians",
        "plants.py:Leaves": "Leaves.step() at t = 0.00 s raised SystemExit: 3",
        "plants.py:Function": "it is called as Function(x, y, yaw, speed)",
        "plants.py:Backwards": "The wheels turn against the command (gain -1.00)",
    }.items(),
)
def test_bad_plants_are_explained(name, words, rfl, fmus, paths, tmp_path, monkeypatch):
    (tmp_path / "plants.py").write_text(PLANTS)
    (tmp_path / "broken.py").write_text("class Car(:\n")
    (tmp_path / "broken.py.fmu").write_text("no zip\n")
    monkeypatch.setenv("PYTHONPATH", f"{Path(__file__).parent}:{SCRIPT.parent}")
    out = tmp_path / "out"
    _, printed = ladder(out, rfl, fmus, paths, "--plant", tmp_path / name, "--roads", 0, ok=False)
    assert words in printed, printed
    if "drive: " in printed:
        assert (out / "drive_1.csv").is_file()


@pytest.mark.parametrize(
    ("mapping", "words"),
    {
        "yaw=psi": "PassengerCar.fmu has no 'psi'",
        "heading=yaw": "no such signal",
        "yaw=x*yaw": "NAME=FACTOR*FMU_NAME",
        "steer_cmd=roll": "no input 'steer_cmd'",
    }.items(),
)
def test_bad_mappings_are_explained(mapping, words, fmus):
    with pytest.raises(plant.PlantError) as caught:
        plant.plant_of(str(fmus / "PassengerCar.fmu"), {}, [mapping])
    assert words in str(caught.value)


def test_the_simpler_of_equal_controllers_is_recommended():
    figures = learn.Figures(COMPLETED, "", 10.0, 0.010, 0.010, 0.05, Path("log"), True, None, None)
    as_good, lost = replace(figures, mean=0.0099), replace(figures, outcome=LOST)
    assert learn.better({"default": [figures], "identified": [as_good], "learned": [as_good]}) == "default"
    assert (
        learn.better({"default": [figures], "identified": [lost], "learned": [replace(figures, mean=0.005)]})
        == "learned"
    )
    assert learn.better({"default": [lost], "identified": [figures]}) == "identified"


def test_what_stands_otherwise_in_the_steering_is_said():
    def number(value, spread, excited=True):
        return {"value": value, "low": value - spread, "high": value + spread, "excited": excited}

    sound = {"gain": number(1.0, 0.001), "offset": number(0.0, 1e-4)}
    assert learn.stands_otherwise(sound, True) == []
    [gain, offset] = learn.stands_otherwise({"gain": number(0.85, 0.001), "offset": number(-0.01, 1e-3)}, True)
    assert "0.850 times the command" in gain and "actuator.gain=0.850" in gain
    assert "0.57 degrees to the right" in offset and "actuator.offset=-0.0100" in offset
    # Through the yaw rate a gain is that of the tyres as well; what is not excited is not said.
    assert learn.stands_otherwise(sound | {"gain": number(0.85, 0.001)}, False) == []
    assert learn.stands_otherwise(sound | {"offset": number(0.01, 1e-3, False)}, True) == []
    # What the controller is told need not be said to it, and what it is told wrongly is said.
    other = {"gain": number(0.93, 0.001), "offset": number(0.02, 1e-4)}
    assert learn.stands_otherwise(other, True, {"actuator.gain": "0.93", "actuator.offset": 0.02}) == []
    assert len(learn.stands_otherwise(sound, True, {"actuator.gain": "0.93"})) == 1


def test_an_articulation_of_the_other_sign_is_noticed():
    turn = 0.1 * np.sin(np.linspace(0.0, 20.0, 500))
    trailing = np.roll(turn, 20)
    assert not plant.turns_against({"yaw_rate": turn, "articulation": trailing})
    assert plant.turns_against({"yaw_rate": turn, "articulation": -trailing})
    assert not plant.turns_against({"yaw_rate": 0.01 * turn, "articulation": -trailing})
    assert not plant.turns_against({"yaw_rate": turn})
