"""Runs `rfl diagnose` on the cases of a set; it sees nothing but the files of one case."""

from __future__ import annotations

import json
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ANSWERS = (0, 3, 4, 5)  # exit codes that come with a report
LONGEST = 900.0  # s


def diagnose(rfl: Path, folder: Path, name: str, threads: int, more: tuple[str, ...] = ()) -> dict:
    """The report of a case with its time in s under `seconds`; `error` in place of a report where there is none.

    `name` is the folder of the answer within the case; `more` goes on to the program.
    """
    out = folder / name
    command = [str(rfl.resolve()), "diagnose", "log.csv.gz", "--vehicle", "vehicle.toml", "--out", name, "--quiet"]
    command += ["--threads", str(threads), *more]
    if (folder / "reference.csv.gz").exists():
        command += ["--reference", "reference.csv.gz"]
    begin = time.perf_counter()
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return {"error": f"no answer within {LONGEST:.0f} s", "seconds": LONGEST}
    seconds = time.perf_counter() - begin
    report = out / "report.json"
    if done.returncode not in ANSWERS or not report.exists():
        return {"error": done.stderr.strip()[-500:] or f"exit status {done.returncode}", "seconds": seconds}
    found = json.loads(report.read_text(encoding="utf-8"))
    found["seconds"] = seconds
    return found


def diagnose_all(
    rfl: Path, folders: list[Path], jobs: int, name: str = "answer", more=lambda folder: (), say=lambda text: None
) -> list[dict]:
    """Reports of all cases, in their order; each run has one thread when several run at a time."""
    threads = 0 if jobs == 1 else 1
    reports = []
    with ThreadPoolExecutor(jobs) as pool:
        runs = pool.map(lambda folder: diagnose(rfl, folder, name, threads, more(folder)), folders)
        for done, report in enumerate(runs, 1):
            reports.append(report)
            verdict = report.get("verdict", {}).get("kind", report.get("error", "?"))
            named = "+".join(effect["id"] for effect in report.get("verdict", {}).get("effects", []))
            say(f"{done} of {len(folders)}: {folders[done - 1].name} {verdict} {named} {report['seconds']:.1f} s")
    return reports
