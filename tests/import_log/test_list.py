"""--list shows name, unit, rate, samples and range of each column, as a table and as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import TIME, VX, YAW_RATE, mapping, needs, rows, table
from import_log import main


def run(monkeypatch, capsys, *arguments) -> str:
    monkeypatch.setattr(sys, "argv", ["import_log", *map(str, arguments)])
    assert main() == 0
    return capsys.readouterr().out


def channels(monkeypatch, capsys, *arguments) -> dict[str, dict]:
    content = json.loads(run(monkeypatch, capsys, *arguments, "--list", "--json", "-"))
    return {entry["name"]: entry for entry in content["channels"]}


def test_a_table_is_listed(tmp_path, monkeypatch, capsys):
    lines = run(monkeypatch, capsys, table(tmp_path, "t [s],v [km/h],r"), "--list").splitlines()
    assert lines[0].split() == ["name", "unit", "Hz", "samples", "min", "max"]
    assert lines[1].split() == ["t", "[s]", "s", "100", "2000", "0", "19.99"]
    name, bracket, unit, rate, samples, low, high = lines[2].split()
    assert (name, bracket, unit, rate, samples) == ("v", "[km/h]", "km/h", "100", "2000")
    assert np.isclose(float(low), 3.6 * VX.min(), rtol=1e-4) and np.isclose(float(high), 3.6 * VX.max(), rtol=1e-4)
    assert lines[3].split()[:4] == ["r", "-", "100", "2000"]


def test_json_goes_into_a_file(tmp_path, monkeypatch, capsys):
    text = run(monkeypatch, capsys, table(tmp_path), "--list", "--json", tmp_path / "list.json")
    assert text.startswith("name")
    content = json.loads((tmp_path / "list.json").read_text())
    assert content.keys() == {"file", "channels", "unreadable", "notes", "suggestions"}
    assert content["channels"][1].keys() == {"name", "unit", "rate", "samples", "min", "max"}


def test_gaps_are_no_samples_and_lower_the_rate(tmp_path, monkeypatch, capsys):
    lines = ["t;slow;none", *[f"{t:.2f};{t if i % 5 == 0 else ''};" for i, t in enumerate(TIME[:200])]]
    file = tmp_path / "log.csv"
    file.write_text("\n".join(lines))
    found = channels(monkeypatch, capsys, file)
    assert found["slow"]["samples"] == 40
    assert np.isclose(found["slow"]["rate"], 20.0)
    assert found["none"] == {"name": "none", "unit": "", "rate": None, "samples": 0, "min": None, "max": None}


def test_the_rate_comes_from_the_mapping_or_the_option(tmp_path, monkeypatch, capsys):
    file = tmp_path / "log.csv"
    file.write_text("\n".join(["counter,v,r", *rows(fields="{t:.3f},{v:.6f},{r:.8f}")]))
    assert channels(monkeypatch, capsys, file)["v"]["rate"] is None
    assert channels(monkeypatch, capsys, file, "--rate", 50)["v"]["rate"] == 50.0
    by_map = mapping(tmp_path, "[time]\ncolumn = 'counter'\nunit = 'ms'\n[columns.vx]\ncolumn = 'v'\n")
    assert np.isclose(channels(monkeypatch, capsys, file, by_map)["v"]["rate"], 1e5)


def test_mf4_has_units_and_several_rates(tmp_path, monkeypatch, capsys):
    asammdf = needs("asammdf")
    mdf = asammdf.MDF()
    mdf.append([asammdf.Signal(3.6 * VX[::5], TIME[::5], name="v", unit="km/h")])
    mdf.append([asammdf.Signal(YAW_RATE, TIME, name="r", unit="rad/s")])
    found = channels(monkeypatch, capsys, Path(mdf.save(tmp_path / "log.mf4", overwrite=True)))
    assert found.keys() == {"v", "r"}
    assert found["v"]["unit"] == "km/h" and np.isclose(found["v"]["rate"], 20.0) and found["v"]["samples"] == 400
    assert found["r"]["unit"] == "rad/s" and np.isclose(found["r"]["rate"], 100.0)


def test_parquet_and_matlab_are_listed(tmp_path, monkeypatch, capsys):
    pyarrow, io = needs("pyarrow"), needs("scipy.io")
    from pyarrow import parquet

    schema = pyarrow.schema(
        [("time", pyarrow.float64()), pyarrow.field("v", pyarrow.float32(), metadata={"unit": "m/s"})]
    )
    parquet.write_table(pyarrow.table({"time": TIME, "v": VX}, schema), tmp_path / "log.parquet")
    io.savemat(tmp_path / "log.mat", {"log": {"time": TIME, "v": VX}})
    found = channels(monkeypatch, capsys, tmp_path / "log.parquet")["v"]
    assert found["unit"] == "m/s" and np.isclose(found["rate"], 100.0) and np.isclose(found["max"], VX.max())
    found = channels(monkeypatch, capsys, tmp_path / "log.mat")["log.v"]
    assert found["samples"] == 2000 and np.isclose(found["rate"], 100.0)


def test_the_suggested_mapping_is_printed(tmp_path, monkeypatch, capsys):
    text = run(monkeypatch, capsys, table(tmp_path, "t,Vx,yaw_rate"), "--list")
    assert "'Vx' looks like vx: CarSim's name, in km/h (the unit of CarSim)" in text
    entries = text[text.index("[time]") :]
    log = run(
        monkeypatch, capsys, table(tmp_path, "t,Vx,yaw_rate"), mapping(tmp_path, entries), "-o", tmp_path / "o.csv"
    )
    assert "2000 rows, 20.0 s, vx, yaw_rate" in log


def test_json_belongs_to_the_list(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["import_log", str(table(tmp_path)), "map.toml", "--json", "x.json"])
    with pytest.raises(SystemExit):
        main()
    assert "--json belongs to --list" in capsys.readouterr().err
