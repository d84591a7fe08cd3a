#!/usr/bin/env python3
"""Learns a vehicle of your own in one go: drives it, identifies its steering, collects, trains, proves.

    scripts/learn --plant my_plant.py:Suv --vehicle my_car.toml
    scripts/learn --plant MyCar.fmu --vehicle my_car.toml --map yaw=0.0174533*psi_deg
    scripts/learn --plant PassengerCar.fmu --set plant.effect.steer_lag=0.1      a parameter of the plant

The plant is a class or a function of a Python file, NAME(x, y, yaw, speed), with

    outputs() -> dict                       x, y, yaw, vx, vy, yaw_rate; steer if it is measured
    step(steer_cmd, accel_cmd, seconds)

or a co-simulation FMU 2.0 with variables of these names (`--map` for others) and, if it can be placed, the parameters
initial.x, initial.y, initial.yaw, initial.vx. SI units, radians, ISO 8855. The vehicle file is what the controller
knows of it.

The ladder, that of `rfl learn`:

1. drive: the default controller on the training road; lost, with the steering that the lost drive shows; then slower;
2. identify: dead time and lag of the steering from that drive; from here on the controller begins with them;
3. collect: calmly, with dither, on the training road and on random ones;
4. train: `rfl train`, which refuses a model that is not better in simulated closed loop;
5. faster: where the first drive had to be slow, with what was learned, a level at a time, and trained again;
6. prove: default, identified and learned on roads that none was learned on.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import math
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from closed_loop import FMUS, KINDS, Drive, kind_of, known
from outcome import COMPLETED, TIMED_OUT, tracking, write_whole
from plant import AGAINST, FmuPlant, PythonPlant, controller_for, drive, plant_of, plot_errors

ROOT = Path(__file__).resolve().parent.parent
ROADS = {"car": ("sudoku_train", "sudoku_test"), "truck": ("truck_train", "truck_test")}  # to learn on, to prove on
CALM = {"mpc.tightening": 1.0}  # as rfl collect
DITHER = {"car": 0.01, "truck": 0.005}  # rad, as rfl collect
# First seeds of the random roads, those of `rfl learn`: no other command's.
COLLECT_SEED, PROVE_SEED = 55_000_000, 56_000_000
PROVE_ROADS = 2
# Speed and lateral acceleration of the next slower level, as shares, and such levels.
SLOWER = {"speed.limit": 0.7, "speed.lateral_accel": 0.5}
LEVELS = 4
# Seconds by which the sum of dead time and lag has to differ from what a lost drive began with, to try it again.
NEWS = 0.02
# Deviation of a steering's gain from 1, and of its offset from 0 in rad, that counts as none: those of `rfl identify`.
NO_GAIN, NO_OFFSET = 0.01, 5e-4
# A more complicated controller has to cut the mean error by this share to be called better.
LEAST_GAIN = 0.02
# Lateral error in m by which a largest error is larger than another.
WIDER = 0.005
# Exit status where nothing beats the default controller; that of `rfl train` where it refuses a model.
NOT_BETTER = 3
MODEL = "model.rflm"
MODELS = ("linear", "rt", "rf", "rtl", "rfl", "rfl_s")  # kinds that rfl train proves


class Failure(RuntimeError):
    """The ladder ends here, and why."""


@dataclass(frozen=True)
class Job:
    """A drive to make, in a process of its own."""

    name: str
    road: Path
    vehicle: str
    plant: PythonPlant | FmuPlant
    settings: dict[str, object]
    log: Path
    fmus: Path


@dataclass(frozen=True)
class Figures:
    """What a drive gave; its rows are in the log."""

    outcome: str
    reason: str
    duration: float  # s
    mean: float  # m
    rms: float  # m
    max: float  # m
    log: Path
    steer: bool  # whether the angle was measured
    departed: float | None  # s, when it left its lane
    fault: str | None  # what failed in the plant
    statuses: str = ""  # those beside `optimal`, with their times
    against: bool = False  # a trailer leads its tractor into turns

    @property
    def completed(self) -> bool:
        """Driven to the road's end, in its lane all the way."""
        return self.outcome == COMPLETED

    def __str__(self) -> str:
        if not self.completed:
            return f"{self.duration:.0f} s; {self.outcome}: {self.reason}"
        return (
            f"{self.duration:.0f} s, lateral error mean {1e3 * self.mean:.2f} mm, max {1e3 * self.max:.1f} mm; "
            f"{self.outcome}{f'; {self.statuses}' if self.statuses else ''}"
        )

    def json(self) -> dict:
        """For learn.json."""
        names = ("outcome", "reason", "duration", "mean", "rms", "max", "statuses")
        return {name: getattr(self, name) for name in names} | {"log": str(self.log)}


