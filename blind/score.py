"""One command: makes a set from a secret seed, runs the diagnosis, opens the labels, prints and records the score.

    blind/score                                  the scoring set: 400 cases, a new secret seed, one run, recorded
    blind/score --development --count 60         the development set: other vehicles and roads, nothing recorded
    blind/score --seed 12345                     a seed of one's own (a second one gives the same picture)

Order of things: the labels are sealed, and their salted hash, that of the diagnosing program, of its thresholds and of
this generator are written to `commitment.json` and printed; then the diagnosis runs on the logs; then the seal is
broken and the answers are scored. Every run on a scoring set is added to the record in docs/results (record.py),
whatever it says.
"""

from __future__ import annotations

import argparse
import json
import secrets
import shutil
import sys
import time
from pathlib import Path

from scripts.provenance import provenance

from . import baselines, controls, diagnose, manoeuvres, measures, record, route, seal
from .cases import KINDS, Set
from .make import folder_of, make_set
from .vehicles import ROOT

# The seed of the development set, if none is given.
DEVELOPMENT_SEED = 20261121


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    options = _parser().parse_args(arguments)
    rfl = options.rfl.resolve()
    if not rfl.is_file():
        print(f"blind/score: no program at {rfl}; build it with: cargo build --release --bin rfl", file=sys.stderr)
        return 1
    seed = options.seed
    if seed is None:
        seed = DEVELOPMENT_SEED if options.development else secrets.randbits(64)
    name = ("development" if options.development else "scoring") + ("-wild" if options.wild else "")
    out = (options.out or ROOT / "out" / "blind" / name).resolve()
    if out.exists():
        shutil.rmtree(out)
    out.mkdir(parents=True)

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    cases = Set(
        seed,
        options.development,
        options.count,
        not options.trucks_only,
        not options.cars_only,
        options.longest,
        options.kind,
        options.wild,
    )
    begin = time.perf_counter()
    only = list(range(*options.only)) if options.only else None
    labels = make_set(cases, out, options.jobs, say, only)
    made = time.perf_counter() - begin
    say(f"{len(labels)} cases in {made:.0f} s")

    salt = secrets.token_bytes(16)
    commitment = {
        "set": name,
        "cases": len(labels),
        "labels": seal.close(labels, seed, salt, out / "labels.sealed"),
        "program": seal.hash_of(rfl),
        **provenance(rfl, ROOT),
        "thresholds": seal.hash_of(diagnose.CALIBRATION),
        "generator": seal.hash_of_sources(ROOT / "blind"),
        "written": time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime()),
    }
    (out / "commitment.json").write_text(json.dumps(commitment, indent=2) + "\n", encoding="utf-8")
    say("before the diagnosis: " + json.dumps(commitment))
    if options.development:
        # Nothing to hide here: blind/calibrate.py reads them.
        (out / "labels.json").write_text(json.dumps(labels) + "\n", encoding="utf-8")
    numbers = [label["case"] for label in labels]
    del labels

    folders = [folder_of(out, number) for number in numbers]
    reports = diagnose.diagnose_all(rfl, folders, options.jobs, say=say)
    (out / "reports.json").write_text(json.dumps(reports) + "\n", encoding="utf-8")
    if seal.hash_of(rfl) != commitment["program"]:
        print("blind/score: the program changed while it was scored; the run does not count", file=sys.stderr)
        return 1

    labels = seal.open_labels(out / "labels.sealed", seed, commitment["labels"])
    result = measures.score(labels, reports)
    result["made_seconds_per_case"] = made / max(len(labels), 1)

    def add(name: str, most: int, measure) -> None:
        """A further measure; one that fails is said, and the score is recorded all the same."""
        if most:
            try:
                result[name] = result.get(name, {}) | measure(most)
            except Exception as error:
                say(f"{name} failed: {type(error).__name__}: {error}")
                result.setdefault("failed", []).append(f"{name}: {type(error).__name__}: {error}")

    case_files = cases, labels, reports, out
    run_again = rfl, options.controls, options.jobs, say
    add("routes", options.routes, lambda most: route.measure(*case_files, most, say))
    add("controls", options.controls, lambda _: controls.measure(*case_files, *run_again))
    add("controls", options.controls, lambda _: manoeuvres.measure(*case_files, *run_again))
    add("baselines", options.baselines, lambda most: baselines.measure(cases, labels, out, most, options.jobs, say))
    run = {"commitment": commitment | {"salt": salt.hex(), "seed": seed}, "result": result}
    run["cases"] = record.rows(labels, reports)
    (out / "score.json").write_text(json.dumps(run, indent=1) + "\n", encoding="utf-8")
    record.plots(result, out)
    print(record.table(result))
    print(record.listing(run["cases"]))
    if not options.development and not options.only and not options.kind:
        record.add(run, ROOT / "docs" / "results", out)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="blind/score", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=400, help="cases (default: %(default)s)")
    parser.add_argument("--seed", type=int, help="the set's seed (default: secret; of the development set a fixed one)")
    parser.add_argument("--development", action="store_true", help="other vehicles and roads; not recorded")
    parser.add_argument(
        "--only", type=int, nargs=2, metavar=("FROM", "TO"), help="cases FROM to before TO; not recorded"
    )
    parser.add_argument("--wild", action="store_true", help="a world that the diagnosis's prior did not make (wild.py)")
    parser.add_argument("--cars-only", action="store_true", help="no trucks")
    parser.add_argument("--trucks-only", action="store_true", help="no cars")
    parser.add_argument("--kind", choices=sorted(KINDS), help="cases of this kind only; not recorded")
    parser.add_argument("--longest", type=float, default=120.0, help="longest drive in s (default: %(default)s)")
    parser.add_argument("--rfl", type=Path, default=ROOT / "target" / "release" / "rfl", help="the program")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: %(default)s)")
    parser.add_argument("--out", type=Path, help="folder for the set (default: out/blind/...); emptied first")
    parser.add_argument("--routes", type=int, default=0, help="how many named cases are driven on another route (FMUs)")
    parser.add_argument("--baselines", type=int, default=0, help="baselines; how many cases the classifier learns from")
    parser.add_argument("--controls", type=int, default=0, help="how many named cases get negative controls")
    return parser


if __name__ == "__main__":
    sys.exit(main())
