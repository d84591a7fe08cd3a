#!/usr/bin/env python3
"""Brings logs of other tools into our drive log: MF4, Parquet, MATLAB, ROS bags, any CSV; by a mapping file.

    scripts/import_log.py drive.mf4 --list                          what the file holds
    scripts/import_log.py drive.mf4 my_car.toml -o drive.csv.gz     a drive log for rfl diagnose and rfl train

A mapping file (TOML) says for each of our signals where it comes from. scripts/import_examples/ has one for each
format.

    rate = 100                       # samples a second of the drive log (default: those of the quickest signal)

    [time]                           # tables (Parquet, MATLAB, CSV) only; MF4 and ROS bags have their own clock
    column = "t"
    unit = "ms"

    [columns.yaw_rate]               # one of our signals; `rfl diagnose --help` names them
    column = "ESP_YawRate"           # in MATLAB a dotted path; in a ROS bag TOPIC:FIELD, e.g. /imu:angular_velocity.z
    unit = "deg/s"                   # of the file; converted to SI (default: SI already)
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

Signals on several clocks are interpolated to one. What is missing in the file becomes an empty field.
"""

from __future__ import annotations

import argparse
import csv
import gzip
import importlib
import math
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np

PROJECT = Path(__file__).resolve().parent.parent

# Factors to SI, and offsets before them.
UNITS = {
    "1": 1.0,
    "%": 0.01,
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "m": 1.0,
    "mm": 1e-3,
    "cm": 1e-2,
    "km": 1e3,
    "rad": 1.0,
    "deg": math.pi / 180.0,
    "m/s": 1.0,
    "km/h": 1 / 3.6,
    "mph": 0.44704,
    "kn": 0.514444,
    "rad/s": 1.0,
    "deg/s": math.pi / 180.0,
    "m/s2": 1.0,
    "g": 9.80665,
    "1/m": 1.0,
}

PACKAGES = {"asammdf": "asammdf", "pyarrow.parquet": "pyarrow", "scipy.io": "scipy", "mat73": "mat73",
            "rosbags.highlevel": "rosbags"}  # fmt: skip


class ImportFailed(Exception):
    """What is wrong, where, and what to do."""


def load(module: str, what: str):
    """A reader's package, imported only when it is needed."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportFailed(f"{what} needs the package {PACKAGES[module]}: pip install {PACKAGES[module]}") from error


def vocabulary() -> list[str]:
    """Our signals, in order, from where they are declared."""
    text = (PROJECT / "src" / "signal.rs").read_text(encoding="utf-8")
    return re.findall(r'^    [A-Z0-9_]+ = "(\w+)" [A-Z]\w+ "', text, re.MULTILINE)


@dataclass
class Series:
    """Values and their times in seconds; values of a quaternion have four columns."""

    time: np.ndarray
    values: np.ndarray


# A reader opens a file and gives: names of what it holds, and a function from a name to its series (time is None where
# the file has no clock of its own).
Reader = tuple[list[str], Callable[[str], tuple[np.ndarray | None, np.ndarray]]]


def opened(file: Path, mode: str):
    """A text file, compressed if its name ends in .gz; a byte order mark is skipped."""
    encoding = "utf-8-sig" if mode == "r" else "utf-8"
    if file.suffix == ".gz":
        return gzip.open(file, f"{mode}t", newline="", encoding=encoding)
    return open(file, mode, newline="", encoding=encoding)


def read_csv(file: Path) -> Reader:
    """Any CSV with a header."""
    with opened(file, "r") as stream:
        sample = stream.read(4096)
        stream.seek(0)
        try:
            dialect = csv.Sniffer().sniff(sample, delimiters=",;\t")
        except csv.Error:
            dialect = csv.excel
        rows = csv.reader(stream, dialect)
        names = [name.strip() for name in next(rows, [])]
        columns: list[list[float]] = [[] for _ in names]
        for row in rows:
            for place, column in enumerate(columns):
                column.append(number(row[place] if place < len(row) else ""))
    table = {name: np.array(column) for name, column in zip(names, columns)}
    return names, lambda name: (None, table[name])


def number(text: str) -> float:
    """A field as a number; what is none is a gap."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def read_mf4(file: Path) -> Reader:
    """ASAM MDF 3 and 4."""
    mdf = load("asammdf", f"{file.name}: MF4").MDF(file)

    def get(name: str) -> tuple[np.ndarray, np.ndarray]:
        # A name may stand in several groups: the first with samples is taken.
        for group, index in mdf.channels_db[name]:
            signal = mdf.get(group=group, index=index)
            if len(signal.samples) > 1:
                return np.asarray(signal.timestamps, float), numeric(signal.samples, name)
        raise ImportFailed(f"{file.name}: '{name}' holds no samples")

    return sorted(mdf.channels_db), get


