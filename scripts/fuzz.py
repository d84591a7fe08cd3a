#!/usr/bin/env python3
"""Damaged files of every format by the million: runs the tests' fuzz targets, writes docs/results/fuzzing.{md,json}.

    scripts/fuzz.py                       a million inputs of each format, in a release build
    scripts/fuzz.py --inputs 20000 --only log --only state

The targets are tests (`tests/fuzz.rs`, `tests/fmi_hostile_states.rs`); a panic, or an input that takes over 1 s or
200 MB, ends one. What is done is kept after each piece: the same command goes on where it was stopped. `--fresh` begins
anew, as is needed when the code has changed.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "docs" / "results"
# Format, the tests' name, and what is damaged.
TARGETS = {
    "table": ("fuzz::tables_of_any_kind", "tables in text, as roads and logs are"),
    "path": ("fuzz::roads_of_any_kind", "roads, in metres and in degrees"),
    "log": ("fuzz::logs_of_any_kind", "drive logs, with the check of a log"),
    "tyre": ("fuzz::tyres_of_any_kind", "tyre files (.tir)"),
    "vehicle": ("fuzz::vehicles_of_any_kind", "vehicle files (TOML) with their tyres"),
    "model": ("fuzz::models_of_any_kind", "learned models, as they come and with a right checksum"),
    "process": ("fuzz::processes_of_any_kind", "Gaussian processes, the same way"),
    "state, car's controller": (
        "fmi_hostile_states::of_the_car_s_controller",
        "a saved state of the FMU, then 30 steps",
    ),
    "state, truck's controller": ("fmi_hostile_states::of_the_truck_s_controller", "the same"),
    "state, car": ("fmi_hostile_states::of_a_car_with_delays", "the same"),
    "state, truck": ("fmi_hostile_states::of_a_truck", "the same"),
}
SAID = re.compile(r"(\d+) inputs, (\d+) taken, longest ([\d.]+) ms(?:, most memory (\d+) kB)?")
ABOUT = """\
# Damaged and hostile files

Written by `scripts/fuzz.py`; the same numbers in [fuzzing.json](fuzzing.json). Good files of each format are damaged at
one to five places. Bits, bytes and fields change (no number, 1e308, another unit's, quotes, brackets). Pieces are left
out, repeated, exchanged or cut off. Numbers become NaN or infinite. Each is read as the program or the FMU reads it. A
panic, more than 1 s or more than 200 MB for one input ends the run; none did. Each run of the tests tries some hundred.

| format | inputs | taken | longest | most memory of an input | of the whole process | processor time |
|---|---|---|---|---|---|---|"""
KILLS = """\

## Killed commands

By `scripts/kills.py`: each command that writes runs once to its end and is then killed (SIGKILL) at random moments of
that time, again and again in one folder. After each kill all files there but drafts are read: whole rows, ends,
checksums. None was taken for good and was not.

| command | kills | before its end | files read |
|---|---|---|---|"""


def program(given: Path | None) -> Path:
    """The tests as a program."""
    if given is not None:
        return given
    command = ["cargo", "test", "--release", "--test", "behaviours", "--no-run", "--message-format", "json"]
    built = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    messages = [json.loads(line) for line in built.splitlines()]
    return Path(next(m["executable"] for m in messages if m.get("executable") and m["target"]["name"] == "behaviours"))


def piece(tests: Path, name: str, seed: int, count: int) -> dict:
    """Tries some inputs of a format."""
    environment = {**os.environ, "RFL_FUZZ": str(count), "RFL_FUZZ_SEED": str(seed)}
    command = [tests, "--exact", name, "--nocapture", "--test-threads", "1"]
    with subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True) as run:
        text = run.stdout.read()
        _, status, used = os.wait4(run.pid, 0)
        run.returncode = os.waitstatus_to_exitcode(status)
    if run.returncode or not (said := SAID.search(text)):
        raise SystemExit(f"{name}, seeds from {seed} on: {text}")
    inputs, taken, longest, memory = said.groups()
    return {
        "inputs": int(inputs),
        "taken": int(taken),
        "longest_ms": float(longest),
        "most_memory_kb": int(memory) if memory else None,
        "process_kb": used.ru_maxrss,
        "cpu_s": used.ru_utime + used.ru_stime,
    }


def joined(one: dict | None, other: dict) -> dict:
    if one is None:
        return other
    add, most = ("inputs", "taken", "cpu_s"), ("longest_ms", "most_memory_kb", "process_kb")
    sums = {name: one[name] + other[name] for name in add}
    return sums | {name: None if other[name] is None else max(one[name], other[name]) for name in most}


def write(found: dict) -> None:
    rows = []
    for name, (_, words) in TARGETS.items():
        if name in found:
            of = found[name]
            memory = "" if of["most_memory_kb"] is None else f"{of['most_memory_kb'] / 1000:.1f} MB"
            rows.append(
                f"| {name}: {words} | {of['inputs']:,} | {of['taken']:,} | {of['longest_ms']:.0f} ms | {memory} | "
                f"{of['process_kb'] / 1000:.0f} MB | {of['cpu_s']:.0f} s |"
            )
    killed = found.get("kills", {})
    if killed:
        rows.append(KILLS)
    rows += [f"| `{name}` | {of['kills']} | {of['stopped']} | {of['files']:,} |" for name, of in killed.items()]
    (RESULTS / "fuzzing.md").write_text("\n".join([ABOUT, *rows]) + "\n", encoding="utf-8")
    (RESULTS / "fuzzing.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=1_000_000, help="inputs of each format")
    parser.add_argument("--piece", type=int, default=20_000, help="inputs between two writings of the results")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="pieces at a time, on idle processors")
    parser.add_argument("--only", action="append", metavar="FORMAT", help="only this format (may be repeated)")
    parser.add_argument("--program", type=Path, help="the tests, if they are built already")
    parser.add_argument("--fresh", action="store_true", help="forget what was done before")
    options = parser.parse_args()
    file = RESULTS / "fuzzing.json"
    found = json.loads(file.read_text(encoding="utf-8")) if file.is_file() and not options.fresh else {}
    tests = program(options.program)
    for name, (test, _) in TARGETS.items():
        if options.only and name not in options.only and name.split(",")[0] not in options.only:
            continue
        while (done := found.get(name, {}).get("inputs", 0)) < options.inputs:
            starts = range(done, min(done + options.jobs * options.piece, options.inputs), options.piece)
            counts = [min(options.piece, options.inputs - start) for start in starts]
            with ThreadPoolExecutor(options.jobs) as pool:
                for said in pool.map(partial(piece, tests, test), [start + 1 for start in starts], counts):
                    found[name] = joined(found.get(name), said)
            write(found)
            print(f"{name}: {found[name]['inputs']} of {options.inputs}", flush=True)


if __name__ == "__main__":
    main()
