#!/usr/bin/env python3
"""Drives a vehicle's FMU with its controller's in fmpy: the co-simulation master to copy and change.

    scripts/closed_loop.py --path road.csv --vehicle car.toml --duration 60 --log drive.csv
    scripts/closed_loop.py --vehicle truck_simulation

Master algorithm, with a fixed communication step h and t_k = k h. Gauss-Seidel (default): the controller steps
first, and the vehicle gets its answer at the same communication point:

    read the vehicle's state x_k
    controller: set x_k, step from t_k to t_k + h, read the command u_k
    vehicle:    set u_k, step from t_k to t_k + h

so the loop has no delay beyond the controller's sampling. Jacobi (`--jacobi`), what most tools do: both step on the
other's outputs at t_k, so the vehicle gets u_{k-1}, one communication step late.

A row of the log is what is true at t_k: the vehicle's state, and the command that holds from t_k to t_k + h. The last
column, `status`, is the controller's status in a word.

A drive is `completed`, `stopped`, `lost` or `timed_out`, as that of `rfl drive` (`outcome.py`). Nothing stands between
the FMUs here: the pose that the controller is given, and judges its error by, is the vehicle's own.
"""

from __future__ import annotations

import argparse
import csv
import ctypes
import io
import itertools
import json
import math
import re
import shutil
import sys
import time
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import NoReturn

import fmpy
import fmpy.fmi2
import fmpy.logging
import numpy as np
from fmpy.fmi1 import FMICallException, printLogMessage
from outcome import (
    COMPLETED,
    LANE,
    LOST,
    STATUSES,
    STOPPED,
    TIMED_OUT,
    Check,
    Ending,
    Place,
    Referee,
    Requirement,
    check_files,
    exit_status,
    figures_help,
    is_junit,
    step_times,
    tracking,
    write_junit,
    write_whole,
)
from progress import Progress

PROJECT = Path(__file__).resolve().parent.parent
FMUS = PROJECT / "target" / "fmu"
KINDS = {"car": ("RflMpc", "PassengerCar"), "truck": ("TruckRflMpc", "SemiTrailerTruck")}  # controller, vehicle
STEP = 0.02  # s, the controller's sampling time
STEPS = (0.001, 0.2)  # s, range of it
LIMIT = 1800.0  # s, a drive that has not finished by then is given up

# fmpy expands the printf-style messages of FMUs in C and hands them to one logger in the whole process: this one, which
# finds the list of an instance by what the instance was given as its environment.
_LISTENERS: dict[int, list] = {}
_KEYS = itertools.count(1)


def _listen(environment, instance, status, category, message) -> None:
    if environment in _LISTENERS:
        texts = (text.decode("utf-8", "replace") if text else "" for text in (category, message))
        _LISTENERS[environment].append((status, *texts))
    else:
        printLogMessage(environment, instance, status, category, message)


_SHARED = fmpy.fmi2.fmi2CallbackFunctions(fmpy.fmi2.fmi2CallbackLoggerTYPE(_listen))
fmpy.logging.addLoggerProxy(ctypes.byref(_SHARED))


def callbacks_into(messages: list[tuple[int, str, str]]) -> fmpy.fmi2.fmi2CallbackFunctions:
    """Callbacks for an instance; its messages are appended to the list as (status, category, text)."""
    key = next(_KEYS)
    _LISTENERS[key] = messages
    return fmpy.fmi2.fmi2CallbackFunctions(
        _SHARED.logger,
        fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc),
        fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free),
        componentEnvironment=key,
    )


