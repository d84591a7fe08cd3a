"""Path-tracking MPC that learns, its vehicles, and a diagnosis of the gap between a simulator and a vehicle.

===========================  ==========================================================================
:func:`drive`                a closed loop on a road: a log as a data frame, and how well it tracked
:func:`diagnose`             why a log and the simulator disagree
:func:`identify`             the steering actuator's dead time and lag, from logs
:func:`train`                what the controller's model misses, from logs
:func:`tune`                 weights and horizon for a vehicle
:class:`Controller`          the controller, one step at a time
:func:`fmus`                 the FMUs, of FMI 2.0 and 3.0; :func:`vehicles` and :func:`roads` are files to edit
===========================  ==========================================================================

SI units and radians, axes of ISO 8855: x forward, y to the left, yaw counter-clockwise. A road is a CSV file with the
columns ``x`` and ``y``, or a built-in name such as ``sudoku_test``; a vehicle is a TOML file or a built-in name such
as ``c_class``. A log is a file (CSV, ``.csv.gz``), or any table with named columns: pandas, polars, Arrow, a dict of
arrays. Its columns are ``time``, ``steer_cmd``, ``vx``, ``yaw_rate`` and as many of ``x``, ``y``, ``yaw``, ``vy``,
``ax``, ``ay``, ``steer`` as there are; ``name [unit]`` converts.

The functions are the commands of the program ``rfl``, which is part of the package: options have the same names and
defaults, and ``rfl drive --help`` explains them at length. Bad input raises :class:`RflError`, whose words say what
was wrong, where, and what to do. Notes go to the logger ``rfl_mpc``, warnings are :class:`RflWarning`. Ctrl-C stops.
``progress`` is called with the part of the work and its share that is done, 0 to 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from copy import deepcopy
from pathlib import Path

from rfl_mpc import _native
from rfl_mpc._call import File, Logs, Progress, RflWarning, call, file_name, frames_and_words, renamed, words
from rfl_mpc._native import Command, InternalError, RflError
from rfl_mpc.results import Drive, Estimate, Report, Steering, Training, Tuning

__all__ = [
    "Command",
    "Controller",
    "Drive",
    "Estimate",
    "InternalError",
    "NotBetterError",
    "Report",
    "RflError",
    "RflWarning",
    "Steering",
    "Training",
    "Tuning",
    "diagnose",
    "drive",
    "fmus",
    "identify",
    "roads",
    "train",
    "tune",
    "vehicles",
]

__version__: str = _native.__version__

Settings = Mapping[str, float | str]


class _TimeError(RflError, ValueError):
    """A time that cannot be a step's."""


class NotBetterError(RflError):
    """Nothing better than the default controller was found; ``result`` is what was."""

    result: Training | None = None


def drive(
    path: File | None = None,
    vehicle: File = "c_class",
    *,
    set: Settings | None = None,
    duration: float | None = None,
    step: float = 0.02,
    lane: float | None = None,
    smooth: float | None = None,
    closed: bool = False,
    open: bool = False,
    controller: File | None = None,
    variant: str | None = None,
    residual: File | None = None,
    models: File | None = None,
    direct: bool = False,
    require: Iterable[str] = (),
    log: File | None = None,
    json: File | None = None,
    junit: File | None = None,
    junit_name: str | None = None,
    progress: Progress | None = None,
) -> Drive:
    """Drives a vehicle along a road with the MPC.

    Parameters
    ----------
    path
        Road: a CSV file with columns ``x``, ``y`` in m, or a built-in name (:func:`roads`). Default: the vehicle's
        test route.
    vehicle
        Vehicle file (TOML) or built-in name (:func:`vehicles`).
    set
        Numbers of vehicle and controller by name, such as ``{"effect.steer_delay": 0.06, "mpc.q_e1": 1}``; ``car.``
        (``truck.``) or ``controller.`` before a name means one of them only. ``rfl parameters`` lists all with their
        units.
    duration
        Longest drive, s of simulated time.
    step
        Communication step, s: the log has a row for each.
    lane
        True lateral error beyond which the drive is lost, m.
    smooth
        How far the path may leave the road's noisy points, RMS in m.
    closed, open
        The road leads from its last point to its first, or ends there. Default: as its ends lie.
    controller
        Controller file, from :func:`tune`.
    variant, residual, models, direct
        What the controller predicts with: a variant such as ``"rfl_s"``, a learned model (from :func:`train`), a
        folder of them; ``direct``: the residual is added without being propagated.
    require
        Figures that must be met, such as ``"max_e1<=0.5"``; see :attr:`Drive.requirements`.
    log, json, junit
        Files to write beside: log (CSV), results (JSON), outcome and requirements (JUnit XML).
    junit_name
        Class of the JUnit file's test cases, in place of one of vehicle and road.

    Returns
    -------
    Drive
        ``log`` is a data frame with a row for each communication step, ``outcome`` is ``completed``, ``stopped``,
        ``lost`` or ``timed_out``. A drive that is lost raises nothing.
    """
    options = words(
        path=path, vehicle=vehicle, set=set, duration=duration, step=step, lane=lane, smooth=smooth, closed=closed,
        open=open, controller=controller, variant=variant, residual=residual, models=models, direct=direct,
        require=require, log=log, json=json, junit=junit, junit_name=junit_name,
    )  # fmt: skip
    (report, (columns, statuses)), text = call(_native.drive, options, progress=progress)
    return Drive.of(report, text, columns, statuses)


