"""What a log holds: each column with its unit, rate, number of samples and range."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass

import numpy as np
from progress import followed

from importing.known_names import OURS, Suggestion, looks_like_time, snippet
from importing.log import Log, said


@dataclass
class Entry:
    """One column in a list."""

    name: str
    unit: str
    rate: float | None  # Hz, by the median step
    samples: int
    min: float | None
    max: float | None


def rate_of(time: np.ndarray | None) -> float | None:
    """Samples a second by the median step; None where it cannot be said."""
    if time is None:
        return None
    steps = np.diff(time[np.isfinite(time)])
    step = float(np.median(steps)) if len(steps) else 0.0
    return 1.0 / step if step > 0 and math.isfinite(step) else None


def table_clock(log: Log, column: str | None, unit: str | None) -> tuple[str | None, np.ndarray | None]:
    """The time of a table's rows: the mapping's column, else one that is named like it and increases."""
    if log.clock is None:
        return None, None
    for name in [column] if column else [name for name in log.names if looks_like_time(name)]:
        try:
            times = log.clock(name, unit)
        except Exception:  # Not a clock then; a list goes on.
            continue
        known = times[np.isfinite(times)]
        if len(known) > 1 and (np.diff(known) >= 0).mean() > 0.9 and known[-1] > known[0]:
            return name, times
    return None, None


def entries(log: Log, times: np.ndarray | None, clock: str | None) -> tuple[list[Entry], dict[str, str]]:
    """Columns that can be read, and the others with the reason."""
    found, broken = [], dict(log.broken)
    for name in followed(log.names, len(log.names), f"reading the columns of {log.file.name}"):
        if name == clock and times is not None:
            known = times[np.isfinite(times)]
            found.append(entry(name, "s", rate_of(times), known))
            broken.pop(name, None)
            continue
        if name in broken:
            continue
        try:
            series = log.get(name)
        except Exception as error:  # Foreign packages raise whatever they like.
            broken[name] = said(error)
            continue
        values = series.values
        time = series.time if series.time is not None else times
        rows = np.isfinite(values) if values.ndim == 1 else np.isfinite(values).all(axis=1)
        rate = rate_of(time[rows]) if time is not None and len(time) == len(rows) else None
        known = values[rows]
        found.append(
            entry(name, log.units.get(name, ""), rate, known if values.ndim == 1 else np.ravel(known), rows.sum())
        )
    return found, broken


def entry(name: str, unit: str, rate: float | None, known: np.ndarray, samples: int | None = None) -> Entry:
    count = len(known) if samples is None else int(samples)
    low, high = (float(known.min()), float(known.max())) if len(known) else (None, None)
    return Entry(name, unit, rate, count, low, high)


def as_text(
    found: list[Entry], broken: dict[str, str], notes: list[str], suggested: list[Suggestion], clock: str | None
) -> str:
    """The list as a table, with what cannot be read, notes and suggestions below."""
    rows = [["name", "unit", "Hz", "samples", "min", "max"]]
    rows += [[e.name, e.unit or "-", figure(e.rate), str(e.samples), figure(e.min), figure(e.max)] for e in found]
    widths = [max(len(row[i]) for row in rows) for i in range(6)]
    lines = [
        "  ".join(cell.ljust(width) if i < 2 else cell.rjust(width) for i, (cell, width) in enumerate(zip(row, widths)))
        for row in rows
    ]
    if broken:
        lines += ["", "cannot be read:"] + [f"  {name}: {reason}" for name, reason in sorted(broken.items())]
    if notes:
        lines += [""] + [f"note: {note}" for note in notes]
    if suggested:
        lines += [""] + [suggestion.words() for suggestion in suggested if suggestion.tool != OURS]
        lines += ["", "entries for a mapping file, to be checked:", ""]
        lines += [f"[time]\ncolumn = {json.dumps(clock, ensure_ascii=False)}\n"] if clock else []
        lines += [snippet(suggested)]
    return "\n".join(line.rstrip() for line in lines)


def figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.6g}"


def as_json(log: Log, found: list[Entry], broken: dict[str, str], suggested: list[Suggestion]) -> str:
    """The list for programs."""
    content = {
        "file": str(log.file),
        "channels": [asdict(e) for e in found],
        "unreadable": [{"name": name, "reason": reason} for name, reason in sorted(broken.items())],
        "notes": log.notes,
        "suggestions": [{**asdict(s), "entry": s.entry()} for s in suggested],
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
