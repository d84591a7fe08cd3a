"""What is imported is written whole or not at all; links are written through."""

from __future__ import annotations

import pytest
from foreign_logs import PLAIN, mapping, table
from import_log import convert
from importing.output import written


@pytest.mark.parametrize("name", ["out.csv", "out.csv.gz"])
def test_a_write_that_breaks_off_leaves_the_old_file(tmp_path, name):
    out = tmp_path / "there" / name
    convert(table(tmp_path), mapping(tmp_path, PLAIN), out)
    before = out.read_bytes()
    with pytest.raises(OSError, match="full"), written(out) as stream:
        stream.write("time\n0.0\n")
        raise OSError("the disk is full")
    assert out.read_bytes() == before
    assert [file.name for file in out.parent.iterdir()] == [name]


def test_what_a_killed_run_left_is_taken_away(tmp_path):
    left, others = tmp_path / ".out.csv.1.0.part", tmp_path / ".out.csv.part"
    for file in (left, others):
        file.write_text("half")
    with written(tmp_path / "model.csv") as stream:
        stream.write("time\n")
        with written(tmp_path / "out.csv") as second:
            second.write("time\n")
    assert sorted(file.name for file in tmp_path.iterdir()) == [".out.csv.part", "model.csv", "out.csv"]


def test_a_link_is_written_through(tmp_path):
    target, link = tmp_path / "target.csv", tmp_path / "link.csv"
    target.write_text("old")
    link.symlink_to(target)
    convert(table(tmp_path), mapping(tmp_path, PLAIN), link)
    assert link.is_symlink() and target.read_text().startswith("time,vx,yaw_rate\n")
