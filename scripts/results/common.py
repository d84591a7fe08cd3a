"""What the results of all kinds of vehicles share: means over seeds, tables, drives, plots."""

from __future__ import annotations

import csv
import math
import statistics
from collections.abc import Iterable
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from provenance import program_text, provenance

ROOT = Path(__file__).resolve().parent.parent.parent
PROTOCOLS = {
    "own_best": "Each row at its own best",
    "frozen": "All rows at the weights that are best for the nominal MPC",
    "default": "All rows at the default weights",
}

# Time of a step (s); both papers print the same: Zhao et al., ITSC 2024, Table IV.
PAPER_TIME = {
    "MPC": {"mean_s": 0.059, "max_s": 0.827},
    "RTL": {"mean_s": 0.184, "max_s": 0.886},
    "RFL": {"mean_s": 0.695, "max_s": 1.641},
    "NMPC": {"mean_s": 2.308, "max_s": 4.137},
    "GP-NMPC": {"mean_s": 15.434, "max_s": 21.692},
}


def program() -> dict:
    """The program of this checkout, for a results page."""
    return provenance(ROOT / "target" / "release" / "rfl", ROOT)


def program_lines(results: dict) -> list[str]:
    """Version and commit of the program that made the results, as lines of a page."""
    text = program_text(results.get("program", {}))
    return [text, ""] if text else []


def spread(values: list[float]) -> tuple[float, float]:
    """Mean and standard deviation; 0 for a single value: no seed plays a part in it."""
    return statistics.fmean(values), statistics.stdev(values) if len(values) > 1 else 0.0


def summary(outcomes: list[dict], base: list[dict]) -> dict:
    """A row's outcomes, means over the seeds with `_sd` beside them, against the nominal MPC's outcomes."""
    entry = {}
    for key in ("mae", "rmse", "max"):
        entry[key], entry[f"{key}_sd"] = spread([o["tracking"][key] for o in outcomes])
    for key in ("mae", "rmse"):
        nominal = statistics.fmean(o["tracking"][key] for o in base)
        pe = [100 * (1 - o["tracking"][key] / nominal) for o in outcomes]
        entry[f"pe_{key}"], entry[f"pe_{key}_sd"] = spread(pe)
    entry["roughness"], entry["roughness_sd"] = spread([o["steering"]["rate_rms"] for o in outcomes])
    entry["diverged"] = sum(o["lost"] for o in outcomes)
    entry["seeds"] = len(outcomes)
    return entry


def classes_of(outcomes: list[dict]) -> dict:
    """Errors by class of road, means over the seeds."""
    names = sorted({name for o in outcomes for name in o["classes"]})
    return {
        name: {
            key: statistics.fmean(o["classes"][name][key] for o in outcomes if name in o["classes"])
            for key in ("mae", "rmse", "max")
        }
        for name in names
    }


def table(condition: dict, protocol: str) -> dict:
    """A tracking table: means over the seeds with `_sd` beside them."""
    rows = {}
    for row in condition["rows"]:
        entry = summary(row[protocol], condition["rows"][0][protocol])
        entry["classes"] = classes_of(row[protocol])
        if protocol == "own_best":
            entry["weights"] = row["weights"]
        rows[row["row"]] = entry
    return rows


def fits(condition: dict) -> dict:
    """Errors of predictions, means over the seeds; components in the order of the states."""
    rows = {}
    for row in condition["rows"]:
        if not row["fit"]:
            continue
        entry = {}
        for part in row["fit"][0]:
            for key in ("rmse", "max", "nominal_rmse"):
                values = [fit[part][key] for fit in row["fit"]]
                both = [spread(list(component)) for component in zip(*values, strict=True)]
                entry.setdefault(part, {})[key] = [mean for mean, _ in both]
                entry[part][f"{key}_sd"] = [sd for _, sd in both]
        rows[row["row"]] = entry
    return rows


# -- Markdown ---------------------------------------------------------------------------------------------------------


