"""Lines of a text file of any tool: packed or not, in any encoding; a file of another format is named.

A packed file of 3 MB may hold 2 GB. It is read in blocks: the head and a sample of the end are kept, and no more.
"""

from __future__ import annotations

import codecs
import csv
import gzip
import io
from collections.abc import Iterator
from pathlib import Path

from progress import Unhurried

from importing.limits import LONGEST_LINE, MEGABYTE, Limits
from importing.log import ImportFailed

SAMPLE = 200  # lines from which delimiter and columns are found ...
SAMPLE_LETTERS = 2 * MEGABYTE  # ... and their letters
HEAD = 10_000  # lines in which names are found ...
HEAD_LETTERS = 8 * MEGABYTE  # ... and their letters
BLOCK = MEGABYTE  # bytes that are read at a time
COMMENTS = ("#", "%", "//")

# With a delimiter that a wide table does not have, a line is one field.
csv.field_size_limit(LONGEST_LINE + 1)

# Files of other programs under a text's ending: their first bytes, the kind, and what to do. As in src/table/open.rs.
_FOREIGN = [
    (b"PK\x03\x04", "a spreadsheet or a zip archive", "save the table as CSV"),
    (b"\xd0\xcf\x11\xe0", "a spreadsheet", "save the table as CSV"),
    (b"BZh", "packed with bzip2", "unpack it"),
    (b"\xfd7zXZ\0", "packed with xz", "unpack it"),
    (b"\x28\xb5\x2f\xfd", "packed with zstd", "unpack it"),
    (b"7z\xbc\xaf\x27\x1c", "packed with 7-Zip", "unpack it"),
    (b"MDF  ", "an MDF file", "call it .mf4"),
    (b"PAR1", "a Parquet file", "call it .parquet"),
    (b"MATLAB 5.0", "a MATLAB file", "call it .mat"),
    (b"#ROSBAG", "a ROS bag", "call it .bag"),
]
_MARKS = {
    b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe\0\0": "utf-32", b"\0\0\xfe\xff": "utf-32",
    b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16",
}  # fmt: skip


def check_foreign(first: bytes) -> None:
    """Refuses a file of another program by its first bytes."""
    if foreign := next((entry for entry in _FOREIGN if first.startswith(entry[0])), None):
        raise ImportFailed(f"it is no text but {foreign[1]}: {foreign[2]}")


def encodings(first: bytes) -> list[tuple[str, str]]:
    """Encodings that a file may have by its first bytes, in order, and how they are called where they are not UTF-8."""
    for mark, encoding in _MARKS.items():
        if first.startswith(mark):
            return [(encoding, "" if encoding == "utf-8-sig" else encoding.upper())]
    for start, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        # Without a mark: every second byte of Latin letters is zero.
        other = first[1 - start :: 2]
        if len(first) > 3 and first[start::2].count(0) > 0.4 * len(first[start::2]) and other.count(0) == 0:
            return [(encoding, encoding.upper())]
    if b"\0" in first:
        raise ImportFailed("it is no text: it holds zero bytes")
    return [("utf-8", ""), ("cp1252", "Windows-1252 (Latin-1)"), ("latin-1", "Latin-1")]


def is_comment(line: str) -> bool:
    return line.lstrip().startswith(COMMENTS)


def is_row(line: str) -> bool:
    """Whether a line holds fields: it is neither blank nor a comment."""
    return bool(line) and not line.isspace() and not is_comment(line)


def rows_among(lines: list[str]) -> list[str]:
    """Lines that hold fields. The first letter tells most of the others: a file can have millions of them."""
    return [line for line in lines if line and line[0] not in "#%" and is_row(line)]


def split(line: str, delimiter: str) -> list[str]:
    """Fields of one line; outer blanks do not count."""
    if delimiter == " ":
        return [cell for cell in next(csv.reader([" ".join(line.split())], delimiter=" "), []) if cell]
    return [unquoted(cell) for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]


def unquoted(cell: str) -> str:
    """A field without blanks and single quotes around it; double quotes are the reader's."""
    cell = cell.strip()
    return cell[1:-1].strip() if len(cell) > 1 and cell[0] == cell[-1] == "'" else cell


