"""Findings in logs by their kinds: a fleet has thousands of logs, and few kinds of faults."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
SAID = 5
"""Kinds that are said; all are on the page."""


@dataclass(frozen=True)
class Finding:
    """A fault of logs, or what was mended in them, and the drives with it."""

    text: str
    """As the first of the drives has it."""
    drives: list[tuple[str, int]]
    """Vehicle, and place among its drives."""


def by_kind(told: Iterable[tuple[str, int, Sequence[str]]]) -> list[Finding]:
    """Kinds of the findings of drives, the commonest first: texts of one kind differ in their numbers alone."""
    kinds: dict[str, Finding] = {}
    for vehicle, place, texts in told:
        for text in texts:
            own = kinds.setdefault(NUMBER.sub("0", text), Finding(text, []))
            if own.drives[-1:] != [(vehicle, place)]:
                own.drives.append((vehicle, place))
    return sorted(kinds.values(), key=lambda one: -len(one.drives))


def lines(findings: Sequence[Finding]) -> list[str]:
    """The commonest kinds in words."""
    said = []
    for one in findings[:SAID]:
        vehicle, place = one.drives[0]
        count = f"{len(one.drives)} drive{'s' if len(one.drives) > 1 else ''}"
        said.append(f"found in {count}, such as drive {place + 1} of {vehicle}: {one.text}")
    if len(findings) > SAID:
        said.append(f"{len(findings) - SAID} more kinds of findings (all: column findings of verdicts.parquet)")
    return said
