"""The Python package, from its sources and the library as built; or the installed one, with RFL_PACKAGE=installed."""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path

import programs
import pytest


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """Where the package is imported from; none where it is installed."""
    if os.environ.get("RFL_PACKAGE") == "installed":
        return None
    return programs.python_package(tmp_path_factory.mktemp("package"))


@pytest.fixture(scope="session")
def rfl(folder):
    """The program: that of the project, or the installed one beside the package."""
    return programs.program("rfl") if folder is not None else Path(sys.executable).with_name("rfl")


@pytest.fixture(scope="session")
def rfl_mpc(folder):
    if folder is not None:
        sys.path.insert(0, str(folder))
    return importlib.import_module("rfl_mpc")
