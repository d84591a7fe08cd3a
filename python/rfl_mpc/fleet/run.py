"""A whole run: drives, answers, tables, page."""

from __future__ import annotations

import contextlib
import functools
import itertools
import json
import numbers
import os
import sys
import threading
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import rfl_mpc
from rfl_mpc._call import File, file_name, plain, reason
from rfl_mpc._native import RflError
from rfl_mpc.fleet import engine, manifest, page, tables
from rfl_mpc.fleet.changes import Change, Vehicle
from rfl_mpc.fleet.findings import Finding, by_kind
from rfl_mpc.fleet.findings import lines as finding_lines
from rfl_mpc.fleet.manifest import Drive
from rfl_mpc.fleet.reduce import TypeState, VehicleState, reduce_type, say
from rfl_mpc.fleet.store import Store
from rfl_mpc.fleet.summary import drives_of
from rfl_mpc.fleet.work import diagnosed

if TYPE_CHECKING:
    import pandas as pd

STORE = "drives.sqlite"
NAMED = 3
"""Files that are named of many."""
NOT_KNOWN = "not known"
"""Type of vehicles without a vehicle file of which no drive was diagnosed."""


@dataclass(frozen=True)
class Fleet:
    """What a run gave; the tables lie in ``out``, an absolute path."""

    out: Path
    report: dict[str, Any]
    """What ``fleet.json`` holds."""

    @property
    def changed(self) -> list[str]:
        """Vehicles that have changed, the surest first."""
        return self.report["changed"]

    @functools.cached_property
    def vehicles(self) -> pd.DataFrame:
        """A row a change: see ``vehicles.parquet``; kept once it is read."""
        return self._table("vehicles.parquet")

    @functools.cached_property
    def verdicts(self) -> pd.DataFrame:
        """A row a drive: see ``verdicts.parquet``; kept once it is read."""
        return self._table("verdicts.parquet")

    def _table(self, name: str) -> pd.DataFrame:
        import pandas as pd

        if "waiting" in self.report:
            raise RflError(f"a dry run has no {name}; run without dry_run")
        try:
            now = (self.out / "fleet.json").read_text(encoding="utf-8")
            found = pd.read_parquet(self.out / name)
        except OSError as error:
            raise RflError(f"{self.out / name}: cannot be read ({reason(error)}); run again") from None
        if now != _json(self.report):
            raise RflError(f"{self.out}: another run has written here since; give each run an out of its own")
        return found

    def __str__(self) -> str:
        return self.report["words"]


def _json(report: dict[str, Any]) -> str:
    return json.dumps(report, indent=1) + "\n"


