"""The car's results, passenger-car.md, .json and plots, from what `rfl evaluate` measured."""

from __future__ import annotations

import json
import subprocess
import tempfile
from pathlib import Path

from results.common import (
    PAPER_TIME,
    PROTOCOLS,
    ROOT,
    SHOWN,
    classes_markdown,
    draw_bars,
    draw_errors,
    draw_turns,
    fits,
    markdown_table,
    number,
    program,
    program_lines,
    read_drives,
    table,
    time_markdown,
    tracking_markdown,
)

HEADLINE = "lag_and_dead_time"
PLANTS = {
    "as_is": "the car as it is",
    "lag": "steering lag of 0.1 s added",
    "lag_and_dead_time": "steering lag of 0.1 s and dead time of 60 ms added",
    "payload_low_friction": "300 kg of payload, friction of all roads at 60 %",
}
# Zhao et al., ITSC 2024, Tables II to IV (errors in m, PE in %, times in s).
PAPER = {
    "tracking": {
        "MPC": {"mae": 0.0206, "rmse": 0.0403, "max": 0.2517},
        "RT": {"mae": 0.0189, "rmse": 0.0370, "max": 0.2304, "pe_mae": 7.89},
        "RTL": {"mae": 0.0176, "rmse": 0.0344, "max": 0.2118, "pe_mae": 14.29},
        "RF": {"mae": 0.0187, "rmse": 0.0366, "max": 0.2280, "pe_mae": 9.02},
        "RFL": {"mae": 0.0172, "rmse": 0.0335, "max": 0.2020, "pe_mae": 16.32},
        "NMPC": {"mae": 0.0200, "rmse": 0.0375, "max": 0.1786},
        "GP-NMPC": {"mae": 0.2145, "rmse": 0.0759, "max": 0.3967},
    },
    "fit_test_rmse_permille": {"RT": 1.57, "RF": 1.48, "RTL": 0.1479, "RFL": 0.1477},
    "time": PAPER_TIME,
}


ABOUT = """\
Written by `scripts/reproduce`; the same numbers as JSON in [passenger-car.json](passenger-car.json). Car
`{vehicle}`, N = 16, Ts = 0.02 s, Sudoku test route, disjoint from the training route. {seeds} seeds (drives,
models, noise), {drives} training drives a seed, {budget} candidates a row in the search for weights. The search drives
pieces of the training route. The chosen weights must then complete that route with every seed's model, at twice the
noise (typical noise on plants without). Errors are the true ones, not those of noisy sensors. ± is the standard
deviation over the seeds; 0 where no seed plays a part. PE is the cut against the nominal MPC under the same protocol.
Roughness is the RMS rate of the steering command. A row's own best may be no rougher than the nominal's best on
the training pieces. A diverged drive counts until the car was lost."""
ON_FROZEN_WEIGHTS = """\
The paper's own tables are Zhao et al., ITSC 2024, Tables II to IV. Its row NMPC+GP has an MAE above its RMSE, which is
impossible; it is no target. At one frozen weight set a ranking can be made either way. The nominal MPC survives a delay
with a high weight on the yaw rate, which acts as lead. Such weights are wrong for any model that knows the delay, the
exact oracle included."""
ON_PREDICTION = """\
RMSE and largest error of predictions on drives of the nominal MPC, one step and 16 steps ahead without looking, without
sensor noise."""


KINDS = {
    "RT": "rt",
    "RTL": "rtl",
    "RF": "rf",
    "RFL": "rfl",
    "linear": "linear",
    "RFL+S": "rfl_s",
    "NMPC": "nmpc",
    "GP-NMPC": "gp_nmpc",
    "oracle": "actuator",
    "RFL+S+observer": "rfl_s",
}
SOLVERS = {"active_set": 0, "clarabel": 1}


