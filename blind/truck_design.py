"""The blind truck's design, the units built of it, and the vehicle file that an honest user would have of it.

Masses, lengths and actuators are drawn about those of `vehicles/truck_simulation.toml`; what the file holds and the
blind truck has not (springs of wheels and hitch, pitch) is that file's.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import tomllib

from .drive import TRUCK
from .truck import FNOMIN, GRAVITY
from .vehicles import ROOT, Design, Unit, chained, plain_chain, surroundings

TEMPLATE = ROOT / "vehicles" / "truck_simulation.toml"
# Stiffness factor of the project's truck tyre, per radian of the load: 8 sin(2 atan(load / (2.5 FNOMIN))) FNOMIN /
# load.
SLOPE, FALL = -8.0, 2.5
SOFTER = 1.06


def stiffness_per_load(load: float) -> float:
    """Cornering stiffness over load of the tyre file at a load in N, 1/rad."""
    return -SLOPE * FNOMIN / load * math.sin(2.0 * math.atan(load / (FALL * FNOMIN)))


def design(rng: np.random.Generator | None) -> Design:
    """A truck, varied at random; that of the file without `rng`."""
    t = tomllib.loads(TEMPLATE.read_text(encoding="utf-8"))

    def about(value: float, spread: float) -> float:
        return value if rng is None else value * rng.uniform(1.0 - spread, 1.0 + spread)

    tractor, trailer, hitch, axle, tyre = t["tractor"], t["trailer"], t["hitch"], t["axle"], t["tyre"]
    p = {
        "m1": about(tractor["mass"], 0.06), "iz1": about(tractor["yaw_inertia"], 0.08), "ix1": tractor["roll_inertia"],
        "h1": tractor["cg_height"], "a": about(tractor["cg_to_front_axle"], 0.05),
        "b": about(tractor["cg_to_rear_axle"], 0.05),
        "mu1": axle["front"]["unsprung_mass"] +
        axle["rear"]["unsprung_mass"], "m2": about(trailer["mass"], 0.3), "ix2": trailer["roll_inertia"], "h2":
        about(trailer["cg_height"], 0.05), "mu2": axle["trailer"]["unsprung_mass"], "hx": about(hitch["cg_to_hitch"],
        0.1), "lx": about(trailer["cg_to_hitch"], 0.05), "dx": about(trailer["cg_to_axle"], 0.05), "hitch_h":
        hitch["height"], "hitch_roll": hitch["roll_stiffness"], "hitch_roll_d": hitch["roll_damping"],
        "hitch_friction": 800.0, "max_force": t["drive"]["max_force"], "max_power": t["drive"]["max_power"],
        "max_brake": t["brake"]["max_force"], "brake_f": t["brake"]["front_share"], "brake_t":
        t["brake"]["trailer_share"], "rolling": 0.006, "yaw_moment": 0.0, "relaxation": about(0.35, 0.15), "drag": 0.6
        * about(t["air"]["drag_area"], 0.1), "side1": 0.6 * about(t["air"]["tractor_side_area"], 0.1), "side2": 0.6 *
        about(t["air"]["trailer_side_area"], 0.1), "x1": t["air"]["tractor_pressure_centre"], "x2":
        t["air"]["trailer_pressure_centre"],
    }  # fmt: skip
    p["iz2"] = trailer["yaw_inertia"] * p["m2"] / trailer["mass"]
    p["drive_mass"] = p["m1"] + p["m2"]
    vertical = 950e3
    for key, which in (("f", "front"), ("r", "rear"), ("t", "trailer")):
        one, count = axle[which], t["tyres_per_side"][which]
        p["n_" + key], p["t" + key], p["centre_" + key] = count, one["track"], one["roll_centre_height"]
        springs = 0.5 * one["spring_rate"] * one["track"] ** 2 + one["anti_roll_bar"]
        tyres = 0.5 * vertical * count * one["track"] ** 2
        # Springs, and tyres in series; the damper sees the springs' share only.
        p["springs_" + key], p["tyres_" + key] = springs, tyres
        _in_series(p, key, springs, tyres)
        p["d" + key] = 0.5 * one["damping"] * one["track"] ** 2 * (tyres / (springs + tyres)) ** 2
        p["stiff_" + key] = about(tyre[which]["stiffness_scale"], 0.08)
    p["added"] = sum(2.0 * axle[which]["wheel_inertia"] for which in axle) / 0.53**2
    pitch = 2.0 * (axle["front"]["spring_rate"] * p["a"] ** 2 + axle["rear"]["spring_rate"] * p["b"] ** 2)
    p["pitch_k"] = p["m1"] * (p["h1"] - 0.4) / pitch
    # Stiffness over load falls with load: through the file's tyre at 15 and 30 kN.
    low, high = stiffness_per_load(15000.0), stiffness_per_load(30000.0)
    p["c1"] = (low - high) / 0.75
    p["c0"] = low + p["c1"] * 0.75
    # A brush softens from the first slip on: its slope at nothing is such that a fifth of the grip gives the file's.
    p["c0"], p["c1"] = SOFTER * p["c0"], SOFTER * p["c1"]
    p["mu0"], p["mu1t"] = 0.80, 0.08
    p["base"] = p["a"] + p["b"]
    p["understeer"] = _understeer(p)
    chain = plain_chain() | {"angle_limit": 0.7, "rate_limit": 0.6, "drive_lag": about(0.2, 0.2)}
    if rng is not None:
        chain |= {"dead_time": 0.004 * rng.integers(8, 15), "lag": rng.uniform(0.08, 0.15)}
    return Design("truck", TRUCK, p, chain)


def _in_series(p: dict[str, float], key: str, springs: float, tyres: float) -> None:
    """Roll stiffness of an axle and height of the axis about which the body rolls on it.

    With side force F at the roll centre r and moment M in the springs, body and axle roll by M / springs + (M + F r) /
    tyres: that of a body on one spring about an axis at r tyres / (springs + tyres).
    """
    p["k" + key] = springs * tyres / (springs + tyres)
    p["r" + key] = p["centre_" + key] * tyres / (springs + tyres)


def _understeer(p: dict[str, float]) -> float:
    """Understeer at rest loads, rad s2/m."""
    pin = p["m2"] * p["dx"] / (p["lx"] + p["dx"])
    front = (p["m1"] * p["b"] + pin * (p["b"] - p["hx"])) / p["base"]
    rear = p["m1"] + pin - front
    slopes = [
        p["stiff_" + key] * stiffness_per_load(mass * GRAVITY / (2.0 * p["n_" + key])) * GRAVITY
        for key, mass in (("f", front), ("r", rear))
    ]
    return 1.0 / slopes[0] - 1.0 / slopes[1]


def build(design: Design, values: dict[str, float]) -> Unit:
    """A truck with tolerances and effects."""
    p, of = dict(design.p), values.get
    p["m1"] *= of("mass", 1.0)
    p["m2"] *= of("trailer_mass", 1.0)
    p["iz1"] *= of("yaw_inertia", 1.0)
    p["iz2"] *= of("trailer_yaw_inertia", 1.0)
    p["h1"] *= of("cg_height", 1.0)
    for key in "frt":
        springs, tyres = p["springs_" + key] * of("roll_stiffness", 1.0), p["tyres_" + key]
        springs *= of("spring_front", 1.0) if key == "f" else 1.0
        _in_series(p, key, springs, tyres)
    shift, load = of("cg_shift", 0.0), of("payload", 0.0)
    if load > 0.0:
        place = of("payload_x", 0.0)
        move = load * place / (p["m1"] + load)
        p["iz1"] += p["m1"] * move**2 + load * (place - move) ** 2
        p["m1"] += load
        shift += move
    p["a"], p["b"], p["hx"] = p["a"] - shift, p["b"] + shift, p["hx"] + shift - of("hitch_offset", 0.0)
    p["x1"] -= shift
    p["m2"] += of("trailer_payload", 0.0)
    p["stiff_f"] *= of("tyre_stiffness_front", 1.0)
    p["stiff_r"] *= of("tyre_stiffness_rear", 1.0)
    p["stiff_t"] *= of("trailer_stiffness", 1.0)
    p["relaxation"] = of("relaxation", p["relaxation"] * of("tyre_relaxation", 1.0))
    p["drag"] *= of("drag", 1.0)
    p["yaw_moment"] += of("brake_pull", 0.0)
    p["hitch_friction"] += of("articulation_friction", 0.0)
    return Unit(design, p, chained(design, values), surroundings(values), -shift)


def _toml(table: dict, name: str = "") -> str:
    """A table of tables of numbers and texts as TOML."""
    lines, tables = [], []
    for key, value in table.items():
        if isinstance(value, dict):
            tables.append(_toml(value, f"{name}.{key}" if name else key))
        else:
            lines.append(f"{key} = {float(value)!r}" if not isinstance(value, str) else f'{key} = "{value}"')
    head = f"[{name}]\n" if name and lines else ""
    return head + "\n".join(lines) + ("\n\n" if lines else "") + "".join(tables)


def write_file(design: Design, folder: Path) -> Path:
    """Writes the vehicle file with its tyre file, and gives its place."""
    p, chain = design.p, design.chain
    t = tomllib.loads(TEMPLATE.read_text(encoding="utf-8"))
    t["name"], t["source"] = design.name, "made by blind/truck_design.py from the design of a blind vehicle"
    t["tractor"] |= {"mass": p["m1"], "yaw_inertia": p["iz1"], "cg_to_front_axle": p["a"], "cg_to_rear_axle": p["b"]}
    t["trailer"] |= {"mass": p["m2"], "yaw_inertia": p["iz2"], "cg_to_hitch": p["lx"], "cg_to_axle": p["dx"]}
    t["trailer"]["cg_height"] = p["h2"]
    t["hitch"] |= {"cg_to_hitch": p["hx"], "friction": p["hitch_friction"]}
    for key, which in (("f", "front"), ("r", "rear"), ("t", "trailer")):
        t["tyre"][which] = {"file": "truck.tir", "stiffness_scale": p["stiff_" + key]}
    t["steering"] |= {"dead_time": chain["dead_time"], "lag": chain["lag"]}
    t["drive"]["lag"] = chain["drive_lag"]
    t["air"] |= {
        "drag_area": p["drag"] / 0.6,
        "tractor_side_area": p["side1"] / 0.6,
        "trailer_side_area": p["side2"] / 0.6,
    }
    tyre = (ROOT / "vehicles" / "tyres" / "truck.tir").read_text(encoding="utf-8")
    tyre = tyre.replace("PTY1 = 0.67", f"PTY1 = {0.67 * p['relaxation'] / 0.35:.5f}")
    (folder / "truck.tir").write_text(tyre, encoding="utf-8")
    place = folder / "truck.toml"
    place.write_text(_toml({k: t[k] for k in sorted(t, key=lambda k: isinstance(t[k], dict))}), encoding="utf-8")
    return place
