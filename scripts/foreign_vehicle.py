#!/usr/bin/env python3
"""Learns a car that others wrote: CommonRoad's multi-body BMW 320i, driven by RflMpc.fmu in a Python loop.

    scripts/foreign_vehicle                     all of it: drives, models, tables, plot; some minutes
    scripts/foreign_vehicle --quick             a short form
    scripts/foreign_vehicle --drive road.csv --log drive.csv [--calm] [--set residual.file=model.rflm]      one drive

Three steps, which are those for any vehicle of one's own (a simulator, a test car):

1. drive: the controller FMU with calm weights and a little dither steers the foreign car along a training road;
   what was measured and commanded becomes a drive log (CSV);
2. learn: `rfl train LOG... --vehicle bmw_320i` finds what the nominal model of the controller missed;
3. use: the FMU with the parameter `residual.file` drives the car on a road that it has not seen.

The controller knows the car's single-track parameters (`vehicles/bmw_320i.toml`), not its steering actuator. Two
actuators: a fast servo, and one with lag and dead time.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import plant
from closed_loop import FMUS, Drive
from multi_body_car import Actuator, MultiBodyCar
from outcome import exit_status
from plant import OUTSIDE

ROOT = Path(__file__).resolve().parent.parent
VEHICLE = "bmw_320i"
ACTUATORS = {"fast": Actuator(lag=0.01, delay=0), "slow": Actuator(lag=0.1, delay=3)}
# Weights of a collecting controller, those of `rfl collect`: calm, for a model that has learned ringing rings.
CALM = {"mpc.tightening": 1.0}
# Half of what `rfl collect` takes: with 0.01 rad the nominal MPC lost this car behind the slow actuator, once in two
# drives.
DITHER = {"mpc.dither": 0.005}  # rad
KINDS = ("linear", "rfl", "rfl_s")
# How fast the disturbance of the observer wanders, where a row has one.
OBSERVER = {"observer.disturbance_noise": 0.01}
NOMINALS: dict[str, dict[str, object]] = {"nominal": {}, "nominal, calm": CALM, "nominal, observer": OBSERVER}
# Lateral acceleration that the road asks for in m/s2, from which it is a bend. With its wheels straight the multi-body
# car wanders sideways by itself, up to 0.02 m/s, whoever drives it: that is some 3 mm on the straights of every row.
BEND = 0.2


@dataclass(frozen=True)
class Course:
    """A drive to measure on: its name, its road, settings of the controller beside those of a row."""

    name: str
    road: Path
    settings: dict[str, object] = field(default_factory=dict)


def cut(road: Path, begin: float, end: float, out: Path) -> Path:
    """Writes the part of a road between two stations in m as a road of its own."""
    with open(road, newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    x, y = (np.array([float(row[header.index(name)]) for row in rows]) for name in "xy")
    station = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    out.parent.mkdir(parents=True, exist_ok=True)
    with open(out, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(row for row, s in zip(rows, station) if begin <= s <= end)
    return out


def drive(road: Path, actuator: Actuator, settings: dict[str, object], fmus: Path = FMUS) -> Drive:
    """Drives the foreign car along a road with the controller FMU, to the road's end or until the car is lost."""
    return plant.drive(road, VEHICLE, partial(MultiBodyCar, actuator), settings, fmus=fmus)


def tracking(result: Drive) -> dict[str, float | bool]:
    """Lateral errors of a drive in m, the greatest of them in bends, the RMS rate of the steering command in rad/s, and
    how much of the prediction was outside the model's training."""
    e1 = np.abs(result.columns["e1"])
    bends = np.abs(result.columns["curvature"]) * result.columns["vx"] ** 2 > BEND
    rate = np.diff(result.columns["steer_cmd"]) / result.step
    return {
        "mae": float(e1.mean()),
        "rmse": float(np.sqrt(np.mean(e1**2))),
        "max": float(e1.max()),
        "max_in_bends": float(e1[bends].max(initial=0.0)),
        "steer_rate_rms": float(np.sqrt(np.mean(rate**2))),
        "outside": float(result.columns[OUTSIDE].mean()),
        "finished": result.finished,
    }


def collect(job: tuple) -> Path:
    """A drive to learn from, written as a log."""
    road, actuator, seed, out, fmus = job
    result = drive(road, actuator, CALM | DITHER | {"mpc.dither_seed": seed}, fmus)
    if not result.finished:
        raise RuntimeError(f"the collecting drive did not reach the road's end: {'; '.join(result.messages)}")
    out.parent.mkdir(parents=True, exist_ok=True)
    result.write_csv(out)
    return out


