#!/usr/bin/env python3
"""A blind diagnosis to watch: something is wrong with the car, and `rfl diagnose` finds out what.

    scripts/diagnose_demo                      another effect each time
    scripts/diagnose_demo --seed 7             the same again

1. A seed draws one effect and its value, and a background: mass and tyres within their tolerances, sensor noise. The
   draw is sealed: it goes to a file whose hash is printed.
2. The controller's FMU drives the car's FMU with it in fmpy; what a test car would record becomes the log.
3. `rfl diagnose` gets the log and the car as the simulator has it. It is told nothing else.
4. The draw is opened and compared: name, value, how far the gap shrank.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import random
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from closed_loop import FMUS, PROJECT, DriveProgress, drive

# What may be drawn: effect, least and greatest distance from neutral, neutral, whether both signs. Moderate sizes, that
# a driver would notice.
EFFECTS = [
    ("steer_delay", 0.06, 0.15, 0.0, False),
    ("steer_lag", 0.08, 0.20, 0.0, False),
    ("steer_backlash", 0.010, 0.020, 0.0, False),
    ("steer_offset", 0.008, 0.020, 0.0, True),
    ("steer_gain", 0.08, 0.15, 1.0, True),
    ("tyre_stiffness_front", 0.15, 0.35, 1.0, True),
    ("tyre_stiffness_rear", 0.15, 0.35, 1.0, True),
    ("payload", 200.0, 400.0, 0.0, False),
    ("cg_shift", 0.10, 0.25, 0.0, True),
    ("yaw_inertia", 0.25, 0.50, 1.0, False),
    ("road_bank", 0.025, 0.060, 0.0, True),
    ("yaw_rate_bias", 0.008, 0.020, 0.0, True),
    ("lateral_accel_bias", 0.2, 0.5, 0.0, True),
    ("sensor_delay", 0.05, 0.12, 0.0, False),
    ("speed_scale", 0.03, 0.06, 1.0, True),
]

# The background: standard deviations as shares of the value.
BACKGROUND = {"vehicle.mass": 0.015, "vehicle.yaw_inertia": 0.02, "tyre.front.stiffness_scale": 0.02,
              "tyre.rear.stiffness_scale": 0.02}  # fmt: skip

# What a test car records, and the noise of each sensor.
RECORDED = {
    "steer_cmd": 0.0, "accel_cmd": 0.0, "x": 0.02, "y": 0.02, "yaw": 5e-4, "vx": 0.02, "vy": 0.02, "yaw_rate": 2e-3,
    "ax": 0.05, "ay": 0.05, "steer": 5e-4,
}  # fmt: skip


def draw(seed: int, given: dict[str, float]) -> dict:
    """The effect and the background that a seed means."""
    chance = random.Random(seed)
    effect, least, greatest, neutral, both = chance.choice(EFFECTS)
    value = neutral + chance.uniform(least, greatest) * (chance.choice((-1, 1)) if both else 1)
    background = {name: given[name] * (1 + chance.gauss(0.0, share)) for name, share in BACKGROUND.items()}
    return {
        "seed": seed,
        "effect": effect,
        "value": value,
        "background": background,
        "noise_seed": chance.getrandbits(32),
    }


def record(columns: dict[str, np.ndarray], seed: int, file: Path) -> None:
    """Writes what a test car would: few signals, with noise."""
    noise = np.random.default_rng(seed)
    measured = {name: columns[name] + noise.normal(0.0, sigma, len(columns[name])) if sigma else columns[name]
                for name, sigma in RECORDED.items()}  # fmt: skip
    with open(file, "w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream)
        rows.writerow(["time", *measured])
        for row in zip(columns["time"], *measured.values()):
            rows.writerow([f"{value:.8g}" for value in row])


def parameters(rfl: Path) -> dict[str, float]:
    """The car's parameters as the simulator has them."""
    found = subprocess.run([rfl, "parameters", "--json"], capture_output=True, text=True, check=True).stdout
    return {p["name"]: p["default"] for p in json.loads(found) if p["of"] == "car"}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, help="what is drawn (default: another each time)")
    parser.add_argument("--path", type=Path, default=PROJECT / "paths" / "sudoku_test.csv", help="road to drive")
    parser.add_argument("--duration", type=float, default=100.0, help="seconds to drive (default: %(default)s)")
    parser.add_argument("--out", type=Path, default=PROJECT / "out" / "diagnosis", help="folder for log and page")
    parser.add_argument("--fmus", type=Path, default=FMUS, help="folder of the FMUs (default: %(default)s)")
    parser.add_argument("--rfl", type=Path, default=PROJECT / "target" / "release" / "rfl", help="the program")
    options = parser.parse_args()
    if not options.rfl.is_file():
        parser.error(f"no program at {options.rfl}: cargo build --release --bin rfl, or start scripts/diagnose_demo")
    seed = options.seed if options.seed is not None else random.SystemRandom().randrange(10**6)
    out = options.out
    out.mkdir(parents=True, exist_ok=True)

    drawn = draw(seed, parameters(options.rfl))
    sealed = out / "draw.json"
    sealed.write_text(json.dumps(drawn, indent=1) + "\n")
    seal = hashlib.sha256(sealed.read_bytes()).hexdigest()
    print(f"drawn and sealed: sha256 {seal}")

    settings = {f"car.{name}": value for name, value in drawn["background"].items()}
    settings[f"car.effect.{drawn['effect']}"] = drawn["value"]
    progress = DriveProgress("driving the FMUs")
    try:
        result = drive(options.path, duration=options.duration, settings=settings, fmus=options.fmus, progress=progress)
    except (RuntimeError, ValueError, OSError) as error:
        progress.close()
        print(f"diagnose_demo: {error}", file=sys.stderr)
        return 1
    progress.close()
    log = out / "drive.csv"
    record(result.columns, drawn["noise_seed"], log)
    e1 = np.abs(result.columns["e1"])
    print(
        f"driven: {result.columns['time'][-1]:.0f} s, lateral error mean {e1.mean():.3f} m, max {e1.max():.3f} m; "
        f"{result.outcome}"
    )

    command = [options.rfl, "diagnose", log, "--path", options.path, "--out", out]
    begin = time.perf_counter()
    # The log and the sound car are all that it is told.
    answer = subprocess.run([str(part) for part in command], check=False)
    wall = time.perf_counter() - begin
    if answer.returncode in (1, 2):
        return 1
    report = json.loads((out / "report.json").read_text())

    assert hashlib.sha256(sealed.read_bytes()).hexdigest() == seal, "the seal is broken"
    return compare(drawn, report, wall, out)


