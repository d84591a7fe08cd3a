#!/usr/bin/env python3
"""Counts how the project is written: names defined twice, doc comments, import circles, length of sentences.

It reads the files only; nothing is built. `MEASURES` has the measures and their limits; `count_...` define them.
"""

from __future__ import annotations

import argparse
import bisect
import json
import math
import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

# The grammar that editors use: comments, nested imports and test modules are found without a parser of our own.
try:
    import tree_sitter
    import tree_sitter_rust
except ImportError:
    sys.exit("style: the packages tree-sitter and tree-sitter-rust are missing; run scripts/setup --test")

ROOT = Path(__file__).resolve().parent.parent
DOC_FOLDERS = ("src", "fmu-build", "python/src")
PAGES = ("README.md", "CONTRIBUTING.md", "python/README.md", "blind/README.md", "docs")
QUESTION_WORDS = ("What", "Whether", "How", "Where", "Why", "That", "When", "Which")
LONG = 25  # words of a sentence
TYPES = ("struct_item", "enum_item", "union_item", "trait_item", "type_item")

# Name: meaning, largest value wanted (none: for information).
MEASURES: dict[str, tuple[str, float | None]] = {
    "types": ("type names defined in src", None),
    "types_in_several_files": ("type names defined in more than one file of src", 10),
    "doc_sentences": ("sentences of doc comments", None),
    "question_openings_percent": ("% of doc sentences that open with a question word", 1),
    "doc_words_mean": ("mean words of a doc sentence", None),
    "doc_sentences_over_25": ("doc sentences of more than 25 words", None),
    "import_circles": ("circles of imports inside the folders of src", 5),
    "page_sentences": ("sentences of README and docs", None),
    "page_words_mean": ("mean words of their sentences", 18),
    "page_words_p90": ("90th percentile of words", None),
    "page_sentences_over_25": ("sentences of more than 25 words", None),
    "page_words_max": ("words of the longest sentence", None),
}


@dataclass(frozen=True)
class Place:
    """A line of a file and the words found there."""

    file: str
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.text}"


@dataclass
class Count:
    """Values of all measures, and the places behind those that have a limit."""

    values: dict[str, float] = field(default_factory=dict)
    places: dict[str, list[Place]] = field(default_factory=dict)


# -- Sentences --------------------------------------------------------------------------------------------------------

# The end of a sentence: a stop and a space, unless an abbreviation or a single letter stands before the stop.
END = re.compile(r"(?<!\be\.g)(?<!\bi\.e)(?<!\betc)(?<!\bvs)(?<!\bcf)(?<!\bapprox)(?<!\bet al)[.!?][)\"*_]*\s+(?=\S)")
LIST_ITEM = re.compile(r"\s*([-*+]|\d+[.)])\s+")


def blocks(lines: list[tuple[int, str]]) -> Iterator[list[tuple[int, str]]]:
    """Paragraphs and list items of Markdown; code, tables, headings, pictures and references are left out."""
    block: list[tuple[int, str]] = []
    fence, listed, blank = None, False, True
    for number, line in lines:
        words = line.strip()
        if fence is not None or words.startswith(("```", "~~~")):
            if fence is None:
                fence = words[:3]
            elif words.startswith(fence):
                fence = None
            left_out = True
        else:
            item = LIST_ITEM.match(line)
            code = line.startswith("    ") and blank and not listed
            left_out = (
                not words
                or code
                or words.startswith(("#", "|", "![", "<", ">"))
                or bool(re.match(r"\[[^]]+\]:\s", words))
            )
            listed = bool(item) or (listed and (not words or line.startswith(" ")))
            if item and not code and block:
                yield block
                block = []
        if left_out:
            if block:
                yield block
            block = []
            # After a line of code the next indented line is code, too.
            blank = not words or fence is not None or line.startswith("    ")
        else:
            block.append((number, LIST_ITEM.sub("", line, count=1) if item else words))
            blank = False
    if block:
        yield block


