"""Whether the proposed next manoeuvre resolves what remained confused: driven by the same unit, diagnosed anew.

The manoeuvres are built from the words of the report ("how it is driven"), as roads with a speed; the blind driver
drives them as a person would, not the exact commands. Trucks drive them slower and gentler. As the report asks, the
manoeuvre is also driven by the unit as it was before anything happened: that shows the model's form.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from . import diagnose, measures, sensors
from .cases import Case, Set, combined, draw_conditions, start_and_drive
from .controls import again
from .make import folder_of
from .road import SPACING, Road
from .vehicles import build

DURATION, STEP = 30.0, 0.02  # s
TRUCK_SPEED, TRUCK_LATERAL = 0.75, 0.4
# Cosine from which on two effects count as collinear.
COLLINEAR = 0.9


def _sweep(t: float) -> float:
    rate = math.log(2.5 / 0.2) / DURATION
    return math.sin(2.0 * math.pi * 0.2 * (math.exp(rate * t) - 1.0) / rate)


def _step(t: float) -> float:
    return (3.0, 0.0, -3.0, 0.0)[int(t % 12.0) // 3]


def _brake(t: float) -> float:
    phase = t % 15.0
    if phase < 3.0:
        return 25.0
    return 25.0 - 4.0 * (phase - 3.0) if phase < 6.0 else min(13.0 + 1.5 * (phase - 6.0), 25.0)


# Name: speed in m/s and lateral acceleration in m/s2 over time.
PLANS: dict[str, tuple[Callable[[float], float], Callable[[float], float]]] = {
    "speed sweep": (lambda t: 6.0 + 20.0 * t / DURATION, lambda t: 2.0 * math.sin(2.0 * math.pi * 0.25 * t)),
    "step steer": (lambda t: 18.0, _step),
    "sine sweep": (lambda t: 20.0, lambda t: 2.5 * _sweep(t)),
    "there and back": (lambda t: 15.0, lambda t: 5.0 if 10.0 <= t < 19.4 else 0.0),
    "limit circle": (lambda t: 14.0, lambda t: 8.0 * t / 15.0 if t < 15.0 else -8.0 * (t - 15.0) / 15.0),
    "braking": (_brake, lambda t: 0.0 if t < 15.0 else 1.5),
}


def road_of(name: str, is_truck: bool) -> Road:
    """The road on which a manoeuvre is driven; raises KeyError for one that this module does not know."""
    speed_at, lateral_at = PLANS[name]
    quick, hard = (TRUCK_SPEED, TRUCK_LATERAL) if is_truck else (1.0, 1.0)
    time = np.arange(0.0, DURATION + 5.0, STEP)
    speed = np.array([quick * speed_at(min(t, DURATION)) for t in time])
    curvature = np.array([hard * lateral_at(t) if t < DURATION else 0.0 for t in time]) / speed**2
    station = np.concatenate([[0.0], np.cumsum(speed[:-1] * STEP)])
    s = np.arange(0.0, station[-1], SPACING)
    curvature, speed = np.interp(s, station, curvature), np.interp(s, station, speed)
    yaw = np.concatenate([[0.0], np.cumsum(curvature[:-1]) * SPACING])
    x = np.concatenate([[0.0], np.cumsum(np.cos(yaw[:-1])) * SPACING])
    y = np.concatenate([[0.0], np.cumsum(np.sin(yaw[:-1])) * SPACING])
    return Road(x, y, yaw, curvature, speed, 0.0 * s, np.ones(len(s)), 0.0 * s)


def drive(cases: Set, case: Case, name: str, sound: bool = False) -> dict[str, np.ndarray] | None:
    """A log of the case's unit in a manoeuvre, `sound`: before anything happened; None if it left the road."""
    rng = cases.rng(6 if sound else 5, case.number)
    conditions = draw_conditions(rng, case.design, case.suite, DURATION)
    samples = round(DURATION / conditions.sample)
    conditions = replace(
        conditions,
        road=road_of(name, case.design.is_truck),
        duration=DURATION,
        noise=rng.normal(size=(samples, 2)),
    )
    whole = combined(case.background, {} if sound else case.values)
    truth = start_and_drive(build(case.design, whole), conditions)
    suite = replace(case.suite, seed=case.suite.seed + (31 if sound else 29))
    return sensors.log(truth, whole, suite) if truth.arrived else None


def confused(label: dict, report: dict) -> bool:
    """Whether a single effect was taken for another, or was named in a class with others."""
    if label["kind"] != "single" or measures.kind(report) != "effect":
        return False
    return not measures.exact(label, report) or any(len(group) > 1 for group in measures.classes(report))


