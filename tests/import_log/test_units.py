"""Units of columns: what the file or the mapping says is converted, or refused with the column and what is needed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_logs import TIME, VX, YAW_RATE, close, imported, mapping, needs, table
from import_log import ImportFailed, convert
from importing.mapping import signal_units, vocabulary

PLAIN = "[time]\ncolumn = 't'\n[columns.vx]\ncolumn = 'v'\nunit = 'km/h'\n[columns.yaw_rate]\ncolumn = 'r'\n"
RATES = {
    "cdeg/s": 100 * np.degrees(1), "0.01deg/s": 100 * np.degrees(1), "0.01 °/s": 100 * np.degrees(1),
    "mrad/s": 1e3, "rpm": 30 / np.pi, "deg s⁻¹": np.degrees(1),
}  # fmt: skip


def log(tmp_path: Path, names: str, rate: np.ndarray = YAW_RATE, units: str = "") -> Path:
    """The drive with a column of the yaw rate in some unit."""
    file = tmp_path / "log.csv"
    body = [f"{t:.3f},{3.6 * v:.6f},{r:.9g}" for t, v, r in zip(TIME, VX, rate)]
    file.write_text("\n".join([names, *([units] if units else []), *body]) + "\n", encoding="utf-8")
    return file


@pytest.mark.parametrize("unit", RATES)
@pytest.mark.parametrize("place", ["[]", "()", "row", "mapping"])
def test_a_unit_of_a_rate_is_converted(tmp_path, unit, place):
    names, units, text = "t,v,r", "", PLAIN
    if place == "row":
        units = f"s,km/h,{unit}"
    elif place == "mapping":
        text += f"unit = '{unit}'\n"
    else:
        names = f"t,v,r {place[0]}{unit}{place[1]}"
    close(
        imported(log(tmp_path, names, RATES[unit] * YAW_RATE, units), mapping(tmp_path, text), tmp_path),
        yaw_rate=YAW_RATE,
    )


@pytest.mark.parametrize(
    ("names", "units", "unit"),
    [
        ("t,v,r [1/s]", "", "1/s"),
        ("t,v,r [deg/s²]", "", "deg/s²"),
        ("t,v,r (furlong/h)", "", "furlong/h"),
        ("t,v,r [Nm]", "", "Nm"),
        ("t,v,r [0.1 deg/s]", "", "0.1 deg/s"),
        ("t,v,r", "s,km/h,furlong", "furlong"),
    ],
)
def test_a_unit_that_is_not_known_is_refused_without_one_of_the_mapping(tmp_path, names, units, unit):
    file = log(tmp_path, names, units=units)
    with pytest.raises(ImportFailed) as refused:
        convert(file, mapping(tmp_path, PLAIN), tmp_path / "out.csv")
    for words in ("[columns.yaw_rate]", f"is in '{unit}', as the file says", "rad/s, mrad/s, deg/s", str(file)):
        assert words in str(refused.value)
    said = convert(file, mapping(tmp_path, PLAIN + "unit = 'rad/s'\n"), tmp_path / "out.csv")
    assert f"is in {unit}; the mapping's rad/s is taken" in said
    # Columns that the mapping leaves alone may have any unit.
    convert(file, mapping(tmp_path, PLAIN.partition("[columns.yaw_rate]")[0]), tmp_path / "out.csv")


def test_a_unit_of_mf4_that_is_not_known_is_refused(tmp_path):
    asammdf = needs("asammdf")
    mdf = asammdf.MDF()
    mdf.append([asammdf.Signal(YAW_RATE, TIME, name="r", unit="Unit_X")])
    file = Path(mdf.save(tmp_path / "log.mf4", overwrite=True))
    with pytest.raises(ImportFailed, match=r"columns.yaw_rate\]: 'r' is in 'Unit_X', as the file says"):
        convert(file, mapping(tmp_path, "[columns.yaw_rate]\ncolumn = 'r'\n"), tmp_path / "out.csv")


@pytest.mark.parametrize("word", ["[GPS]", "(filtered)", "[FL]", "[A]", "[furlong]"])
def test_brackets_that_may_be_no_unit_are_noted(tmp_path, word):
    file = log(tmp_path, f"t,v,r {word}")
    text = PLAIN.replace("'r'", f"'r {word}'")
    said = convert(file, mapping(tmp_path, text), tmp_path / "out.csv")
    assert f"columns.yaw_rate: {word} of 'r {word}' is taken for a part of the name, and the numbers as rad/s" in said
    assert "part of the name" not in convert(file, mapping(tmp_path, text + "unit = 'rad/s'\n"), tmp_path / "out.csv")


@pytest.mark.parametrize("name", ["r[0]", "r(:,2)", "r []", "r [-]", "r [rad/s]"])
def test_an_index_and_no_unit_are_neither_refused_nor_noted(tmp_path, name):
    file = log(tmp_path, f"t;v;{name}")
    file.write_text(file.read_text().replace(",", ";").replace("(:;2)", "(:,2)"))
    text = PLAIN.replace("'r'", f"'{name}'")
    columns = imported(file, mapping(tmp_path, text), tmp_path)
    close(columns, yaw_rate=YAW_RATE)
    assert "columns.yaw_rate" not in convert(file, mapping(tmp_path, text), tmp_path / "out.csv")


def test_a_unit_with_a_remark_is_taken(tmp_path):
    file = log(tmp_path, "t,v,r [deg/s (IMU)]", np.degrees(YAW_RATE))
    close(imported(file, mapping(tmp_path, PLAIN), tmp_path), yaw_rate=YAW_RATE)


def test_a_unit_beside_a_word_in_brackets_counts(tmp_path):
    file = log(tmp_path, "t,v,r [IMU]", np.degrees(YAW_RATE), "s,km/h,deg/s")
    close(imported(file, mapping(tmp_path, PLAIN), tmp_path), yaw_rate=YAW_RATE)


@pytest.mark.parametrize(
    ("signal", "unit", "needed"),
    [("vx", "deg", "m/s"), ("vx", "s", "m/s"), ("vx", "%", "m/s"), ("steer_cmd", "m", "rad"), ("ay", "m/s", "m/s2"),
     ("yaw_rate", "deg", "rad/s"), ("yaw", "rad/s", "rad"), ("curvature", "m", "1/m")],
)  # fmt: skip
@pytest.mark.parametrize("place", ["mapping", "file"])
def test_a_unit_of_another_quantity_is_refused(tmp_path, signal, unit, needed, place):
    file = table(tmp_path, f"t,v,r [{unit}]" if place == "file" else "t,v,r")
    text = f"[time]\ncolumn = 't'\n[columns.{signal}]\ncolumn = 'r'\n" + (
        f"unit = '{unit}'\n" if place == "mapping" else ""
    )
    with pytest.raises(ImportFailed) as refused:
        convert(file, mapping(tmp_path, text), tmp_path / "out.csv")
    for words in (f"[columns.{signal}]", f"is in {unit}, as the {place} says, and {signal} is in {needed}", str(file)):
        assert words in str(refused.value)
    if place == "file":
        # The mapping's unit counts, also where the factors are the same.
        said = convert(file, mapping(tmp_path, text + f"unit = '{needed}'\n"), tmp_path / "out.csv")
        assert f"is in {unit}; the mapping's {needed} is taken" in said


def test_a_factor_may_make_another_quantity(tmp_path):
    # Wheel speed and radius.
    file = log(tmp_path, "t,v,w", VX / 0.3 * 30 / np.pi)
    text = "[time]\ncolumn = 't'\n[columns.vx]\ncolumn = 'w'\nunit = 'rpm'\nfactor = 0.3\n"
    close(imported(file, mapping(tmp_path, text), tmp_path), vx=VX)
    said = convert(file, mapping(tmp_path, text), tmp_path / "out.csv")
    assert "'w' is in rpm, as the mapping says, and vx is in m/s: the factor is taken" in said


def test_a_grade_in_per_cent_is_an_angle(tmp_path):
    file = log(tmp_path, "t,v,grade [%]", 100 * YAW_RATE)
    columns = imported(file, mapping(tmp_path, "[time]\ncolumn = 't'\n[columns.grade]\ncolumn = 'grade'\n"), tmp_path)
    close(columns, grade=YAW_RATE)


PLACES = "[time]\ncolumn = 't'\n[columns.x]\ncolumn = 'lon'\n{x}\n[columns.y]\ncolumn = 'lat'\n{y}\n"


@pytest.mark.parametrize(
    ("names", "unit"), [("t,lon,lat", ""), ("t,lon [deg],lat [deg]", ""), ("t,lon,lat", "unit = 'deg'")]
)
def test_latitude_and_longitude_are_no_place_in_a_plane(tmp_path, names, unit):
    # A drive on a circle of 100 m at 48 degrees north.
    east, north = 100 * np.sin(0.1 * TIME), 100 * np.cos(0.1 * TIME)
    lat, lon = 48 + north / 111_200, 11 + east / 74_600
    file = tmp_path / "log.csv"
    file.write_text(names + "\n" + "\n".join(f"{t:.2f},{x:.9f},{y:.9f}" for t, x, y in zip(TIME, lon, lat)) + "\n")
    with pytest.raises(
        ImportFailed, match=r"columns.x\].*metres in a plane.*latitude and longitude\? Give metres to the east"
    ):
        convert(file, mapping(tmp_path, PLACES.format(x=unit, y=unit)), tmp_path / "out.csv")
    # As docs/import.md has it.
    entry = "unit = 'deg'\nfactor = {0}\noffset = {1}"
    across = 6_371_000 * np.cos(np.radians(48))
    text = PLACES.format(
        x=entry.format(across, -across * np.radians(11)), y=entry.format(6_371_000, -6_371_000 * np.radians(48))
    )
    columns = imported(file, mapping(tmp_path, text), tmp_path)
    assert np.abs(columns["x"] - east).max() < 1.0 and np.abs(columns["y"] - north).max() < 1.0
    # Named so, and in metres.
    convert(
        log(tmp_path, "t,lon,lat"), mapping(tmp_path, PLACES.format(x="unit='m'", y="unit='m'")), tmp_path / "out.csv"
    )


@pytest.mark.parametrize(
    ("name", "words"), [("t [rad]", r"column = 't \[rad\]': it is in 'rad'"), ("t [1/s]", "'1/s'")]
)
def test_a_clock_in_no_unit_of_time_is_refused(tmp_path, name, words):
    file = log(tmp_path, f"{name},v,r")
    with pytest.raises(ImportFailed, match=rf"\[time\] .*{words}.*write unit in \[time\] \(s, ms"):
        convert(file, mapping(tmp_path, PLAIN), tmp_path / "out.csv")
    text = PLAIN.replace("'t'", "'t'\nunit = 's'")
    close(imported(file, mapping(tmp_path, text), tmp_path), yaw_rate=YAW_RATE)


def test_a_word_beside_a_clock_is_noted(tmp_path):
    said = convert(log(tmp_path, "t [UTC],v,r"), mapping(tmp_path, PLAIN), tmp_path / "out.csv")
    assert "time 't [UTC]': [UTC] is taken for a part of the name, and the numbers as s" in said


def test_signals_have_the_units_of_the_program():
    units = signal_units()
    assert list(units) == vocabulary()
    assert (units["time"], units["steer"], units["curvature_rate"], units["friction"]) == ("s", "rad", "1/m2", "1")
