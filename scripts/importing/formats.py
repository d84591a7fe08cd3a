"""Binary formats with one table or a channel group each: ASAM MF4, Parquet, MATLAB."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from importing import clock
from importing.log import ImportFailed, Log, Series, load, numeric, said
from importing.table import number


def read_mf4(file: Path, _wanted: set[str]) -> Log:
    """ASAM MDF 3 and 4."""
    mdf = load("asammdf", f"{file.name}: MF4").MDF(file)
    notes: list[str] = []
    units: dict[str, str] = {}
    masters = {name for name, places in mdf.channels_db.items() if all(is_master(mdf, *place) for place in places)}

    def get(name: str) -> Series:
        # A name may stand in several groups: the first with samples is taken.
        reasons = []
        for group, index in mdf.channels_db[name]:
            try:
                signal = mdf.get(group=group, index=index)
                values = signal.samples
                if values.dtype.kind in "SUO":
                    # An enumeration's numbers, not its words; text has none.
                    values = numbers_among(values, mdf.get(group=group, index=index, raw=True).samples)
                values = numeric(values, name)
            except Exception as error:
                reasons.append(said(error))
                continue
            if len(values) > 1:
                if signal.unit:
                    units[name] = signal.unit
                if len(mdf.channels_db[name]) > 1:
                    note = f"'{name}' stands in {len(mdf.channels_db[name])} groups: that of group {group} is taken"
                    notes.extend([note] if note not in notes else [])
                return Series(np.asarray(signal.timestamps, float), values)
        raise ImportFailed(reasons[0] if reasons else "it holds no samples")

    for name, places in mdf.channels_db.items():
        for group, index in places:
            channel = mdf.groups[group].channels[index]
            unit = getattr(channel, "unit", "") or getattr(getattr(channel, "conversion", None), "unit", "")
            if unit and name not in units:
                units[name] = unit.decode("latin-1").strip(" \0") if isinstance(unit, bytes) else unit

    return Log(file, sorted(mdf.channels_db.keys() - masters), get, None, units, {}, {}, notes)


def numbers_among(words: np.ndarray, raw: np.ndarray) -> np.ndarray:
    """Numbers of a channel that has words for some values ('not available'), or raw ones where all are words."""
    texts = [word.decode("latin-1") if isinstance(word, bytes) else str(word) for word in words.tolist()]
    values = np.array([math.nan if (value := number(text.strip(), False)) is None else value for text in texts])
    if np.isfinite(values).any():
        return values
    if raw.dtype.kind not in "fiub":
        raise ImportFailed("it holds text")
    return raw


def is_master(mdf, group: int, index: int) -> bool:
    """Whether a channel is its group's clock, which says nothing beside the signals."""
    return mdf.masters_db.get(group) == index


def read_parquet(file: Path, _wanted: set[str]) -> Log:
    """Parquet tables; a structure's fields are dotted names."""
    parquet, arrow = load("pyarrow.parquet", f"{file.name}: Parquet"), load("pyarrow", f"{file.name}: Parquet")
    compute, types = load("pyarrow.compute", f"{file.name}: Parquet"), arrow.types
    units: dict[str, str] = {}
    broken: dict[str, str] = {}
    places: dict[str, list[str]] = {}

    def walk(path: list[str], entry) -> None:
        name, kind = ".".join(path), entry.type
        if types.is_struct(kind):
            for inner in kind.fields if hasattr(kind, "fields") else [kind.field(i) for i in range(kind.num_fields)]:
                walk([*path, inner.name], inner)
            return
        places[name] = path
        if types.is_nested(kind):
            broken[name] = f"its type is nested ({kind})"
        elif types.is_binary(kind) or types.is_null(kind):
            broken[name] = f"its type is {kind}"
        if entry.metadata and b"unit" in entry.metadata:
            units[name] = entry.metadata[b"unit"].decode("utf-8", "replace")

    for entry in parquet.read_schema(file):
        walk([entry.name], entry)

    def column(name: str):
        path = places[name]
        found = parquet.ParquetFile(file).read(columns=[name]).column(0)
        for part in path[1:]:
            found = compute.struct_field(found, part)
        return found.combine_chunks()

    def get(name: str) -> Series:
        if name in broken:
            raise ImportFailed(broken[name])
        found = column(name)
        kind = found.type
        if types.is_dictionary(kind):
            found = found.dictionary_decode()
            kind = found.type
        if types.is_temporal(kind):
            return Series(None, seconds(found.cast(arrow.int64() if not types.is_date32(kind) else arrow.int32())))
        if types.is_string(kind) or types.is_large_string(kind):
            raise ImportFailed("it holds text")
        return Series(None, numeric(found.cast(arrow.float64(), safe=False).to_numpy(zero_copy_only=False), name))

    def seconds(numbers) -> np.ndarray:
        raw = numbers.to_pylist()
        first = next((value for value in raw if value is not None), 0)
        return np.array([np.nan if value is None else float(value - first) for value in raw])

    def time(name: str, unit: str | None) -> np.ndarray:
        where = f"{file}: [time] column = '{name}'"
        found = column(name)
        kind = found.type
        if types.is_temporal(kind):
            # Counted from the first: nanoseconds since 1970 do not fit a float.
            scale = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}.get(getattr(kind, "unit", "s"), 1.0)
            if types.is_date(kind):
                raise ImportFailed(f"{where}: it holds days ({kind}), no times")
            wide = arrow.int32() if types.is_time32(kind) else arrow.int64()
            return seconds(found.cast(wide)) * scale
        if types.is_string(kind) or types.is_large_string(kind):
            texts = found.to_pylist()
            rows = [row for row, text in enumerate(texts) if text]
            times = np.full(len(texts), np.nan)
            if rows:
                stamps = [texts[row].strip() for row in rows]
                times[rows] = clock.of_stamps(stamps, where, [row + 1 for row in rows])
            return times
        times, note = clock.of_numbers(get(name).values, unit, units.get(name, ""), name)
        if note:
            log.notes.append(f"time '{name}': {note}")
        return times

    log = Log(file, list(places), get, time, units, broken)
    return log


