"""Fields as numbers: gaps, decimal commas, thousands. A log's number is ASCII figures, as in `rfl`.

Python's float() and `\\d` take more: 1_000, words like infinity, and the figures of other scripts.
"""

from __future__ import annotations

import math
import re

from importing import clock

_EXPONENT = r"(?:[eEdD][+-]?[0-9]+)?"
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)" + _EXPONENT)
_COMMA_NUMBER = re.compile(r"[+-]?(?:[0-9]+,[0-9]*|,[0-9]+)" + _EXPONENT)
# Thousands apart are told from decimals where the number has both. As in src/table/decimal.rs.
_THOUSANDS = re.compile(r"[+-]?[0-9]{1,3}(?:,[0-9]{3})+\.[0-9]+")
_COMMA_THOUSANDS = re.compile(r"[+-]?[0-9]{1,3}(?:\.[0-9]{3})+,[0-9]+")
_POINTS = re.compile(r"[+-]?[1-9][0-9]{0,2}(?:\.[0-9]{3})+")
# Apostrophes part thousands alone, so they need no decimal mark: 1'000.
_APOSTROPHES = re.compile(r"[+-]?[0-9]{1,3}(?:(?:'[0-9]{3})+|(?:\u2019[0-9]{3})+)(?:[.,][0-9]*)?")
_GAPS = {"", "nan", "na", "n/a", "#n/a", "null", "none", "nil", "-", "--", "---", "?", "inf", "+inf", "-inf", "-nan",
         "infinity", "-infinity", "1.#qnan", "-1.#ind", "1.#inf", "nan(ind)", "-nan(ind)"}  # fmt: skip


def is_gap(cell: str) -> bool:
    return cell.lower() in _GAPS


def may_have_thousands(cell: str) -> bool:
    """Whether the points of a number may part thousands: 1.000, and not 0.125."""
    return _POINTS.fullmatch(cell) is not None


def joined(cell: str) -> str:
    """A field without the apostrophes between its thousands."""
    if ("'" in cell or "\u2019" in cell) and _APOSTROPHES.fullmatch(cell):
        return cell.replace("'", "").replace("\u2019", "")
    return cell


def has_point(cell: str) -> bool:
    """Whether a field is a number with a decimal point."""
    cell = joined(cell)
    return "." in cell and (_NUMBER.fullmatch(cell) or _THOUSANDS.fullmatch(cell)) is not None


def has_comma(cell: str) -> bool:
    """Whether a field is a number with a decimal comma; the comma of 1,234 may be one."""
    cell = joined(cell)
    return "," in cell and (_COMMA_NUMBER.fullmatch(cell) or _COMMA_THOUSANDS.fullmatch(cell)) is not None


def is_value(cell: str) -> bool:
    """Whether a field is a number or a time stamp."""
    cell = joined(cell)
    return _NUMBER.fullmatch(cell) is not None or has_comma(cell) or has_point(cell) or clock.is_stamp(cell)


def number(cell: str, comma: bool) -> float | None:
    """A field as a number, a gap as NaN, anything else as None. With `comma` a point alone may be one of thousands."""
    if is_gap(cell):
        return math.nan
    if clock.is_compact(cell):
        return None
    cell = joined(cell)
    if comma and has_comma(cell):
        cell = cell.replace(".", "").replace(",", ".")
    elif comma and "." in cell:
        return None
    elif not comma and _THOUSANDS.fullmatch(cell):
        cell = cell.replace(",", "")
    if _NUMBER.fullmatch(cell):
        return float(cell.replace("D", "e").replace("d", "e"))
    return None
