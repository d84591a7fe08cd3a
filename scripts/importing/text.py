"""Lines of a text file of any tool: packed or not, in any encoding; a file of another format is named."""

from __future__ import annotations

import gzip
from pathlib import Path

from importing.log import ImportFailed

SAMPLE = 200  # lines from which delimiter and columns are found

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


def decoded(data: bytes) -> tuple[str, str]:
    """A file's text, and its encoding where that is not UTF-8."""
    if foreign := next((entry for entry in _FOREIGN if data.startswith(entry[0])), None):
        raise ImportFailed(f"it is no text but {foreign[1]}: {foreign[2]}")
    for mark, encoding in {
        b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe\0\0": "utf-32", b"\0\0\xfe\xff": "utf-32",
        b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16",
    }.items():  # fmt: skip
        if data.startswith(mark):
            return data.decode(encoding), "" if encoding == "utf-8-sig" else encoding.upper()
    head = data[:4000]
    for start, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        # Without a mark: every second byte of Latin letters is zero.
        if len(head) > 3 and head[start::2].count(0) > 0.4 * len(head[start::2]) and head[1 - start :: 2].count(0) == 0:
            return data.decode(encoding), encoding.upper()
    if b"\0" in head:
        raise ImportFailed("it is no text: it holds zero bytes")
    for encoding, name in (("utf-8", ""), ("cp1252", "Windows-1252 (Latin-1)")):
        try:
            return data.decode(encoding), name
        except UnicodeDecodeError:
            continue
    return data.decode("latin-1"), "Latin-1"


def read_lines(file: Path) -> tuple[list[str], str]:
    """Lines of a text file, compressed if its name ends in .gz, and its encoding where that is not UTF-8."""
    data = file.read_bytes()
    if file.suffix.lower() == ".gz" or data[:2] == b"\x1f\x8b":
        data = gzip.decompress(data)
    text, encoding = decoded(data)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    join_quoted(lines)
    return lines, encoding


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