def measure_times(weights: dict) -> dict:
    """Step times of each row, at its own best, with either QP solver: drives of the test route, one after the other."""
    rfl = ROOT / "target/release/rfl"
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        slow = ["--set", "effect.steer_lag=0.1", "--set", "effect.steer_delay=0.06", "--quiet"]

        def run(*arguments: str) -> None:
            done = subprocess.run([rfl, *arguments], check=False, cwd=folder, capture_output=True, text=True)
            # A drive that is lost has had its steps.
            if done.returncode not in (0, 4):
                raise SystemExit(f"rfl {arguments[0]}: {done.stderr}")

        run("collect", "--runs", "1", *slow)
        log = str(Path(folder) / "out/collect/drive_1.csv")
        for kind in sorted({KINDS[row] for row in weights if row in KINDS} - {"nmpc", "actuator"}):
            run("train", log, "--kind", kind, "--quiet", "--force")
        for solver, number in SOLVERS.items():
            for row in weights:
                if row != "MPC" and row not in KINDS:
                    continue
                settings = {f"mpc.{key}": value for key, value in weights[row].items() if key.startswith(("q_", "r_"))}
                settings["observer.disturbance_noise"] = weights[row]["disturbance_noise"]
                settings["observer.prediction_noise"] = weights[row]["prediction_noise"]
                settings["mpc.solver"] = number
                if row == "oracle":
                    settings |= {"actuator.dead_time": 0.06, "actuator.time_constant": 0.15}
                sets = [part for name, value in settings.items() for part in ("--set", f"{name}={value}")]
                run("drive", *slow, *sets, "--variant", KINDS.get(row, "none"), "--json", "step.json")
                drive = json.loads((Path(folder) / "step.json").read_text())
                found.setdefault(solver, {})[row] = drive["step"] | drive["parts"]
    return found


# -- Markdown ---------------------------------------------------------------------------------------------------------


def fit_markdown(rows: dict) -> str:
    head = ["row", "part", "RMSE e1 m", "e1' m/s", "e2 rad", "e2' rad/s", "max e1 m"]
    body = []
    for name, entry in rows.items():
        for part, title in (("train", "train, 1 step"), ("test", "test, 1 step"), ("test_16_steps", "test, 16 steps")):
            values = [f"{value:.2e}" for value in entry[part]["rmse"]]
            body.append([name, title, *values, f"{entry[part]['max'][0]:.2e}"])
    if rows:
        first = next(iter(rows.values()))
        for part, title in (("test", "test, 1 step"), ("test_16_steps", "test, 16 steps")):
            body.append(["nominal", title, *(f"{value:.2e}" for value in first[part]["nominal_rmse"]), ""])
    return markdown_table(head, body)


def ratio_text(rows: dict, row: str) -> str:
    return f"{1e6 * rows[row]['mean_s']:.1f} ({rows[row]['mean_s'] / rows['MPC']['mean_s']:.2f} x)"


def ablation_markdown(entries: list[dict]) -> str:
    head = ["RFL+S with", "MAE mm", "RMSE mm", "max mm", "test RMSE e1', 1 step, m/s", "16 steps, m/s"]
    body = []
    for entry in entries:
        tracking = entry["outcome"]["tracking"]
        name = entry["name"] + (" (diverged)" if entry["outcome"]["lost"] else "")
        body.append(
            [
                name,
                *(number(1e3 * tracking[key], digits) for key, digits in (("mae", 2), ("rmse", 2), ("max", 1))),
                f"{entry['test']['rmse'][1]:.2e}",
                f"{entry['test_16_steps']['rmse'][1]:.2e}",
            ]
        )
    return markdown_table(head, body)


# -- All of it --------------------------------------------------------------------------------------------------------


