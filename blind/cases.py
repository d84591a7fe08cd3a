"""Draws and drives the cases of a blind set.

Every case hangs on the set's seed and its own number only: cases can be made in any order and on any number of
processes. A case that leaves the road, or whose effect is lost beside its background (dominance below 0.2, or above
10), is drawn again.

    dominance = |measured(background + effect) - measured(background)| / |measured(background) - measured(design)|

with the same commands, in units of the sensors' noise, over the signals that are logged. "Small" effects have a
dominance below 1, "moderate" ones from 1 on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from . import drive, effects, road, sensors, truck_design, wild
from .drive import CAR, STEPS, TRUCK, Conditions, Truth
from .vehicles import CARS, Design, Unit, build, design_car

# Shares of the kinds of cases; of trucks; of cases that come with a reference log.
KINDS = {"single": 0.50, "pair": 0.15, "none": 0.20, "outside": 0.15}
TRUCKS = 0.2
REFERENCES = 0.25
DURATION = (30.0, 120.0)  # s
DOMINANCE = (0.2, 10.0)
LEAST_OF_PAIR, LEAST_OUTSIDE = 0.5, 1.0
TRIES = 40
# Signals that a dominance looks at; of vx what changes within some seconds.
LOOKED_AT = ("yaw_rate", "ay", "vy", "ax", "vx", "steer", "roll", "articulation")


class CannotDraw(RuntimeError):
    """No drive with this cause came out within the tries."""


@dataclass(frozen=True)
class Set:
    """A set of cases."""

    seed: int
    development: bool
    count: int
    #: Only these kinds of vehicles.
    cars: bool = True
    trucks: bool = True
    #: Longest drive, s.
    longest: float = DURATION[1]
    #: This kind of cases only.
    kind: str | None = None
    #: A world that no prior made.
    wild: bool = False

    def rng(self, *of: int) -> np.random.Generator:
        return np.random.default_rng([int(self.development) + 2 * int(self.wild), self.seed, *of])

    def designs(self) -> list[Design]:
        """The vehicles of this set: three cars, and a truck."""
        found = [design_car(name, self.rng(1, i)) for i, name in enumerate(CARS)] if self.cars else []
        if self.trucks:
            found.append(truck_design.design(self.rng(1, 9)))
        if self.wild:
            found = [wild.reshaped(design, self.rng(5, i)) for i, design in enumerate(found)]
        return found

    def file_of(self, design: Design) -> Design:
        """The design as its vehicle file has it."""
        place = [own.name for own in self.designs()].index(design.name)
        return wild.as_catalogued(design, self.rng(6, place)) if self.wild else design

    def world(self) -> wild.World | None:
        """What else than usual is the same for all cases."""
        return wild.world(self.rng(4)) if self.wild else None

    def plan(self) -> list[Plan]:
        """What each case is to be: kinds, vehicles and effects evenly spread, in random order."""
        rng, designs = self.rng(2), self.designs()
        names = [design.name for design in designs]
        of_trucks = round(TRUCKS * self.count) if self.cars and self.trucks else (self.count if self.trucks else 0)
        plans = []
        for is_truck, count in ((False, self.count - of_trucks), (True, of_trucks)):
            own = [name for name, design in zip(names, designs) if design.is_truck == is_truck]
            shares = {self.kind: 1.0} if self.kind else KINDS
            counts = {kind: round(share * count) for kind, share in shares.items()}
            counts[next(iter(counts))] += count - sum(counts.values())
            pool = _endless(rng, effects.ids(is_truck))
            outside = _endless(rng, list(effects.OUTSIDE_OF_TRUCKS if is_truck else effects.OUTSIDE))
            vehicles = _endless(rng, own) if own else None
            for kind, number in counts.items():
                for _ in range(number):
                    named: tuple[str, ...] = ()
                    if kind == "single":
                        named = (next(pool),)
                    elif kind == "pair":
                        first = next(pool)
                        second = first
                        while second == first:
                            second = next(pool)
                        named = (first, second)
                    elif kind == "outside":
                        named = (next(outside),)
                    plans.append(Plan(kind, next(vehicles), named, bool(rng.random() < REFERENCES)))
        order = rng.permutation(len(plans))
        return [plans[i] for i in order]


@dataclass(frozen=True)
class Plan:
    """What a case is to be."""

    kind: str
    vehicle: str
    causes: tuple[str, ...]
    reference: bool


@dataclass
class Case:
    """A case: what the diagnosis gets, and what it must not know."""

    number: int
    plan: Plan
    design: Design
    #: The effects' values (and a payload's place).
    values: dict[str, float]
    background: dict[str, float]
    #: Of each cause; of all together under "".
    dominance: dict[str, float]
    conditions: Conditions
    suite: sensors.Suite
    truth: Truth
    log: dict[str, np.ndarray]
    reference: dict[str, np.ndarray] | None
    #: How often it was drawn anew.
    tries: int
    #: What the logger does otherwise than the documentation asks.
    conventions: list[str] = field(default_factory=list)

    @property
    def moderate(self) -> bool:
        return self.dominance.get("", 0.0) >= 1.0

    def label(self) -> dict:
        """What is sealed."""
        return {
            "case": self.number,
            "kind": self.plan.kind,
            "vehicle": self.design.name,
            "truck": self.design.is_truck,
            "causes": list(self.plan.causes),
            "values": self.values,
            "background": self.background,
            "dominance": self.dominance,
            "duration": self.conditions.duration,
            "rate": self.suite.rate,
            "logged": list(self.suite.logged),
            "reference": self.reference is not None,
            "tries": self.tries,
            "conventions": self.conventions,
        }


def _endless(rng: np.random.Generator, names: list[str]):
    """The names over and over, each round in another order."""
    while True:
        yield from (names[i] for i in rng.permutation(len(names)))


def make(cases: Set, number: int, plan: Plan, design: Design) -> Case:
    """Draws and drives a case.

    Raises `CannotDraw` when no try gives a drive that stays on its road with the cause to be seen.
    """
    for attempt in range(TRIES):
        case = _try(cases, number, plan, design, attempt)
        if case is not None:
            return case
    raise CannotDraw(f"case {number}: no drive with {' and '.join(plan.causes) or 'no effect'} in {TRIES} tries")


def _try(cases: Set, number: int, plan: Plan, design: Design, attempt: int) -> Case | None:
    rng = cases.rng(3, number, attempt)
    suite = sensors.draw(cases.rng(3, number), design.is_truck)  # the instruments stay the same
    world = cases.world()
    background = world.background(rng, design.is_truck) if world else effects.background(rng, design.is_truck)
    conditions = draw_conditions(rng, design, suite, cases.longest)
    how = None
    if world:
        conditions, how = _untamed(rng, conditions), wild.conventions(cases.rng(7, number))
    base = conditions
    values: dict[str, float] = {}
    hidden: dict[str, float] = {}
    if plan.kind == "outside":
        conditions, hidden = _outside(rng, plan.causes[0], conditions, design)
    else:
        for cause in plan.causes:
            values |= effects.draw(rng, cause, design.is_truck)
    unit = build(design, combined(background, values) | hidden)
    truth = start_and_drive(unit, conditions)
    if not truth.arrived:
        return None
    dominance = {}
    if plan.kind != "none":
        dominance = _dominances(plan, design, background, values, hidden, base, conditions, suite, truth)
        low, high = DOMINANCE
        least = {"pair": LEAST_OF_PAIR, "outside": LEAST_OUTSIDE}.get(plan.kind, low)
        if not all(least <= value <= high for value in dominance.values()):
            return None
    own = combined(background, values)
    reference = None
    if plan.reference:
        reference = _reference(rng, design, background, suite, how)
        if reference is None:
            return None
    log = sensors.log(truth, own, suite, how)
    words = how.words() if how else []
    return Case(
        number, plan, design, values, background, dominance, conditions, suite, truth, log, reference, attempt, words
    )


def _untamed(rng: np.random.Generator, conditions: Conditions) -> Conditions:
    """The same drive on a road of a wild world, in its wind."""
    samples = round(conditions.duration / conditions.sample)
    events = wild.gusts(samples, conditions.sample, rng)
    return replace(conditions, road=wild.surfaced(conditions.road, rng), events=events)


def combined(background: dict[str, float], values: dict[str, float]) -> dict[str, float]:
    """Tolerances with effects; an effect takes the place of its own tolerance, so that its value is the whole."""
    found = background | values
    if "tyre_relaxation" in values:
        found["relaxation"] = found.pop("tyre_relaxation")
    return found


def draw_conditions(rng: np.random.Generator, design: Design, suite: sensors.Suite, longest: float) -> Conditions:
    """A road, a driver, a length."""
    duration = float(np.round(rng.uniform(min(DURATION[0], longest), longest)))
    if design.is_truck:
        lateral, slow, fast, tightest, aims = (
            rng.uniform(1.0, 2.0),
            rng.uniform(6.0, 9.0),
            rng.uniform(15.0, 21.0),
            22,
            0.6,
        )
    else:
        lateral, slow, fast, tightest, aims = (
            rng.uniform(2.5, 5.5),
            rng.uniform(7.0, 10.0),
            rng.uniform(16.0, 27.0),
            11,
            1.0,
        )
    way = road.draw(rng, 1.1 * fast * duration + 200.0, lateral, slow, fast, tightest, aims)
    base, understeer = _handling(design)
    driver = {
        "preview": rng.uniform(1.3, 1.8) if design.is_truck else rng.uniform(0.9, 1.3),
        "wheelbase": base,
        "understeer": understeer,
        "lag": rng.uniform(0.05, 0.15),
        "integral": rng.uniform(0.0, 0.0006),
        "noise": rng.uniform(0.05, 0.2) if design.is_truck else rng.uniform(0.15, 0.6),  # m/s2
        "noise_time": rng.uniform(0.15, 0.5),
        "speed_gain": rng.uniform(0.5, 1.0),
        "speed_noise": rng.uniform(0.0, 0.15),
        "brake": 2.5 if design.is_truck else 4.0,
        "push": 0.8 if design.is_truck else 2.5,
    }
    sample = float(rng.choice([0.01, 0.02]) if STEPS[design.kind] == 0.002 else 0.02)
    noise = rng.normal(size=(round(duration / sample), 2))
    return Conditions(way, np.array([driver[name] for name in drive.DRIVER]), duration, sample, noise, np.zeros(5))


def _handling(design: Design) -> tuple[float, float]:
    """Wheelbase in m and understeer in rad s2/m of the design, as its driver knows them."""
    p = design.p
    if design.is_truck:
        return p["base"], p["understeer"]
    slope = abs(p["p_ky1"]) * 9.81
    return p["a"] + p["b"], (1.0 / p["stiffness_f"] - 1.0 / p["stiffness_r"]) / slope


def start_and_drive(unit: Unit, conditions: Conditions, commands: tuple[np.ndarray, np.ndarray] | None = None) -> Truth:
    """Drives a unit from the road's beginning."""
    way = conditions.road
    p, chain = unit.arrays()
    start = unit.at_speed(way.x[0], way.y[0], way.yaw[0], float(way.speed[0]))
    return drive.drive(unit.design.kind, p, chain, start, replace(conditions, around=unit.around), unit.arm, commands)


