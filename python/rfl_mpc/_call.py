"""From Python's arguments to a command's words and frames, and what it says back."""

from __future__ import annotations

import logging
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rfl_mpc import _native

if TYPE_CHECKING:
    import numpy as np

File = str | bytes | os.PathLike[str]
# A file, a table with named columns, or several.
Logs = Any
Progress = Callable[[str, float], None]

logger = logging.getLogger("rfl_mpc")


class RflWarning(UserWarning):
    """Something that is probably not meant."""


def words(**options: Any) -> list[str]:
    """Options in the words of the command line; what is not given has the command's default."""
    said: list[str] = []
    for name, given in options.items():
        option, value = "--" + name.replace("_", "-"), plain(given)
        if value is None or value is False:
            continue
        if value is True:
            said.append(option)
        elif _is_mapping(value):
            said += [f"{option}={key}={_text(f'{option} {key}', one)}" for key, one in value.items()]
        elif isinstance(value, Iterable) and not isinstance(value, (str, bytes, os.PathLike)):
            said += [f"{option}={_text(option, one)}" for one in value]
        else:
            said.append(f"{option}={_text(option, value)}")
    return said


def _is_mapping(value: Any) -> bool:
    """Whether values have names: of a dict, or of a series of pandas."""
    return isinstance(value, Mapping) or (
        hasattr(value, "items") and all(isinstance(name, str) for name, _ in value.items())
    )


def plain(value: Any) -> Any:
    """A number or a truth value of numpy as Python's."""
    return value.item() if getattr(value, "ndim", None) == 0 and hasattr(value, "item") else value


def _text(name: str, value: Any) -> str:
    if isinstance(value, (str, bytes, os.PathLike)):
        return file_name(value)
    if getattr(value, "ndim", 0) > 0:
        if value.size != 1:
            raise _native.RflError(f"{name}: an array of {value.size} values; give one value")
        value = value.reshape(-1)[0] if hasattr(value, "reshape") else value.iloc[0]
    return repr(plain(value))


def file_name(file: File) -> str:
    """A file's name as text; ``~`` is the home folder, as in a shell."""
    text = os.path.expanduser(os.fsdecode(file))
    try:
        text.encode()
    except UnicodeEncodeError:
        raise _native.RflError(f"{text!r}: a name that is no text in UTF-8; rename the file") from None
    return text


def reason(error: Exception) -> str:
    """An error of the operating system in its words, without its number; of another one its text."""
    return os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)


Frame = tuple[str, list[tuple[str, bytes]]]


def frames_and_words(logs: Logs, *, option: str | None = None, name: str = "log") -> tuple[list[Frame], list[str]]:
    """Tables among the logs, and the words that name all of them: operands, or values of an option."""
    if logs is None:
        if option is None:
            raise _native.RflError("give at least one log; None was given")
        return [], []
    several = list(logs) if isinstance(logs, Sequence) and not isinstance(logs, (str, bytes)) else [logs]
    if not several:
        raise _native.RflError("give at least one log")
    frames: list[Frame] = []
    said: list[str] = [] if option else ["--"]
    for number, log in enumerate(several, start=1):
        if isinstance(log, (str, bytes, os.PathLike)):
            text = file_name(log)
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
    signals = dict(zip(names, _native.signals(names)))
    told = [(column, table[column]) for column in names if signals[column]]
    index = getattr(table, "index", None)
    if "time" not in signals.values() and hasattr(index, "dtype"):
        named = isinstance(index.name, str) and _native.signals([index.name]) == ["time"]
        if named or index.dtype.kind in "mM":
            told.insert(0, (index.name if named else "time", index))
            signals[told[0][0]] = "time"
    if not told:
        words = f"no column is a signal of a drive log (columns: {', '.join(names[:8]) or 'none with a name'})"
        raise _native.RflError(f"{name}: {words}; {_named(table)}")
    columns = []
    for column, given in told:
        masked = isinstance(given, np.ma.MaskedArray) and given.dtype.kind in "biuf"
        values = np.ma.filled(given.astype(np.float64), np.nan) if masked else np.asarray(given)
        if values.ndim == 0:
            words = "one value and no column; of rows that are dicts make a table: pandas.DataFrame(rows)"
            raise _native.RflError(f"{name}, column {column}: {words}")
        if values.ndim != 1:
            raise _native.RflError(f"{name}, column {column}: shape {values.shape}; give a one-dimensional column")
        if signals[column] == "time":
            if values.dtype.kind in "OUT":
                values = _times(f"{name}, column {column}", values)
            _check_steps(f"{name}, column {column}", values)
        if values.dtype.kind == "M":  # dates
            known = values[~np.isnat(values)]
            values = (values - known[:1]) / np.timedelta64(1, "s") if len(known) else np.full(len(values), np.nan)
        elif values.dtype.kind == "m":
            values = values / np.timedelta64(1, "s")
        try:
            columns.append((column, np.ascontiguousarray(values, dtype=np.float64).tobytes()))
        except (TypeError, ValueError) as error:
            raise _native.RflError(f"{name}, column {column}: {error}; give numbers") from None
    if not any(data for _, data in columns):
        raise _native.RflError(f"{name}: the table has no rows")
    return columns


