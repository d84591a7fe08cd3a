"""From Python's arguments to a command's words and frames, and what it says back."""

from __future__ import annotations

import logging
import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from rfl_mpc import _native

File = str | os.PathLike[str]
# A file, a table with named columns, or several.
Logs = Any
Progress = Callable[[str, float], None]

logger = logging.getLogger("rfl_mpc")


class RflWarning(UserWarning):
    """Something that is probably not meant."""


def words(**options: Any) -> list[str]:
    """Options in the words of the command line; what is not given has the command's default."""
    said: list[str] = []
    for name, value in options.items():
        option = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            said.append(option)
        elif isinstance(value, Mapping):
            said += [f"{option}={key}={_text(one)}" for key, one in value.items()]
        elif isinstance(value, Iterable) and not isinstance(value, (str, os.PathLike)):
            said += [f"{option}={_text(one)}" for one in value]
        else:
            said.append(f"{option}={_text(value)}")
    return said


def _text(value: Any) -> str:
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, str):
        return value
    # A number of numpy is written as a plain one.
    return repr(value.item() if hasattr(value, "item") else value)


Frame = tuple[str, list[tuple[str, bytes]]]


def frames_and_words(logs: Logs, *, option: str | None = None, name: str = "log") -> tuple[list[Frame], list[str]]:
    """Tables among the logs, and the words that name all of them: operands, or values of an option."""
    if logs is None:
        return [], []
    several = list(logs) if isinstance(logs, Sequence) and not isinstance(logs, str) else [logs]
    if not several:
        raise _native.RflError("give at least one log")
    frames: list[Frame] = []
    said: list[str] = [] if option else ["--"]
    for number, log in enumerate(several, start=1):
        if isinstance(log, (str, os.PathLike)):
            text = os.fspath(log)
        else:
            text = f"<{name}>" if len(several) == 1 else f"<{name} {number}>"
            frames.append((text, _columns(text, log)))
        said.append(f"--{option}={text}" if option else text)
    return frames, said


def _columns(name: str, table: Any) -> list[tuple[str, bytes]]:
    """The columns of a table that are signals, as doubles."""
    import numpy as np

    if not hasattr(table, "__getitem__"):
        kind = type(table).__name__
        raise _native.RflError(f"{name}: {kind} is no log; give a file, a data frame or a dict of arrays")
    names = [one for one in _names(table) if isinstance(one, str)]
    columns = []
    for column in names:
        if not _native.is_signal(column.split("[")[0].strip()):
            continue
        values = np.asarray(table[column])
        if values.ndim != 1:
            raise _native.RflError(f"{name}, column {column}: shape {values.shape}; give a one-dimensional column")
        if values.dtype.kind == "M":  # dates
            values = (values - values[:1]) / np.timedelta64(1, "s") if len(values) else values.astype(float)
        elif values.dtype.kind == "m":
            values = values / np.timedelta64(1, "s")
        try:
            columns.append((column, np.ascontiguousarray(values, dtype=np.float64).tobytes()))
        except (TypeError, ValueError) as error:
            raise _native.RflError(f"{name}, column {column}: {error}; give numbers") from None
    if not columns:
        words = f"no column is a signal of a drive log (columns: {', '.join(names[:8]) or 'none'})"
        raise _native.RflError(f"{name}: {words}; give time, steer_cmd, vx")
    return columns


def _names(table: Any) -> Iterable[Any]:
    """Names of a table's columns: of Arrow, of pandas and polars, of a dict, of a structured array."""
    for attribute in ("column_names", "columns"):
        if (names := getattr(table, attribute, None)) is not None:
            return names
    if isinstance(table, Mapping):
        return table.keys()
    return getattr(getattr(table, "dtype", None), "names", None) or ()


class _Listener:
    """Hears what a command says while it works."""

    def __init__(self, progress: Progress | None) -> None:
        self.lines: list[str] = []
        self.progress = progress

    def __call__(self, kind: str, text: str, share: float) -> None:
        if kind == "line":
            self.lines.append(text)
        elif kind == "share":
            if self.progress is not None:
                self.progress(text, share)
        elif text.startswith("warning: "):
            # From here over `call` and the function to the user's line.
            warnings.warn(text.removeprefix("warning: "), RflWarning, stacklevel=4)
        else:
            logger.info(text.removeprefix("note: "))


def call(function: Callable[..., Any], *arguments: Any, progress: Progress | None = None) -> tuple[Any, str]:
    """Calls a command; gives its answer, and what it says on a terminal."""
    listener = _Listener(progress)
    answer = function(*arguments, listener)
    return answer, "\n".join(listener.lines)