def markdown_table(head: list[str], rows: list[list[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "-"


def tracking_markdown(rows: dict, paper: dict | None = None) -> str:
    """A tracking table, with what the paper printed (`mae` in m and a PE) beside it; no PE of or against divergence."""
    head = ["row", "MAE mm", "RMSE mm", "max mm", "PE MAE %", "PE RMSE %", "roughness rad/s"]
    if paper is not None:
        head.append("paper: MAE mm, PE %")
    body = []
    lost = any(entry["diverged"] for entry in list(rows.values())[:1])
    for name, entry in rows.items():
        cells = [name]
        for key, digits in (("mae", 2), ("rmse", 2), ("max", 1)):
            cells.append(f"{number(1e3 * entry[key], digits)} ± {number(1e3 * entry[f'{key}_sd'], digits)}")
        for key in ("pe_mae", "pe_rmse"):
            of_means = f"{number(entry[key], 1)} ± {number(entry[f'{key}_sd'], 1)}"
            cells.append("-" if lost or entry["diverged"] else of_means)
        cells.append(number(entry["roughness"], 3))
        if entry["diverged"]:
            cells[0] += f" (diverged in {entry['diverged']} of {entry['seeds']})"
        if paper is not None:
            printed = paper.get(name)
            text = "" if printed is None else f"{1e3 * printed['mae']:.1f}"
            if printed:
                text += "".join(f", {value}" for key, value in printed.items() if key.startswith("pe_"))
            cells.append(text)
        body.append(cells)
    return markdown_table(head, body)


def classes_markdown(rows: dict) -> str:
    names = sorted({name for entry in rows.values() for name in entry["classes"]})
    body = [
        [row, *(number(1e3 * entry["classes"][n]["mae"], 2) if n in entry["classes"] else "-" for n in names)]
        for row, entry in rows.items()
    ]
    return markdown_table(["MAE mm on", *names], body)


def time_markdown(rows: dict, paper: dict) -> str:
    head = ["row", "mean µs", "p99 µs", "max µs", "missed", "look-up µs", "condensing µs", "solve µs", "paper: mean s"]
    body = []
    for name, entry in rows.items():
        parts = [number(1e6 * entry[part]["mean_s"], 1) for part in ("look_up", "condense", "solve")]
        printed = paper.get(name)
        cells = [number(1e6 * entry[key], 1) for key in ("mean_s", "p99_s", "max_s")]
        body.append([name, *cells, str(entry["missed"]), *parts, str(printed["mean_s"]) if printed else ""])
    return markdown_table(head, body)


# -- Plots ------------------------------------------------------------------------------------------------------------

SHOWN = {
    "MPC": "tab:gray",
    "RTL": "tab:orange",
    "RFL": "tab:blue",
    "RFL+S": "tab:red",
    "RFL+S+observer": "tab:green",
    "NMPC": "tab:purple",
}


def read_drive(file: Path) -> dict[str, list[float]]:
    with file.open() as lines:
        rows = list(csv.DictReader(lines))
    return {
        key: [float(row[key]) for row in rows] for key in ("x", "y", "yaw", "station", "e1", "e2", "vx", "steer_cmd")
    }


def read_drives(folder: Path, rows: Iterable[str], before: str = "") -> dict[str, dict]:
    """The drives of rows that are there; `before` stands before the row's name in the file's."""
    files = {name: folder / f"{before}{name}.csv" for name in rows}
    return {name: read_drive(file) for name, file in files.items() if file.exists()}


def save(figure: plt.Figure, file: Path) -> None:
    figure.tight_layout()
    figure.savefig(file, dpi=110)
    plt.close(figure)


def draw_errors(drives: dict[str, dict], colours: dict[str, str], road_title: str, file: Path) -> None:
    """The road, and the lateral error along it."""
    figure, (road, error) = plt.subplots(1, 2, figsize=(13, 4.6), width_ratios=(1, 2))
    first = next(iter(drives.values()))
    road.plot(first["x"], first["y"], color="black", linewidth=1)
    road.plot(first["x"][0], first["y"][0], "o", color="tab:green")
    road.set(aspect="equal", xlabel="x in m", ylabel="y in m", title=road_title)
    for name, drive in drives.items():
        error.plot(drive["station"], [1e3 * e for e in drive["e1"]], color=colours[name], linewidth=0.8, label=name)
    error.set(xlabel="station in m", ylabel="lateral error in mm", title="Lateral error, each row at its own best")
    error.legend(ncols=3)
    error.grid(alpha=0.3)
    save(figure, file)


def sharpest(drive: dict) -> list[tuple[str, float]]:
    """Stations of the sharpest turns to the right and to the left: where the road's heading changes most."""
    heading = [yaw - e2 for yaw, e2 in zip(drive["yaw"], drive["e2"], strict=True)]
    rates = []
    step = 60
    for i in range(0, len(heading) - step, 10):
        length = drive["station"][i + step] - drive["station"][i]
        rates.append((i, (heading[i + step] - heading[i]) / length if length > 2 else 0.0))
    places = (min(rates, key=lambda r: r[1]), max(rates, key=lambda r: r[1]))
    return [(title, drive["station"][i + step // 2]) for (i, _), title in zip(places, ("right", "left"), strict=True)]


def magnified_track(drive: dict, rows: list[int], magnified: float) -> tuple[list, list]:
    """The road under rows of a drive, and where the vehicle would be with a magnified error."""
    heading = [drive["yaw"][i] - drive["e2"][i] for i in rows]
    road = [
        (drive["x"][i] + drive["e1"][i] * math.sin(a), drive["y"][i] - drive["e1"][i] * math.cos(a))
        for i, a in zip(rows, heading, strict=True)
    ]
    far = [
        (x - magnified * drive["e1"][i] * math.sin(a), y + magnified * drive["e1"][i] * math.cos(a))
        for (x, y), i, a in zip(road, rows, heading, strict=True)
    ]
    return road, far


def draw_turns(drives: dict[str, dict], colours: dict[str, str], magnified: float, around: float, file: Path) -> None:
    """The sharpest right and left turn with `around` m to each side, the error magnified so that it can be seen."""
    figure, axes = plt.subplots(1, 2, figsize=(12, 5.4))
    for axis, (title, middle) in zip(axes, sharpest(next(iter(drives.values()))), strict=True):
        for place, (name, drive) in enumerate(drives.items()):
            rows = [i for i, s in enumerate(drive["station"]) if abs(s - middle) < around]
            if not rows:
                continue
            road, far = magnified_track(drive, rows, magnified)
            if place == 0:
                axis.plot(*zip(*road, strict=True), color="black", linewidth=2.5, label="road")
            axis.plot(*zip(*far, strict=True), color=colours[name], linewidth=1.2, label=name)
        axis.set(
            aspect="equal",
            xlabel="x in m",
            ylabel="y in m",
            title=f"sharpest turn to the {title}, lateral error x {magnified:.0f}",
        )
        axis.legend(fontsize=8)
    save(figure, file)


def draw_bars(conditions: dict[str, dict], colours: dict[str, str], height: float, file: Path) -> None:
    """Mean lateral error of all rows on all plants, each row at its own best; red where it diverged."""
    figure, axes = plt.subplots(
        1, len(conditions), figsize=(3.0 * len(conditions) + 1.5, height), sharey=True, squeeze=False
    )
    for axis, (name, tables) in zip(axes[0], conditions.items(), strict=True):
        rows = tables["own_best"]
        names = list(rows)
        axis.barh(
            names,
            [1e3 * rows[n]["mae"] for n in names],
            xerr=[1e3 * rows[n]["mae_sd"] for n in names],
            color=["tab:red" if rows[n]["diverged"] else colours.get(n, "tab:cyan") for n in names],
        )
        axis.set(xscale="log", xlabel="MAE in mm", title=name.replace("_", " "))
        axis.title.set_fontsize(9)
        axis.grid(axis="x", alpha=0.3)
    axes[0][0].invert_yaxis()
    figure.tight_layout()
    figure.savefig(file, dpi=100)
    plt.close(figure)
