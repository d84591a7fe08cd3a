#!/usr/bin/env python3
"""Brings logs of other tools into our drive log: MF4, Parquet, MATLAB, ROS bags, any CSV; by a mapping file.

    scripts/import_log.py drive.mf4 --list                          what the file holds; --json FILE for programs
    scripts/import_log.py drive.mf4 my_car.toml -o drive.csv.gz     a drive log for rfl diagnose and rfl train

A mapping file (TOML) says for each of our signals where it comes from. scripts/import_examples/ has one for each
format.

    rate = 100                       # samples a second of the drive log (default: those of the quickest signal)

    [time]                           # tables (Parquet, MATLAB, CSV) only; MF4 and ROS bags have their own clock
    column = "t"                     # numbers, Unix times, or time stamps: 2024-05-01T12:00:00.020+02:00, 12:00:00.020
    unit = "ms"                      # of numbers
                                     # or, without a column: rate = 100; `--rate 100` does the same

    [columns.yaw_rate]               # one of our signals; `rfl diagnose --help` names them
    column = "ESP_YawRate"           # in MATLAB a dotted path; in a ROS bag TOPIC:FIELD, e.g. /imu:angular_velocity.z
    unit = "deg/s"                   # of the file; converted to SI (default: the file's own unit, else SI)
    sign = -1                        # 1 or -1: ours is positive to the left
    factor = 1.0                     # ours = sign * (factor * converted + offset)
    offset = 0.0                     # in our unit

    [columns.steer]
    column = "SteeringWheelAngle"
    unit = "deg"
    factor = 0.0633                  # 1 / 15.8: from the steering wheel to the road wheels

    [columns.yaw]
    column = "/odom:pose.pose.orientation"
    quaternion = true                # x, y, z, w to yaw

Signals on several clocks are interpolated to one. What is missing in the file becomes an empty field. A column that
cannot be read is named; it is an error only if the mapping asks for it. Columns with names that CarSim, CarMaker,
comma.ai or Autoware give are suggested as entries of the mapping, and never taken unasked. A log of more than 512 MB
(unpacked) or 5 million rows is refused, unless --limit allows it.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import sys
from pathlib import Path

import numpy as np
from importing import listing
from importing.bags import read_rosbag
from importing.column_unit import unit_for
from importing.formats import read_matlab, read_mf4, read_parquet
from importing.known_names import is_steering_wheel, looks_like_time, suggestions
from importing.limits import MEGABYTE, MOST, STANDARD, USUAL, Limits, check_file
from importing.log import ImportFailed, Log, Series, said
from importing.mapping import check_rate, read_mapping, resolve, vocabulary, wanted
from importing.output import written
from importing.table import read_table
from importing.units import UNITS, unit_of
from progress import Progress, followed, word

READERS = {
    ".csv": read_table, ".gz": read_table, ".txt": read_table, ".tsv": read_table, ".asc": read_table,
    ".lvm": read_table, ".vbo": read_table,
    ".mf4": read_mf4, ".mdf": read_mf4, ".dat": read_mf4, ".parquet": read_parquet, ".mat": read_matlab,
    ".bag": read_rosbag, ".db3": read_rosbag, ".mcap": read_rosbag,
}  # fmt: skip


SLOW = 64 * MEGABYTE  # size of a file from which a reader is known to take its time


def open_log(file: Path, names: set[str] = frozenset(), limits: Limits = STANDARD) -> Log:
    """Opens a log by its ending, if it is within the limits; `names` are the columns that the mapping asks for."""
    if not file.exists():
        raise ImportFailed(f"{file}: there is no such file")
    if file.is_dir() and not (file / "metadata.yaml").is_file():
        # As a recorder leaves it that was stopped hard: each of its files can be read alone.
        bags = sorted(part for part in file.iterdir() if part.suffix.lower() in (".db3", ".mcap"))
        if len(bags) != 1:
            which = f"give one of its files: {', '.join(part.name for part in bags)}" if bags else "nor has it any bag"
            raise ImportFailed(f"{file}: a folder of ROS 2 has a metadata.yaml, and this one has none; {which}")
        file = bags[0]
    reader = read_rosbag if file.is_dir() else READERS.get(file.suffix.lower())
    if reader is None:
        raise ImportFailed(f"{file}: its ending is none of {', '.join(sorted(READERS))}, nor is it a folder of ROS 2")
    size = check_file(file, limits)
    if reader is not read_table and size > SLOW:
        word(f"reading {file.name}: {size // MEGABYTE} MB")
    try:
        return reader(file, names, limits)
    except ImportFailed:
        raise
    except Exception as error:  # Readers of foreign formats raise whatever they like.
        raise ImportFailed(f"{file}: cannot be read ({said(error)}); is it damaged?") from error


def yaw_of(quaternion: np.ndarray, name: str) -> np.ndarray:
    """Yaw of quaternions x, y, z, w."""
    if quaternion.ndim != 2 or quaternion.shape[1] != 4:
        raise ImportFailed(f"'{name}' is no quaternion: it needs four numbers, x, y, z, w")
    x, y, z, w = quaternion.T
    return np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def fetch(log: Log, mapping_file: Path, key: str, name: str) -> Series:
    """A column that the mapping asks for."""
    try:
        if name in log.broken:
            raise ImportFailed(log.broken[name])
        return log.get(name)
    except Exception as error:  # Readers of foreign formats raise whatever they like.
        words = f'{mapping_file}: [{key}] column = "{name}" cannot be read from {log.file}: {said(error)}'
        raise ImportFailed(words) from error


def clock_of(log: Log, mapping_file: Path, mapping: dict, rate: float | None) -> np.ndarray | float | None:
    """The time of a table's rows in seconds, or their constant rate; None where each column has its own clock."""
    table = mapping.get("time", {})
    rate = rate if rate is not None else table.get("rate")
    if rate is not None and log.clock is None:
        raise ImportFailed(f"{log.file}: it has its own clock; a constant rate is for tables without one")
    if rate is not None and "column" in table:
        raise ImportFailed(f"{mapping_file}: [time] names a column, and a constant rate is given; it is one of both")
    if rate is not None or log.clock is None:
        return rate
    if "column" not in table:
        near = [f'"{name}"' for name in log.names if looks_like_time(name)]
        hint = f" (there is {', '.join(near[:3])})" if near else ""
        raise ImportFailed(
            f"{mapping_file}: the columns of {log.file} have no clock: name the column of time in [time]{hint}, "
            "or give a constant rate: --rate HZ"
        )
    name = resolve(log, mapping_file, "time", table["column"])
    try:
        times = log.clock(name, unit_of(table["unit"]) if "unit" in table else None)
    except ImportFailed as error:
        raise ImportFailed(f"{mapping_file}: {error}") from error
    steps = np.diff(times[np.isfinite(times)])
    if len(steps) == 0:
        raise ImportFailed(
            f'{mapping_file}: [time] column = "{name}" of {log.file} holds {np.isfinite(times).sum()} times'
        )
    step = float(np.median(steps))
    if step == 0.0:
        raise ImportFailed(
            f'{mapping_file}: [time] column = "{name}": most of its time stamps repeat, it is too coarse for its rate; '
            "leave [time] out and give a constant rate: --rate HZ"
        )
    if step > 1.0 or 0 < step < 2e-5:
        log.notes.append(f"the rows of '{name}' are {step:.6g} s apart: is its unit right? [time] unit = \"ms\" is one")
    return times