def _named(table: Any) -> str:
    """How a table that has no columns with the names of signals is given."""
    names = list(_names(table))
    if any(isinstance(name, tuple) for name in names):
        return f"its names are of several levels; {_of_one_level(table, names)}"
    if getattr(table, "ndim", 0) == 1 and hasattr(table, "to_frame"):
        return "a Series is one column; give a data frame with time, steer_cmd, vx"
    if hasattr(table, "ndim") and not hasattr(table, "columns"):
        return "an array has no names; give a data frame or a dict of arrays: time, steer_cmd, vx"
    return "give time, steer_cmd, vx"


def _of_one_level(table: Any, names: list[Any]) -> str:
    """A statement that gives a table names of one level, those of signals."""
    tuples = [name for name in names if isinstance(name, tuple)]
    parts = {f"name[{level}]": [name[level] for name in tuples] for level in range(min(map(len, tuples)))}
    parts["[part for part in name if part][-1]"] = [next(filter(None, reversed(name)), "") for name in tuples]
    found = {how: _native.signals([str(part) for part in of]) for how, of in parts.items()}
    how = max(found, key=lambda how: len({*found[how]} - {None}))
    signals = [signal for signal in found[how] if signal]
    is_mapping = isinstance(table, Mapping)
    if not signals:
        return "give time, steer_cmd, vx"
    if len(tuples) == len(names) and len({*signals}) == len(signals):
        return (
            f"table = {{{how}: table[name] for name in table}}"
            if is_mapping
            else f"table.columns = [{how} for name in table]"
        )
    # A sensor's columns stay together: the first of those with the most signals.
    known = [(name, part, signal) for name, part, signal in zip(tuples, parts[how], found[how]) if signal]
    groups = [tuple(one for one in name if one != part) for name, part, _ in known]
    chosen: dict[str, tuple[Any, Any]] = {}
    for _, (name, part, signal) in sorted(zip(groups, known), key=lambda one: -groups.count(one[0])):
        chosen.setdefault(signal, (name, part))
    given = [name for name in names if isinstance(name, str) and _native.signals([name])[0] not in (None, *chosen)]
    pairs = [(name, name) for name in given] + list(chosen.values())
    if is_mapping:
        return "choose, such as table = {" + ", ".join(f"{part!r}: table[{name!r}]" for name, part in pairs) + "}"
    columns, flat = [name for name, _ in pairs], [part for _, part in pairs]
    return f"choose, such as table = table[{columns!r}].set_axis({flat!r}, axis=1)"


def _check_steps(place: str, times: np.ndarray) -> None:
    """Refuses times that their type cannot hold apart: seconds since 1970 in 32 bits have steps of two minutes."""
    import numpy as np

    if times.dtype.kind != "f" or times.dtype.itemsize >= 8:
        return
    known = times[np.isfinite(times)]
    if 2 * len(np.unique(known)) <= len(known):
        step, kind = float(np.spacing(np.abs(known).max())), times.dtype.name
        words = (
            f"{kind} counts such times in steps of {step:.3g} s, and rows come out at one time; keep them as float64"
        )
        raise _native.RflError(f"{place}: {words}")


def _times(place: str, values: np.ndarray) -> np.ndarray:
    """Times that are objects or text: as numbers, durations, or dates in UTC."""
    import numpy as np
    import pandas as pd

    times = pd.Series(values).infer_objects()
    if times.dtype.kind == "m":
        return times.to_numpy()
    if times.dtype.kind != "M":
        numbers = pd.to_numeric(times, errors="coerce")
        texts = times.astype(str).str.strip()
        missing = times.isna() | (texts == "")
        if (numbers.notna() | missing).all():
            return numbers.to_numpy(np.float64, na_value=np.nan)
        times = pd.to_datetime(texts.where(numbers.isna() & ~missing), errors="coerce", utc=True, format="ISO8601")
        bad = times.isna() & numbers.isna() & ~missing
        if bad.any():
            row = int(bad.to_numpy().argmax())
            words = f"row {row + 1}: '{texts.iloc[row]}' is neither a number nor a date (ISO 8601)"
            raise _native.RflError(f"{place}, {words}; give seconds or dates")
        if numbers.notna().any():
            raise _native.RflError(f"{place}: numbers beside dates; give seconds or dates")
    # Without the zone, for numpy has none.
    return pd.to_datetime(times, utc=True).dt.tz_localize(None).to_numpy()


def _names(table: Any) -> Iterable[Any]:
    """Names of a table's columns: of Arrow, of pandas and polars, of a dict, of a structured array."""
    for attribute in ("column_names", "columns"):
        if (names := getattr(table, attribute, None)) is not None:
            return names
    if isinstance(table, Mapping):
        return table.keys()
    return getattr(getattr(table, "dtype", None), "names", None) or ()


@contextmanager
def renamed(**options: str) -> Iterator[None]:
    """Errors name options of the command line as Python does; ``from`` is no name in Python."""
    try:
        yield
    except _native.RflError as error:
        text = str(error)
        for python, option in options.items():
            text = text.replace(option, python)
        raise type(error)(text) from None


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
