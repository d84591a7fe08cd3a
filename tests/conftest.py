"""Shared by all Python tests: the built FMUs, the roads, and the program."""

from __future__ import annotations

import os
from pathlib import Path

import programs
import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def fmus() -> Path:
    """Folder of the built FMUs."""
    folder = Path(os.environ.get("RFL_FMUS", ROOT / "target" / "fmu"))
    if not (folder / "RflMpc.fmu").is_file():
        pytest.fail(f"no FMUs in {folder}: run scripts/build-fmus")
    return folder


@pytest.fixture(scope="session")
def paths() -> Path:
    """Folder of the roads."""
    return ROOT / "paths"


@pytest.fixture(scope="session")
def rfl() -> Path:
    """The program, in the profile that RFL_PROFILE names."""
    return programs.program("rfl")
