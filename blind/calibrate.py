"""What development sets say of the calibration of the diagnosis.

What it prints goes into src/diagnose/calibration.toml by hand: a change of thresholds is a decision.

    blind/score --development --kind none --count 40 --out out/blind/sound
    blind/score --development --count 60
    blind/.venv/bin/python -m blind.calibrate out/blind/sound out/blind/development

- thresholds: what 95 % of the sound logs stay under, for tyres and body and for the rest, with and without a reference;
- what second effects add to logs with one, and rests of what is in the library and what is not;
- the factor that brings the intervals of named values to 95 %;
- probabilities: logistic in the margin, for a scoring set's mix of kinds; of effects also in what is left, strained and
  varying, as shares of the thresholds of these, in how unsure the least sure value is, and in how many there are.

What another effect says for one that the library does not have is best learned from answers without the true one
(`--without`, made with `rfl diagnose --without EFFECT`): they count as half of the causes outside.

All are a handful of scalars. More of the generator must not come into the diagnosis: a covariance of all tolerances,
learned from sound logs, was tried and left out for that (docs/results/diagnosis.md).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import tomllib

from . import measures
from .cases import KINDS
from .diagnose import CALIBRATION
from .make import folder_of

STRUCTURAL = {*measures.STAGES["tyre"], *measures.STAGES["body"]}
VERDICTS = (
    ("effect", "effect", [-1.0, 0.9, 0.0, 0.0, 0.0, 0.0, 0.0]),
    ("none", "nothing", [1.0, 0.5]),
    ("not_in_library", "unknown", [0.0, 0.5]),
)
THRESHOLDS = tomllib.loads(CALIBRATION.read_text(encoding="utf-8"))
# What the probability of an effect goes by; those of other verdicts by the first two.
OF_EFFECT = ("constant", "margin", "left", "strained", "varying", "unsure", "further")


def logistic(features: np.ndarray, right: np.ndarray, weights: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Coefficients of a logistic regression of weighted cases, drawn towards `at` as if by a case in any units."""
    b = at.astype(float).copy()
    drawn = np.where(features.std(axis=0) > 0.0, features.var(axis=0), 1.0)
    for _ in range(100):
        p = 1.0 / (1.0 + np.exp(-features @ b))
        slope = features.T @ (weights * (right - p)) - drawn * (b - at)
        curve = features.T @ (features * (weights * p * (1.0 - p))[:, None]) + np.diag(drawn)
        b += np.clip(np.linalg.solve(curve, slope), -1.0, 1.0)
    return b


def read_answers(folders: list[Path], answer: str) -> list[tuple[dict, dict]]:
    """Labels and reports of development sets."""
    found = []
    for folder in folders:
        for label in json.loads((folder / "labels.json").read_text(encoding="utf-8")):
            report = folder_of(folder, label["case"]) / answer / "report.json"
            if report.exists():
                found.append((label, json.loads(report.read_text(encoding="utf-8"))))
    return found


def greatest(report: dict, structural: bool) -> float:
    """Greatest evidence of a single effect, of tyres and body or of the rest."""
    of = [c for c in report["candidates"] if len(c["effects"]) == 1 and (c["effects"][0] in STRUCTURAL) == structural]
    return max((c["evidence"] for c in of), default=0.0)


def line(name: str, values: list[float], share: float) -> str:
    """A quantile beside the largest values."""
    if not values:
        return f"# {name}: none\n"
    return f"# {name}: {np.quantile(values, share):.1f}; {len(values)}, the largest {np.sort(values)[-5:].round(1)}\n"


def features(report: dict) -> list[float]:
    """The values of `OF_EFFECT`, as `Calibration::of_effect` has them."""
    scores = report["scores"]
    shares = {name: max(scores[name], 0.0) / THRESHOLDS.get(name, 1.0) for name in OF_EFFECT[2:-1]}
    shares["left"] = min(shares["left"], 1.0) * min(scores["excess"] / THRESHOLDS["outside"], 1.0)
    margin = np.log1p(np.clip(scores["margin"], 0.0, THRESHOLDS["effect"]["clear"]))
    return [1.0, margin, *shares.values(), max(len(report["verdict"]["effects"]) - 1, 0)]