def make(job: Job) -> Figures:
    """Makes a drive and writes its log, however it ended."""
    result = drive(job.road, job.vehicle, job.plant, job.settings, fmus=job.fmus)
    result.write_csv(job.log)
    errors, columns = tracking(result.columns), result.columns
    duration = float(columns["time"][-1]) if len(columns["time"]) else 0.0
    return Figures(
        result.outcome,
        result.ending.reason,
        duration,
        errors["mae"],
        errors["rmse"],
        errors["max"],
        job.log,
        "steer" in columns,
        result.ending.departure and result.ending.departure.time,
        str(result.fault) if result.fault else None,
        unusual(result),
        result.against,
    )


def unusual(result: Drive) -> str:
    """Statuses of a drive beside `optimal`, and how long each lasted: `slowed for 0.9 s`."""
    words = result.words.get("status", {})
    rows = Counter(words.get(int(status), "unknown") for status in result.columns.get("status", ()))
    return ", ".join(
        f"{word} for {count * result.step:.1f} s" for word, count in rows.items() if word not in ("optimal", "finished")
    )


@dataclass
class Ladder:
    """The steps, one after the other, and what they found."""

    plant: PythonPlant | FmuPlant
    vehicle: str
    given: dict[str, object]  # settings of the controller that the user gave
    training: Path
    test: Path
    out: Path
    rfl: Path
    fmus: Path
    pool: ProcessPoolExecutor
    roads: int
    seed: int
    kind: str  # of model
    quiet: bool
    levels: list[dict[str, float]] = field(default_factory=list)  # speeds, full speed first
    steering: dict[str, float] = field(default_factory=dict)  # actuator.* as found
    model: Path | None = None
    report: dict = field(default_factory=dict)

    def climb(self) -> int:
        """All steps; the exit status. What was found until a failure is written, too."""
        self.clear()
        try:
            return self.steps()
        except RuntimeError as error:
            self.report["failed"] = str(error)
            self.write_report()
            raise

    def steps(self) -> int:
        """All steps; the exit status."""
        with closing(controller_for(self.training, self.vehicle, self.given, self.fmus)) as controller:
            full = {name: controller.get(name) for name in SLOWER}
        self.levels = [{name: round(full[name] * share**k, 4) for name, share in SLOWER.items()} for k in range(LEVELS)]
        roads = self.random_roads("collect", COLLECT_SEED, self.roads)
        proving = [(f"test road {self.test.stem}", self.test), *self.random_roads("prove", PROVE_SEED, PROVE_ROADS)]

        level, first = self.first_drive()
        self.identify(first)
        logs = [first.log, *self.collect(level, [(f"training road {self.training.stem}", self.training), *roads])]
        self.train(logs)
        level = self.faster(level, logs)
        return self.prove(level, proving)

    # -- Steps ------------------------------------------------------------------------------------------------------

    def first_drive(self) -> tuple[int, Figures]:
        """The default controller, as fast as it stays on the road: level of speed and drive.

        A lost drive may show the steering: the next one begins with it, once at the same speed, if that is news.
        """
        level, again = 0, False
        while level < LEVELS:
            speed = self.speed(level)
            log = f"drive_{len(self.report.get('drive', [])) + 1}.csv"
            result = self.drive([self.job("drive", self.training, self.steering | speed, log)])[0]
            print(f"1 drive: {result}")
            self.report.setdefault("drive", []).append(result.json() | {"settings": self.steering | speed})
            if result.fault:
                raise Failure(f"{result.fault}; the drive until then: {result.log}")
            if result.against:
                print(f"  {AGAINST}")
            if result.completed:
                return level, result
            if result.outcome == TIMED_OUT:
                break
            before = sum(self.steering.values())
            self.identify(result)
            again = not again and abs(sum(self.steering.values()) - before) > NEWS
            if not again:
                level += 1
                if level < LEVELS:
                    print(f"  slower: up to {said(self.levels[level])}")
        how = "" if result.outcome == TIMED_OUT else ", however slowly it drives"
        gain = self.report.get("identify", {}).get("gain", {}).get("value") or 1.0
        turned = f"The wheels turn against the command (gain {gain:.2f}). " if gain < 0.0 else ""
        raise Failure(
            f"the vehicle does not get along {self.training}{how} ({result.outcome}: {result.reason}). {turned}"
            f"Look at {result.log}: do signs and units fit (radians, positive to the left), and does {self.vehicle} "
            "describe this vehicle?"
        )

    def identify(self, drive: Figures) -> None:
        """Dead time and lag of the steering from a drive, as long as it was in its lane."""
        report = self.out / "identify.json"
        report.unlink(missing_ok=True)
        by = [] if drive.steer else ["--by-yaw-rate"]
        until = [] if drive.departed is None else ["--until", drive.departed]
        done = self.call("identify", drive.log, "--vehicle", self.vehicle, "--no-check", "--json", report, *by, *until)
        kept = "the controller begins with what it had"
        if done.returncode != 0:
            print(f"2 identify: {said_by(done)}; {kept}")
            self.report["identify"] = {"failed": said_by(done)}
            return
        found = json.loads(report.read_text(encoding="utf-8"))
        self.report["identify"] = found
        dead_time, lag, both = (found[name]["value"] for name in ("dead_time", "lag", "delay"))
        numbers = (
            f"dead time {dead_time:.3f} s, lag {lag:.3f} s, together {both:.3f} s "
            f"({found['delay']['low']:.3f} to {found['delay']['high']:.3f})"
        )
        if not found["delay"]["excited"]:
            print(f"2 identify: the drive does not show the steering ({numbers}); {kept}")
            return
        # To a tenth of a millisecond, as `rfl identify` writes them.
        self.steering = {"actuator.dead_time": round(dead_time, 4), "actuator.time_constant": round(lag, 4)}
        print(f"2 identify: {numbers}, by {'the angle' if drive.steer else 'the yaw rate'}")
        for line in stands_otherwise(found, drive.steer, self.numbers):
            print(f"  {line}")

    def collect(self, level: int, roads: list[tuple[str, Path]]) -> list[Path]:
        """Drives to learn from, calm and with dither; one that is lost is tried slower once. Gives their logs."""
        kept = []
        pending = list(enumerate(roads, start=1))
        for attempt in range(2):
            speed = self.speed(min(level + attempt, LEVELS - 1))
            jobs = [
                self.job(
                    name,
                    road,
                    self.steering | speed | CALM | self.dither(number + 50 * attempt),
                    f"collect_{number}{'_slower' if attempt else ''}.csv",
                )
                for number, (name, road) in pending
            ]
            lost = []
            for numbered, job, result in zip(pending, jobs, self.drive(jobs)):
                print(f"3 collect: {job.name}{' (slower)' if attempt else ''}: {result}")
                self.report.setdefault("collect", []).append(result.json() | {"road": job.name})
                if result.completed:
                    kept.append(result.log)
                elif not result.fault:
                    lost.append(numbered)
            pending = lost
            if not pending or level + 1 == LEVELS:
                break
        return kept

    def train(self, logs: list[Path]) -> None:
        """Learns a model, unless it is no better in simulation."""
        draft, report = self.out / "draft.rflm", self.out / "train.json"
        report.unlink(missing_ok=True)
        done = self.call(
            *("train", *logs, "--vehicle", self.vehicle, "--kind", self.kind, "--seed", self.seed),
            *("--out", draft, "--json", report, "--quiet"),
            *(part for name, value in (self.numbers | self.steering).items() for part in ("--set", f"{name}={value}")),
        )
        (self.out / "train.txt").write_text(done.stdout, encoding="utf-8")
        found = json.loads(report.read_text(encoding="utf-8")) if report.is_file() else {}
        model = (found.get("models") or [{}])[0]
        refused = None if done.returncode == 0 else said_by(done)
        word = "refused" if done.returncode == NOT_BETTER else "failed"
        text = f"{found['data']['labels']} samples" if "data" in found else ""
        if proof := model.get("proof"):
            learned, default = (proof[name] for name in ("learned", "default"))
            text += (
                f"; in simulation mean {1e3 * learned['mean']:.2f} mm, max {1e3 * learned['max']:.1f} mm, lost "
                f"{learned['lost']} (default: {1e3 * default['mean']:.2f} mm, {1e3 * default['max']:.1f} mm, "
                f"{default['lost']})"
            )
        self.report.setdefault("train", []).append({"logs": len(logs), "refused": refused} | found)
        if refused:
            earlier = "; the model before is kept" if self.model else ""
            print(f"4 train: {text}{'; ' if text else ''}{word}: {without_advice(refused)}{earlier}")
            return
        self.model = self.out / MODEL
        draft.replace(self.model)
        print(f"4 train: {text}; {self.model}")

    def faster(self, level: int, logs: list[Path]) -> int:
        """From the level of speed that was driven to full speed, as far as the vehicle stays on the road."""
        while level > 0:
            speed, number = self.speed(level - 1), LEVELS - level
            for name, settings in {"learned": self.best(), "identified": self.steering}.items():
                if name == "learned" and not self.model:
                    continue
                log = f"faster_{number}_{name}.csv"
                job = self.job("faster", self.training, settings | speed | self.dither(90 + number), log)
                result = self.drive([job])[0]
                print(f"5 faster: {name}, up to {said(self.levels[level - 1])}: {result}")
                faster = {"controller": name, "speed": self.levels[level - 1]}
                self.report.setdefault("faster", []).append(result.json() | faster)
                if result.completed:
                    break
            else:
                break
            level -= 1
            logs.append(result.log)
            self.train(logs)
        return level

    def prove(self, level: int, roads: list[tuple[str, Path]]) -> int:
        """Default, identified and learned on roads of their own; the exit status."""
        speed = self.speed(level)
        if level:
            print(f"  full speed was not reached: proved at up to {said(self.levels[level])}")
        rows: dict[str, dict[str, object]] = {"default": {}}
        if self.steering:
            rows["identified"] = self.steering
        if self.model:
            rows["learned"] = self.best()
        jobs = {
            (name, row): self.job(f"{name}, {row}", road, settings | speed, f"prove_{number}_{row}.csv")
            for number, (name, road) in enumerate(roads, start=1)
            for row, settings in rows.items()
        }
        proof = dict(zip(jobs, self.drive(list(jobs.values()))))
        width = max(len(name) for name, _ in roads) + 2
        print(f"{'6 prove':<{width}}{'':<12}{'mean mm':>9}{'max mm':>9}  outcome")
        for (name, row), result in proof.items():
            print(f"{name:<{width}}{row:<12}{1e3 * result.mean:>9.2f}{1e3 * result.max:>9.1f}  {result.outcome}")
        for result in proof.values():
            if result.fault:
                print(f"  {result.fault}")
        drives = {row: [proof[name, row] for name, _ in roads] for row in rows}
        self.report["proof"] = [
            {"road": name, "controller": row} | result.json() for (name, row), result in proof.items()
        ]
        self.draw(roads, proof)
        return self.conclude(level, rows, drives)

    def conclude(self, level: int, rows: dict[str, dict[str, object]], drives: dict[str, list[Figures]]) -> int:
        """What is recommended, how to use it, and the files; the exit status."""
        best = better(drives)
        use = {"vehicle_file": self.vehicle} | self.given | self.speed(level) | rows[best]
        rejected = list(rows)[list(rows).index(best) + 1 :]
        if rejected:
            print(
                f"{' and '.join(rejected)} {'is' if len(rejected) == 1 else 'are'} no better than {best} on this plant"
            )
        if not self.model:
            print("no model was learned (4 train says why)")
        if lost := [drive for drive in drives[best] if not drive.completed]:
            print(
                f"{best} did not get along {len(lost)} of {len(drives[best])} roads: drive slower than that (speed.*)"
            )
        if best == "default":
            print("nothing beats the default controller: use it as it is")
        worst = max(drives[best], key=lambda drive: drive.max)
        print(f"{best}: lateral error up to {1e3 * worst.max:.0f} mm ({worst.log.name})")
        if wider := [d.log.name for d, base in zip(drives[best], drives["default"]) if d.max > base.max + WIDER]:
            print(f"its mean error is less than the default controller's, its largest is more in {', '.join(wider)}")
        if self.steering:
            write_whole(
                self.out / "controller.toml", controller_file(self.kind_of_vehicle, self.vehicle, self.steering)
            )
        fmu = KINDS[self.kind_of_vehicle][0]
        self.report |= {
            "speed": {"full": self.levels[0], "reached": self.levels[level]},
            "steering": self.steering or None,
            "model": str(self.model) if self.model else None,
            "recommended": best,
            "use": {"fmu": f"{fmu}.fmu"} | use,
        }
        self.write_report()
        print(f"logs and learn.json in {self.out}")
        print(f"use ({best}): {fmu}.fmu with {', '.join(f'{name}={value}' for name, value in use.items())}")
        return 0 if best != "default" else NOT_BETTER

    # -- What they need -----------------------------------------------------------------------------------------------

    @property
    def kind_of_vehicle(self) -> str:
        """`car` or `truck`."""
        return kind_of(self.vehicle)

    @property
    def numbers(self) -> dict[str, object]:
        """The user's settings that are numbers: training is to know them."""
        return {name: value for name, value in self.given.items() if is_number(value)}

    def best(self) -> dict[str, object]:
        """The controller with what has been learned until now."""
        return self.steering | ({"residual.file": str(self.model.resolve())} if self.model else {})

    def speed(self, level: int) -> dict[str, float]:
        """Settings of a level of speed; full speed is the controller's own."""
        return self.levels[level] if level else {}

    def dither(self, number: int) -> dict[str, object]:
        """Random steering for a drive to learn from."""
        seed = (100 * self.seed + number) % 1_000_000
        return {"mpc.dither": DITHER[self.kind_of_vehicle], "mpc.dither_seed": seed}

    def job(self, name: str, road: Path, settings: dict[str, object], log: str) -> Job:
        """A drive with these settings, which win over those that the user gave."""
        return Job(name, road, self.vehicle, self.plant, self.given | settings, self.out / log, self.fmus)

    def drive(self, jobs: list[Job]) -> list[Figures]:
        """Makes drives side by side; their order is that of the jobs."""
        results = []
        try:
            for job, result in zip(jobs, self.pool.map(make, jobs)):
                if not self.quiet and len(jobs) > 1:
                    print(f"  {len(results) + 1} of {len(jobs)}: {job.name}", file=sys.stderr, flush=True)
                results.append(result)
        except BrokenProcessPool as error:
            raise Failure(f"{self.plant.label} ended its process; it has to raise an exception instead") from error
        return results

    def random_roads(self, what: str, first: int, count: int) -> list[tuple[str, Path]]:
        """Roads of seeds; every third is closed."""
        roads = []
        for number in range(count):
            seed = first + 1000 * self.seed + number
            file = self.out / "roads" / f"{what}_{number + 1}.csv"
            file.parent.mkdir(parents=True, exist_ok=True)
            closed = ["--closed"] if number % 3 == 2 else []
            done = self.call("course", "--random", self.kind_of_vehicle, "--seed", seed, "--out", file, *closed)
            if done.returncode != 0:
                raise Failure(f"rfl course: {said_by(done)}")
            roads.append((f"random road {seed}", file))
        return roads

    def call(self, *words: object) -> subprocess.CompletedProcess:
        """Runs our program."""
        command = [str(self.rfl), *map(str, words)]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    def clear(self) -> None:
        """Takes away what an earlier run left and would be taken for this one's."""
        self.out.mkdir(parents=True, exist_ok=True)
        names = ("learn.json", "controller.toml", "identify.json", "train.json", "lateral_error.png", MODEL)
        for file in (self.out / name for name in names):
            file.unlink(missing_ok=True)
        for log in (log for what in ("drive", "collect", "faster", "prove") for log in self.out.glob(f"{what}_*.csv")):
            log.unlink()

    def write_report(self) -> None:
        """Everything, for programs."""
        asked = {"plant": self.plant.label, "vehicle": self.vehicle, "settings": self.given, "seed": self.seed}
        write_whole(self.out / "learn.json", json.dumps(known(asked | self.report), indent=2) + "\n")

    def draw(self, roads: list[tuple[str, Path]], proof: dict[tuple[str, str], Figures]) -> None:
        """The lateral error on each road."""
        if importlib.util.find_spec("matplotlib") is None:
            print("no picture: matplotlib is not installed (scripts/setup --plots)")
            return
        panels = []
        for name, _ in roads:
            of_road = {row: result for (road, row), result in proof.items() if road == name}
            lines = [
                (f"{row} (mean {1e3 * r.mean:.1f} mm{'' if r.completed else f', {r.outcome}'})", r.log)
                for row, r in of_road.items()
                if r.duration > 0.0
            ]
            panels.append((name, lines))
        plot_errors(panels, self.out / "lateral_error.png")


