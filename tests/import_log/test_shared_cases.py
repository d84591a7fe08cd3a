"""Logs that people brought. A user's machine has none of them: then these tests are skipped and say so."""

from __future__ import annotations

import tarfile
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import EXAMPLES, imported, mapping, needs
from import_log import ImportFailed, convert, open_log

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases" / "logs"


def case(name: str) -> Path:
    if not (CASES / name).is_file():
        pytest.skip(f"{name} is not in ../shared/cases/logs; it is not part of the project")
    return CASES / name


@pytest.mark.parametrize(
    ("log", "mapping_file"),
    [
        ("underscore_time.csv", "map_std.toml"),
        ("iso_time.csv", "map_std.toml"),
        ("latin1_header.csv", "map_std.toml"),
        ("semicolon_decimal_comma_log.csv", "map_semicolon.toml"),
        ("motec_like.csv", "map_motec.toml"),
    ],
)
def test_a_table_is_read(tmp_path, log, mapping_file):
    columns = imported(case(log), case(mapping_file), tmp_path)
    assert np.allclose(np.diff(columns["time"]), 0.02)
    assert np.isclose(columns["vx"][0], 12.5) and columns["vx"].min() >= 0
    assert 11.9 < columns["time"][-1] < 12.1 and np.abs(columns["yaw_rate"]).max() < 0.1


def test_a_bag_with_an_unknown_type_is_read(tmp_path):
    needs("rosbags")
    with tarfile.open(case("ros2_db3_without_definitions.tar.gz")) as archive:
        archive.extractall(tmp_path, filter="data")
    log = open_log(tmp_path / "bag_nodef")
    assert "ackermann_msgs/msg/AckermannDriveStamped is unknown" in log.broken["/drive"]
    assert "/odom:twist.twist.linear.x" in log.names
    text = (EXAMPLES / "rosbag.toml").read_text()
    with pytest.raises(ImportFailed, match=r"\[columns.steer_cmd\].*AckermannDriveStamped is unknown"):
        convert(tmp_path / "bag_nodef", EXAMPLES / "rosbag.toml", tmp_path / "out.csv")
    rest = "rate = 50\n" + text[text.index("[columns.x]") :]
    columns = imported(tmp_path / "bag_nodef", mapping(tmp_path, rest), tmp_path)
    assert len(columns["time"]) == 1500 and np.isclose(columns["vx"][0], 12.5)
