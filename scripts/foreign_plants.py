#!/usr/bin/env python3
"""Drives plants that others wrote with RflMpc.fmu in Python: what the default controller stands on vehicles not ours.

    scripts/foreign_plants.py                    all drives, into out/robustness/foreign.json; some minutes
    scripts/foreign_plants.py --only suv-03      one drive again, its log beside the results

Plants: CommonRoad's multi-body cars (`multi_body_car.py`), and the tanh bicycle of
`../shared/cases/controller/suv_plant.py`, where that folder is there. The controller knows their vehicle files, for the
bicycle `suv.toml` with the C-class car's tyres. Each drive has a random road, and a steering of its own: lag 0 to
0.2 s, dead time 0 to 0.12 s in whole samples. It is driven twice: by the default controller (`default`), and by one
that is given this lag and dead time as `actuator.*` (`told`).

Written by `scripts/reproduce robustness`, which makes docs/results/robustness.md of it.
"""

from __future__ import annotations

import argparse
import json
import random
import runpy
import shutil
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import plant
from closed_loop import FMUS, STEP
from multi_body_car import CARS, Actuator, MultiBodyCar
from outcome import COMPLETED, tracking, write_whole
from tqdm import tqdm

ROOT = Path(__file__).resolve().parent.parent
SUV = ROOT.parent / "shared" / "cases" / "controller"
# Roads and steering of the examination; no search has had them.
FIRST_ROAD, SEED = 930_001, 20_370_002
DRIVES = 16  # of each plant, half of them at each lateral acceleration
ACCELS = (2.25, 4.0)  # m/s2
LONGEST_LAG, LONGEST_DEAD_TIME = 0.2, 6  # s, samples
SHORTEST_LAG = 0.005  # s, of a fast servo: the multi-body car's steering has to follow by some law
SETTLED = 20.0  # s: by then the controller is to know its actuator


@dataclass(frozen=True)
class Case:
    """A drive to make."""

    id: str
    plant: str
    vehicle: str
    road: Path
    actuator: Actuator
    accel: float
    row: str

    def make(self):
        """What makes the plant at a pose and a speed."""
        if self.plant != "suv":
            return partial(MultiBodyCar, self.actuator, car=self.plant)
        return partial(suv, self.actuator)

    def settings(self) -> dict[str, object]:
        """Parameters of the controller."""
        settings: dict[str, object] = {"speed.lateral_accel": self.accel}
        if self.row == "told":
            settings["actuator.time_constant"] = self.actuator.lag
            settings["actuator.dead_time"] = self.actuator.delay * STEP
        return settings


def suv(actuator: Actuator, x: float, y: float, yaw: float, speed: float):
    """The tanh bicycle with a steering of ours."""
    kind = runpy.run_path(str(SUV / "suv_plant.py"))["Suv"]
    kind.lag, kind.delay = actuator.lag, actuator.delay * STEP
    return kind(x, y, yaw, speed)


def cases(out: Path, rfl: Path, count: int) -> list[Case]:
    """All drives; their roads are written."""
    vehicles = {name: name for name in CARS} | {"suv": suv_vehicle(out / "suv") if SUV.is_dir() else None}
    if not SUV.is_dir():
        print(f"left out: {SUV} is absent", file=sys.stderr)
    draw = random.Random(SEED)
    found = []
    for number in range(count):
        road = out / "roads" / f"random_{FIRST_ROAD + number}.csv"
        road.parent.mkdir(parents=True, exist_ok=True)
        words = ["course", "--random", "car", "--seed", FIRST_ROAD + number, "--out", road]
        words += ["--closed"] if number // 2 % 2 else []
        subprocess.run([str(rfl), *map(str, words)], check=True, stdout=subprocess.DEVNULL)
        for name, vehicle in vehicles.items():
            # Drawn for a plant that is absent, too: the others' steering is the same everywhere.
            lag = max(round(draw.uniform(0.0, LONGEST_LAG), 3), SHORTEST_LAG)
            actuator = Actuator(lag, draw.randint(0, LONGEST_DEAD_TIME))
            if vehicle is None:
                continue
            accel = ACCELS[number % len(ACCELS)]
            found += [
                Case(f"{name}-{number:02}", name, str(vehicle), road, actuator, accel, row)
                for row in ("default", "told")
            ]
    return found


def suv_vehicle(folder: Path) -> Path:
    """The vehicle file of the tanh bicycle, with the tyres that it asks for."""
    (folder / "tyres").mkdir(parents=True, exist_ok=True)
    shutil.copy(ROOT / "vehicles" / "tyres" / "c_class.tir", folder / "tyres")
    return Path(shutil.copy(SUV / "suv.toml", folder))


def make(job: tuple[Case, Path, Path | None]) -> dict:
    """A drive, and its figures."""
    case, fmus, log = job
    driven = plant.drive(case.road, case.vehicle, case.make(), case.settings(), fmus=fmus)
    if log is not None:
        driven.write_csv(log)
    figures = tracking(driven.columns)
    late = np.abs(driven.columns["e1"][driven.columns["time"] >= SETTLED])
    return {
        "id": case.id,
        "plant": case.plant,
        "row": case.row,
        "road": case.road.stem,
        "lag": case.actuator.lag,
        "dead_time": round(case.actuator.delay * STEP, 3),
        "lateral_accel": case.accel,
        "outcome": driven.outcome,
        "reason": driven.ending.reason,
        "max": figures["max"],
        "mean": figures["mae"],
        "max_after_20_s": float(late.max()) if late.size else None,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "robustness", help="folder for results")
    parser.add_argument("--fmus", type=Path, default=FMUS, help="folder of the FMUs (default: %(default)s)")
    parser.add_argument("--rfl", type=Path, default=ROOT / "target" / "release" / "rfl", help="the program")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: %(default)s)")
    parser.add_argument("--quick", action="store_true", help="two drives of each plant")
    parser.add_argument("--only", metavar="NAME", help="one drive, by its name")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    wanted = cases(options.out, options.rfl, 2 if options.quick else DRIVES)
    if options.only:
        wanted = [case for case in wanted if case.id == options.only]
        if not wanted:
            print(f"foreign_plants: no drive '{options.only}'; names are such as bmw_320i-03", file=sys.stderr)
            return 2
    log = (lambda case: options.out / f"{case.id}_{case.row}.csv") if options.only else (lambda case: None)
    jobs = [(case, options.fmus.resolve(), log(case)) for case in wanted]
    with ProcessPoolExecutor(options.jobs) as pool:
        drives = list(tqdm(pool.map(make, jobs), total=len(jobs), desc="foreign plants", unit="drive"))
    if options.only:
        print(json.dumps(drives, indent=2))
        return 0
    result = {"roads": {"first": FIRST_ROAD, "count": DRIVES}, "seed": SEED, "drives": drives}
    write_whole(options.out / "foreign.json", json.dumps(result, indent=2) + "\n")
    done = sum(drive["outcome"] == COMPLETED for drive in drives)
    print(
        f"{done} of {len(drives)} completed, max {max(d['max'] for d in drives):.3f} m; {options.out / 'foreign.json'}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
