"""The commands that README and docs print: their options and parameters exist, and they run as printed.

A page's commands run in order in a folder that has what the page supposes: a road, a vehicle file, logs. Those that
take minutes run with RFL_DOCS=all, before a release; without it their options are checked, as those of all.
"""

from __future__ import annotations

import functools
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import programs
import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "blind" / "README.md", ROOT / "examples/ci/README.md"]
PAGES += [page for page in sorted((ROOT / "docs").rglob("*.md")) if page.parent.name != "results"]
PROGRAM = ("cargo run --release --", "target/release/rfl", "rfl")
PYTHON = ".venv/bin/python"
# Wrappers whose options are those of another program.
WRAPPED = {name: "fmu-build" for name in ("scripts/build-fmus", "target/release/fmu-build", "fmu-build")}
# Printed for their own sake, with options of others' programs or none.
OTHERS = ("cargo build", "cargo test", "cargo bench", "cargo install", "blind/", "scripts/fuzz.py", f"{PYTHON} -m")
# Checks and measurements of the project itself, which other tests, or people, run.
ITSELF = (
    "cargo ",
    "scripts/test",
    "scripts/site",
    "scripts/wheels",
    "scripts/release",
    f"{PYTHON} -m pytest",
    "blind/",
    "scripts/fuzz.py",
    "rfl fleet",
    "rfl evaluate --dask",
)
# Runs that take a minute or more, and what needs their files.
SLOW = (
    "scripts/demo",
    "scripts/learn",
    "scripts/foreign_vehicle",
    "scripts/tables_in_fmpy.py",
    "rfl learn",
    "rfl collect",
    "rfl train",
    "rfl diagnose",
    "rfl drive --vehicle out/",
    "rfl_s.rflm",
)
# Examples with files that only the reader has.
READERS = ("my_plant.py", "MyCar.fmu", "drive.mf4", "out/evaluate_truck")
# What a verdict, a car that the default controller drives best, or a requirement that is not met says with its status.
STATUSES = {"rfl diagnose": {0, 3, 4, 5}, "rfl learn": {0, 3}, "--require": {0, 6}}


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def commands(page: Path) -> list[str]:
    """The commands of a page's indented blocks, without the words beside them."""
    text = re.sub(r"\\\n\s+", "", page.read_text(encoding="utf-8"))
    found = []
    for line in text.splitlines():
        words = line.strip()
        if line.startswith("    ") and re.match(
            r"((cargo|rfl|fmu-build)\b|blind/|scripts/|target/|\.venv/) ?\S*", words
        ):
            found.append(re.split(r"\s{2,}|\s#", words)[0].strip())
    return found


def all_commands() -> list:
    return [
        pytest.param(name_of(page), text, id=f"{name_of(page)}: {text}") for page in PAGES for text in commands(page)
    ]


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
            if words[0] == "fleet":
                command = ROOT / "python" / "rfl_mpc" / "fleet" / "command.py"
                return [sys.executable, str(command), "--help"], words[1:]
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


def shell(text: str) -> str:
    """A command with the programs that were built, by their names."""
    for prefix in PROGRAM[:2]:
        text = text.replace(prefix, "rfl")
    return text.replace("target/release/fmu-build", "fmu-build")


def from_elsewhere(text: str) -> str:
    """A script finds its checkout from its own place; files on its command line are the reader's."""
    return re.sub(r"^scripts/", f"{ROOT}/scripts/", text)


@pytest.fixture(scope="module")
def logs(rfl, tmp_path_factory) -> dict[str, Path]:
    """Drives, as readers have them: of a car, of its steering when it has become late, and of another road."""
    place = tmp_path_factory.mktemp("logs")
    found = {}
    for name, road, delay in (("sound", "turns", 0.0), ("late", "turns", 0.06), ("other", "train", 0.0)):
        found[name] = place / f"{name}.csv"
        command = [rfl, "drive", "--path", ROOT / "paths" / f"sudoku_{road}.csv", "--duration", "40", "--quiet"]
        command += ["--log", found[name], "--set", f"effect.steer_delay={delay}"]
        subprocess.run(command, check=True, capture_output=True)
    return found


@pytest.fixture
def folder(tmp_path, fmus, logs, rfl) -> Path:
    """A checkout with a road, a vehicle file, logs and FMUs of the reader."""
    for name in ("paths", "vehicles", "scripts", "tests", "examples", ".venv"):
        (tmp_path / name).symlink_to(ROOT / name)
    # Copies: commands change them.
    shutil.copytree(fmus, tmp_path / "target" / "fmu")
    for name in ("road.csv", "my_road.csv"):
        shutil.copy(ROOT / "paths" / "sudoku_turns.csv", tmp_path / name)
    for name in ("car.toml", "my_car.toml"):
        shutil.copy(ROOT / "vehicles" / "c_class.toml", tmp_path / name)
    shutil.copytree(ROOT / "vehicles" / "tyres", tmp_path / "tyres")
    (tmp_path / "my_logs").mkdir()
    for name in ("real.csv", "march.csv", "my_logs/monday.csv"):
        shutil.copy(logs["sound"], tmp_path / name)
    shutil.copy(logs["late"], tmp_path / "june.csv")
    shutil.copy(logs["other"], tmp_path / "sweep.csv")
    subprocess.run(["gzip", "--keep", "real.csv"], cwd=tmp_path, check=True)
    step = ["time,steer_cmd,steer"]
    for k in range(400):
        step.append(f"{0.01 * k},{0.02 * (k >= 100)},{0.02 * (k >= 108)}")
    (tmp_path / "step.csv").write_text("\n".join(step) + "\n")
    for fmu in fmus.glob("*.fmu"):
        shutil.copy(fmu, tmp_path)
    programs.program("fmu-build")
    return tmp_path


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_run_as_printed(page, folder, rfl):
    everything = os.environ.get("RFL_DOCS") == "all"
    environment = os.environ | {
        "PATH": os.pathsep.join([str(rfl.parent), str(Path(sys.executable).parent), os.environ["PATH"]])
    }
    for printed in commands(page):
        text = shell(printed)
        if text.startswith(ITSELF) or any(name in text for name in READERS):
            continue
        if not everything and any(name in text for name in SLOW) and "--explain" not in text:
            continue
        done = subprocess.run(
            ["bash", "-c", from_elsewhere(text)],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        allowed = next((found for name, found in STATUSES.items() if name in text), {0})
        assert done.returncode in allowed, (
            f"{name_of(page)}: {printed}: status {done.returncode}: {done.stderr}{done.stdout}"
        )


def test_links_between_pages_are_sound(tmp_path):
    """Files only; `scripts/site` checks the places in pages, too."""
    said(sys.executable, str(ROOT / "scripts" / "site.py"), "--links", "--out", str(tmp_path))