def stands_otherwise(found: dict, by_angle: bool, told: dict[str, object] | None = None) -> list[str]:
    """Gain and offset of the steering, in words, where they are not those that the controller is told, else 1 and 0."""
    said = []
    told = told or {}

    def differs(number: dict, name: str, usual: float, negligible: float) -> bool:
        known = float(str(told.get(name, usual)))
        is_known = abs(number["value"] - known) <= negligible or number["low"] <= known <= number["high"]
        return number["excited"] and not is_known

    gain, offset = found["gain"], found["offset"]
    if by_angle and differs(gain, "actuator.gain", 1.0, NO_GAIN):
        said.append(
            f"the measured angle is {gain['value']:.3f} times the command ({gain['low']:.3f} to {gain['high']:.3f}): "
            f"if the wheels turn so, too, say it to the controller, --set actuator.gain={gain['value']:.3f}"
        )
    if differs(offset, "actuator.offset", 0.0, NO_OFFSET):
        degrees = math.degrees(offset["value"])
        side = "left" if degrees > 0.0 else "right"
        said.append(
            f"{'the measured angle' if by_angle else 'the steering'} stands {abs(degrees):.2f} degrees to the {side} "
            "without a command: if the wheels do, too, say it to the controller, "
            f"--set actuator.offset={offset['value']:.4f}"
        )
    return said