def run(
    sources: Any,
    *,
    vehicle: File | None = None,
    out: File = "fleet",
    dask: str | None = None,
    workers: int | None = None,
    dry_run: bool = False,
    again: bool = False,
    time_limit: float = 600.0,
    reports: int = 20,
    pairs: bool = True,
    trust: str | None = None,
    rate: float | None = None,
    quiet: bool = True,
) -> Fleet:
    """Diagnoses the drives of a fleet, and says what differs in which vehicle since when.

    Parameters
    ----------
    sources
        Folders of logs (each folder below is a vehicle), logs, or manifests: tables with the columns ``log``,
        ``vehicle``, and perhaps ``time``, ``vehicle_file``, ``reference``, as files or data frames.
    vehicle
        Vehicle file of drives that name none.
    out
        Folder for the tables and the page. What is done already is kept there in ``drives.sqlite``.
    dask
        Address of a scheduler; its workers read the same files. Default: workers on this machine, ``workers`` of them.
    dry_run
        Only say what would be done, and which files are missing (``report["missing"]``).
    again
        Drives that gave an error are tried once more.
    time_limit
        Longest diagnosis of a drive, s.
    reports
        Single reports that are written of the first changed drives.
    pairs, trust, rate
        As of :func:`rfl_mpc.diagnose`.

    Returns
    -------
    Fleet
        With data frames ``vehicles`` and ``verdicts``, and ``changed``, the vehicles that have.
    """
    if workers is not None and not (isinstance(workers, numbers.Integral) and workers >= 1):
        raise RflError(f"workers: {workers!r}; give a whole number, 1 or more")
    if not (isinstance(time_limit, numbers.Real) and 0.0 < time_limit <= threading.TIMEOUT_MAX):
        raise RflError(f"time_limit: {time_limit!r}; give a number of seconds, more than 0")
    if not (isinstance(reports, numbers.Integral) and reports >= 0):
        raise RflError(f"reports: {reports!r}; give a whole number, 0 or more")
    one = (
        isinstance(sources, (str, bytes, os.PathLike))
        or manifest.is_table(sources)
        or not isinstance(sources, Iterable)
    )
    given = [sources] if one else list(sources)
    default = None if vehicle is None else _vehicle(file_name(vehicle))
    drives = [
        drive if drive.vehicle_file is not None else replace(drive, vehicle_file=default)
        for drive in manifest.read(given)
    ]
    of_vehicle: dict[str, str | None] = {}
    for drive in drives:
        file = drive.vehicle_file
        if of_vehicle.setdefault(drive.vehicle, file) != file:
            raise RflError(
                f"vehicle '{drive.vehicle}' has two vehicle files, {of_vehicle[drive.vehicle]} and {file}; give it one"
            )
    options: dict[str, Any] = {"pairs": plain(pairs), "trust": trust, "rate": plain(rate)}
    for file in sorted({drive.vehicle_file for drive in drives}, key=str):
        _check(file, options)
    folder = Path(file_name(out))
    if dry_run and not (folder / STORE).exists():
        return _plan_words(folder, drives, range(len(drives)))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RflError(f"--out {folder}: {reason(error)}; give a folder that can be written to") from None
    store = Store(folder / STORE)
    try:
        plan = engine.plan(drives, store, options)
        if again:
            failed = [
                row for row, key in enumerate(plan.keys) if key is not None and (store.get(key) or {}).get("error")
            ]
            for row in failed:
                plan.keys[row] = None
            plan.waiting = sorted({*plan.waiting, *failed})
        if dry_run:
            return _plan_words(folder, drives, plan.waiting)
        say_progress = not quiet
        with contextlib.ExitStack() as stack:
            client = None
            if plan.waiting:
                client = stack.enter_context(engine.cluster(dask, workers))
                _diagnose(plan, store, client, options, time_limit, say_progress)
            answers = Answers(plan, store)
            types = _reduced(answers, say_progress)
            places = _first_changed(types, answers, reports)
            written = _reports(folder, answers, places, options, time_limit, client, stack, dask, workers)
        try:
            return _write(folder, answers, types, written)
        except OSError as error:
            raise RflError(f"{error.filename or folder}: {reason(error)}; what was done is kept: run again") from None
    finally:
        store.close()


def _vehicle(name: str) -> str:
    if Path(name).is_file():
        return str(Path(name).resolve())
    if name not in rfl_mpc.vehicles():
        known = ", ".join(sorted(rfl_mpc.vehicles()))
        raise RflError(f"--vehicle {name}: no such file, and no built-in vehicle; there are {known}")
    return name


def _check(vehicle: str | None, options: dict[str, Any]) -> None:
    """Reads a vehicle file and the options as a diagnosis does: what is wrong with them fails each drive."""
    try:
        rfl_mpc.diagnose({"vx": [1.0]}, vehicle, **options)
    except RflError as error:
        # It comes as far as the log, which is none.
        if not str(error).startswith("<log>"):
            raise


def _plan_words(folder: Path, drives: Sequence[Drive], rows: Sequence[int]) -> Fleet:
    """What would be done: the drives of some rows, as far as their files are there."""
    vehicles = len({drive.vehicle for drive in drives})
    types = len({drive.vehicle_file for drive in drives})
    lacks = {row: [file for file in (drive.log, drive.reference) if file and not os.path.exists(file)]
             for row, drive in enumerate(drives)}  # fmt: skip
    missing = list(dict.fromkeys(itertools.chain(*lacks.values())))
    waiting = sum(not lacks[row] for row in rows)
    words = f"{len(drives)} drives of {vehicles} vehicles of {types} types; {waiting} of them to be diagnosed"
    if missing:
        more = f" and {len(missing) - NAMED} more" if len(missing) > NAMED else ""
        are = "file is" if len(missing) == 1 else "files are"
        words += f"\n{len(missing)} {are} missing: {', '.join(missing[:NAMED])}{more}"
    report = {"words": words, "changed": [], "drives": len(drives), "waiting": waiting, "missing": missing}
    return Fleet(folder.absolute(), report)


