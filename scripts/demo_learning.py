"""The demo's second part: a car whose steering is slow, with the controller as it is, identified, and learned.

`rfl learn` drives that car on other roads, identifies its steering and learns what the model misses
(`docs/learning.md`); the FMUs then drive the demo's roads with `controller_file` and `residual.file`.
"""

from __future__ import annotations

import subprocess
from dataclasses import dataclass, field
from pathlib import Path

from closed_loop import FMUS, Drive, DriveProgress, drive

# Lag and dead time of an ordinary electric power steering, s; the controller is not told.
STEERING = {"effect.steer_lag": 0.1, "effect.steer_delay": 0.06}
WORDS = "a steering lag of 0.1 s behind a dead time of 0.06 s"


@dataclass
class Row:
    """A road and its drives by column; a column that could not be driven is absent."""

    name: str
    drives: dict[str, Drive] = field(default_factory=dict)


def learn(rfl: Path, vehicle: str | None, folder: Path, quiet: bool) -> None:
    """Runs the ladder; a model that is refused is a result, a failure is an error."""
    command = [str(rfl), "learn", "--out", str(folder)]
    command += [word for name, value in STEERING.items() for word in ("--set", f"{name}={value}")]
    command += ["--vehicle", str(vehicle)] if vehicle else []
    command += ["--quiet"] if quiet else []
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "learn.txt").write_text(done.stdout, encoding="utf-8")
    if not (folder / "learn.json").is_file():
        raise RuntimeError(f"rfl learn failed (exit status {done.returncode})")


def columns(folder: Path) -> dict[str, dict[str, object]]:
    """Settings of the controller for each column, from what was learned; no column for a model that was refused."""
    identified = {"controller.controller_file": str((folder / "controller.toml").resolve())}
    found: dict[str, dict[str, object]] = {"default": {}, "identified": identified}
    model = folder / "model.rflm"
    if model.is_file():
        found["learned"] = identified | {"controller.residual.file": str(model.resolve())}
    return found


def compare(
    routes: dict[str, Path], vehicle: str | None, folder: Path, duration: float | None, fmus: Path = FMUS,
    quiet: bool = False,
) -> list[Row]:  # fmt: skip
    """Drives each road with each column's controller."""
    rows = []
    for name, file in routes.items():
        row = Row(name)
        for column, settings in columns(folder).items():
            progress = DriveProgress(f"{name}, {column}", quiet)
            try:
                row.drives[column] = drive(
                    file, vehicle, duration=duration, settings=STEERING | settings, fmus=fmus, progress=progress
                )
            finally:
                progress.close()
        rows.append(row)
    return rows


def results(rows: list[Row]) -> dict:
    """Figures by road and column."""
    return {
        row.name: {
            column: driven.results()["tracking"] | {"outcome": driven.outcome, "reason": driven.ending.reason}
            for column, driven in row.drives.items()
        }
        for row in rows
    }


def cell(figures: dict | None) -> str:
    """Mean and max of a drive in mm, or how it ended."""
    if figures is None:
        return "refused"
    text = f"{1e3 * figures['mae']:.1f} / {1e3 * figures['max']:.0f}"
    return text if figures["outcome"] == "completed" else f"{text} {figures['outcome']}"


def table(result: dict) -> str:
    """The figures as text."""
    names = ("default", "identified", "learned")
    width = max(len("route"), *(len(name) for name in result))
    lines = [f"{WORDS}: lateral error, mean / max [mm]", f"{'route':<{width}}" + "".join(f"{n:>16}" for n in names)]
    for route, of in result.items():
        lines.append(f"{route:<{width}}" + "".join(f"{cell(of.get(name)):>16}" for name in names))
    return "\n".join(lines)
