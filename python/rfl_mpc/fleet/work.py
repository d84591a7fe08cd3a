"""A drive's diagnosis in a Dask worker: a child process that is kept, and killed where it takes too long."""

from __future__ import annotations

import atexit
import json
import os
import queue
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import rfl_mpc
from rfl_mpc.fleet.store import file_hash

AGAIN = 2
"""Times that a drive is tried again whose child was killed: another's need of memory is not the log's fault."""

_own = threading.local()


def environment() -> dict[str, str]:
    """Environment in which a child has the package that this process has, wherever its path came from."""
    path = os.pathsep.join([str(Path(rfl_mpc.__file__).parent.parent), os.environ.get("PYTHONPATH", "")])
    return os.environ | {"PYTHONPATH": path.rstrip(os.pathsep)}


class _Child:
    def __init__(self) -> None:
        command = [sys.executable, "-m", "rfl_mpc.fleet.child"]
        self.process = subprocess.Popen(
            command,
            env=environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self.lines: queue.Queue[bytes] = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()
        atexit.register(self.kill)

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.put(line)
        self.lines.put(b"")

    def ask(self, job: dict[str, Any], limit: float) -> dict[str, Any]:
        """The answer; an ``error`` where none came in time, or the child died over it."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(json.dumps(job).encode() + b"\n")
            self.process.stdin.flush()
            line = self.lines.get(timeout=limit)
        except queue.Empty:
            return {"error": f"no answer within {limit:g} s (--time-limit)", "late": True}
        except OSError:
            line = b""
        if not line:
            self.process.wait()
            return {"error": f"the diagnosis ended with status {self.process.returncode}", "dead": True}
        return json.loads(line)

    def kill(self) -> None:
        atexit.unregister(self.kill)
        self.process.kill()
        self.process.wait()


def _stat(path: str) -> tuple[int, int]:
    found = os.stat(path)
    return found.st_size, found.st_mtime_ns


def diagnosed(job: dict[str, Any], limit: float) -> dict[str, Any]:
    """The answer to a job; see :func:`rfl_mpc.fleet.child.answer`."""
    for _ in range(1 + AGAIN):
        child = getattr(_own, "child", None)
        if child is None or child.process.poll() is not None:
            child = _own.child = _Child()
        found = child.ask(job, limit)
        late, dead = found.pop("late", False), found.pop("dead", False)
        if late or dead:
            child.kill()
            _own.child = None
        if not dead:
            break
    if late or dead:
        # What hangs is known by its content, too, so that the next run does not hang on it again.
        files = [path for path in (job["log"], job.get("reference")) if path and os.path.isfile(path)]
        found["hashes"] = {path: (*_stat(path), file_hash(path)) for path in files}
    return found