class Answers:
    """Drives and their answers by vehicle."""

    def __init__(self, plan: engine.Plan, store: Store) -> None:
        self.plan, self.store = plan, store
        self.rows: dict[tuple[str, str], list[int]] = {}
        self.types: dict[str, str] = {}
        # A copy says nothing anew, and a log of two vehicles is of one of them at most.
        same: dict[str, list[int]] = {}
        for row, key in enumerate(plan.keys):
            if key is not None:
                same.setdefault(key, []).append(row)
        self.copies = {
            row: words
            for rows in same.values()
            if len(rows) > 1 and not self._answer(rows[0]).get("error")
            for row, words in self._copies(rows)
        }
        by_vehicle: dict[str, list[int]] = {}
        for row, drive in enumerate(plan.drives):
            by_vehicle.setdefault(drive.vehicle, []).append(row)
        for vehicle, rows in by_vehicle.items():
            known = (tables.type_of(plan.drives[row], self._answer(row)) for row in rows)
            self.types[vehicle] = next((type for type in known if type), NOT_KNOWN)
            self.rows[self.types[vehicle], vehicle] = rows

    def _copies(self, rows: list[int]) -> Iterator[tuple[int, str]]:
        """Those of rows with the same content that do not count, and why."""
        drives = [self.plan.drives[row] for row in rows]
        if len({drive.vehicle for drive in drives}) == 1:
            for row in rows[1:]:
                yield row, f"the same content as {drives[0].log}, which counts"
            return
        for row, drive in zip(rows, drives):
            other = next(one for one in drives if one.vehicle != drive.vehicle)
            yield (
                row,
                f"the same content as {other.log} of vehicle '{other.vehicle}': whose is it? It counts for neither",
            )

    def _answer(self, row: int) -> dict[str, Any]:
        key = self.plan.keys[row]
        found = None if key is None else self.store.get(key)
        return {"error": "not diagnosed"} if found is None else engine.told(found, self.plan.drives[row])

    def of(self, row: int) -> dict[str, Any]:
        """A drive's answer; an error of a copy, and where its log is of another kind of vehicle than the others."""
        if row in self.copies:
            return {"error": self.copies[row]}
        answer, vehicle = self._answer(row), self.plan.drives[row].vehicle
        type = tables.type_of(self.plan.drives[row], answer)
        if type and type != self.types[vehicle]:
            return {"error": f"a log of {type}, where others of this vehicle are of {self.types[vehicle]}"}
        return answer

    def told(self, type: str, vehicle: str) -> list[int]:
        """Rows of a vehicle's drives with a summary, in their order."""
        return [row for row in self.rows[type, vehicle] if self.of(row).get("information")]

    def summaries(self, type: str, vehicle: str) -> list[dict[str, Any]]:
        found = (self.of(row).get("information") for row in self.rows[type, vehicle])
        return [summary for summary in found if summary]

    def findings(self) -> list[Finding]:
        """What was found in the logs that were diagnosed."""
        told = (
            (vehicle, place, self.of(row).get("findings") or ())
            for (_, vehicle), rows in sorted(self.rows.items())
            for place, row in enumerate(rows)
        )
        return by_kind(told)

    def label(self, row: int) -> str:
        drive = self.plan.drives[row]
        return drive.time or Path(drive.log).name


def _diagnose(plan, store, client, options, limit, say_progress) -> None:
    from tqdm import tqdm

    with tqdm(
        total=len(plan.drives), initial=len(plan.drives) - len(plan.waiting), unit="drive", disable=not say_progress,
        file=sys.stderr, desc="diagnosed",
    ) as bar:  # fmt: skip
        engine.run(plan, store, client, options, limit, lambda drive, answer: bar.update())


