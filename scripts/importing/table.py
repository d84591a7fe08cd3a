"""Text tables of any tool: delimiter, decimal comma, lines before the names, a row of units, comments.

The numbers are found first, at the end of the file; the names are what stands above them.
"""

from __future__ import annotations

import csv
import gzip
import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from importing import clock
from importing.log import ImportFailed, Log, Series
from importing.text import SAMPLE, read_lines
from importing.units import looks_like_unit, reads_like_unit, split_unit

DELIMITERS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blanks"}
COMMENTS = ("#", "%", "//")

# Python's float() takes 1_000 and words like infinity; a log's number is digits.
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
_COMMA_NUMBER = re.compile(r"[+-]?(?:\d+,\d*|,\d+)(?:[eEdD][+-]?\d+)?")
_PLAIN = re.compile(r"[0-9.eE+-]*")
_GAPS = {"", "nan", "na", "n/a", "#n/a", "null", "none", "nil", "-", "--", "---", "?", "inf", "+inf", "-inf", "-nan",
         "infinity", "-infinity", "1.#qnan", "-1.#ind", "1.#inf", "nan(ind)", "-nan(ind)"}  # fmt: skip


def split(line: str, delimiter: str) -> list[str]:
    """Fields of one line; outer blanks do not count."""
    if delimiter == " ":
        return [cell for cell in next(csv.reader([" ".join(line.split())], delimiter=" "), []) if cell]
    return [unquoted(cell) for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]


def unquoted(cell: str) -> str:
    """A field without blanks and single quotes around it; double quotes are the reader's."""
    cell = cell.strip()
    return cell[1:-1].strip() if len(cell) > 1 and cell[0] == cell[-1] == "'" else cell


def is_gap(cell: str) -> bool:
    return cell.lower() in _GAPS


def is_value(cell: str) -> bool:
    """Whether a field is a number or a time stamp."""
    return bool(_NUMBER.fullmatch(cell) or _COMMA_NUMBER.fullmatch(cell)) or clock.is_stamp(cell)


def is_comment(line: str) -> bool:
    return line.lstrip().startswith(COMMENTS)


def find_delimiter(lines: list[str]) -> str:
    """The delimiter that gives the most values."""
    best, choice = (0.0, 0.0), ""
    for delimiter in DELIMITERS:
        rows = [split(line, delimiter) for line in lines]
        width = Counter(map(len, rows)).most_common(1)[0][0]
        if width < 2:
            continue
        cells = [cell for row in rows if len(row) == width for cell in row if not is_gap(cell)]
        values = sum(map(is_value, cells))
        score = (values / len(lines), values / max(len(cells), 1))
        if values and score > best:
            best, choice = score, delimiter
    return choice or "\0"  # one column: a delimiter that never comes


@dataclass
class Cells:
    """One column as it is read: numbers, and what is none with its row."""

    numbers: list[float] = field(default_factory=list)
    odd: dict[int, str] = field(default_factory=dict)


@dataclass
class Layout:
    """Where a table's names, units and numbers stand."""

    delimiter: str
    names: list[str]
    units: list[str]
    begin: int  # first line of numbers
    width: int
    notes: list[str]


class Shape:
    """What a row of numbers looks like, from a sample of them."""

    def __init__(self, lines: list[str], delimiter: str):
        rows = [trimmed(split(line, delimiter)) for line in lines]
        full = [split(line, delimiter) for line in lines]
        self.delimiter = delimiter
        # Fields that are empty in all rows at the end are a delimiter at the line's end.
        self.width = max(Counter(map(len, full)).most_common(1)[0][0] if any(map(any, full)) else 0, 1)
        self.used = max((len(row) for row in rows if len(row) <= self.width), default=1)
        self.numeric = []
        for place in range(self.used):
            cells = [row[place] for row in rows if place < len(row) and not is_gap(row[place])]
            if cells and sum(map(is_value, cells)) >= 0.9 * len(cells):
                self.numeric.append(place)

    def fits(self, line: str) -> bool:
        """Whether a line is one of numbers: all that is filled in the columns of numbers is a value."""
        row = split(line, self.delimiter)
        if not 0 < len(row) <= self.width + 1 or (len(trimmed(row)) < 2 < self.used):
            return False
        cells = [row[place] for place in self.numeric if place < len(row) and not is_gap(row[place])]
        return bool(cells) and sum(map(is_value, cells)) >= 0.9 * len(cells)


def trimmed(row: list[str]) -> list[str]:
    """A row without the empty fields at its end."""
    end = len(row)
    while end and not row[end - 1]:
        end -= 1
    return row[:end]


