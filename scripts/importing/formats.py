"""Binary formats with one table or a channel group each: ASAM MF4, Parquet, MATLAB."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from importing import clock
from importing.limits import Limits
from importing.log import ImportFailed, Log, Series, load, numeric, said
from importing.number import number

LONGEST_STAMP = 100  # letters of a time stamp


def read_mf4(file: Path, _wanted: set[str], limits: Limits) -> Log:
    """ASAM MDF 3 and 4."""
    mdf = load("asammdf", f"{file.name}: MF4").MDF(file)
    check_groups(file, mdf, limits)
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


def check_groups(file: Path, mdf, limits: Limits) -> None:
    """Holds the groups' samples against the limits: blocks may be packed."""
    size = 0
    for group in mdf.groups:
        about = group.channel_group
        limits.check_rows(about.cycles_nr, f"{file}: ", "samples in a group")
        size += about.cycles_nr * (about.samples_byte_nr + getattr(about, "invalidation_bytes_nr", 0))
    try:
        limits.check_bytes(size, unpacked=True)
    except ImportFailed as error:
        raise ImportFailed(f"{file}: {error}") from error


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


def read_parquet(file: Path, _wanted: set[str], limits: Limits) -> Log:
    """Parquet tables; a structure's fields are dotted names."""
    parquet, arrow = load("pyarrow.parquet", f"{file.name}: Parquet"), load("pyarrow", f"{file.name}: Parquet")
    compute, types = load("pyarrow.compute", f"{file.name}: Parquet"), arrow.types
    units: dict[str, str] = {}
    broken: dict[str, str] = {}
    places: dict[str, list[str]] = {}

    def is_string(kind) -> bool:
        return types.is_string(kind) or types.is_large_string(kind)

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

    with parquet.ParquetFile(file) as opened:
        about, schema = opened.metadata, opened.schema_arrow
    limits.check_rows(about.num_rows, f"{file}: ")
    limits.check_columns(about.num_columns, f"{file}: ")
    # A column is read when it is needed, so each is held against the limit alone.
    sizes: dict[str, int] = {}
    for group in map(about.row_group, range(about.num_row_groups)):
        for part in map(group.column, range(group.num_columns)):
            sizes[part.path_in_schema] = sizes.get(part.path_in_schema, 0) + part.total_uncompressed_size
    for entry in schema:
        walk([entry.name], entry)

    def column(name: str):
        path = places[name]
        limits.check_bytes(sizes.get(name, 0), unpacked=True)
        # Of texts each is kept once: a short file can repeat a long one a million times.
        texts = [name] if is_text(path) else None
        with parquet.ParquetFile(file, read_dictionary=texts) as opened:
            found = opened.read(columns=[name]).column(0)
        for part in path[1:]:
            found = compute.struct_field(found, part)
        return found.combine_chunks()

    def is_text(path: list[str]) -> bool:
        kind = schema.field(path[0]).type
        for part in path[1:]:
            kind = kind.field(part).type
        return is_string(kind.value_type if types.is_dictionary(kind) else kind)

    def get(name: str) -> Series:
        if name in broken:
            raise ImportFailed(broken[name])
        if is_text(places[name]):
            raise ImportFailed("it holds text")
        found = column(name)
        kind = found.type
        if types.is_dictionary(kind):
            found = found.dictionary_decode()
            kind = found.type
        if types.is_temporal(kind):
            return Series(None, seconds(found.cast(arrow.int64() if not types.is_date32(kind) else arrow.int32())))
        return Series(None, numeric(found.cast(arrow.float64(), safe=False).to_numpy(zero_copy_only=False), name))

    def seconds(numbers) -> np.ndarray:
        known = numbers.drop_null()
        if len(known) == 0:
            return np.full(len(numbers), np.nan)
        # Counted from the first: nanoseconds since 1970 do not fit a float.
        since = compute.subtract(numbers.cast(arrow.int64()), known[0].cast(arrow.int64()))
        return since.cast(arrow.float64(), safe=False).to_numpy(zero_copy_only=False)

    def stamps(found, where: str) -> np.ndarray:
        if types.is_dictionary(found.type):
            if any(len(text or "") > LONGEST_STAMP for text in found.dictionary.to_pylist()):
                raise ImportFailed(f"{where}: it holds texts of more than {LONGEST_STAMP} letters, no time stamps")
            found = found.dictionary_decode()
        rows = np.flatnonzero(compute.greater(compute.binary_length(found), 0).fill_null(False).to_numpy(False))
        times = np.full(len(found), np.nan)
        if len(rows):
            texts = (found[int(row)].as_py().strip() for row in rows)
            times[rows] = clock.of_stamps(texts, where, (int(row) + 1 for row in rows))
        return times

    def time(name: str, unit: str | None) -> np.ndarray:
        where = f"{file}: [time] column = '{name}'"
        found = column(name)
        kind = found.type
        if types.is_temporal(kind):
            scale = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}.get(getattr(kind, "unit", "s"), 1.0)
            if types.is_date(kind):
                raise ImportFailed(f"{where}: it holds days ({kind}), no times")
            wide = arrow.int32() if types.is_time32(kind) else arrow.int64()
            return seconds(found.cast(wide)) * scale
        if is_text(places[name]):
            return stamps(found, where)
        times, note = clock.of_numbers(get(name).values, unit, units.get(name, ""), name)
        if note:
            log.notes.append(f"time '{name}': {note}")
        return times

    log = Log(file, list(places), get, time, units, broken)
    return log