def sentences(lines: list[tuple[int, str]]) -> Iterator[tuple[int, tuple[str, int]]]:
    """Sentences, each with its first line and its number of words: of a paragraph or list item, up to a full stop.

    Code in backquotes and formulas count as one word, a link as its text.
    """
    for block in blocks(lines):
        text, starts, numbers = "", [], []
        for number, words in block:
            starts.append(len(text))
            numbers.append(number)
            text += words.strip() + " "
        # Replacements of equal length, so that places stay.
        plain = re.sub(r"(`+)(.+?)\1", lambda m: "`" + "c" * (len(m[0]) - 2) + "`", text)
        plain = re.sub(r"\$[^$]+\$", lambda m: "`" + "c" * (len(m[0]) - 2) + "`", plain)
        plain = re.sub(r"\]\([^)\s]*\)", lambda m: "]" + " " * (len(m[0]) - 1), plain)
        begin = 0
        for end in [*(m.end() for m in END.finditer(plain)), len(plain)]:
            sentence = plain[begin:end]
            if re.search(r"\w", sentence):
                at = numbers[bisect.bisect_right(starts, begin) - 1]
                yield at, (text[begin:end].strip(), len([w for w in sentence.split() if re.search(r"\w", w)]))
            begin = end


# -- Rust -------------------------------------------------------------------------------------------------------------


@dataclass
class Source:
    """A Rust file: types, imports and doc comments outside its tests."""

    file: Path
    types: dict[str, int] = field(default_factory=dict)  # name, line
    items: set[str] = field(default_factory=set)  # names of all that the file defines
    imports: list[tuple[tuple[str, ...], str, bool, int]] = field(default_factory=list)  # path, name, re-export, line
    paths: list[tuple[tuple[str, ...], int]] = field(default_factory=list)  # qualified paths in the code
    docs: list[list[tuple[int, str]]] = field(default_factory=list)  # blocks of lines


@cache
def parser() -> tree_sitter.Parser:
    return tree_sitter.Parser(tree_sitter.Language(tree_sitter_rust.language()))


def is_test(node: tree_sitter.Node) -> bool:
    """An item behind `#[cfg(test)]`."""
    before = node.prev_named_sibling
    while before is not None and before.type in ("attribute_item", "line_comment"):
        if re.search(rb"cfg\(\s*(all\()?\s*test\b", before.text):
            return True
        before = before.prev_named_sibling
    return False


def use_paths(node: tree_sitter.Node, prefix: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], str]]:
    """Paths of an import with the names that they get; `*` for all names of a module."""
    kind, text = node.type, node.text.decode()
    if kind == "use_list":
        for child in node.named_children:
            yield from use_paths(child, prefix)
    elif kind == "scoped_use_list":
        path, names = node.child_by_field_name("path"), node.child_by_field_name("list")
        yield from use_paths(names, prefix + (segments(path) if path else ()))
    elif kind == "use_as_clause":
        path = prefix + segments(node.child_by_field_name("path"))
        yield path, node.child_by_field_name("alias").text.decode()
    elif kind == "use_wildcard":
        yield prefix + segments(node.named_children[0]) if node.named_children else prefix, "*"
    elif kind == "self" and prefix:
        yield prefix, prefix[-1]
    elif kind in ("identifier", "scoped_identifier", "crate", "super", "self"):
        path = prefix + segments(node)
        yield path, text.rsplit("::", 1)[-1]


def segments(node: tree_sitter.Node) -> tuple[str, ...]:
    return tuple(part.strip() for part in node.text.decode().split("::"))


