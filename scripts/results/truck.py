"""The truck's results, truck.md, .json and plots, from what `rfl evaluate` measured."""

from __future__ import annotations

import json
from pathlib import Path

from results import truck_plots
from results.common import (
    PAPER_TIME,
    PROTOCOLS,
    classes_markdown,
    draw_bars,
    fits,
    markdown_table,
    number,
    program,
    program_lines,
    read_drives,
    summary,
    table,
    tracking_markdown,
)

LOW, HIGH, U_TURN = "low_delay", "high_delay", "truck_u_turn"
PLANTS = {
    LOW: "Low delay (dead time 2 samples, lag 0.05 s), unseen off-road path",
    HIGH: "High delay (dead time 15 samples, lag 0.2 s), test route",
}
# Zhao et al., Acta Automatica Sinica 2025, Tables 4, 5 and 7 (errors in m, PE in %, times in s).
PAPER = {
    LOW: {
        "MPC": {"mae": 0.0893, "rmse": 0.1127, "max": 0.4399},
        "RTL": {"mae": 0.0492, "rmse": 0.0645, "max": 0.4232, "pe_mae": 44.8},
        "RFL": {"mae": 0.0433, "rmse": 0.0579, "max": 0.4329, "pe_mae": 51.5},
        "NMPC": {"mae": 0.0516, "rmse": 0.0882, "max": 0.9300},
        "GP-NMPC": {"mae": 0.0477, "rmse": 0.0796, "max": 0.5173},
    },
    HIGH: {
        "MPC": {"mae": 0.2835, "rmse": 0.3813, "max": 1.412},
        "first_order": {"mae": 0.0172, "rmse": 0.0317, "max": 0.1756, "pe_rmse": 91.6},
        "pade_1_1": {"mae": 0.0307, "rmse": 0.0523, "max": 0.2377, "pe_rmse": 86.3},
        "RFL": {"mae": 0.0133, "rmse": 0.0226, "max": 0.1292, "pe_rmse": 94.1},
    },
    "time": PAPER_TIME,
}
LEARNED = ("RT", "RF", "RTL", "RFL", "RFL+S")
OBSERVER = "+observer"
STEP_AT = "step_at_"
RIVALS = ("RTL", "NMPC", "GP-NMPC", "linear", "oracle")
DELAY_MODELS = ("first_order", "pade_1_1", "pade_2_2")

ABOUT = """\
Written by `scripts/reproduce`; the same numbers as JSON in [truck.json](truck.json). Truck `{vehicle}`, N = W = 60,
Ts = 0.02 s. {seeds} seeds (drives, models, shaking). A seed has {drives} training drive(s) by
the calm nominal MPC with a dither of 0.005 rad. It has as many by an MPC with one linear model learned from those, at
the default weights with a dither of 0.01 rad. All learned rows learn from the same drives. {budget} candidates a row in
the search for weights. The search drives pieces of the training route, one of them a fast straight with sensor noise.
The chosen weights must then complete further parts of that route with every seed's model: fast, cross-country, with
noise.

No test road is on the training route. Errors are the tractor's true ones. ± is the standard deviation over the seeds; 0
where no seed plays a part. PE is the cut against the nominal MPC under the same protocol. Roughness is the RMS rate of
the steering command. It is not limited here, unlike in the car's tables. Behind a long delay the nominal must be damped
until it steers less than the road asks for. With the nominal's roughness as a limit, four rows of the high delay get
worse: RT, RF, MPC+observer and Padé (2, 2). The other learned rows stay. So does `oracle+observer`, which is calm on
the pieces of the search and rough on the test road. A drive diverges off the path, by jack-knifing or by rolling over.
It counts until then; later numbers mean nothing. `+observer` is the row with the disturbance observer.

The delay models' constants are identified from one recorded step of the steering; `oracle` is told the truth."""
ON_FROZEN = """\
At one frozen weight set a ranking can be made either way. The nominal MPC's best weights are calm: a delay hardly
matters with them, and no model gains much. At weights that suit a good model the nominal diverges."""
ON_SWEEP = "Lag 0.2 s, off-road path, first seed, the same weights for all."
ON_TIME = """\
Wall clock of a control step on this machine in µs, drive of the test road, sample time 20 ms. The paper's are its
MATLAB's."""
ON_LOST_GP = """\
GP-NMPC diverges here with every seed. Its processes see only the newest command. A truck that follows a command of 15
samples ago gives them a residual of nearly the size of the motion itself. Their prediction has no delay in it. NMPC,
without them, stays on the road."""
ON_PREDICTION = """\
On drives of the calm collecting MPC, without looking. The second table of each plant tests knowledge of the actuator.
The truck drives straight, and the command steps by 0.02 rad. The 1.2 s that follow are predicted from the state before.
Means over the seeds."""
ON_EDGE = """\
The paper's cut of 94 % (RMSE) arises where the nominal MPC is near the edge of its stability. Here it is made in two
ways, with the first seed. It shows how far a nominal can be driven into its delay. The gain over a well-tuned nominal
is in the table of each row at its own best."""
ON_EDGE_OF_WEIGHTS = """\
**The delay as it is.** The weights move from the nominal's best to the default ones and to each row's best, over
decades. Bisection finds the tightest on each way at which the nominal still finishes the test route. Of these, all rows
have the one at which RFL or RFL+S gains most: {share:.0f} % of the way to {towards}. Its weights are {weights}. A
nominal that survives such a delay is so damped that a model of it has little to gain."""
ON_EDGE_OF_DELAY = """\
**The weights as they are**, the default ones: tight enough for a model that knows the delay. Behind the whole delay the
nominal diverges with them. Bisection finds the longest dead time at which it still finishes the test route:
{dead_time:.3f} s ({share:.0f} % of the plant's). All rows are behind that one, learned and identified there."""
ON_EDGES = {"weights": ON_EDGE_OF_WEIGHTS, "delay": ON_EDGE_OF_DELAY}


