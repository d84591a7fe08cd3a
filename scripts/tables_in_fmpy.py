"""Drives rows of the result tables again in fmpy, through the FMUs: are the errors those of `rfl evaluate`?

For each plant it collects and learns anew with the program, as a user would (the first seed's models), takes each
row's own best weights from the raw results and drives the plant's test road in fmpy. Both loops are the same controller
and vehicle: the largest error must be the same to the last bit, and the mean to 1e-12 of itself, for the two add up in
another order. It needs the program in release and the FMUs (`cargo build --release --bins`, `scripts/build-fmus`).

    scripts/tables_in_fmpy.py --raw out/evaluate_truck --rows MPC,RFL+S+observer,pade_1_1,NMPC,GP-NMPC
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from closed_loop import PROJECT, drive, kind_of

# The plants of `rfl evaluate` (src/simulate/experiment/plant.rs): effects and test road.
PLANTS = {
    "as_is": ({}, "sudoku_test"),
    "lag": ({"steer_lag": 0.1}, "sudoku_test"),
    "lag_and_dead_time": ({"steer_lag": 0.1, "steer_delay": 0.06}, "sudoku_test"),
    "payload_low_friction": ({"payload": 300.0, "payload_x": -0.8, "road_friction": 0.6}, "sudoku_test"),
    "low_delay": ({"steer_delay": 0.04, "steer_lag": 0.05}, "truck_off_road"),
    "high_delay": ({"steer_delay": 0.3, "steer_lag": 0.2}, "truck_test"),
}
VEHICLES = {"car": "c_class", "truck": "truck_simulation"}
# How models of each kind are learned from drives without noise.
RESIDUAL = {"car": [], "truck": ["--prefilter", "0"]}
GP = {"car": [], "truck": ["--points", "100"]}
# Variant of the controller, and how its model is learned.
LEARNED = {
    "RT": ("rt", []),
    "RTL": ("rtl", []),
    "RF": ("rf", []),
    "RFL": ("rfl", []),
    "linear": ("linear", []),
    "linear_curvature": ("linear", ["--road-regressors", "--prefilter", "0"]),
    "RFL+S": ("rfl_s", []),
    "GP-NMPC": ("gp_nmpc", []),
}
DELAYS = {"first_order": "first_order", "pade_1_1": "pade_1_1", "pade_2_2": "pade_2_2", "identified": "exact"}
TOLERANCE = 1e-12


def program(*arguments: object) -> None:
    """Runs a command of the program."""
    command = [str(PROJECT / "target" / "release" / "rfl"), *map(str, arguments)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}\n{result.stdout}{result.stderr}")


def settings(values: dict[str, object]) -> list:
    """Parameters as options of a command."""
    return [text for name, value in values.items() for text in ("--set", f"{name}={value!r}")]


class Plant:
    """A condition of the raw results: its drives to learn from, made once, and what each row drives with."""

    def __init__(self, condition: dict, vehicle: str, folder: Path) -> None:
        self.condition, self.vehicle, self.folder = condition, vehicle, folder
        self.kind = kind_of(vehicle)
        effects, self.road = PLANTS[condition["plant"]]
        self.effects = {f"effect.{name}": value for name, value in effects.items()}
        self.logs: list[Path] = []

    def collected(self) -> list[Path]:
        """The logs of the first seed."""
        if not self.logs:
            # Collecting controllers have no weight on the yaw error's rate.
            values = self.effects | {"mpc.q_e2_rate": 0.0}
            more = settings(values)
            if weaker := self.condition.get("weaker_dithers"):
                more += ["--dither", repr(weaker[0])]
            self.logs = self.round("collect", more)
            # The dither of the second round, 0 where the truck stood none.
            if dither := next(iter(self.condition.get("again_dithers", [])), 0.0):
                model = self.folder / "first_round.rflm"
                self.learn("linear", model, RESIDUAL[self.kind])
                # Dithers of all seeds' drives of the first round come before.
                effort = self.condition["effort"]
                first = 1 + effort["seeds"] * (effort["drives"] + 1)
                more = ["--residual", model, "--seed", first, "--dither", repr(dither)]
                self.logs = self.logs + self.round("again", settings(values) + more)
        return self.logs

    def round(self, name: str, more: list) -> list[Path]:
        """Drives to learn from."""
        runs, out = self.condition["effort"]["drives"], self.folder / name
        program("collect", "--quiet", "--vehicle", self.vehicle, "--runs", runs, "--out", out, *more)
        return [out / f"drive_{run}.csv" for run in range(1, runs + 1)]

    def learn(self, variant: str, model: Path, options: list[str]) -> None:
        """Learns from all logs that there are."""
        known = ["--vehicle", self.vehicle, "--kind", variant, "--out", model]
        program("train", *self.logs, "--quiet", "--force", *known, *options)

    def parameters(self, row: dict) -> dict[str, object]:
        """What the FMUs of a row are told."""
        weights = row["weights"]
        values = self.effects | {f"mpc.{name}": weights[name] for name in ("q_e1_rate", "q_e2", "q_e2_rate", "r_rate")}
        values |= {f"observer.{name}": weights[name] for name in ("disturbance_noise", "prediction_noise")}
        name = row["row"].removesuffix("+observer")
        if name in LEARNED:
            variant, options = LEARNED[name]
            model = self.folder / f"{name}.rflm"
            if not model.exists():
                self.collected()
                self.learn(variant, model, options + (GP if variant == "gp_nmpc" else RESIDUAL)[self.kind])
            return values | {"controller.variant": variant, "controller.residual.file": str(model)}
        if name in DELAYS:
            found = next(found for found in self.condition["identified"] if found["row"] == name)
            return values | actuator(found["dead_time"], found["time_constant"], DELAYS[name])
        if name == "oracle":
            steering = steering_of(self.vehicle)
            delay = steering["dead_time"] + self.effects.get("effect.steer_delay", 0.0)
            lag = steering["lag"] + self.effects.get("effect.steer_lag", 0.0)
            return values | actuator(delay, lag, "exact")
        return values | {"controller.variant": {"MPC": "none", "NMPC": "nmpc"}[name]}

    def drive(self, row: dict, fmus: Path) -> dict[str, float]:
        """Errors of a row in fmpy."""
        road = PROJECT / "paths" / f"{self.road}.csv"
        # The lane of the comparison, `LOST` in src/simulate/experiment/trial.rs.
        driven = drive(road, self.vehicle, settings=self.parameters(row), fmus=fmus, lane=3.5)
        e1 = np.abs(driven.columns["e1"])
        return {"mae": e1.mean(), "rmse": np.sqrt((e1 * e1).mean()), "max": e1.max(), "finished": driven.finished}


def actuator(dead_time: float, time_constant: float, model: str) -> dict[str, object]:
    """The variant that knows a steering actuator."""
    names = {"dead_time": dead_time, "time_constant": time_constant, "dead_time_model": model}
    return {"controller.variant": "actuator"} | {f"actuator.{name}": value for name, value in names.items()}


def steering_of(vehicle: str) -> dict[str, float]:
    """The steering actuator of a vehicle's file."""
    text = (PROJECT / "vehicles" / f"{vehicle}.toml").read_text(encoding="utf-8")
    steering = text.split("[steering]")[1].split("\n[")[0]
    number = r"^\s*{}\s*=\s*([-+.\deE]+)"
    return {key: float(re.search(number.format(key), steering, re.MULTILINE)[1]) for key in ("dead_time", "lag")}


