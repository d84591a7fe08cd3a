"""Which drives a fleet has: folders, logs, tables; and what is wrong with them, in words."""

from __future__ import annotations

import importlib

import pandas as pd
import pytest


@pytest.fixture(scope="module")
def manifest(rfl_mpc):
    return importlib.import_module("rfl_mpc.fleet.manifest")


def of(drives):
    return [(drive.vehicle, drive.log.rsplit("/", 1)[-1]) for drive in drives]


def test_each_folder_of_logs_is_a_vehicle_and_drives_come_in_natural_order(manifest, tmp_path):
    for place in ("a/drive_10.csv", "a/drive_9.csv", "b/c/log.csv.gz", "b/notes.txt", "b/c/.hidden.csv", "d/x.parquet"):
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).write_text("time,vx\n")
    (tmp_path / "b" / "vehicle.toml").write_text("")
    drives = manifest.read([tmp_path])
    assert of(drives) == [("a", "drive_9.csv"), ("a", "drive_10.csv"), ("b/c", "log.csv.gz"), ("d", "x.parquet")]
    assert [drive.vehicle_file for drive in drives] == [None, None, str(tmp_path / "b" / "vehicle.toml"), None]


@pytest.mark.parametrize("suffix", ["csv", "parquet", "semicolon"])
def test_a_table_says_vehicle_time_and_files(manifest, tmp_path, suffix):
    table = pd.DataFrame({
        "log": ["x/2.csv", "x/1.csv", "/data/3.csv"],
        "vehicle": ["one", "one", "two"],
        "time": ["2026-03-02T08:00:00Z", "2026-03-01T08:00:00Z", "2026-03-01T08:00:00+01:00"],
        "vehicle_file": ["my_car.toml", "my_car.toml", "c_class"],
        "reference": ["", "x/0.csv", ""],
    })  # fmt: skip
    file = tmp_path / ("drives.parquet" if suffix == "parquet" else "drives.csv")
    if suffix == "parquet":
        table.to_parquet(file)
    else:
        table.to_csv(file, index=False, sep=";" if suffix == "semicolon" else ",")
    drives = manifest.read([file])
    assert of(drives) == [("one", "1.csv"), ("one", "2.csv"), ("two", "3.csv")]
    assert [drive.log for drive in drives] == [
        str(tmp_path / "x" / "1.csv"),
        str(tmp_path / "x" / "2.csv"),
        "/data/3.csv",
    ]
    assert [drive.vehicle_file for drive in drives] == [str(tmp_path / "my_car.toml")] * 2 + ["c_class"]
    assert [drive.reference for drive in drives] == [str(tmp_path / "x" / "0.csv"), None, None]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_table_is_read_as_spreadsheets_save_it(manifest, tmp_path, encoding, separator):
    rows = [("Log", "Vehicle", "TIME"), ("x/a.csv", "grün", "1"), ("x/b, c; d.csv", "grün", "2"), ("", "", "")]
    text = "\r\n".join(separator.join(f'"{cell}"' for cell in row) for row in rows)
    (tmp_path / "drives.csv").write_text(text, encoding=encoding)
    assert of(manifest.read([tmp_path / "drives.csv"])) == [("grün", "a.csv"), ("grün", "b, c; d.csv")]