def verdicts(results: dict) -> list[str]:
    """What the numbers say, line by line, against what the paper printed."""
    calm, noisy = results.get("tracking"), results.get("tracking_noise")
    lines = []
    if calm:
        for row in ("RT", "RF", "RTL", "RFL"):
            if row in calm:
                said = "above" if calm[row]["pe_mae"] > PAPER["tracking"][row]["pe_mae"] else "**below**"
                text = (
                    f"- {row}: PE {calm[row]['pe_mae']:.1f} %, {said} the printed {PAPER['tracking'][row]['pe_mae']} %"
                )
                fit = results["fit"]
                if row in ("RT", "RF") and f"{row}L" in fit:
                    # The reason: a constant answers to past states, not to the commands that are to be decided.
                    missed = {name: fit[name]["test_16_steps"]["rmse"][1] for name in (row, f"{row}L")}
                    nominal = fit[row]["test_16_steps"]["nominal_rmse"][1]
                    text += (
                        f": constant leaves leave the response to the commands to come nominal. 16 steps ahead they "
                        f"miss e1' by {missed[row]:.3f} m/s RMS (nominal {nominal:.3f}, {row}L {missed[f'{row}L']:.3f})"
                    )
                lines.append(text + ".")
    for title, rows in (("without noise", calm), ("with noise", noisy)):
        best = [row for row in ("RFL+S", "RFL+S+observer") if rows and row in rows]
        if not best:
            continue
        row = max(best, key=lambda name: rows[name]["pe_mae"])
        mine = rows[row]
        rivals = [name for name in ("NMPC", "GP-NMPC", "MPC+observer", "linear_curvature") if name in rows]
        ahead = [n for n in rivals if all(mine[k] < rows[n][k] for k in ("mae", "rmse", "max"))]
        behind = [n for n in rivals if n not in ahead]
        rough = "no rougher" if mine["roughness"] <= rows["MPC"]["roughness"] else "**rougher**"
        text = f"- {row} {title}: PE {mine['pe_mae']:.1f} % (MAE), {mine['pe_rmse']:.1f} % (RMSE)"
        text += f". Steering {rough} than the nominal's best"
        text += f". Ahead of {', '.join(ahead)} on MAE, RMSE and max" if ahead else ""
        text += f". **Not** ahead of {', '.join(behind)} on all three" if behind else ""
        lines.append(text + ".")
    return lines


def write_markdown(results: dict, raw: dict, out: Path) -> None:
    effort = results["effort"]
    text = [
        "# The car: the first paper's tables beside ours",
        "",
        ABOUT.format(vehicle=results["vehicle"], **effort),
        "",
        *program_lines(results),
        "**What it says**",
        "",
        *verdicts(results),
        "",
    ]
    for name in (HEADLINE, f"{HEADLINE}_noise"):
        if name in results["conditions"]:
            noise = (
                "with sensor noise (5 mm, 10 mm/s, 1.5 mrad, 4 mrad/s)"
                if name.endswith("noise")
                else "without sensor noise"
            )
            text += [f"## {PLANTS[HEADLINE].capitalize()}, {noise}", ""]
            for protocol, title in PROTOCOLS.items():
                text += [
                    f"**{title}**",
                    "",
                    tracking_markdown(
                        results["conditions"][name][protocol],
                        PAPER["tracking"] if protocol == "own_best" else None,
                    ),
                    "",
                ]
            text += [classes_markdown(results["conditions"][name]["own_best"]), ""]
    text += [
        "![Lateral error along the route](passenger-car-error.png)",
        "",
        "![A right and a left turn](passenger-car-turns.png)",
        "",
        ON_FROZEN_WEIGHTS,
        "",
        "## Prediction",
        "",
        ON_PREDICTION,
        "",
        fit_markdown(results["fit"]),
        "",
        "## Time",
        "",
        "Wall clock of a control step on this machine, drive of the test route, sample time 20 ms. The paper's are "
        "its MATLAB's.",
        "",
        time_markdown(results["time"], PAPER["time"]),
        "",
    ]
    both = results["time_of_solvers"]
    body = [[row, *(ratio_text(both[solver], row) for solver in both)] for row in next(iter(both.values()))]
    text += [
        "Mean step in µs with the default QP solver and with the interior-point method alone (`mpc.solver=1`). "
        "In brackets: the ratio to the nominal MPC with the same solver.",
        "",
        markdown_table(["row", "active set (default)", "Clarabel alone"], body),
        "",
    ]
    if results["ablations"]:
        text += [
            "## What matters",
            "",
            "One thing changed in turn, at the weights of RFL+S (no noise, first seed).",
            "",
            ablation_markdown(results["ablations"]),
            "",
        ]
    text += ["## Other plants", "", "![All plants](passenger-car-plants.png)", ""]
    for name, tables in results["conditions"].items():
        if name.startswith(HEADLINE):
            continue
        plant = name.removesuffix("_noise")
        noise = "with sensor noise" if name.endswith("_noise") else "without sensor noise"
        text += [f"### {PLANTS[plant].capitalize()}, {noise}", ""]
        # A condition that was kept from an earlier run says so.
        text += program_lines({"program": results["kept"][name]}) if name in results.get("kept", {}) else []
        for protocol, title in PROTOCOLS.items():
            text += [f"**{title}**", "", tracking_markdown(tables[protocol]), ""]
    missing = [n for p in PLANTS for n in (p, f"{p}_noise") if n not in results["conditions"]]
    if missing:
        text += [f"Not run here: {', '.join(missing)}.", ""]
    (out / "passenger-car.md").write_text("\n".join(text))


