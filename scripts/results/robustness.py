"""The robustness of the default controller, robustness.md, .json and a plot, from what the example `robustness` measured."""

# ruff: noqa: E501  (sentences of a page)
from __future__ import annotations

import json
import math
from pathlib import Path

from results.common import markdown_table, number, plt, program, program_lines, save

# Drives of a row: 240 of cars, 96 of trucks.
WHOLE = 336
PARTS = ("matrix", "unknown", "ladder", "margins", "faults", "foreign")
ROWS = {"default": "default", "told": "told its actuator", "papers": "the papers' settings"}
ABOUT = """\
Written by `scripts/reproduce robustness`; the same numbers as JSON in [robustness.json](robustness.json), errors in m and
true ones. A drive is lost beyond 2 m beside its road, rolled over, jack-knifed, or unable to go on. Random roads have the
seeds from {first} on, {count} for each kind of vehicle, every second closed; the search had {search}. What is drawn has the
seed {seed}. One drive again: `cargo run --release --example robustness -- matrix --only NAME`.
Damaged and hostile files are another page: [fuzzing.md](fuzzing.md). {skipped}"""


# What a calm controller has to stand: dead time in s, a factor on the steering.
STANDS = {"steer_delay": 0.15, "steer_gain": 2.0}
# Largest errors that are allowed, m: at an ordinary lateral acceleration and friction (True), and beyond.
LIMIT = {True: 0.4, False: 0.6}


def worst(values: list[float]) -> float:
    return max(values, default=0.0)


def share(values: list[bool]) -> str:
    return f"{sum(values)} of {len(values)} ({100 * sum(values) / len(values):.1f} %)" if values else "none driven"


def own(drive: dict) -> bool:
    return drive["lag"] == 0 and drive["dead_time"] == 0


def easy(drive: dict) -> bool:
    return drive["lateral_accel"] <= 2.25


def hard(drive: dict) -> bool:
    return drive["lateral_accel"] > 2.25 or drive["friction"] < 1


def fine(drive: dict, limit: float, key: str = "max") -> bool:
    return drive["outcome"] == "completed" and (drive[key] is None or drive[key] <= limit)


def goals(drives: list[dict]) -> dict[str, tuple[list[bool], float]]:
    """Which drives keep each goal, and the share that is asked for."""
    calm = [d for d in drives if easy(d)]
    return {
        "completed": ([d["outcome"] == "completed" for d in drives], 1.0),
        "not lost": ([d["outcome"] != "lost" for d in drives], 1.0),
        "max <= 0.4 m, ay 2.25 (trucks 1.0)": ([fine(d, 0.4) for d in calm], 0.98),
        "max after 20 s <= 0.2 m, ay 2.25 (trucks 1.0)": (
            [fine(d, 0.2, "max_after_20_s") for d in calm if d["max_after_20_s"] is not None],
            0.9,
        ),
        "max <= 0.15 m, the file's actuator, ay 2.25 (trucks 1.0)": ([fine(d, 0.15) for d in calm if own(d)], 1.0),
        "max <= 0.6 m, ay 4 or friction 0.6": ([fine(d, 0.6) for d in drives if hard(d)], 1.0),
    }


