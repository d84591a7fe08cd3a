"""The truck's plots, like Fig. 5 to 9, 11 and 12 of the truck paper."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt

from results.common import draw_errors, draw_turns, save

# Rows that are drawn, each in a colour of its own.
SHOWN = {
    "MPC": "tab:gray",
    "first_order": "tab:olive",
    "pade_1_1": "tab:brown",
    "pade_2_2": "tab:pink",
    "identified": "tab:cyan",
    "oracle": "black",
    "linear": "gold",
    "RTL": "tab:orange",
    "RFL": "tab:blue",
    "RFL+S": "tab:red",
    "RFL+S+observer": "tab:green",
    "NMPC": "tab:purple",
    "GP-NMPC": "violet",
}
# Rows of the learned models, and of the delay models.
RESIDUALS = ("MPC", "RTL", "RFL", "RFL+S", "RFL+S+observer", "NMPC", "GP-NMPC")
DELAYS = ("MPC", "first_order", "pade_1_1", "pade_2_2", "identified", "oracle", "RFL", "RFL+S")

LOW_ERROR, HIGH_ERROR, HIGH_TRACK = "truck-low-delay.png", "truck-high-delay.png", "truck-high-delay-track.png"
STEP, U_TURN, SWEEP, ROWS = "truck-step.png", "truck-u-turn.png", "truck-dead-time.png", "truck-rows.png"
OF_PLANT = {"low_delay": [LOW_ERROR], "high_delay": [HIGH_ERROR, HIGH_TRACK]}


def of(drives: dict[str, dict], rows: tuple[str, ...]) -> dict[str, dict]:
    return {name: drive for name, drive in drives.items() if name in rows}


def draw_steps(conditions: dict, file: Path) -> None:
    """Fig. 6: the steering angle behind each delay, and what the command was."""
    figure, axis = plt.subplots(figsize=(8, 4))
    for place, (name, condition) in enumerate(conditions.items()):
        step = condition["step"]
        if place == 0:
            axis.step(step["time"], step["command"], where="post", color="black", label="command")
        axis.plot(step["time"], step["angle"], label=name.replace("_", " "))
        identified = next(entry for entry in condition["identified"] if entry["row"] == "identified")
        axis.axvline(0.5 + identified["dead_time"], color="gray", linewidth=0.6, linestyle=":")
    title = "A recorded step (dotted: the dead time identified)"
    axis.set(xlabel="time in s", ylabel="road-wheel angle in rad", xlim=(0.3, 2.5), title=title)
    axis.legend()
    axis.grid(alpha=0.3)
    save(figure, file)


def draw_u_turns(drives: dict[str, dict[str, dict]], file: Path) -> None:
    """Fig. 11 and 12: the trajectories through the U-turn, and the lateral errors of the delay models."""
    figure, axes = plt.subplots(len(drives), 2, figsize=(12, 4.2 * len(drives)), squeeze=False)
    for (track, error), (name, rows) in zip(axes, drives.items(), strict=True):
        for row, drive in of(rows, DELAYS).items():
            track.plot(drive["x"], drive["y"], color=SHOWN[row], linewidth=1, label=row)
            millimetres = [1e3 * e for e in drive["e1"]]
            error.plot(drive["station"], millimetres, color=SHOWN[row], linewidth=0.9, label=row)
        title = name.replace("_", " ")
        track.set(aspect="equal", xlabel="x in m", ylabel="y in m", title=f"U-turn, {title}")
        error.set(xlabel="station in m", ylabel="lateral error in mm", title=f"Lateral error, {title}")
        error.legend(fontsize=8, ncols=2)
        error.grid(alpha=0.3)
    save(figure, file)


def draw_sweep(tables: dict, out: Path) -> None:
    """Mean lateral error over the dead time; a loop that diverged ends its line with a cross."""
    figure, axes = plt.subplots(1, len(tables), figsize=(6 * len(tables), 4.6), sharey=True, squeeze=False)
    for axis, (weights, rows) in zip(axes[0], tables.items(), strict=True):
        top = max(1e3 * entry["mae"] for entries in rows.values() for entry in entries if entry["mae"] is not None)
        for place, (name, entries) in enumerate(rows.items()):
            points = [(e["dead_time"], 1e3 * e["mae"]) for e in entries if e["mae"] is not None]
            if points:
                axis.plot(*zip(*points, strict=True), "o-", color=SHOWN[name], label=name, markersize=4)
            lost = [e["dead_time"] for e in entries if e["diverged"]]
            axis.plot(lost, [1.5 * top * 1.15**place] * len(lost), "x", color=SHOWN[name], markersize=8)
        title = f"weights: {weights} (crosses: diverged)"
        axis.set(yscale="log", xlabel="dead time in s", ylabel="MAE in mm", title=title)
        axis.legend(fontsize=8)
        axis.grid(alpha=0.3)
    save(figure, out / SWEEP)


def draw(conditions: dict, drives: dict, u_turns: dict, out: Path) -> None:
    """All plots of conditions without noise."""
    if of_low := of(drives.get("low_delay", {}), RESIDUALS):
        draw_errors(of_low, SHOWN, "Off-road path, driven from the dot", out / LOW_ERROR)
    if of_high := of(drives.get("high_delay", {}), DELAYS):
        draw_errors(of_high, SHOWN, "Test route, driven from the dot", out / HIGH_ERROR)
        draw_turns(of_high, SHOWN, 20.0, 35.0, out / HIGH_TRACK)
    if all("step" in condition for condition in conditions.values()):
        draw_steps(conditions, out / STEP)
    if any(u_turns.values()):
        draw_u_turns({name: rows for name, rows in u_turns.items() if rows}, out / U_TURN)
