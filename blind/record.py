"""Tables, plots and the record of all scoring runs.

The record is one table, `docs/results/blind-runs.jsonl.gz`: a line for each run with its number, commitment, result and
cases. Two files are made from it: `blind.json`, the runs of the newest program without their cases, and `blind.md`.

    python -m blind.record --rewrite    makes blind.json and blind.md anew from the table; the plots stay
    python -m blind.record --run 38     prints one run: its score and all its cases
"""

from __future__ import annotations

import argparse
import gzip
import io
import json
import shutil
import sys
from pathlib import Path

from scripts.provenance import program_text

from . import measures, route

RESULTS = Path(__file__).resolve().parents[1] / "docs" / "results"
TABLE = "blind-runs.jsonl.gz"

# Goals of the specification: measure, text, limit, whether more is better.
GOALS = (
    ("moderate", "moderate single, exact or class", 0.90, True),
    ("small", "small single, exact or class", 0.75, True),
    ("pair_both", "pairs, both", 0.80, True),
    ("pair_one", "pairs, at least one", 0.97, True),
    ("false_alarms", "none: false alarms", 0.05, False),
    ("outside_found", "out of library: found", 0.75, True),
    ("false_flags", "false flags of 'not in library'", 0.05, False),
)
FURTHER = (
    ("moderate_exact", "moderate single, exact"),
    ("small_exact", "small single, exact"),
    ("single_top3", "single, among the first three"),
    ("cars", "single, cars"),
    ("trucks", "single, trucks"),
    ("with_reference", "single, with a reference log"),
    ("without_reference", "single, without"),
    ("clear_single", "single, four tolerances off or more: exact or class"),
    ("clear_pair", "pairs, each four tolerances off or more: both"),
    ("shown_single", "single, large enough for its log to show it: exact or class"),
    ("shown_pair", "pairs, each large enough for its log to show it: both"),
    ("hidden_pair", "pairs, the other ones: both"),
    ("pair_top3", "pairs, among the first three pairs"),
    ("stage", "stage at which the gap enters"),
    ("interval_covers", "95 % intervals hold the true value"),
    ("cannot_tell", "verdict 'cannot tell'"),
    ("errors", "no report"),
    ("wrong_names", "names that were not put in"),
    ("wrong_names_of_unit", "... of which the unit's own number is four tolerances off, to that side"),
)


# Sets whose tolerances are the prior's, and worlds that no prior made.
WORLDS = {"scoring": "usual", "scoring-wild": "wild"}


def percent(value: float | None) -> str:
    """A share as text."""
    return "-" if value is None else f"{100.0 * value:.0f} %"


def _share(of: dict) -> str:
    if not of["count"]:
        return "no case"
    interval = f"{100.0 * of['low']:.0f} to {100.0 * of['high']:.0f}"
    return f"{percent(of['share'])} ({of['hits']} of {of['count']}; {interval})"


def lines(result: dict) -> list[tuple[str, str, str]]:
    """Measure, value with its 95 % interval, goal."""
    found = []
    for key, text, limit, more in GOALS:
        met = ""
        if result[key]["count"]:
            ok = result[key]["share"] >= limit if more else result[key]["share"] <= limit
            met = ", met" if ok else ", missed"
        found.append((text, _share(result[key]), f"{'>=' if more else '<='} {percent(limit)}{met}"))
    numbers = [
        ("calibration error (ECE)", result["ece"], "<= 0.08", 0.08),
        ("parameter error, median", result["value_error"], "<= 0.10", 0.10),
    ]
    for text, value, goal, limit in numbers:
        met = "" if value is None else (", met" if value <= limit else ", missed")
        found.append((text, "-" if value is None else f"{value:.3f}", goal + met))
    routes = result.get("routes", {})
    if routes.get("closed_loop_calibrated") is not None:
        value = routes["closed_loop_calibrated"]
        met = "met" if value >= 0.9 else "missed"
        found.append(("other route, closed loop: gap closed, median", percent(value), f">= 90 %, {met}"))
    # Runs before a measure was thought of have it not.
    found += [(text, _share(result[key]), "") for key, text in FURTHER if key in result]
    credit, f1 = result["single_credit"], result["pair_f1"]
    found += [
        ("single, penalised by the class's size", "-" if credit is None else f"{credit:.2f}", ""),
        ("pairs, F1", "-" if f1 != f1 else f"{f1:.2f}", ""),
        ("own log, held out: yaw-rate gap closed by the effect", percent(result["own_log_effect"]), ""),
        ("... and with recalibration", percent(result["own_log_recalibrated"]), ""),
        ("time a case, median and longest", f"{result['seconds_median']:.1f} s, {result['seconds_most']:.1f} s", ""),
        ("... of processor", f"{result['cpu_seconds_median']:.1f} s, {result['cpu_seconds_most']:.1f} s", ""),
    ]
    for key, text in (("open", "other route, open loop"), ("closed", "other route, closed loop")):
        for who in route.SIMULATORS:
            value = routes.get(f"{key}_loop_{who}")
            if value is not None and (key, who) != ("closed", "calibrated"):
                found.append((f"{text}: {who.replace('_', '-')}", percent(value), f"{routes['cases']} cases"))
    for text, value in result.get("controls", {}).items():
        shown = _share(value) if isinstance(value, dict) else str(value)
        found.append((f"control: {text}", shown, ""))
    found += [("failed", text, "") for text in result.get("failed", [])]
    for text, value in result.get("baselines", {}).items():
        alarms = _share(value["false_alarms"])
        found.append((f"baseline {text}: single, right", _share(value["single"]), f"false alarms {alarms}"))
    return found