def weights_text(weights: dict) -> str:
    return ", ".join(f"{key} {value:.3g}" for key, value in weights.items() if value and not key.endswith("noise"))


def u_turns(condition: dict) -> dict:
    """Each row's U-turn at its own best weights."""
    rows = {}
    for row in condition["rows"]:
        outcomes = row.get("further", {}).get(U_TURN)
        if not outcomes:
            continue
        entry = summary(outcomes, condition["rows"][0]["further"][U_TURN])
        entry["completed"] = not entry["diverged"]
        entry["articulation_max"] = max(o["articulation"] for o in outcomes)
        entry["within_bounds"] = entry["completed"] and entry["articulation_max"] <= condition["articulation_bound"]
        rows[row["row"]] = entry
    return rows


def edges(found: list[dict]) -> dict:
    """The nominal's edges by name, with their rows measured by the nominal there."""
    tables = {}
    for name, edge in zip(ON_EDGES, found, strict=False):
        base = [edge["rows"][0][1]]
        rows = {row: summary([outcome], base) for row, outcome in edge["rows"]}
        tables[name] = {**edge, "rows": rows}
    return tables


def sweep_table(points: list[dict]) -> dict:
    """MAE by weights, row and dead time; None for a loop that diverged, or had nothing to learn from."""
    tables = {}
    for point in points:
        outcome = point["outcome"]
        mae = None if outcome is None or outcome["lost"] else outcome["tracking"]["mae"]
        entry = {"dead_time": point["dead_time"], "mae": mae, "diverged": outcome is not None and outcome["lost"]}
        tables.setdefault(point["weights"], {}).setdefault(point["row"], []).append(entry)
    return tables


def times(conditions: dict) -> dict:
    """Times of a control step, of the last condition that was timed (drives of its test road, one at a time)."""
    found = {}
    for condition in conditions.values():
        for row in condition["rows"]:
            if row["time"]:
                step = row["time"]["step"]
                parts = {part: row["time"][part] for part in ("look_up", "condense", "solve")}
                found[row["row"]] = step | parts | {"plant": condition["plant"]}
    return found


# -- Markdown ---------------------------------------------------------------------------------------------------------


def u_turn_markdown(rows: dict) -> str:
    head = ["row", "completed", "articulation rad", "within bounds", "MAE mm", "RMSE mm", "max mm"]
    body = [
        [
            name,
            "yes" if entry["completed"] else f"no ({entry['diverged']} of {entry['seeds']} diverged)",
            number(entry["articulation_max"], 3),
            "yes" if entry["within_bounds"] else "**no**",
            *(number(1e3 * entry[key], 2) for key in ("mae", "rmse", "max")),
        ]
        for name, entry in rows.items()
    ]
    return markdown_table(head, body)