def diagnose(
    logs: Logs,
    vehicle: File | None = None,
    *,
    reference: Logs | None = None,
    path: File | None = None,
    unit: str | None = None,
    controller: File | None = None,
    set: Settings | None = None,
    without: Iterable[str] = (),
    pairs: bool = True,
    trust: str | None = None,
    prior: Mapping[str, float] | None = None,
    rate: float | None = None,
    only: str | None = None,
    seed: int = 1,
    threads: int = 0,
    out: File | None = None,
    progress: Progress | None = None,
) -> Report:
    """Says why a log and the simulator disagree: which unmodelled effect causes the gap, and how far it shrinks.

    Parameters
    ----------
    logs
        Log, or several of one vehicle on one day, which are diagnosed together.
    vehicle
        The simulator's vehicle, a file or a built-in name. Default: ``c_class``; of a log with ``articulation``,
        ``truck_simulation``.
    reference
        Log of the same vehicle when it was as modelled.
    path
        Road that was driven: tells bank, grade and friction, and adds the closed loop.
    unit
        ``"car"`` or ``"truck"``, where no vehicle is given.
    controller, set
        Learned model and parameters of the controller that drove, for the closed loop; only with ``path``.
    without
        Effects that are not to be named, such as ``["steer_offset"]``.
    pairs
        Two effects together are candidates, too.
    trust
        How good the vehicle's numbers are: ``"low"``, ``"usual"``, ``"high"``.
    prior
        Probability of an effect before the log is seen, by its id.
    rate
        Rows a second of logs without ``time``, Hz.
    only
        Rows of one vehicle in log files of several, as ``"COLUMN=VALUE"``.
    out
        Folder to write ``report.html``, ``report.json`` and the calibrated simulator into.

    Returns
    -------
    Report
        Fields as in ``report.json``; ``verdict["kind"]`` is ``none``, ``effect``, ``not_in_library`` or
        ``cannot_tell``.
    """
    frames, files = frames_and_words(logs)
    others, reference_words = frames_and_words(reference, option="reference", name="reference")
    options = words(
        vehicle=vehicle, path=path, unit=unit, controller=controller, set=set, without=without, no_pairs=not pairs,
        trust=trust, prior=prior, rate=rate, only=only, seed=seed, threads=threads,
    )  # fmt: skip
    folder = None if out is None else Path(file_name(out))
    (report, page), text = call(
        _native.diagnose, [*options, *reference_words, *files], frames + others, folder, progress=progress
    )
    return Report.of(report, text, page)


def identify(
    logs: Logs,
    vehicle: File | None = None,
    *,
    into: File | None = None,
    set: Settings | None = None,
    begin: float | None = None,
    end: float | None = None,
    by_yaw_rate: bool = False,
    check: bool = True,
    rate: float | None = None,
    only: str | None = None,
    json: File | None = None,
    progress: Progress | None = None,
) -> Steering:
    """Identifies the steering actuator from drives: dead time, lag, gain and offset, each with an interval.

    Parameters
    ----------
    logs
        One or several logs of one vehicle, with ``time``, ``steer_cmd`` and ``steer``.
    vehicle
        Vehicle file or built-in name; default: ``into``, else ``c_class``.
    into
        Vehicle file to write ``[steering]`` into; one that does not exist is made from ``vehicle``.
    begin, end
        Only the rows from this time on and up to that one, s.
    by_yaw_rate
        From ``yaw_rate`` and ``vx`` through the vehicle's linear model, where no angle was measured.
    check
        Looks in closed loop whether knowing it drives better, where a vehicle is given.
    rate, only
        As in :func:`diagnose`.
    """
    frames, files = frames_and_words(logs)
    options = words(
        vehicle=vehicle,
        into=into,
        set=set,
        until=end,
        by_yaw_rate=by_yaw_rate,
        no_check=not check,
        rate=rate,
        only=only,
        json=json,
    )
    options += words(**{"from": begin})
    with renamed(begin="--from", end="--until"):
        report, text = call(_native.identify, [*options, *files], frames, progress=progress)
    return Steering.of(report, text)


