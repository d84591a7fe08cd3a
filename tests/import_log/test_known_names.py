"""Names of other tools are suggested with their unit; a steering wheel's angle is never taken for the road wheels'."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import AY, STEER, TIME, VX, YAW_RATE, close, imported, mapping, needs
from import_log import ImportFailed, convert, open_log, vocabulary
from importing.known_names import KNOWN, is_steering_wheel, known_name, snippet, suggestions
from importing.units import UNITS

DEGREE = np.degrees(1.0)
TOOLS = {
    "CarSim": {"Vx": 3.6 * VX, "AVz": DEGREE * YAW_RATE, "Ay": AY / 9.80665, "Steer_SW": 16 * DEGREE * STEER},
    "CarMaker": {"Car.vx": VX, "Car.YawRate": YAW_RATE, "Car.ay": AY, "Steer.WhlAng": 16 * STEER},
    "comma.ai": {"carState.vEgo": VX, "carState.yawRate": YAW_RATE, "carState.steeringAngleDeg": 16 * DEGREE * STEER},
    "comma.ai, flattened": {
        "/carState/vEgo": VX,
        "/carState/yawRate": YAW_RATE,
        "/carState/steeringAngleDeg": 16 * DEGREE * STEER,
    },
    "Autoware": {
        "/vehicle/status/velocity_status/longitudinal_velocity": VX,
        "/vehicle/status/velocity_status/heading_rate": YAW_RATE,
        "/vehicle/status/steering_status/steering_tire_angle": STEER,
    },
}  # fmt: skip


def log_of(tmp_path: Path, columns: dict[str, np.ndarray]) -> Path:
    file = tmp_path / "log.csv"
    np.savetxt(
        file, np.column_stack([TIME, *columns.values()]), "%.9g", ",", header="t," + ",".join(columns), comments=""
    )
    return file


@pytest.mark.parametrize("tool", TOOLS)
def test_the_suggested_entries_read_the_log(tmp_path, tool):
    file = log_of(tmp_path, TOOLS[tool])
    found = suggestions(open_log(file), vocabulary())
    assert {suggestion.tool for suggestion in found} == {tool.split(",")[0]}
    text = '[time]\ncolumn = "t"\n' + snippet(found)
    if "WHEEL" in " ".join(suggestion.words() for suggestion in found):
        # The ratio is the user's to give: without it the entry is no TOML.
        with pytest.raises(ImportFailed):
            convert(file, mapping(tmp_path, text), tmp_path / "out.csv")
        text = text.replace("factor = ?", "factor = 0.0625")
    close(imported(file, mapping(tmp_path, text), tmp_path), vx=VX, yaw_rate=YAW_RATE, steer=STEER)


def test_what_the_mapping_lacks_is_suggested_and_not_taken(tmp_path):
    file = log_of(tmp_path, TOOLS["CarSim"])
    text = "[time]\ncolumn = 't'\n[columns.vx]\ncolumn = 'Vx'\nunit = 'km/h'\n"
    said = convert(file, mapping(tmp_path, text), tmp_path / "out.csv")
    assert "not in the mapping: 'AVz' looks like yaw_rate: CarSim's name, in deg/s (the unit of CarSim)" in said
    assert '[columns.yaw_rate]  # CarSim\n    column = "AVz"\n    unit = "deg/s"' in said
    assert "'Vx' looks" not in said
    assert (tmp_path / "out.csv").read_text().splitlines()[0] == "time,vx"


def test_the_files_own_unit_wins(tmp_path):
    (suggestion,) = suggestions(open_log(log_of(tmp_path, {"Vx [m/s]": VX})), vocabulary())
    assert suggestion.unit == "m/s" and suggestion.by_file and "as the file says" in suggestion.words()


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_a_unit_of_mf4_wins(tmp_path, version):
    asammdf = needs("asammdf")
    mdf = asammdf.MDF(version=version)
    mdf.append([asammdf.Signal(VX, TIME, name="Vx", unit="m/s")])
    mdf.append([asammdf.Signal(YAW_RATE, TIME, name="Car.YawRate", unit="rad/s")])
    file = Path(mdf.save(tmp_path / "log.mf4", overwrite=True))
    text = "[columns.yaw_rate]\ncolumn = 'Car.YawRate'\n"
    said = convert(file, mapping(tmp_path, text), tmp_path / "out.csv")
    assert "'Vx' looks like vx: CarSim's name, in m/s (as the file says)" in said


@pytest.mark.parametrize(
    ("name", "signal", "wheel"),
    [
        ("log.Vx", "vx", False),
        ("Steer_SW", "steer", True),
        ("Steer_L1", "steer", False),
        ("DM.Steer.Ang", "steer_cmd", True),
        ("/vehicle/status/steering_status:steering_tire_angle", "steer", False),
        ("/vehicle/status/velocity_status:lateral_velocity", "vy", False),
        ("/localization/kinematic_state:pose.pose.orientation", "yaw", False),
        ("carControl.actuators.steeringAngleDeg", "steer_cmd", True),
    ],
)
def test_a_known_name(name, signal, wheel):
    found = known_name(name)
    assert (found.signal, found.wheel) == (signal, wheel)


@pytest.mark.parametrize("name", ["vx_target", "MyVx", "Yaw_Target", "AVx", "speed", "vEgo_raw"])
def test_a_name_that_is_only_alike_is_not_suggested(name):
    assert known_name(name) is None


@pytest.mark.parametrize(
    "name", ["SteeringWheelAngle", "steering_wheel_angle", "Lenkradwinkel", "SteerWheel [deg]", "HandWheelAngle"]
)
def test_a_steering_wheel_needs_its_ratio(tmp_path, name):
    assert is_steering_wheel(name)
    file = log_of(tmp_path, {name: 16 * STEER})
    text = f"[time]\ncolumn = 't'\n[columns.steer]\ncolumn = '{name}'\n"
    with pytest.raises(
        ImportFailed, match=re.escape(f'[columns.steer] column = "{name}"') + ".*factor = 1 / steering ratio"
    ):
        convert(file, mapping(tmp_path, text), tmp_path / "out.csv")
    close(imported(file, mapping(tmp_path, text + "unit = 'rad'\nfactor = 0.0625\n"), tmp_path), steer=STEER)


@pytest.mark.parametrize("name", ["RoadWheelAngle", "steering_tire_angle", "SteerAngle", "delta_f", "FrontWheelSteer"])
def test_a_road_wheel_needs_none(name):
    assert not is_steering_wheel(name)


def test_the_table_is_sound():
    assert len({known.name for known in KNOWN}) == len(KNOWN)
    for known in KNOWN:
        assert known.signal in vocabulary() and known.unit in UNITS
