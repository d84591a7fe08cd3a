"""The answers as tables: a row a drive, a row a change of a vehicle, a row a parameter of a type and of a vehicle."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rfl_mpc.fleet.manifest import Drive

if TYPE_CHECKING:
    import pyarrow

ROWS = 1000
"""Rows of a group in Parquet files: as many are in memory at a time."""


def verdict_schema() -> pyarrow.Schema:
    """Columns of ``verdicts.parquet``."""
    import pyarrow as pa

    number, text = pa.float64(), pa.string()
    bound = [("least", number), ("greatest", number), ("goes_with", text), ("value", number)]
    own = [("name", text), ("given", number), ("unit", text), ("reciprocal", pa.bool_()), ("tolerance", number)]
    parameter = pa.struct([*own, ("change", number), *bound])
    effect = pa.struct([("id", text), ("value", number), ("low", number), ("high", number), ("unit", text)])
    return pa.schema(
        [
            ("vehicle", text),
            ("type", text),
            ("drive", pa.int32()),
            ("time", text),
            ("log", text),
            ("key", text),
            ("error", text),
            ("kind", text),
            ("probability", number),
            ("words", text),
            ("effects", pa.list_(effect)),
            ("none", number),
            ("not_in_library", number),
            ("inclusion", pa.map_(text, number)),
            ("gap_yaw_rate", number),
            ("gap_yaw_rate_after", number),
            ("gap_ay", number),
            ("gap_ay_after", number),
            ("duration", number),
            ("findings", pa.list_(text)),
            ("parameters", pa.list_(parameter)),
            ("precision", pa.list_(number)),
            ("gradient", pa.list_(number)),
            ("temper", number),
            ("version", text),
        ]
    )  # fmt: skip


def change_schema() -> pyarrow.Schema:
    """Columns of ``vehicles.parquet``."""
    import pyarrow as pa

    number, text, count, flag = pa.float64(), pa.string(), pa.int32(), pa.bool_()
    return pa.schema(
        [
            ("vehicle", text),
            ("type", text),
            ("drives", count),
            ("nothing", number),
            ("changed", flag),
            ("said", flag),
            ("effect", text),
            ("unit", text),
            ("passing", flag),
            ("since", text),
            ("since_drive", count),
            ("earliest", count),
            ("latest", count),
            ("before", number),
            ("value", number),
            ("low", number),
            ("high", number),
            ("probability", number),
            ("also", pa.map_(text, number)),
        ]
    )  # fmt: skip


def parameter_schema() -> pyarrow.Schema:
    """Columns of ``types.parquet``: of a type, and of each vehicle."""
    import pyarrow as pa

    number, text = pa.float64(), pa.string()
    words = [(name, text) for name in ("type", "vehicle", "parameter", "unit")]
    numbers = ("simulator", "value", "low", "high", "tolerance", "between_vehicles", "between_drives")
    return pa.schema([*words, *((name, number) for name in numbers)])


def verdict_row(drive: Drive, type: str, number: int, key: str, answer: dict[str, Any], version: str) -> dict[str, Any]:
    """A row of ``verdicts.parquet``; ``number`` counts the vehicle's drives from 1."""
    gaps, information = answer.get("gaps") or {}, answer.get("information") or {}
    yaw_rate, ay = gaps.get("yaw_rate") or (None, None), gaps.get("ay") or (None, None)
    return {
        "vehicle": drive.vehicle,
        "type": type,
        "drive": number,
        "time": drive.time,
        "log": drive.log,
        "key": key,
        "error": answer.get("error"),
        **{name: answer.get(name) for name in ("kind", "probability", "words", "none", "not_in_library", "duration")},
        "effects": answer.get("effects") or [],
        "inclusion": sorted((answer.get("inclusion") or {}).items()),
        "gap_yaw_rate": yaw_rate[0],
        "gap_yaw_rate_after": yaw_rate[1],
        "gap_ay": ay[0],
        "gap_ay_after": ay[1],
        "findings": answer.get("findings") or [],
        "parameters": information.get("parameters") or [],
        "precision": information.get("precision") or [],
        "gradient": information.get("gradient") or [],
        "temper": information.get("temper"),
        "version": version,
    }


def summaries(path: Path) -> dict[str, dict[str, list[dict[str, Any]]]]:
    """Summaries of the drives in a ``verdicts.parquet``, by type and vehicle, each vehicle's in their order."""
    import pyarrow.parquet as parquet

    found: dict[str, dict[str, list[dict[str, Any]]]] = {}
    columns = ["type", "vehicle", "parameters", "precision", "gradient", "temper"]
    for batch in parquet.ParquetFile(path).iter_batches(ROWS, columns=columns):
        for row in batch.to_pylist():
            own = found.setdefault(row["type"], {}).setdefault(row["vehicle"], [])
            if row["parameters"]:
                own.append({name: row[name] for name in ("parameters", "precision", "gradient", "temper")})
    return found


def type_of(drive: Drive, answer: dict[str, Any]) -> str | None:
    """Name of a drive's type: its vehicle file's; where none is given, the vehicle that the diagnosis took, if any."""
    return drive.vehicle_file or answer.get("model")


def write(path: Path, schema: pyarrow.Schema, rows: Iterator[dict[str, Any]]) -> None:
    """Writes a Parquet file by groups, apart, and names it when it is whole; the same rows give the same bytes."""
    import pyarrow as pa
    import pyarrow.parquet as parquet

    draft = path.with_name(path.name + ".part")
    try:
        with parquet.ParquetWriter(draft, schema, compression="zstd") as writer:
            group: list[dict[str, Any]] = []
            for row in rows:
                group.append(row)
                if len(group) == ROWS:
                    writer.write_table(pa.Table.from_pylist(group, schema=schema))
                    group = []
            if group:
                writer.write_table(pa.Table.from_pylist(group, schema=schema))
        os.replace(draft, path)
    finally:
        draft.unlink(missing_ok=True)


def write_text(path: Path, make: Callable[[], str]) -> None:
    """Writes a text apart, and gives it its name when it is whole."""
    draft = path.with_name(path.name + ".part")
    try:
        draft.write_text(make(), encoding="utf-8")
        os.replace(draft, path)
    finally:
        draft.unlink(missing_ok=True)