def train(rfl: Path, logs: list[Path], kind: str, out: Path) -> str:
    """Learns a model from logs; gives what the program says."""
    command = [rfl, "train", *logs, "--vehicle", VEHICLE, "--kind", kind, "--out", out, "--quiet", "--force"]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"rfl train failed: {done.stderr.strip()}")
    return done.stdout


def evaluate(job: tuple) -> tuple[dict, list[str]]:
    """A drive that is measured: its figures, and what was said."""
    road, actuator, settings, log, fmus = job
    result = drive(road, actuator, settings, fmus)
    log.parent.mkdir(parents=True, exist_ok=True)
    result.write_csv(log)
    return tracking(result), result.messages


def log_of(out: Path, actuator: str, test: str, row: str) -> Path:
    """Where the log of a measured drive lies."""
    return out / actuator / f"{test}_{row.replace(', ', '_')}.csv"


def study(
    actuators: dict[str, Actuator],
    training: Path,
    tests: list[Course],
    out: Path,
    rfl: Path,
    *,
    kinds: tuple[str, ...] = KINDS,
    drives: int = 2,
    fmus: Path = FMUS,
    jobs: int = 2,
    say=lambda text: None,
) -> dict:
    """Collects, learns and drives the tests, for each actuator.

    Gives `{actuator: {test: {row: figures}}}`. Rows: the nominal controller with its default weights, with the calm
    ones, and with a disturbance observer; then the default weights with each kind of model, and the last kind with
    the observer. `pe_mae` and `pe_rmse` are in % against the nominal with default weights, None where that one was
    lost; `pe_mae_best` against the best of the nominals that reached the road's end.
    """
    result: dict = {name: {test.name: {} for test in tests} for name in actuators}
    with ProcessPoolExecutor(jobs) as pool:
        wanted = {
            (name, seed): (training, actuator, seed, out / name / f"train_{seed}.csv", fmus)
            for name, actuator in actuators.items()
            for seed in range(1, drives + 1)
        }
        logs = dict(zip(wanted, pool.map(collect, wanted.values())))
        say(f"{len(logs)} drives collected on {training.stem}")
        work = {}
        for name, actuator in actuators.items():
            rows: dict[str, dict[str, object]] = dict(NOMINALS)
            for kind in kinds:
                model = out / name / f"{kind}.rflm"
                fit = train(rfl, [log for (owner, _), log in logs.items() if owner == name], kind, model)
                model.with_suffix(".txt").write_text(fit, encoding="utf-8")
                rows[kind] = {"residual.file": str(model.resolve())}
            rows[f"{kinds[-1]}, observer"] = rows[kinds[-1]] | OBSERVER
            say(f"{name}: {', '.join(kinds)} learned")
            for test in tests:
                for row, settings in rows.items():
                    log = log_of(out, name, test.name, row)
                    work[name, test.name, row] = (test.road, actuator, test.settings | settings, log, fmus)
        for (name, test, row), (figures, messages) in zip(work, pool.map(evaluate, work.values())):
            result[name][test][row] = figures
            for message in messages:
                say(f"{name}, {test}, {row}: {message}")
    for rows in (rows for of_tests in result.values() for rows in of_tests.values()):
        arrived = [rows[row]["mae"] for row in NOMINALS if rows[row]["finished"]]
        base = rows["nominal"]
        for figures in rows.values():
            for key in ("mae", "rmse"):
                figures[f"pe_{key}"] = error_cut(figures[key], base[key]) if base["finished"] else None
            figures["pe_mae_best"] = error_cut(figures["mae"], min(arrived)) if arrived else None
    return result


def error_cut(error: float, base: float) -> float:
    """How much less than `base` an error is, in %: the papers' PE."""
    return 100.0 * (1.0 - error / base)


def percent(value: float | None) -> str:
    """A cut as text."""
    return "-" if value is None else f"{value:.1f}"


def table(result: dict) -> str:
    """The figures as text."""
    head = f"{'':<19}{'MAE m':>9}{'RMSE m':>9}{'max m':>9}{'PE MAE %':>10}{'PE RMSE %':>11}{'PE best %':>11}"
    lines = []
    for name, tests in result.items():
        for test, rows in tests.items():
            lines += [f"\n{name} actuator ({ACTUATORS[name]}), {test}", f"{head}{'steer rate':>12}{'outside %':>11}"]
            lines += [
                f"{row:<19}{f['mae']:>9.4f}{f['rmse']:>9.4f}{f['max']:>9.4f}{percent(f['pe_mae']):>10}"
                f"{percent(f['pe_rmse']):>11}{percent(f['pe_mae_best']):>11}"
                f"{f['steer_rate_rms']:>12.3f}{100 * f['outside']:>11.1f}"
                f"{'' if f['finished'] else '   LOST'}"
                for row, f in rows.items()
            ]
    lines.append(
        "\nPE: error cut against the nominal with the same weights (-: it was lost); best: against the best nominal "
        "that arrived"
    )
    return "\n".join(lines)


