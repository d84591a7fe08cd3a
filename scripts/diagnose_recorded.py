#!/usr/bin/env python3
"""Changes the steering column of a recorded log, and asks the diagnosis what has changed since another drive.

Each change is known: the diagnosis has to find it beside whatever separates the two drives themselves.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT.parent / "shared/data/genesis"
DELAY, OFFSET, RATIO = 0.12, 0.0174533, 1.1

EXAMPLES = """examples:
  scripts/diagnose_recorded.py                       the recorded Genesis
  scripts/diagnose_recorded.py LOG REFERENCE --vehicle car.toml
"""


def changed(log: Path, into: Path, change: Callable[[list[float], int], list[float]]) -> None:
    """Writes a log with another steering column. The change is given the column and the rows of `DELAY`."""
    with log.open(newline="") as file:
        reader = csv.DictReader(file)
        names, rows = list(reader.fieldnames or []), list(reader)
    step = (float(rows[-1]["time"]) - float(rows[0]["time"])) / (len(rows) - 1)
    column = change([float(row["steer"]) for row in rows], round(DELAY / step))
    with into.open("w", newline="") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(row | {"steer": f"{value:.9g}"} for row, value in zip(rows, column, strict=True))


# What is put in, and what the diagnosis has to say.
CHANGES: dict[str, tuple[Callable[[list[float], int], list[float]], str]] = {
    "nothing": (lambda steer, _: steer, ""),
    # The column shows now what the wheels do later: the motion is late.
    "motion late by 0.12 s": (lambda steer, n: steer[n:] + [steer[-1]] * n, "sensor_delay = 0.12 (class steer_delay)"),
    "steering column late by 0.12 s": (lambda steer, n: [steer[0]] * n + steer[:-n], "sensor_delay = -0.12"),
    "1 degree added": (lambda steer, _: [s + OFFSET for s in steer], "steer_offset = -0.0175 x steer_gain"),
    "times 1.1": (lambda steer, _: [s * RATIO for s in steer], "steer_gain = 0.909"),
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "log", nargs="?", type=Path, default=DATA / "real_mpc_med_lap.csv", help="drive that is changed"
    )
    parser.add_argument("reference", nargs="?", type=Path, default=DATA / "real_human_fast_lap.csv")
    parser.add_argument("--vehicle", default="genesis", help="vehicle file or built-in name [default: genesis]")
    parser.add_argument("--out", type=Path, default=ROOT / "out/diagnose_recorded", help="folder for logs and reports")
    arguments = parser.parse_args()
    for file in (arguments.log, arguments.reference):
        if not file.exists():
            parser.error(f"no file {file}")
    arguments.out.mkdir(parents=True, exist_ok=True)
    print("| put into the steering column | expected | verdict |\n|---|---|---|")
    for number, (words, (change, expected)) in enumerate(CHANGES.items()):
        log, answer = arguments.out / f"changed_{number}.csv", arguments.out / f"report_{number}"
        changed(arguments.log, log, change)
        command = [ROOT / "target/release/rfl", "diagnose", log, "--reference", arguments.reference]
        command += ["--vehicle", arguments.vehicle, "--quiet", "--out", answer]
        ran = subprocess.run(command, capture_output=True, text=True, check=False)
        if not (answer / "report.json").exists():
            raise SystemExit(f"rfl diagnose failed on {log}: {ran.stderr}")
        verdict = json.loads((answer / "report.json").read_text())["verdict"]
        named = ", ".join(
            f"`{e['id']}` {e['value']:.4g} ({e['low']:.4g} to {e['high']:.4g})" for e in verdict["effects"]
        )
        print(
            f"| {words} | {expected} | {named or verdict['kind']}, probability {verdict['probability']:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