class Unit:
    """One instance of a co-simulation FMU, with reads and writes of many reals in one call.

    fmpy's getReal builds its arrays anew at each call; here they are made once. What the FMU logs is kept in
    `messages` as (status, category, text).
    """

    def __init__(self, file: Path, name: str) -> None:
        if not Path(file).is_file():
            raise FileNotFoundError(f"no FMU at {file}: build it with scripts/build-fmus")
        self.description = fmpy.read_model_description(str(file))
        if self.description.fmiVersion != "2.0":
            raise ValueError(f"{file} is of FMI {self.description.fmiVersion}: this master takes FMUs of FMI 2.0")
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.messages: list[tuple[int, str, str]] = []
        self._folder = fmpy.extract(str(file))
        self.fmu = fmpy.fmi2.FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=self._folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate(callbacks=callbacks_into(self.messages))
        self._step = self.fmu.dll.fmi2DoStep
        self._component = ctypes.c_void_p(self.fmu.component)

    def names(self, causality: str, kind: str | None = None) -> list[str]:
        """Names of the variables of a causality, in the description's order."""
        return [n for n, v in self.variables.items() if v.causality == causality and kind in (None, v.type)]

    def set(self, name: str, value: float | int | bool | str) -> None:
        """Sets one variable of any type; text is converted to the variable's type, an enumeration's by name."""
        variable = self.variables[name]
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        if variable.type == "Enumeration":
            named = {item.name: int(item.value) for item in variable.declaredType.items}
            value = named.get(value, value)
        if kind == "Boolean" and isinstance(value, str):
            value = value.lower() in ("1", "true", "yes", "on")
        try:
            value = {"Real": float, "Integer": int, "Boolean": bool, "String": str}[kind](value)
        except ValueError as error:
            wanted = f"one of {', '.join(named)}" if variable.type == "Enumeration" else f"a {kind.lower()}"
            raise ValueError(f"{name} is {wanted}: '{value}' cannot be set") from error
        self._checked(lambda: getattr(self.fmu, f"set{kind}")([variable.valueReference], [value]), f"setting {name}")

    def get(self, name: str) -> float | int | bool | str:
        """Reads one variable of any type."""
        variable = self.variables[name]
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        value = getattr(self.fmu, f"get{kind}")([variable.valueReference])[0]
        return bool(value) if kind == "Boolean" else value.decode() if kind == "String" else value

    def items(self, name: str) -> dict[int, str]:
        """The words of an enumeration by number."""
        return {int(item.value): item.name for item in self.variables[name].declaredType.items}

    def initialize(self, start_time: float = 0.0) -> None:
        """From instantiated to ready for the first step."""
        for call in (
            lambda: self.fmu.setupExperiment(startTime=start_time),
            self.fmu.enterInitializationMode,
            self.fmu.exitInitializationMode,
        ):
            self._checked(call, "initialisation")

    def reader(self, names: list[str]):
        """A function that reads these variables (reals, integers, booleans) into one array of floats."""
        values = np.zeros(len(names))
        parts = []
        for kind, c_type in (("Real", ctypes.c_double), ("Integer", ctypes.c_int), ("Boolean", ctypes.c_int)):
            kinds = (kind, "Enumeration") if kind == "Integer" else (kind,)
            where = [i for i, name in enumerate(names) if self.variables[name].type in kinds]
            if where:
                function = getattr(self.fmu.dll, f"fmi2Get{kind}")
                references, buffer = self._arrays([names[i] for i in where], c_type)
                parts.append((function, references, len(where), buffer, where))

        def read() -> np.ndarray:
            for function, references, count, buffer, where in parts:
                self._check(function(self._component, references, count, buffer), "reading")
                values[where] = buffer
            return values

        return read

    def writer(self, names: list[str]):
        """A function that sets these real variables from an array."""
        references, buffer = self._arrays(names, ctypes.c_double)
        function, count = self.fmu.dll.fmi2SetReal, len(names)

        def write(values) -> None:
            buffer[:] = values
            self._check(function(self._component, references, count, buffer), "setting inputs")

        return write

    def step(self, at: float, length: float) -> None:
        """Advances from time `at` by `length`."""
        self._check(self._step(self._component, at, length, 1), f"the step at t = {at:.3f} s")

    def close(self) -> None:
        """Frees the instance and what was unpacked."""
        self.fmu.freeInstance()
        _LISTENERS.pop(self.fmu.callbacks.componentEnvironment)
        shutil.rmtree(self._folder, ignore_errors=True)

    def _arrays(self, names: list[str], c_type):
        references = [self.variables[name].valueReference for name in names]
        return (ctypes.c_uint * len(names))(*references), (c_type * len(names))()

    def _checked(self, call, what: str) -> None:
        try:
            call()
        except FMICallException as error:
            raise RuntimeError(self._explain(what, error.status)) from error

    def _check(self, status: int, what: str) -> None:
        if status > 1:  # fmi2OK = 0, fmi2Warning = 1
            raise RuntimeError(self._explain(what, status))

    def _explain(self, what: str, status: int | None) -> str:
        said = "; ".join(text for level, _, text in self.messages[-3:] if level > 1)
        names = {2: "fmi2Discard", 3: "fmi2Error", 4: "fmi2Fatal"}
        return f"{self.description.modelName}: {what} failed ({names.get(status, status)}): {said or 'no message'}"