def _reduced(answers: Answers, say_progress: bool) -> list[TypeState]:
    from tqdm import tqdm

    found = []
    for type, group in itertools.groupby(sorted(answers.rows), key=lambda one: one[0]):
        vehicles = [vehicle for _, vehicle in group]
        with tqdm(
            total=1.0, desc="vehicles", disable=not say_progress, file=sys.stderr, bar_format="{l_bar}{bar}"
        ) as bar:

            def progress(share: float, bar=bar) -> None:
                bar.update(share - bar.n)

            state = reduce_type(type, vehicles, lambda vehicle, type=type: answers.summaries(type, vehicle), progress)
        if state is not None:
            found.append(state)
    say(found)
    return found


def _first_changed(types: Sequence[TypeState], answers: Answers, most: int) -> list[tuple[str, int, int]]:
    """Vehicle, number and row of the drives that get a report of their own: the first of each change that is said."""
    found = []
    for state in page.order(types):
        rows = answers.told(state.type, state.vehicle)
        for change in page.said_changes(state):
            found.append((state.vehicle, change.since, rows[change.since]))
    return found[: max(most, 0)]


def _reports(folder, answers, places, options, limit, client, stack, dask, workers):
    """Writes single reports; gives the places of each vehicle's."""
    found: dict[str, list[tuple[int, str]]] = {}
    wanted = []
    for vehicle, number, row in places:
        key = answers.plan.keys[row]
        place = Path("reports") / key[:16] / "report.html"
        found.setdefault(vehicle, []).append((number, place.as_posix()))
        if not (folder / place).exists():
            wanted.append((row, folder / place))
    if wanted:
        client = client or stack.enter_context(engine.cluster(dask, workers))
        jobs = []
        for row, place in wanted:
            with_page = options | {"out": str(place.parent.resolve())}
            jobs.append(engine.job_of(answers.plan.drives[row], with_page))
        answered = client.gather([client.submit(diagnosed, job, limit, pure=False) for job in jobs])
        for (_, place), answer in zip(wanted, answered):
            if answer.get("error") or not place.exists():
                for of_vehicle in found.values():
                    of_vehicle[:] = [one for one in of_vehicle if folder / one[1] != place]
    return {vehicle: rows for vehicle, rows in found.items() if rows}


def _history(answers: Answers):
    def history(of: TypeState, state: VehicleState, effect: str) -> page.History | None:
        rows = answers.told(state.type, state.vehicle)
        drives = drives_of(answers.summaries(state.type, state.vehicle), of.parameters)
        vehicle = Vehicle(drives, of.spread, of.rates)
        value, deviation = vehicle.by_drive(effect, vehicle.changes().known)
        return page.History(effect, of.unit(effect), value, deviation, [answers.label(row) for row in rows])

    return history


def _write(folder: Path, answers: Answers, types: list[TypeState], reports) -> Fleet:
    version = rfl_mpc.__version__
    drives = answers.plan.drives
    number: dict[str, Iterator[int]] = {}

    def verdicts() -> Iterator[dict[str, Any]]:
        for row, drive in enumerate(drives):
            count = next(number.setdefault(drive.vehicle, itertools.count(1)))
            yield tables.verdict_row(
                drive, answers.types[drive.vehicle], count, answers.plan.keys[row] or "", answers.of(row), version
            )

    tables.write(folder / "verdicts.parquet", tables.verdict_schema(), verdicts())
    labels = {
        state.vehicle: [answers.label(row) for row in answers.told(state.type, state.vehicle)]
        for of in types for state in of.vehicles
    }  # fmt: skip
    changes = list(_changes(types, labels))
    tables.write(folder / "vehicles.parquet", tables.change_schema(), iter(changes))
    tables.write(folder / "types.parquet", tables.parameter_schema(), _parameters(types))
    errors = []
    for (_, vehicle), rows in sorted(answers.rows.items()):
        for place, row in enumerate(rows):
            if error := answers.of(row).get("error"):
                errors.append((vehicle, place, error))
    findings = answers.findings()
    states = page.order(types)
    changed = [state for state in states if any(not one.passing for one in page.said_changes(state))]
    counts = {"drives": len(drives), "vehicles": len({drive.vehicle for drive in drives})}
    report = {
        "words": _words(types, changed, counts, errors, findings, labels, folder),
        "changed": [state.vehicle for state in changed],
        **counts,
        "errors": len(errors),
        "types": [
            {
                "type": of.type, "vehicles": len(of.vehicles), "drives": of.drives,
                "changes_a_drive": of.rates.lasting, "passing_a_drive": of.rates.passing,
                "common": [
                    {name: getattr(one, name) for name in ("effect", "value", "low", "high", "probability", "also")}
                    for one in of.common
                ],
            }
            for of in types
        ],
        "changes": [one for one in changes if one["said"]],
        "version": version,
    }  # fmt: skip
    tables.write_text(folder / "fleet.json", lambda: _json(report))
    made = lambda: page.page(types, labels.__getitem__, _history(answers), reports, counts, (errors, findings), version)  # noqa: E731
    tables.write_text(folder / "index.html", made)
    return Fleet(folder.absolute(), report)


