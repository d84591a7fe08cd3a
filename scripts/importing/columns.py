"""Columns of a text table, with what is no number in them.

A log of 512 MB has a hundred million fields. As Python's numbers and texts they would take some ten times its size, so
numbers are kept as arrays, and the texts of a column as one.
"""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from importing import clock
from importing.limits import Limits
from importing.log import ImportFailed
from importing.number import is_value, number
from importing.text import Text, is_row, rows_among, split

_PLAIN = re.compile(r"[0-9.eE+-]*")
_FIGURES = b"0123456789.eE+- \n"


@dataclass
class Layout:
    """Where a table's names, units and numbers stand."""

    delimiter: str
    names: list[str]
    units: list[str]
    begin: int  # first line of numbers
    width: int
    notes: list[str]


class Odd:
    """Fields of a column that are no numbers, in order, with their rows."""

    def __init__(self) -> None:
        self.rows = array("q")
        self.texts: list[str] = []  # lines of fields

    def add(self, rows: list[int], cells: list[str]) -> None:
        self.rows.extend(rows)
        self.texts.append("\n".join(cells))

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[str]:
        for text in self.texts:
            yield from text.split("\n")

    def first(self) -> tuple[int, str]:
        """The first row and its field."""
        return self.rows[0], next(iter(self))


@dataclass
class Cells:
    """One column as it is read: numbers, and what is none."""

    blocks: list[np.ndarray]
    place: int
    known: int  # numbers that are finite
    odd: Odd

    @property
    def numbers(self) -> np.ndarray:
        return np.concatenate([block[:, self.place] for block in self.blocks] or [np.empty(0)])


@dataclass
class Counted:
    """Lines of one kind: how many, and the first."""

    count: int = 0
    first: int = 0

    def add(self, line: int) -> None:
        self.first = self.first or line
        self.count += 1

    def words(self) -> str:
        return "1 line" if self.count == 1 else f"{self.count} lines"


@dataclass
class Columns:
    """The rows of a table as they come."""

    layout: Layout
    comma: bool
    limits: Limits
    blocks: list[np.ndarray] = field(default_factory=list)
    places: array = field(default_factory=lambda: array("q"))  # the line of each row
    odd: dict[int, Odd] = field(default_factory=dict)
    texts: int = 0  # fields that are no numbers
    skipped: Counted = field(default_factory=Counted)
    long: Counted = field(default_factory=Counted)
    short: Counted = field(default_factory=Counted)

    def add(self, place: int, lines: list[str]) -> None:
        """Takes lines; `place` is that of the first."""
        rows = rows_among(lines)
        if not rows:
            return
        here = range(place + 1, place + 1 + len(lines))
        if len(rows) < len(lines):
            here = [at for at, line in zip(here, lines) if is_row(line)]
            lines = rows
        if (values := self.plain(lines)) is None:
            here, values = self.mixed(here, lines)
        if not here:
            return
        if over := max(0, len(self.places) + len(here) - self.limits.rows):
            self.limits.check_rows(len(self.places) + len(here), f"line {here[-over]}: ")
        # A text takes as much again.
        fields = (len(self.places) + len(here)) * len(self.layout.names) + self.texts
        self.limits.check_fields(fields, f"line {here[0]}: ")
        self.places.extend(here)
        self.blocks.append(values)

    def plain(self, lines: list[str]) -> np.ndarray | None:
        """Lines of numbers alone, quickly; None where anything else is among them."""
        delimiter, text = self.layout.delimiter, "\n".join(lines)
        if delimiter not in ",;\t| " or (self.comma and (delimiter == "," or "." in text)):
            return None
        figures = _FIGURES + delimiter.encode() + (b"," if self.comma else b"")
        if not text.isascii() or text.encode().translate(None, figures):
            return None
        if self.comma:
            lines = text.replace(",", ".").split("\n")
        try:
            values = np.loadtxt(lines, delimiter=None if delimiter == " " else delimiter, comments=None, ndmin=2)
        except ValueError:
            return None
        # Digits may be a date and a time.
        whole = values.shape == (len(lines), len(self.layout.names)) and np.abs(values).max() < 1e13
        return values if whole else None

    def mixed(self, here: Sequence[int], lines: list[str]) -> tuple[list[int], np.ndarray]:
        """Numbers of any lines, and the lines of those that are rows."""
        count, delimiter = len(self.layout.names), self.layout.delimiter
        places, rows = [], []
        for place, line in zip(here, lines):
            if '"' in line or "'" in line or delimiter == " ":
                cells = split(line, delimiter)
            else:
                cells = [cell.strip() for cell in line.split(delimiter)]
            if (len(cells) > count and any(cells[count:])) or (delimiter == " " and len(cells) != count):
                # Between blanks an empty field leaves no trace.
                self.long.add(place)
                continue
            row = padded(cells, count)
            if not any(is_value(cell) for cell in row):
                if any(row):
                    self.skipped.add(place)
                continue
            if len(cells) < count:
                self.short.add(place)
            places.append(place)
            rows.append(row)
        values = np.empty((len(rows), count))
        for column, cells in enumerate(zip(*rows)):
            values[:, column] = self.numbers_of(column, cells)
        return places, values

    def numbers_of(self, column: int, cells: tuple[str, ...]) -> list[float]:
        """Numbers of one column's fields; what is none is kept as text."""
        if not self.comma and _PLAIN.fullmatch("".join(cells)) and not any(map(clock.is_compact, cells)):
            try:
                return list(map(float, cells))
            except ValueError:
                pass
        values = [number(cell, self.comma) for cell in cells]
        odd = [row for row, value in enumerate(values) if value is None]
        if odd:
            found = self.odd.setdefault(column, Odd())
            self.texts += len(odd)
            found.add([len(self.places) + row for row in odd], [cells[row] for row in odd])
        return [math.nan if value is None else value for value in values]

    def cells(self) -> list[Cells]:
        """All columns."""
        known = np.zeros(len(self.layout.names), int)
        for block in self.blocks:
            known += np.isfinite(block).sum(axis=0)
        return [Cells(self.blocks, i, int(count), self.odd.get(i, Odd())) for i, count in enumerate(known)]

    def notes(self) -> list[str]:
        """What was left out."""
        notes = []
        if self.long.count:
            notes.append(
                f"{self.long.words()} left out, for other fields than there are names; the first is line "
                f"{self.long.first}"
            )
        if self.short.count:
            notes.append(
                f"{self.short.words()} with fewer fields than there are names, whose others are gaps; the first is "
                f"line {self.short.first}"
            )
        if self.skipped.count:
            notes.append(f"{self.skipped.words()} without numbers left out, the first is line {self.skipped.first}")
        return notes


def padded(row: list[str], width: int) -> list[str]:
    return (row + [""] * width)[:width]


def columns_of(text: Text, layout: Layout, comma: bool, limits: Limits) -> Columns:
    """The rows of numbers of a table."""
    columns = Columns(layout, comma, limits)
    for place, lines in text.lines(layout.begin):
        columns.add(place, lines)
    long = columns.long
    if long.count > max(1, 0.01 * len(columns.places)):
        raise ImportFailed(
            f"line {long.first} has other fields than the {len(layout.names)} names (in all {long.words()}): which "
            "column is which cannot be told (a decimal comma in a file with commas between its fields?)"
        )
    return columns