def better(rows: dict[str, list[Figures]]) -> str:
    """The best controller, named; one that is more complicated has to be better, not as good."""

    def score(drives: Iterable[Figures]) -> tuple[int, float]:
        drives = list(drives)
        arrived = [drive.mean for drive in drives if drive.completed]
        return len(drives) - len(arrived), sum(arrived) / len(arrived) if arrived else math.inf

    best, *others = rows
    for row in others:
        (lost, mean), (least, bar) = score(rows[row]), score(rows[best])
        if lost < least or (lost == least and mean < (1.0 - LEAST_GAIN) * bar):
            best = row
    return best


def said(speed: dict[str, float]) -> str:
    """A level of speed in words."""
    return f"{speed['speed.limit']:.1f} m/s, {speed['speed.lateral_accel']:.2f} m/s2"


def said_by(done: subprocess.CompletedProcess) -> str:
    """Why our program refused."""
    lines = [line for line in done.stderr.strip().splitlines() if line.strip()]
    return lines[-1].removeprefix("error: ") if lines else f"exit status {done.returncode}"


def without_advice(refused: str) -> str:
    """The reason alone: the advice that follows is for plants of ours."""
    reason = refused.removeprefix("no model is written, for it is not shown to be better than the default controller: ")
    for advice in (". The default controller ", ". The steering is not excited", ". rfl diagnose "):
        reason = reason.partition(advice)[0]
    return reason


