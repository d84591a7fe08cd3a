"""Text tables of any tool: delimiter, decimal comma, lines before the names, a row of units, comments.

The numbers are found first, at the end of the file; the names are what stands above them.
"""

from __future__ import annotations

import csv
import gzip
import re
from array import array
from collections import Counter
from collections.abc import Iterable
from itertools import islice
from pathlib import Path

import numpy as np
from progress import followed

from importing import clock, vbox
from importing.columns import Cells, Layout, columns_of, padded
from importing.limits import LONGEST_NAME, Limits
from importing.log import ImportFailed, Log, Series
from importing.number import has_comma, has_point, is_gap, is_value, may_have_thousands
from importing.text import SAMPLE, Text, is_comment, is_row, split
from importing.units import looks_like_unit, reads_like_unit, split_unit, unit_of

DELIMITERS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blanks"}


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


def find_layout(text: Text, wanted: set[str], delimiter: str = "") -> Layout:
    """Names, units and the first line of numbers."""
    lines, sample = text.head, text.sample
    if not sample:
        raise ImportFailed("it is empty")
    delimiter = delimiter or find_delimiter(sample)
    # A short file's sample holds its header, too: the rows with the most values speak for it.
    if text.rows <= SAMPLE:
        share = [sum(map(is_value, split(line, delimiter))) for line in sample]
        sample = [line for line, count in zip(sample, share) if count >= 0.5 * max(share)]
    shape = Shape(sample, delimiter)
    if not shape.numeric:
        raise ImportFailed("no rows of numbers were found in it")
    begin = first_row(lines, shape)
    notes = [f"delimiter: {DELIMITERS[delimiter]}"] if delimiter in DELIMITERS and delimiter != "," else []
    rows = header_rows(lines[:begin], shape)
    if not rows:
        above = next((i for i in reversed(range(begin)) if is_row(lines[i])), None)
        count = 0 if above is None else len(split(lines[above], delimiter))
        if count == 1 and shape.used == 2 and delimiter == ",":
            # One column of numbers with a decimal comma.
            return find_layout(text, wanted, "\0")
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
    too_many = len(trimmed(names)) > shape.width and (delimiter == " " or is_split_name(lines[line], delimiter))
    if (len(trimmed(names)) < shape.used and len(names) < shape.used) or too_many:
        raise ImportFailed(unlike(begin, shape.used, line, len(names)))
    width = max(shape.used, len(trimmed(names)))
    units = vbox.units_of(lines[:begin], width) or units
    if width > 3 and split(lines[begin], delimiter) == [str(i + 1) for i in range(width)]:
        notes.append(f"line {begin + 1} numbers the columns, and is left out")
        begin += 1
    return Layout(delimiter, padded(names, width), padded(units, width), begin, max(width, shape.width), notes)


def is_split_name(line: str, delimiter: str) -> bool:
    """Whether a name seems to hold the delimiter: 'Time,Speed, GPS', where no other is followed by a blank."""
    cells = line.split(delimiter)[1:]
    return delimiter == "," and 0 < sum(cell.startswith(" ") for cell in cells) < len(cells)


def unlike(begin: int, fields: int, line: int, names: int) -> str:
    """Why names and numbers do not go together."""
    return (
        f"line {begin + 1} has {fields} fields and the line of names, {line + 1}, has {names}: which column is which "
        "cannot be told (a decimal comma in a file with commas between its fields?)"
    )


def first_row(lines: list[str], shape: Shape) -> int:
    """The first line of numbers: others follow it."""
    places = [i for i, line in enumerate(lines) if is_row(line)]
    for at, place in enumerate(places):
        if all(shape.fits(lines[i]) for i in places[at : at + 5]):
            return place
    for place in places:
        if shape.fits(lines[place]):
            return place
    raise ImportFailed(f"no rows of numbers were found in its first {len(lines)} lines")


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
    if units and "unit" in units[0].lower() and unit_of(units[0]) is None:
        units = ["", *units[1:]]  # 'Y_Unit_Label' says what the row is
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


def has_decimal_comma(text: Text, layout: Layout) -> bool:
    """Whether numbers have decimal commas. Points speak against it, but for those that may part thousands."""
    commas, points, thousands = set(), 0, set()
    rows = (line for line in text.head[layout.begin :] if is_row(line))
    for line in islice(rows, 5 * SAMPLE):
        for place, cell in enumerate(split(line, layout.delimiter)):
            if has_comma(cell):
                commas.add(place)
            elif may_have_thousands(cell):
                thousands.add(place)
            elif has_point(cell):
                points += 1
    return len(commas) > len(thousands) and points == 0


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


