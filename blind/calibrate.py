"""What development sets say of the numbers of the statistical model.

What it prints goes into src/diagnose/calibration.toml by hand: a change of it is a decision.

    blind/score --development --seed 911 --out out/blind/usual
    blind/score --development --wild --seed 913 --out out/blind/wild
    blind/.venv/bin/python -m blind.calibrate out/blind/usual out/blind/wild

The hypotheses of each report (`posterior.hypotheses`) are weighed anew with other numbers: the odds against an effect,
a value that varies, another number that is off, and too much that is left. The temper is that of the runs.
The best numbers give the truth the greatest logarithm of its probability, each set counting alike: usual sets
share their tolerances with the prior, wild ones do not. A verdict is read from them as the program does
(src/diagnose/decision.rs), but for the check on what a fit has not seen.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomllib
from scipy.optimize import minimize

from . import measures
from .diagnose import CALIBRATION
from .make import folder_of

NAMES = ("odds", "varying_odds", "other_odds", "misfit.odds")
FREEDOM = 4.0  # of the tolerances' Student's t, as beliefs.rs has it
LEAST = 0.01  # probability below which a truth is lost, whatever its probability is
ALIKE = 0.1  # as decision.rs has it


# Evidence and narrowing in a world, by the scale of its tolerances.
Terms = dict[float, tuple[float, float]]


@dataclass(frozen=True)
class Case:
    """A case: its label, and what its hypotheses are weighed by."""

    label: dict
    #: Of each set of effects.
    sets: dict[tuple[str, ...], Terms]
    #: Set that it comes upon, what says so, and its own terms; the logarithm of a misfit's size.
    unknown: list[tuple[tuple[str, ...], str, Terms, float]]


def read(folder: Path, answer: str) -> list[Case]:
    """The cases of a development set that have a posterior."""
    found = []
    for label in json.loads((folder / "labels.json").read_text(encoding="utf-8")):
        place = folder_of(folder, label["case"]) / answer / "report.json"
        report = json.loads(place.read_text(encoding="utf-8")) if place.exists() else {}
        if report.get("posterior"):
            found.append(case_of(label, report))
    return found


def case_of(label: dict, report: dict) -> Case:
    """What a report's hypotheses are weighed by."""
    sets, unknown = {}, []
    for it in report["posterior"]["hypotheses"]:
        terms = {term["factor"]: (term["evidence"], term["narrowing"]) for term in it["terms"]}
        why = it.get("not_in_library")
        if why is None:
            sets[_key(it)] = terms
            continue
        size = 0.0
        if " times as much " in why:
            what, size = "misfit", math.log(max(0.05, float(why.split()[0])))
        else:
            what = "other" if why.endswith(" is off") else "varying"
        unknown.append((_key(it), what, terms, size))
    return Case(label, sets, unknown)


def _key(of: dict) -> tuple[str, ...]:
    return tuple(sorted(of["effects"]))


def posterior(case: Case, numbers: np.ndarray, misfit: dict) -> tuple[dict[tuple[str, ...], float], float]:
    """Probability of each set of effects, and that the cause is not in the library (src/diagnose/calibration.rs)."""
    odds, varying, other, left = numbers
    density = lambda x, mean, deviation: -0.5 * ((x - mean) / deviation) ** 2 - math.log(deviation)  # noqa: E731
    weight = lambda terms, scale: 0.5 * terms[scale][0] - terms[scale][1]  # noqa: E731

    def of_set(key: tuple[str, ...], scale: float) -> float:
        prior = -FREEDOM * math.log(scale) - 0.5 * FREEDOM / scale**2
        return weight(case.sets[key], scale) - odds * len(key) + prior

    sets = {key: [of_set(key, scale) for scale in terms] for key, terms in case.sets.items()}
    unknown = []
    for key, what, terms, of_misfit in case.unknown:
        size = max(of_misfit, misfit["known"][0])
        more = {
            "misfit": density(size, *misfit["outside"]) - density(size, *misfit["known"]) - left,
            "varying": -varying,
            "other": -other,
        }[what]
        unknown += [
            of_set(key, scale) + weight(terms, scale) + more for scale in terms if scale in case.sets.get(key, {})
        ]
    best = max(itertools.chain(unknown, *sets.values()))
    shares = {key: sum(math.exp(weight - best) for weight in weights) for key, weights in sets.items()}
    outside = sum(math.exp(weight - best) for weight in unknown)
    total = sum(shares.values()) + outside
    return {key: share / total for key, share in shares.items()}, outside / total