def time_markdown(rows: dict) -> str:
    head = ["row", "median", "mean", "p99", "max", "missed", "look-up", "condensing", "solve", "paper: mean s"]
    body = []
    for name, entry in rows.items():
        cells = [number(1e6 * entry[key], 0) for key in ("median_s", "mean_s", "p99_s", "max_s")]
        parts = [number(1e6 * entry[part]["mean_s"], 0) for part in ("look_up", "condense", "solve")]
        printed = PAPER["time"].get(name)
        body.append([name, *cells, str(entry["missed"]), *parts, str(printed["mean_s"]) if printed else ""])
    return markdown_table(head, body)


def steps_markdown(rows: dict) -> str:
    """What learned models make of a step of the command: RMSE of the yaw rate, the nominal model's behind."""
    parts = [part for part in next(iter(rows.values()), {}) if part.startswith(STEP_AT)]
    head = ["RMSE of the yaw rate mrad/s at", *(f"{part.removeprefix(STEP_AT)} m/s" for part in parts)]
    yaw_rate = 3

    def line(name: str, entry: dict, key: str) -> list[str]:
        return [name, *(number(1e3 * entry[part][key][yaw_rate], 3) for part in parts)]

    body = [line(name, entry, "rmse") for name, entry in rows.items() if not name.endswith(OBSERVER)]
    body += [line("nominal", entry, "nominal_rmse") for entry in list(rows.values())[:1]]
    return markdown_table(head, body)


def fit_markdown(rows: dict) -> str:
    parts = {
        "train": "train, 1 step",
        "test": "test, 1 step",
        "test_16_steps": "test, 16 steps",
        "test_horizon": "test, 60 steps",
    }
    body = []
    for name, entry in rows.items():
        for part, title in parts.items():
            if part in entry:
                body.append([name, title, *(f"{value:.2e}" for value in entry[part]["rmse"])])
    if rows:
        first = next(iter(rows.values()))
        for part, title in parts.items():
            if part in first:
                body.append(["nominal", title, *(f"{value:.2e}" for value in first[part]["nominal_rmse"])])
    states = ["e1 m", "e1' m/s", "e2 rad", "e2' rad/s", "articulation rad", "its rate rad/s"]
    return markdown_table(["row", "RMSE of", *states], body)


def sweep_markdown(rows: dict) -> str:
    dead_times = [entry["dead_time"] for entry in next(iter(rows.values()))]

    def cell(entry: dict) -> str:
        if entry["mae"] is not None:
            return number(1e3 * entry["mae"], 2)
        return "diverged" if entry["diverged"] else "nothing to learn from"

    body = [[name, *(cell(entry) for entry in entries)] for name, entries in rows.items()]
    return markdown_table(["MAE mm at a dead time of", *(f"{t:.1f} s" for t in dead_times)], body)


def best_of(rows: dict, names: list[str]) -> str | None:
    """The row with the least MAE among those that never diverged."""
    standing = [name for name in names if name in rows and not rows[name]["diverged"]]
    return min(standing, key=lambda name: rows[name]["mae"]) if standing else None


def learned(rows: dict) -> list[str]:
    return [name for name in rows if name.removesuffix(OBSERVER) in LEARNED]


def verdict(rows: dict, observer: str, asked: float, rivals: tuple[str, ...]) -> str | None:
    """The best learned row, all with the observer or all without: its PE, and which rivals it is ahead of."""
    best = best_of(rows, [name + observer for name in LEARNED])
    if best is None:
        return None
    mae, pe = 1e3 * rows[best]["mae"], rows[best]["pe_mae"]
    text = f"{best}, MAE {mae:.2f} mm"
    if not rows["MPC"]["diverged"]:
        text += f", PE {pe:.1f} % (MAE), {'at least' if pe >= asked else '**below**'} {asked} %"
    named = {name: rows[name] for rival in rivals if (name := rival + observer) in rows and name != best}
    ahead = [n for n, rival in named.items() if rival["diverged"] or rows[best]["mae"] <= rival["mae"]]
    behind = [n for n in named if n not in ahead]

    def listed(names: list[str]) -> str:
        size = {n: "diverged" if rival["diverged"] else f"{1e3 * rival['mae']:.2f} mm" for n, rival in named.items()}
        return ", ".join(f"{n} ({size[n]})" for n in names)

    text += f". No worse than {listed(ahead)}" if ahead else ""
    return text + (f". **Worse than** {listed(behind)}" if behind else "")


