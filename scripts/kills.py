#!/usr/bin/env python3
"""Kills each command that writes at random moments, and reads what it left; totals into docs/results/fuzzing.{md,json}.

    scripts/kills.py                          100 kills of each command, with target/release
    scripts/kills.py --kills 10 --only drive --only tune
    scripts/kills.py --fmus target/fmu        FMUs for the commands that change them

A command runs once to its end. Then it is started again and again in the same folder (`evaluate`, which goes on where
it was, in an empty one) and killed (SIGKILL) after a random part of that time. After each kill every file that a later
command would take is read: a table has whole rows, JSON, TOML and HTML have their ends, a model its checksum, an
archive the sums of its entries. Drafts (`.NAME.PROCESS.NUMBER.part`) are nobody's; the next run takes them away.
"""

from __future__ import annotations

import argparse
import csv
import gzip
import json
import random
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

import fuzz

try:
    import tomllib
except ImportError:  # Python 3.10
    import tomli as tomllib

ROOT = Path(__file__).resolve().parent.parent
DRIVEN = ["--log", "own.csv", "--json", "own.json", "--junit", "own.xml"]
ROAD = str(ROOT / "paths" / "sudoku_turns.csv")
LOG = "good/drive_1.csv"
IMPORT = str(ROOT / "scripts" / "import_log.py")
TRAIN = ["train", LOG, "--quiet", "--no-proof", "--trees", "3", "--depth", "3"]
SHORT = ["--budget", "2", "--scenarios", "2", "--held-out", "2"]
# Name and arguments; `{rfl}`, `{fmu}` and `{python}` are programs, `{fmus}` a folder.
COMMANDS: dict[str, list[str]] = {
    "collect": ["{rfl}", "collect", "--path", ROAD, "--runs", "3", "--out", "logs", "--quiet"],
    "train": ["{rfl}", *TRAIN, "--out", "models/rfl_s.rflm", "--json", "models/fit.json"],
    "course": ["{rfl}", "course", "--route", "sudoku_turns", "--out", "roads/course.csv"],
    "path --write": ["{rfl}", "path", ROAD, "--write", "roads/smooth.csv"],
    "drive": ["{rfl}", "drive", "--quiet", "--path", ROAD, *DRIVEN],
    "identify --into": ["{rfl}", "identify", LOG, "--no-check", "--into", "cars/own.toml", "--json", "cars/own.json"],
    "diagnose": ["{rfl}", "diagnose", LOG, "--no-pairs", "--quiet", "--out", "report"],
    "tune": ["{rfl}", "tune", "--path", ROAD, *SHORT, "--out", "tune", "--quiet"],
    "learn": ["{rfl}", "learn", "--path", ROAD, "--test", ROAD, "--roads", "1", "--out", "learn", "--quiet"],
    "evaluate": [
        "{rfl}", "evaluate", "--quick", "--budget", "1", "--rows", "linear", "--plants", "as_is", "--noise", "off",
        "--out", "evaluate", "--quiet",
    ],
    "import_log.py": ["{python}", IMPORT, "raw.csv", "map.toml", "-o", "import/own.csv.gz"],
    "fmu-build --start": ["{fmu}", "{fmus}/RflMpc.fmu", "--start", "RflMpc.mpc.q_e2=2", "--out", "fmus"],
    "fmu-build --merge": ["{fmu}", "{fmus}/PassengerCar.fmu", "--merge", "{fmus}/PassengerCar.fmu", "--out", "fmus"],
}  # fmt: skip

# What a command goes on from: without it each run is one from the beginning.
KEPT = {"evaluate": "evaluate"}


def check(file: Path) -> None:
    """Raises where a file is not whole."""
    name = file.name.lower()
    if name.endswith(".csv.gz"):
        rows = list(csv.reader(gzip.decompress(file.read_bytes()).decode().splitlines()))
    elif name.endswith(".csv"):
        text = file.read_text(encoding="utf-8")
        assert text.endswith("\n"), "the last line has no end"
        rows = list(csv.reader(text.splitlines()))
    elif name.endswith(".json"):
        return json.loads(file.read_text(encoding="utf-8")) and None
    elif name.endswith(".toml"):
        return tomllib.loads(file.read_text(encoding="utf-8")) and None
    elif name.endswith((".html", ".xml", ".ssv", ".ssd")):
        assert file.read_text(encoding="utf-8").rstrip().endswith(">"), "the last tag is missing"
        return
    elif name.endswith((".fmu", ".ssp")):
        with zipfile.ZipFile(file) as archive:
            assert archive.testzip() is None, "an entry is damaged"
        return
    elif name.endswith(".sqlite"):
        with sqlite3.connect(file) as base:
            assert base.execute("pragma integrity_check").fetchone() == ("ok",), "the data base is damaged"
        return
    else:
        assert file.stat().st_size > 0, "it is empty"
        return
    assert len(rows) > 5, "it has hardly a row"
    assert all(len(row) == len(rows[0]) for row in rows), "a row is cut off"