def table(result: dict) -> str:
    """The score as text."""
    rows = [("measure", "value (95 % interval)", "goal"), *lines(result)]
    width = [max(len(row[i]) for row in rows) for i in range(2)]
    return "\n".join(f"{a:<{width[0]}}  {b:<{width[1]}}  {c}".rstrip() for a, b, c in rows)


def rows(labels: list[dict], reports: list[dict]) -> list[dict]:
    """One row a case: the truth, the answer, whether it was right."""
    found = []
    for label, report in zip(labels, reports):
        verdict = report.get("verdict", {})
        found.append(
            {
                "case": label["case"],
                "vehicle": label["vehicle"],
                "kind": label["kind"],
                "causes": label["causes"],
                "values": label["values"],
                "dominance": label["dominance"].get(""),
                "reference": label["reference"],
                "duration": label["duration"],
                "verdict": measures.kind(report),
                "probability": verdict.get("probability"),
                "named": [
                    {key: effect[key] for key in ("id", "value", "low", "high", "class", "dominance")}
                    for effect in verdict.get("effects", [])
                ],
                "first": [
                    {key: c[key] for key in ("effects", "values", "evidence")} for c in report.get("candidates", [])[:3]
                ],
                "error": report.get("error"),
                "exact": measures.exact(label, report),
                "in_class": measures.in_class(label, report),
                "seconds": report["seconds"],
            }
        )
    return found


def listing(of: list[dict]) -> str:
    """The cases as text."""
    found = []
    for row in of:
        truth = " + ".join(f"{cause} {row['values'].get(cause, 0.0):.3g}" for cause in row["causes"]) or "none"
        answer = " + ".join(
            f"{e['id']} {e['value']:.3g}" + (f" {{{', '.join(e['class'])}}}" if len(e["class"]) > 1 else "")
            for e in row["named"]
        )
        mark = "+" if row["exact"] else ("o" if row["in_class"] else "-")
        dominance = f"{row['dominance']:.2f}" if row["dominance"] is not None else "    "
        reference = " ref" if row["reference"] else ""
        if not row["exact"] and row["first"]:
            answer += " | first: " + ", ".join(f"{'+'.join(c['effects'])} {c['evidence']:.0f}" for c in row["first"])
        found.append(
            f"{mark} {row['case']:3d} {row['vehicle']:8s}{row['kind']:8s}{dominance} {truth}{reference} -> "
            f"{row['verdict']} {answer or row['error'] or ''}"
        )
    return "\n".join(found)


