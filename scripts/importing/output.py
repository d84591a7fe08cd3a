"""Files that are written whole or not at all, as `src/output.rs` does: beside their place, then renamed into it."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from importing.table import opened


@contextlib.contextmanager
def written(file: Path) -> Iterator[IO[str]]:
    """A stream into a file, compressed if its name ends in .gz. What is no ordinary file is written through."""
    if file.is_symlink() or (file.exists() and (not file.is_file() or file.stat().st_nlink > 1)):
        with opened(file, "w") as stream:
            yield stream
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    draft = file.with_name(f".{os.getpid()}.{file.name}")
    try:
        with opened(draft, "w") as stream:
            yield stream
        if file.exists():
            shutil.copymode(file, draft)
        draft.replace(file)
    finally:
        draft.unlink(missing_ok=True)
