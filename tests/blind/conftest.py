"""Tests of the blind check; they need its own environment (blind/requirements.txt) and are skipped without it."""

import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

for module in ("numba", "statsmodels", "cryptography"):
    # Looked for, not imported: the package `blind` says where numba keeps compiled code before numba is imported.
    if find_spec(module) is None:
        collect_ignore_glob = ["test_*.py"]
        if "blind" in " ".join(sys.argv):
            pytest.exit(f"the blind check's tests need {module}: blind/.venv/bin/python -m pytest tests/blind", 4)
        break
