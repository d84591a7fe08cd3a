"""Makes a set: one folder a case with what a user would have (log, reference, vehicle file); labels apart."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from . import sensors
from .cases import CannotDraw, Case, Plan, Set, make, vehicle_of
from .vehicles import Design, write_file


def folder_of(out: Path, number: int) -> Path:
    """Where a case lies."""
    return out / f"case_{number:03d}"


def write_case(case: Case, out: Path, file: Design | None = None) -> None:
    """Writes what the diagnosis gets: the log, and the vehicle as its `file` has it, by default as it was designed."""
    folder = folder_of(out, case.number)
    folder.mkdir(parents=True, exist_ok=True)
    sensors.write(case.log, folder / "log.csv.gz")
    if case.reference is not None:
        sensors.write(case.reference, folder / "reference.csv.gz")
    write_file(file or case.design, folder).rename(folder / "vehicle.toml")


def _one(job: tuple[Set, int, Plan, Design, Path]) -> dict | str:
    cases, number, plan, design, out = job
    try:
        case = make(cases, number, plan, design)
    except CannotDraw as error:
        return str(error)
    write_case(case, out, cases.file_of(design))
    return case.label()


def make_set(cases: Set, out: Path, jobs: int, say=lambda text: None, only: list[int] | None = None) -> list[dict]:
    """Makes all cases (or those of `only`), and gives their labels. What could not be drawn is said and left out."""
    designs, plans = cases.designs(), cases.plan()
    wanted = [number for number in range(len(plans)) if only is None or number in only]
    work = [(cases, n, plans[n], vehicle_of(designs, plans[n].vehicle), out) for n in wanted]
    labels = []
    with ProcessPoolExecutor(jobs) as pool:
        for done, label in enumerate(pool.map(_one, work), 1):
            if isinstance(label, str):
                say(label)
            else:
                labels.append(label)
            if done % 10 == 0:
                say(f"{done} of {len(work)} cases made")
    return labels