def compare(drawn: dict, report: dict, wall: float, out: Path) -> int:
    """Opens the draw."""
    effect, value = drawn["effect"], drawn["value"]
    neutral = next(entry[3] for entry in EFFECTS if entry[0] == effect)
    named = report["verdict"]["effects"]
    exact = any(one["id"] == effect for one in named)
    in_class = any(effect in one["class"] for one in named)
    error = next((abs(one["value"] - value) / abs(value - neutral) for one in named if one["id"] == effect), None)
    verdict = "right" if exact else "in the class" if in_class else "wrong"
    print(f"\nThe draw is opened (seed {drawn['seed']}): effect.{effect} = {value:.4g}")
    print(
        f"The diagnosis, in {wall:.1f} s: {verdict}"
        + (f", value off by {100 * error:.1f} %" if error is not None else "")
    )
    shrunk = {
        name: 1 - gap["recalibrated"] / gap["before"] for name, gap in report["gap_reduction"]["open_loop"].items()
    }
    for name, gap in (report["gap_reduction"]["closed_loop"] or {}).items():
        shrunk[f"{name}, closed loop"] = 1 - gap["recalibrated"] / gap["before"]
    print("The gap closed by: " + ", ".join(f"{name} {100 * share:.0f} %" for name, share in shrunk.items()))
    print(f"look at: {out / 'report.html'}")
    result = {"draw": drawn, "named": [one["id"] for one in named], "verdict": verdict, "value_error": error,
              "closed": shrunk, "wall_s": wall}  # fmt: skip
    (out / "demo.json").write_text(json.dumps(result, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