def clear(label: dict, report: dict) -> bool:
    """Whether the effect, and nothing beside it, is named."""
    return measures.exact(label, report) and all(len(group) == 1 for group in measures.classes(report))


def has_another(label: dict, report: dict) -> bool:
    """Whether the true effect is named, with certainty, and another besides: not taken for it, but one too many."""
    return set(label["causes"]) < set(measures.named(report))


def explained(label: dict, report: dict) -> bool:
    """Whether the report itself says why its log does not tell the true effect from what it named.

    In its class, collinear, or smaller than it has to be to be named.
    """
    return is_collinear(label, report) or not measures.shown(label, report)


def is_collinear(label: dict, report: dict) -> bool:
    """Whether the report itself says that the true effect is collinear with what it named, or in its class."""
    likeness = alike(label, report)
    return likeness is not None and likeness >= COLLINEAR


def alike(label: dict, report: dict) -> float | None:
    """How collinear the report itself says that the true effect is with what it named; 1 within its class."""
    if measures.in_class(label, report):
        return 1.0
    found = [c.get("collinearity") for c in report["candidates"] if set(label["causes"]) <= set(c["effects"])]
    return max((abs(cosine) for cosine in found if cosine is not None), default=None)


def measure(
    cases: Set,
    labels: list[dict],
    reports: list[dict],
    out: Path,
    rfl: Path,
    most: int,
    jobs: int,
    say=lambda text: None,
) -> dict:
    """Of confused single effects: whether the report says with what, and what the manoeuvre that it proposes tells.

    The manoeuvre is diagnosed on its own, together with the log that left the confusion, and beside the same manoeuvre
    driven before anything happened.
    """
    folders, of, lost, undecided = [], [], 0, []
    for label, report in zip(labels, reports):
        if not confused(label, report):
            continue
        undecided.append((label, report))
        proposed = (report.get("next_manoeuvre") or {}).get("name")
        if not proposed or len(folders) >= most:
            continue
        case = again(cases, label)
        logs = [drive(cases, case, proposed, sound) if proposed in PLANS else None for sound in (False, True)]
        if any(log is None for log in logs):
            lost += 1
            say(f"case {label['case']}: '{proposed}' could not be driven")
            continue
        own, folder = folder_of(out, label["case"]), out / f"next_{label['case']:03d}"
        shutil.copytree(own, folder, ignore=shutil.ignore_patterns("answer*", "without"))
        for log, name in zip(logs, ("next", "before")):
            sensors.write(log, folder / f"{name}.csv.gz")
        folders.append(folder)
        of.append(label)
    alone = diagnose.diagnose_all(rfl, folders, jobs, "alone", say=say, log="next.csv.gz")
    both = diagnose.diagnose_all(rfl, folders, jobs, "both", lambda _: ("next.csv.gz",), say)
    for folder in folders:
        (folder / "before.csv.gz").replace(folder / "reference.csv.gz")
    beside = diagnose.diagnose_all(rfl, folders, jobs, "beside", say=say, log="next.csv.gz")
    more = {label["case"] for label, report in undecided if has_another(label, report)}
    return {
        "single effects confused or in a class": measures.share(
            confused(a, b) for a, b in zip(labels, reports) if a["kind"] == "single"
        ),
        "confused: collinear by 0.9 or in the class, as the report says": measures.share(
            is_collinear(a, b) for a, b in undecided
        ),
        "confused: taken for another, or in a class": measures.share(a["case"] not in more for a, _ in undecided),
        "... collinear, in the class, or too small for its log, as the report says": measures.share(
            explained(a, b) for a, b in undecided if a["case"] not in more
        ),
        "confused: named, and another besides": measures.share(a["case"] in more for a, _ in undecided),
        "... the other gone in the next manoeuvre, driven before and after": measures.share(
            clear(a, b) for a, b in zip(of, beside) if a["case"] in more
        ),
        "next manoeuvre alone: in class": measures.share(measures.in_class(a, b) for a, b in zip(of, alone)),
        "next manoeuvre alone: the effect and no other": measures.share(clear(a, b) for a, b in zip(of, alone)),
        "both logs: in class": measures.share(measures.in_class(a, b) for a, b in zip(of, both)),
        "both logs: the effect and no other": measures.share(clear(a, b) for a, b in zip(of, both)),
        "next manoeuvre, driven before and after: in class": measures.share(
            measures.in_class(a, b) for a, b in zip(of, beside)
        ),
        "next manoeuvre, driven before and after: the effect and no other": measures.share(
            clear(a, b) for a, b in zip(of, beside)
        ),
        "next manoeuvre not drivable": lost,
    }
