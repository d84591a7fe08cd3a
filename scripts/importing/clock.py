"""Time stamps as seconds: numbers with a unit, Unix times, ISO 8601, dates with other separators, times of day."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterable
from datetime import date

import numpy as np

from importing.log import ImportFailed
from importing.units import TIMES, UNITS, bracketed, unit_of

DAY = 86_400 * 10**9  # ns

# Figures are ASCII, as in numbers; blanks may be hard or thin.
_BLANK = r"[\s\xa0\u2009\u202f]"


def _form(pattern: str) -> re.Pattern:
    return re.compile(pattern, re.ASCII)


_ZONE = rf"(?:{_BLANK}*(?P<zone>Z|UTC|GMT|[+-]\d\d:?\d\d|[+-]\d\d))?"
_CLOCK = r"(?P<h>\d{1,2})[:_.hH-](?P<min>\d{1,2})(?:[:_.m-](?P<s>\d{1,2})(?:(?P<point>[.,:_-])(?P<frac>\d{1,9}))?)?"
_NOON = rf"(?:{_BLANK}*(?P<noon>[AaPp][Mm]))?"
_BETWEEN = rf"(?:{_BLANK}*T|{_BLANK}+|_|-|/|:|,{_BLANK}*)"
_YMD = r"(?P<a>\d{4})(?P<sep>[-_/.:])(?P<b>\d{1,2})(?P=sep)(?P<c>\d{1,2})"
_DMY = r"(?P<a>\d{1,2})(?P<sep>[-_/.])(?P<b>\d{1,2})(?P=sep)(?P<c>\d{4})"
# The month in English: 01-May-2024 of MATLAB, May 1, 2024.
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_MONTH = (
    r"(?P<b>(?i:jan(?:uary)?|feb(?:ruary)?|mar(?:ch)?|apr(?:il)?|may|june?|july?|aug(?:ust)?|sept?(?:ember)?|"
    r"oct(?:ober)?|nov(?:ember)?|dec(?:ember)?))\.?"
)
_FORMS = [
    _form(f"{_YMD}{_BETWEEN}{_CLOCK}{_NOON}{_ZONE}"),
    _form(f"{_DMY}{_BETWEEN}{_CLOCK}{_NOON}{_ZONE}"),
    # 20240423T133700.020, 20240423_133700_020, 20240423133700020
    _form(
        r"(?P<a>(?:19|20)\d\d)(?P<b>\d\d)(?P<c>\d\d)[T_ -]?(?P<h>\d\d)(?P<min>\d\d)(?P<s>\d\d)"
        rf"(?:(?P<point>[.,_-]?)(?P<frac>\d{{1,9}}))?{_ZONE}"
    ),
    _form(r"(?P<h>\d{1,2}):(?P<min>\d\d):(?P<s>\d\d)(?:(?P<point>[.,:])(?P<frac>\d{1,9}))?" + _NOON),
    _form(
        rf"(?P<c>\d{{1,2}})(?:[-/.]|{_BLANK}+){_MONTH}(?:[-/.]|{_BLANK}+)(?P<a>\d{{4}}){_BETWEEN}{_CLOCK}{_NOON}{_ZONE}"
    ),
    _form(rf"{_MONTH}{_BLANK}+(?P<c>\d{{1,2}}),?{_BLANK}+(?P<a>\d{{4}}){_BETWEEN}{_CLOCK}{_NOON}{_ZONE}"),
    # Stop watches: minutes and seconds.
    _form(r"(?P<min>\d{1,3}):(?P<s>\d\d)(?P<point>[.,])(?P<frac>\d{1,9})"),
]
_COMPACT = _form(
    r"(?:19|20)\d\d(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])(?:[01]\d|2[0-3])[0-5]\d[0-5]\d(?:\d{3}|\d{6}|\.\d+)?"
)


def is_stamp(text: str) -> bool:
    """Whether a field is a time stamp in words rather than a number."""
    return any(form.fullmatch(text) for form in _FORMS[:2] + _FORMS[3:]) or (
        _FORMS[2].fullmatch(text) is not None and (not text.isdigit() or is_compact(text))
    )


def is_compact(text: str) -> bool:
    """Whether digits alone are a date and a time: 20240423133700020. As a number they would lose the milliseconds."""
    return len(text) >= 14 and text[:14].isdigit() and _COMPACT.fullmatch(text) is not None


def of_stamps(texts: Iterable[str], where: str, lines: Iterable[int]) -> np.ndarray:
    """Seconds since the first stamp. `where` names the column, `lines` has the line of each stamp.

    Of each stamp two numbers are kept: the time of day, and which of the dates it has.
    """
    form = first = opening = None
    dates: dict[tuple, int] = {}
    zones: set[bool] = set()
    widths: set[int] = set()
    of_day, date_of = array("q"), array("q")
    for text, line in zip(texts, lines):
        if form is None:
            first, form = text, next((form for form in _FORMS if form.fullmatch(text)), None)
        if form is None:
            raise ImportFailed(
                f"{where}: '{text}' in line {line} is neither a number nor a time stamp that is known "
                "(ISO 8601, dates with - / . _ between or an English month, times of day)"
            )
        match = form.fullmatch(text)
        if match is None:
            raise ImportFailed(f"{where}: '{text}' in line {line} is written otherwise than '{first}'")
        m = match.groupdict()
        opening = opening or m
        if m.get("frac"):
            widths.add(len(m["frac"]))
        zones.add(bool(m.get("zone")))
        date_of.append(dates.setdefault((m.get("a"), m.get("b"), m.get("c")), len(dates)))
        of_day.append(time_of_day(m, where))
    check_fractions(opening, widths, where, first)
    month_first = day_first(set(dates), form, where, opening)
    days = np.array([day_of(key, month_first, where) for key in dates], dtype="int64")
    if len(zones) > 1:
        raise ImportFailed(f"{where}: some time stamps have a time zone and others have none")
    times = days[np.frombuffer(date_of, "int64")] * DAY + np.frombuffer(of_day, "int64")
    if "a" not in form.groupindex:
        # A time of day starts anew at midnight.
        times = times + DAY * np.concatenate([[0], np.cumsum(np.diff(times) < -DAY // 2)])
    return (times - times[0]) * 1e-9


def check_fractions(opening: dict, widths: set[int], where: str, first: str) -> None:
    """Refuses `12_00_00_5` beside `12_00_00_20`: a counter of milliseconds or a decimal fraction cannot be told."""
    if opening.get("point") not in (".", ",", None, "") and len(widths) > 1:
        raise ImportFailed(
            f"{where}: the last figure of time stamps like '{first}' has {min(widths)} to {max(widths)} digits; "
            "milliseconds and fractions of a second cannot be told apart"
        )


def day_first(dates: set, form: re.Pattern, where: str, first: dict) -> bool:
    """For dates with the year last: whether the month comes first. It matters only if the day changes."""
    if form is not _FORMS[1]:
        return False
    if any(int(b) > 12 for _, b, _ in dates):
        return True
    if any(int(a) > 12 for a, _, _ in dates) or first["sep"] == "." or len(dates) == 1:
        return False
    days, months = {a for a, _, _ in dates}, {b for _, b, _ in dates}
    if len(days) > 1 and len(months) > 1:
        raise ImportFailed(f"{where}: day and month of dates like '{first['a']}/{first['b']}' cannot be told apart")
    return len(months) > 1


def day_of(key: tuple, month_first: bool, where: str) -> int:
    a, b, c = key
    if a is None:
        return 0
    year, month, day = (a, b, c) if len(a) == 4 else (c, a, b) if month_first else (c, b, a)
    if month[:3].lower() in _MONTHS:
        month = _MONTHS.index(month[:3].lower()) + 1
    try:
        return (date(int(year), int(month), int(day)) - date(1970, 1, 1)).days
    except ValueError as error:
        raise ImportFailed(f"{where}: there is no day {year}-{month}-{day}") from error


def time_of_day(m: dict, where: str) -> int:
    """Nanoseconds since midnight, in UTC where the stamp has a zone."""
    hour, minute, second = int(m.get("h") or 0), int(m["min"]), int(m.get("s") or 0)
    if noon := m.get("noon"):
        hour = hour % 12 + (12 if noon.lower() == "pm" else 0)
    if hour > 24 or second > 60 or ("h" in m and minute > 59):
        raise ImportFailed(f"{where}: there is no time {hour:02}:{minute:02}:{second:02}")
    total = ((hour * 60 + minute) * 60 + second) * 10**9 + int((m.get("frac") or "0").ljust(9, "0"))
    zone = m.get("zone") or ""
    if zone[:1] in ("+", "-"):
        digits = zone[1:].replace(":", "").ljust(4, "0")
        ahead = (int(digits[:2]) * 60 + int(digits[2:])) * 60 * 10**9
        total -= ahead if zone[0] == "+" else -ahead
    return total


# Unix times of 2001 to 2100, by what they count.
_UNIX = {"s": (1e9, 4.2e9), "ms": (1e12, 4.2e12), "us": (1e15, 4.2e15), "ns": (1e18, 4.2e18)}


def unix_unit(values: np.ndarray) -> str | None:
    """What a Unix time counts; None if the numbers are none."""
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return None
    return next((u for u, (low, high) in _UNIX.items() if low <= known.min() and known.max() < high), None)


def is_days(values: np.ndarray) -> bool:
    """Whether numbers are a spreadsheet's days since 1900, of 1982 to 2064: no log has a sample each microsecond."""
    known = values[np.isfinite(values)]
    if len(known) < 2 or known.min() < 30_000 or known.max() > 60_000:
        return False
    return 0 < float(np.median(np.diff(known))) < 2e-5


