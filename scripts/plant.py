"""A vehicle of one's own, driven by the controller FMU: a Python class, or a co-simulation FMU of another tool.

A plant in Python is a class or a function, `Name(x, y, yaw, speed)`: a vehicle at this pose and speed, with

    outputs() -> dict                       what is measured now: x, y, yaw, vx, vy, yaw_rate; steer if it is measured
    step(steer_cmd, accel_cmd, seconds)     drives on under commands that hold so long

SI units, radians, ISO 8855 (x forward, y left, yaw and steering positive to the left). A truck has `articulation`, the
tractor's yaw less the trailer's, and `articulation_rate`, too. A plant that cannot be driven on (it spins, it rolled
over) raises `Lost`.

An FMU has variables of the same names, or names them by a mapping, and may have the parameters `initial.x`,
`initial.y`, `initial.yaw` and `initial.vx`.
"""

from __future__ import annotations

import importlib.util
import inspect
import math
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from closed_loop import FMUS, KINDS, Drive, Unit, kind_of
from outcome import COMPLETED, LANE, LOST, STOPPED, TIMED_OUT, TURNED, Place, Referee

COMMANDS = ["steer_cmd", "accel_cmd"]
ERRORS = ["e1", "e1_rate", "e2", "e2_rate", "station", "curvature", "curvature_rate"]
OUTSIDE = "residual.outside"  # share of the horizon where the model was asked outside its training
POSE = ("x", "y", "yaw")
NOT_NEEDED = {"steer"}  # the controller does without: the yaw rate shows the actuator, too
ASTRAY = 5.0  # m of lateral error: the vehicle is not on its road any more
AGAINST = "the articulation is negative in left turns; give the tractor's yaw less the trailer's"
TURNING = 0.02  # rad/s: slower, a truck does not turn
WALKING = 1.0  # m/s: who takes more than twice the time for the road is given up


class PlantError(ValueError):
    """A plant that cannot be used: what is wrong with it, where, and what to do."""


class Lost(RuntimeError):
    """The vehicle left what its model describes: it spun, rolled over or stood still."""


@dataclass
class PlantDrive(Drive):
    """A drive of a plant; `fault` says what failed in the plant while it was on its road.

    `against`: a trailer seems to lead its tractor into turns.
    """

    fault: PlantError | None = None
    against: bool = False


# -- The loop ---------------------------------------------------------------------------------------------------------


def set_parameters(unit: Unit, settings: dict[str, object], prefix: str = "") -> None:
    """Sets parameters by name; `prefix` is what a user writes before the name."""
    for name, value in settings.items():
        if name not in unit.variables:
            near = get_close_matches(name, unit.names("parameter"), cutoff=0.5)
            there = f"; there is {', '.join(prefix + other for other in near)}" if near else ""
            raise ValueError(f"no parameter '{prefix}{name}'{there}")
        unit.set(name, value)


def controller_for(road: Path, vehicle: Path | str, settings: dict[str, object], fmus: Path = FMUS) -> Unit:
    """The controller of this kind of vehicle on a road, ready for its first step."""
    controller = Unit(fmus / f"{KINDS[kind_of(vehicle)][0]}.fmu", "controller")
    try:
        controller.set("vehicle_file", str(Path(vehicle).resolve() if Path(vehicle).is_file() else vehicle))
        controller.set("path_file", str(Path(road).resolve()))
        set_parameters(controller, settings)
        controller.initialize()
    except BaseException:
        controller.close()
        raise
    return controller