@dataclass
class Drive:
    """What a drive gave: its columns by name, and how long it took."""

    columns: dict[str, np.ndarray]
    step: float  # s, communication step
    wall: float  # s, duration of the loop on the clock
    finished: bool  # completed: the end of the path was reached, or one lap of a closed one, within the lane
    messages: list[str] = field(default_factory=list)
    ending: Ending | None = None  # outcome, place and reason
    words: dict[str, dict[int, str]] = field(default_factory=dict)  # words of the columns that are enumerations

    @property
    def outcome(self) -> str:
        """The outcome in one word."""
        return self.ending.outcome if self.ending else COMPLETED if self.finished else TIMED_OUT

    def write_csv(self, file: Path) -> None:
        """Writes a drive log; numbers keep all their digits, enumerations are words, `status` comes last."""
        names = sorted(self.columns, key=lambda name: name == "status")
        texts = []
        for name in names:
            values, words = self.columns[name].tolist(), self.words.get(name)
            texts.append([words.get(int(value), repr(value)) for value in values] if words else map(repr, values))
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(zip(*texts))
        write_whole(file, out.getvalue())

    def results(self) -> dict:
        """Outcome and figures, as `rfl drive --json` has them."""
        c, end = self.columns, self.ending or Ending(self.outcome, "")
        duration = float(c["time"][-1]) if len(c["time"]) else 0.0
        worst = int(np.argmax(np.abs(c["e1"]))) if len(c["e1"]) else None
        largest = None
        if worst is not None:
            names = {"time": "time", "station": "station", "lateral_error": "e1"}
            largest = {name: float(c[column][worst]) for name, column in names.items()}
        return {
            "outcome": self.outcome,
            "reason": end.reason,
            "end": end.place and end.place.json(),
            "left_lane": end.departure and end.departure.json(),
            "entered_lane": end.entered_late and end.entered_late.json(),
            "largest": largest,
            "length": end.length,
            "driven": end.driven,
            "tracking": tracking(c),
            "duration": duration,
            "finished": self.finished,
            "real_time_factor": duration / self.wall if self.wall > 0 else math.nan,
            "step": step_times(c, STEP),
        }


def columns_of(unit: Unit) -> list[str]:
    """The outputs that a log holds: signals of the vocabulary, without details such as `predicted.e1[3]`."""
    keep = ("qp.iterations",)
    kinds = ("Real", "Integer", "Enumeration", "Boolean")
    return [
        name
        for name in unit.names("output")
        if (name in keep or not set(name) & set(".[")) and unit.variables[name].type in kinds
    ]


def kind_of(vehicle: Path | str | None) -> str:
    """`car` or `truck`: the kind of a vehicle file or of a built-in vehicle; a car where neither can be told."""
    file = PROJECT / "vehicles" / f"{vehicle}.toml"
    if vehicle is not None and Path(vehicle).is_file():
        file = Path(vehicle)
    try:
        return "truck" if re.search(r"^\s*\[tractor", file.read_text(encoding="utf-8"), re.MULTILINE) else "car"
    except (OSError, ValueError):  # the FMU says what is wrong with it
        return "car"


def road_of(path: Path | str) -> Path:
    """A road's file: a name of `paths/` where there is no such file here."""
    named = PROJECT / "paths" / f"{path}.csv"
    return named if named.is_file() and not Path(path).exists() else Path(path).resolve()