def controller_file(kind: str, vehicle: str, values: dict[str, float]) -> str:
    """The steering as a controller file, which `rfl drive --controller` and `fmu-build --controller` read."""
    numbers = "".join(f"{name} = {value!r}\n" for name, value in values.items())
    head = "# The steering as scripts/learn found it: what the controller begins with."
    return f"{head}\nkind = {json.dumps(kind)}\nvehicle = {json.dumps(Path(vehicle).stem)}\n\n[controller]\n{numbers}"


def is_number(value: object) -> bool:
    """Whether it can be given to `rfl train --set`."""
    try:
        float(str(value))
    except ValueError:
        return False
    return True


def settings_of(texts: list[str]) -> tuple[dict[str, object], dict[str, str]]:
    """Settings of the controller and of the plant (`plant.NAME`); a value that is a file gets its whole path."""
    controller: dict[str, object] = {}
    plant: dict[str, str] = {}
    for text in texts:
        name, separator, value = text.partition("=")
        if not separator or not name:
            raise ValueError(f"--set wants NAME=VALUE, not '{text}'")
        value = str(Path(value).resolve()) if Path(value).is_file() else value
        owner, _, rest = name.partition(".")
        if owner == "plant":
            plant[rest] = value
        else:
            controller[rest if owner == "controller" else name] = value
    return controller, plant


