"""Whether a verdict hangs on how a logger writes: the same drives, in one convention after another.

    python -m blind.conventions                  60 sound drives and 60 with one effect; a new secret seed; hours
    python -m blind.conventions --count 20 --longest 60 --jobs 2

A drive is written as the documentation asks, and then once with each convention alone. The verdict is **the same**
where its kind and its named effects are those of the plain log. A log that is refused, or of which the program says
that it cannot tell, with a finding that the plain log does not have, is counted apart: that is no other verdict.
"""

from __future__ import annotations

import argparse
import json
import os
import secrets
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from . import diagnose, sensors
from .cases import CannotDraw, Case, Set, combined, make
from .measures import wilson
from .vehicles import ROOT, write_file
from .wild import Conventions

Columns = dict[str, np.ndarray]

PLAIN = Conventions(False, 1.0, 0.0, 0.0, False, False, False, 0)
#: Height of a car's reference point over the road, m: that of the body's axes above the ground.
HEIGHT = 0.5


def of_the_road(columns: Columns) -> Columns:
    """The pose of a point on the road below: a body that rolls to the right has its upper parts right of it."""
    if "roll" not in columns or "y" not in columns:
        return columns
    out, shift = dict(columns), HEIGHT * columns["roll"]
    out["x"] = columns["x"] - np.sin(columns["yaw"]) * shift
    out["y"] = columns["y"] + np.cos(columns["yaw"]) * shift
    if "vy" in columns:
        out["vy"] = columns["vy"] + np.gradient(shift, columns["time"])
    return out


def jittered(columns: Columns, rng: np.random.Generator) -> Columns:
    """Rows at uneven times: a fifth of a step early or late, what is logged being of that time."""
    time = columns["time"]
    step = float(np.median(np.diff(time)))
    new = np.clip(time + step * rng.uniform(-0.2, 0.2, len(time)), time[0], time[-1])
    new = np.maximum.accumulate(new)
    held = ("steer_cmd", "accel_cmd")
    return {
        name: new if name == "time" else column if name in held else np.interp(new, time, column)
        for name, column in columns.items()
    }


def writings(case: Case) -> dict[str, Columns]:
    """The log of a case, as each convention writes it."""
    own = combined(case.background, case.values)

    def written(how: Conventions) -> Columns:
        return sensors.log(case.truth, own, case.suite, replace(how, seed=case.suite.seed))

    plain = written(PLAIN)
    return {
        "plain": plain,
        "level frame": written(replace(PLAIN, level=True)),
        "roll to the other side": written(replace(PLAIN, roll_sign=-1.0)),
        "pose of the road": of_the_road(plain),
        "jittered": jittered(plain, np.random.default_rng(case.suite.seed)),
        "outliers": written(replace(PLAIN, outliers=0.001)),
    }


def put(cases: Set, number: int, out: Path) -> dict | None:
    """Writes the logs of a case; its label, or nothing where none can be drawn."""
    plan = cases.plan()[number]
    design = next(design for design in cases.designs() if design.name == plan.vehicle)
    try:
        case = make(cases, number, replace(plan, reference=False), design)
    except CannotDraw:
        return None
    folder = out / f"{plan.kind}{number:03}"
    folder.mkdir(parents=True)
    write_file(cases.file_of(design), folder).rename(folder / "vehicle.toml")
    for name, columns in writings(case).items():
        sensors.write(columns, folder / f"{name.replace(' ', '_')}.csv.gz")
    return {"folder": folder.name, **case.label()}


def said(report: dict) -> tuple[str, tuple[str, ...]]:
    """Kind and effects of a verdict."""
    if "error" in report:
        return "refused", ()
    verdict = report["verdict"]
    return verdict["kind"], tuple(sorted(effect["id"] for effect in verdict["effects"]))


def compared(plain: dict, other: dict) -> str:
    """`same`, `refused` (or untold) or `other`."""
    if said(plain) == said(other):
        return "same"
    return "refused" if said(other)[0] in ("refused", "cannot_tell") else "other"


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m blind.conventions", description=__doc__.split("\n", 1)[0])
    parser.add_argument("--count", type=int, default=60, help="drives of each kind (default 60)")
    parser.add_argument("--longest", type=float, default=120.0, help="longest drive in s (default 120)")
    parser.add_argument("--seed", type=int, help="of the drives (default: a new secret one)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="diagnoses at a time")
    parser.add_argument("--no-pairs", action="store_true", help="single effects only: a third of the time")
    parser.add_argument("--rfl", type=Path, default=ROOT / "target/release/rfl", help="the program")
    parser.add_argument("--out", type=Path, default=ROOT / "out/blind/conventions", help="folder, a new one")
    options = parser.parse_args(arguments)
    seed = secrets.randbits(64) if options.seed is None else options.seed

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    labels: list[dict] = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for kind in ("none", "single"):
            cases = Set(seed, False, options.count, longest=options.longest, kind=kind)
            made = pool.map(put, *zip(*((cases, number, options.out) for number in range(options.count))))
            labels += [label for label in made if label]
    say(f"{len(labels)} drives, seed {seed}")
    more: Callable[[Path], tuple[str, ...]] = lambda _: ("--no-pairs",) if options.no_pairs else ()  # noqa: E731
    folders = [options.out / label["folder"] for label in labels]
    reports: dict[str, list[dict]] = {}
    for log in sorted(folders[0].glob("*.csv.gz"), key=lambda path: path.name != "plain.csv.gz"):
        name = log.name.removesuffix(".csv.gz")
        reports[name] = diagnose.diagnose_all(options.rfl, folders, options.jobs, name, more, say, log.name)
    refused = [report["error"] for report in reports["plain"] if "error" in report]
    if refused:
        print(f"{len(refused)} plain logs are refused, such as: {refused[0]}", file=sys.stderr)
        return 1
    rows = []
    for name, found in reports.items():
        for kind in ("none", "single"):
            of = [i for i, label in enumerate(labels) if label["kind"] == kind]
            how = [compared(reports["plain"][i], found[i]) for i in of]
            others = [(labels[i]["folder"], *map(said, (reports["plain"][i], found[i]))) for i in of]
            row = {"convention": name, "kind": kind, **{word: how.count(word) for word in ("same", "refused", "other")}}
            row["differ"] = [entry for entry, word in zip(others, how) if word != "same"]
            rows.append(row)
            low, high = wilson(row["same"] + row["refused"], len(of))
            print(
                f"{name:24} {kind:7} same {row['same']} of {len(of)}, refused {row['refused']}, other {row['other']}"
                f" ({100 * low:.0f} to {100 * high:.0f} % same or refused)"
            )
    result = {"seed": seed, "options": {"count": options.count, "longest": options.longest}, "rows": rows}
    (options.out / "conventions.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
