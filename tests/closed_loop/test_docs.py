"""The commands that README and docs print: their options and parameters exist, and the quick ones run as printed."""

from __future__ import annotations

import functools
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import programs
import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PROGRAM = ("cargo run --release --", "target/release/rfl", "rfl")
PYTHON = ".venv/bin/python"
# Wrappers whose options are those of another program.
WRAPPED = {"scripts/build-fmus": "fmu-build"}
# Printed for their own sake, with options of others' programs or none.
OTHERS = ("cargo build", "cargo test", "cargo bench", f"{PYTHON} -m")
QUICK = {
    "README.md": (
        "drive --set effect.steer_lag=0.1 --set effect.steer_delay=0.06 --log out/drive.csv",
        "identify out/drive.csv",
        "drive --path paths/hairpin_circuit.csv --log drive.csv",
        "path road.csv",
        "parameters",
        "course --help",
    )
}


def commands(page: Path) -> list[str]:
    """The commands of a page's indented blocks, without the words beside them."""
    text = re.sub(r"\\\n\s+", "", page.read_text(encoding="utf-8"))
    found = []
    for line in text.splitlines():
        words = line[4:]
        if line.startswith("    ") and re.match(r"(cargo|rfl|scripts/|target/|\.venv/)", words):
            found.append(re.split(r"\s{2,}|\s#", words)[0].strip())
    return found


def all_commands() -> list:
    return [pytest.param(page.name, text, id=f"{page.name}: {text}") for page in PAGES for text in commands(page)]


@functools.cache
def said(*command: str) -> str:
    """What a command prints."""
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command}: {done.stderr}"
    return done.stdout


@functools.cache
def parameters() -> set[str]:
    """Names of all parameters of controllers and vehicles."""
    rfl = str(programs.program("rfl"))
    listed = said(rfl, "parameters")
    return set(re.findall(r"[a-z_0-9]+(?:\.[a-z_0-9]+)+", listed)) | {"road_friction"}


def program_of(text: str) -> tuple[list[str], list[str]] | None:
    """The help of what a command calls, and its arguments; none for others' programs."""
    if text.startswith(OTHERS):
        return None
    for prefix in PROGRAM:
        if text.startswith(prefix + " "):
            words = shlex.split(text[len(prefix) :])
            return [str(programs.program("rfl")), words[0], "--help"], words[1:]
    words = shlex.split(text)
    if words[0] in WRAPPED:
        return [str(programs.program(WRAPPED[words[0]])), "--help"], words[1:]
    script = words[1] if words[0] == PYTHON else words[0]
    file = ROOT / script if script.endswith(".py") else (ROOT / script).with_suffix(".py")
    assert (ROOT / script).is_file(), f"there is no {script}"
    if not file.is_file():
        return None
    return [sys.executable, str(file), "--help"], words[2:] if words[0] == PYTHON else words[1:]


@pytest.mark.parametrize(("page", "text"), all_commands())
def test_options_and_parameters_exist(page, text):
    called = program_of(text)
    if called is None:
        return
    help_command, arguments = called
    help_text = said(*help_command)
    for at, word in enumerate(arguments):
        if word.startswith("--"):
            assert re.search(rf"{re.escape(word.split('=')[0])}\b", help_text), f"{page}: no option {word}"
        if word == "--set" and "plant." not in arguments[at + 1] and "fmu-build" not in help_command[0]:
            name = arguments[at + 1].split("=")[0].removeprefix("controller.").removeprefix("car.")
            assert name in parameters() or name == "residual.file", f"{page}: no parameter {name}"


@pytest.mark.parametrize(("page", "texts"), QUICK.items())
def test_quick_commands_run_as_printed(page, texts, rfl, tmp_path):
    for folder in ("paths", "vehicles"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    shutil.copy(ROOT / "paths" / "sudoku_turns.csv", tmp_path / "road.csv")
    printed = commands(ROOT / page)
    for text in texts:
        assert any(line.endswith(f"-- {text}") for line in printed), f"{page} does not print '{text}' any more"
        done = subprocess.run([rfl, *shlex.split(text)], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{text}: {done.stderr}"
