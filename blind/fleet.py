"""A synthetic fleet from the blind vehicles, sealed changes in some of them, and how `rfl fleet` fares on it.

    blind/fleet                                     200 vehicles of 3 types, 50 drives each; a new secret seed; hours
    blind/fleet --vehicles 30 --drives 12 --development    a small one for all tuning

A type is a design with errors that all its vehicles share; a vehicle has tolerances of its own that stay; a drive
has the day's: wind, road, fuel, warm sensors. Some vehicles change at one drive, in one effect of the library, drawn
as for single cases. One type has an effect in all of its vehicles. `rfl fleet` gets logs, a manifest, and each
type's design as its vehicle file.

What is measured, as if `rfl fleet` were run after each drive:

- **named in time**: of the changed vehicles, those whose change is said, with its effect, on the first, second or
  third drive that has it;
- **false alarms**: vehicles of which a lasting change is said that they do not have, or not yet, or with another
  effect that is not told to be confused with it, per 1000 drives;
- values: whether the interval holds the true value; and whether the type's effect is said of the type, and of no
  vehicle.

The final answer over all drives is measured beside it.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import secrets
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from . import effects, seal, sensors
from .cases import CannotDraw, Set, combined, draw_conditions, start_and_drive
from .vehicles import CARS, ROOT, Design, build, write_file

#: Shares of a tolerance's variance: of the type, of the vehicle, of the drive.
STAYS = (0.3, 0.7, 0.0)
OF_THE_DAY = (0.0, 0.0, 1.0)
SHARES = {
    **dict.fromkeys(("road_bank", "road_grade", "wind_x", "wind_y"), OF_THE_DAY),
    "road_friction": (0.0, 0.4, 0.6),  # tyres' age; wet and dry
    "mass": (0.2, 0.5, 0.3),  # equipment; fuel and people
    **dict.fromkeys(
        ("tyre_stiffness_front", "tyre_stiffness_rear", "tyre_relaxation"), (0.3, 0.4, 0.3)
    ),  # pressure, warmth
    **dict.fromkeys(("yaw_rate_bias", "lateral_accel_bias", "ax_bias", "roll_bias"), (0.0, 0.6, 0.4)),  # warm sensors
}
CHANGES = ("payload", "tyre_stiffness_front", "tyre_stiffness_rear", "steer_offset", "steer_delay", "yaw_rate_bias",
           "speed_scale", "lateral_accel_bias")  # fmt: skip
COMMON = ("drag", "steer_gain", "drive_gain", "roll_stiffness", "steer_lag")
CHANGED = 0.2
LENGTH = 15.0  # s
TRIES = 30


def tolerances(rng: np.random.Generator, level: int) -> dict[str, float]:
    """Differences at a level: 0 the type, 1 the vehicle, 2 the drive; none beyond two deviations."""
    return {
        name: float(np.clip(rng.normal(), -2.0, 2.0)) * tolerance * math.sqrt(SHARES.get(name, STAYS)[level])
        for name, tolerance in effects.TOLERANCES.items()
    }


def background(levels: list[dict[str, float]]) -> dict[str, float]:
    """Tolerances of all levels together, as the vehicles take them."""
    found = {}
    for name in effects.TOLERANCES:
        total = sum(level[name] for level in levels)
        total = abs(total) if name in effects.POSITIVE else total
        found[name] = total + (1.0 if name in effects.FACTORS else 0.0)
    return found


class Fleet:
    """A fleet, by its seed."""

    def __init__(self, seed: int, development: bool, vehicles: int, drives: int) -> None:
        self.seed, self.development, self.vehicles, self.drives = seed, development, vehicles, drives

    def rng(self, *of: int) -> np.random.Generator:
        return np.random.default_rng([7 + int(self.development), self.seed, *of])

    def designs(self) -> list[Design]:
        return Set(self.seed, self.development, 1, trucks=False).designs()

    def common(self) -> tuple[int, str, dict[str, float]]:
        """The type with an effect that all its vehicles have, and the effect."""
        rng = self.rng(1)
        effect = COMMON[rng.integers(len(COMMON))]
        return int(rng.integers(len(CARS))), effect, effects.draw(rng, effect, False)

    def label(self, vehicle: int) -> dict:
        """What is sealed of a vehicle."""
        rng = self.rng(2, vehicle)
        kind = vehicle % len(CARS)
        label = {"vehicle": name_of(vehicle), "type": kind, "effect": None}
        # Evenly spread, so that a small fleet has them too.
        order = self.rng(3).permutation(self.vehicles)
        place = int(np.flatnonzero(order == vehicle)[0])
        changed = round(CHANGED * self.vehicles)
        if place < changed:
            effect = CHANGES[place % len(CHANGES)]
            values = effects.draw(rng, effect, False)
            last = max(self.drives - 3, 4)
            label |= {"effect": effect, "values": values, "since": int(rng.integers(3, last))}
        return label

    def make(self, vehicle: int, out: Path) -> None:
        """Drives a vehicle, and writes its logs."""
        kind = vehicle % len(CARS)
        design = self.designs()[kind]
        label, (common_kind, _, common) = self.label(vehicle), self.common()
        of_type, own = tolerances(self.rng(4, kind), 0), tolerances(self.rng(5, vehicle), 1)
        suite = sensors.draw(self.rng(6, vehicle), False)
        folder = out / "logs" / name_of(vehicle)
        folder.mkdir(parents=True, exist_ok=True)
        for drive in range(self.drives):
            values = dict(common) if kind == common_kind else {}
            if label["effect"] and drive >= label["since"]:
                values = values | label["values"]
            for attempt in range(TRIES):
                rng = self.rng(8, vehicle, drive, attempt)
                whole = combined(background([of_type, own, tolerances(rng, 2)]), values)
                conditions = draw_conditions(rng, design, suite, LENGTH)
                truth = start_and_drive(build(design, whole), conditions)
                if truth.arrived:
                    break
            else:
                raise CannotDraw(f"{name_of(vehicle)}, drive {drive + 1}: no drive stays on its road in {TRIES} tries")
            log = sensors.log(truth, whole, replace(suite, seed=suite.seed + drive))
            sensors.write(log, folder / f"drive_{drive + 1:03d}.csv.gz")


def name_of(vehicle: int) -> str:
    return f"car_{vehicle + 1:03d}"


def _made(job: tuple[Fleet, int, Path]) -> None:
    fleet, vehicle, out = job
    fleet.make(vehicle, out)


def make(fleet: Fleet, out: Path, jobs: int, say) -> list[dict]:
    """Makes logs, vehicle files and the manifest; gives the labels."""
    for kind, design in enumerate(fleet.designs()):
        write_file(design, out / f"type_{kind}").rename(out / f"type_{kind}" / "vehicle.toml")
    with ProcessPoolExecutor(jobs) as pool:
        for done, _ in enumerate(pool.map(_made, [(fleet, v, out) for v in range(fleet.vehicles)]), 1):
            if done % 10 == 0:
                say(f"{done} of {fleet.vehicles} vehicles driven")
    with open(out / "manifest.csv", "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["log", "vehicle", "time", "vehicle_file"])
        for vehicle in range(fleet.vehicles):
            for drive in range(fleet.drives):
                log = f"logs/{name_of(vehicle)}/drive_{drive + 1:03d}.csv.gz"
                writer.writerow([log, name_of(vehicle), drive + 1, f"type_{vehicle % len(CARS)}/vehicle.toml"])
    return [fleet.label(vehicle) for vehicle in range(fleet.vehicles)]


def is_right(label: dict, change, drives: int) -> bool:
    """Whether a change is the one that a vehicle has within so many drives."""
    return (
        label["effect"] == change.effect
        and drives > label["since"]
        and change.earliest <= label["since"] <= change.latest
    )


def measure(labels: list[dict], out: Path, common: tuple[int, str, dict[str, float]], say) -> dict:
    """Measures the answers of `rfl fleet` on its own tables, as if it had been run after each drive."""
    from rfl_mpc.fleet import reduce, tables
    from rfl_mpc.fleet.changes import Vehicle
    from rfl_mpc.fleet.summary import drives_of

    types = tables.summaries(out / "fleet" / "verdicts.parquet")
    label_of = {label["vehicle"]: label for label in labels}
    states, found = [], {}
    for type, summaries in sorted(types.items()):
        state = reduce.reduce_type(type, sorted(summaries), summaries.__getitem__)
        states.append(state)
        for done, name in enumerate(sorted(summaries), 1):
            own = summaries[name]
            vehicle = Vehicle(drives_of(own, state.parameters), state.spread, state.rates)
            for count in range(1, len(own) + 1):
                found[count, name] = [it for it in vehicle.changes(count).changes if not it.passing]
            if done % 10 == 0:
                say(f"{Path(type).parent.name}: {done} of {len(summaries)} vehicles judged drive by drive")
    right: dict[str, int] = {}
    alarms: set[tuple[str, str, int]] = set()
    for count in range(1, max(count for count, _ in found) + 1):
        all = sorted(
            ((-change.probability, name, change) for (at, name), of in found.items() if at == count for change in of),
            key=lambda it: it[:2],
        )
        for _, name, change in all[: reduce.held([-it[0] for it in all])]:
            label = label_of[name]
            if is_right(label, change, count):
                right.setdefault(name, count)
            elif not (label["effect"] in change.also and count > label["since"]):
                alarms.add((name, change.effect, change.since))
    rows = [
        {"vehicle": label["vehicle"], "effect": label["effect"], "values": label["values"], "since": label["since"],
         "late": None if label["vehicle"] not in right else right[label["vehicle"]] - label["since"]}
        for label in labels if label["effect"]
    ]  # fmt: skip
    reduce.say(states)
    final = {"right": 0, "wrong": 0, "held": 0, "missed": []}
    for state in states:
        for one in state.vehicles:
            label = label_of[one.vehicle]
            said = [change for change, is_said in zip(one.changes, one.said) if is_said and not change.passing]
            hits = [change for change in said if is_right(label, change, one.drives)]
            final["right"] += bool(hits)
            final["wrong"] += len(said) - len(hits)
            if hits:
                final["held"] += bool(hits[0].low <= label["values"][label["effect"]] <= hits[0].high)
            elif label["effect"]:
                final["missed"].append(one.vehicle)
    drives = sum(len(of) for summaries in types.values() for of in summaries.values())
    return {
        "drives": drives, "vehicles": len(labels), "changed": len(rows),
        "named_within_3": sum(1 for row in rows if row["late"] is not None and row["late"] <= 3),
        "named": len(right), "false_alarms": len(alarms),
        "false_alarms_per_1000": 1000.0 * len(alarms) / max(drives, 1),
        "final": final, "rows": rows,
        "false": [{"vehicle": name, "effect": effect, "since": since} for name, effect, since in sorted(alarms)],
        "common_truth": {"type": common[0], "effect": common[1], "values": common[2]},
        "types": [
            {"type": it.type, "common": [vars(one) for one in it.common], "rates": vars(it.rates)} for it in states
        ],
    }  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(
        prog="blind/fleet", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--vehicles", type=int, default=200)
    parser.add_argument("--drives", type=int, default=50)
    parser.add_argument("--seed", type=int, help="the fleet's seed (default: secret)")
    parser.add_argument("--development", action="store_true", help="other designs; not recorded")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "blind" / "fleet")
    parser.add_argument("--again", action="store_true", help="measure once more what lies in --out (development only)")
    options = parser.parse_args(arguments)

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    out = options.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    kept = out / "fleet.seed"  # of a development fleet only
    seed = options.seed if options.seed is not None else secrets.randbits(64)
    if options.again:
        if not kept.exists():
            parser.error(f"{out} holds no development fleet")
        seed = int(kept.read_text())
    fleet = Fleet(seed, options.development, options.vehicles, options.drives)
    begin = time.perf_counter()
    if not options.again:
        labels = make(fleet, out, options.jobs, say)
        if options.development:
            kept.write_text(str(seed))
        salt = secrets.token_bytes(16)
        sealed = seal.close(labels, seed, salt, out / "labels.sealed")
        say(f"before the diagnosis: labels {sealed}, generator {seal.hash_of_sources(ROOT / 'blind')}")
    made = time.perf_counter() - begin
    command = [sys.executable, "-m", "rfl_mpc", "fleet", str(out / "manifest.csv"), "--out", str(out / "fleet")]
    command += ["--workers", str(options.jobs)]
    begin = time.perf_counter()
    status = subprocess.run(command, check=False).returncode
    if status not in (0, 3):
        return status
    took = time.perf_counter() - begin
    labels = [fleet.label(vehicle) for vehicle in range(fleet.vehicles)]
    result = measure(labels, out, fleet.common(), say) | {"made_seconds": made, "diagnosed_seconds": took}
    result["seed"] = seed
    (out / "score.json").write_text(json.dumps(result, indent=1, default=float) + "\n", encoding="utf-8")
    shown = {key: value for key, value in result.items() if key not in ("rows", "false", "types")}
    print(json.dumps(shown, indent=1, default=float))
    for row in result["rows"]:
        print(row["vehicle"], row["effect"], row["values"], "late:", row["late"])
    for row in result["false"]:
        print("false:", row)
    for row in result["types"]:
        print(row["type"], [(one["effect"], one["value"], one["probability"]) for one in row["common"]])
    return 0


if __name__ == "__main__":
    sys.exit(main())