def plots(result: dict, out: Path) -> None:
    """Reliability diagram, accuracy over dominance, confusion matrix."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import numpy as np

    figure, axes = plt.subplots(1, 2, figsize=(10, 4))
    axes[0].plot([0, 1], [0, 1], color="grey", linewidth=1)
    for confidence, accuracy, count in result["reliability"]:
        axes[0].scatter(confidence, accuracy, s=12 + 3 * count, color="tab:blue")
        axes[0].annotate(str(count), (confidence, accuracy), textcoords="offset points", xytext=(6, -4), fontsize=8)
    axes[0].set(xlabel="probability given", ylabel="share right", xlim=(0, 1), ylim=(-0.02, 1.02))
    axes[0].set_title(f"reliability, ECE {result['ece']:.3f}", fontsize=10)
    bands = [band for band in result["by_dominance"] if band["count"]]
    middle = [(band["from"] * band["to"]) ** 0.5 for band in bands]
    value = np.array([band["share"] for band in bands])
    low = value - np.array([band["low"] for band in bands])
    high = np.array([band["high"] for band in bands]) - value
    if bands:
        axes[1].errorbar(middle, value, yerr=[np.maximum(low, 0), np.maximum(high, 0)], marker="o", capsize=3)
        for x, y, band in zip(middle, value, bands):
            axes[1].annotate(str(band["count"]), (x, y), textcoords="offset points", xytext=(6, -4), fontsize=8)
    axes[1].set(xscale="log", xlabel="dominance", ylabel="share in class", ylim=(-0.02, 1.02))
    axes[1].set_title("single effects over dominance, 95 % intervals", fontsize=10)
    figure.tight_layout()
    figure.savefig(out / "blind.png", dpi=110)
    plt.close(figure)

    confusion = result["confusion"]
    truths = list(confusion)
    answers = sorted({a if "+" not in a else "a pair" for row in confusion.values() for a in row})
    counts = np.zeros((len(truths), len(answers)))
    for i, truth in enumerate(truths):
        for answer, count in confusion[truth].items():
            counts[i, answers.index(answer if "+" not in answer else "a pair")] += count
    figure, axis = plt.subplots(figsize=(3 + 0.3 * len(answers), 2 + 0.26 * len(truths)))
    axis.imshow(counts, cmap="Blues", aspect="auto")
    for i, j in zip(*np.nonzero(counts)):
        axis.text(j, i, f"{counts[i, j]:.0f}", ha="center", va="center", fontsize=7)
    axis.set_xticks(range(len(answers)), answers, rotation=90, fontsize=7)
    axis.set_yticks(range(len(truths)), truths, fontsize=7)
    axis.set(xlabel="answer", ylabel="truth")
    figure.tight_layout()
    figure.savefig(out / "blind-confusion.png", dpi=110)
    plt.close(figure)


def read(folder: Path) -> list[dict]:
    """All runs of the table, in order; none if there is no table."""
    place = folder / TABLE
    if not place.exists():
        return []
    with gzip.open(place, "rt", encoding="utf-8") as table_of_runs:
        return [json.loads(line) for line in table_of_runs]


def save(runs: list[dict], folder: Path) -> None:
    """Writes the table: the same runs give the same bytes. The old table stays until the new one is complete."""
    buffer = io.BytesIO()
    # Neither time nor name in the header, as they would change the bytes.
    with gzip.GzipFile(filename="", mode="wb", compresslevel=9, fileobj=buffer, mtime=0) as packed:
        for run in runs:
            packed.write(json.dumps(run).encode() + b"\n")
    unfinished = folder / (TABLE + ".part")
    unfinished.write_bytes(buffer.getvalue())
    unfinished.replace(folder / TABLE)


def add(run: dict, folder: Path, plots_in: Path) -> None:
    """Adds a scoring run to the record: all runs stay, with all their cases; the newest program's largest has plots."""
    folder.mkdir(parents=True, exist_ok=True)
    runs = read(folder)
    number = 1 + max((earlier["run"] for earlier in runs), default=0)
    runs.append({"run": number} | rounded(run))
    save(runs, folder)
    if newest_program(runs)[0]["run"] == number:
        for name in ("blind.png", "blind-confusion.png"):
            shutil.copy(plots_in / name, folder / name)
    write(runs, folder)


def write(runs: list[dict], folder: Path) -> None:
    """Writes blind.json and blind.md."""
    newest = [{key: value for key, value in run.items() if key != "cases"} for run in newest_program(runs)]
    text = json.dumps({"runs": sorted(newest, key=lambda run: run["run"])}, indent=1) + "\n"
    (folder / "blind.json").write_text(text, encoding="utf-8")
    (folder / "blind.md").write_text(page(runs), encoding="utf-8")


