"""Every scoring run stays in the record, and the pages are made from it."""

import gzip
import json
import subprocess

import pytest

from blind import record
from scripts.provenance import provenance

RESULT = next(iter(record.read(record.RESULTS)))["result"]


def run_of(program: str, cases: int, **commitment) -> dict:
    """A run with the smallest commitment that the page needs, and one case."""
    case = {
        "case": 7,
        "vehicle": "van",
        "kind": "single",
        "causes": ["steer_delay"],
        "values": {"steer_delay": 0.123456789},
        "dominance": None,
        "reference": False,
        "verdict": "None",
        "named": [],
        "first": [],
        "error": None,
        "exact": False,
        "in_class": False,
    }
    written = {"set": "scoring", "labels": "0" * 64, "program": program, "written": "2026-11-26 02:45:31 UTC"}
    return {"commitment": written | commitment, "result": RESULT | {"cases": cases}, "cases": [case]}


@pytest.fixture
def add(tmp_path):
    """Adds a run to the record of an empty folder; its plots are its program's name."""
    plots = tmp_path / "plots"
    plots.mkdir()

    def added(run: dict) -> list[dict]:
        for name in ("blind.png", "blind-confusion.png"):
            (plots / name).write_text(run["commitment"]["program"], encoding="utf-8")
        record.add(run, tmp_path, plots)
        return record.read(tmp_path)

    return added


def test_a_run_is_kept_with_its_number_and_cases(add):
    add(run_of("old", 50))
    runs = add(run_of("new", 40))
    assert [run["run"] for run in runs] == [1, 2]
    assert runs[0]["commitment"]["program"] == "old"
    # Five digits a number.
    assert runs[1]["cases"][0]["values"] == {"steer_delay": 0.12346}


def test_the_page_has_a_line_for_each_run_and_the_newest_program_beside(add, tmp_path):
    add(run_of("old", 50))
    add(run_of("new", 40, version="rfl 0.1.0", commit="abc1234", dirty=True))
    add(run_of("new", 60, version="rfl 0.1.0", commit="abc1234", dirty=True))
    page = (tmp_path / "blind.md").read_text(encoding="utf-8")
    assert all(f"| {number}, 2026-11-26" in page for number in (1, 2, 3))
    assert "run 3, usual, 60 cases | run 2, usual, 40 cases" in page
    assert "Program: rfl 0.1.0, commit abc1234, with changes." in page
    assert "All cases of run 3" in page
    newest = json.loads((tmp_path / "blind.json").read_text(encoding="utf-8"))["runs"]
    assert [run["run"] for run in newest] == [2, 3]
    assert all("cases" not in run for run in newest)


def test_the_plots_are_of_the_newest_programs_largest_run(add, tmp_path):
    add(run_of("old", 90))
    add(run_of("new", 60))
    assert (tmp_path / "blind.png").read_text(encoding="utf-8") == "new"
    (tmp_path / "blind.png").write_text("kept", encoding="utf-8")
    add(run_of("new", 40))
    assert (tmp_path / "blind.png").read_text(encoding="utf-8") == "kept"


def test_the_same_runs_give_the_same_bytes(add, tmp_path):
    runs = add(run_of("new", 60))
    before = (tmp_path / record.TABLE).read_bytes()
    record.save(runs, tmp_path)
    assert (tmp_path / record.TABLE).read_bytes() == before
    assert [file.name for file in tmp_path.glob("*.part")] == []


def test_rewriting_gives_the_pages_that_are_there(tmp_path, capsys):
    (tmp_path / record.TABLE).write_bytes((record.RESULTS / record.TABLE).read_bytes())
    assert record.main(["--rewrite", "--folder", str(tmp_path)]) == 0
    for name in ("blind.md", "blind.json"):
        assert (tmp_path / name).read_text(encoding="utf-8") == (record.RESULTS / name).read_text(encoding="utf-8")


def test_the_table_has_each_run_once_with_as_many_cases_as_were_scored():
    runs = record.read(record.RESULTS)
    assert [run["run"] for run in runs] == list(range(1, len(runs) + 1))
    for run in runs:
        assert "lost" in run or len(run["cases"]) == run["result"]["cases"]


def test_one_run_is_printed(tmp_path, capsys):
    with gzip.open(tmp_path / record.TABLE, "wt", encoding="utf-8") as table:
        table.write(json.dumps({"run": 1} | run_of("new", 60)) + "\n")
    assert record.main(["--run", "1", "--folder", str(tmp_path)]) == 0
    assert "steer_delay 0.123 -> None" in capsys.readouterr().out
    assert record.main(["--run", "2", "--folder", str(tmp_path)]) == 1
    assert "there is no run 2" in capsys.readouterr().err


def test_every_run_of_the_record_is_printed(capsys, monkeypatch):
    runs = record.read(record.RESULTS)
    monkeypatch.setattr(record, "read", lambda _: runs)
    for run in runs:
        assert record.main(["--run", str(run["run"])]) == 0
        assert capsys.readouterr().out


def test_a_commit_is_named_where_git_is_there(tmp_path):
    assert provenance(tmp_path / "no-program", tmp_path / "no-folder") == {}

    def git(*arguments):
        who = ["-c", "user.name=test", "-c", "user.email=test@example.com"]
        subprocess.run(["git", *who, *arguments], cwd=tmp_path, check=True, capture_output=True)

    git("init")
    file = tmp_path / "file"
    file.write_text("one", encoding="utf-8")
    git("add", "file")
    git("commit", "-m", "one")
    found = provenance(tmp_path / "no-program", tmp_path)
    assert found["dirty"] is False
    assert len(found["commit"]) >= 7
    file.write_text("two", encoding="utf-8")
    assert provenance(tmp_path / "no-program", tmp_path)["dirty"] is True
