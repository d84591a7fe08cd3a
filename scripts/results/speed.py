"""Speed: speed.json, speed.md and its plot, from the figures that scripts/compare_peers measured."""

from __future__ import annotations

import json
from pathlib import Path

from results.common import plt, program_lines

GOALS = {  # us, median and 99th percentile
    "nominal_16": (40, 120),
    "rfl_16": (80, 200),
    "truck_rfl_60": (500, 1500),
}
STEPS = {
    "nominal_16": "car, nominal, N = 16",
    "rtl_16": "car, RTL, N = 16, W = 28",
    "rfl_16": "car, RFL, N = 16, W = 28",
    "rfl_s_16": "car, RFL+S, N = 16, W = 28",
    "truck_nominal_60": "truck, nominal, N = 60",
    "truck_rfl_60": "truck, RFL, N = 60, W = 60",
}
NONLINEAR = {"nmpc": "NMPC", "gp_nmpc": "GP-NMPC"}
QP_GOALS = {"16": 20, "60": 200}  # us
SOLVERS = {
    "ours": "ours",
    "ours_clarabel": "Clarabel as our fallback",
    "daqp": "daqp",
    "clarabel": "clarabel",
    "piqp": "PIQP",
    "proxqp": "ProxQP",
    "osqp": "OSQP (1e-6)",
}
GROWTH = {
    "horizon_nominal_us": ("horizon N, nominal", "steps"),
    "horizon_rfl_us": ("horizon N, RFL (W = 28)", "steps"),
    "window_rfl_us": ("window W, RFL (N = 16)", "steps"),
    "trees_rfl_us": ("trees, RFL (N = 16)", "trees"),
    "depth_rfl_us": ("depth of trees, RFL (N = 16)", "levels"),
}


def summary(raw: dict) -> dict:
    """The contents of speed.json: the keys that others read, and everything measured behind them."""
    result: dict = {"qp": {}, "step": {}}
    for horizon, part in raw.get("qp", {}).items():
        result["qp"][horizon] = {f"{name}_us": part[f"{name}_us"] for name in part["solvers"]}
    speed = raw.get("speed", {})
    result["step"] = speed.get("step", {})
    if "closed_loop_x_real_time" in speed:
        result["closed_loop_x_real_time"] = speed["closed_loop_x_real_time"]
    if "fmpy" in raw:
        result["fmpy_x_real_time"] = raw["fmpy"]["x_real_time"]
    if "1000000" in raw.get("training", {}):
        result["train_1e6_s"] = raw["training"]["1000000"]["train_s"]
    result["measured"] = {name: part for name, part in raw.items() if name not in ("machine",)}
    result["machine"] = raw.get("machine", {})
    return result


def _by_size(row: dict) -> dict:
    """A table's entries in the order of their sizes."""
    return dict(sorted(row.items(), key=lambda entry: float(entry[0])))


def _verdict(holds: bool) -> str:
    return "yes" if holds else "**no**"


def _qp(raw: dict) -> list[str]:
    lines = ["## The quadratic program", ""]
    for horizon, part in raw["qp"].items():
        goal, ours, daqp = QP_GOALS[horizon], part["ours_us"], part["daqp_us"]
        lines += [
            f"N = {horizon}: {part['problems']} problems of closed-loop drives, {part['with_active_bounds']} with "
            f"active bounds (up to {part['most_active_bounds']} at once). Median at most {goal} us: "
            f"{_verdict(ours <= goal)}; within 2 x daqp: {_verdict(ours <= 2 * daqp)}.",
            "",
            "| solver | median, us | p99, us | against ours | largest difference of an input |",
            "|---|---|---|---|---|",
        ]
        lines += [
            f"| {SOLVERS[name]} | {part[f'{name}_us']:.1f} | {part[f'{name}_p99_us']:.1f} | "
            f"{part[f'{name}_us'] / ours:.2f} | {part[f'{name}_difference']:.0e} |"
            for name in part["solvers"]
        ]
        lines.append("")
    lines += [
        "Times of ours, and of Clarabel as our fallback, begin at the gains: the cost's Hessian is in them. The others "
        "are given the Hessian, and are set up anew for each problem, as the model changes with speed; best of 3. "
        "daqp has its own clock; the others' times hold the call from Python, some microseconds. Differences are to a "
        "solution whose KKT residuals were checked, relative to the input's bound.",
        "",
    ]
    return lines