def matrix_markdown(drives: list[dict]) -> list[str]:
    text = ["## Matrix", "", "![Largest error over the actuator's delay](robustness.png)", ""]
    body = []
    for kind in ("car", "truck"):
        for row, title in ROWS.items():
            of = [d for d in drives if d["kind"] == kind and d["row"] == row]
            if not of:
                continue
            count = {o: sum(d["outcome"] == o for d in of) for o in ("lost", "stopped", "timed_out")}
            done = [d for d in of if d["outcome"] == "completed"]
            late = worst([d["max_after_20_s"] or 0.0 for d in done])
            mean = sum(d["mean"] for d in done) / max(len(done), 1)
            body.append(
                [
                    kind,
                    title,
                    str(len(of)),
                    *(str(n) for n in count.values()),
                    number(worst([d["max"] for d in done]), 3),
                    number(late, 3),
                    number(mean, 4),
                ]
            )
    head = ["", "row", "drives", "lost", "stopped", "timed out", "max m", "max after 20 s, m", "mean m"]
    text += ["Max and mean are those of the completed drives.", "", markdown_table(head, body), ""]
    rows = []
    for row in ("default", "told"):
        for kind in ("car", "truck"):
            for goal, (kept, asked) in goals([d for d in drives if d["row"] == row and d["kind"] == kind]).items():
                verdict = "met" if sum(kept) >= asked * len(kept) else "**missed**"
                rows.append([row, kind, goal, share(kept), f"{100 * asked:.0f} %", verdict if kept else "not examined"])
        told = [fine(d, 0.15) for d in drives if d["row"] == row]
        if row == "told" and told:
            met = "met" if sum(told) >= 0.95 * len(told) else "**missed**"
            rows.append([row, "all", "max <= 0.15 m", share(told), "95 %", met])
    head = ["row", "", "goal", "kept", "asked", ""]
    text += ["### Goals", "", markdown_table(head, rows), "", "### Worst drives", ""]
    order = sorted((d for d in drives if d["row"] == "default"), key=lambda d: (d["outcome"] == "completed", -d["max"]))
    body = [
        [
            d["id"],
            d["vehicle"],
            d["road"],
            f"{d['lag']:.3f}",
            f"{d['dead_time']:.3f}",
            f"{d['lateral_accel']:g}",
            f"{d['friction']:g}",
            f"{d['payload']:g}",
            f"{d['noise']:g}",
            d["outcome"],
            number(d["max"], 3),
            number(d["max_at"], 1),
            "" if d["max_after_20_s"] is None else number(d["max_after_20_s"], 3),
        ]
        for d in order[:16]
    ]
    head = ["name", "vehicle", "road", "lag s", "dead time s", "ay", "friction", "payload", "noise", "outcome"]
    text += ["Of the default; lag and dead time are what is added to the file's.", ""]
    text += [markdown_table([*head, "max m", "at s", "after 20 s"], body), ""]
    reasons = [f"- {d['id']} ({d['outcome']}): {d['reason']}" for d in order if d["outcome"] != "completed"]
    if reasons:
        text += ["Not completed:", "", *reasons, ""]
    return text


def unknown_markdown(unknown: dict) -> list[str]:
    """Errors of sensors and linkage that nobody has told the controller."""
    drives = [d for d in unknown["drives"] if "failed" not in d]
    kinds: dict[tuple, list[dict]] = {}
    for d in drives:
        kinds.setdefault((d["unknown"]["effect"], d["unknown"]["value"]), []).append(d)
    body = []
    for (effect, value), of in kinds.items():
        done = [d for d in of if d["outcome"] == "completed"]
        late = worst([d["max_after_20_s"] or 0.0 for d in done])
        mean = sum(d["mean"] for d in done) / max(len(done), 1)
        body.append(
            [
                f"`{effect}`",
                f"{value:g}",
                str(len(of)),
                str(len(done)),
                number(worst([d["max"] for d in done]), 3),
                number(late, 3),
                number(mean, 4),
            ]
        )
    failed = [f"- {d['id']} could not be run: {d['failed']}" for d in unknown["drives"] if "failed" in d]
    head = ["effect", "value", "drives", "completed", "max m", "max after 20 s, m", "mean m"]
    return [
        "## What nobody has told",
        "",
        "Default options on the first half of the matrix, at 2.25 m/s2 sideways (trucks 1.0), with one more difference of the real "
        "vehicle in each drive, beside the matrix's actuator, friction, payload and noise (`rfl parameters` explains the effects; SI units).",
        "",
        markdown_table(head, body),
        "",
        *failed,
    ]


# By how much a drive may get worse than the default, m.
WORSE = 0.005


