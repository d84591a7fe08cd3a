"""The arithmetic of a score: what counts as right, and how sure a share is.

A case is a label (what was put in) and a report (`report.json`). All functions are pure.
"""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Callable, Iterable

import numpy as np
from statsmodels.stats.proportion import proportion_confint

from .effects import FACTORS, OF, OF_TRUCKS, TOLERANCES

# A class of more members names nothing.
LARGEST_CLASS = 4
STAGES = {
    "command": ["steer_delay"],
    "actuator": ["steer_lag", "steer_rate_limit", "steer_backlash"],
    "linkage": ["steer_offset", "steer_gain"],
    "tyre": ["tyre_stiffness_front", "tyre_stiffness_rear", "road_friction", "tyre_relaxation", "trailer_stiffness"],
    "body": [
        "payload", "cg_shift", "yaw_inertia", "roll_stiffness", "trailer_payload", "hitch_offset",
        "articulation_friction",
    ],
    "road": ["road_bank", "road_grade", "wind_x", "wind_y", "drag"],
    "drive": ["drive_lag", "drive_gain", "brake_pull"],
    "sensor": [
        "yaw_rate_bias", "lateral_accel_bias", "sensor_delay", "speed_scale", "imu_lever_arm", "heading_misalignment",
        "articulation_bias",
    ],
}  # fmt: skip
STAGE_OF = {effect: stage for stage, effects in STAGES.items() for effect in effects}


# So many tolerances off an effect is clear: no log gives more evidence against the tolerances alone than the square.
CLEAR = 4.0
# Effects that no ordinary vehicle has a little of, and one whose tolerance hangs on the design.
WITHOUT_TOLERANCE = {"steer_rate_limit", "steer_backlash", "payload", "trailer_payload", "tyre_relaxation"}


def tolerances(label: dict) -> dict[str, float]:
    """Tolerances of a case's vehicle."""
    return TOLERANCES | (OF_TRUCKS if label["truck"] else {})


def tolerances_off(label: dict) -> float:
    """How many tolerances the weakest cause is from neutral; infinite without a tolerance."""
    known = tolerances(label)
    of = [
        abs(label["values"][cause] - OF[cause].neutral) / known[cause]
        for cause in label["causes"]
        if cause not in WITHOUT_TOLERANCE
    ]
    return min(of, default=float("inf"))


def shown(label: dict, report: dict) -> bool:
    """Whether each cause is as large as the report's own account of the log says that it must be to be named.

    Of a rate limit, which a log either meets or not, and of one that nothing is said of, it is taken for granted.
    """
    least = {entry["effect"]: entry.get("named_from") for entry in report.get("observability", [])}
    return all(
        abs(label["values"][cause] - OF[cause].neutral) >= (least.get(cause) or 0.0)
        for cause in label["causes"]
        if cause != "steer_rate_limit"
    )


def wilson(hits: int, count: int) -> tuple[float, float]:
    """The 95 % interval of a share by Wilson; (0, 1) of nothing."""
    if count == 0:
        return 0.0, 1.0
    low, high = proportion_confint(hits, count, alpha=0.05, method="wilson")
    return float(low), float(high)


def share(of: Iterable[bool]) -> dict:
    """Hits, count, share and its interval."""
    of = list(of)
    hits = sum(map(bool, of))
    low, high = wilson(hits, len(of))
    return {"hits": hits, "count": len(of), "share": hits / len(of) if of else None, "low": low, "high": high}


def effects_of(report: dict) -> list[dict]:
    """Effects that the verdict names."""
    return report["verdict"]["effects"] if kind(report) == "effect" else []


def named(report: dict) -> list[str]:
    """Ids that the verdict names."""
    return [effect["id"] for effect in effects_of(report)]


def kind(report: dict) -> str:
    """The verdict's kind; `error` without a report."""
    return report["verdict"]["kind"] if "verdict" in report else "error"


def exact(label: dict, report: dict) -> bool:
    """Whether the verdict is the truth and nothing else."""
    if label["kind"] == "none":
        return kind(report) == "none"
    if label["kind"] == "outside":
        return kind(report) == "not_in_library"
    return sorted(named(report)) == sorted(label["causes"])


def classes(report: dict) -> list[set[str]]:
    """What each named effect may be; classes that are too large name their first member only."""
    found = []
    for effect in effects_of(report):
        members = set(effect.get("class") or [effect["id"]]) | {effect["id"]}
        found.append(members if len(members) <= LARGEST_CLASS else {effect["id"]})
    return found


def in_class(label: dict, report: dict) -> bool:
    """Whether each cause is in the class of an effect of its own that was named, and no more were named."""
    if label["kind"] in ("none", "outside"):
        return exact(label, report)
    return _matched(label["causes"], classes(report)) == len(label["causes"]) == len(named(report))


def _matched(causes: list[str], groups: list[set[str]]) -> int:
    """How many causes find a class of their own, at most."""
    if not causes:
        return 0
    first, rest = causes[0], causes[1:]
    best = _matched(rest, groups)
    for i, group in enumerate(groups):
        if first in group:
            best = max(best, 1 + _matched(rest, groups[:i] + groups[i + 1 :]))
    return best


