"""A foreign log as the importer sees it: named columns, each with values and perhaps a clock of its own."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


class ImportFailed(Exception):
    """What is wrong, where, and what to do."""


@dataclass
class Series:
    """Values and their times in seconds; values of a quaternion have four columns."""

    time: np.ndarray | None  # None where the file has no clock of its own
    values: np.ndarray


@dataclass
class Log:
    """An opened log. `get` reads one column, `clock` reads one as times in seconds by a unit (None: by the file)."""

    file: Path
    names: list[str]
    get: Callable[[str], Series]
    clock: Callable[[str, str | None], np.ndarray] | None = None
    units: dict[str, str] = field(default_factory=dict)
    broken: dict[str, str] = field(default_factory=dict)  # columns that cannot be read, and why
    aliases: dict[str, str] = field(default_factory=dict)  # short spellings of names, e.g. without the unit
    notes: list[str] = field(default_factory=list)  # how the file was read, where that was a choice


def load(module: str, what: str):
    """A reader's package, imported only when it is needed."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise ImportFailed(f"{what} needs the package {package}: pip install {package}") from error


def numeric(values, name: str) -> np.ndarray:
    """Values as floats."""
    values = np.asarray(values)
    if values.dtype.kind == "c":
        raise ImportFailed(f"'{name}' holds complex numbers")
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError) as error:
        raise ImportFailed(f"'{name}' holds no numbers") from error


def said(error: Exception) -> str:
    """A foreign package's error in one line."""
    if isinstance(error, ImportFailed):
        return str(error)
    words = " ".join(str(error).split())
    return f"{type(error).__name__}: {words[:160]}" if words else type(error).__name__