def _agreement(raw: dict) -> list[str]:
    cases = [(horizon, name, case) for horizon, of in raw["agreement"].items() for name, case in of.items()]
    problems = sum(case["problems"] for _, _, case in cases)
    worst = max(case["largest_difference"] for _, _, case in cases)
    return [
        "## Agreement with Clarabel",
        "",
        f"{problems} problems, each solved by our active-set method alone and by Clarabel with tolerances of 1e-13. At "
        f"least 10 000: {_verdict(problems >= 10_000)}; inputs, relative to their bound, at most 1e-7 apart: "
        f"{_verdict(worst <= 1e-7)} ({worst:.0e}).",
        "",
        "| N | drive | problems | half of the rate bounds active, or more | softly bounded outputs outside | left to "
        "the fallback | Clarabel short of 1e-13 | largest difference |",
        "|---|---|---|---|---|---|---|---|",
        *(
            f"| {horizon} | {name} | {case['problems']} | {case['at_rate_bounds']} | {case['softened']} | "
            f"{case['left_to_clarabel']} | {case['clarabel_failed']} | {case['largest_difference']:.0e} |"
            for horizon, name, case in cases
        ),
        "",
    ]


def _nonlinear(raw: dict) -> list[str]:
    rows = [
        (title, horizon, part)
        for name, title in NONLINEAR.items()
        for horizon, part in _by_size(raw.get(name, {})).items()
    ]
    faster = all(part["ratio"] > 1 for _, _, part in rows)
    excess = max(part["largest_relative_excess"] for _, _, part in rows)
    difference = max(part["largest_input_difference_rad"] for _, _, part in rows)
    lines = [
        "## Nonlinear MPC beside CasADi with IPOPT",
        "",
        "Problems of a closed-loop drive, both from the plan of the step before. Ours is faster: "
        f"{_verdict(faster)}; its objective is above IPOPT's by at most {excess:.0e} of it, and its commands are at "
        f"most {difference:.0e} rad apart. Ours stops as in the drive, IPOPT at 1e-9. IPOPT has exact Hessians. "
        "For its time the road ahead is one cubic, in its favour. Agreement is judged on the road as it is, a chain of "
        "parabolas.",
        "",
        "| problem | points of the processes | problems | ours: median, us | p99, us | IPOPT: median, us | p99, us | "
        "IPOPT against ours |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for title, horizon, part in rows:
        points = " + ".join(map(str, part.get("points", [])))
        lines.append(
            f"| {title}, N = {horizon} | {points} | {part['problems']} | {part['ours_us']:.0f} | "
            f"{part['ours_p99_us']:.0f} | {part['ipopt_us']:.0f} | {part['ipopt_p99_us']:.0f} | {part['ratio']:.0f} |"
        )
    return [*lines, ""]


def _steps(raw: dict) -> list[str]:
    speed = raw["speed"]
    lines = [
        "## The whole control step",
        "",
        "Each controller drives its own vehicle along the test route for 60 s; all step in turn.",
        "",
        "| controller | median, us | p99, us | 10th percentile, us | against nominal | goal: median, p99 | reached |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, title in STEPS.items():
        step = speed["step"][name]
        nominal = speed["step"]["truck_nominal_60" if name.startswith("truck") else "nominal_16"]
        goal, reached = GOALS.get(name), ""
        if goal:
            reached = _verdict(step["median_us"] <= goal[0] and step["p99_us"] <= goal[1])
        lines.append(
            f"| {title} | {step['median_us']:.1f} | {step['p99_us']:.1f} | {step['p10_us']:.1f} | "
            f"{step['median_us'] / nominal['median_us']:.2f} | {f'{goal[0]}, {goal[1]}' if goal else ''} | {reached} |"
        )
    factor = speed["closed_loop_x_real_time"]
    lines += [
        "",
        f"Closed loop of car and nominal MPC in native code: {factor:.0f} x real time (500 wanted: "
        f"{_verdict(factor >= 500)}).",
    ]
    if factor := speed.get("closed_loop_x_real_time_cpu"):
        lines.append(f"By processor time, which other programs do not take from it: {factor:.0f} x.")
    if "fmpy" in raw:
        factor = raw["fmpy"]["x_real_time"]
        lines.append(f"The same in fmpy: {factor:.0f} x real time (80 wanted: {_verdict(factor >= 80)}).")
    return [*lines, ""]


def _instances(raw: dict) -> list[str]:
    """What many vehicles in one process cost."""
    lines = [
        "Vehicles in one process share one model (RFL) and one road. Either one controller serves all, given the state "
        "of each (`step_for`), or each has its own. Each goes along a part of its own of one recorded drive. All step "
        "in turn; vehicles are not simulated. `two threads` is the wall time of a step when two threads share the "
        "vehicles. Nothing is locked: shared data are read only. Each number is the middle one of five means; numbers "
        "of vehicles took turns. The first step of a controller stands apart: it looks everything up, and touches its "
        "memory first.",
        "",
        "| controllers | vehicles | step, us | against one | two threads, us | first step, us | memory each, KiB |",
        "|---|---|---|---|---|---|---|",
    ]
    for key, name in (("one", "one"), ("each", "one each")):
        rows = _by_size(raw["instances"][key])
        alone = rows["1"]["step_us"]
        for count, row in rows.items():
            # Few fit into memory that the process had before.
            memory = f"{row['kib']:.1f}" if row["kib"] and int(count) >= 100 else ""
            lines.append(
                f"| {name} | {count} | {row['step_us']:.1f} | {row['step_us'] / alone:.1f} | "
                f"{row['step_us_2_threads']:.1f} | {row['first_step_us']:.0f} | {memory} |"
            )
    ends = list(rows)[-2:]
    many, most = (rows[count]["step_us"] for count in ends)
    cold = raw["instances"]["cold_us"]
    return [
        *lines,
        "",
        "A step of one controller alone is the fastest: its memory is in the caches, and most of its last look-up "
        f"still holds. With the caches emptied before each step it takes {cold:.1f} us. Of {ends[0]} controllers in "
        f"turn each takes {many:.1f} us, of {ends[1]} {most:.1f} us. At that price, time is proportional to their "
        "number. One controller for all keeps its working memory in the caches. It needs only a state of each vehicle, "
        "but looks everything up anew for each. Most of a controller's memory is that of Clarabel, the fallback, which "
        "hardly a step touches.",
        "",
    ]


def _growth(raw: dict) -> list[str]:
    growth = raw["growth"]
    lines = ["## How cost grows", "", "Median of a control step, us; the entries of a row took turns in one run.", ""]
    for key, (title, _) in GROWTH.items():
        row = _by_size(growth["steps"][key])
        lines += [
            f"| {title} | " + " | ".join(row) + " |",
            "|---" * (len(row) + 1) + "|",
            "| us | " + " | ".join(f"{value:.1f}" for value in row.values()) + " |",
            "",
        ]
    row = _by_size(growth["log_ms"])
    lines += [
        "| log, s of driving | " + " | ".join(row) + " |",
        "|---" * (len(row) + 1) + "|",
        "| samples made, ms | " + " | ".join(f"{value:.2f}" for value in row.values()) + " |",
        "",
    ]
    return lines


def _training(raw: dict) -> list[str]:
    lines = [
        "## Training",
        "",
        "20 trees of depth 6 on rows of 64 columns and 4 outputs, 2 threads; then one row looked up.",
        "",
        "| rows | training, s | most memory, against the table | look-up of a row, us |",
        "|---|---|---|---|",
    ]
    for rows, part in raw["training"].items():
        memory = "" if part["memory_over_data"] is None else f"{part['memory_over_data']:.2f}"
        lines.append(f"| {int(rows):,} | {part['train_s']:.2f} | {memory} | {part['row_us']:.3f} |".replace(",", " "))
    if part := raw["training"].get("1000000"):
        lines += [
            "",
            f"A million rows in at most 60 s: {_verdict(part['train_s'] <= 60)}; memory at most 3 x the data: "
            f"{_verdict((part['memory_over_data'] or 0) <= 3)}.",
        ]
    return [*lines, ""]


def _plot(raw: dict, file: Path) -> None:
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4))
    for place, (horizon, part) in enumerate(raw.get("qp", {}).items()):
        names = list(part["solvers"])
        places = [i + 0.4 * place for i in range(len(names))]
        left.bar(places, [part[f"{name}_us"] for name in names], width=0.4, label=f"N = {horizon}")
        left.set_xticks(
            [i + 0.2 for i in range(len(names))], [SOLVERS[name] for name in names], rotation=35, ha="right"
        )
    left.set(yscale="log", ylabel="median of a problem, us", title="the quadratic program")
    left.legend()
    for key, label in (("horizon_nominal_us", "nominal"), ("horizon_rfl_us", "RFL, W = 28")):
        row = _by_size(raw.get("growth", {}).get("steps", {}).get(key, {}))
        right.loglog([int(n) for n in row], list(row.values()), "o-", label=label)
    right.set(xlabel="horizon N, steps", ylabel="median of a control step, us", title="the whole step")
    right.grid(which="both", alpha=0.3)
    right.legend()
    figure.tight_layout()
    figure.savefig(file, dpi=110)
    plt.close(figure)


def write(raw: dict, folder: Path) -> None:
    """Writes the results of what was measured."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "speed.json").write_text(json.dumps(summary(raw), indent=1) + "\n", encoding="utf-8")
    _plot(raw, folder / "speed.png")
    lines = [
        "# Speed",
        "",
        "Written by `scripts/compare_peers`. Times are of "
        f"{raw['machine'].get('processor', 'a machine')}, {raw['machine'].get('cores', '?')} cores, not all of them "
        "free; ratios are of one run, in which all took turns.",
        "",
        *program_lines(raw),
        "![Solvers side by side; the step over the horizon](speed.png)",
        "",
    ]
    if notes := raw.get("notes"):
        lines += [notes, ""]
    parts = {
        "qp": _qp,
        "agreement": _agreement,
        "speed": _steps,
        "growth": _growth,
        "instances": _instances,
        "training": _training,
    }
    for name, section in parts.items():
        if name in raw:
            lines += section(raw)
    if any(name in raw for name in NONLINEAR):
        lines += _nonlinear(raw)
    (folder / "speed.md").write_text("\n".join(lines), encoding="utf-8")