def credit(label: dict, report: dict) -> float:
    """As `in_class`, penalised by size: one over the size of the class, for pairs of both together."""
    if not in_class(label, report):
        return 0.0
    return 1.0 / float(np.prod([len(group) for group in classes(report)] or [1]))


def in_top(label: dict, report: dict, count: int = 3) -> bool:
    """Whether the causes stand among the first candidates of their number of effects."""
    if label["kind"] in ("none", "outside"):
        return exact(label, report)
    wanted = sorted(label["causes"])
    of_size = [c for c in report.get("candidates", []) if len(c["effects"]) == len(wanted)]
    return any(sorted(c["effects"]) == wanted for c in of_size[:count])


def some_of_pair(label: dict, report: dict) -> bool:
    """Whether at least one cause of a pair is in a class that was named."""
    return _matched(label["causes"], classes(report)) >= 1


def f1(label: dict, report: dict) -> float:
    """F1 of the named effects against the causes, by id."""
    truth, found = set(label["causes"]), set(named(report))
    return 2.0 * len(truth & found) / (len(truth) + len(found)) if truth or found else 1.0


def true_value(label: dict, effect: dict) -> float:
    """What an effect that was named rightly really is; of a wind that is named by its speed alone, its speed."""
    value = label["values"][effect["id"]]
    return abs(value) if effect.get("direction") is not None else value


def value_errors(label: dict, report: dict) -> list[float]:
    """|found - true| / |true - neutral| of the effects that were named rightly; of a rate limit against its value."""
    errors = []
    for effect in effects_of(report):
        if effect["id"] in label["causes"]:
            true, neutral = true_value(label, effect), OF[effect["id"]].neutral
            scale = abs(true) if effect["id"] == "steer_rate_limit" else abs(true - neutral)
            errors.append(abs(effect["value"] - true) / scale)
    return errors


def covered(label: dict, report: dict) -> list[bool]:
    """Whether the 95 % intervals of what was named rightly hold the true value."""
    return [e["low"] <= true_value(label, e) <= e["high"] for e in effects_of(report) if e["id"] in label["causes"]]


# What an effect stands for where a vehicle has it without anything having been put in: a heavier one has a load.
OWN_NUMBER = {"payload": "mass", "trailer_payload": "trailer_mass"}


def wrong_names(label: dict, report: dict) -> list[bool]:
    """For each effect that was named and not put in: whether the unit's own number is clearly off, to that side.

    A wild unit may be ten tolerances off by itself. Who names it is right about the vehicle, not about the label.
    """
    known = tolerances(label)
    found = []
    for effect in effects_of(report):
        if effect["id"] in label["causes"]:
            continue
        own = OWN_NUMBER.get(effect["id"], effect["id"])
        there = label.get("background", {}).get(own)
        off = 0.0 if there is None or own not in known else (there - (own in FACTORS)) / known[own]
        found.append(abs(off) >= CLEAR and (effect["value"] - OF[effect["id"]].neutral) * off > 0.0)
    return found


def stage_right(label: dict, report: dict) -> bool:
    """Whether the gap was found to enter at the stage of (one of) the causes."""
    return report.get("stage") in {STAGE_OF[cause] for cause in label["causes"]}


def calibration_error(probabilities: list[float], right: list[bool], bins: int = 10) -> float:
    """Expected calibration error: the mean of |accuracy - confidence| over bins of even width, by their counts."""
    return sum(
        count * abs(accuracy - confidence) for confidence, accuracy, count in reliability(probabilities, right, bins)
    ) / max(len(right), 1)


def reliability(probabilities: list[float], right: list[bool], bins: int = 10) -> list[tuple[float, float, int]]:
    """Mean confidence, accuracy and count of each bin that has cases."""
    p, r = np.asarray(probabilities, float), np.asarray(right, float)
    which = np.minimum((p * bins).astype(int), bins - 1)
    return [
        (float(p[which == k].mean()), float(r[which == k].mean()), int(np.sum(which == k)))
        for k in range(bins)
        if np.any(which == k)
    ]


def shrinkage(report: dict, signal: str = "yaw_rate", stage: str = "recalibrated") -> float | None:
    """Share of a held-out gap of the log that is closed; the noise is not a gap."""
    gap = report.get("gap_reduction", {}).get("open_loop", {}).get(signal)
    if not gap or gap["before"] <= gap["noise"]:
        return None
    before, after = (max(gap[key] ** 2 - gap["noise"] ** 2, 0.0) ** 0.5 for key in ("before", stage))
    return 1.0 - after / before


def median(of: Iterable[float | None]) -> float | None:
    """The median of what there is; None of nothing."""
    there = [value for value in of if value is not None]
    return statistics.median(there) if there else None


def bands(labels: list[dict], right: list[bool], edges=(0.2, 0.4, 0.7, 1.0, 1.5, 2.5, 10.0)) -> list[dict]:
    """Share of right answers over the dominance of single effects."""
    found = []
    for low, high in itertools.pairwise(edges):
        of = [
            r for label, r in zip(labels, right) if label["kind"] == "single" and low <= label["dominance"][""] < high
        ]
        found.append({"from": low, "to": high} | share(of))
    return found


