"""Which drives there are: a folder of logs, logs, or a table that says of which vehicle and when each is."""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rfl_mpc._call import file_name, reason
from rfl_mpc._native import RflError, signals

if TYPE_CHECKING:
    import pandas as pd

LOGS = (".csv", ".csv.gz", ".parquet")
"""Files that are taken for logs in a folder."""
FOREIGN = {
    "a spreadsheet": (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods", ".numbers"),
    "an archive": (".zip", ".tar", ".tgz", ".tar.gz", ".7z", ".rar"),
    "a recording of another tool": (
        ".mf4",
        ".mdf",
        ".mat",
        ".h5",
        ".hdf5",
        ".bag",
        ".db3",
        ".mcap",
        ".blf",
        ".ld",
        ".vbo",
    ),
}
"""Files that are no table, by their endings."""
ADVICE = {
    "a spreadsheet": "save its sheet as CSV and give that",
    "an archive": "unpack it and give the folder",
    "a recording of another tool": "scripts/import_log.py makes a log of it",
}
COLUMNS = ("log", "vehicle", "time", "vehicle_file", "reference")
NEEDS = f"a manifest needs the columns log and vehicle, and may have {', '.join(COLUMNS[2:])}"


@dataclass(frozen=True)
class Drive:
    """A row of a manifest; files are absolute paths, or built-in names of vehicles."""

    log: str
    vehicle: str
    order: tuple[float, str]
    """Drives of a vehicle in the order of this: time, then name."""
    time: str | None = None
    """When it began, ISO 8601 or a number as it was given."""
    vehicle_file: str | None = None
    """The simulator's vehicle, and so the type; None: the default."""
    reference: str | None = None
    clock: str | None = None
    """Kind of ``time``: times of one kind can be compared."""


def is_table(source: Any) -> bool:
    """Whether it is a data frame (pandas, polars, Arrow), or a dict of columns."""
    return isinstance(source, Mapping) or hasattr(source, "columns")


def read(sources: Sequence[Any]) -> list[Drive]:
    """Drives of folders, logs and manifests (tables with the columns ``log`` and ``vehicle``: CSV, Parquet, frames)."""
    drives: list[Drive] = []
    for given in sources:
        if is_table(given):
            drives += _of_frame(given)
            continue
        if not isinstance(given, (str, bytes, os.PathLike)):
            raise RflError(f"{given!r} names no drives; give a folder, a log or a manifest")
        source = Path(file_name(given))
        if source.is_dir():
            found = list(_of_folder(source))
            if not found:
                other = next((words for file in sorted(source.rglob("*")) if (words := _foreign(file))), None)
                raise RflError(other or f"{source}: no log in this folder; logs end with {', '.join(LOGS)}")
            drives += found
        elif not source.exists():
            raise RflError(f"{source}: no such file or folder")
        elif words := _foreign(source):
            raise RflError(words)
        elif (table := _table(source)) is not None:
            drives += _of_table(str(source), source.resolve().parent, table)
        else:
            log = source.resolve()
            drives.append(Drive(str(log), log.parent.name, (0.0, _natural(log.name))))
    if not drives:
        raise RflError("no drive is given; name a folder of logs, logs, or a table with the columns log and vehicle")
    seen: dict[tuple[str, str], None] = {}
    for drive in drives:
        if (drive.vehicle, drive.log) in seen:
            raise RflError(f"{drive.log} is given twice for vehicle '{drive.vehicle}'; name each drive once")
        seen[drive.vehicle, drive.log] = None
    timed: dict[str, Drive] = {}
    for drive in drives:
        if drive.clock and (first := timed.setdefault(drive.vehicle, drive)).clock != drive.clock:
            words = f"{first.log} has {first.clock}, {drive.log} {drive.clock}"
            raise RflError(f"vehicle '{drive.vehicle}': {words}: which was first? Give times of one kind")
    return sorted(drives, key=lambda drive: (drive.vehicle, drive.order))


def _of_folder(folder: Path) -> Iterator[Drive]:
    """Each folder with logs is a vehicle; its file ``vehicle.toml``, if it has one, lies beside them or above."""
    folder = folder.resolve()
    for place, folders, names in os.walk(folder):
        folders.sort()
        here = Path(place)
        own = next(
            (str(above / "vehicle.toml") for above in _up(here, folder) if (above / "vehicle.toml").exists()), None
        )
        vehicle = here.relative_to(folder).as_posix() if here != folder else folder.name
        for name in sorted(names):
            if name.endswith(LOGS) and not name.startswith("."):
                yield Drive(str(here / name), vehicle, (0.0, _natural(name)), vehicle_file=own)


def _foreign(source: Path) -> str | None:
    """What to do with a file that is no table; None: it may be one."""
    name = source.name.lower()
    kind = next((kind for kind, endings in FOREIGN.items() if name.endswith(endings)), None)
    return kind and f"{source}: {kind}, not a log; {ADVICE[kind]}"


def _up(place: Path, top: Path) -> Iterator[Path]:
    while True:
        yield place
        if place == top:
            return
        place = place.parent


def _natural(name: str) -> str:
    """A name by which ``drive_10`` comes after ``drive_9``."""
    return re.sub(r"\d+", lambda digits: digits.group().zfill(20), name)


def _table(source: Path) -> pd.DataFrame | None:
    """The table, if a file is a manifest."""
    import pandas as pd

    if source.suffix == ".parquet":
        import pyarrow.parquet as parquet

        try:
            if not _is_manifest(source, parquet.read_schema(source).names):
                return None
        except (ValueError, OSError):
            # Its diagnosis says what is wrong with it.
            return None
        try:
            return _with_index(pd.read_parquet(source))
        except (ValueError, OSError) as error:
            raise RflError(f"{source}: {reason(error)}; write it anew") from None
    if not source.name.endswith((".csv", ".csv.gz", ".tsv")) or not source.is_file():
        return None
    try:
        separator = _separator(source)
        if separator is None:
            return None
        with _open(source) as file:
            text = _decoded(file.read())
    except (OSError, EOFError):
        return None
    try:
        lines = csv.reader(io.StringIO(text, newline=""), delimiter=separator, skipinitialspace=True)
        head, *rows = [cells for cells in lines if any(cells)]
    except csv.Error as error:
        raise RflError(f"{source}: {error}; write the table anew") from None
    for row, cells in enumerate(rows, start=2):
        if len(cells) > len(head):
            words = f"{len(cells)} values for {len(head)} columns; quote a value that holds '{separator}'"
            raise RflError(f"{source}, row {row}: {words}")
        cells.extend([""] * (len(head) - len(cells)))
    return pd.DataFrame(rows, columns=head, dtype=object)


def _open(source: Path) -> Any:
    return gzip.open(source, "rb") if source.suffix == ".gz" else open(source, "rb")


def _decoded(data: bytes, *, whole: bool = True) -> str:
    """Text as spreadsheets write it: UTF-8, UTF-16, or of Windows; what is not whole may end within a letter."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    try:
        return codecs.getincrementaldecoder("utf-8-sig")().decode(data, final=whole)
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _separator(source: Path) -> str | None:
    """What separates the values of a manifest; None: it is a log."""
    with _open(source) as file:
        # The names are within this; a log is not read for them.
        lines = _decoded(file.read(1 << 16), whole=False).lstrip("\r\n").splitlines()
    if not lines:
        return None
    heads = {}
    for separator in ",;\t":
        try:
            heads[separator] = next(csv.reader([lines[0]], delimiter=separator, skipinitialspace=True))
        except csv.Error:
            continue
    if not heads:
        return None
    separator = max(heads, key=lambda one: len(heads[one]))
    return separator if _is_manifest(source, heads[separator]) else None


def _lower(name: Any) -> str:
    return str(name).strip().lower()


def _is_manifest(source: Path, columns: Iterable[Any]) -> bool:
    """Whether columns are those of a manifest; what is neither one nor a log is an error."""
    names = [_lower(column) for column in columns]
    if {"log", "vehicle"} <= set(names):
        return True
    # A time may be of both.
    logged = any(signal not in (None, "time") for signal in signals(names))
    if not logged and any(name in COLUMNS and name != "time" for name in names):
        raise RflError(f"{source}: neither a log nor a manifest (columns: {', '.join(names[:8])}); {NEEDS}")
    return False


def _of_frame(given: Any) -> Iterator[Drive]:
    """Drives of a data frame; its files are relative to the current folder."""
    import pandas as pd

    table = _with_index(given.to_pandas() if hasattr(given, "to_pandas") else pd.DataFrame(given))
    names = [_lower(column) for column in table.columns]
    if not {"log", "vehicle"} <= set(names):
        raise RflError(f"<table>: no manifest (columns: {', '.join(names[:8]) or 'none'}); {NEEDS}")
    yield from _of_table("<table>", Path.cwd(), table)


def _with_index(table: pd.DataFrame) -> pd.DataFrame:
    """The table with its index as columns, where that has names of a manifest's columns."""
    names = {_lower(column) for column in table.columns}
    levels = {name: level for level, name in enumerate(table.index.names) if name is not None}
    wanted = {name: level for name, level in levels.items() if _lower(name) in COLUMNS and _lower(name) not in names}
    return table.assign(**{_lower(name): table.index.get_level_values(level) for name, level in wanted.items()})


def _of_table(source: str, folder: Path, table: pd.DataFrame) -> Iterator[Drive]:
    import pandas as pd

    table = table.rename(columns=_lower)
    other = [name for name in table.columns if name not in COLUMNS]
    if other:
        raise RflError(f"{source}: column '{other[0]}' is none of a manifest; its columns are {', '.join(COLUMNS)}")
    if not table.columns.is_unique:
        name = table.columns[table.columns.duplicated()][0]
        raise RflError(f"{source}: the column '{name}' stands twice; leave one of them out")
    base = str(folder) + os.sep
    rows = len(table)

    def column(name: str) -> list[Any]:
        if name not in table:
            return [None] * rows
        values = table[name]
        return [None if pd.isna(value) or value == "" else value for value in values.tolist()]

    def placed(value: Any) -> str | None:
        if value is None:
            return None
        text = file_name(value) if isinstance(value, (str, bytes, os.PathLike)) else str(value)
        return text if os.path.isabs(text) else os.path.normpath(base + text)

    times = column("time")
    clock, orders = _orders(source, times)
    for row, (log, vehicle, time, order, file, reference) in enumerate(
        zip(column("log"), column("vehicle"), times, orders, column("vehicle_file"), column("reference"))
    ):
        for name, value in (("log", log), ("vehicle", vehicle)):
            if value is None:
                raise RflError(f"{source}, row {row + 2}: no {name}")
        # A built-in vehicle is a name; a file has a suffix or a folder.
        own = file if file is None or not re.search(r"[/\\.]", str(file)) else placed(file)
        text = None if time is None else str(time)
        log_path = placed(log) or ""
        yield Drive(log_path, str(vehicle), (order, _natural(log_path)), text, own, placed(reference), clock)


def _orders(source: str, times: list[Any]) -> tuple[str | None, list[float]]:
    """Kind of the times, and the times as numbers: seconds, or dates; none: in the order of the names."""
    import pandas as pd

    if all(time is None for time in times):
        return None, [0.0] * len(times)
    for row, time in enumerate(times):
        if time is None:
            raise RflError(f"{source}, row {row + 2}: no time, where other rows have one")
    series = pd.Series(times)
    numbers = pd.to_numeric(series, errors="coerce")
    if series.map(lambda value: isinstance(value, pd.Timestamp)).all() or numbers.isna().all():
        dates = pd.to_datetime(series, errors="coerce", utc=True, format=None if len(series) == 1 else "ISO8601")
        if dates.isna().any():
            row = int(dates.isna().to_numpy().argmax())
            raise RflError(f"{source}, row {row + 2}: time '{times[row]}' is neither a number nor a date (ISO 8601)")
        return _zones(source, times), [date.timestamp() for date in dates]
    if numbers.isna().any():
        row = int(numbers.isna().to_numpy().argmax())
        raise RflError(f"{source}, row {row + 2}: time '{times[row]}' is no number, where other rows have numbers")
    return "numbers for times", [float(number) for number in numbers]


def _zones(source: str, times: list[Any]) -> str:
    """Kind of dates; with a zone and without one they cannot be compared."""
    import pandas as pd

    kinds: dict[str, list[int]] = {}
    for row, time in enumerate(times, start=2):
        zoned = pd.Timestamp(str(time).strip()).tzinfo is not None
        kinds.setdefault("times with a zone" if zoned else "times without a zone", []).append(row)
    if len(kinds) > 1:
        words = ", ".join(f"{kind} in {_rows(rows)}" for kind, rows in kinds.items())
        raise RflError(f"{source}: {words}: which was first? Give all a zone, such as Z for UTC, or none")
    return next(iter(kinds))


def _rows(rows: list[int]) -> str:
    """Some rows by their numbers, the first ones."""
    more = f" and {len(rows) - 3} more" if len(rows) > 3 else ""
    return f"row{'s' if len(rows) > 1 else ''} {', '.join(map(str, rows[:3]))}{more}"