def calibration(cases: list[tuple[dict, dict]], removed: list[tuple[dict, dict]], share: float = 0.95) -> str:
    """All that was found, as comments and lines of TOML; `removed` are answers without the true effect."""
    text = f"# {len(cases)} cases\n"
    sound = [(label, r) for label, r in cases if label["kind"] == "none"]
    for truck in (False, True):
        for reference in (False, True):
            own = [r for label, r in sound if label["truck"] == truck and label["reference"] == reference]
            name = ("truck" if truck else "car") + (" with reference" if reference else "")
            for structural in (True, False):
                what = "structural" if structural else "other"
                text += line(f"{name}, {what}", [greatest(r, structural) for r in own], share)
    single = [r for label, r in cases if label["kind"] == "single" and measures.named(r)]
    text += line("second effects", [r["scores"]["pair"] for r in single], share)
    inside = [r for label, r in cases if label["kind"] != "outside" and r["scores"]["left"] > 0.4]
    outside = [r for label, r in cases if label["kind"] == "outside" and r["scores"]["left"] > 0.4]
    text += line("rest, in the library", [r["scores"]["excess"] for r in inside], share)
    text += line("rest, outside", [r["scores"]["excess"] for r in outside], 0.5)
    for which in ("in the library", "outside"):
        own = [r for label, r in cases if (label["kind"] == "outside") == (which == "outside")]
        text += line(f"varying, {which}", [r["scores"]["varying"] for r in own], share)
    # A development set has as many of a kind as one likes; probabilities are for the mix of a scoring set.
    count = Counter(label["kind"] for label, _ in cases)
    weight = {kind: KINDS[kind] / number * len(cases) for kind, number in count.items()}
    off = []
    for label, report in cases:
        for effect in report["verdict"]["effects"]:
            if effect["id"] in label["causes"] and label["kind"] in ("single", "pair"):
                half = max(effect["high"] - effect["low"], 1e-12) / 2.0
                off.append(abs(label["values"][effect["id"]] - (effect["high"] + effect["low"]) / 2.0) / half)
    text += line("off by half widths", off, share)
    if removed:
        weight["outside"] = weight.get("outside", 0.0) / 2.0
        weight["removed"] = weight["outside"] * count["outside"] / len(removed)
    for kind, name, at in VERDICTS:
        own = [(label["kind"], measures.in_class(label, r), r) for label, r in cases if measures.kind(r) == kind]
        if kind == "effect":
            own += [("removed", False, r) for _, r in removed if measures.kind(r) == kind]
        if own:
            columns = [features(report)[: len(at)] for _, _, report in own]
            right = np.array([is_right for _, is_right, _ in own], float)
            weights = np.array([weight[of] for of, _, _ in own])
            fitted = logistic(np.array(columns), right, weights, np.array(at))
            weighted = np.average(right, weights=weights)
            of_all = f"{int(right.sum())} of {len(own)} right, weighted {weighted:.2f}"
            values = fitted.round(2).tolist()
            if kind == "effect":
                named = dict(zip(OF_EFFECT, values)) | {"clear": THRESHOLDS["effect"]["clear"]}
                values = "{ " + ", ".join(f"{of} = {value}" for of, value in named.items()) + " }"
            text += f"{name} = {values} # {of_all}\n"
    return text


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(
        prog="python -m blind.calibrate", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sets", type=Path, nargs="+", help="folders of development sets")
    parser.add_argument("--answer", default="answer", help="folder of the answers within the cases")
    parser.add_argument("--without", help="folder of the answers without the true effect")
    options = parser.parse_args()
    removed = read_answers(options.sets, options.without) if options.without else []
    print(calibration(read_answers(options.sets, options.answer), removed))
    return 0


if __name__ == "__main__":
    sys.exit(main())
