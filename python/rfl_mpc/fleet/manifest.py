"""Which drives there are: a folder of logs, logs, or a table that says of which vehicle and when each is."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rfl_mpc._native import RflError

if TYPE_CHECKING:
    import pandas as pd

LOGS = (".csv", ".csv.gz", ".parquet")
"""Files that are taken for logs in a folder."""
COLUMNS = ("log", "vehicle", "time", "vehicle_file", "reference")


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


def read(sources: Sequence[str | os.PathLike[str]]) -> list[Drive]:
    """Drives of folders, logs and manifests (tables with the columns ``log`` and ``vehicle``, CSV or Parquet)."""
    drives: list[Drive] = []
    for source in map(Path, sources):
        if source.is_dir():
            found = list(_of_folder(source))
            if not found:
                raise RflError(f"{source}: no log in this folder; logs end with {', '.join(LOGS)}")
            drives += found
        elif not source.exists():
            raise RflError(f"{source}: no such file or folder")
        elif (table := _table(source)) is not None:
            drives += _of_table(source, table)
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

        names = parquet.read_schema(source).names
        return pd.read_parquet(source) if {"log", "vehicle"} <= set(names) else None
    if not source.name.endswith((".csv", ".csv.gz", ".tsv")):
        return None
    try:
        table = pd.read_csv(source, sep=None, engine="python", dtype=str, keep_default_na=False, nrows=0)
        if not {"log", "vehicle"} <= set(table.columns):
            return None
        separator = "\t" if source.name.endswith(".tsv") else None
        options: dict[str, Any] = {"sep": separator or ","}
        with open(source, "rb") as file:
            head = file.readline()
        if separator is None and b";" in head and b"," not in head:
            options["sep"] = ";"
        return pd.read_csv(source, dtype=str, keep_default_na=False, **options)
    except (ValueError, UnicodeDecodeError, pd.errors.ParserError):
        return None


def _of_table(source: Path, table: pd.DataFrame) -> Iterator[Drive]:
    import pandas as pd

    other = [name for name in table.columns if name not in COLUMNS]
    if other:
        raise RflError(f"{source}: column '{other[0]}' is none of a manifest; its columns are {', '.join(COLUMNS)}")
    folder = source.resolve().parent
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
        text = str(value)
        return text if os.path.isabs(text) else os.path.normpath(base + text)

    times = column("time")
    orders = _orders(source, times)
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
        yield Drive(log_path, str(vehicle), (order, _natural(log_path)), text, own, placed(reference))


def _orders(source: Path, times: list[Any]) -> list[float]:
    """Times as numbers: seconds, or dates; none: in the order of the names."""
    import pandas as pd

    if all(time is None for time in times):
        return [0.0] * len(times)
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
        return [date.timestamp() for date in dates]
    if numbers.isna().any():
        row = int(numbers.isna().to_numpy().argmax())
        raise RflError(f"{source}, row {row + 2}: time '{times[row]}' is no number, where other rows have numbers")
    return [float(number) for number in numbers]