def read_all(folder: Path, rfl: Path) -> int:
    """Reads all files that a later command would take; gives their number."""
    count = 0
    for file in sorted(folder.rglob("*")):
        if not file.is_file() or file.name.endswith(".part"):
            continue
        count += 1
        try:
            check(file)
            if file.suffix == ".rflm":
                # Its checksum is read before anything else.
                command = [rfl, "drive", "--quiet", "--path", ROAD, "--duration", "0.1", "--residual", file]
                run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
                assert run.returncode == 0, run.stderr
        except (AssertionError, ValueError, OSError, EOFError, zipfile.BadZipFile, sqlite3.Error) as error:
            raise SystemExit(f"{file}: {error}") from None
    return count


def prepare(folder: Path, rfl: Path) -> None:
    """A log to work on, and one of another tool."""
    made = [rfl, "collect", "--path", ROAD, "--runs", "1", "--out", "good", "--quiet"]
    subprocess.run(made, cwd=folder, check=True, capture_output=True)
    (folder / "cars").mkdir()
    lines = (folder / LOG).read_text(encoding="utf-8").splitlines()[:1501]
    (folder / LOG).write_text("\n".join(lines) + "\n", encoding="utf-8")
    names = ["time", "steer_cmd", "vx", "yaw_rate"]
    place = [lines[0].split(",").index(name) for name in names]
    rows = [",".join(line.split(",")[i] for i in place) for line in lines[1:]]
    (folder / "raw.csv").write_text("\n".join(["t,angle,speed,gyro", *rows]) + "\n", encoding="utf-8")
    (folder / "map.toml").write_text(
        '[time]\ncolumn = "t"\n'
        + "".join(f'[columns.{name}]\ncolumn = "{own}"\n' for name, own in zip(names[1:], ["angle", "speed", "gyro"])),
        encoding="utf-8",
    )


def kill(command: list[str], kills: int, rfl: Path, kept: str | None) -> dict:
    """Kills a command at random moments. ``kept``: a folder that is removed before each run."""
    draw = random.Random(1)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        prepare(folder, rfl)
        begin = time.monotonic()
        whole = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        takes = time.monotonic() - begin
        # Exit codes from 2 on tell outcomes and verdicts apart.
        if whole.returncode in (1, 2) or whole.returncode < 0:
            raise SystemExit(f"{' '.join(command)}: {whole.stderr or whole.stdout}")
        stopped = files = 0
        for _ in range(kills):
            if kept:
                shutil.rmtree(folder / kept, ignore_errors=True)
            with subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as run:
                time.sleep(takes * draw.random())
                run.kill()
                stopped += run.wait() < 0
            files += read_all(folder, rfl)
    return {"kills": kills, "stopped": stopped, "files": files, "seconds": round(takes, 2)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=100, help="kills of each command")
    parser.add_argument("--only", action="append", metavar="COMMAND", help="only this command (may be repeated)")
    parser.add_argument(
        "--programs", type=Path, default=ROOT / "target" / "release", help="folder of rfl and fmu-build"
    )
    parser.add_argument("--fmus", type=Path, default=ROOT / "target" / "fmu", help="FMUs of this version")
    options = parser.parse_args()
    programs = {
        "rfl": options.programs.resolve() / "rfl",
        "fmu": options.programs.resolve() / "fmu-build",
        "fmus": options.fmus.resolve(),
        "python": sys.executable,
    }
    results = fuzz.RESULTS / "fuzzing.json"
    for name, words in COMMANDS.items():
        if options.only and name not in options.only:
            continue
        command = [word.format(**programs) for word in words]
        if shutil.which(command[0]) is None:
            raise SystemExit(f"{command[0]}: is not there; build it, or name its folder with --programs")
        done = kill(command, options.kills, programs["rfl"], KEPT.get(name))
        found = json.loads(results.read_text(encoding="utf-8"))
        found.setdefault("kills", {})[name] = done
        fuzz.write(found)
        print(f"{name}: {done['stopped']} of {done['kills']} runs stopped, {done['files']} files read", flush=True)


if __name__ == "__main__":
    main()