def drive(
    road: Path,
    vehicle: Path | str,
    make: Callable,
    settings: dict[str, object] | None = None,
    *,
    fmus: Path = FMUS,
    lane: float = LANE,
) -> PlantDrive:
    """Drives the plant `make(x, y, yaw, speed)` along a road, from its start to its end or until the plant is lost.

    At each sample the controller steps first and the plant gets its answer at once, as in `closed_loop.py`. The
    controller knows the `vehicle` (a vehicle file or a built-in name) and takes `settings`. Whatever happens on the
    way, the drive until then is given, and its `ending` says what; bad input and a plant that cannot start raise.
    """
    rows: list[list[float]] = []
    begin = time.perf_counter()
    with ExitStack() as stack:
        controller = stack.enter_context(closing(controller_for(road, vehicle, settings or {}, fmus)))
        answers = [*COMMANDS, *ERRORS, OUTSIDE, "status"]
        read = controller.reader([*answers, "finished"])
        step, length = controller.get("mpc.sample_time"), controller.get("path.length")
        words = {"status": controller.items("status")}
        start = {name: controller.get(f"start.{name}") for name in (*POSE, "speed")}
        plant = stack.enter_context(_Watched(make, start, controller.names("input")))
        write = controller.writer(plant.measured)
        referee = Referee(length, lane)
        names = ["time", *COMMANDS, *plant.measured, *answers[2:]]
        station, e1, e2 = (answers.index(name) for name in ("station", "e1", "e2"))
        outcome, reason, fault = TIMED_OUT, None, None
        for k in range(int(2.0 * length / WALKING / step)):
            now = k * step
            try:
                measured = plant.outputs(now)
                write(measured)
                controller.step(now, step)
                *answer, finished = read().tolist()
                rows.append([now, *answer[:2], *measured, *answer[2:]])
                place = Place(now, answer[station], answer[e1], answer[e2])
                referee.see(place, measured[plant.speed_at])
                if abs(place.lateral_error) > ASTRAY:
                    raise Lost(f"the vehicle is {ASTRAY:g} m from its road")
                if finished and referee.at_end:
                    outcome, reason = COMPLETED, "the road was driven to its end"
                    break
                if referee.stands:
                    word = words["status"].get(int(answer[-1]), "unknown")
                    outcome, reason = (
                        STOPPED,
                        (
                            f"the vehicle stood before the end of the road ({referee.driven:.0f} of {length:.0f} m), "
                            f"control status {word}"
                        ),
                    )
                    break
                plant.step(answer[0], answer[1], step, now)
            except Lost as lost:
                outcome, reason = LOST, f"t = {now:.2f} s: {lost}"
                break
            except PlantError as error:
                outcome, reason = LOST, str(error)
                fault = error if referee.departure is None else None
                break
            except RuntimeError as error:  # the controller's step
                outcome, reason = LOST, str(error)
                break
        messages = [f"controller: {text}" for status, _, text in controller.messages if status > 0]
    if reason is None:
        reason = f"the time for the road was over after {referee.driven:.0f} of {length:.0f} m"
    ending = referee.ending(outcome, reason)
    if ending.outcome == LOST:
        messages.insert(0, ending.reason)
    columns = dict(zip(names, np.array(rows).reshape(len(rows), len(names)).T))
    if against := turns_against(columns):
        messages.append(f"{plant.name}: {AGAINST}")
    wall = time.perf_counter() - begin
    return PlantDrive(columns, step, wall, ending.outcome == COMPLETED, messages, ending, words, fault, against)


def turns_against(columns: dict[str, np.ndarray]) -> bool:
    """Whether a trailer seems to lead its tractor into the turn: the sign of the articulation is the other one."""
    if "articulation" not in columns or not len(columns["articulation"]):
        return False
    turn, angle = columns["yaw_rate"], columns["articulation"]
    size = float(np.linalg.norm(turn) * np.linalg.norm(angle))
    return bool(size > 0.0 and float(turn @ angle) < -0.5 * size and np.abs(turn).max() > TURNING)