def train(
    logs: Logs,
    vehicle: File = "c_class",
    *,
    kind: str = "rfl_s",
    test: Logs | None = None,
    path: File | None = None,
    set: Settings | None = None,
    out: File | None = None,
    proof: bool = True,
    force: bool = False,
    rate: float | None = None,
    only: str | None = None,
    window: int | None = None,
    trees: int | None = None,
    depth: int | None = None,
    min_leaf: int | None = None,
    tree_features: str | None = None,
    seed: int = 1,
    threads: int = 0,
    json: File | None = None,
    progress: Progress | None = None,
) -> Training:
    """Learns what the controller's model misses, and proves in simulated closed loop that driving with it is better.

    Parameters
    ----------
    logs, test
        Logs to learn from; logs to measure the fit on. Columns ``time``, ``steer_cmd``, ``vx`` and the errors to the
        path (as a drive's log has them), or the pose and ``path``.
    kind
        ``linear``, ``rt``, ``rf``, ``rtl``, ``rfl``, ``rfl_s`` or ``gp_nmpc``.
    path
        Road that was driven, for logs that lack the errors to it.
    out
        File for the model; default ``out/residual/KIND.rflm``.
    proof, force
        Without a proof: written as fitted. ``force``: written even if it is no better.
    window, trees, depth, min_leaf, tree_features
        As for ``rfl train``; default: the kind's.

    Raises
    ------
    NotBetterError
        Nothing is written, for driving with it is no better.
    """
    frames, files = frames_and_words(logs)
    others, test_words = frames_and_words(test, option="test", name="test")
    options = words(
        vehicle=vehicle, kind=kind, path=path, set=set, out=out, no_proof=not proof, force=force, rate=rate, only=only,
        window=window, trees=trees, depth=depth, min_leaf=min_leaf, tree_features=tree_features, seed=seed,
        threads=threads, json=json,
    )  # fmt: skip
    (report, refused), text = call(_native.train, [*options, *test_words, *files], frames + others, progress=progress)
    result = Training.of(report, text)
    if refused is not None:
        error = NotBetterError(refused)
        error.result = result
        raise error
    return result


def tune(
    vehicle: File = "c_class",
    *,
    path: File | None = None,
    set: Settings | None = None,
    budget: int = 120,
    scenarios: int = 10,
    held_out: int = 16,
    delay_margin: float = 0.05,
    gain_margin: float = 2.0,
    variant: str | None = None,
    residual: File | None = None,
    models: File | None = None,
    out: File = "out/tune",
    seed: int = 1,
    threads: int = 0,
    progress: Progress | None = None,
) -> Tuning:
    """Searches weights and horizon that stand a family of vehicles around this one.

    Parameters
    ----------
    path
        Road to tune for; default: random roads.
    budget, scenarios, held_out
        Candidates that are tried, drives of each, and drives on which the best is compared with the default in the end.
    delay_margin, gain_margin
        Margins that are wanted at every speed: s, and a factor.
    out
        Folder for ``controller.toml``, ``tune.html`` and ``tune.json``.

    Returns
    -------
    Tuning
        ``file`` is the controller file, or ``None`` where nothing better than the default was found.
    """
    options = words(
        vehicle=vehicle, path=path, set=set, budget=budget, scenarios=scenarios, held_out=held_out,
        delay_margin=delay_margin, gain_margin=gain_margin, variant=variant, residual=residual, models=models,
        out=out, seed=seed, threads=threads,
    )  # fmt: skip
    report, text = call(_native.tune, options, progress=progress)
    return Tuning.of(report, text, Path(file_name(out)))