def read_source(file: Path) -> Source:
    """Reads a file of Rust."""
    source = Source(file)
    text = file.read_bytes()
    comments: list[tuple[int, str, str]] = []

    def walk(node: tree_sitter.Node, inside: bool, tests: bool) -> None:
        kind, line = node.type, node.start_point[0] + 1
        if kind == "line_comment":
            words = node.text.decode().rstrip("\r\n")
            if words.startswith(("///", "//!")) and not words.startswith("////"):
                comments.append((line, words[:3], words[3:].removeprefix(" ")))
            return
        tests = tests or (kind.endswith(("_item", "_declaration")) and is_test(node))
        if not tests:
            name = node.child_by_field_name("name") if kind.endswith(("_item", "_definition")) else None
            if name is not None and not inside:
                source.items.add(name.text.decode())
                if kind in TYPES:
                    source.types.setdefault(name.text.decode(), line)
            if kind == "macro_invocation":
                # Types that a macro of ours declares: `enumeration! { pub enum Name { .. } }`.
                for found in re.finditer(rb"\b(?:struct|enum)\s+([A-Z]\w*)\s*\{", node.text):
                    source.items.add(found[1].decode())
                    source.types.setdefault(found[1].decode(), line)
            if kind == "use_declaration":
                public = any(child.type == "visibility_modifier" for child in node.named_children)
                for path, as_name in use_paths(node.child_by_field_name("argument")):
                    source.imports.append((path, as_name, public, line))
                return
            if kind in ("scoped_identifier", "scoped_type_identifier"):
                path = segments(node)
                if all(re.fullmatch(r"\w+", part) for part in path):
                    source.paths.append((path, line))
                    return
        for child in node.children:
            walk(child, inside or kind in ("impl_item", "trait_item"), tests)

    walk(parser().parse(text).root_node, False, False)
    last = ""
    for line, marker, words in comments:
        if source.docs and source.docs[-1][-1][0] == line - 1 and last == marker:
            source.docs[-1].append((line, words))
        else:
            source.docs.append([(line, words)])
        last = marker
    return source


def rust_files(root: Path, folder: str) -> list[Path]:
    return [file for file in sorted((root / folder).rglob("*.rs")) if "target" not in file.relative_to(root).parts]


# -- Circles ----------------------------------------------------------------------------------------------------------


class Modules:
    """The tree of modules of one crate, and the file in which each name is defined."""

    def __init__(self, folder: Path, sources: dict[Path, Source]) -> None:
        self.sources = {file: source for file, source in sources.items() if file.is_relative_to(folder)}
        self.files: dict[tuple[str, ...], Path] = {}
        for file in self.sources:
            parts = file.relative_to(folder).with_suffix("").parts
            if parts[-1] in ("mod", "lib"):
                parts = parts[:-1]
            self.files[parts] = file
        self.modules = {file: module for module, file in self.files.items()}

    def defined(self, path: tuple[str, ...], module: tuple[str, ...], seen: frozenset = frozenset()) -> Path | None:
        """The file that defines what a path of a module means, through all re-exports; none outside the crate."""
        if (path, module) in seen:
            return None
        seen |= {(path, module)}
        at, first = module, True
        for index, part in enumerate(path):
            if first and part == "crate":
                at = ()
            elif first and part == "self":
                pass
            elif part == "super":
                at = at[:-1]
                continue
            elif (*at, part) in self.files:
                at = (*at, part)
            else:
                found = self.named(part, path[index + 1 :], at, seen)
                # A name that this module does not know: another crate's where the path begins, a macro's item later.
                return found or (None if first else self.files.get(at))
            first = False
        return self.files.get(at)

    def named(self, name: str, rest: tuple[str, ...], module: tuple[str, ...], seen: frozenset) -> Path | None:
        """The file that defines a name of a module."""
        file = self.files.get(module)
        if file is None:
            return None
        source = self.sources[file]
        if name in source.items:
            return file
        for path, as_name, _, _ in source.imports:
            if as_name == name:
                return self.defined(path + rest, module, seen)
        for path, as_name, _, _ in source.imports:
            if as_name == "*":
                target = self.defined(path, module, seen)
                found = self.named(name, rest, self.modules[target], seen) if target else None
                if found:
                    return found
        return None

    def uses(self, file: Path) -> dict[Path, int]:
        """Files whose items a file uses, with the first line of each use. A re-export alone is no use."""
        module, source = self.modules[file], self.sources[file]
        found: dict[Path, int] = {}
        used = [(path, line) for path, _, public, line in source.imports if not public] + source.paths
        for path, line in used:
            target = self.defined(path, module)
            if target is not None and target != file:
                found.setdefault(target, line)
        return found