def _measured(unit: Unit, values: dict[str, float], conditions: Conditions, truth: Truth | None, commands) -> dict:
    """Signals without noise that a unit's sensors give under the commands."""
    truth = truth or start_and_drive(unit, conditions, commands)
    return sensors.placed(truth, values)


def distance(one: dict, other: dict, suite: sensors.Suite, h: float) -> float:
    """How far two drives under the same commands are apart, in units of the sensors' noise."""
    total = 0.0
    for name in LOOKED_AT:
        if name in suite.logged:
            gap = (one[name] - other[name])[:: max(1, round(0.02 / h))]
            if name == "vx":
                gap = gap - _slow(gap, 0.02, 4.0)
            total += float(np.mean(np.minimum(np.abs(gap), 1e3) ** 2)) / sensors.NOISE[name] ** 2
    return math.sqrt(total)


def _slow(signal: np.ndarray, step: float, time: float) -> np.ndarray:
    """A first-order low pass that begins at the signal's start."""
    from scipy.signal import lfilter

    keep = math.exp(-step / time)
    return lfilter([1.0 - keep], [1.0, -keep], signal, zi=[keep * signal[0]])[0]


def _dominances(
    plan: Plan, design: Design, background: dict, values: dict, hidden: dict, base: Conditions, conditions: Conditions,
    suite: sensors.Suite, truth: Truth,
) -> dict[str, float]:  # fmt: skip
    commands = (truth.steer_cmd, truth.accel_cmd)
    h = truth.h

    def run(own: dict[str, float], extra: dict[str, float], under: Conditions) -> dict:
        return _measured(build(design, own | extra), own, under, None, commands)

    neutral = {name: 1.0 if name in effects.FACTORS else 0.0 for name in background}
    nominal = run(neutral, {}, base)
    alone = run(background, {}, base)
    whole = run(combined(background, values), hidden, conditions)
    scale = max(distance(alone, nominal, suite, h), 1e-3)
    found = {"": distance(whole, alone, suite, h) / scale}
    if len(plan.causes) == 2:
        for cause in plan.causes:
            one = {key: value for key, value in values.items() if key == cause or cause == "payload" == key[:7]}
            found[cause] = distance(run(combined(background, one), {}, base), alone, suite, h) / scale
    return found


