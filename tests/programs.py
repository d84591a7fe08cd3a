"""Our programs, built as the tests want them: in the profile that RFL_PROFILE names, `release` without it."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROFILE = os.environ.get("RFL_PROFILE", "release")
# What `cargo test --workspace` has built already: a narrower selection has other features, and would be a build apart.
TESTED = ["--workspace", "--bins", "--examples"]


def program(name: str) -> Path:
    """The program `name`, built."""
    return _built("--bin", name, Path(name))


def example(name: str) -> Path:
    """The example `name`, built."""
    return _built("--example", name, Path("examples", name))


def _built(kind: str, name: str, place: Path) -> Path:
    selection = TESTED if PROFILE == "dev" else ["--workspace", kind, name]
    subprocess.run(["cargo", "build", "--profile", PROFILE, "--quiet", *selection], cwd=ROOT, check=True)
    return ROOT / "target" / ("debug" if PROFILE == "dev" else PROFILE) / place
