"""Files that are written whole or not at all, as `src/output.rs` does: beside their place, then renamed into it.

Drafts have the same names, `.NAME.PROCESS.NUMBER.part`, and locks as there: what a killed run left is taken away by the
next one that writes to the folder.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from importing.table import opened

try:
    import fcntl
except ImportError:  # Windows: drafts are not locked, and none is taken away
    fcntl = None

DRAFT = re.compile(r"\..+\.\d+\.\d+\.part")


def locked(draft: Path, flags: int, wait: bool) -> int | None:
    """Descriptor of a draft that no other process has locked; None where one has."""
    descriptor = os.open(draft, flags)
    try:
        if fcntl is not None:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        os.close(descriptor)
        return None
    except OSError:  # a file system without locks
        if not wait:
            os.close(descriptor)
            return None
    return descriptor


def remove_abandoned(folder: Path) -> None:
    """Takes away the drafts that nobody writes any more."""
    for draft in folder.iterdir():
        if fcntl is None or not DRAFT.fullmatch(draft.name) or draft.is_symlink() or not draft.is_file():
            continue
        # What cannot be opened or removed belongs to somebody else, and harms nobody.
        with contextlib.suppress(OSError):
            descriptor = locked(draft, os.O_RDONLY, wait=False)
            if descriptor is not None:
                draft.unlink()
                os.close(descriptor)


@contextlib.contextmanager
def written(file: Path) -> Iterator[IO[str]]:
    """A stream into a file, compressed if its name ends in .gz. What is no ordinary file is written through."""
    if file.is_symlink() or (file.exists() and (not file.is_file() or file.stat().st_nlink > 1)):
        with opened(file, "w") as stream:
            yield stream
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    remove_abandoned(file.parent)
    draft = file.with_name(f".{file.name}.{os.getpid()}.0.part")
    lock = locked(draft, os.O_WRONLY | os.O_CREAT, wait=True)
    try:
        with opened(draft, "w", file.suffix == ".gz") as stream:
            yield stream
        if file.exists():
            shutil.copymode(file, draft)
        draft.replace(file)
    finally:
        draft.unlink(missing_ok=True)
        os.close(lock)