def keep(results: dict, before: dict, names: list[str]) -> None:
    """Takes over the conditions that were not run, of the same car and effort, with the program that ran them."""
    same = all(results[key] == before.get(key) for key in ("vehicle", "effort"))
    results["kept"] = {}
    for name in names if same else ():
        if name not in results["conditions"] and name in before["conditions"]:
            results["conditions"][name] = before["conditions"][name]
            results["kept"][name] = before.get("kept", {}).get(name, before["program"])


def write(folder: Path, out: Path) -> None:
    """Writes the results of the conditions in a folder of `rfl evaluate`; others stay as an earlier run had them."""
    names = [
        f"{plant}{noise}" for plant in (HEADLINE, *(p for p in PLANTS if p != HEADLINE)) for noise in ("", "_noise")
    ]
    raw = {n: json.loads((folder / f"{n}.json").read_text()) for n in names if (folder / f"{n}.json").exists()}
    if HEADLINE not in raw:
        raise SystemExit(f"{folder}: no {HEADLINE}.json; run scripts/reproduce, or rfl evaluate --plants {HEADLINE}")
    head = raw[HEADLINE]
    results = {
        "vehicle": head["vehicle"],
        "effort": head["effort"],
        "program": program(),
        "tracking": table(head, "own_best"),
        "fit": fits(head),
        "conditions": {name: {p: table(c, p) for p in PROTOCOLS} for name, c in raw.items()},
        "ablations": head["ablations"],
        "paper": PAPER,
    }
    before = out / "passenger-car.json"
    if before.exists():
        keep(results, json.loads(before.read_text()), names)
    if f"{HEADLINE}_noise" in raw:
        results["tracking_noise"] = table(raw[f"{HEADLINE}_noise"], "own_best")
    weights = {row["row"]: row["weights"] for row in head["rows"]}
    results["time_of_solvers"] = measure_times(weights)
    results["time"] = results["time_of_solvers"]["active_set"]
    drives = read_drives(folder / f"drives_{HEADLINE}", SHOWN)
    if drives:
        # Like Fig. 5 and 6 of Zhao et al.
        road = "Sudoku test route, driven anticlockwise from the dot"
        draw_errors(drives, SHOWN, road, out / "passenger-car-error.png")
        draw_turns(drives, SHOWN, 150.0, 28.0, out / "passenger-car-turns.png")
    draw_bars(results["conditions"], SHOWN, 4.6, out / "passenger-car-plants.png")
    write_markdown(results, raw, out)
    (out / "passenger-car.json").write_text(json.dumps(results, indent=1) + "\n")
    print(f"{out}/passenger-car.md, .json and plots")
    print("\n".join(verdicts(results)))
