"""Units of a VBOX file (.vbo), which stand in sections above the numbers.

[header]             one line for each column: 'velocity kmh', 'heading', 'YawRate'
[channel units]      one line for each of the last columns, those of modules: 'deg/s'
[column names]       the names in one line
[data]
"""

from __future__ import annotations

import re

from importing.units import unit_of

# Columns of the receiver whose line states no unit. Latitude and longitude are minutes, those to the west positive.
_RECEIVER = {"heading": "deg", "height": "m"}


def section(lines: list[str], name: str) -> list[str]:
    """Lines of a section without blank ones; empty where there is none."""
    heads = [i for i, line in enumerate(lines) if re.fullmatch(r"\s*\[[^\[\]]*\]\s*", line)]
    begin = next((i for i in heads if lines[i].strip().lower() == f"[{name}]"), None)
    if begin is None:
        return []
    end = next((i for i in heads if i > begin), len(lines))
    return [line.strip() for line in lines[begin + 1 : end] if line.strip()]


def units_of(lines: list[str], count: int) -> list[str] | None:
    """Units of a table's columns by the sections above it; None for another file."""
    header, modules = section(lines, "header"), section(lines, "channel units")
    if len(header) != count or not section(lines, "column names"):
        return None
    units = []
    for line in header:
        last = line.split()[-1]
        units.append(last if last != line and unit_of(last) else _RECEIVER.get(line.lower(), ""))
    return units[: count - len(modules)] + modules if len(modules) <= count else units