def ladder_markdown(ladder: dict) -> list[str]:
    """What knowing more gives, against the default on the same drives."""
    drives = [d for d in ladder["drives"] if "failed" not in d]
    of = [{row["controller"]: row for row in d["rows"]} for d in drives]
    body, goals, worse = [], [], []
    for name in ("default", "identified", "learned", "tuned"):
        pairs = [(rows["default"], rows[name], d) for rows, d in zip(of, drives, strict=True) if name in rows]
        if not pairs:
            continue
        done = [p for p in pairs if p[1]["outcome"] == "completed"]
        ratios = sorted(row["mean"] / base["mean"] for base, row, _ in done)
        body.append(
            [
                name,
                str(len(pairs)),
                str(len(pairs) - len(done)),
                number(worst([row["max"] for _, row, _ in done]), 3),
                number(1e3 * sum(row["mean"] for _, row, _ in done) / max(len(done), 1), 2),
                number(1e3 * sum(base["mean"] for base, _, _ in done) / max(len(done), 1), 2),
                number(ratios[len(ratios) // 2], 2) if ratios else "",
                share([ratio <= 0.5 for ratio in ratios]),
            ]
        )
        if name == "identified":
            kept = [row["max"] <= 0.15 for _, row, _ in pairs]
            goals.append(["identified: max <= 0.15 m in 95 %", share(kept), sum(kept) >= 0.95 * len(kept)])
        elif name != "default":
            total = sum(row["mean"] for _, row, _ in done) / max(sum(base["mean"] for base, _, _ in done), 1e-9)
            goals.append([f"{name}: mean at least halves", f"{total:.2f} of the default's", total <= 0.5])
        if name != "default":
            more = [(row["max"] - base["max"], row["mean"] - base["mean"]) for base, row, _ in pairs]
            bad = [
                f"{d['id']} ({name}: max {1e3 * base['max']:.0f} to {1e3 * row['max']:.0f} mm)"
                for (base, row, d), (by_max, _) in zip(pairs, more, strict=True)
                if by_max > WORSE or row["outcome"] != "completed"
            ]
            worse += bad
            goals.append(
                [f"{name}: no max worse by 5 mm", f"{len(bad)} worse", not bad],
            )
            by_mean = sum(by_mean > WORSE for _, by_mean in more)
            goals.append([f"{name}: no mean worse by 5 mm", f"{by_mean} worse", by_mean == 0])
    refused = [d["id"] for d in drives if d["refused"]]
    failed = [f"- {d['id']} could not be run: {d['failed']}" for d in ladder["drives"] if "failed" in d]
    head = ["row", "drives", "not completed", "max m", "mean mm", "default's mean mm", "median ratio", "mean halved"]
    text = [
        "## Knowing more",
        "",
        "A part of the matrix, each drive made by the commands: `rfl learn` (drive, identify, collect, train, prove) with the road "
        "of the matrix to prove on, which it did not learn on; for some, `rfl identify --into` and `rfl tune` "
        f"with {ladder['budget']} candidates. Without noise. A refused model leaves a drive without the row `learned`: "
        f"{len(refused)} of {len(drives)}{': ' + ', '.join(refused) if refused else ''}.",
        "",
        markdown_table(head, body),
        "",
        markdown_table(["goal", "", ""], [[*g[:2], "met" if g[2] else "**missed**"] for g in goals]),
        "",
        *failed,
    ]
    return [*text, "Worse: " + ", ".join(worse) + ".", ""] if worse else text


def margins_markdown(margins: dict) -> list[str]:
    linear = margins["linear"]
    speeds = sorted({m["speed"] for m in linear})
    body = []
    for vehicle in dict.fromkeys(m["vehicle"] for m in linear):
        for row in ("calm", "sure"):
            of = {m["speed"]: m for m in linear if m["vehicle"] == vehicle and m["row"] == row}
            cells = [
                f"{of[s]['delay']:.2f} s, {of[s]['gain'] or math.inf:.1f}" if of[s]["stable"] else "unstable"
                for s in speeds
            ]
            body.append([vehicle, row, *cells])
    calm = [m for m in linear if m["row"] == "calm"]
    missed = [
        m
        for m in calm
        if not (m["stable"] and m["delay"] >= STANDS["steer_delay"] and (m["gain"] or math.inf) >= STANDS["steer_gain"])
    ]
    sure = [m for m in linear if m["row"] == "sure" and m["stable"]]
    text = [
        "## Margins",
        "",
        "Delay margin and gain margin of the linear loop, observer included, with the file's actuator. Calm: before the "
        "drive has shown the actuator; sure: after.",
        "",
        markdown_table(["vehicle", "", *(f"{s:g} m/s" for s in speeds)], body),
        "",
        f"Goal, calm: {STANDS['steer_delay']:g} s and {STANDS['steer_gain']:g} at every speed: "
        + (
            "met." if not missed else "**missed** at " + ", ".join(f"{m['vehicle']} {m['speed']:g} m/s" for m in missed)
        ),
        f"Least of the sure: {min(m['delay'] for m in sure):.3f} s and {min(m['gain'] or 99 for m in sure):.2f}.",
        "",
        f"Measured on the nonlinear vehicle, random road {margins['road_seed']}: raised until the drive is lost. Calm and "
        "sure: the controller keeps the file's actuator, and the weights of that end; default: it may learn the actuator.",
        "",
    ]
    measured = [m for m in margins["measured"] if m.get("row") == "calm"]
    short = [m for m in measured if m["stands"] < STANDS[m["effect"]]]
    if measured:
        verdict = "met" if not short else "**missed** by " + ", ".join(f"{m['vehicle']} {m['effect']}" for m in short)
        stands = f"{STANDS['steer_delay']:g} s and a gain of {STANDS['steer_gain']:g}"
        text += [f"Goal, calm: stands {stands}: {verdict}.", ""]
    body = []
    for m in margins["measured"]:
        if "failed" in m:
            body.append([m["failed"]] + [""] * 6)
            continue
        lost = f"{m['lost_at']:.3f}" if m["stands"] < m["upper_end"] else f"not up to {m['upper_end']:g}"
        body.append(
            [
                m["vehicle"],
                m["row"],
                m["effect"],
                f"{m['stands']:.3f}",
                lost,
                number(m["max_without"], 3),
                number(m["max_where_it_stands"], 3),
            ]
        )
    head = ["vehicle", "", "raised", "stands", "lost at", "max m without", "max m where it stands"]
    return [*text, markdown_table(head, body), ""]


def faults_markdown(faults: dict) -> list[str]:
    text = ["## Faults", ""]
    if not faults["faults"]:
        return [*text, "Not run here: BrandsHatch of ../shared/data is absent.", ""]
    body, missed = [], []
    for f in faults["faults"]:
        if "failed" in f:
            body.append([f["fault"], f["failed"]] + [""] * 9)
            continue
        limit = 0.5 if f["length"] <= 0.2 else 2.0
        added = worst(f["added"])
        good = f["fault"] == "none" or (
            (added if f["length"] <= 0.2 else worst(f["errors"])) <= limit and f["optimal_steps"] == 0
        )
        if f["length"] > 1 and f["safe_stop"] < len(f["stations"]):
            good = False
        missed += [] if good else [f]
        body.append(
            [
                f["fault"],
                f"{f['length']:g}",
                f"{f['speed']:g}",
                f"{f['lag']:g}, {f['dead_time']:g}",
                number(added, 3),
                number(worst(f["errors"]), 3),
                str(f["optimal_steps"]),
                f"{f['safe_stop']} of {len(f['stations'])}",
                f"{f['stands']}",
                ", ".join(f["statuses"]),
                "" if good else "**missed**",
            ]
        )
    head = ["fault", "s", "m/s", "lag, dead time", "added m", "max m", "steps called optimal", "safe stop", "stands"]
    stations = len(faults["faults"][0]["stations"])
    text += [
        f"`c_class` on BrandsHatch, cut open, {stations} stations each; added: to the largest error without the fault, at "
        "the worst station. Goals: <= 0.5 m added by 0.2 s; a safe stop within 2 m after 2 s; never `optimal` meanwhile. "
        f"{len(missed)} of {len(body)} rows miss one.",
        "",
        markdown_table([*head, "statuses", "goal"], body),
        "",
    ]
    body = []
    base = {(r["lag"], r["as_trained"]): r for r in faults["residuals"] if r.get("model") == "none"}
    for r in faults["residuals"]:
        if "failed" in r:
            body.append([r["model"], r["failed"]] + [""] * 6)
            continue
        ratio = r["max"] / base[r["lag"], r["as_trained"]]["max"]
        # Faster than its training a model is not asked, and there is nothing to notice.
        noticed = not r["as_trained"] or (r["noticed_at"] is not None and r["noticed_at"] <= 2)
        good = r["model"] == "none" or (ratio <= 2 and noticed)
        noticed = "" if r["model"] == "none" else "never" if r["noticed_at"] is None else f"{r['noticed_at']:.2f} s"
        body.append(
            [
                r["model"],
                f"{r['lag']:g}, {r['dead_time']:g}",
                "as trained" if r["as_trained"] else "full",
                r["outcome"],
                noticed,
                f"{100 * r['faded_share']:.0f} %",
                number(r["max"], 3),
                number(ratio, 2),
                "" if good else "**missed**",
            ]
        )
    head = ["model", "lag, dead time", "speed", "outcome", "noticed", "faded", "max m", "times the default's", "goal"]
    text += [
        "### Wrong models",
        "",
        "Goals: noticed within 2 s where it is asked from the beginning, at most twice the default's largest error.",
        "",
    ]
    return [*text, markdown_table(head, body), ""]


def foreign_markdown(foreign: dict) -> list[str]:
    body, missed = [], []
    for plant in dict.fromkeys(d["plant"] for d in foreign["drives"]):
        for row in ("default", "told"):
            for accel in sorted({d["lateral_accel"] for d in foreign["drives"]}):
                of = [d for d in foreign["drives"] if (d["plant"], d["row"], d["lateral_accel"]) == (plant, row, accel)]
                missed += [d for d in of if not fine(d, LIMIT[easy(d)])]
                body.append(
                    [
                        plant,
                        row,
                        f"{accel:g}",
                        str(len(of)),
                        str(sum(d["outcome"] == "completed" for d in of)),
                        number(worst([d["max"] for d in of]), 3),
                        number(worst([d["max_after_20_s"] or 0.0 for d in of]), 3),
                        number(sum(d["mean"] for d in of) / max(len(of), 1), 4),
                    ]
                )
    head = ["plant", "row", "ay", "drives", "completed", "max m", "max after 20 s, m", "mean m"]
    names = ", ".join(f"{d['id']} ({d['row']}, {d['outcome']}, {d['max']:.3f} m)" for d in missed)
    return [
        "## Foreign plants",
        "",
        "Equations of others, in Python, driven by `RflMpc.fmu` in fmpy: CommonRoad's multi-body cars (29 states), and the tanh "
        "bicycle of `../shared/cases/controller/suv_plant.py` (`suv`), whose controller knows mass, inertia and axles, and has the "
        "C-class car's tyres. Random roads from seed "
        f"{foreign['roads']['first']} on, {foreign['roads']['count']} for each plant; a steering lag of 0 to 0.2 s and a dead time "
        f"of 0 to 0.12 s for each drive, drawn with the seed {foreign['seed']}. `scripts/foreign_plants --only NAME` drives one again.",
        "",
        markdown_table(head, body),
        "",
        f"Goal: completed, max <= {LIMIT[True]:g} m at ay 2.25 and <= {LIMIT[False]:g} m at ay 4: "
        + (f"**missed** by {names}." if missed else "met."),
        "",
    ]


def draw(drives: list[dict], file: Path) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(13, 4.8), sharey=True)
    colours = {"papers": "tab:gray", "told": "tab:green", "default": "tab:red"}
    for axis, kind in zip(axes, ("car", "truck"), strict=True):
        for row, colour in colours.items():
            of = [d for d in drives if d["kind"] == kind and d["row"] == row]
            delays = [d["lag"] + d["dead_time"] for d in of]
            axis.scatter(delays, [min(d["max"], 4.0) for d in of], s=12, color=colour, alpha=0.7, label=ROWS[row])
        axis.axhline(2.0, color="black", linewidth=0.8, linestyle="--")
        axis.set(yscale="log", xlabel="lag and dead time added, s", title=f"{kind}s: every drive a dot, lost above 2 m")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    axes[0].set_ylabel("largest lateral error in m")
    save(figure, file)


def write(folder: Path, out: Path) -> None:
    """Writes the results of the parts in a folder of the example `robustness`."""
    files = {part: folder / f"{part}.json" for part in PARTS}
    if not files["matrix"].exists():
        raise SystemExit(f"{files['matrix']} is missing; run scripts/reproduce robustness")
    raw = {part: json.loads(file.read_text()) for part, file in files.items() if file.exists()}
    drives = [d for d in raw["matrix"]["drives"] if "failed" not in d]
    failed = [d for d in raw["matrix"]["drives"] if "failed" in d]
    roads = {d["road"] for d in drives}
    skipped = "" if any("Norisring" in r for r in roads) else "Norisring and BrandsHatch are absent here."
    seeds = raw["matrix"]["road_seeds"]
    text = ["# Robustness of the default controller", ""]
    text += [ABOUT.format(seed=raw["matrix"]["seed"], skipped=skipped, **seeds).rstrip(), ""]
    raw["program"] = raw["matrix"].pop("program", None) or program()
    text += program_lines(raw)
    text += [f"- **{d['id']} ({d['row']}) could not be driven: {d['failed']}**" for d in failed]
    if sum(d["row"] == "default" for d in drives) < WHOLE:
        text += [
            f"**A part of the matrix only**, of {WHOLE} drives a row; `scripts/reproduce robustness` drives them all.",
            "",
        ]
    text += matrix_markdown(drives)
    parts = {
        "unknown": unknown_markdown,
        "ladder": ladder_markdown,
        "margins": margins_markdown,
        "faults": faults_markdown,
        "foreign": foreign_markdown,
    }
    for part, markdown in parts.items():
        if part not in raw:
            text += [f"## {part.capitalize()}", "", "Not run here.", ""]
            continue
        title, blank, *rest = markdown(raw[part])
        # A part that was kept from an earlier run says so.
        text += [title, blank, *program_lines(raw[part]), *rest]
    (out / "robustness.md").write_text("\n".join(text))
    (out / "robustness.json").write_text(json.dumps(raw, indent=1) + "\n")
    draw(drives, out / "robustness.png")
    print(f"{out}/robustness.md, .json and .png")