def test_a_data_frame_is_a_manifest_with_files_relative_to_the_current_folder(manifest, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    frame = pd.DataFrame({"log": ["2.csv", "1.csv"], "vehicle": [7, 7], "time": pd.to_datetime(["2026-03-01"] * 2)})
    drives = manifest.read([frame])
    assert [drive.log for drive in drives] == [str(tmp_path / "1.csv"), str(tmp_path / "2.csv")]
    assert [drive.vehicle for drive in drives] == ["7", "7"]


def test_a_corrupt_parquet_file_is_a_log_that_its_diagnosis_refuses(manifest, tmp_path):
    (tmp_path / "x.parquet").write_bytes(b"PAR1")
    assert of(manifest.read([tmp_path / "x.parquet"])) == [(tmp_path.name, "x.parquet")]


@pytest.mark.parametrize("name", ["drives.csv", "drives.parquet"])
def test_a_table_that_is_neither_log_nor_manifest_is_refused_with_the_names_it_needs(rfl_mpc, manifest, tmp_path, name):
    table = pd.DataFrame({"path": ["a.csv"], "Vehicle": ["v"], "time": ["1"]})
    getattr(table, "to_csv" if name.endswith("csv") else "to_parquet")(tmp_path / name)
    with pytest.raises(rfl_mpc.RflError, match=r"columns: .*path, vehicle.*needs the columns log and vehicle"):
        manifest.read([tmp_path / name])


def test_a_log_with_a_column_of_a_manifest_stays_a_log(manifest, tmp_path):
    (tmp_path / "log.csv").write_text("time,steer_cmd,vx,vehicle\n0,0,1,a\n")
    assert of(manifest.read([tmp_path / "log.csv"])) == [(tmp_path.name, "log.csv")]


@pytest.mark.parametrize("source", [None, 3, pd.DataFrame({"path": ["a.csv"]})])
def test_what_names_no_drives_is_said(rfl_mpc, manifest, source):
    with pytest.raises(rfl_mpc.RflError, match="manifest"):
        manifest.read([source])


def test_times_may_be_numbers(manifest, tmp_path):
    (tmp_path / "drives.csv").write_text("log,vehicle,time\na.csv,v,10\nb.csv,v,9.5\n")
    assert of(manifest.read([tmp_path / "drives.csv"])) == [("v", "b.csv"), ("v", "a.csv")]


@pytest.mark.parametrize("name", ["drives.parquet", "frame"])
@pytest.mark.parametrize("index", [["vehicle"], ["log"], ["vehicle", "time"], ["number"]])
def test_the_index_of_a_table_is_of_its_columns(manifest, tmp_path, monkeypatch, name, index):
    monkeypatch.chdir(tmp_path)
    table = pd.DataFrame({"log": ["b.csv", "a.csv"], "vehicle": ["v", "w"], "time": [1, 2], "number": [3, 4]})
    table = table.set_index("number") if index == ["number"] else table.drop(columns="number").set_index(index)
    if name == "drives.parquet":
        table.to_parquet(name)
    drives = manifest.read([name if name == "drives.parquet" else table])
    assert of(drives) == [("v", "b.csv"), ("w", "a.csv")] and [drive.time for drive in drives] == ["1", "2"]


DAY = "2026-03-0{}T08:00:00"


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ([DAY.format(1) + "Z", DAY.format(2)], "times with a zone in row 2, times without a zone in row 3: which was"),
        (
            [DAY.format(1), DAY.format(2) + "+01:00", DAY.format(3)],
            "without a zone in rows 2, 4, times with .* in row 3",
        ),
        (["2026-03-01", "2026-03-02T08Z"], "row 2, .* row 3"),
        ([DAY.format(day) for day in range(1, 6)] + ["2026-03-07T08:00:00-05"], "rows 2, 3, 4 and 2 more, .* row 7"),
        ([pd.Timestamp(DAY.format(1)), pd.Timestamp(DAY.format(2), tz="UTC")], "row 2, .* row 3"),
    ],
)
def test_times_with_and_without_a_zone_are_not_compared(rfl_mpc, manifest, times, words):
    logs = [f"{number}.csv" for number in range(len(times))]
    with pytest.raises(rfl_mpc.RflError, match=words):
        manifest.read([pd.DataFrame({"log": logs, "vehicle": "v", "time": pd.Series(times, dtype=object)})])