def read_parquet(file: Path) -> Reader:
    """Parquet tables."""
    parquet = load("pyarrow.parquet", f"{file.name}: Parquet")
    names = parquet.read_schema(file).names

    def get(name: str) -> tuple[None, np.ndarray]:
        column = parquet.read_table(file, columns=[name]).column(0)
        if str(column.type).startswith("timestamp"):
            # Nanoseconds since 1970 fit a float to a quarter of a microsecond.
            values = column.to_numpy().astype("datetime64[ns]").astype("int64")
            return None, (values - values[0]) * 1e-9
        return None, numeric(column.to_numpy(), name)

    return names, get


def read_matlab(file: Path) -> Reader:
    """MATLAB files: up to 7.2 with scipy, 7.3 with mat73. Structures are dotted paths."""
    with open(file, "rb") as stream:
        new = b"MATLAB 7.3" in stream.read(128)
    if new:
        data = load("mat73", f"{file.name}: MATLAB 7.3").loadmat(str(file))
    else:
        data = load("scipy.io", f"{file.name}: MATLAB").loadmat(file, simplify_cells=True)
    flat: dict[str, np.ndarray] = {}

    def walk(path: str, value) -> None:
        if isinstance(value, dict):
            for key, inner in value.items():
                walk(f"{path}.{key}" if path else key, inner)
        elif isinstance(value, np.ndarray) and value.size > 1 and value.dtype.kind in "fiub":
            flat[path] = value

    walk("", {key: value for key, value in data.items() if not key.startswith("__")})
    return list(flat), lambda name: (None, numeric(flat[name], name))


def read_rosbag(path: Path) -> Reader:
    """ROS 1 and 2 bags. A name is TOPIC:FIELD, e.g. /imu/data:angular_velocity.z."""
    highlevel = load("rosbags.highlevel", f"{path.name}: ROS bags")

    def reader():
        typestore = None
        if path.is_dir() or path.suffix in (".db3", ".mcap"):
            # A ROS 2 bag may come without its message definitions: then those of Humble are taken.
            typesys = importlib.import_module("rosbags.typesys")
            typestore = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
        bag = path.parent if path.suffix in (".db3", ".mcap") and (path.parent / "metadata.yaml").is_file() else path
        return highlevel.AnyReader([bag], default_typestore=typestore)

    with reader() as bag:
        names = []
        for connection in bag.connections:
            first = next(bag.messages(connections=[connection]), None)
            if first is not None:
                message = bag.deserialize(first[2], connection.msgtype)
                names += [f"{connection.topic}:{field}" for field in fields(message)]

    def get(name: str) -> tuple[np.ndarray, np.ndarray]:
        topic, _, field = name.partition(":")
        times, values = [], []
        with reader() as bag:
            connections = [connection for connection in bag.connections if connection.topic == topic]
            for connection, received, raw in bag.messages(connections=connections):
                message = bag.deserialize(raw, connection.msgtype)
                stamp = getattr(getattr(message, "header", None), "stamp", None)
                # The stamp is when it was measured; the bag's time is when it was written.
                measured = stamp.sec * 10**9 + stamp.nanosec if stamp is not None and stamp.sec > 0 else received
                value = message
                for part in field.split("."):
                    value = getattr(value, part)
                if all(hasattr(value, part) for part in "xyzw"):
                    value = (value.x, value.y, value.z, value.w)
                times.append(measured)
                values.append(value)
        start = start_of(path, times)
        return (np.array(times, dtype="int64") - start) * 1e-9, np.array(values, float)

    return sorted(set(names)), get


_STARTS: dict[Path, int] = {}


def start_of(path: Path, times: list[int]) -> int:
    """One beginning for all signals of a bag: nanoseconds since 1970 do not fit a float."""
    return _STARTS.setdefault(path, times[0] if times else 0)


def fields(message, prefix: str = "") -> list[str]:
    """Names of a message's numbers, as dotted paths; quaternions under their own name, too."""
    names = []
    for name in getattr(message, "__dataclass_fields__", ()):
        value = getattr(message, name)
        path = f"{prefix}{name}"
        if isinstance(value, (int, float, np.number)) and not isinstance(value, bool):
            names.append(path)
        elif hasattr(value, "__dataclass_fields__"):
            if all(hasattr(value, part) for part in "xyzw"):
                names.append(path)
            names += fields(value, f"{path}.")
    return names


