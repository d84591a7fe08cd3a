"""Our programs, built as the tests want them: in the profile that RFL_PROFILE names, `release` without it."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROFILE = os.environ.get("RFL_PROFILE", "release")


def program(name: str) -> Path:
    """The program `name`, built."""
    return _built("--bin", name, Path(name))


def example(name: str) -> Path:
    """The example `name`, built."""
    return _built("--example", name, Path("examples", name))


def _built(kind: str, name: str, place: Path) -> Path:
    subprocess.run(["cargo", "build", "--profile", PROFILE, "--quiet", kind, name], cwd=ROOT, check=True)
    return ROOT / "target" / ("debug" if PROFILE == "dev" else PROFILE) / place