def verdicts(results: dict) -> list[str]:
    """What the numbers say, line by line, against what is asked."""
    lines = []
    for plant, asked, rivals in ((LOW, 51.5, RIVALS), (HIGH, 80.0, (*DELAY_MODELS, "identified", "oracle", "linear"))):
        rows = results.get(plant, {})
        for observer, title in (("", "without observer"), (OBSERVER, "with it")):
            if text := rows and verdict(rows, observer, asked, rivals):
                if plant == HIGH and (rival := best_of(rows, [name + observer for name in DELAY_MODELS])):
                    best = best_of(rows, [name + observer for name in LEARNED])
                    cut = 100 * (1 - rows[best]["mae"] / rows[rival]["mae"])
                    text += f". {cut:.0f} % under the best of first order and Padé (25 % are asked)"
                lines.append(f"- {plant.replace('_', ' ').capitalize()}, best learned row {title}: {text}.")
    for name, rows in results.get("u_turn", {}).items():
        out = [row for row in learned(rows) if not rows[row]["within_bounds"]]
        said = f"**not** completed within bounds by {', '.join(out)}" if out else "completed within bounds by all"
        lines.append(f"- U-turn, {name.replace('_', ' ')}, learned rows: {said}.")
    cuts = []
    for name, edge in results["edges"].items():
        if best := best_of(edge["rows"], learned(edge["rows"])):
            cuts.append(f"of its {name} {edge['rows'][best]['pe_rmse']:.1f} % ({best})")
    if cuts:
        lines.append(
            f"- The paper's setting, PE on RMSE where the nominal is at the edge {', '.join(cuts)}; printed 94.1 %."
        )
    time = results["time"]
    if "MPC" in time and "RFL" in time:
        ratio = time["RFL"]["median_s"] / time["MPC"]["median_s"]
        text = f"- Step at N = 60: median {1e3 * time['MPC']['median_s']:.2f} ms nominal, "
        text += f"{1e3 * time['RFL']['median_s']:.2f} ms RFL ({ratio:.2f} x), p99 {1e3 * time['RFL']['p99_s']:.2f} ms"
        lines.append(text + "; the paper's RFL: 695 ms. One drive after the other; beside peers: [speed.md](speed.md).")
    return lines


