"""Time stamps of any tool become seconds, or are refused with the column and the line."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import PLAIN, VX, YAW_RATE, close, imported, mapping, read
from import_log import ImportFailed, convert
from importing.clock import of_digits

START = datetime(2024, 4, 30, 23, 59, 59, tzinfo=timezone.utc)  # midnight and a month's end are passed


def ms(when: datetime, digits: int = 3) -> str:
    return f"{when.microsecond // 10 ** (6 - digits):0{digits}}"


def unix(factor: int):
    return lambda when: str(
        round((when - datetime(1970, 1, 1, tzinfo=timezone.utc)) / timedelta(microseconds=1)) * factor
    )


STAMPS = {
    "ISO 8601": lambda when: when.strftime("%Y-%m-%dT%H:%M:%S.") + ms(when),
    "ISO 8601, whole seconds without a fraction": lambda when: when.replace(tzinfo=None).isoformat(),
    "ISO 8601 with Z": lambda when: when.strftime("%Y-%m-%dT%H:%M:%S.") + ms(when) + "Z",
    "ISO 8601 in a zone": lambda when: when.astimezone(timezone(timedelta(hours=5, minutes=30))).isoformat(),
    "ISO 8601 across zones": lambda when: when.astimezone(timezone(timedelta(hours=when.second % 2))).isoformat(),
    "blank between": lambda when: when.strftime("%Y-%m-%d %H:%M:%S.%f"),
    "basic ISO": lambda when: when.strftime("%Y%m%dT%H%M%S.") + ms(when),
    "underscores": lambda when: when.strftime("%Y_%m_%d_%H_%M_%S_") + ms(when),
    "underscores, microseconds": lambda when: when.strftime("%Y_%m_%d_%H_%M_%S_%f"),
    "one underscore": lambda when: when.strftime("%Y%m%d_%H%M%S_") + ms(when),
    "digits alone": lambda when: when.strftime("%Y%m%d%H%M%S") + ms(when),
    "slashes": lambda when: when.strftime("%Y/%m/%d %H:%M:%S.") + ms(when),
    "German": lambda when: when.strftime("%d.%m.%Y %H:%M:%S.") + ms(when),
    "American": lambda when: when.strftime("%m/%d/%Y %I:%M:%S.") + ms(when) + when.strftime(" %p"),
    "MATLAB": lambda when: when.strftime("%d-%b-%Y %H:%M:%S.") + ms(when),
    "capital letters": lambda when: when.strftime("%d %b %Y %H:%M:%S.").upper() + ms(when),
    "time of day": lambda when: when.strftime("%H:%M:%S.") + ms(when),
    "time of day, colon before milliseconds": lambda when: when.strftime("%H:%M:%S:") + ms(when),
    "Unix ms": lambda when: unix(1)(when)[:-3],
    "Unix us": unix(1),
    "Unix ns": unix(1000),
    "Unix s": lambda when: f"{when.timestamp():.3f}",
}


def stamped(tmp_path: Path, stamp, name: str = "t", quoted: bool = False) -> Path:
    file = tmp_path / "log.csv"
    lines = [f"{name},v,r"]
    for i in range(300):
        text = stamp(START + timedelta(milliseconds=10 * i))
        lines.append(
            f'"{text}",{3.6 * VX[i]:.6f},{YAW_RATE[i]:.8f}' if quoted else f"{text},{3.6 * VX[i]:.6f},{YAW_RATE[i]:.8f}"
        )
    file.write_text("\n".join(lines) + "\n")
    return file


@pytest.mark.parametrize("quoted", [False, True])
@pytest.mark.parametrize("kind", STAMPS)
def test_a_time_stamp_is_read(tmp_path, kind, quoted):
    columns = imported(stamped(tmp_path, STAMPS[kind], quoted=quoted), mapping(tmp_path, PLAIN), tmp_path)
    assert len(columns["time"]) == 300
    assert np.allclose(np.diff(columns["time"]), 0.01, atol=1e-6)
    close(columns, vx=VX, yaw_rate=YAW_RATE)


def test_a_decimal_comma_in_time_stamps_is_read(tmp_path):
    file = stamped(tmp_path, lambda when: when.strftime("%Y-%m-%dT%H:%M:%S.") + ms(when))
    text = file.read_text().replace(",", ";").replace(".", ",")
    file.write_text(text)
    close(imported(file, mapping(tmp_path, PLAIN), tmp_path), vx=VX)


def test_a_stop_watch_is_read(tmp_path):
    def watch(when: datetime) -> str:
        passed = (when - START).total_seconds() + 59.0
        return f"{int(passed // 60):02}:{passed % 60:06.3f}"

    close(imported(stamped(tmp_path, watch), mapping(tmp_path, PLAIN), tmp_path), vx=VX)


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
@pytest.mark.parametrize("place", ["mapping", "header"])
def test_a_unit_of_time_is_taken(tmp_path, unit, place):
    per_second = {"s": 1, "ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
    name = f"t [{unit}]" if place == "header" else "t"
    file = stamped(tmp_path, lambda when: f"{(when - START).total_seconds() * per_second:.3f}", name)
    text = PLAIN if place == "header" else PLAIN.replace('"t"', f'"t"\nunit = "{unit}"')
    columns = imported(file, mapping(tmp_path, text), tmp_path)
    close(columns, vx=VX)
    assert np.isclose(columns["time"][-1], 2.99)


def test_days_of_a_spreadsheet_are_read(tmp_path):
    file = stamped(tmp_path, lambda when: f"{45413.5 + (when - START) / timedelta(days=1):.10f}")
    columns = imported(file, mapping(tmp_path, PLAIN), tmp_path)
    close(columns, vx=VX)
    assert np.isclose(columns["time"][-1], 2.99, atol=1e-4)


DIGITS = {
    "a minute": "16:22:58.5",
    "an hour, which has no digits before": "00:59:58.5",
    "an hour": "09:59:58.5",
    "midnight": "23:59:58.5",
}


def digits(start: str, step: float, count: int = 300) -> list[str]:
    """Times of day as VBOX and NMEA write them."""
    begin = datetime.strptime(start, "%H:%M:%S.%f")
    return [(begin + timedelta(seconds=step * i)).strftime("%H%M%S.%f")[:-4] for i in range(count)]


@pytest.mark.parametrize("name", ["t", "t [s]"])
@pytest.mark.parametrize("start", DIGITS.values(), ids=DIGITS)
@pytest.mark.parametrize("step", [0.01, 0.05, 1.0])
def test_times_of_day_in_digits_are_read(tmp_path, start, step, name):
    file = tmp_path / "log.csv"
    body = [f"{t},{3.6 * v:.6f},{r:.8f}" for t, v, r in zip(digits(start, step), VX, YAW_RATE)]
    del body[100:120]  # a hole in the log
    file.write_text("\n".join([f"{name},v,r", *body]) + "\n")
    said = convert(file, mapping(tmp_path, PLAIN), tmp_path / "out.csv")
    assert "times of day, HHMMSS" in said and ("the header says s" in said) == (name != "t")
    time = read(tmp_path / "out.csv")["time"]
    assert np.isclose(time[-1], 299 * step) and np.isclose(np.diff(time).max(), 21 * step)
    said = convert(file, mapping(tmp_path, PLAIN.replace('"t"', '"t"\nunit = "s"')), tmp_path / "out.csv")
    assert "(the mapping says s)" in said


@pytest.mark.parametrize(
    "time",
    [
        np.arange(0, 3000.0, 10),  # 10 s, or ms without their unit
        np.arange(0, 15_000.0, 50),
        np.arange(0, 5900.0, 100),
        np.arange(0, 59.0, 0.2),  # within a minute both are the same
        np.arange(120_000.0, 120_300.0),
        np.concatenate([np.arange(0, 50, 0.2), np.arange(107.0, 150, 0.2)]),  # seconds with a hole
        np.concatenate([np.arange(0, 60, 0.2), np.arange(100.0, 170, 0.2)]),  # one second too many for a minute
    ],
)
def test_other_numbers_are_no_times_of_day(time):
    assert of_digits(time) is None


def test_one_wrong_time_costs_one_row(tmp_path):
    file = stamped(tmp_path, lambda when: "x" if when.microsecond == 500_000 and when.second == 0 else unix(1)(when))
    said = convert(file, mapping(tmp_path, PLAIN), tmp_path / "out.csv")
    assert "299 rows" in said and "'x' in line" in said


def test_a_unit_that_is_missing_is_asked_for(tmp_path):
    file = stamped(tmp_path, lambda when: f"{(when - START).total_seconds() * 1e3:.3f}")
    assert "rows of 't' are 10 s apart: is its unit right?" in convert(
        file, mapping(tmp_path, PLAIN), tmp_path / "out.csv"
    )


@pytest.mark.parametrize(
    ("stamp", "words"),
    [
        # Milliseconds without leading zeros look like fractions of a second.
        (lambda when: when.strftime("%Y_%m_%d_%H_%M_%S_") + str(when.microsecond // 1000), "cannot be told apart"),
        (lambda when: "1_7" + str(when.microsecond), "neither a number nor a time stamp"),
        (lambda when: f"lap {when.second}", "neither a number nor a time stamp"),
        (lambda when: when.strftime("2024-13-%dT%H:%M:%S.%f"), "there is no day 2024-13"),
        (
            lambda when: when.strftime("%Y-%m-%dT%H:%M:%S.%f") + ("Z" if when.second else ""),
            "time zone and others have none",
        ),
        (lambda when: when.strftime("%Y-%m-%dT%H:%M:%S"), "most of its time stamps repeat.*--rate HZ"),
        (lambda when: when.strftime("%H:%M:%S.%f") if when.second else "0.5", "is no number, and others are"),
    ],
)
def test_a_time_that_cannot_be_told_is_refused(tmp_path, stamp, words):
    with pytest.raises(ImportFailed, match=rf"\[time\] column = ['\"]t['\"].*{words}"):
        convert(stamped(tmp_path, stamp), mapping(tmp_path, PLAIN), tmp_path / "out.csv")


def test_a_little_disorder_is_sorted_and_said(tmp_path):
    file = stamped(tmp_path, lambda when: f"{(when - START).total_seconds():.3f}")
    lines = file.read_text().splitlines()
    lines[20], lines[21] = lines[21], lines[20]
    file.write_text("\n".join(lines))
    assert "rows are sorted by time" in convert(file, mapping(tmp_path, PLAIN), tmp_path / "out.csv")