class Text:
    """A text file, compressed if its name ends in .gz or its first bytes say so, looked through once."""

    def __init__(self, file: Path, limits: Limits):
        self.file, self.limits = file, limits
        self.head: list[str] = []  # the first lines
        self.sample: list[str] = []  # the last rows
        self.rows = 0  # lines that are neither blank nor comments
        self.whole = True  # the head is all
        with open(file, "rb") as raw:
            first = raw.read(4000)
            check_foreign(first)
            self.packed = file.suffix.lower() == ".gz" or first[:2] == b"\x1f\x8b"
            raw.seek(0)
            if self.packed:
                first = gzip.GzipFile(fileobj=raw).read(4000)
                check_foreign(first)
        choices = encodings(first)
        for self.encoding, self.called in choices:
            try:
                self.look_through()
                break
            except UnicodeDecodeError:
                if self.encoding == choices[-1][0]:
                    raise

    def blocks(self, title: str) -> Iterator[list[str]]:
        """All lines without their ends, some at a time."""
        size = max(self.file.stat().st_size, 1)
        decoder = io.IncrementalNewlineDecoder(codecs.getincrementaldecoder(self.encoding)(), translate=True)
        progress = Unhurried(f"{title} {self.file.name}")
        rest, count, taken = "", 0, 0
        try:
            with open(self.file, "rb") as raw:
                source = gzip.GzipFile(fileobj=raw) if self.packed else raw
                while rest is not None:
                    data = source.read(BLOCK)
                    taken += len(data)
                    self.limits.check_bytes(taken, self.packed, known=False)
                    lines = (rest + decoder.decode(data, final=not data)).split("\n")
                    rest = lines.pop() if data else None
                    for place, line in ((1, lines[0] if lines else ""), (len(lines) + 1, rest or "")):
                        if len(line) > LONGEST_LINE:
                            raise ImportFailed(
                                f"line {count + place}: it has more than {LONGEST_LINE // MEGABYTE} MB; a table is a "
                                "text file with a line for each row"
                            )
                    count += len(lines)
                    progress(raw.tell() / size)
                    yield lines
        finally:
            progress.close()

    def look_through(self) -> None:
        """Finds head, sample and the number of rows."""
        head: list[str] = []
        tail: list[str] = []
        letters, count, more = 0, 0, 0
        for lines in self.blocks("reading"):
            taken = 0
            while taken < len(lines) and len(head) < HEAD and letters < HEAD_LETTERS:
                head.append(lines[taken])
                letters += len(lines[taken])
                taken += 1
            rows = rows_among(lines[taken:])
            more += len(rows)
            self.limits.check_rows(more)
            count += len(lines)
            tail = last(tail + rows[-SAMPLE:])
        join_quoted(head)
        own = rows_among(head)
        self.head, self.sample, self.rows = head, last(own[-SAMPLE:] + tail), len(own) + more
        self.whole = count == len(head)

    def lines(self, begin: int) -> Iterator[tuple[int, list[str]]]:
        """Lines from one on, some at a time, with the place of the first."""
        yield begin, self.head[begin:]
        place, known = 0, len(self.head)
        for lines in self.blocks("taking the numbers of") if not self.whole else ():
            ours = lines[max(0, known - place) :]
            if ours:
                yield max(place, known), ours
            place += len(lines)


def last(lines: list[str]) -> list[str]:
    """The last lines, not too many and not too long."""
    lines = lines[-SAMPLE:]
    letters = sum(map(len, lines))
    while letters > SAMPLE_LETTERS and len(lines) > 1:
        letters -= len(lines.pop(0))
    return lines


def join_quoted(lines: list[str]) -> None:
    """Joins quoted names that go on in the next lines. Empty lines keep the count of lines."""
    i = 0
    while i < min(len(lines), SAMPLE):
        end = i
        while sum(line.count('"') for line in lines[i : end + 1]) % 2 and end + 1 < min(len(lines), i + 12):
            end += 1
        if end > i and sum(line.count('"') for line in lines[i : end + 1]) % 2 == 0:
            lines[i : end + 1] = [""] * (end - i) + [" ".join(lines[i : end + 1])]
        i = end + 1
