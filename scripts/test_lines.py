"""Says a test program's results by files of tests: one line when a file is through, all of what failed at the end.

Reads what `cargo test` (`--rust`, with the list that `cargo test -- --list` gives) or `pytest -v` prints,
and keeps all of it in a log file. Seconds are those that passed since the same processor's file before.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections import Counter
from pathlib import Path

RUST = re.compile(r"^test (?P<test>.+?)(?: - should panic)? \.\.\. (?P<outcome>ok|FAILED|ignored)")
PYTHON = re.compile(r"^\[(?P<worker>gw\d+)\] \[ *\d+%\] (?P<outcome>[A-Z]+) (?P<test>\S+?)::")
LISTED = re.compile(r"^(?P<test>.+): test$")
PROGRAM = re.compile(r"^\s+(?:Running (?:unittests )?|Doc-tests )(?P<source>\S+)(?: \(.*/(?P<crate>\w+)-[0-9a-f]+\))?")
# Where the runners begin to say what failed.
REPORTS = re.compile(r"^(failures:|=+ (FAILURES|ERRORS) =+|error(\[|:))")


class Files:
    """Files of tests under way."""

    def __init__(self, expected: Counter[str] | None):
        self.expected = expected
        self.outcomes: dict[str, Counter[str]] = {}
        self.worker: dict[str, tuple[str, float]] = {}
        self.start = time.monotonic()
        self.since: dict[str, float] = {}

    def result(self, file: str, outcome: str, worker: str = "") -> None:
        self.since.setdefault(worker, self.start)
        before = self.worker.get(worker)
        # pytest does not say how many tests a file has: it is through when its processor begins another.
        if self.expected is None and before and before[0] != file:
            self.through(before[0], before[1] - self.since[worker])
            self.since[worker] = before[1]
        now = time.monotonic()
        self.worker[worker] = (file, now)
        counts = self.outcomes.setdefault(file, Counter())
        counts[outcome] += 1
        if self.expected is not None and counts.total() == self.expected[file]:
            self.through(file, now - self.since[worker])
            self.since[worker] = now

    def through(self, file: str, seconds: float) -> None:
        counts = self.outcomes.pop(file, None)
        if counts:
            words = ", ".join(f"{count} {outcome}" for outcome, count in sorted(counts.items()))
            print(f"  {file:<44} {words:<26} {seconds:6.1f} s", flush=True)

    def end(self) -> None:
        for worker, (file, last) in self.worker.items():
            self.through(file, last - self.since[worker])
        for file in list(self.outcomes):
            self.through(file, time.monotonic() - self.start)


def rust_file(program: str, test: str) -> str:
    """The behaviours are one program, a module for each file; another program is a file itself."""
    return f"tests/{test.split('::')[0]}.rs" if program == "tests/main.rs" else program


def program(match: re.Match[str]) -> str:
    source, crate = match["source"], match["crate"]
    return source if source.startswith("tests/main") else f"{source} ({crate})" if crate else f"examples of {source}"


def expected(listing: Path) -> Counter[str]:
    """How many tests each file has."""
    count, running = Counter(), ""
    for line in listing.read_text(encoding="utf-8", errors="replace").splitlines():
        if match := PROGRAM.match(line):
            running = program(match)
        elif match := LISTED.match(line):
            count[rust_file(running, match["test"])] += 1
    return count


WORDS = {"ok": "passed", "FAILED": "FAILED", "PASSED": "passed", "SKIPPED": "skipped", "XFAIL": "expected to fail"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rust", type=Path, help="what `cargo test -- --list` printed")
    parser.add_argument("log", type=Path, help="keeps all output")
    arguments = parser.parse_args()
    files = Files(expected(arguments.rust) if arguments.rust else None)
    running, reports = "", False
    with arguments.log.open("w", encoding="utf-8") as log:
        for line in sys.stdin:
            log.write(line)
            if match := PROGRAM.match(line):
                running, reports = program(match), False
            elif match := RUST.match(line) if arguments.rust else PYTHON.match(line):
                outcome = WORDS.get(match["outcome"], match["outcome"])
                if arguments.rust:
                    files.result(rust_file(running, match["test"]), outcome)
                else:
                    files.result(match["test"], outcome, match["worker"])
            elif REPORTS.match(line):
                reports = True
            # Skipped tests say why.
            if reports or line.startswith("SKIPPED ["):
                print(line, end="", flush=True)
    files.end()


if __name__ == "__main__":
    main()