def decide(sets: dict[tuple[str, ...], float], outside: float) -> tuple[dict, float]:
    """Verdict and probability, as src/diagnose/decision.rs has them, in the form of a report."""
    best, named = max(((p, key) for key, p in sets.items() if key), default=(0.0, ()))
    classes = []
    for own in named:
        beside = set(named) - {own}
        near = (set(key) for key, p in sets.items() if len(key) == len(named) and p >= ALIKE * best)
        alike = (key - set(named) for key in near if beside <= key)
        classes.append({own}.union(*alike))
    inside = [p for key, p in sets.items() if len(key) == len(named) and _fits(key, classes)] if named else []
    choices = [("none", sets.get((), 0.0)), ("effect", sum(inside)), ("not_in_library", outside)]
    kind, probability = max(choices, key=lambda choice: choice[1])
    effects = [{"id": own, "class": sorted(of)} for own, of in zip(named, classes)] if kind == "effect" else []
    return {"verdict": {"kind": kind, "effects": effects}}, probability


def _fits(key: tuple[str, ...], classes: list[set[str]]) -> bool:
    return any(all(own in of for own, of in zip(order, classes)) for order in itertools.permutations(key))


def truth(case: Case, sets: dict[tuple[str, ...], float], outside: float) -> float:
    """Probability of what was put in."""
    if case.label["kind"] == "outside":
        return outside
    return sets.get(tuple(sorted(case.label["causes"])), 0.0)


def loss(sets: list[list[Case]], numbers: np.ndarray, misfit: dict) -> float:
    """Mean of minus the logarithm of the truth's probability, each set counting alike."""
    if min(numbers) < 0.0:
        return 1e9
    of_case = lambda case: -math.log(max(truth(case, *posterior(case, numbers, misfit)), LEAST))  # noqa: E731
    return float(np.mean([np.mean([of_case(case) for case in cases]) for cases in sets]))


def summary(cases: list[Case], numbers: np.ndarray, misfit: dict) -> str:
    """How the verdicts would fare: shares right by kind, names that are wrong, calibration error."""
    right: dict[str, list[bool]] = {}
    names, confidence, hits = [], [], []
    for case in cases:
        report, probability = decide(*posterior(case, numbers, misfit))
        is_right = measures.in_class(case.label, report)
        right.setdefault(case.label["kind"], []).append(is_right and probability >= 0.5)
        confidence.append(probability)
        hits.append(is_right)
        if measures.named(report) and probability >= 0.5:
            names.append(is_right)
    shares = ", ".join(f"{kind} {sum(of)} of {len(of)}" for kind, of in sorted(right.items()))
    bins = np.minimum((np.array(confidence) * 10).astype(int), 9)
    gaps = [abs(np.mean(np.array(confidence)[bins == b]) - np.mean(np.array(hits)[bins == b])) * np.mean(bins == b)
            for b in set(bins)]  # fmt: skip
    return f"{shares}; names wrong {names.count(False)} of {len(names)}; ECE {sum(gaps):.3f}"


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(
        prog="python -m blind.calibrate", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sets", type=Path, nargs="+", help="folders of development sets")
    parser.add_argument("--answer", default="answer", help="folder of the answers within the cases")
    options = parser.parse_args()
    now = tomllib.loads(CALIBRATION.read_text(encoding="utf-8"))
    start = np.array([now[n] if "." not in n else now["misfit"][n.split(".")[1]] for n in NAMES])
    misfit = now["misfit"]
    sets = [read(folder, options.answer) for folder in options.sets]
    starts = (start, start * 0.7, start * 1.4)
    fits = [
        minimize(lambda x: loss(sets, x, misfit), s, method="Nelder-Mead", options={"maxiter": 600}) for s in starts
    ]
    best = min(fits, key=lambda fit: fit.fun)
    for what, numbers in (("as it is", start), ("best", best.x)):
        listed = ", ".join(f"{name} = {value:.2f}" for name, value in zip(NAMES, numbers))
        print(f"{what}: {listed}; loss {loss(sets, numbers, misfit):.3f}")
        for folder, cases in zip(options.sets, sets):
            print(f"  {folder.name}, {len(cases)} cases: {summary(cases, numbers, misfit)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