class Controller:
    """The path-tracking controller, one step at a time: for a simulator or a vehicle of your own.

    >>> controller = Controller("sudoku_turns")
    >>> x, y, yaw, speed = controller.start
    >>> controller.step(x=x, y=y, yaw=yaw, vx=speed, vy=0.0, yaw_rate=0.0).status
    'optimal'

    ``copy.copy`` and ``copy.deepcopy`` give a controller of its own in the same state.
    """

    def __init__(
        self,
        path: File | None = None,
        vehicle: File = "c_class",
        *,
        set: Settings | None = None,
        smooth: float | None = None,
        closed: bool = False,
        open: bool = False,
        controller: File | None = None,
        variant: str | None = None,
        residual: File | None = None,
        models: File | None = None,
        direct: bool = False,
    ) -> None:
        """As :func:`drive`."""
        options = words(
            path=path, vehicle=vehicle, set=set, smooth=smooth, closed=closed, open=open, controller=controller,
            variant=variant, residual=residual, models=models, direct=direct,
        )  # fmt: skip
        self._controller, _ = call(_native.Controller, options)
        self._time: float | None = None

    def __copy__(self) -> Controller:
        copied = object.__new__(type(self))
        copied.__dict__ |= self.__dict__ | {"_controller": self._controller.copied()}
        return copied

    def __deepcopy__(self, memo: dict[int, object]) -> Controller:
        copied = memo[id(self)] = self.__copy__()
        own = {name: value for name, value in self.__dict__.items() if name != "_controller"}
        copied.__dict__ |= deepcopy(own, memo)
        return copied

    def step(
        self,
        *,
        x: float,
        y: float,
        yaw: float,
        vx: float,
        vy: float,
        yaw_rate: float,
        steer: float = 0.0,
        articulation: float = 0.0,
        articulation_rate: float = 0.0,
        time: float | None = None,
    ) -> Command:
        """Steering and acceleration that hold until the next step, :attr:`sample_time` later.

        Parameters
        ----------
        x, y, yaw
            Pose of the centre of gravity (truck: of the tractor's), m and rad.
        vx, vy, yaw_rate
            Velocity in body axes, m/s, and rad/s.
        steer
            Road-wheel angle, rad: where the steering command starts from at the first step.
        articulation, articulation_rate
            Trucks: tractor yaw minus trailer yaw, rad and rad/s.
        time
            Time of the measurement, s, where steps are not evenly spaced: later than that of the step before. Another
            drive is driven by another controller.
        """
        measured = (x, y, yaw, vx, vy, yaw_rate, steer, articulation, articulation_rate)
        if time is not None:
            self._check_time(time)
        command = self._controller.step_with(time, measured)
        self._time = time
        return command

    def _check_time(self, time: float) -> None:
        if not math.isfinite(time):
            raise _TimeError(f"time: {time} s; give a finite number, or no time where steps are evenly spaced")
        if self._time is not None and time <= self._time:
            words = "a step is later than the one before; for another drive make another Controller"
            raise _TimeError(f"time: {time:g} s after {self._time:g} s; {words}")

    @property
    def sample_time(self) -> float:
        """Time from step to step, s."""
        return self._controller.sample_time

    @property
    def start(self) -> tuple[float, float, float, float]:
        """Where the road begins, x and y in m, yaw in rad, and the speed planned there, m/s."""
        x, y, yaw, speed = self._controller.start
        return x, y, yaw, speed

    @property
    def length(self) -> float:
        """Length of the road, m."""
        return self._controller.length

    @property
    def actuator(self) -> dict[str, float | bool] | None:
        """Steering as the drive has shown it: ``dead_time``, ``time_constant``, ``spread`` of their sum, s; whether the
        drive has ``shown`` them; ``backlash``, rad."""
        found = self._controller.actuator
        names = ("dead_time", "time_constant", "spread", "shown", "backlash")
        return None if found is None else dict(zip(names, found))


def _carried(kind: str, suffix: str) -> dict[str, Path]:
    files = sorted((Path(__file__).parent / "data" / kind).glob(f"*{suffix}"))
    if not files:
        raise RflError(f"this build of rfl_mpc carries no {kind}: install a wheel that scripts/wheels made")
    return {file.stem: file for file in files}


def fmus(version: str = "2.0") -> dict[str, Path]:
    """Co-simulation FMUs of the package, by name: plants and controllers of car and truck, of FMI 2.0 or 3.0.

    >>> sorted(fmus())
    ['PassengerCar', 'RflMpc', 'SemiTrailerTruck', 'TruckRflMpc']
    >>> fmus("3.0")["RflMpc"].parent.name
    'fmi3'
    """
    folders = {"2.0": "fmu", "3.0": "fmu/fmi3"}
    if version not in folders:
        raise RflError(f"version: {version!r}; the FMUs are of FMI {' and '.join(folders)}")
    return _carried(folders[version], ".fmu")


def vehicles() -> dict[str, Path]:
    """Files of the built-in vehicles, by name: to be copied, with the folder ``tyres`` beside them, and edited."""
    return _carried("vehicles", ".toml")


def roads() -> dict[str, Path]:
    """Files of the built-in roads, by name."""
    return _carried("paths", ".csv")