@pytest.mark.parametrize("others", [[DAY.format(1)], [5]])
def test_tables_with_times_of_several_kinds_are_not_joined_in_a_vehicle(rfl_mpc, manifest, others):
    zoned = pd.DataFrame({"log": ["a.csv"], "vehicle": ["v"], "time": [DAY.format(2) + "Z"]})
    other = pd.DataFrame({"log": ["b.csv"], "vehicle": ["v"], "time": others})
    with pytest.raises(rfl_mpc.RflError, match=r"vehicle 'v': .*a.csv has times with a zone, .*b.csv (times|numbers)"):
        manifest.read([zoned, other])
    assert len(manifest.read([zoned, other.assign(vehicle="w")])) == 2


def test_a_tilde_is_the_home_folder_in_a_table_and_beside_it(manifest, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    (tmp_path / "car.toml").write_text("")
    head = "log,vehicle,vehicle_file,reference\n"
    (tmp_path / "drives.csv").write_text(head + "~/logs/a.csv,v,~/car.toml,~/r.csv\n")
    for given in ("~/drives.csv", b"~/drives.csv"):
        (drive,) = manifest.read([given])
        files = [drive.log, drive.vehicle_file, drive.reference]
        assert files == [str(tmp_path / name) for name in ("logs/a.csv", "car.toml", "r.csv")]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("log,vehicle,time\na.csv,v,1\nb.csv,v,\n", "row 3: no time"),
        ("log,vehicle,time\na.csv,v,1\nb.csv,v,soon\n", "row 3: time 'soon' is no number"),
        ("log,vehicle,time\na.csv,v,yesterday\n", "row 2: time 'yesterday' is neither"),
        ("log,vehicle\na.csv,\n", "row 2: no vehicle"),
        ("log,vehicle\n,v\n", "row 2: no log"),
        ("log,vehicle,car\na.csv,v,x\n", "column 'car' is none of a manifest"),
        ("log,vehicle,Log\na.csv,v,b.csv\n", "the column 'log' stands twice"),
        ("log,vehicle\na.csv,v\nb.csv,v,w\n", "row 3: 3 values for 2 columns"),
        ("log,vehicle\na.csv,v\na.csv,v\n", "is given twice"),
        ("log,vehicle\n", "no drive is given"),
    ],
)
def test_what_is_wrong_with_a_table_is_said_with_its_row(rfl_mpc, manifest, tmp_path, text, words):
    (tmp_path / "drives.csv").write_text(text)
    with pytest.raises(rfl_mpc.RflError, match=words.replace("'", ".")):
        manifest.read([tmp_path / "drives.csv"])


def test_a_missing_or_an_empty_folder_is_said(rfl_mpc, manifest, tmp_path):
    with pytest.raises(rfl_mpc.RflError, match="no such file or folder"):
        manifest.read([tmp_path / "nothing"])
    with pytest.raises(rfl_mpc.RflError, match="no log in this folder"):
        manifest.read([tmp_path])


def test_a_log_by_itself_is_a_drive_of_its_folder(manifest, tmp_path):
    (tmp_path / "log.csv").write_text("time,steer_cmd,vx\n")
    assert of(manifest.read([tmp_path / "log.csv"])) == [(tmp_path.name, "log.csv")]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("drive.xlsx", "a spreadsheet, not a log; save its sheet as CSV"),
        ("Drives.ODS", "a spreadsheet, not a log; save its sheet as CSV"),
        ("week.zip", "an archive, not a log; unpack it"),
        ("run.mf4", "scripts/import_log.py"),
    ],
)
def test_what_is_no_table_is_refused_with_what_to_do(rfl_mpc, manifest, tmp_path, name, words):
    (tmp_path / name).write_bytes(b"PK\x03\x04")
    for given in (tmp_path / name, tmp_path):
        with pytest.raises(rfl_mpc.RflError, match=words) as error:
            manifest.read([given])
        assert name in str(error.value)
    # Beside logs it is nobody's.
    (tmp_path / "drive.csv").write_text("time,vx\n")
    assert of(manifest.read([tmp_path])) == [(tmp_path.name, "drive.csv")]
