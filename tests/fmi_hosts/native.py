"""The program beside the FMUs: run it, read its logs, compare them with drives in a host."""

from __future__ import annotations

import csv
import subprocess
from pathlib import Path

import numpy as np
from instance import CLOCKED


def run(rfl: Path, *arguments) -> None:
    """Runs a command of the program, which must not fail."""
    result = subprocess.run([str(a) for a in (rfl, *arguments)], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def settings(values: dict[str, object]) -> list[str]:
    """Parameters as options of a command."""
    return [text for name, value in values.items() for text in ("--set", f"{name}={value}")]


def read_log(log: Path) -> dict[str, np.ndarray]:
    """The columns of a log: numbers, and `status` (a host's log also has that of the vehicle) as words."""
    with open(log, newline="") as file:
        header, *rows = csv.reader(file)
    assert header[-1] == "status"
    columns = dict(zip(header, zip(*rows)))
    words = {name for name in header if name.split(".")[-1] == "status"}
    return {name: np.array(column, dtype=None if name in words else float) for name, column in columns.items()}


def assert_same(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> None:
    """All that both have recorded is equal to the last bit."""
    shared = set(a) & set(b) - {CLOCKED}
    assert {"steer_cmd", "x", "e1", "station"} <= shared
    for name in shared - {"status"}:
        assert np.array_equal(a[name], b[name]), name