def loaded(file: Path, new: bool, limits: Limits) -> dict:
    """A MATLAB file's content, once it is known to fit."""
    if new:
        reader = load("mat73", f"{file.name}: MATLAB 7.3")
        limits.check_bytes(size_of_hdf5(file), unpacked=True)
        return reader.loadmat(str(file))
    reader = load("scipy.io", f"{file.name}: MATLAB")
    check_unpacked(file, limits)
    for name, shape, kind in reader.whosmat(file):
        if kind != "sparse":
            limits.check_fields(math.prod(shape), f"'{name}': ")
    return reader.loadmat(file, simplify_cells=True)


def size_of_hdf5(file: Path) -> int:
    """Bytes of the data sets of an HDF5 file, unpacked."""
    h5py = load("h5py", f"{file.name}: MATLAB 7.3")
    sizes: list[int] = []
    with h5py.File(file, "r") as content:
        content.visititems(lambda _, entry: sizes.append(entry.nbytes) if isinstance(entry, h5py.Dataset) else None)
    return sum(sizes)


def check_unpacked(file: Path, limits: Limits) -> None:
    """Unpacks the variables of a MATLAB file of kind 5 and forgets them: what they say of their size may be wrong."""
    size = 0
    with open(file, "rb") as stream:
        head = stream.read(128)
        if len(head) < 128 or 0 in head[:4]:
            return  # an older kind, which packs nothing
        order = "little" if head[126:128] == b"IM" else "big"
        while len(tag := stream.read(8)) == 8:
            kind, count = (int.from_bytes(tag[i : i + 4], order) for i in (0, 4))
            if kind != 15:
                stream.seek(count, 1)
                continue
            unpacker = zlib.decompressobj()
            while count > 0 and (data := stream.read(min(count, 1 << 16))):
                count -= len(data)
                while data and not unpacker.eof:
                    size += len(unpacker.decompress(data, 1 << 20))
                    limits.check_bytes(size, unpacked=True, known=False)
                    data = unpacker.unconsumed_tail


def read_matlab(file: Path, _wanted: set[str], limits: Limits) -> Log:
    """MATLAB files: up to 7.2 with scipy, 7.3 with mat73. Structures are dotted paths, columns of matrices A(:,2)."""
    with open(file, "rb") as stream:
        new = b"MATLAB 7.3" in stream.read(128)
    try:
        data = loaded(file, new, limits)
    except ImportFailed as error:
        raise ImportFailed(f"{file}: {error}") from error
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