def circles(graph: dict[Path, set[Path]]) -> list[list[Path]]:
    """Sets of two or more files each of which reaches each other (strongly connected components, after Tarjan)."""
    index: dict[Path, int] = {}
    low: dict[Path, int] = {}
    stack: list[Path] = []
    found = []

    def visit(node: Path) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            group = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(group) > 1:
                found.append(sorted(group))

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return sorted(found)


# -- Counting ---------------------------------------------------------------------------------------------------------


def percentile(values: list[int], share: float) -> int:
    """Smallest value that this share of all does not exceed."""
    return sorted(values)[max(0, math.ceil(share * len(values)) - 1)] if values else 0


def mean(values: list[int]) -> float:
    return sum(values) / len(values) if values else 0.0


def count_types(root: Path, sources: dict[Path, Source], count: Count) -> None:
    """Structs, enums, unions, traits and aliases of src, private ones too; tests and associated types are left out."""
    where: dict[str, list[Place]] = {}
    for file, source in sources.items():
        if file.is_relative_to(root / "src"):
            for name, line in source.types.items():
                where.setdefault(name, []).append(Place(str(file.relative_to(root)), line, name))
    several = {name: places for name, places in where.items() if len(places) > 1}
    count.values |= {"types": len(where), "types_in_several_files": len(several)}
    count.places["types_in_several_files"] = [place for name in sorted(several) for place in several[name]]


def count_docs(root: Path, sources: dict[Path, Source], count: Count) -> None:
    """Sentences of `///` and `//!` in src, fmu-build and python/src; code in them is left out."""
    found = [
        (Place(str(file.relative_to(root)), line, text), words)
        for file, source in sources.items()
        for block in source.docs
        for line, (text, words) in sentences(block)
    ]
    asking = [place for place, _ in found if re.match(rf"\W*({'|'.join(QUESTION_WORDS)})\b", place.text)]
    lengths = [words for _, words in found]
    count.values |= {
        "doc_sentences": len(found),
        "question_openings_percent": 100 * len(asking) / max(1, len(found)),
        "doc_words_mean": mean(lengths),
        "doc_sentences_over_25": sum(words > LONG for words in lengths),
    }
    count.places["question_openings_percent"] = asking
    count.places["doc_sentences_over_25"] = [place for place, words in found if words > LONG]


def count_circles(root: Path, sources: dict[Path, Source], count: Count) -> None:
    """Circles between files of one folder of src, and of fmu-build/src.

    A file uses another if an import or a qualified path leads to an item of the other, re-exports followed.
    `mod` and `pub use` are no uses, and tests do not count. A circle is a set of files that all reach one another.
    """
    groups = (
        [folder for folder in sorted((root / "src").iterdir()) if folder.is_dir()] if (root / "src").is_dir() else []
    )
    crates = {folder: Modules(root / "src", sources) for folder in groups}
    packer = root / "fmu-build" / "src"
    if packer.is_dir():
        crates[packer] = Modules(packer, sources)
    number, places = 0, []
    for folder, crate in crates.items():
        uses = {file: crate.uses(file) for file in crate.sources if file.is_relative_to(folder)}
        for group in circles({file: {other for other in found if other in uses} for file, found in uses.items()}):
            number += 1
            for file in group:
                for other, line in sorted(uses[file].items()):
                    if other in group:
                        text = f"circle {number} of {len(group)} files: uses {other.relative_to(root)}"
                        places.append(Place(str(file.relative_to(root)), line, text))
    count.values["import_circles"] = number
    count.places["import_circles"] = places


