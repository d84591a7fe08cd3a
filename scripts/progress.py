"""Progress of what takes longer than people wait without a word, on standard error."""

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

    def __init__(self, title: str, quiet: bool = False) -> None:
        self.title, self.quiet = title, quiet or self.quiet
        self.live = sys.stderr.isatty() and not self.quiet
        self.tenths, self.time = 0, time.monotonic()
        self.width = 0  # of what is drawn

    def __call__(self, share: float, more: str = "") -> None:
        """Shows a share that is done; on a terminal with more words."""
        share = min(1.0, max(0.0, share))
        if self.live:
            text = f"{self.title:<18} [{'#' * round(30 * share):<30}] {100 * share:3.0f} %{more}"
            self.width = max(self.width, len(text))
            print(f"\r{text}", end="", file=sys.stderr, flush=True)
        elif not self.quiet and 10 * share >= self.tenths + 1 and time.monotonic() - self.time >= self.LEAST:
            self.tenths, self.time = int(10 * share), time.monotonic()
            print(f"{self.title}: {10 * self.tenths} %", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Clears the bar."""
        if self.width:
            print("\r" + " " * self.width + "\r", end="", file=sys.stderr, flush=True)


class Unhurried(Progress):
    """The same of what is mostly quick: nothing for two seconds, then a bar that is not drawn at each of many steps."""

    REDRAWN = 0.1  # s

    def __init__(self, title: str) -> None:
        super().__init__(title)
        self.due = self.time + self.LEAST
        self.tenths = -1  # the first line comes with any share

    def __call__(self, share: float, more: str = "") -> None:
        if (now := time.monotonic()) < self.due:
            return
        self.due = now + (self.REDRAWN if self.live else self.LEAST)
        super().__call__(share, more)


def followed(items: Iterable[Item], count: int, title: str) -> Iterator[Item]:
    """Items with progress."""
    progress = Unhurried(title)
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
