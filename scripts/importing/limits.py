"""How large a log may be. A file of 3 MB may unpack to 2 GB, and a pipe never ends: both are refused early.

The limits are those of `rfl` (src/table/table_error.rs), and `--limit` means the same in both.
"""

from __future__ import annotations

import stat
from dataclasses import dataclass
from pathlib import Path

from importing.log import ImportFailed

MEGABYTE = 1 << 20
USUAL = 512  # MB
MOST = 1 << 20  # MB that --limit takes
LONGEST_LINE = MEGABYTE  # letters
LONGEST_NAME = 1000  # letters of a column's name
TEXT = 16 * MEGABYTE  # a mapping file, in bytes


@dataclass(frozen=True)
class Limits:
    """Most that a log may have. Unlike `rfl` this keeps all columns, so they and their fields count, too."""

    bytes: int = USUAL * MEGABYTE  # unpacked
    rows: int = 5_000_000
    columns: int = 16_384  # as in a spreadsheet
    fields: int = 128 * MEGABYTE  # numbers, of 8 bytes of memory each; a text counts twice

    @classmethod
    def of(cls, megabytes: int | None) -> Limits:
        """Limits by `--limit`. A larger file may have more rows, columns and fields, too."""
        if megabytes is None:
            return cls()
        more = max(1, megabytes // USUAL)
        return cls(megabytes * MEGABYTE, cls.rows * more, cls.columns * more, cls.fields * more)

    def hint(self, size: int | None = None) -> str:
        """What to do; `size` is what the file has, in bytes."""
        next_step = (self.bytes // (USUAL * MEGABYTE) + 1) * USUAL
        needed = next_step if size is None else -(-size // MEGABYTE)
        return f"cut it into several files, or raise the limit: --limit {needed}"

    def check_bytes(self, size: int, unpacked: bool = False, known: bool = True) -> None:
        """Refuses too many bytes; with `known` it is the whole size."""
        if size > self.bytes:
            words = " unpacked" if unpacked else ""
            hint = self.hint(size if known else None)
            raise ImportFailed(f"it has more than {self.bytes // MEGABYTE} MB{words}, the limit of a log; {hint}")

    def check_rows(self, rows: int, where: str = "", what: str = "rows") -> None:
        if rows > self.rows:
            raise ImportFailed(f"{where}it has more than {self.rows} {what}, the limit of a log; {self.hint()}")

    def check_columns(self, columns: int, where: str = "") -> None:
        if columns > self.columns:
            words = f"{where}it has {columns} columns, more than {self.columns}, the limit of a log"
            raise ImportFailed(f"{words}; export fewer of them, or raise the limit: {self.hint().rpartition(': ')[2]}")

    def check_fields(self, fields: int, where: str = "") -> None:
        if fields > self.fields:
            raise ImportFailed(
                f"{where}it has more than {self.fields} fields (rows times columns; texts count twice), the limit of a "
                f"log; {self.hint()}"
            )


STANDARD = Limits()


def check_kind(file: Path) -> int:
    """The size of an ordinary file in bytes; anything else is refused unread."""
    about = file.stat()
    if not stat.S_ISREG(about.st_mode):
        raise ImportFailed(f"it is {kind(about.st_mode)}, not a file")
    return about.st_size


def kind(mode: int) -> str:
    """Kind of what is no ordinary file."""
    if stat.S_ISDIR(mode):
        return "a folder"
    if stat.S_ISFIFO(mode):
        return "a pipe (FIFO)"
    if stat.S_ISSOCK(mode):
        return "a socket"
    return "a device" if stat.S_ISCHR(mode) or stat.S_ISBLK(mode) else "something else"


def check_file(file: Path, limits: Limits) -> int:
    """The size of a log in bytes, of a folder's files together."""
    try:
        size = sum(map(check_kind, parts(file))) if file.is_dir() else check_kind(file)
        limits.check_bytes(size)
    except ImportFailed as error:
        raise ImportFailed(f"{file}: {error}") from error
    return size


def parts(folder: Path) -> list[Path]:
    """Files of a bag's folder."""
    return [part for part in folder.iterdir() if not part.is_dir()]