def _reference(rng: np.random.Generator, design: Design, background: dict, suite: sensors.Suite, how):
    """A log of the same vehicle with its tolerances, before anything happened to it."""
    conditions = draw_conditions(rng, design, suite, 90.0)
    if how:
        conditions = _untamed(rng, conditions)
    truth = start_and_drive(build(design, background), conditions)
    if not truth.arrived:
        return None
    return sensors.log(truth, background, replace(suite, seed=suite.seed + 1), how)


def _outside(rng: np.random.Generator, cause: str, conditions: Conditions, design: Design):
    """Conditions and hidden chain values of a cause that the library does not have."""
    strength = rng.uniform(0.5, 1.0)
    samples = round(conditions.duration / conditions.sample)
    events, way, hidden = np.zeros((samples, 4)), conditions.road, {}
    if len(conditions.events) == samples:
        events = conditions.events.copy()
    friction, bank = way.friction.copy(), way.bank.copy()

    def stretches(gap: float, length: float):
        at = rng.exponential(gap)
        while at < conditions.duration:
            size = length * rng.uniform(0.6, 1.4)
            yield slice(int(at / conditions.sample), int((at + size) / conditions.sample))
            at += size + rng.exponential(gap)

    if cause == "second_order_steering":
        hidden = {"natural": 2.0 * math.pi * rng.uniform(0.9, 1.8), "damping": 0.35 - 0.2 * strength}
    elif cause == "friction_patch":
        bends = np.argsort(-np.abs(way.curvature) * way.speed**2)
        for _ in range(4):
            middle = int(bends[rng.integers(len(bends) // 6)])
            half = int(rng.uniform(10.0, 25.0) / road.SPACING)
            friction[max(middle - half, 0) : middle + half] = 0.65 - 0.4 * strength
    elif cause == "intermittent_delay":
        for piece in stretches(5.0, 4.0):
            events[piece, 2] = 0.12 + 0.2 * strength
    elif cause == "sticking_command":
        for piece in stretches(3.5, 0.3 + 0.5 * strength):
            events[piece, 3] = 1.0
    elif cause == "variable_ratio":
        hidden = {"cubic": rng.choice([-1.0, 1.0]) * (50.0 + 70.0 * strength)}
    elif cause == "gusts":
        keep = math.exp(-conditions.sample / 1.2)
        for column in (0, 1):
            unrest = rng.normal(size=samples) * math.sqrt(1.0 - keep**2)
            for k in range(1, samples):
                unrest[k] += keep * unrest[k - 1]
            events[:, column] += 10.0 * strength * unrest
    elif cause == "bank_patch":
        at = 0
        while at < len(bank):
            size = int(rng.uniform(20.0, 60.0) / road.SPACING)
            bank[at : at + size] += rng.choice([0.0, 0.0, 1.0, -1.0]) * 0.09 * strength
            at += size
    elif cause == "braking_pull":
        hidden = {"brake_moment": rng.choice([-1.0, 1.0]) * 0.8 * strength}
    elif cause == "one_sided_tyres":
        hidden = {"stiffness_left": 0.8 - 0.35 * strength}
    else:
        raise ValueError(f"no cause '{cause}'")
    return replace(conditions, events=events, road=replace(way, friction=friction, bank=bank)), hidden


def vehicle_of(designs: list[Design], name: str) -> Design:
    """The design of this name."""
    return next(design for design in designs if design.name == name)


__all__ = ["CAR", "TRUCK", "Case", "Plan", "Set", "make"]