def in_order(time: np.ndarray, where: str, notes: list[str]) -> np.ndarray:
    """The order of rows by time. A clock that starts anew is another drive: rows of both must not be mixed."""
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0)
    if len(back) == 0:
        return np.arange(len(time))
    usual = float(np.median(np.abs(steps)))
    far = back[steps[back] < -max(1.0, 10 * usual)]
    if len(far):
        row = int(far[0])
        raise ImportFailed(
            f"{where}: time goes back from {time[row]:.9g} s to {time[row + 1]:.9g} s after {row + 1} samples: a clock "
            "that starts anew is another drive; split the log there"
        )
    note = f"{len(back)} time stamps go back a little: rows are sorted by time"
    notes.extend([note] if note not in notes else [])
    return np.argsort(time, kind="stable")


def series_of(log: Log, mapping_file: Path, mapping: dict, rate: float | None = None) -> dict[str, Series]:
    """The mapped signals, in our units, each on its clock."""
    clock = clock_of(log, mapping_file, mapping, rate)
    found = {}
    entries = mapping["columns"].items()
    for signal, table in followed(entries, len(entries), f"reading the columns of {log.file.name}"):
        key = f"columns.{signal}"
        name = resolve(log, mapping_file, key, table["column"])
        series = fetch(log, mapping_file, key, name)
        where = f'{mapping_file}: [{key}] column = "{name}"'
        values = series.values
        if table.get("quaternion"):
            values = yaw_of(values, name)
        elif values.ndim == 2 and min(values.shape) > 1:
            raise ImportFailed(
                f"{where}: it is a matrix of {values.shape[0]} x {values.shape[1]}; name one of its columns"
            )
        values = np.ravel(values)
        if signal in ("steer", "steer_cmd") and is_steering_wheel(name) and table.get("factor", 1.0) == 1.0:
            raise ImportFailed(
                f"{where}: by its name it is the angle of the steering wheel, and {signal} is that of the road wheels; "
                "give factor = 1 / steering ratio"
            )
        time = series.time if series.time is not None else clock
        if isinstance(time, (int, float)):
            time = np.arange(len(values)) / time
        if len(time) != len(values):
            raise ImportFailed(f"{where}: it has {len(values)} values and its clock {len(time)}")
        try:
            values = values * UNITS[unit_for(log, signal, name, table)]
        except ImportFailed as error:
            raise ImportFailed(f"{mapping_file}: {error} ({log.file})") from error
        values = table.get("sign", 1) * (table.get("factor", 1.0) * values + table.get("offset", 0.0))
        known = np.isfinite(time) & np.isfinite(values)
        if known.sum() < 2:
            raise ImportFailed(f"{where}: it holds {known.sum()} numbers in {log.file}; a drive has more")
        order = in_order(time[known], f"{mapping_file}: {log.file}", log.notes)
        found[signal] = Series(time[known][order], values[known][order])
    return found