def find_layout(lines: list[str], wanted: set[str], delimiter: str = "") -> Layout:
    """Names, units and the first line of numbers."""
    body = [line for line in lines if line.strip() and not is_comment(line)]
    if not body:
        raise ImportFailed("it is empty")
    delimiter = delimiter or find_delimiter(body[-SAMPLE:])
    # A short file's sample holds its header, too: the rows with the most values speak for it.
    sample = body[-SAMPLE:]
    if len(body) <= SAMPLE:
        share = [sum(map(is_value, split(line, delimiter))) for line in sample]
        sample = [line for line, count in zip(sample, share) if count >= 0.5 * max(share)]
    shape = Shape(sample, delimiter)
    if not shape.numeric:
        raise ImportFailed("no rows of numbers were found in it")
    begin = first_row(lines, shape)
    notes = [f"delimiter: {DELIMITERS[delimiter]}"] if delimiter in DELIMITERS and delimiter != "," else []
    rows = header_rows(lines[:begin], shape)
    if not rows:
        above = next((i for i in reversed(range(begin)) if lines[i].strip() and not is_comment(lines[i])), None)
        count = 0 if above is None else len(split(lines[above], delimiter))
        if count == 1 and shape.used == 2 and delimiter == ",":
            # One column of numbers with a decimal comma.
            return find_layout(lines, wanted, "\0")
        foreign = above is not None and any(other in lines[above] for other in ",;\t|" if other != delimiter)
        if (count > 1 or foreign) and not any(map(is_value, split(lines[above], delimiter))):
            raise ImportFailed(unlike(begin, shape.used, above, count))
        first = [cell for cell in split(lines[begin], delimiter) if cell]
        if len(first) > 2 and first in ([str(i + start) for i in range(len(first))] for start in (0, 1)):
            # A table of a program that numbers its columns.
            return Layout(delimiter, first, [""] * len(first), begin + 1, max(shape.width, len(first)), notes)
        notes.append("it has no line of names: its columns are called 1, 2, ...")
        names, units = [str(i + 1) for i in range(shape.used)], [""] * shape.used
        return Layout(delimiter, names, units, begin, shape.width, notes)
    names, units, line = chosen(rows, wanted)
    if line > 0:
        notes.append(f"names in line {line + 1}")
    if (len(trimmed(names)) < shape.used and len(names) < shape.used) or len(trimmed(names)) > shape.width:
        raise ImportFailed(unlike(begin, shape.used, line, len(names)))
    width = max(shape.used, len(trimmed(names)))
    return Layout(delimiter, padded(names, width), padded(units, width), begin, max(width, shape.width), notes)


def unlike(begin: int, fields: int, line: int, names: int) -> str:
    """Why names and numbers do not go together."""
    return (
        f"line {begin + 1} has {fields} fields and the line of names, {line + 1}, has {names}: which column is which "
        "cannot be told (a decimal comma in a file with commas between its fields?)"
    )


def padded(row: list[str], width: int) -> list[str]:
    return (row + [""] * width)[:width]


def first_row(lines: list[str], shape: Shape) -> int:
    """The first line of numbers: others follow it."""
    places = [i for i, line in enumerate(lines) if line.strip() and not is_comment(line)]
    for at, place in enumerate(places):
        if all(shape.fits(lines[i]) for i in places[at : at + 5]):
            return place
    return next(place for place in places if shape.fits(lines[place]))


def header_rows(lines: list[str], shape: Shape) -> list[tuple[int, list[str]]]:
    """Rows above the numbers that have a field for each column: names, units, descriptions; with their line."""
    rows = []
    for i, line in enumerate(lines):
        row = split(line, shape.delimiter)
        if is_comment(line):
            # '# time, vx' holds names; '#, time, vx' has a column of that name.
            bare = split(re.sub(r"^\s*(#+|%+|//+)", "", line), shape.delimiter)
            row = row if len(row) == shape.used != len(bare) or not bare or not bare[0] else bare
            if len(trimmed(row)) != shape.used:
                continue
        filled = sum(1 for cell in row if cell)
        if filled and 2 * filled > shape.used and shape.used - 1 <= len(trimmed(row)) <= shape.width + 1:
            rows.append((i, row))
    return rows


def chosen(rows: list[tuple[int, list[str]]], wanted: set[str]) -> tuple[list[str], list[str], int]:
    """Names, units and the names' line: the row that holds what the mapping asks for, else the lowest but the units."""

    def asked(entry: tuple[int, list[str]]) -> int:
        return sum(1 for cell in entry[1] if cell in wanted or split_unit(cell)[0] in wanted)

    def all_words(entry: tuple[int, list[str]]) -> bool:
        return not any(is_value(cell) for cell in entry[1])

    units_rows = [entry for entry in rows if is_units_row(entry[1])]
    # A row of units stands below names; one alone holds names that read like units.
    others = [entry for entry in rows if entry not in units_rows] or rows[:1]
    names = max(rows, key=lambda entry: (asked(entry), entry in others, all_words(entry), entry[0]))
    if asked(names) == 0:
        names = above_description(others, names)
    units = next((row for line, row in reversed(units_rows) if line != names[0]), [])
    return names[1], units, names[0]


