"""What a diagnosis is worth elsewhere: the gap on another route, before and after, with open and with closed loop.

The blind vehicle (with its effect) is driven along a road that no log has shown. Open loop: its commands go through the
simulator. Closed loop: the same driver drives the simulator along the same road. The gap is the RMS difference in yaw
rate, or in lateral offset by place on the road. Simulators: as given; with the named effect alone; calibrated; with
the runner-up alone; an oracle with the true effect and the true tolerances. Beside them the gap between blind vehicle
and simulator of the same design, without effects and tolerances: what the other formulation alone makes of the same
numbers, and no diagnosis can close.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from . import effects, measures, plant
from .cases import Set, combined, draw_conditions, start_and_drive, vehicle_of
from .drive import SIGNALS
from .make import folder_of
from .sensors import Suite
from .vehicles import build

SIMULATORS = ("effect", "calibrated", "runner_up", "oracle", "formulation")

DURATION = 45.0  # s


def measure(cases: Set, labels: list[dict], reports: list[dict], out: Path, most: int, say=lambda text: None) -> dict:
    """Median share of the gap that is closed, over cases whose effects the verdict named (in class).

    Effects of sensors alone are left out: they move nothing.
    """
    rows = []
    for label, report in zip(labels, reports):
        if len(rows) >= most:
            break
        named = label["kind"] in ("single", "pair") and measures.in_class(label, report)
        if named and any(measures.STAGE_OF[cause] != "sensor" for cause in label["causes"]):
            try:
                row = _one(cases, label, report, folder_of(out, label["case"]))
            except Exception as error:  # what a simulator cannot drive is said, not hidden
                say(f"case {label['case']}, another route: {error}")
                continue
            if row:
                rows.append({"case": label["case"]} | row)
                say(f"case {label['case']}, another route: {row}")
    found: dict = {"cases": len(rows), "rows": rows}
    for key in ("open_loop", "closed_loop"):
        for who in SIMULATORS:
            shares = [1.0 - row[key][who] / row[key]["given"] for row in rows if row[key].get(who) is not None]
            found[f"{key}_{who}"] = measures.median(shares)
    return found


def _one(cases: Set, label: dict, report: dict, folder: Path) -> dict | None:
    design = vehicle_of(cases.designs(), label["vehicle"])
    rng = cases.rng(4, label["case"])
    suite = Suite(100, 1.0, 40.0, 0.0, (), 0)
    conditions = draw_conditions(rng, design, suite, DURATION)
    whole = combined(label["background"], label["values"])
    truth = start_and_drive(build(design, whole), conditions)
    # Only what moves the vehicle: sensors and reference points are not looked at here.
    bare = start_and_drive(build(design, {}), conditions)
    if not (truth.arrived and bare.arrived):
        return None
    verdict: dict[str, float] = {}
    for effect in report["verdict"]["effects"]:
        verdict |= {effect["id"]: effect["value"]} | effect.get("components", {})
    given = folder / "vehicle.toml"
    simulators: dict[str, tuple[Path, dict[str, float]]] = {"given": (given, {}), "effect": (given, verdict)}
    calibrated = folder / "answer" / "calibrated.toml"
    if calibrated.exists():
        simulators["calibrated"] = (calibrated, {})
    others = [c for c in report["candidates"] if not set(c["effects"]) & set(verdict)]
    if others:
        simulators["runner_up"] = (given, dict(zip(others[0]["effects"], others[0]["values"])))
    simulators["oracle"] = (given, oracle(design, label))
    # A sensor's error is no error of the simulator's motion: the truth here is the motion itself, and so is the
    # simulator's.
    sensors = {
        name: effects.OF[name].neutral for name in measures.STAGES["sensor"] if name in effects.ids(design.is_truck)
    }
    rows: dict = {"open_loop": {}, "closed_loop": {}}
    runs = [(who, truth, vehicle, told) for who, (vehicle, told) in simulators.items()]
    for who, real, vehicle, told in [*runs, ("formulation", bare, given, {})]:
        values = {name: value for name, value in told.items() if name not in sensors} | sensors
        replayed = plant.run(vehicle, design.is_truck, conditions, values, (real.steer_cmd, real.accel_cmd))
        rate = real.signals[:: round(conditions.sample / real.h), SIGNALS.index("yaw_rate")]
        rows["open_loop"][who] = float(np.sqrt(np.mean((replayed["yaw_rate"] - rate) ** 2)))
        driven = plant.run(vehicle, design.is_truck, conditions, values)
        rows["closed_loop"][who] = _offset_gap(real.station, real.offset, driven["station"], driven["offset"])
    if rows["closed_loop"]["given"] is None:
        return None
    return rows


def oracle(design, label: dict) -> dict[str, float]:
    """Effects of the simulator that are the truth, tolerances included, as far as effects can say them."""
    values = combined(label["background"], label["values"])
    found = {}
    for name in effects.ids(design.is_truck):
        if name == "tyre_relaxation":
            found[name] = values.get("relaxation", design.p["relaxation"] * values.get("tyre_relaxation", 1.0))
        elif name in values:
            found[name] = values[name]
    if "payload_x" in values:
        found["payload_x"] = values["payload_x"]
    for name in ("steer_delay", "steer_lag", "drive_lag"):  # less than nothing is no effect
        found[name] = max(found.get(name, 0.0), 0.0)
    return found


def _offset_gap(station, offset, other_station, other_offset) -> float | None:
    """RMS difference of two lateral offsets over the stations that both have driven, m."""
    end = min(station.max(), other_station.max())
    if end < 50.0:
        return None
    places = np.arange(10.0, end, 1.0)

    def at(s, e):
        s, first = np.unique(np.maximum.accumulate(s), return_index=True)
        return np.interp(places, s, e[first])

    return float(np.sqrt(np.mean((at(station, offset) - at(other_station, other_offset)) ** 2)))