class _Watched:
    """A plant whose errors name the call, the time and the line."""

    def __init__(self, make: Callable, start: dict[str, float], inputs: list[str]) -> None:
        function = getattr(make, "func", make)  # within a partial
        self.name = getattr(make, "label", None) or getattr(function, "__name__", type(function).__name__)
        self._last_yaw = start["yaw"]
        self.plant = self._call(f"{self.name}(x, y, yaw, speed)", None, lambda: make(*start.values()))
        for method in ("outputs", "step"):
            if not callable(getattr(self.plant, method, None)):
                raise PlantError(
                    f"{self.name}: what it gives has no {method}(); a plant has outputs() and "
                    "step(steer_cmd, accel_cmd, seconds)"
                )
        _check_arguments(self.plant.step, ("steer_cmd", "accel_cmd", "seconds"), f"{self.name}.step")
        first = self._told(0.0)
        if missing := [name for name in inputs if name not in first and name not in NOT_NEEDED]:
            raise PlantError(
                f"{self.name}.outputs() has no '{missing[0]}': a controller needs "
                f"{', '.join(name for name in inputs if name not in NOT_NEEDED)}, and steer if it is measured"
                f"{_given(first)}"
            )
        self.measured = [name for name in inputs if name in first]
        self.speed_at = self.measured.index("vx")
        self._yaw_at = self.measured.index("yaw")
        x, y, yaw = (float(first[name]) for name in POSE)
        off, turned = math.hypot(x - start["x"], y - start["y"]), math.remainder(yaw - start["yaw"], math.tau)
        if off > LANE or abs(turned) > TURNED:
            raise PlantError(
                f"{self.name} was to start at x {start['x']:.2f} m, y {start['y']:.2f} m, yaw {start['yaw']:.3f} rad, "
                f"and its outputs say x {x:.2f} m, y {y:.2f} m, yaw {yaw:.3f} rad: begin where you are told, in metres "
                "and radians"
            )

    def __enter__(self) -> _Watched:
        return self

    def __exit__(self, *_) -> None:
        close = getattr(self.plant, "close", None)
        if callable(close):
            close()

    def outputs(self, now: float) -> list[float]:
        """What is measured, yaw without jumps; all of it is finite."""
        told = self._told(now)
        try:
            values = [float(told[name]) for name in self.measured]
        except KeyError as error:
            raise PlantError(f"{self.name}.outputs() at t = {now:.2f} s: {error} is not there any more") from error
        # A yaw angle that is wrapped to +- pi goes on.
        values[self._yaw_at] += math.tau * round((self._last_yaw - values[self._yaw_at]) / math.tau)
        self._last_yaw = values[self._yaw_at]
        return values

    def step(self, steer_cmd: float, accel_cmd: float, seconds: float, now: float) -> None:
        """Drives on."""
        self._call(f"{self.name}.step()", now, lambda: self.plant.step(steer_cmd, accel_cmd, seconds))

    def _told(self, now: float) -> dict:
        what = f"{self.name}.outputs()"
        told = self._call(what, now, self.plant.outputs)
        if not isinstance(told, dict):
            raise PlantError(f"{what} gives {type(told).__name__}: it is to give a dict, signals by name")
        for name, value in told.items():
            try:
                finite = math.isfinite(value)
            except TypeError as error:
                raise PlantError(f"{what} at t = {now:.2f} s: {name} is {value!r}, and no number") from error
            if not finite:
                raise PlantError(f"{what} at t = {now:.2f} s: {name} is {float(value)}")
        return told

    def _call(self, what: str, now: float | None, call: Callable):
        try:
            return call()
        except (Lost, PlantError):
            raise
        except (Exception, SystemExit) as error:
            at = "" if now is None else f" at t = {now:.2f} s"
            raise PlantError(f"{what}{at} raised {_explained(error)}") from error