def numeric(values, name: str) -> np.ndarray:
    """Values as floats."""
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError) as error:
        raise ImportFailed(f"'{name}' holds no numbers") from error


READERS = {
    ".csv": read_csv, ".gz": read_csv, ".txt": read_csv, ".mf4": read_mf4, ".mdf": read_mf4, ".dat": read_mf4,
    ".parquet": read_parquet, ".mat": read_matlab, ".bag": read_rosbag, ".db3": read_rosbag, ".mcap": read_rosbag,
}  # fmt: skip


def open_log(file: Path) -> Reader:
    """Opens a log by its ending."""
    if not file.exists():
        raise ImportFailed(f"{file}: there is no such file")
    reader = read_rosbag if file.is_dir() else READERS.get(file.suffix.lower())
    if reader is None:
        raise ImportFailed(f"{file}: its ending is none of {', '.join(sorted(READERS))}, nor is it a folder of ROS 2")
    try:
        return reader(file)
    except ImportFailed:
        raise
    except Exception as error:  # Readers of foreign formats raise whatever they like.
        raise ImportFailed(f"{file}: cannot be read ({type(error).__name__}: {error}); is it damaged?") from error


def read_mapping(file: Path) -> dict:
    """A mapping file, checked."""
    try:
        import tomllib
    except ImportError:  # Python 3.10
        tomllib = load_tomli()
    try:
        mapping = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ImportFailed(f"{file}: {error.strerror}; see scripts/import_examples/") from error
    except tomllib.TOMLDecodeError as error:
        raise ImportFailed(f"{file}: {error}") from error
    known = vocabulary()
    columns = mapping.get("columns", {})
    if not columns:
        raise ImportFailed(f"{file}: no [columns.SIGNAL] in it; see scripts/import_examples/")
    for name, column in columns.items():
        if name not in known or name == "time":
            near = get_close_matches(name, known, 1)
            hint = f"; did you mean {near[0]}?" if near else f"; signals are {', '.join(known[1:])}"
            raise ImportFailed(f"{file}: '{name}' is none of our signals{hint}")
        check(file, f"columns.{name}", column, {"column", "unit", "factor", "offset", "sign", "quaternion"})
    if "time" in mapping:
        check(file, "time", mapping["time"], {"column", "unit"})
    if unknown := mapping.keys() - {"rate", "time", "columns"}:
        raise ImportFailed(f"{file}: '{min(unknown)}' is not known; there are rate, [time] and [columns.SIGNAL]")
    rate = mapping.get("rate", 100)
    if not isinstance(rate, (int, float)) or not 0 < rate <= 1e5:
        raise ImportFailed(f"{file}: rate = {rate!r} is no number of samples a second")
    return mapping


def load_tomli():
    try:
        return importlib.import_module("tomli")
    except ImportError as error:
        raise ImportFailed("reading TOML needs Python 3.11, or the package tomli: pip install tomli") from error


def check(file: Path, where: str, table, known: set[str]) -> None:
    if not isinstance(table, dict) or not isinstance(table.get("column"), str):
        raise ImportFailed(f'{file}: [{where}] needs column = "..."')
    if unknown := table.keys() - known:
        raise ImportFailed(f"{file}: [{where}] does not know '{min(unknown)}'; there are {', '.join(sorted(known))}")
    if table.get("unit", "1") not in UNITS:
        raise ImportFailed(f"{file}: [{where}] has the unit '{table['unit']}'; there are {', '.join(UNITS)}")
    if table.get("sign", 1) not in (1, -1):
        raise ImportFailed(f"{file}: [{where}] has sign = {table['sign']}; it is 1 or -1")
    for key in ("factor", "offset"):
        if not isinstance(table.get(key, 1.0), (int, float)):
            raise ImportFailed(f"{file}: [{where}] has {key} = {table[key]!r}, which is no number")


def yaw_of(quaternion: np.ndarray, name: str) -> np.ndarray:
    """Yaw of quaternions x, y, z, w."""
    if quaternion.ndim != 2 or quaternion.shape[1] != 4:
        raise ImportFailed(f"'{name}' is no quaternion: it needs four numbers, x, y, z, w")
    x, y, z, w = quaternion.T
    return np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def fetch(reader: Reader, file: Path, name: str) -> tuple[np.ndarray | None, np.ndarray]:
    names, get = reader
    if name not in names:
        near = get_close_matches(name, names, 3, 0.4)
        hint = f"; there is {', '.join(near)}" if near else ""
        raise ImportFailed(f"{file}: there is no '{name}'{hint} (--list shows all)")
    return get(name)