def read_table(file: Path, wanted: set[str], limits: Limits) -> Log:
    """A text table; `wanted` are the names that the mapping asks for."""
    try:
        text = Text(file, limits)
        layout = find_layout(text, wanted)
        limits.check_columns(len(layout.names))
        if long := next((name for name in layout.names if len(name) > LONGEST_NAME), None):
            raise ImportFailed(f"the name '{long[:40]}...' of a column has more than {LONGEST_NAME} letters")
        comma = has_decimal_comma(text, layout)
        read = columns_of(text, layout, comma, limits)
    except csv.Error as error:
        raise ImportFailed(f"{file}: {error}") from error
    except ImportFailed as error:
        raise ImportFailed(f"{file}: {error}") from error
    places, encoding = read.places, text.called
    notes = layout.notes + (["decimal comma"] if comma else []) + read.notes()
    if encoding:
        notes.insert(0, f"encoding: {encoding}")
    names, twice = distinct(layout.names)
    there = set(names)
    table: dict[str, Cells] = {}
    units, broken, aliases = {}, {}, {}
    for raw, name, unit, column in zip(layout.names, names, layout.units, read.cells()):
        if not raw and not column.known and not column.odd:
            continue  # after a delimiter at the end of each line
        bare, own = split_unit(raw)
        if stated := own if reads_like_unit(own) else unit.strip().strip("[]()").strip():
            units[name] = stated
        if own and bare not in there:
            aliases[bare] = "" if bare in aliases else name
        table[name] = column
        if len(column.odd) > 0.01 * (column.known + len(column.odd)) and not is_marked(column):
            row, cell = column.odd.first()
            broken[name] = f"'{cell}' in line {places[row]} is no number"
            if not comma and has_comma(cell):
                broken[name] += ": a comma beside points in other columns may be decimal or part thousands"
        elif column.odd:
            row, cell = column.odd.first()
            count = "1 field is no number" if len(column.odd) == 1 else f"{len(column.odd)} fields are no numbers"
            notes.append(f"'{name}': {count} and left out: '{cell}' in line {places[row]}")
    if twice:
        notes.append(f"names that stand more than once are numbered: {', '.join(sorted(twice))}")

    def time(name: str, unit: str | None) -> np.ndarray:
        column = table[name]
        where = f"{file}: [time] column = '{name}'"
        if len(column.odd) <= 0.01 * column.known:
            times, note = clock.of_numbers(column.numbers, unit, units.get(name, ""), name)
            if note:
                log.notes.append(f"time '{name}': {note}")
            return times
        row, first = column.odd.first()
        if column.known:
            why = ": a point beside decimal commas may be decimal or part thousands" if comma and "." in first else ""
            raise ImportFailed(f"{where}: '{first}' in line {places[row]} is no number, and others are{why}")
        times = np.full(len(places), np.nan)
        rows = np.frombuffer(column.odd.rows, "int64")
        stamps = followed(column.odd, len(column.odd), f"reading the time stamps of {file.name}")
        times[rows] = clock.of_stamps(stamps, where, lines_of(places, column.odd.rows))
        if unit is not None:
            log.notes.append(f"time '{name}': time stamps like '{first}' have no unit; '{unit}' is not used")
        return times

    log = Log(
        file, list(table), lambda name: Series(None, table[name].numbers), time, units, broken,
        {bare: name for bare, name in aliases.items() if name}, notes,
    )  # fmt: skip
    return log


def lines_of(places: array, rows: array) -> Iterable[int]:
    """The lines of some rows."""
    return (places[row] for row in rows)


def is_marked(column: Cells) -> bool:
    """Whether what is no number is a word for a gap, such as 'SNA', among numbers."""
    words: set[str] = set()
    for word in column.odd if column.known > len(column.odd) else ():
        words.add(word)
        if len(words) > 2:
            return False
    return bool(words) and not any(letter.isdigit() for word in words for letter in word)


def opened(file: Path, mode: str, packed: bool | None = None):
    """A drive log's text file, compressed if its name ends in .gz, or as said; a byte order mark is skipped."""
    encoding = "utf-8-sig" if mode == "r" else "utf-8"
    if file.suffix == ".gz" if packed is None else packed:
        return gzip.open(file, f"{mode}t", newline="", encoding=encoding)
    return open(file, mode, newline="", encoding=encoding)
