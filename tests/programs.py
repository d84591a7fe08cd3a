"""Our programs and the Python package, built as the tests want: in the profile RFL_PROFILE, `release` without it."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROFILE = os.environ.get("RFL_PROFILE", "release")
# What `cargo test --workspace` has built already: a narrower selection has other features, and would be a build apart.
TESTED = (ROOT / "scripts" / "tested.txt").read_text(encoding="utf-8").split()
FMUS = ["fmu-passenger-car", "fmu-rfl-mpc", "fmu-semi-trailer-truck", "fmu-truck-rfl-mpc"]


def program(name: str) -> Path:
    """The program `name`, built."""
    return _built("--bin", name, Path(name))


def example(name: str) -> Path:
    """The example `name`, built."""
    return _built("--example", name, Path("examples", name))


def python_package(folder: Path) -> Path:
    """A folder to import `rfl_mpc` from: the sources in python/, the library as built, and what a wheel carries."""
    library = _built("--lib", "", Path("librfl_mpc_native.so"))
    package = folder / "rfl_mpc"
    (package / "data").mkdir(parents=True)
    for file in (ROOT / "python" / "rfl_mpc").iterdir():
        if file.suffix in (".py", ".pyi", ".typed") or file.name == "fleet":
            (package / file.name).symlink_to(file)
    (package / "_native.abi3.so").symlink_to(library)
    for name, place in {"fmu": ROOT / "target" / "fmu", "vehicles": ROOT / "vehicles", "paths": ROOT / "paths"}.items():
        (package / "data" / name).symlink_to(place)
    return folder


def _built(kind: str, name: str, place: Path) -> Path:
    selection = TESTED if PROFILE == "dev" else ["--workspace", kind, *([name] if name else [])]
    if kind == "--lib":
        # The FMUs' libraries are built apart (scripts/build-fmus).
        selection = list(dict.fromkeys([*selection, "--lib", *(f"--exclude={fmu}" for fmu in FMUS)]))
    subprocess.run(["cargo", "build", "--profile", PROFILE, "--quiet", *selection], cwd=ROOT, check=True)
    return ROOT / "target" / ("debug" if PROFILE == "dev" else PROFILE) / place
