#!/usr/bin/env python3
"""The documentation site: stages README and docs, builds them with MkDocs, and fails at a broken link.

MkDocs wants all pages below one folder, while ours link to each other across the project. So pages and pictures are
staged with their places in the project; README becomes the index. A link to a file that is no page (a script, a
folder) keeps its text and loses its target: the site has no sources.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SITE = ROOT / "out" / "site"
PAGES = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "blind/README.md", "examples/ci/README.md"]
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
PICTURES = {".png", ".svg"}
# Names of files and commands stay in one piece; what is wider scrolls.
STYLE = ".md-typeset td:first-child code { white-space: nowrap; }\n"


def pages() -> list[Path]:
    """All pages, relative to the project."""
    docs = sorted(path.relative_to(ROOT) for path in (ROOT / "docs").rglob("*.md"))
    return [Path(page) for page in PAGES] + docs


def staged(page: Path) -> Path:
    """The place of a page on the site."""
    return Path("index.md") if page == Path("README.md") else page


def relative(target: Path, page: Path) -> str:
    """A link from a staged page to another staged file."""
    up = "../" * len(page.parent.parts)
    return up + target.as_posix()


def stage(folder: Path) -> list[str]:
    """Copies all pages with their links rewritten; gives what a page links to and the project does not have."""
    shutil.rmtree(folder, ignore_errors=True)
    known, missing = set(pages()), []
    for page in pages():
        place = staged(page)

        def rewrite(match: re.Match, page=page, place=place) -> str:
            picture, text, link = match.groups()
            name, _, anchor = link.partition("#")
            if re.match(r"[a-z]+:", link) or not name:
                return match.group()
            target = (ROOT / page.parent / name).resolve()
            if not target.is_relative_to(ROOT) or not target.exists():
                missing.append(f"{page}: {link}")
                return match.group()
            target = target.relative_to(ROOT)
            target = target / "README.md" if target / "README.md" in known else target
            if target in known:
                return f"[{text}]({relative(staged(target), place)}{'#' + anchor if anchor else ''})"
            if target.suffix in PICTURES:
                copy = folder / target
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(ROOT / target, copy)
                return f"{picture}[{text}]({relative(target, place)})"
            return text

        out = folder / place
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(LINK.sub(rewrite, (ROOT / page).read_text(encoding="utf-8")), encoding="utf-8")
    (folder / "site.css").write_text(STYLE, encoding="utf-8")
    return missing


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--serve", action="store_true", help="show the site at http://127.0.0.1:8000")
    parser.add_argument("--links", action="store_true", help="only check that links lead to files of the project")
    parser.add_argument("--out", type=Path, default=SITE, help="stage the pages below this folder (with --links)")
    given = parser.parse_args()
    if given.out != SITE and not given.links:
        parser.error("--out is for --links: mkdocs.yml says where the site lies")
    missing = stage(given.out / "pages")
    for link in missing:
        print(f"site: {link} leads nowhere", file=sys.stderr)
    if missing or given.links:
        return int(bool(missing))
    command = [sys.executable, "-m", "mkdocs", "serve" if given.serve else "build", "--strict", "--quiet"]
    done = subprocess.run(command, cwd=ROOT, check=False).returncode
    if not done and not given.serve:
        print(
            f"site: {(SITE / 'html' / 'index.html').relative_to(ROOT)} (a search needs a server: scripts/site --serve)"
        )
    return done


if __name__ == "__main__":
    sys.exit(main())
