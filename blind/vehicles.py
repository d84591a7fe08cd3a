"""The blind vehicles: their designs, what an honest user's vehicle file says of them, and the effects put into them.

A design is a car of CommonRoad's parameter sets, varied: other masses, tyres, actuators and air in each set of cases.
Its vehicle file is what a user would write who knows the design: masses and geometry as they are, the tyre file of
the project with scales for loads and stiffness. A unit is one built car: the design with tolerances and effects.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import car, truck
from .drive import CAR, CHAIN, STEPS, TRUCK

ROOT = Path(__file__).resolve().parent.parent
CARS = {"ford": 1, "bmw": 2, "vanagon": 3}
# Terms of CommonRoad's tyre that make a car another in left and right turns, or jump where the wheel's lean changes
# sign: no tyre on both sides does that, and no user's tyre file has it.
ONE_SIDED = ("r_hx1", "r_by3", "r_vy1", "p_hy1", "p_vy1", "r_hy1")


@dataclass(frozen=True)
class Design:
    """A vehicle as it was meant to be."""

    name: str
    kind: int
    p: dict[str, float]
    chain: dict[str, float]

    @property
    def is_truck(self) -> bool:
        return self.kind == TRUCK


@dataclass(frozen=True)
class Unit:
    """A built vehicle: what the compiled functions take."""

    design: Design
    p: dict[str, float]
    chain: dict[str, float]
    around: np.ndarray
    #: Of the file's CG, forward of the real one, m.
    arm: float

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        module = _module(self.design.kind)
        return module.array(self.p), np.array([self.chain[name] for name in CHAIN])

    def at_speed(self, x: float, y: float, yaw: float, speed: float) -> np.ndarray:
        return _module(self.design.kind).at_speed(self.p, x, y, yaw, speed)


def _module(kind: int):
    return car if kind == CAR else truck


def plain_chain() -> dict[str, float]:
    """A steering and a drive that do what they are told."""
    neutral = {"rate_limit": 1e6, "gain": 1.0, "angle_limit": 0.6, "drive_gain": 1.0}
    return {name: neutral.get(name, 0.0) for name in CHAIN}


def design_car(name: str, rng: np.random.Generator | None) -> Design:
    """A car of CommonRoad's, varied at random; as it is without `rng`."""
    p = car.parameters(CARS[name])
    p |= dict.fromkeys(ONE_SIDED, 0.0)
    chain = plain_chain()
    if rng is None:
        return Design(name, CAR, p, chain)
    mass = rng.uniform(0.92, 1.15)
    for key in ("m", "m_s", "m_uf", "m_ur", "I_Phi_s", "I_y_s", "I_z", "I_uf", "I_ur", "drive_mass"):
        p[key] *= mass
    for key in ("K_sf", "K_sr", "K_sdf", "K_sdr", "K_tsf", "K_tsr"):
        p[key] *= mass * rng.uniform(0.95, 1.2)
    p["I_z"] *= rng.uniform(0.92, 1.1)
    shift = rng.uniform(-0.05, 0.05)
    p["a"], p["b"] = p["a"] - shift, p["b"] + shift
    # Stiffer in front than CommonRoad's tyre would make a car oversteer: the front gets less, if anything.
    p["stiffness_f"], p["stiffness_r"] = rng.uniform(0.75, 0.95), rng.uniform(0.95, 1.1)
    p["friction_f"] = p["friction_r"] = rng.uniform(0.88, 1.02)
    p["relaxation"] = rng.uniform(0.25, 0.5)
    p["drag_area"], p["side_area"] = rng.uniform(0.55, 0.85), rng.uniform(4.0, 6.5)
    p["pressure_x"] = rng.uniform(0.2, 0.6)
    chain |= {"dead_time": 0.002 * rng.integers(10, 20), "lag": rng.uniform(0.04, 0.09), "rate_limit": 0.8}
    chain |= {"drive_lag": rng.uniform(0.12, 0.25)}
    return Design(name, CAR, p, chain)