def newest_program(runs: list[dict]) -> list[dict]:
    """Runs of the newest program, the largest first."""
    program = runs[-1]["commitment"]["program"]
    same = [run for run in runs if run["commitment"]["program"] == program]
    return sorted(same, key=lambda run: (-run["result"]["cases"], run["run"]))


def rounded(of):
    """The same with five digits a number."""
    if isinstance(of, float):
        return float(f"{of:.5g}")
    if isinstance(of, dict):
        return {key: rounded(value) for key, value in of.items()}
    return [rounded(value) for value in of] if isinstance(of, list | tuple) else of


def page(runs: list[dict]) -> str:
    """blind.md: a line for each run; the runs of the newest program beside each other, and all cases of the largest."""
    text = ["# The blind check: the record", ""]
    text += [
        "Made by `blind/score`, which `blind/README.md` describes. Every scoring run is here. All cases of each are in"
    ]
    text += [f"[{TABLE}]({TABLE}), a line for each run. `python -m blind.record --run 1` prints the first."]
    text += [f"Run {run['run']}: {run['lost']}." for run in runs if "lost" in run]
    text += [""]
    text += [
        "| run | set | cases | moderate | small | pairs, both | false alarms | outside found | ECE | labels' hash |"
    ]
    text += ["|---|---|---|---|---|---|---|---|---|---|"]
    for run in runs:
        r, c = run["result"], run["commitment"]
        cells = [
            percent(r[key]["share"]) for key in ("moderate", "small", "pair_both", "false_alarms", "outside_found")
        ]
        text.append(
            f"| {run['run']}, {c['written']} | {WORLDS[c['set']]} | {r['cases']} | {' | '.join(cells)} "
            f"| {r['ece']:.3f} | `{c['labels'][:16]}` |"
        )
    newest = newest_program(runs)
    head = [f"run {run['run']}, {WORLDS[run['commitment']['set']]}, {run['result']['cases']} cases" for run in newest]
    made_from = dict.fromkeys(filter(None, (program_text(run["commitment"]) for run in newest)))
    text += [
        "",
        "## The newest program",
        "",
        *made_from,
        "Values with their 95 % intervals; a goal is met or missed by the first.",
        "",
    ]
    text += [f"| measure | {' | '.join(head)} | goal |", f"|---|{'---|' * len(head)}---|"]
    goals = {name: goal for run in reversed(newest) for name, _, goal in lines(run["result"])}
    values = [{name: value for name, value, _ in lines(run["result"])} for run in newest]
    names = dict.fromkeys(name for of_run in values for name in of_run)
    text += [f"| {name} | {' | '.join(of.get(name, '') for of in values)} | {goals[name]} |" for name in names]
    text += [f"\nRun {run['run']}: {run['note']}" for run in newest if "note" in run]
    text += ["", "![reliability and dominance](blind.png)", "", "![confusion](blind-confusion.png)", ""]
    for run in newest:
        text += [f"Hashes of run {run['run']}, written before the diagnosis ran:", ""]
        text += [f"- {key}: `{value}`" for key, value in run["commitment"].items()] + [""]
    text += [
        f"All cases of run {newest[0]['run']} (`+` exact, `o` in class, `-` wrong):",
        "",
        "```",
        listing(newest[0].get("cases", [])),
        "```",
    ]
    return "\n".join(text) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(
        prog="python -m blind.record", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--rewrite", action="store_true", help="make blind.json and blind.md anew from the table")
    what.add_argument("--run", type=int, metavar="N", help="print the score and all cases of run N")
    parser.add_argument("--folder", type=Path, default=RESULTS, help="where the table is (default: docs/results)")
    options = parser.parse_args(arguments)
    runs = read(options.folder)
    if not runs:
        print(f"blind.record: no runs in {options.folder / TABLE}", file=sys.stderr)
        return 1
    if options.rewrite:
        write(runs, options.folder)
        return 0
    found = [run for run in runs if run["run"] == options.run]
    if not found:
        last = runs[-1]["run"]
        print(f"blind.record: there is no run {options.run}; the table has 1 to {last}", file=sys.stderr)
        return 1
    if "lost" in found[0]:
        # Shares without intervals are all that is left of it.
        print(f"Run {options.run}: {found[0]['lost']}.")
        print(json.dumps(found[0]["result"], indent=1))
        return 0
    print(table(found[0]["result"]))
    print(listing(found[0]["cases"]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
