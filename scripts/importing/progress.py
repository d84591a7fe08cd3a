"""Progress of what takes longer than people wait without a word; nothing for what is quick."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

Item = TypeVar("Item")


class Progress:
    """A bar on a terminal; elsewhere a line for each tenth, but not more often than every two seconds."""

    LEAST = 2.0  # s
    quiet = False  # for all; `--quiet` sets it

    def __init__(self, title: str) -> None:
        self.title = title
        self.live = sys.stderr.isatty()
        self.tenths, self.begin = 0, time.monotonic()
        self.time = self.begin
        self.shown = False

    def __call__(self, share: float) -> None:
        now = time.monotonic()
        if self.quiet or now - self.begin < self.LEAST:
            return
        share = min(1.0, max(0.0, share))
        if self.live:
            if now - self.time > 0.1:
                bar = f"[{'#' * round(30 * share):<30}] {100 * share:3.0f} %"
                print(f"\r{self.title} {bar}", end="", file=sys.stderr, flush=True)
                self.time, self.shown = now, True
        elif (10 * share >= self.tenths + 1 or not self.shown) and now - self.time >= self.LEAST:
            self.tenths, self.time, self.shown = int(10 * share), now, True
            print(f"{self.title}: {100 * share:.0f} %", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Clears the bar."""
        if self.live and self.shown:
            print("\r" + " " * (len(self.title) + 40) + "\r", end="", file=sys.stderr, flush=True)


def followed(items: Iterable[Item], count: int, title: str) -> Iterator[Item]:
    """Items with progress."""
    progress = Progress(title)
    try:
        for done, item in enumerate(items):
            progress(done / max(count, 1))
            yield item
    finally:
        progress.close()


def word(text: str) -> None:
    """A line before what tells no progress itself."""
    if not Progress.quiet:
        print(text, file=sys.stderr, flush=True)