def of_digits(values: np.ndarray) -> np.ndarray | None:
    """Seconds of times of day that are written as numbers, HHMMSS.ss, as VBOX and NMEA do; None for other numbers.

    Within a minute both are the same. At a full minute such numbers jump by 40 s more than the clock, at an hour by
    4040 s. They are taken for times of day only if the clock goes on evenly then, and no field is above 60.
    """
    known = np.flatnonzero(np.isfinite(values))
    digits = values[known]
    if len(digits) < 3 or digits.min() < 0 or digits.max() >= 240_000:
        return None
    minutes, second = np.floor(digits / 100), digits % 100
    if (second > 60).any() or (minutes % 100 >= 60).any():
        return None
    seconds = (np.floor(minutes / 100) * 60 + minutes % 100) * 60 + second
    seconds += 86_400 * np.concatenate([[0], np.cumsum(np.diff(seconds) < -43_200)])
    steps, turns = np.diff(seconds), np.diff(minutes) != 0
    within = steps[~turns & (steps > 0)]
    if len(within) == 0 or not turns.any() or not 0.5 < np.median(steps[turns]) / np.median(within) < 3:
        return None
    times = np.full(len(values), np.nan)
    times[known] = seconds - seconds[0]
    return times


def of_numbers(values: np.ndarray, given: str | None, stated: str, name: str) -> tuple[np.ndarray, str]:
    """Seconds of a column's numbers, and a note on a unit that the mapping does not give; `stated` is the file's."""
    unit, note = given, ""
    by_file = unit_of(stated)
    unix = unix_unit(values)
    if given in (None, "s") and by_file in (None, "1", "s") and (times := of_digits(values)) is not None:
        said_by = "mapping" if given else "header" if by_file == "s" else ""
        return times, "times of day, HHMMSS" + (f" (the {said_by} says s)" if said_by else "")
    if unit is None and unix is not None:
        unit, note = unix, f"Unix time in {unix}"
        if by_file in UNITS and by_file != unix:
            note += f" (the header says {by_file})"
    elif unit is None and by_file in TIMES:
        unit, note = by_file, f"in {by_file}, as the file says"
    elif unit is None and is_days(values):
        unit, note = "d", "days, as spreadsheets count"
    elif unit is None and stated and by_file != "1":
        raise ImportFailed(
            f"[time] column = '{name}': it is in '{stated}', as the file says, and that is no unit of time that is "
            f"known: write unit in [time] ({', '.join(TIMES)})"
        )
    elif unit is None and (word := bracketed(name)):
        note = f"{word} is taken for a part of the name, and the numbers as s; if it is their unit, give unit in [time]"
    # Less the first: a Unix time in nanoseconds does not fit a float.
    known = values[np.isfinite(values)]
    first = known[0] if (unix is not None or unit == "d") and len(known) else 0.0
    return (values - first) * UNITS[unit or "s"], note
