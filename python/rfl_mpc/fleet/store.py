"""What is done already: answers by the content of what they were made from, in one SQLite file.

A key is a hash of the log, the vehicle's files, the reference, the options and the version: where any of these
changes, the drive is new. An answer is written the moment that it comes, in a transaction of its own: who is killed
loses what was running, no more. SQLite comes with Python, has locks against a second run, and survives a kill.
"""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
import sys
import zlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from rfl_mpc._native import RflError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

LAYOUT = "1"
"""Version of what the file holds."""
TABLES = """
CREATE TABLE IF NOT EXISTS about (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS files (path TEXT PRIMARY KEY, size INTEGER, time INTEGER, hash TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS answers (key TEXT PRIMARY KEY, answer BLOB NOT NULL);
"""


class Store:
    """The file ``drives.sqlite`` of an output folder, for one run at a time."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._base = sqlite3.connect(path, timeout=1.0, isolation_level=None)
            # First, so that no shared memory is needed: folders on a network have none.
            self._base.execute("PRAGMA locking_mode = EXCLUSIVE")
            self._base.execute("PRAGMA journal_mode = WAL")
            # A killed program loses nothing; a killed machine may lose the last answers.
            self._base.execute("PRAGMA synchronous = NORMAL")
            self._base.execute("BEGIN EXCLUSIVE")
            self._base.execute("COMMIT")
            self._base.executescript(TABLES)
            self._base.execute("INSERT OR IGNORE INTO about VALUES ('layout', ?)", (LAYOUT,))
            (layout,) = self._base.execute("SELECT value FROM about WHERE name = 'layout'").fetchone()
        except sqlite3.OperationalError as error:
            if "locked" in str(error):
                raise RflError(
                    f"{path}: another run writes to this folder; wait for it, or give another --out"
                ) from None
            raise RflError(f"{path}: {error}") from None
        except sqlite3.DatabaseError as error:
            raise RflError(f"{path}: {error}; give another --out, or remove the file to begin anew") from None
        if layout != LAYOUT:
            raise RflError(f"{path}: written by another version of rfl fleet; give another --out")

    def close(self) -> None:
        self._base.close()

    def put(self, key: str, answer: Mapping[str, Any], hashes: Iterable[tuple[str, int, int, str]] = ()) -> None:
        """Keeps an answer, and the hashes of its files."""
        text = json.dumps(answer, separators=(",", ":"), sort_keys=True, allow_nan=True)
        try:
            self._base.execute("BEGIN")
            self._base.execute("INSERT OR REPLACE INTO answers VALUES (?, ?)", (key, zlib.compress(text.encode(), 6)))
            self._base.executemany("INSERT OR REPLACE INTO files VALUES (?, ?, ?, ?)", list(hashes))
            self._base.execute("COMMIT")
        except sqlite3.OperationalError as error:
            if self._base.in_transaction:
                self._base.execute("ROLLBACK")
            raise RflError(f"{self.path}: {error}; what was done before is kept: make room and run again") from None

    def get(self, key: str) -> dict[str, Any] | None:
        row = self._base.execute("SELECT answer FROM answers WHERE key = ?", (key,)).fetchone()
        return None if row is None else json.loads(zlib.decompress(row[0]))

    def has(self, key: str) -> bool:
        return self._base.execute("SELECT 1 FROM answers WHERE key = ?", (key,)).fetchone() is not None

    def hash_of(self, path: str) -> str | None:
        """Hash of a file that was read before and is as it was; None: not known."""
        row = self._base.execute("SELECT size, time, hash FROM files WHERE path = ?", (path,)).fetchone()
        if row is None:
            return None
        try:
            stat = os.stat(path)
        except OSError:
            return None
        if row[0] != stat.st_size:
            return None
        if row[1] == stat.st_mtime_ns:
            return row[2]
        # Touched, but perhaps not changed.
        found = file_hash(path)
        if found == row[2]:
            self._base.execute("UPDATE files SET time = ? WHERE path = ?", (stat.st_mtime_ns, path))
            return found
        return None


def file_hash(path: str | os.PathLike[str]) -> str:
    """SHA-256 of a file's content."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest() if hasattr(hashlib, "file_digest") else _digest(file)


def _digest(file: Any) -> str:
    found = hashlib.sha256()
    while block := file.read(1 << 20):
        found.update(block)
    return found.hexdigest()


def vehicle_hash(vehicle: str | None) -> str:
    """Hash of a vehicle file and the tyre files that it names; of a built-in vehicle its name."""
    if vehicle is None or not Path(vehicle).is_file():
        return f"built-in {vehicle}"
    found = hashlib.sha256(file_hash(vehicle).encode())
    try:
        with open(vehicle, "rb") as file:
            told = tomllib.load(file)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        return found.hexdigest()
    for name in _files(told):
        tyre = Path(vehicle).parent / name
        if tyre.is_file():
            found.update(file_hash(tyre).encode())
    return found.hexdigest()


def _files(told: Any) -> Iterator[str]:
    for key, value in sorted(told.items()):
        if isinstance(value, dict):
            yield from _files(value)
        elif key == "file" and isinstance(value, str):
            yield value


def key_of(log: str, vehicle: str, reference: str | None, options: Mapping[str, Any], version: str) -> str:
    """Key of an answer, by hashes of what it was made from."""
    parts = [LAYOUT, version, log, vehicle, reference or "", json.dumps(options, sort_keys=True)]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()