def run(options: argparse.Namespace) -> int:
    """The ladder as it was asked for."""
    begin = time.perf_counter()
    given, of_plant = settings_of(options.set)
    vehicle = options.vehicle
    if Path(vehicle).is_file():
        vehicle = str(Path(vehicle).resolve())
    elif vehicle.endswith(".toml"):
        raise ValueError(f"--vehicle: there is no file {vehicle}")
    training, test = (ROOT / "paths" / f"{name}.csv" for name in ROADS[kind_of(vehicle)])
    training, test = options.path or training, options.test or test
    for road in (training, test):
        if not road.is_file():
            raise ValueError(f"there is no road {road}")
    if training.samefile(test):
        raise ValueError(f"{test} is the road to learn on: prove on another one (--test)")
    if not options.rfl.is_file():
        raise ValueError(f"no program at {options.rfl}: scripts/learn builds it, --rfl names another")
    plant = plant_of(options.plant, of_plant, options.map)
    for note in plant.notes():
        print(f"note: {note}")
    with ProcessPoolExecutor(options.jobs) as pool:
        ladder = Ladder(
            plant=plant,
            vehicle=vehicle,
            given=given,
            training=training,
            test=test,
            out=options.out,
            rfl=options.rfl,
            fmus=options.fmus,
            pool=pool,
            roads=options.roads,
            seed=options.seed,
            kind=options.kind,
            quiet=options.quiet,
        )
        status = ladder.climb()
    if not options.quiet:
        print(f"{time.perf_counter() - begin:.0f} s", file=sys.stderr)
    return status


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="exit status: 0 something beats the default controller; 1 bad input or a failure; 2 wrong usage; "
        "3 nothing does",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--plant", required=True, metavar="FILE.py:NAME|FILE.fmu", help="the vehicle to learn")
    parser.add_argument(
        "--vehicle",
        default="c_class",
        help="what the controller knows of it: a TOML file or a built-in name (default: %(default)s)",
    )
    parser.add_argument(
        "--path", type=Path, help="road to learn on, a CSV with x and y (default: paths/sudoku_train.csv)"
    )
    parser.add_argument("--test", type=Path, help="road to prove on (default: paths/sudoku_test.csv)")
    parser.add_argument("--out", type=Path, default=Path("out/learn_plant"), help="folder (default: %(default)s)")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a parameter of the controller; plant.NAME: of the plant, in Python an argument; repeatable",
    )
    parser.add_argument(
        "--map",
        action="append",
        default=[],
        metavar="NAME=[FACTOR*]FMU_NAME",
        help="a signal's name in the FMU, and what it is multiplied by to be in SI units; repeatable",
    )
    parser.add_argument("--kind", choices=MODELS, default="rfl_s", help="kind of model (default: %(default)s)")
    parser.add_argument("--roads", type=int, default=6, help="random roads to collect on (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of roads, dither and training (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=2, help="processes; the result is the same (default: %(default)s)")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    parser.add_argument("--rfl", type=Path, default=ROOT / "target" / "release" / "rfl", help="the program")
    parser.add_argument("--fmus", type=Path, default=FMUS, help="folder of the FMUs (default: %(default)s)")
    options = parser.parse_args()
    if options.jobs < 1 or options.roads < 0 or options.seed < 0:
        parser.error("--jobs is at least 1, --roads and --seed at least 0")
    sys.stdout.reconfigure(line_buffering=True)
    try:
        return run(options)
    except (RuntimeError, ValueError, OSError) as error:
        print(f"learn: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