def build(design: Design, values: dict[str, float]) -> Unit:
    """A unit of a design: tolerances and effects as effects.py names them."""
    if design.kind == CAR:
        return build_car(design, values)
    from . import truck_design  # it builds on this module

    return truck_design.build(design, values)


def chained(design: Design, values: dict[str, float]) -> dict[str, float]:
    """The chains with tolerances and effects; dead times are whole steps."""
    h, chain = STEPS[design.kind], dict(design.chain)
    of = values.get
    chain["dead_time"] = max(0.0, round((chain["dead_time"] + of("steer_delay", 0.0)) / h) * h)
    chain["lag"] = max(0.0, chain["lag"] + of("steer_lag", 0.0))
    chain["rate_limit"] = min(chain["rate_limit"], of("steer_rate_limit", 1e6))
    chain["backlash"] += of("steer_backlash", 0.0)
    chain["gain"] *= of("steer_gain", 1.0)
    chain["offset"] += of("steer_offset", 0.0)
    chain["drive_lag"] = max(0.0, chain["drive_lag"] + of("drive_lag", 0.0))
    chain["drive_gain"] *= of("drive_gain", 1.0)
    chain["natural"], chain["damping"] = of("natural", 0.0), of("damping", 0.0)
    chain["cubic"], chain["brake_moment"] = of("cubic", 0.0), of("brake_moment", 0.0)
    return chain


def surroundings(values: dict[str, float]) -> np.ndarray:
    """Bank, grade, friction and wind."""
    of = values.get
    return np.array([np.sin(of("road_bank", 0.0)), np.sin(of("road_grade", 0.0)), of("road_friction", 1.0),
                     of("wind_x", 0.0), of("wind_y", 0.0)])  # fmt: skip


def build_car(design: Design, values: dict[str, float]) -> Unit:
    """A car with tolerances and effects."""
    p, of = dict(design.p), values.get
    for key in ("m", "m_s"):
        p[key] *= of("mass", 1.0)
    p["I_z"] *= of("yaw_inertia", 1.0)
    p["h_s"] *= of("cg_height", 1.0)
    p["K_sf"] *= of("spring_front", 1.0)
    # The roll stiffness of springs and bars together: the bars take the change.
    stiffer = of("roll_stiffness", 1.0) - 1.0
    for bar, spring, track in (("K_tsf", "K_sf", "T_f"), ("K_tsr", "K_sr", "T_r")):
        p[bar] -= stiffer * (0.5 * p[track] ** 2 * p[spring] - p[bar])
    # The CG moves by `cg_shift`, then to that of car and load together; sprung and unsprung go along.
    shift, load = of("cg_shift", 0.0), of("payload", 0.0)
    if load > 0.0:
        place = of("payload_x", 0.0)  # forward of the unladen CG
        move = load * place / (p["m"] + load)
        p["I_z"] += p["m"] * move**2 + load * (place - move) ** 2
        p["I_y_s"] += p["m"] * move**2 + load * (place - move) ** 2
        p["m"], p["m_s"] = p["m"] + load, p["m_s"] + load
        shift += move
    p["a"], p["b"], p["pressure_x"] = p["a"] - shift, p["b"] + shift, p["pressure_x"] - shift
    p["stiffness_f"] *= of("tyre_stiffness_front", 1.0)
    p["stiffness_r"] *= of("tyre_stiffness_rear", 1.0)
    p["friction_r"] *= of("friction_rear", 1.0)
    p["relaxation"] = of("relaxation", p["relaxation"] * of("tyre_relaxation", 1.0))
    p["drag_factor"] *= of("drag", 1.0)
    p["yaw_moment"] += of("brake_pull", 0.0)
    p["stiffness_left"] *= of("stiffness_left", 1.0)
    return Unit(design, p, chained(design, values), surroundings(values), -shift)


