"""Names the program behind recorded numbers: its version and the commit of the checkout."""

from __future__ import annotations

import subprocess
from pathlib import Path


def provenance(program: Path, checkout: Path) -> dict:
    """The program's own version, and the commit of the checkout; `dirty` if it has changes. Without git no commit."""

    def answer(*command: str | Path) -> str | None:
        try:
            done = subprocess.run(command, cwd=checkout, capture_output=True, text=True, timeout=60, check=False)
        except (OSError, subprocess.TimeoutExpired):
            return None
        return done.stdout.strip() if done.returncode == 0 else None

    found = {}
    if version := answer(program, "--version"):
        found["version"] = version
    if commit := answer("git", "rev-parse", "--short", "HEAD"):
        found["commit"] = commit
        found["dirty"] = bool(answer("git", "status", "--porcelain", "--untracked-files=no"))
    return found


def program_text(found: dict) -> str:
    """The same in words, as far as it is known.

    `recorded_in` is the commit that brought the numbers, of runs that did not note the one they were built from.
    """
    parts = [found["version"]] if "version" in found else []
    if "commit" in found:
        parts.append(f"commit {found['commit']}" + (", with changes" if found.get("dirty") else ""))
    if "recorded_in" in found:
        parts.append(f"recorded in commit {found['recorded_in']}")
    return f"Program: {', '.join(parts)}." if parts else ""