def _explained(error: BaseException) -> str:
    """An exception in words, with the line that raised it."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return f"{text} ({frame.filename}, line {frame.lineno})"


def _given(names) -> str:
    return f" (given: {', '.join(map(str, names))})" if names else ""


def _check_arguments(call: Callable, names: tuple[str, ...], what: str, more: dict | None = None) -> None:
    """Whether it can be called with these arguments."""
    try:
        signature = inspect.signature(call)
    except (TypeError, ValueError):  # written in C: the call will show
        return
    try:
        signature.bind(*names, **(more or {}))
    except TypeError as error:
        named = "".join(f", {name}=..." for name in more or {})
        raise PlantError(f"{what}{signature}: it is called as {what}({', '.join(names)}{named}); {error}") from error


# -- Plants -----------------------------------------------------------------------------------------------------------


def plant_of(text: str, settings: dict[str, str] | None = None, mapping: list[str] | None = None):
    """The plant that a user names, `FILE.py:NAME` or `FILE.fmu`, checked; it can be sent to other processes."""
    if text.lower().endswith(".fmu"):
        plant: PythonPlant | FmuPlant = FmuPlant(Path(text).resolve(), settings or {}, _mapping(mapping or []))
    elif mapping:
        raise PlantError("--map is for FMUs: a plant in Python names its outputs itself")
    else:
        file, _, name = text.partition(".py:")
        file = text if not name else f"{file}.py"
        if not file.endswith(".py"):
            raise PlantError(f"--plant {text}: write it as FILE.py:CLASS or FILE.fmu")
        plant = PythonPlant(Path(file).resolve(), name, settings or {})
    plant.check()
    return plant


@dataclass(frozen=True)
class PythonPlant:
    """A class or a function of a Python file; `settings` are more arguments by name."""

    file: Path
    name: str
    settings: dict[str, str] = field(default_factory=dict)

    @property
    def label(self) -> str:
        return self.name or self.file.stem

    def check(self) -> None:
        """Raises what is wrong with the file."""
        _check_arguments(self._make(), (*POSE, "speed"), self.label, self._arguments())

    def notes(self) -> list[str]:
        """What a user should know."""
        return []

    def __call__(self, x: float, y: float, yaw: float, speed: float):
        """A vehicle at this pose and speed."""
        return self._make()(x, y, yaw, speed, **self._arguments())

    def _arguments(self) -> dict[str, object]:
        return {name: _number(value) for name, value in self.settings.items()}

    def _make(self) -> Callable:
        module = _loaded(self.file)
        if self.name:
            if callable(found := getattr(module, self.name, None)):
                return found
            there = ", ".join(_classes(module)) or "none"
            raise PlantError(f"{self.file}: no class or function '{self.name}'; classes there: {there}")
        fitting = [name for name, of in _classes(module).items() if hasattr(of, "outputs") and hasattr(of, "step")]
        if len(fitting) == 1:
            return getattr(module, fitting[0])
        found = f"{len(fitting)} classes ({', '.join(fitting)})" if fitting else "no class"
        raise PlantError(f"{self.file}: {found} with outputs() and step(); name one, {self.file.name}:CLASS")


def _classes(module) -> dict[str, type]:
    own = vars(module).items()
    return {name: of for name, of in own if isinstance(of, type) and of.__module__ == module.__name__}


def _number(value: str) -> object:
    try:
        return float(value)
    except ValueError:
        return value


def _loaded(file: Path):
    """The module of a file; what stands beside it can be imported by it."""
    name = str(file)
    if name in sys.modules:
        return sys.modules[name]
    if not file.is_file():
        raise PlantError(f"no plant at {file}: --plant wants FILE.py:CLASS or FILE.fmu")
    if str(file.parent) not in sys.path:
        sys.path.append(str(file.parent))
    spec = importlib.util.spec_from_file_location(name, file)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except SyntaxError as error:
        del sys.modules[name]
        raise PlantError(f"{error.filename}, line {error.lineno}: {error.msg}; the plant cannot be loaded") from error
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise PlantError(f"loading {file} raised {_explained(error)}") from error
    return module


def _mapping(texts: list[str]) -> dict[str, tuple[float, str]]:
    """`NAME=FMU_NAME` or `NAME=FACTOR*FMU_NAME`, by name."""
    mapping = {}
    for text in texts:
        name, separator, other = text.partition("=")
        factor, star, rest = other.partition("*")
        try:
            number = float(factor) if star else 1.0
        except ValueError:
            number = math.nan
        mapped = (rest if star else other).strip()
        if not separator or not mapped or not math.isfinite(number) or number == 0.0:
            raise PlantError(f"--map {text}: write it as NAME=FMU_NAME or NAME=FACTOR*FMU_NAME")
        mapping[name.strip()] = (number, mapped)
    return mapping


@dataclass(frozen=True)
class FmuPlant:
    """A co-simulation FMU; `settings` are its parameters, `mapping` gives (factor, its name) for a name of ours."""

    file: Path
    settings: dict[str, str] = field(default_factory=dict)
    mapping: dict[str, tuple[float, str]] = field(default_factory=dict)

    @property
    def label(self) -> str:
        return self.file.name

    def check(self) -> None:
        """Raises what is wrong with the FMU."""
        with closing(self(0.0, 0.0, 0.0, 10.0)):
            pass

    def notes(self) -> list[str]:
        """What a user should know."""
        with closing(self(0.0, 0.0, 0.0, 10.0)) as vehicle:
            return vehicle.notes

    def __call__(self, x: float, y: float, yaw: float, speed: float) -> _FmuVehicle:
        """A vehicle at this pose and speed."""
        return _FmuVehicle(self, x, y, yaw, speed)


START = ("initial.x", "initial.y", "initial.yaw", "initial.vx")  # parameters for pose and speed at the start


class _FmuVehicle:
    """An instance of it on the road.

    One without parameters for its start begins where it likes: the road is then laid before it, that is its pose is
    turned and moved so that it begins at the road's start.
    """

    def __init__(self, source: FmuPlant, *start: float) -> None:
        self.source, self.notes, self._steps = source, [], 0
        if not source.file.is_file():
            raise PlantError(f"no FMU at {source.file}: --plant wants FILE.py:CLASS or FILE.fmu")
        try:
            self.unit = Unit(source.file, "plant")
        except Exception as error:  # whatever fmpy says of a file that is none
            raise PlantError(
                f"{source.file}: this is no co-simulation FMU 2.0 that can be loaded here ({error})"
            ) from error
        try:
            self._begin(start)
        except BaseException:
            self.unit.close()
            raise

    def _begin(self, start: tuple[float, ...]) -> None:
        unit, mapping = self.unit, self.source.mapping
        set_parameters(unit, self.source.settings, "plant.")
        known = {*COMMANDS, *POSE, "vx", "vy", "yaw_rate", "steer", "articulation", "articulation_rate", *START}
        for name, (_, mapped) in mapping.items():
            if name not in known:
                near = get_close_matches(name, known, cutoff=0.5) or sorted(known)
                raise PlantError(f"--map {name}: no such signal; there is {', '.join(near)}")
            if mapped not in unit.variables:
                near = get_close_matches(mapped, unit.variables, cutoff=0.5)
                there = f"; it has {', '.join(near)}" if near else ""
                raise PlantError(f"--map {name}: {self.source.file.name} has no '{mapped}'{there}")
        names = {name: mapping.get(name, (1.0, name)) for name in known}
        there = {name: of for name, of in names.items() if self._is(name, of[1])}
        missing = [name for name in (*COMMANDS, *POSE, "vx", "vy", "yaw_rate") if name not in there]
        if missing:
            kind = "input" if missing[0] in COMMANDS else "output"
            raise PlantError(
                f"{self.source.file.name} has no {kind} '{missing[0]}': name it with --map {missing[0]}=NAME or "
                f"--map {missing[0]}=FACTOR*NAME; its {kind}s: {', '.join(unit.names(kind)) or 'none'}"
            )
        self._commands = [there[name] for name in COMMANDS]
        self._signals = {name: of for name, of in there.items() if name not in START and name not in COMMANDS}
        placed = [name for name in START if name in there and names[name][1] not in self.source.settings]
        whole = all(f"initial.{name}" in placed for name in POSE)
        for name in placed:
            if whole or name == "initial.vx":
                factor, mapped = there[name]
                unit.set(mapped, start[START.index(name)] / factor)
        unit.initialize()
        self._read = unit.reader([mapped for _, mapped in self._signals.values()])
        self._write = unit.writer([mapped for _, mapped in self._commands])
        self._moved = None
        if not whole:
            first = self.outputs()
            turn = start[2] - first["yaw"]
            self._moved = (math.cos(turn), math.sin(turn), turn, first["x"], first["y"], start[0], start[1])
            self.notes.append(
                f"the start of {self.source.file.name} cannot be set (initial.x, initial.y, initial.yaw; --map names "
                "others): it begins where it likes, and each road is laid before it"
            )
        if "initial.vx" not in placed:
            self.notes.append(f"{self.source.file.name} has no parameter initial.vx: it begins at its own speed")

    def _is(self, name: str, mapped: str) -> bool:
        """Whether the FMU has a variable that can be a command, a parameter for the start or a measured signal."""
        variable = self.unit.variables.get(mapped)
        if variable is None:
            return False
        if name in COMMANDS:
            return variable.causality == "input" and variable.type == "Real"
        return variable.causality in (("parameter", "input") if name in START else ("output", "local"))

    def outputs(self) -> dict[str, float]:
        """What is measured now."""
        values = self._read().tolist()
        told = {name: factor * value for (name, (factor, _)), value in zip(self._signals.items(), values)}
        if self._moved:
            c, s, turn, x0, y0, x, y = self._moved
            dx, dy = told["x"] - x0, told["y"] - y0
            told |= {"x": x + c * dx - s * dy, "y": y + s * dx + c * dy, "yaw": told["yaw"] + turn}
        return told

    def step(self, steer_cmd: float, accel_cmd: float, seconds: float) -> None:
        """Drives on under commands that hold so long."""
        try:
            self._write([value / factor for value, (factor, _) in zip((steer_cmd, accel_cmd), self._commands)])
            self.unit.step(self._steps * seconds, seconds)
        except RuntimeError as error:
            raise Lost(str(error)) from error
        self._steps += 1

    def close(self) -> None:
        """Frees the instance."""
        self.unit.close()


# -- Pictures ---------------------------------------------------------------------------------------------------------


def plot_errors(panels: list[tuple[str, list[tuple[str, Path]]]], file: Path) -> None:
    """Draws the lateral error of logs along their road: for each panel its title, and label and log of each line."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(len(panels), 1, figsize=(11, 2.6 * len(panels)), squeeze=False)
    for axis, (title, lines) in zip(axes[:, 0], panels):
        for label, path in lines:
            log = np.genfromtxt(path, delimiter=",", names=True)
            # At the end of a lap the station begins anew: no line back.
            station = np.where(np.diff(log["station"], prepend=0.0) < -1.0, np.nan, log["station"])
            axis.plot(station, 1e3 * log["e1"], label=label, linewidth=1)
        axis.set_title(title, fontsize=10)
        axis.set_ylabel("lateral error [mm]")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8, loc="upper right")
    axes[-1, 0].set_xlabel("station [m]")
    figure.tight_layout()
    figure.savefig(file, dpi=110)
    plt.close(figure)