def count_pages(root: Path, count: Count) -> None:
    """Sentences of README, CONTRIBUTING and docs; tables, code, headings and pictures are left out."""
    files = [
        file
        for page in PAGES
        for file in ([root / page] if page.endswith(".md") else sorted((root / page).rglob("*.md")))
    ]
    found = []
    for file in files:
        if file.is_file():
            lines = list(enumerate(file.read_text(encoding="utf-8").splitlines(), 1))
            name = str(file.relative_to(root))
            found += [(Place(name, line, text), words) for line, (text, words) in sentences(lines)]
    lengths = [words for _, words in found]
    count.values |= {
        "page_sentences": len(found),
        "page_words_mean": mean(lengths),
        "page_words_p90": percentile(lengths, 0.9),
        "page_sentences_over_25": sum(words > LONG for words in lengths),
        "page_words_max": max(lengths, default=0),
    }
    count.places["page_sentences_over_25"] = [
        Place(place.file, place.line, f"({words}) {place.text}") for place, words in found if words > LONG
    ]


def count_all(root: Path) -> Count:
    """Counts everything below a folder that is laid out as this project."""
    sources = {file: read_source(file) for folder in DOC_FOLDERS for file in rust_files(root, folder)}
    count = Count()
    count_types(root, sources, count)
    count_docs(root, sources, count)
    count_circles(root, sources, count)
    count_pages(root, count)
    return count


def misses(count: Count) -> list[str]:
    """Measures beyond their limits."""
    return [name for name, (_, limit) in MEASURES.items() if limit is not None and count.values[name] > limit]


def table(count: Count) -> str:
    rows = []
    for name, (meaning, limit) in MEASURES.items():
        value = count.values[name]
        shown = f"{value:.1f}" if isinstance(value, float) else str(value)
        wanted = "" if limit is None else f"wanted <= {limit:g}" + (", missed" if value > limit else "")
        rows.append(f"{meaning:<52}{shown:>8}  {wanted}".rstrip())
    return "\n".join(rows)


def arguments() -> argparse.Namespace:
    listed = argparse.ArgumentParser(
        description="Counts how the project is written: names defined twice, doc comments, import circles, sentences.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="""examples:
  scripts/style                                      all counts
  scripts/style --list                               and every place behind them
  scripts/style --list import_circles                the places of one measure
  scripts/style --json > style.json                  for scripts
  scripts/style --check                              exit status 1 where a limit is missed

measures with places: types_in_several_files, question_openings_percent, doc_sentences_over_25, import_circles,
page_sentences_over_25""",
    )
    listed.add_argument("--json", action="store_true", help="print JSON")
    listed.add_argument(
        "--list", nargs="?", const="all", metavar="MEASURE", help="show the places, of one measure or all"
    )
    listed.add_argument("--check", action="store_true", help="exit status 1 where a limit is missed")
    listed.add_argument("--root", type=Path, default=ROOT, metavar="FOLDER", help="another checkout")
    return listed.parse_args()


def main() -> int:
    chosen = arguments()
    if not (chosen.root / "src").is_dir():
        print(f"style: {chosen.root} has no folder src; --root names a checkout of the project", file=sys.stderr)
        return 2
    count = count_all(chosen.root.resolve())
    if chosen.list not in (None, "all", *count.places):
        print(f"style: '{chosen.list}' has no places; one of {', '.join(count.places)} has", file=sys.stderr)
        return 2
    listed = {name: places for name, places in count.places.items() if chosen.list in ("all", name)}
    if chosen.json:
        found = {"counts": count.values, "limits": {name: limit for name, (_, limit) in MEASURES.items() if limit}}
        if chosen.list:
            found["places"] = {name: [vars(place) for place in places] for name, places in listed.items()}
        print(json.dumps(found, indent=1, ensure_ascii=False))
    else:
        print(table(count))
        for name, places in listed.items():
            print(f"\n{name}:", *(f"  {place}" for place in places), sep="\n")
    return int(chosen.check and bool(misses(count)))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BrokenPipeError:  # `scripts/style | head`: the reader has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
