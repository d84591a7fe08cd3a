"""`scripts/style.py` on a small project: each measure counts what its definition says."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "style.py"
FILES = {
    "README.md": """# A heading is no sentence

One two three
four five. See [the docs](docs/a/long/page.md) and `rfl drive --set a=b`!

    code that is left out. And more of it.

| a table | left out. Too. |
|---|---|

- An item without a stop
- Another item, e.g. this one.
""",
    "docs/long.md": " ".join(["word"] * 31) + ".\n",
    "src/lib.rs": "//! The problem.\npub mod a;\nmod b;\n",
    "src/a/mod.rs": """//! How it is.
mod one;
mod two;
pub use one::{Shape, Same};
/// Whether `a ... b` holds. It does.
///
/// ```
/// // What is code is no sentence.
/// ```
pub struct Row;
""",
    # Both use what the other defines, one through the re-export of their folder.
    "src/a/one.rs": """use super::two;
pub struct Shape;
pub struct Same;
pub trait Kind { type Row; }
const TEXT: &str = "/// What is text is no comment.";
""",
    "src/a/two.rs": """use super::Shape;
struct Row(Shape);
type Same = u8;
#[cfg(test)]
mod tests { struct Shape; use crate::b::B; }
""",
    "src/b/mod.rs": "mod leaf;\npub struct B(leaf::Leaf);\nnames! { pub enum Row { First } }\n",
    # A child that uses only another folder is no circle.
    "src/b/leaf.rs": "use crate::a::Row as Other;\npub struct Leaf(Other);\n",
}


@pytest.fixture
def root(tmp_path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def style(root: Path, *options: str, status: int = 0) -> str:
    command = [sys.executable, str(SCRIPT), "--root", str(root), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout + done.stderr


def counted(root: Path) -> tuple[dict, dict]:
    found = json.loads(style(root, "--json", "--list"))
    return found["counts"], found["places"]


def test_types_in_several_files_are_named_with_their_places(root):
    counts, places = counted(root)
    # An associated type and a type of tests define no name; a macro's enum does.
    assert counts["types"] == 6 and counts["types_in_several_files"] == 2
    found = {(place["text"], place["file"]) for place in places["types_in_several_files"]}
    assert found == {
        ("Row", "src/a/mod.rs"),
        ("Row", "src/a/two.rs"),
        ("Row", "src/b/mod.rs"),
        ("Same", "src/a/one.rs"),
        ("Same", "src/a/two.rs"),
    }


def test_openings_of_doc_sentences(root):
    counts, places = counted(root)
    assert counts["doc_sentences"] == 4
    assert counts["question_openings_percent"] == 50
    assert [(p["file"], p["line"]) for p in places["question_openings_percent"]] == [
        ("src/a/mod.rs", 1),
        ("src/a/mod.rs", 5),
    ]


def test_a_circle_goes_through_re_exports_and_not_through_tests(root):
    counts, places = counted(root)
    assert counts["import_circles"] == 1
    assert {place["file"] for place in places["import_circles"]} == {"src/a/one.rs", "src/a/two.rs"}


def test_words_of_page_sentences(root):
    counts, places = counted(root)
    # 5, 5 (a link as its text, code as one word), 5, 5 and 31 words.
    assert counts["page_sentences"] == 5
    assert counts["page_words_mean"] == pytest.approx(51 / 5)
    assert (counts["page_sentences_over_25"], counts["page_words_max"], counts["page_words_p90"]) == (1, 31, 31)
    assert [place["file"] for place in places["page_sentences_over_25"]] == ["docs/long.md"]


def test_text_and_exit_status(root):
    text = style(root)
    assert "type names defined in more than one file of src" in text
    # Half of the four doc sentences open with a question word: a limit is missed.
    style(root, "--check", status=1)
    assert "src/a/one.rs:1" in style(root, "--list", "import_circles")
    assert "has no places" in style(root, "--list", "words", status=2)
    assert "no folder src" in style(root / "docs", status=2)
    assert "examples:" in style(root, "--help")