def above_description(rows: list[tuple[int, list[str]]], lowest: tuple[int, list[str]]) -> tuple[int, list[str]]:
    """The names above a row of descriptions: identifiers above words with blanks."""
    if not any(" " in cell for cell in lowest[1]):
        return lowest
    identifiers = [
        entry
        for entry in rows
        if 0 < lowest[0] - entry[0] <= 2 and all(re.fullmatch(r"[\w.:/\[\]()-]+", cell) for cell in entry[1])
    ]
    return identifiers[-1] if identifiers else lowest


def is_units_row(row: list[str]) -> bool:
    filled = [cell for cell in row if cell]
    return bool(filled) and sum(map(looks_like_unit, filled)) > 0.5 * len(filled)


def columns_of(lines: list[str], layout: Layout, comma: bool) -> tuple[list[Cells], list[int], list[str]]:
    """Cells of each column, the line of each row, and notes on what was left out."""
    count = len(layout.names)
    columns = [Cells() for _ in range(count)]
    places: list[int] = []
    skipped: list[int] = []
    long: list[int] = []
    short: list[int] = []
    chunk: list[list[str]] = []

    def convert() -> None:
        for column, cells in zip(columns, zip(*chunk)):
            start = len(column.numbers)
            if not comma and _PLAIN.fullmatch("".join(cells)) and not any(map(clock.is_compact, cells)):
                try:
                    column.numbers += map(float, cells)
                    continue
                except ValueError:
                    del column.numbers[start:]
            for row, cell in enumerate(cells, start):
                value = number(cell, comma)
                column.numbers.append(math.nan if value is None else value)
                if value is None:
                    column.odd[row] = cell
        chunk.clear()

    for place, cells in rows_of(lines, layout):
        if (len(cells) > count and any(cells[count:])) or (layout.delimiter == " " and len(cells) != count):
            # Between blanks an empty field leaves no trace.
            long.append(place + 1)
            continue
        row = padded(cells, count)
        if not any(is_value(cell) for cell in row):
            if any(row):
                skipped.append(place + 1)
            continue
        if len(cells) < count:
            short.append(place + 1)
        places.append(place + 1)
        chunk.append(row)
        if len(chunk) == 5000:
            convert()
    if chunk:
        convert()
    if len(long) > max(1, 0.01 * len(places)):
        raise ImportFailed(
            f"line {long[0]} has other fields than the {count} names (in all {len(long)} lines): which column is which "
            "cannot be told (a decimal comma in a file with commas between its fields?)"
        )
    notes = []
    if long:
        notes.append(
            f"{lines_of(len(long))} left out, for other fields than there are names; the first is line {long[0]}"
        )
    if short:
        notes.append(
            f"{lines_of(len(short))} with fewer fields than there are names, whose others are gaps; the first is line "
            f"{short[0]}"
        )
    if skipped:
        notes.append(f"{lines_of(len(skipped))} without numbers left out, the first is line {skipped[0]}")
    return columns, places, notes


def lines_of(count: int) -> str:
    return "1 line" if count == 1 else f"{count} lines"


def rows_of(lines: list[str], layout: Layout) -> Iterator[tuple[int, list[str]]]:
    """Rows of numbers with their line."""
    for place in range(layout.begin, len(lines)):
        line = lines[place]
        if line and not line.isspace() and not is_comment(line):
            if '"' in line or "'" in line or layout.delimiter == " ":
                yield place, split(line, layout.delimiter)
            else:
                yield place, [cell.strip() for cell in line.split(layout.delimiter)]


def number(cell: str, comma: bool) -> float | None:
    """A field as a number, a gap as NaN, anything else as None."""
    if is_gap(cell):
        return math.nan
    if clock.is_compact(cell):
        return None
    if comma and _COMMA_NUMBER.fullmatch(cell):
        cell = cell.replace(",", ".")
    if _NUMBER.fullmatch(cell):
        return float(cell.replace("D", "e").replace("d", "e"))
    return None


