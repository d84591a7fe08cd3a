"""Negative controls: what the diagnosis says where it ought to say less.

- The true effect is removed from the library: the verdict must not be a confident other name.
- The same drive with new sensor noise: the same name.
- The gap reversed in time, on the simulator's own replay of the commands: it has the size and colour of the real one,
but no
  effect makes it. It must name nothing with confidence.
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

from . import diagnose, measures, plant, sensors
from .cases import Case, Set, combined, make, vehicle_of
from .make import folder_of

CONFIDENT = 0.8


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
    """Shares over the first `most` single effects that were named rightly."""
    chosen = [
        (label, report)
        for label, report in zip(labels, reports)
        if label["kind"] == "single" and measures.exact(label, report)
    ][:most]
    folders = [folder_of(out, label["case"]) for label, _ in chosen]
    causes = {folder: label["causes"][0] for folder, (label, _) in zip(folders, chosen)}
    without = diagnose.diagnose_all(rfl, folders, jobs, "without", lambda f: ("--without", causes[f]), say)
    anew, reversed_ = [], []
    for label, _ in chosen:
        case = again(cases, label)
        noisy, turned = out / f"noise_{case.number:03d}", out / f"reversed_{case.number:03d}"
        own = folder_of(out, case.number)
        for folder in (noisy, turned):
            shutil.copytree(own, folder, ignore=shutil.ignore_patterns("answer", "without", "log.csv.gz"))
        anew.append(noisy)
        other = replace(case.suite, seed=case.suite.seed + 17)
        sensors.write(sensors.log(case.truth, combined(case.background, case.values), other), noisy / "log.csv.gz")
        try:
            sensors.write(reverse(case, own / "vehicle.toml"), turned / "log.csv.gz")
        except RuntimeError as error:
            # Commands of a loaded vehicle at its limit may roll the simulator over: there is no replay to add a gap to.
            say(f"case {case.number}, reversed: {error}")
            continue
        (turned / "reference.csv.gz").unlink(missing_ok=True)
        reversed_.append(turned)
    noise = diagnose.diagnose_all(rfl, anew, jobs, say=say)
    turned = diagnose.diagnose_all(rfl, reversed_, jobs, say=say)

    def confident(report: dict) -> bool:
        return measures.kind(report) == "effect" and report["verdict"]["probability"] > CONFIDENT

    return {
        "true effect removed, confident other name": measures.share(map(confident, without)),
        "new noise, the same name": measures.share(
            measures.named(a) == measures.named(b) for a, (_, b) in zip(noise, chosen)
        ),
        "gap reversed in time, confident name": measures.share(map(confident, turned)),
    }


def again(cases: Set, label: dict) -> Case:
    """The case of a label, made again from its set."""
    number = label["case"]
    return make(cases, number, cases.plan()[number], vehicle_of(cases.designs(), label["vehicle"]))


def reverse(case: Case, vehicle: Path) -> dict[str, np.ndarray]:
    """The simulator's replay with the case's gap added backwards; without place and yaw, which gather errors."""
    commands = case.truth.steer_cmd, case.truth.accel_cmd
    replayed = plant.run(vehicle, case.design.is_truck, case.conditions, commands=commands)
    log = {name: column for name, column in case.log.items() if name not in ("x", "y", "yaw")}
    time = np.arange(len(replayed["vx"])) * case.conditions.sample
    for name in log:
        if name in replayed:
            simulated = np.interp(log["time"], time, replayed[name])
            gap = log[name] - simulated
            # A gap that begins with a jump is none that a log can have: speeds start alike.
            log[name] = simulated + gap[::-1] - (gap[-1] if name == "vx" else 0.0)
    return log