def plot(result: dict, out: Path, file: Path) -> None:
    """Lateral error along each test road, without and with the model."""
    panels = []
    for name, tests in result.items():
        for test, rows in tests.items():
            lines = []
            for row in ("nominal", "nominal, calm", "rfl_s"):
                figures = rows[row]
                label = f"{row} (mean {1e3 * figures['mae']:.1f} mm{'' if figures['finished'] else ', lost'})"
                lines.append((label, log_of(out, name, test, row)))
            panels.append((f"{test}, {ACTUATORS[name]}", lines))
    plant.plot_errors(panels, file)


def drive_once(options: argparse.Namespace) -> int:
    """One drive, written as a log; the exit status of its outcome."""
    settings: dict[str, object] = CALM | DITHER if options.calm else {}
    for text in options.set:
        name, separator, value = text.partition("=")
        if not separator:
            raise ValueError(f"--set wants NAME=VALUE, not '{text}'")
        settings[name] = str(Path(value).resolve()) if Path(value).is_file() else value
    result = drive(options.drive, ACTUATORS[options.actuator], settings, options.fmus)
    options.log.parent.mkdir(parents=True, exist_ok=True)
    result.write_csv(options.log)
    for message in result.messages:
        print(message, file=sys.stderr)
    figures = tracking(result)
    print(
        f"{options.log}: {result.columns['time'][-1]:.1f} s, lateral error: mean {figures['mae']:.4f} m, "
        f"max {figures['max']:.4f} m; {result.outcome}: {result.ending.reason}"
    )
    return exit_status(result.outcome, cut=False)


def run_study(options: argparse.Namespace) -> int:
    """All drives, models, tables and the plot."""
    roads, out = ROOT / "paths", options.out
    length, drives = (800.0, 1) if options.quick else (2400.0, 2)
    begin = time.perf_counter()
    training = cut(roads / "sudoku_train.csv", 0.0, length, out / "roads" / "train.csv")
    piece = cut(roads / "sudoku_test.csv", 0.0, 0.5 * length, out / "roads" / "test.csv")
    tests = [Course("sudoku_test", piece)]
    if not options.quick:
        circuit = roads / "hairpin_circuit.csv"
        tests.append(Course("hairpin_circuit", circuit, {"speed.limit": 13.0}))
        # Up to 22 m/s, where the training road ends at 13.9: what a model is worth beyond what it has seen.
        tests.append(Course("hairpin_circuit_faster_than_trained", circuit))
    result = study(
        ACTUATORS,
        training,
        tests,
        out,
        options.rfl,
        drives=drives,
        fmus=options.fmus,
        jobs=options.jobs,
        say=lambda text: print(text, file=sys.stderr, flush=True),
    )
    print(table(result))
    (out / "results.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    plot(result, out, out / "lateral_error.png")
    print(f"\n{time.perf_counter() - begin:.0f} s; results.json, lateral_error.png and logs in {out}")
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "foreign_vehicle", help="folder for results")
    parser.add_argument("--fmus", type=Path, default=FMUS, help="folder of the FMUs (default: %(default)s)")
    parser.add_argument("--rfl", type=Path, default=ROOT / "target" / "release" / "rfl", help="the program")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: %(default)s)")
    parser.add_argument("--quick", action="store_true", help="shorter roads, one drive to learn from")
    one = parser.add_argument_group("one drive")
    one.add_argument("--drive", type=Path, metavar="ROAD", help="drive this road only, a CSV with x and y")
    one.add_argument("--log", type=Path, default=Path("drive.csv"), help="file for its log (default: %(default)s)")
    one.add_argument("--actuator", choices=ACTUATORS, default="slow", help="the car's steering (default: %(default)s)")
    one.add_argument("--calm", action="store_true", help="calm weights and dither: a drive to learn from")
    one.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter; repeatable")
    options = parser.parse_args()
    try:
        return drive_once(options) if options.drive else run_study(options)
    except (RuntimeError, ValueError, OSError) as error:
        print(f"foreign_vehicle: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
