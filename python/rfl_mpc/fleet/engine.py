"""The drives' diagnoses on Dask: what is not done yet, some at a time, each answer kept the moment that it comes.

Dask schedules, repeats what a dead worker left, and takes workers that join or leave. Ours is only that no more is
handed over than keeps the workers busy, so that memory does not grow with the number of drives.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import rfl_mpc
from rfl_mpc import _native
from rfl_mpc._call import reason
from rfl_mpc._native import RflError
from rfl_mpc.fleet.manifest import Drive
from rfl_mpc.fleet.store import Store, file_hash, key_of, vehicle_hash
from rfl_mpc.fleet.work import diagnosed

if TYPE_CHECKING:
    from distributed import Client

FILES = {"<log>": "log", "<reference>": "reference", "<vehicle>": "vehicle_file"}
"""Names that stand for a drive's files in answers that are kept: another drive may have files of the same content."""
TEXTS = ("error", "words", "findings")
"""What of an answer may name files."""
AHEAD = 3
"""Drives that are handed over for each that runs: enough that none waits for the client."""


@dataclass
class Plan:
    """Drives, the keys of those that are done, and what is to be done."""

    drives: list[Drive]
    keys: list[str | None]
    """Key of each drive's answer; None: its log was not read yet."""
    waiting: list[int]


class Hashes:
    """Hashes of files that many drives share, taken once."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self.vehicles: dict[str | None, str] = {}
        # Two builds of one version may answer otherwise.
        self.version = f"{rfl_mpc.__version__} {file_hash(_native.__file__)}"

    def key(self, drive: Drive, options: Mapping[str, Any]) -> str | None:
        """Key of a drive's answer; None where a file of it was not read yet."""
        log = self.store.hash_of(drive.log)
        reference = None if drive.reference is None else self.store.hash_of(drive.reference)
        if log is None or (reference is None and drive.reference is not None):
            return None
        return self.of(drive, log, reference, options)

    def of(self, drive: Drive, log: str, reference: str | None, options: Mapping[str, Any]) -> str:
        if drive.vehicle_file not in self.vehicles:
            self.vehicles[drive.vehicle_file] = vehicle_hash(drive.vehicle_file)
        return key_of(log, self.vehicles[drive.vehicle_file], reference, options, self.version)


def plan(drives: Sequence[Drive], store: Store, options: Mapping[str, Any]) -> Plan:
    """What is done and what is not."""
    hashes = Hashes(store)
    keys = [hashes.key(drive, options) for drive in drives]
    known = [key if key is not None and store.has(key) else None for key in keys]
    return Plan(list(drives), known, [row for row, key in enumerate(known) if key is None])


@contextmanager
def cluster(address: str | None, workers: int | None = None) -> Iterator[Client]:
    """A client: of the scheduler at an address, or of workers of this machine."""
    import dask
    from distributed import Client, LocalCluster

    if address and address != "local":
        try:
            client = Client(address, timeout=20)
        except (OSError, ValueError, TimeoutError) as error:
            raise RflError(
                f"--dask {address}: no scheduler answers ({reason(error)}); start one with 'dask scheduler'"
            ) from None
        with client:
            yield client
        return
    # Threads do, for each has a child process that diagnoses: a script needs no guard against being run twice.
    options = {"processes": False, "n_workers": 1, "threads_per_worker": workers or os.cpu_count() or 1}
    with (
        TemporaryDirectory(prefix="rfl_fleet_") as scratch,
        dask.config.set({"temporary-directory": scratch}),
        LocalCluster(**options, dashboard_address="127.0.0.1:0", silence_logs=50) as local,
        Client(local) as client,
    ):
        local.loop.asyncio_loop.set_exception_handler(_unless_abandoned)  # type: ignore[attr-defined]
        yield client


def _unless_abandoned(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """A wait with a limit that nobody awaits any more, for the cluster closes, is no error of a user's."""
    if not isinstance(context.get("exception"), TimeoutError):
        loop.default_exception_handler(context)


def job_of(drive: Drive, options: Mapping[str, Any]) -> dict[str, Any]:
    """A drive as a worker gets it."""
    files = {"log": drive.log, "vehicle_file": drive.vehicle_file, "reference": drive.reference}
    return files | {"options": dict(options)}


def _replaced(answer: dict[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    """An answer with other names in its texts; a name that holds another one comes first."""

    def text(value: Any) -> Any:
        if isinstance(value, list):
            return [text(one) for one in value]
        if isinstance(value, str):
            for name in sorted(names, key=len, reverse=True):
                value = value.replace(name, names[name])
        return value

    return answer | {key: text(answer[key]) for key in TEXTS if key in answer}


def kept(answer: dict[str, Any], drive: Drive) -> dict[str, Any]:
    """A drive's answer as it is kept, for all drives with the same files by their content."""
    files = {name: getattr(drive, of) for name, of in FILES.items()}
    return _replaced(answer, {file: name for name, file in files.items() if file and os.path.isabs(file)})


def told(answer: dict[str, Any], drive: Drive) -> dict[str, Any]:
    """What is kept as the answer of a drive, with its own files."""
    files = {name: getattr(drive, of) for name, of in FILES.items()}
    return _replaced(answer, {name: file for name, file in files.items() if file})


def run(
    plan: Plan,
    store: Store,
    client: Client,
    options: Mapping[str, Any],
    limit: float,
    done: Callable[[Drive, dict[str, Any]], None] = lambda drive, answer: None,
) -> None:
    """Diagnoses what waits; answers go to the store. A drive that brings workers down is a row with its error."""
    from distributed import KilledWorker, as_completed
    from distributed.comm.core import CommClosedError

    hashes = Hashes(store)
    waiting = iter(plan.waiting)
    rows: dict[str, int] = {}
    running = as_completed(with_results=True, raise_errors=False)

    def hand_over() -> bool:
        row = next(waiting, None)
        if row is None:
            return False
        drive = plan.drives[row]
        future = client.submit(diagnosed, job_of(drive, options), limit, key=f"drive-{row}", pure=False)
        rows[future.key] = row
        running.add(future)
        return True

    def wanted() -> int:
        return max(2, AHEAD * sum(client.nthreads().values()))

    try:
        most = wanted()
        while len(rows) < most and hand_over():
            pass
        for future, result in running:
            row = rows.pop(future.key)
            drive = plan.drives[row]
            if future.status == "error":
                error = result[1] if isinstance(result, tuple) else future.exception()
                if not isinstance(error, KilledWorker):
                    raise RflError(f"{drive.log}: the worker failed: {type(error).__name__}: {error}")
                answer = {"error": "its diagnosis ended several workers"}
            elif future.status == "cancelled":
                raise RflError("the scheduler is gone; what was done is kept: run again")
            else:
                answer = dict(result)
            read = answer.pop("hashes", {})
            of = {path: hash for path, (_, _, hash) in read.items()}
            log, reference = of.get(drive.log), of.get(drive.reference or "")
            # Files that cannot be read have no content to know them by: they are tried again by the next run.
            key = hashes.of(drive, log or f"unread {drive.log}", reference, options)
            store.put(key, kept(answer, drive), [(path, size, time, hash) for path, (size, time, hash) in read.items()])
            plan.keys[row] = key
            done(drive, answer)
            future.release()
            most = wanted() if row % 16 == 0 else most
            while len(rows) < most and hand_over():
                pass
    except CommClosedError as error:
        raise RflError(f"the scheduler is gone ({error}); what was done is kept: run again") from None