def confusion(labels: list[dict], reports: list[dict]) -> dict[str, dict[str, int]]:
    """How often each truth (one effect, none, a cause outside) was given each answer; pairs apart."""
    table: dict[str, dict[str, int]] = {}
    for label, report in zip(labels, reports):
        if label["kind"] == "pair":
            continue
        truth = label["causes"][0] if label["causes"] else "none"
        answer = "+".join(sorted(named(report))) or kind(report)
        row = table.setdefault(truth, {})
        row[answer] = row.get(answer, 0) + 1
    return {truth: dict(sorted(row.items())) for truth, row in sorted(table.items())}


def score(labels: list[dict], reports: list[dict]) -> dict:
    """All measures of a set."""

    def of(kinds: tuple[str, ...], test: Callable[[dict, dict], bool], keep=lambda label: True) -> dict:
        pairs = [(a, b) for a, b in zip(labels, reports) if a["kind"] in kinds and keep(a)]
        return share(test(a, b) for a, b in pairs)

    def all_of(kinds: tuple[str, ...], values: Callable[[dict, dict], list]) -> list:
        return [v for a, b in zip(labels, reports) if a["kind"] in kinds for v in values(a, b)]

    def moderate(label: dict) -> bool:
        return label["dominance"][""] >= 1.0

    answered = [(a, b) for a, b in zip(labels, reports) if "verdict" in b and kind(b) != "cannot_tell"]
    sure = [b["verdict"]["probability"] for _, b in answered]
    right = [in_class(a, b) for a, b in answered]
    singles = [(a, b) for a, b in zip(labels, reports) if a["kind"] == "single"]
    pairs = [(a, b) for a, b in zip(labels, reports) if a["kind"] == "pair"]
    named_ones = [b for a, b in zip(labels, reports) if a["kind"] in ("single", "pair") and in_class(a, b)]
    seconds, used = ([b.get(key, b["seconds"]) for b in reports] for key in ("seconds", "cpu_seconds"))
    return {
        "cases": len(labels),
        "moderate_exact": of(("single",), exact, moderate),
        "moderate": of(("single",), in_class, moderate),
        "small_exact": of(("single",), exact, lambda a: not moderate(a)),
        "small": of(("single",), in_class, lambda a: not moderate(a)),
        "single_credit": float(np.mean([credit(a, b) for a, b in singles])) if singles else None,
        "single_top3": of(("single",), in_top),
        "with_reference": of(("single",), in_class, lambda a: a["reference"]),
        "without_reference": of(("single",), in_class, lambda a: not a["reference"]),
        "cars": of(("single",), in_class, lambda a: not a["truck"]),
        "trucks": of(("single",), in_class, lambda a: a["truck"]),
        "pair_both": of(("pair",), in_class),
        "pair_one": of(("pair",), some_of_pair),
        "clear_single": of(("single",), in_class, lambda a: tolerances_off(a) >= CLEAR),
        "clear_pair": of(("pair",), in_class, lambda a: tolerances_off(a) >= CLEAR),
        "shown_single": share(in_class(a, b) for a, b in singles if shown(a, b)),
        "shown_pair": share(in_class(a, b) for a, b in pairs if shown(a, b)),
        "hidden_pair": share(in_class(a, b) for a, b in pairs if not shown(a, b)),
        "pair_top3": of(("pair",), in_top),
        "pair_f1": float(np.mean(all_of(("pair",), lambda a, b: [f1(a, b)]) or [np.nan])),
        "false_alarms": of(("none",), lambda a, b: kind(b) in ("effect", "not_in_library")),
        "outside_found": of(("outside",), exact),
        "false_flags": of(("single", "pair", "none"), lambda a, b: kind(b) == "not_in_library"),
        "cannot_tell": of(("single", "pair", "none", "outside"), lambda a, b: kind(b) == "cannot_tell"),
        "errors": of(("single", "pair", "none", "outside"), lambda a, b: kind(b) == "error"),
        "wrong_names": share(effect not in a["causes"] for a, b in zip(labels, reports) for effect in named(b)),
        "wrong_names_of_unit": share(true for a, b in zip(labels, reports) for true in wrong_names(a, b)),
        "ece": calibration_error(sure, right),
        "reliability": reliability(sure, right),
        "value_error": median(all_of(("single", "pair"), value_errors)),
        "interval_covers": share(all_of(("single", "pair"), covered)),
        "stage": of(("single", "pair"), stage_right),
        "own_log_effect": median(shrinkage(b, stage="effect") for b in named_ones),
        "own_log_recalibrated": median(shrinkage(b) for b in named_ones),
        "by_dominance": bands(labels, [in_class(a, b) for a, b in zip(labels, reports)]),
        "confusion": confusion(labels, reports),
        "seconds_median": median(seconds),
        "seconds_most": max(seconds, default=None),
        "cpu_seconds_median": median(used),
        "cpu_seconds_most": max(used, default=None),
    }