def write_markdown(results: dict, conditions: dict, out: Path) -> None:
    text = [
        "# The truck: the second paper's tables beside ours",
        "",
        ABOUT.format(vehicle=results["vehicle"], **results["effort"]),
        "",
        *program_lines(results),
        "**What it says**",
        "",
        *verdicts(results),
        "",
    ]
    for row in results["left_out"]:
        text += [f"Not in this run: {row}.", ""]
    for name, tables in results["conditions"].items():
        noise = ", with sensor noise" if name.endswith("_noise") else ""
        plant = name.removesuffix("_noise")
        text += [f"## {PLANTS[plant]}{noise}", ""]
        for protocol, title in PROTOCOLS.items():
            paper = PAPER[plant] if protocol == "own_best" else None
            text += [f"**{title}**", "", tracking_markdown(tables[protocol], paper), ""]
            if protocol == "frozen":
                text += [ON_FROZEN, ""]
            if protocol == "own_best" and tables[protocol].get("GP-NMPC", {}).get("diverged"):
                text += [ON_LOST_GP, ""]
        text += [classes_markdown(tables["own_best"]), ""]
        if plant == name:
            text += [f"![Errors]({file})\n" for file in truck_plots.OF_PLANT[plant]]
    if results["edges"]:
        text += ["## The paper's setting: a nominal at its edge", "", ON_EDGE, ""]
    for name, edge in results["edges"].items():
        about = ON_EDGES[name].format(
            **{**edge, "share": 100 * edge["share"], "weights": weights_text(edge["weights"])}
        )
        text += [about, "", tracking_markdown(edge["rows"], PAPER[HIGH]), ""]
    if "sweep" in results:
        text += ["## Dead time from 0 to 0.5 s", "", ON_SWEEP, ""]
        for weights, rows in results["sweep"].items():
            text += [f"**Weights: {weights}**", "", sweep_markdown(rows), ""]
        text += [f"![MAE over dead time]({truck_plots.SWEEP})", ""]
    text += ["## U-turn, R = 12.5 m", "", "Each row at its own best weights of the plant above.", ""]
    for name, rows in results["u_turn"].items():
        bound = conditions[name]["articulation_bound"]
        text += [f"**{name.replace('_', ' ')}** (soft bound of the articulation {bound:.2f} rad)", ""]
        text += [u_turn_markdown(rows), ""]
    text += [f"![U-turn]({truck_plots.U_TURN})", "", f"![A recorded step]({truck_plots.STEP})", ""]
    head = ["row", "plant", "dead time s", "time constant s", "RMSE of the angle mrad"]
    body = [
        [entry["row"], name, *(f"{entry[k]:.4f}" for k in ("dead_time", "time_constant")), f"{1e3 * entry['rmse']:.3f}"]
        for name, entries in results["identified"].items()
        for entry in entries
    ]
    text += ["## What the recorded steps say", "", markdown_table(head, body), ""]
    text += ["## Prediction", "", ON_PREDICTION, ""]
    for name, rows in results["fit"].items():
        text += [f"**{name.replace('_', ' ')}**", "", fit_markdown(rows), ""]
        if any(part.startswith(STEP_AT) for entry in rows.values() for part in entry):
            text += [steps_markdown(rows), ""]
    text += [
        "## Time",
        "",
        ON_TIME,
        "",
        time_markdown(results["time"]),
        "",
        "## All rows",
        "",
        f"![All rows]({truck_plots.ROWS})",
        "",
    ]
    missing = [name for name in PLANTS if name not in results["conditions"]]
    if missing:
        text += [f"Not run here: {', '.join(missing)}.", ""]
    (out / "truck.md").write_text("\n".join(text))


def write(folder: Path, out: Path) -> None:
    """Writes the results of the conditions in a folder of `rfl evaluate --vehicle truck_simulation`."""
    names = [f"{plant}{noise}" for plant in PLANTS for noise in ("", "_noise")]
    raw = {n: json.loads((folder / f"{n}.json").read_text()) for n in names if (folder / f"{n}.json").exists()}
    if not raw:
        run = "run scripts/reproduce, or rfl evaluate --vehicle truck_simulation"
        raise SystemExit(f"{folder}: neither {LOW}.json nor {HIGH}.json; {run}")
    head = next(iter(raw.values()))
    calm = {name: condition for name, condition in raw.items() if not condition["noise"]}
    results = {
        "vehicle": head["vehicle"],
        "effort": head["effort"],
        "program": program(),
        **{name: table(condition, "own_best") for name, condition in calm.items()},
        "u_turn": {name: u_turns(condition) for name, condition in calm.items()},
        "time": times(calm),
        "conditions": {name: {p: table(c, p) for p in PROTOCOLS} for name, c in raw.items()},
        "fit": {name: fits(condition) for name, condition in calm.items()},
        "identified": {name: condition["identified"] for name, condition in calm.items()},
        "left_out": sorted({row for condition in raw.values() for row in condition.get("left_out", [])}),
        "paper": PAPER,
        "edges": edges(next((c["edges"] for c in calm.values() if c.get("edges")), [])),
    }
    sweep = folder / "sweep.json"
    if sweep.exists():
        results["sweep"] = sweep_table(json.loads(sweep.read_text())["points"])
        truck_plots.draw_sweep(results["sweep"], out)
    drives = {n: read_drives(folder / f"drives_{n}", truck_plots.SHOWN) for n in calm}
    u_turn_drives = {n: read_drives(folder / f"drives_{n}", truck_plots.SHOWN, f"{U_TURN}_") for n in calm}
    truck_plots.draw(calm, drives, u_turn_drives, out)
    draw_bars(results["conditions"], truck_plots.SHOWN, 7.0, out / truck_plots.ROWS)
    write_markdown(results, raw, out)
    (out / "truck.json").write_text(json.dumps(results, indent=1) + "\n")
    print(f"{out}/truck.md, .json and plots")
    print("\n".join(verdicts(results)))