GAP = 0.5  # s; a longer stretch without a sample is left empty


def on_one_clock(
    found: dict[str, Series], rate: float | None, limits: Limits = STANDARD
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """All signals on one clock; the table's own where all share it and no rate is asked for."""
    clocks = [series.time for series in found.values()]
    if rate is None and all(np.array_equal(clock, clocks[0]) for clock in clocks):
        return clocks[0], {name: series.values for name, series in found.items()}
    steps = [float(np.median(np.diff(clock))) for clock in clocks]
    step = 1.0 / rate if rate else max(min(steps), 1e-4)
    begin, end = max(clock[0] for clock in clocks), min(clock[-1] for clock in clocks)
    if end - begin < step:
        raise ImportFailed("the signals have no time in common: they do not overlap")
    if (end - begin) / step > limits.rows:
        raise ImportFailed(
            f"the drive log would have {(end - begin) / step:.3g} rows ({end - begin:.6g} s at {1 / step:.6g} Hz), and "
            f"{limits.rows} is the limit: are the time stamps and their unit right? A lower rate in the mapping makes "
            "fewer rows"
        )
    time = begin + step * np.arange(math.floor((end - begin) / step + 1e-9) + 1)
    columns = {}
    for name, series in found.items():
        values = np.interp(time, series.time, series.values)
        after = np.searchsorted(series.time, time).clip(1, len(series.time) - 1)
        far = series.time[after] - series.time[after - 1] > max(GAP, 3 * float(np.median(np.diff(series.time))))
        columns[name] = np.where(far, np.nan, values)
    return time, columns


WRITTEN = 10_000  # rows that are written at a time


def write(file: Path, time: np.ndarray, columns: dict[str, np.ndarray]) -> None:
    """Writes the drive log, columns in the vocabulary's order."""
    names = [name for name in vocabulary() if name in columns]
    with written(file) as stream:
        rows = csv.writer(stream)
        rows.writerow(["time", *names])
        signals = [time, *(columns[name] for name in names)]
        for begin in followed(range(0, len(time), WRITTEN), len(time) / WRITTEN, f"writing {file.name}"):
            for row in zip(*(signal[begin : begin + WRITTEN].tolist() for signal in signals)):
                rows.writerow(["" if math.isnan(value) else f"{value:.9g}" for value in row])


def convert(file: Path, mapping_file: Path, out: Path, rate: float | None = None, limits: Limits = STANDARD) -> str:
    """Brings one log in; sentences on it."""
    mapping = read_mapping(mapping_file)
    log = open_log(file, wanted(mapping), limits)
    found = series_of(log, mapping_file, mapping, rate)
    time, columns = on_one_clock(found, mapping.get("rate"), limits)
    # Numbers of a clock that counts from 1970 are long and say nothing.
    time = time - time[0]
    write(out, time, columns)
    missing = [name for name in ("steer_cmd", "vx", "yaw_rate") if name not in columns]
    note = f"; without {', '.join(missing)}" if missing else ""
    lines = [f"{out}: {len(time)} rows, {time[-1]:.1f} s, {', '.join(columns)}{note}"]
    lines += [f"note: {words}" for words in log.notes]
    taken = {log.aliases.get(name, name) for name in wanted(mapping)}
    lines += [f"left out: '{name}' cannot be read: {why}" for name, why in log.broken.items() if name not in taken]
    for suggestion in suggestions(log, vocabulary()):
        if suggestion.signal not in columns and suggestion.column not in taken:
            lines += [f"not in the mapping: {suggestion.words()}; the entry would be", *indented(suggestion.entry())]
    return "\n".join(lines)


def indented(text: str) -> list[str]:
    return [f"    {line}" for line in text.split("\n")]


def list_log(options: argparse.Namespace) -> None:
    """Shows what a log holds, on the terminal or as JSON."""
    mapping = read_mapping(options.mapping) if options.mapping else {"columns": {}}
    log = open_log(options.log, wanted(mapping), Limits.of(options.limit))
    name, times = None, None
    if options.rate is None and "rate" not in mapping.get("time", {}):
        table = mapping.get("time", {})
        column = resolve(log, options.mapping, "time", table["column"]) if table else None
        name, times = listing.table_clock(log, column, unit_of(table["unit"]) if "unit" in table else None)
    rate = options.rate or mapping.get("time", {}).get("rate")
    found, broken = listing.entries(log, times, name)
    if rate is not None and log.clock is not None:
        for entry in found:
            entry.rate = float(rate)
    if name is not None:
        log.notes.append(f"rates are those of the time column '{name}'")
    suggested = suggestions(log, vocabulary())
    if options.json is None or str(options.json) != "-":
        print(listing.as_text(found, broken, log.notes, suggested, name))
    if options.json is not None:
        text = listing.as_json(log, found, broken, suggested)
        if str(options.json) == "-":
            sys.stdout.write(text)
        else:
            with written(options.json) as stream:
                stream.write(text)


def megabytes(text: str) -> int:
    """A limit, as `rfl` takes it."""
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= MOST):
        raise argparse.ArgumentTypeError(f"'{text}' is no number of MB from 1 to {MOST}")
    return int(text)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path, help="MF4, Parquet, MATLAB or CSV file, or a ROS bag (file or folder)")
    parser.add_argument("mapping", type=Path, nargs="?", help="mapping file (TOML)")
    parser.add_argument("-o", "--out", type=Path, help="drive log to write, .csv or .csv.gz (default: LOG.drive.csv)")
    parser.add_argument("--list", action="store_true", help="show what the file holds")
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="with --list: write the list as JSON (- is the terminal)"
    )
    parser.add_argument("--rate", type=float, metavar="HZ", help="constant rate of a table that has no column of time")
    parser.add_argument(
        "--limit", type=megabytes, metavar="MB",
        help=f"largest log in MB, unpacked (default: {USUAL}); a log may have {Limits.rows} rows and {Limits.columns} "
        f"columns, and for each {USUAL} MB of a larger limit as many again",
    )  # fmt: skip
    parser.add_argument("--quiet", action="store_true", help="no progress")
    options = parser.parse_args()
    Progress.quiet = options.quiet
    if not options.list and options.mapping is None:
        parser.error("give a mapping file, or --list")
    if options.json and not options.list:
        parser.error("--json belongs to --list")
    try:
        if options.rate is not None:
            check_rate("--rate", options.rate)
        if options.list:
            list_log(options)
            return 0
        out = options.out or Path(options.log.stem.removesuffix(".csv") + ".drive.csv")
        print(convert(options.log, options.mapping, out, options.rate, Limits.of(options.limit)))
    except BrokenPipeError:  # The reader of the list has seen enough.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (ImportFailed, OSError) as error:
        print(f"import_log: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