def drive(
    path: Path | str | None = None,
    vehicle: Path | str | None = None,
    *,
    duration: float | None = None,
    step: float = STEP,
    jacobi: bool = False,
    settings: dict[str, object] | None = None,
    fmus: Path = FMUS,
    controller_fmu: Path | None = None,
    vehicle_fmu: Path | None = None,
    lane: float = LANE,
    progress=lambda share, row: None,
) -> Drive:
    """Drives along `path` until its end or a stop, or for `duration` seconds, from the start that the controller names.

    Whatever happens on the way, the drive until then is given, and its `ending` says what; only bad input raises.

    Without `path` and `vehicle` the FMUs take those that they carry; both may be names in `paths/` and `vehicles/`.
    Of `fmus` those are taken that the kind of vehicle needs, unless others are named.
    `settings` are parameters by name, for each FMU that has them (`controller.NAME`, `car.NAME` or `truck.NAME`: for
    one only).
    `progress(share of the drive, row of the log by names)` is called twice in a simulated second.
    """
    kind = kind_of(vehicle)
    files = [fmus / f"{name}.fmu" for name in KINDS[kind]]
    with ExitStack() as stack:
        controller = stack.enter_context(closing(Unit(controller_fmu or files[0], "controller")))
        plant = stack.enter_context(closing(Unit(vehicle_fmu or files[1], kind)))
        units = {"controller": controller, kind: plant}
        parameters: dict[str, object] = {}
        if path is not None:
            parameters |= dict.fromkeys(("controller.path_file", f"{kind}.road_file"), str(road_of(path)))
        if vehicle is not None:
            parameters["vehicle_file"] = str(Path(vehicle).resolve() if Path(vehicle).is_file() else vehicle)
        given = []
        for key, value in (parameters | (settings or {})).items():
            unit, _, rest = key.partition(".")
            targets, name = ([units[unit]], rest) if unit in units else (list(units.values()), key)
            owners = [target for target in targets if name in target.variables]
            if not owners:
                near = get_close_matches(name, sorted({n for t in targets for n in t.names("parameter")}), cutoff=0.5)
                raise ValueError(f"no variable '{key}'" + (f"; there is {', '.join(near)}" if near else ""))
            for owner in owners:
                owner.set(name, value)
            given.append(name)

        controller.initialize()
        for name, start in {"x": "x", "y": "y", "yaw": "yaw", "vx": "speed"}.items():
            if f"initial.{name}" not in given:
                plant.set(f"initial.{name}", controller.get(f"start.{start}"))
        plant.initialize()
        return _loop(controller, plant, duration, step, jacobi, lane, progress)


def _loop(
    controller: Unit, plant: Unit, duration: float | None, step: float, jacobi: bool, lane: float, progress
) -> Drive:
    plant_names, controller_names = columns_of(plant), columns_of(controller)
    to_controller = [name for name in controller.names("input") if name in plant_names]
    to_plant = [name for name in plant.names("input") if name in controller_names]
    answers = to_plant + [name for name in controller_names if name not in to_plant]
    # A name that both have (`status`) is the controller's; the vehicle's gets its owner's name.
    owner = plant.fmu.instanceName
    states = [f"{owner}.{name}" if name in answers else name for name in plant_names]
    names = ["time", *to_plant, *states, *answers[len(to_plant) :]]

    read_plant, read_controller = plant.reader(plant_names), controller.reader(answers)
    write_plant, write_controller = plant.writer(to_plant), controller.writer(to_controller)
    measured = [plant_names.index(name) for name in to_controller]
    commands = len(to_plant)
    finished_at, station_at, speed_at = answers.index("finished"), answers.index("station"), plant_names.index("vx")
    place_at = [answers.index(name) for name in ("station", "e1", "e2")]
    length = controller.get("path.length")
    referee = Referee(length, lane)
    words = {"status": controller.items("status")}
    words |= {state: plant.items(name) for state, name in zip(states, plant_names)
              if plant.variables[name].type == "Enumeration"}  # fmt: skip

    count = max(1, round((LIMIT if duration is None else duration) / step))
    rows = np.empty((count, len(names)))
    every = max(1, round(0.5 / step))
    begin = time.perf_counter()
    driven, outcome, reason = 0, TIMED_OUT, None
    try:
        for k in range(count):
            now = k * step
            state = read_plant()
            answer = read_controller() if jacobi else None
            write_controller(state[measured])
            if not jacobi:
                controller.step(now, step)
                answer = read_controller()
            rows[k, 0] = now
            rows[k, 1 : commands + 1] = answer[:commands]
            rows[k, commands + 1 : -len(answer) + commands] = state
            rows[k, -len(answer) + commands :] = answer[commands:]
            driven = k + 1
            # Before its first step a Jacobi controller has not seen the vehicle.
            if k or not jacobi:
                referee.see(Place(now, *answer[place_at].tolist()), float(state[speed_at]))
            if k % every == 0:
                share = max(now / duration if duration else 0.0, answer[station_at] / length)
                progress(share, dict(zip(names, rows[k])))
            if answer[finished_at] and referee.at_end:
                outcome, reason = COMPLETED, "the road was driven to its end"
                break
            if referee.stands:
                word = words["status"].get(int(answer[answers.index("status")]), "unknown")
                outcome = STOPPED
                far = f"{referee.driven:.0f} of {length:.0f} m"
                reason = f"the vehicle stood before the end of the road ({far}), control status {word}"
                break
            if astray := referee.astray:
                outcome, reason = LOST, astray
                break
            write_plant(answer[:commands])
            if jacobi:
                controller.step(now, step)
            plant.step(now, step)
    except RuntimeError as error:
        outcome, reason = LOST, str(error)
    wall = time.perf_counter() - begin
    if reason is None:
        reason = f"the duration was over after {referee.driven:.0f} of {length:.0f} m"
    ending = referee.ending(outcome, reason)
    messages = [f"{unit.fmu.instanceName}: {text}" for unit in (controller, plant) for _, _, text in unit.messages]
    columns = dict(zip(names, rows[:driven].T.copy()))
    return Drive(columns, step, wall, ending.outcome == COMPLETED, messages, ending, words)