def read_matlab(file: Path, _wanted: set[str]) -> Log:
    """MATLAB files: up to 7.2 with scipy, 7.3 with mat73. Structures are dotted paths, columns of matrices A(:,2)."""
    with open(file, "rb") as stream:
        new = b"MATLAB 7.3" in stream.read(128)
    if new:
        data = load("mat73", f"{file.name}: MATLAB 7.3").loadmat(str(file))
    else:
        data = load("scipy.io", f"{file.name}: MATLAB").loadmat(file, simplify_cells=True)
    flat: dict[str, Callable[[], np.ndarray]] = {}
    broken: dict[str, str] = {}

    def walk(path: str, value) -> None:
        if isinstance(value, dict):
            for key, inner in value.items():
                walk(f"{path}.{key}" if path else key, inner)
        elif isinstance(value, (list, np.ndarray)) and is_structures(value):
            for i, inner in enumerate(value):
                walk(f"{path}({i + 1})", inner)
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
            array(path, value)
        elif not isinstance(value, (int, float, np.number)):
            broken[path] = kind_of(value)

    def array(path: str, value: np.ndarray) -> None:
        if value.size < 2:
            return  # a parameter
        value = np.squeeze(value)
        if value.ndim == 1:
            flat[path] = lambda: value
        elif value.ndim == 2 and min(value.shape) <= 64:
            flat[path] = lambda: value
            # Samples go down; a matrix of few long rows goes across.
            table = value if value.shape[0] >= value.shape[1] else value.T
            for i in range(table.shape[1]):
                name = f"{path}(:,{i + 1})" if table is value else f"{path}({i + 1},:)"
                flat[name] = lambda i=i: table[:, i]
        else:
            broken[path] = f"an array of {' x '.join(map(str, value.shape))}"

    for key, value in data.items():
        if not str(key).startswith("__"):
            walk(str(key), value)

    def get(name: str) -> Series:
        if name in broken:
            raise ImportFailed(broken[name])
        return Series(None, numeric(flat[name](), name))

    def time(name: str, unit: str | None) -> np.ndarray:
        times, note = clock.of_numbers(np.ravel(get(name).values), unit, "", name)
        if note:
            log.notes.append(f"time '{name}': {note}")
        return times

    log = Log(file, [*flat, *broken], get, time, {}, broken)
    return log


def is_structures(value) -> bool:
    """Whether a value is an array of few structures, such as Simulink's `signals`."""
    inner = list(value.flat) if isinstance(value, np.ndarray) and value.dtype == object else value
    return isinstance(inner, list) and 0 < len(inner) <= 100 and all(isinstance(entry, dict) for entry in inner)


def kind_of(value) -> str:
    """What a MATLAB value that holds no numbers is."""
    if isinstance(value, (str, bytes)):
        return "it holds text"
    if type(value).__name__ == "MatlabOpaque" or (isinstance(value, np.ndarray) and value.dtype.names):
        return "it is a MATLAB object (table, timeseries, datetime): save it as a structure of arrays"
    if isinstance(value, np.ndarray) and value.dtype.kind == "c":
        return "it holds complex numbers"
    if isinstance(value, (list, np.ndarray)):
        return "it is a cell array or an array of structures"
    return f"it is a {type(value).__name__}, which holds no columns of numbers"
