"""Runs `rfl diagnose` on the cases of a set; it sees nothing but the files of one case."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from .vehicles import ROOT

# Thresholds and probabilities of the program.
CALIBRATION = ROOT / "src" / "diagnose" / "calibration.toml"
ANSWERS = (0, 3, 4, 5)  # exit codes that come with a report
LONGEST = 900.0  # s


def diagnose(
    rfl: Path, folder: Path, name: str, threads: int, more: tuple[str, ...] = (), log: str = "log.csv.gz"
) -> dict:
    """The report of a case with its times in s, `seconds` and `cpu_seconds`; `error` where there is no report.

    `name` is the folder of the answer within the case; `more` goes on to the program.
    """
    out = folder / name
    command = [str(rfl.resolve()), "diagnose", log, "--vehicle", "vehicle.toml", "--out", name, "--quiet"]
    command += ["--threads", str(threads), *more]
    if (folder / "reference.csv.gz").exists():
        command += ["--reference", "reference.csv.gz"]
    out.mkdir(parents=True, exist_ok=True)
    report = out / "report.json"
    report.unlink(missing_ok=True)
    begin = time.perf_counter()
    with open(out / "said.txt", "wb") as said:
        running = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=said)
        stop = threading.Timer(LONGEST, os.kill, (running.pid, signal.SIGKILL))
        stop.start()
        # Not running.wait(): this also tells the processor time of this one program.
        _, status, used = os.wait4(running.pid, 0)
        stop.cancel()
        running.returncode = os.waitstatus_to_exitcode(status)
    times = {"seconds": time.perf_counter() - begin, "cpu_seconds": used.ru_utime + used.ru_stime}
    if running.returncode not in ANSWERS or not report.exists():
        words = (out / "said.txt").read_text(encoding="utf-8", errors="replace").strip()[-500:]
        if times["seconds"] >= LONGEST:
            words = f"no answer within {LONGEST:.0f} s"
        return {"error": words or f"exit status {running.returncode}"} | times
    return json.loads(report.read_text(encoding="utf-8")) | times


def diagnose_all(
    rfl: Path,
    folders: list[Path],
    jobs: int,
    name: str = "answer",
    more=lambda folder: (),
    say=lambda text: None,
    log: str = "log.csv.gz",
) -> list[dict]:
    """Reports of all cases, in their order; each run has one thread when several run at a time."""
    threads = 0 if jobs == 1 else 1
    reports = []
    with ThreadPoolExecutor(jobs) as pool:
        runs = pool.map(lambda folder: diagnose(rfl, folder, name, threads, more(folder), log), folders)
        for done, report in enumerate(runs, 1):
            reports.append(report)
            verdict = report.get("verdict", {}).get("kind", report.get("error", "?"))
            named = "+".join(effect["id"] for effect in report.get("verdict", {}).get("effects", []))
            say(f"{done} of {len(folders)}: {folders[done - 1].name} {verdict} {named} {report['seconds']:.1f} s")
    return reports