class DriveProgress(Progress):
    """The progress of a drive: time and lateral error beside the bar."""

    def __call__(self, share: float, row: dict[str, float]) -> None:
        super().__call__(share, f"  t {row['time']:6.1f} s  e1 {row['e1']:+.3f} m")


def verdict(result: Drive) -> str:
    """Outcome of a drive in a line: the word, the reason, and how far off it came."""
    r = result.results()
    text = f"outcome: {r['outcome']}: {r['reason']}"
    if at := r["largest"]:
        text += f"; farthest from the path {abs(at['lateral_error']):.3f} m, at {at['time']:.2f} s"
        text += f" and station {at['station']:.0f} m"
    return text


def checks_of(result: Drive, requirements: list[Requirement], cut: bool) -> list[Check]:
    """The outcome as a test, and the requirements; `cut`: the user chose the duration."""
    r = result.results()
    asked = any(requirement.asks_for(r["outcome"]) for requirement in requirements)
    status = exit_status(r["outcome"], cut, asked=asked)
    outcome = Check("outcome", status == 0, f"{r['outcome']}: {r['reason']}")
    return [outcome, *(requirement.check(r) for requirement in requirements)]


def read_by(options: argparse.Namespace) -> dict[str, Path | str | None]:
    """The files that are read, by their options."""
    read = {"--path": options.path and road_of(options.path), "--vehicle": options.vehicle}
    read |= {f"--fmus {file.name}": file for file in options.fmus.glob("*.fmu")}
    return read | {f"--set {name}": value for name, _, value in (text.partition("=") for text in options.set)}


def junit_class(options: argparse.Namespace) -> str:
    """Class of the test cases: drives of other vehicles or roads have others."""

    def of_file(file: Path) -> str:
        return f"{file.parent.name}.{file.stem}" if file.parent.name not in ("", "..") else file.stem

    vehicle = of_file(Path(options.vehicle)) if options.vehicle else "car"
    road = of_file(options.path) if options.path else "drive"
    return options.junit_name or f"closed_loop.{vehicle}.{road}"


def failed(error: Exception, options: argparse.Namespace) -> int:
    """Says why there is no drive."""
    print(f"closed_loop: {error}", file=sys.stderr)
    report_error(str(error), options.junit, junit_class(options))
    return 1


def report_error(words: str, junit: Path | None, case: str) -> None:
    """Writes the JUnit file of a drive that is none: an older one would say how another drive went."""
    if junit:
        try:
            write_junit(junit, "closed_loop.py", [(case, 0.0, [Check("outcome", False, words, error=True)])])
        except OSError as fault:
            print(f"closed_loop: {fault}", file=sys.stderr)


class Parser(argparse.ArgumentParser):
    """A parser whose errors stand in the JUnit file that the words name, too."""

    def error(self, message: str) -> NoReturn:
        few = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
        for option in ("--junit", "--path"):
            few.add_argument(option, type=Path)
        for option in ("--junit-name", "--vehicle"):
            few.add_argument(option)
        try:
            options, _ = few.parse_known_args()
        except (argparse.ArgumentError, SystemExit):
            options = argparse.Namespace(junit=None)
        # What the words of a wrong call name cannot be told: a file that is no JUnit file is left alone.
        if options.junit and (not options.junit.exists() or is_junit(options.junit)):
            report_error(message, options.junit, junit_class(options))
        super().error(message)