def _changes(types: Sequence[TypeState], labels) -> Iterator[dict[str, Any]]:
    """Rows of ``vehicles.parquet``: each change, said or not; of a vehicle without any its likeliest candidate."""
    for state in page.order(types):
        of = next(one for one in types if one.type == state.type)
        names = labels[state.vehicle]
        all: list[tuple[Change | None, bool]] = list(zip(state.changes, state.said)) or [(state.candidate, False)]
        for change, said in all:
            yield {
                "vehicle": state.vehicle, "type": state.type, "drives": state.drives, "nothing": state.nothing,
                "changed": said and change is not None and not change.passing, "said": said,
                **({} if change is None else {
                    "effect": change.effect, "unit": of.unit(change.effect), "passing": change.passing,
                    "since": names[change.since], "since_drive": change.since + 1, "earliest": change.earliest + 1,
                    "latest": change.latest + 1, "before": change.before, "value": change.value, "low": change.low,
                    "high": change.high, "probability": change.probability, "also": sorted(change.also.items()),
                }),
            }  # fmt: skip


def _parameters(types: Sequence[TypeState]) -> Iterator[dict[str, Any]]:
    """Rows of ``types.parquet``: each parameter of a type, and of each of its vehicles after its last drive."""
    for of in types:
        deviation = np.sqrt(np.maximum(np.diag(of.spread.true_covariance), 0.0))
        states = ((state.vehicle, state.mean, state.deviation) for state in of.vehicles)
        for vehicle, mean, spread in ((None, of.spread.true_mean, deviation), *states):
            for i, it in enumerate(of.parameters):
                ends = [it.value(mean[i] + side * 1.96 * spread[i]) for side in (-1.0, 1.0)]
                yield {
                    "type": of.type, "vehicle": vehicle, "parameter": it.name, "unit": it.unit, "simulator": it.given,
                    "value": it.value(mean[i]), "low": min(ends), "high": max(ends), "tolerance": it.tolerance,
                    "between_vehicles": it.scale * of.spread.between_vehicles[i] ** 0.5 if vehicle is None else None,
                    "between_drives": it.scale * of.spread.between_drives[i] ** 0.5 if vehicle is None else None,
                }  # fmt: skip


def _words(types, changed, counts, errors, findings: Sequence[Finding], labels, folder: Path) -> str:
    lines = []
    for of in types:
        for one in of.common:
            lines.append(f"all vehicles of {of.type}: {page.shared(of, one)}")
    for state in changed[:20]:
        of = next(one for one in types if one.type == state.type)
        for one in page.said_changes(state):
            unit = of.unit(one.effect)
            lines.append(
                f"{state.vehicle}: {page.words(one, unit, labels[state.vehicle])}, probability {one.probability:.2f}"
            )
    if len(changed) > 20:
        lines.append(f"... and {len(changed) - 20} more")
    if errors:
        vehicle, place, error = errors[0]
        lines.append(
            f"{len(errors)} drives were not diagnosed, such as drive {place + 1} of {vehicle}: {error} "
            "(all: column error of verdicts.parquet)"
        )
    lines += finding_lines(findings)
    lines.append(
        f"{len(changed)} of {counts['vehicles']} vehicles changed ({counts['drives']} drives); {folder / 'index.html'}"
    )
    return "\n".join(lines)