def has_decimal_comma(lines: list[str], layout: Layout) -> bool:
    """Whether numbers are written with a comma. Points in other numbers speak against it."""
    commas, points = 0, 0
    for at, (_, row) in enumerate(rows_of(lines, layout)):
        if at == 5 * SAMPLE:
            break
        for cell in row:
            commas += _COMMA_NUMBER.fullmatch(cell) is not None
            points += "." in cell and _NUMBER.fullmatch(cell) is not None
    return commas > 0 and points == 0


def distinct(names: list[str]) -> tuple[list[str], set[str]]:
    """Names that stand once; those that stand several times get #1, #2."""
    names = [name or f"column {i + 1}" for i, name in enumerate(names)]
    twice = {name for name, count in Counter(names).items() if count > 1}
    seen: Counter = Counter()
    result = []
    for name in names:
        seen[name] += 1
        result.append(f"{name}#{seen[name]}" if name in twice else name)
    return result, twice


def read_table(file: Path, wanted: set[str]) -> Log:
    """A text table; `wanted` are the names that the mapping asks for."""
    try:
        lines, encoding = read_lines(file)
        layout = find_layout(lines, wanted)
        comma = has_decimal_comma(lines, layout)
        columns, places, notes = columns_of(lines, layout, comma)
    except csv.Error as error:
        raise ImportFailed(f"{file}: {error}") from error
    except ImportFailed as error:
        raise ImportFailed(f"{file}: {error}") from error
    notes = layout.notes + (["decimal comma"] if comma else []) + notes
    if encoding:
        notes.insert(0, f"encoding: {encoding}")
    names, twice = distinct(layout.names)
    table: dict[str, Cells] = {}
    units, broken, aliases = {}, {}, {}
    for raw, name, unit, column in zip(layout.names, names, layout.units, columns):
        if not raw and not np.isfinite(column.numbers).any() and not column.odd:
            continue  # after a delimiter at the end of each line
        bare, own = split_unit(raw)
        if stated := own if reads_like_unit(own) else unit.strip().strip("[]()").strip():
            units[name] = stated
        if own and bare not in names:
            aliases[bare] = "" if bare in aliases else name
        table[name] = column
        filled = int(np.isfinite(column.numbers).sum()) + len(column.odd)
        if len(column.odd) > 0.01 * filled and not is_marked(column):
            row, cell = next(iter(column.odd.items()))
            broken[name] = f"'{cell}' in line {places[row]} is no number"
            if not comma and _COMMA_NUMBER.fullmatch(cell):
                broken[name] += ": a comma beside points in other columns may be decimal or part thousands"
        elif column.odd:
            row, cell = next(iter(column.odd.items()))
            count = "1 field is no number" if len(column.odd) == 1 else f"{len(column.odd)} fields are no numbers"
            notes.append(f"'{name}': {count} and left out: '{cell}' in line {places[row]}")
    if twice:
        notes.append(f"names that stand more than once are numbered: {', '.join(sorted(twice))}")

    def time(name: str, unit: str | None) -> np.ndarray:
        column = table[name]
        where = f"{file}: [time] column = '{name}'"
        if len(column.odd) <= 0.01 * np.isfinite(column.numbers).sum():
            times, note = clock.of_numbers(np.array(column.numbers), unit, units.get(name, ""), name)
            if note:
                log.notes.append(f"time '{name}': {note}")
            return times
        stamps = list(column.odd.items())
        if np.isfinite(column.numbers).any():
            row, cell = stamps[0]
            raise ImportFailed(f"{where}: '{cell}' in line {places[row]} is no number, and others are")
        times = np.full(len(column.numbers), np.nan)
        rows = [row for row, _ in stamps]
        times[rows] = clock.of_stamps([cell for _, cell in stamps], where, [places[row] for row in rows])
        if unit is not None:
            log.notes.append(f"time '{name}': time stamps like '{stamps[0][1]}' have no unit; '{unit}' is not used")
        return times

    log = Log(
        file, list(table), lambda name: Series(None, np.array(table[name].numbers)), time, units, broken,
        {bare: name for bare, name in aliases.items() if name}, notes,
    )  # fmt: skip
    return log


def is_marked(column: Cells) -> bool:
    """Whether what is no number is a word for a gap, such as 'SNA', among numbers."""
    words = set(column.odd.values())
    return (
        len(words) <= 2
        and not any(letter.isdigit() for word in words for letter in word)
        and np.isfinite(column.numbers).sum() > len(column.odd)
    )


def opened(file: Path, mode: str, packed: bool | None = None):
    """A drive log's text file, compressed if its name ends in .gz, or as said; a byte order mark is skipped."""
    encoding = "utf-8-sig" if mode == "r" else "utf-8"
    if file.suffix == ".gz" if packed is None else packed:
        return gzip.open(file, f"{mode}t", newline="", encoding=encoding)
    return open(file, mode, newline="", encoding=encoding)