def main() -> int:
    parser = Parser(
        description=__doc__,
        epilog=f"{figures_help()}\n\n{STATUSES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--path", type=Path, help="road to drive, a CSV with x and y or a name of paths/ (default: the FMUs' own)"
    )
    parser.add_argument("--vehicle", help="car or truck to drive, a TOML file or a built-in name (default: a car)")
    parser.add_argument("--duration", type=float, help="seconds to drive (default: to the road's end)")
    least, most = STEPS
    parser.add_argument(
        "--step",
        type=float,
        default=STEP,
        help=f"communication step in seconds, {least} to {most} (default: %(default)s)",
    )
    parser.add_argument("--log", type=Path, help="file for the drive log, a CSV")
    parser.add_argument("--json", type=Path, help="file for the results, a JSON")
    parser.add_argument("--require", action="append", default=[], metavar="FIGURE<=VALUE", help="a test; repeatable")
    parser.add_argument("--junit", type=Path, help="file for outcome and requirements as test cases, a JUnit XML")
    parser.add_argument("--junit-name", metavar="NAME", help="class of the test cases (default: of vehicle and road)")
    parser.add_argument(
        "--lane",
        type=float,
        default=LANE,
        help="lateral error in m beyond which a drive is lost (default: %(default)s)",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress")
    parser.add_argument("--jacobi", action="store_true", help="one step of delay, as most tools' masters have")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter; repeatable")
    parser.add_argument("--fmus", type=Path, default=FMUS, help="folder of the FMUs (default: %(default)s)")
    options = parser.parse_args()
    if bad := [text for text in options.set if "=" not in text]:
        parser.error(f"--set wants NAME=VALUE, not '{bad[0]}'")
    if not least <= options.step <= most:
        parser.error(f"--step {options.step:g}: give a time between {least} and {most} s")
    if options.duration is not None and not (math.isfinite(options.duration) and options.duration > 0):
        parser.error(f"--duration {options.duration:g}: give a time in s that is greater than 0")
    if not (math.isfinite(options.lane) and options.lane > 0):
        parser.error(f"--lane {options.lane:g}: give a width in m that is greater than 0")
    try:
        requirements = [Requirement(text) for text in options.require]
        check_files({"--log": options.log, "--json": options.json, "--junit": options.junit}, read_by(options))
    except ValueError as error:
        parser.error(str(error))

    name = options.path.stem if options.path else "drive"
    progress = DriveProgress(name, options.quiet)
    try:
        result = drive(
            options.path,
            options.vehicle,
            duration=options.duration,
            step=options.step,
            jacobi=options.jacobi,
            settings=dict(text.split("=", 1) for text in options.set),
            fmus=options.fmus,
            lane=options.lane,
            progress=progress,
        )
    except (RuntimeError, ValueError, OSError) as error:
        progress.close()
        return failed(error, options)
    progress.close()
    for message in result.messages:
        print(message, file=sys.stderr)
    cut = options.duration is not None
    checks = checks_of(result, requirements, cut)
    asked = any(requirement.asks_for(result.outcome) for requirement in requirements)
    status = exit_status(result.outcome, cut, all(check.met for check in checks[1:]), asked)
    results = result.results() | {
        "requirements": [
            {"requirement": c.name, "met": c.met, "summary": c.words, "words": c.words} for c in checks[1:]
        ],
        "exit_status": status,
    }
    try:
        if options.log:
            result.write_csv(options.log)
        if options.json:
            write_whole(options.json, json.dumps(known(results), indent=2) + "\n")
        if options.junit:
            write_junit(options.junit, "closed_loop.py", [(junit_class(options), result.wall, checks)])
    except OSError as error:
        return failed(error, options)
    e1 = results["tracking"]
    print(
        f"{results['duration']:.2f} s driven in {result.wall:.2f} s; "
        f"lateral error: mean {e1['mae']:.4f} m, max {e1['max']:.4f} m"
    )
    for check in checks[1:]:
        print(f"{'met' if check.met else 'NOT met'}: {check.words}")
    print(verdict(result))
    return status


def known(value):
    """A value for JSON, which has no number that is none."""
    if isinstance(value, dict):
        return {key: known(of) for key, of in value.items()}
    if isinstance(value, list):
        return [known(of) for of in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


if __name__ == "__main__":
    sys.exit(main())
