"""A drive as other tools would have written it, and what the tests of the importer share."""

from __future__ import annotations

import csv
import importlib
import os
from pathlib import Path

import numpy as np
import pytest
from import_log import convert
from importing.table import opened

EXAMPLES = Path(__file__).resolve().parents[2] / "scripts" / "import_examples"
TIME = np.arange(0.0, 20.0, 0.01)
STEER, VX = 0.05 * np.sin(TIME), 12.0 + np.sin(0.3 * TIME)
YAW_RATE, AY = 0.2 * np.sin(TIME), 2.4 * np.sin(TIME)

PLAIN = """
[time]
column = "t"
[columns.vx]
column = "v"
unit = "km/h"
[columns.yaw_rate]
column = "r"
"""


def needs(package: str):
    """A reader's package. In continuous integration it is there: nothing is skipped silently."""
    try:
        return importlib.import_module(package)
    except ImportError:
        if os.environ.get("CI"):
            pytest.fail(f"{package} is missing: scripts/setup --test installs it")
        return pytest.skip(f"{package} is not installed: scripts/setup --test installs it")


def read(file: Path) -> dict[str, np.ndarray]:
    """A drive log's columns."""
    with opened(file, "r") as stream:
        header, *rows = list(csv.reader(stream))
    return dict(zip(header, np.array([[float(v) if v else np.nan for v in row] for row in rows]).T))


def imported(log: Path, mapping: str | Path, tmp_path: Path, **more) -> dict[str, np.ndarray]:
    """The drive log of a foreign one; a mapping's name is that of an example."""
    file = EXAMPLES / mapping if isinstance(mapping, str) else mapping
    convert(log, file, tmp_path / "drive.csv.gz", **more)
    return read(tmp_path / "drive.csv.gz")


def close(columns: dict[str, np.ndarray], **expected: np.ndarray) -> None:
    """Holds columns against values on TIME."""
    for name, values in expected.items():
        at = np.interp(columns["time"], TIME, values)
        assert np.nanmax(np.abs(columns[name] - at)) < 2e-3 * np.ptp(values), name


def mapping(tmp_path: Path, text: str) -> Path:
    """A mapping file."""
    file = tmp_path / "mapping.toml"
    file.write_text(text, encoding="utf-8")
    return file


def table(tmp_path: Path, header: str = "t,v,r", rows: int = 2000) -> Path:
    """A plain CSV file of the drive."""
    file = tmp_path / "log.csv"
    body = "\n".join(f"{t:.3f},{3.6 * v:.6f},{r:.8f}" for t, v, r in zip(TIME[:rows], VX, YAW_RATE))
    file.write_text(f"{header}\n{body}\n", encoding="utf-8")
    return file


def rows(count: int = 300, fields: str = "{t:.3f},{v:.6f},{r:.8f}") -> list[str]:
    """Lines of numbers by a format: t in s, v in km/h, r in rad/s."""
    return [fields.format(t=t, v=3.6 * v, r=r) for t, v, r in zip(TIME[:count], VX, YAW_RATE)]
