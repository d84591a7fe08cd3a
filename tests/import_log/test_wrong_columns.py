"""A wrong column in a mapping is named with the mapping's key, the nearest names and the file."""

from __future__ import annotations

import pytest
from foreign_logs import mapping, table
from import_log import ImportFailed, convert


@pytest.mark.parametrize(
    ("header", "key", "asked", "near"),
    [
        ("t,VehicleSpeed,YawRate", "columns.vx", "VehicleSped", '"VehicleSpeed"'),
        ("t,VehicleSpeed,YawRate", "columns.vx", "vehiclespeed", '"VehicleSpeed"'),
        ("t,VehicleSpeed,YawRate", "columns.vx", "Speed", '"VehicleSpeed"'),
        ("t,Speed [km/h],YawRate", "columns.vx", "speed", '"Speed [km/h]"'),
        ("t,v,YawRate", "columns.yaw_rate", "yaw_rate", '"YawRate"'),
        ("Time,v,r", "time", "time", '"Time"'),
        ("TimeStamp,v,r", "time", "t_stamp", '"TimeStamp"'),
        ("t,v,r", "columns.vx", "Geschwindigkeit", "nothing is named like it"),
    ],
)
def test_a_wrong_column_is_explained(tmp_path, header, key, asked, near):
    columns = {"time": header.split(",")[0], "columns.vx": header.split(",")[1]} | {key: asked}
    text = "".join(f'[{name}]\ncolumn = "{column}"\n' for name, column in columns.items())
    file, log = mapping(tmp_path, text), table(tmp_path, header)
    with pytest.raises(ImportFailed) as refused:
        convert(log, file, tmp_path / "out.csv")
    for words in (f'{file}: [{key}] column = "{asked}"', str(log), near, "--list"):
        assert words in str(refused.value)


def test_a_name_without_its_unit_is_enough(tmp_path):
    text = "[time]\ncolumn = 't'\n[columns.vx]\ncolumn = 'Speed'\nunit = 'km/h'\n"
    assert "2000 rows" in convert(table(tmp_path, "t,Speed [km/h],r"), mapping(tmp_path, text), tmp_path / "out.csv")
    # Of two, neither is taken.
    with pytest.raises(ImportFailed, match=r'there is "Speed \[km/h\]", "Speed \[m/s\]"'):
        convert(table(tmp_path, "t,Speed [km/h],Speed [m/s]"), mapping(tmp_path, text), tmp_path / "out.csv")