def series_of(reader: Reader, file: Path, mapping: dict) -> dict[str, Series]:
    """The mapped signals, in our units, each on its clock."""
    clock = None
    if "time" in mapping:
        table = mapping["time"]
        _, clock = fetch(reader, file, table["column"])
        clock = np.ravel(clock) * UNITS[table.get("unit", "s")]
    found = {}
    for name, table in mapping["columns"].items():
        time, values = fetch(reader, file, table["column"])
        time = clock if time is None else time
        if time is None:
            raise ImportFailed(f"{file}: its columns have no clock; name the column of time in [time]")
        values = yaw_of(values, table["column"]) if table.get("quaternion") else np.ravel(values)
        if len(time) != len(values):
            raise ImportFailed(f"{file}: '{table['column']}' has {len(values)} values and its clock {len(time)}")
        values = values * UNITS[table.get("unit", "1")]
        values = table.get("sign", 1) * (table.get("factor", 1.0) * values + table.get("offset", 0.0))
        known = np.isfinite(time) & np.isfinite(values)
        if known.sum() < 2:
            raise ImportFailed(f"{file}: '{table['column']}' holds {known.sum()} numbers; a drive has more")
        order = np.argsort(time[known], kind="stable")
        found[name] = Series(time[known][order], values[known][order])
    return found


GAP = 0.5  # s; a longer stretch without a sample is left empty


def on_one_clock(found: dict[str, Series], rate: float | None) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """All signals on one clock; the table's own where all share it and no rate is asked for."""
    clocks = [series.time for series in found.values()]
    if rate is None and all(np.array_equal(clock, clocks[0]) for clock in clocks):
        return clocks[0], {name: series.values for name, series in found.items()}
    steps = [float(np.median(np.diff(clock))) for clock in clocks]
    step = 1.0 / rate if rate else max(min(steps), 1e-4)
    begin, end = max(clock[0] for clock in clocks), min(clock[-1] for clock in clocks)
    if end - begin < step:
        raise ImportFailed("the signals have no time in common: they do not overlap")
    time = begin + step * np.arange(math.floor((end - begin) / step + 1e-9) + 1)
    columns = {}
    for name, series in found.items():
        values = np.interp(time, series.time, series.values)
        after = np.searchsorted(series.time, time).clip(1, len(series.time) - 1)
        far = series.time[after] - series.time[after - 1] > max(GAP, 3 * float(np.median(np.diff(series.time))))
        columns[name] = np.where(far, np.nan, values)
    return time, columns


def write(file: Path, time: np.ndarray, columns: dict[str, np.ndarray]) -> None:
    """Writes the drive log, columns in the vocabulary's order."""
    names = [name for name in vocabulary() if name in columns]
    file.parent.mkdir(parents=True, exist_ok=True)
    with opened(file, "w") as stream:
        rows = csv.writer(stream)
        rows.writerow(["time", *names])
        for row in zip(time, *(columns[name] for name in names)):
            rows.writerow(["" if math.isnan(value) else f"{value:.9g}" for value in row])


def convert(file: Path, mapping_file: Path, out: Path) -> str:
    """Brings one log in; a sentence on it."""
    mapping = read_mapping(mapping_file)
    found = series_of(open_log(file), file, mapping)
    time, columns = on_one_clock(found, mapping.get("rate"))
    # Numbers of a clock that counts from 1970 are long and say nothing.
    time = time - time[0]
    write(out, time, columns)
    missing = [name for name in ("steer_cmd", "vx", "yaw_rate") if name not in columns]
    note = f"; without {', '.join(missing)}" if missing else ""
    return f"{out}: {len(time)} rows, {time[-1]:.1f} s, {', '.join(columns)}{note}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path, help="MF4, Parquet, MATLAB or CSV file, or a ROS bag (file or folder)")
    parser.add_argument("mapping", type=Path, nargs="?", help="mapping file (TOML)")
    parser.add_argument("-o", "--out", type=Path, help="drive log to write, .csv or .csv.gz (default: LOG.csv)")
    parser.add_argument("--list", action="store_true", help="show what the file holds")
    options = parser.parse_args()
    if not options.list and options.mapping is None:
        parser.error("give a mapping file, or --list")
    try:
        if options.list:
            print("\n".join(open_log(options.log)[0]))
            return 0
        out = options.out or Path(options.log.stem.removesuffix(".csv") + ".drive.csv")
        print(convert(options.log, options.mapping, out))
    except (ImportFailed, OSError) as error:
        print(f"import_log: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
