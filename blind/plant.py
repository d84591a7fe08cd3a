"""The diagnosis' own simulator, as any FMI host has it: the plant FMUs, on recorded commands or with a driver."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np

from .cases import Conditions
from .drive import LOST, hands, locate
from .road import SPACING
from .vehicles import ROOT

sys.path.insert(0, str(ROOT / "scripts"))
FMUS = ROOT / "target" / "fmu"
SIGNALS = ("x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay", "roll", "steer")
OF_TRUCKS = ("articulation", "articulation_rate")


def _drive(
    vehicle: Path,
    is_truck: bool,
    start: dict[str, float],
    effects: dict[str, float],
    sample: float,
    samples: int,
    command: Callable[[int, list[float]], tuple[float, float] | None],
) -> dict[str, np.ndarray]:
    """Signals at each sample; `command` gives steering and acceleration by number and signals, or ends the drive."""
    from closed_loop import Unit  # the project's co-simulation master

    names, rows = SIGNALS + (OF_TRUCKS if is_truck else ()), []
    with closing(Unit(FMUS / ("SemiTrailerTruck.fmu" if is_truck else "PassengerCar.fmu"), "plant")) as plant:
        plant.set("vehicle_file", str(vehicle.resolve()))
        for name, value in effects.items():
            plant.set(f"effect.{name}", float(value))
        for name, value in start.items():
            plant.set(f"initial.{name}", float(value))
        plant.initialize()
        read, write = plant.reader(list(names)), plant.writer(["steer_cmd", "accel_cmd"])
        for k in range(samples):
            rows.append(read().tolist())
            asked = command(k, rows[-1])
            if asked is None:
                break
            write(asked)
            plant.step(k * sample, sample)
    return dict(zip(names, np.array(rows).T))


def replay(
    vehicle: Path, is_truck: bool, start: dict[str, float], sample: float, steer, accel, effects=None
) -> dict[str, np.ndarray]:
    """Signals of the simulator under recorded commands, one every `sample` s."""
    return _drive(
        vehicle, is_truck, start, effects or {}, sample, len(steer), lambda k, _: (float(steer[k]), float(accel[k]))
    )


def run(
    vehicle: Path, is_truck: bool, conditions: Conditions, effects: dict[str, float] | None = None, commands=None
) -> dict[str, np.ndarray]:
    """Signals of the simulator on the conditions' road, with `offset` from it and `station` along it.

    With `commands` (steering, acceleration) they are replayed; else the driver drives, and a drive that leaves the road
    ends there.
    """
    road, mind, answer, places = conditions.road.columns(), np.zeros(4), np.zeros(2), []

    def command(k: int, signals: list[float]) -> tuple[float, float] | None:
        x, y, yaw, vx = signals[:4]
        left = locate(mind, x, y, road)
        places.append((left, SPACING * mind[0]))
        if commands:
            return float(commands[0][k]), float(commands[1][k])
        if abs(left) > LOST or vx < 1.0:
            return None
        unrest, jerk = conditions.noise[k]
        hands(mind, left, x, y, yaw, vx, road, conditions.driver, unrest, jerk, conditions.sample, answer)
        return answer[0], answer[1]

    start = {"x": road[0][0], "y": road[1][0], "yaw": road[2][0], "vx": road[3][0]}
    samples = len(commands[0]) if commands else len(conditions.noise)
    found = _drive(vehicle, is_truck, start, effects or {}, conditions.sample, samples, command)
    offset, station = np.array(places).T
    return found | {"offset": offset, "station": station}
