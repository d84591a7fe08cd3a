"""A process that diagnoses: one job a line on standard input, one answer a line on standard output.

It is a process of its own, so that a log that hangs or brings it down takes nothing else along: who waits kills it.
"""

from __future__ import annotations

import json
import sys
import warnings
from typing import Any

from rfl_mpc._call import reason
from rfl_mpc.fleet.store import file_hash


def answer(job: dict[str, Any]) -> dict[str, Any]:
    """The answer to a job: what a row of the verdicts is made from. Bad input is an ``error`` in words."""
    import os

    import rfl_mpc

    hashes: dict[str, tuple[int, int, str]] = {}
    found: dict[str, Any] = {"hashes": hashes, "error": None}
    try:
        for name in ("log", "reference"):
            if job.get(name):
                stat = os.stat(job[name])
                hashes[job[name]] = (stat.st_size, stat.st_mtime_ns, file_hash(job[name]))
        with warnings.catch_warnings(record=True):
            warnings.simplefilter("always")
            report = rfl_mpc.diagnose(
                _log(job["log"]),
                job.get("vehicle_file"),
                reference=_log(job["reference"]) if job.get("reference") else None,
                threads=1,
                **job["options"],
            ).report
    except rfl_mpc.InternalError as error:
        return found | {"error": f"an error in rfl itself: {error}"}
    except OSError as error:
        return found | {
            "error": f"{error.filename}: cannot be read ({reason(error)}); check the name and the permission"
        }
    except rfl_mpc.RflError as error:
        return found | {"error": str(error)}
    return found | row_of(report)


def _log(path: str) -> Any:
    """A log as `diagnose` takes it; of Parquet its columns."""
    if not path.endswith(".parquet"):
        return path
    import pandas as pd

    import rfl_mpc

    try:
        return pd.read_parquet(path)
    except (ValueError, OSError) as error:
        raise rfl_mpc.RflError(f"{path}: {reason(error)}; write it anew") from None


def row_of(report: dict[str, Any]) -> dict[str, Any]:
    """What of a report a row keeps."""
    verdict, posterior = report["verdict"], report.get("posterior") or {}
    gaps = {
        signal: [of["before"], of["recalibrated"]]
        for signal, of in (report["gap_reduction"].get("open_loop") or {}).items()
        if isinstance(of, dict)
    }
    return {
        "model": report["inputs"]["vehicle"],
        "kind": verdict["kind"],
        "probability": verdict["probability"],
        "words": verdict["summary"],
        "effects": [
            {key: effect.get(key) for key in ("id", "value", "low", "high", "unit")} for effect in verdict["effects"]
        ],
        "none": posterior.get("none"),
        "not_in_library": posterior.get("not_in_library"),
        "inclusion": posterior.get("inclusion") or {},
        "gaps": gaps,
        "duration": report["inputs"]["duration"],
        "findings": [finding["summary"] for finding in report["findings"] if finding["gravity"] != "note"],
        "information": _rounded(report.get("information")),
    }


def _rounded(information: dict[str, Any] | None) -> dict[str, Any] | None:
    """Numbers of a summary with nine digits: more than they mean, half the size."""
    if information is None:
        return None
    short = {key: [float(f"{value:.9g}") for value in information[key]] for key in ("precision", "gradient")}
    return information | short


def main() -> None:
    # What a library prints must not come between the answers.
    out, sys.stdout = sys.stdout, sys.stderr
    for line in sys.stdin:
        out.write(json.dumps(answer(json.loads(line)), separators=(",", ":")) + "\n")
        out.flush()


if __name__ == "__main__":
    main()