def compare(file: Path, wanted: list[str], fmus: Path) -> bool:
    """Drives rows of one file of results again and prints both errors; whether all are the same."""
    condition = json.loads(file.read_text(encoding="utf-8"))
    vehicle = VEHICLES["truck" if condition.get("articulation_bound") else "car"]
    good = True
    with tempfile.TemporaryDirectory() as folder:
        plant = Plant(condition, vehicle, Path(folder))
        print(f"\n{condition['plant']}: lateral error in mm, natively and in fmpy")
        for row in (row for row in condition["rows"] if not wanted or row["row"] in wanted):
            native = row["own_best"][0]
            if native["lost"]:
                print(f"{row['row']:<20} diverged natively: not driven again")
                continue
            tracking, ours = native["tracking"], plant.drive(row, fmus)
            near = all(abs(ours[key] / tracking[key] - 1.0) <= TOLERANCE for key in ("mae", "rmse"))
            same = near and ours["max"] == tracking["max"] and ours["finished"]
            good &= bool(same)
            both = [f"{key} {1e3 * tracking[key]:9.5f} {1e3 * ours[key]:9.5f}" for key in ("mae", "rmse", "max")]
            verdict = "the same" if same else "NOT THE SAME"
            print(f"{row['row']:<20} {'  '.join(both)}  {verdict}", flush=True)
    return good


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--raw", type=Path, required=True, help="folder of `rfl evaluate`'s results, or one file of it")
    parser.add_argument("--rows", default="", help="rows, separated by commas (default: all)")
    parser.add_argument("--fmus", type=Path, default=PROJECT / "target" / "fmu", help="folder of the FMUs")
    options = parser.parse_args()
    files = [options.raw] if options.raw.is_file() else sorted(options.raw.glob("*.json"))
    # Of drives with sensor noise the host would need the noise.
    files = [file for file in files if file.stem in PLANTS]
    if not files:
        parser.error(f"{options.raw} holds no results of a plant without sensor noise")
    wanted = [name for name in options.rows.split(",") if name]
    return 0 if all([compare(file, wanted, options.fmus) for file in files]) else 1


if __name__ == "__main__":
    sys.exit(main())