def write_file(design: Design, folder: Path) -> Path:
    """Writes the vehicle file of a design with its tyre file, and gives its place."""
    folder.mkdir(parents=True, exist_ok=True)
    if design.kind == TRUCK:
        from . import truck_design

        return truck_design.write_file(design, folder)
    p, chain = design.p, design.chain
    text = (ROOT / "vehicles" / "tyres" / "commonroad.tir").read_text(encoding="utf-8")
    radius = 0.344
    # Relaxation: PTY1 R0 sin(2 atan(Fz / (PTY2 FNOMIN))), nearly even about 3.4 kN.
    own = f"PTY1 = {p['relaxation'] / radius:.5f}\nPTY2 = 0.7\n" if p["relaxation"] > 0.0 else ""
    text = text.replace("[LATERAL_COEFFICIENTS]\n", "[LATERAL_COEFFICIENTS]\n" + own)
    (folder / f"{design.name}.tir").write_text(text, encoding="utf-8")
    # CommonRoad takes axle loads from body and axles apart, with the body's CG at a and b: the scales bring our loads
    # to them.
    base, whole = p["a"] + p["b"], p["m"] / (p["a"] + p["b"])
    front = (p["m_s"] * p["b"] / base + p["m_uf"]) / (whole * p["b"])
    rear = (p["m_s"] * p["a"] / base + p["m_ur"]) / (whole * p["a"])
    height = (p["m_s"] * p["h_s"] + (p["m_uf"] + p["m_ur"]) * p["R_w"]) / p["m"]
    force = p["a_max"] * p["m"]

    def axle(which: str, f: str) -> str:
        scale = front if f == "f" else rear
        return f"""
[axle.{which}]
track = {p["T_" + f]:.6f}
unsprung_mass = {p["m_u" + f]:.4f}
spring_rate = {p["K_s" + f]:.3f}
damping = {p["K_sd" + f]:.3f}
anti_roll_bar = {-p["K_ts" + f]:.3f}
roll_centre_height = {p["h_ra" + f]:.4f}
camber_gain = {p["D_" + f]:.6f}
sway = 1.0
wheel_inertia = {p["I_y_w"]}

[tyre.{which}]
file = "{design.name}.tir"
stiffness_scale = {scale * p["stiffness_" + f]:.6f}
friction_scale = {scale * p["friction_" + f]:.6f}
vertical_stiffness = {p["K_zt"]:.2f}
lateral_compliance = {p["K_lt"]:.6e}
"""

    text = f"""name = "{design.name}"
source = "made by blind/vehicles.py from the design of a blind vehicle"

[vehicle]
mass = {p["m"]:.4f}
yaw_inertia = {p["I_z"]:.4f}
roll_inertia = {p["I_Phi_s"]:.4f}
pitch_inertia = {p["I_y_s"]:.4f}
cg_to_front_axle = {p["a"]:.6f}
cg_to_rear_axle = {p["b"]:.6f}
cg_height = {height:.6f}
{axle("front", "f")}{axle("rear", "r")}
[steering]
angle_limit = {chain["angle_limit"]}
rate_limit = {min(chain["rate_limit"], 10.0)}
dead_time = {chain["dead_time"]:.4f}
lag = {chain["lag"]:.6f}

[drive]
front_share = {p["T_se"]}
max_force = {force:.1f}
max_power = {force * p["v_switch"]:.1f}
lag = {chain["drive_lag"]:.6f}

[brake]
front_share = {p["T_sb"]}
max_force = {force:.1f}

[air]
density = {car.AIR_DENSITY}
drag_area = {p["drag_area"]:.6f}
side_area = {p["side_area"]:.6f}
pressure_centre = {p["pressure_x"]:.6f}
"""
    place = folder / f"{design.name}.toml"
    place.write_text(text, encoding="utf-8")
    return place
