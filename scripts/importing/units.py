"""Units of foreign logs: factors to SI, and the spellings that files use."""

from __future__ import annotations

import math
import re

# Factors to SI.
UNITS = {
    "1": 1.0,
    "%": 0.01,
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "h": 3600.0,
    "d": 86400.0,
    "m": 1.0,
    "mm": 1e-3,
    "cm": 1e-2,
    "km": 1e3,
    "ft": 0.3048,
    "rad": 1.0,
    "mrad": 1e-3,
    "deg": math.pi / 180.0,
    "m/s": 1.0,
    "km/h": 1 / 3.6,
    "mph": 0.44704,
    "kn": 0.514444,
    "ft/s": 0.3048,
    "rad/s": 1.0,
    "deg/s": math.pi / 180.0,
    "m/s2": 1.0,
    "g": 9.80665,
    "1/m": 1.0,
}
TIMES = ("s", "ms", "us", "ns", "min", "h", "d")

_SPELLINGS = {
    "1": "- none unitless [-] (-)",
    "%": "pct percent",
    "s": "sec secs second seconds",
    "ms": "msec millisecond milliseconds",
    "us": "usec µs μs microsecond microseconds",
    "ns": "nsec nanosecond nanoseconds",
    "min": "minutes",
    "h": "hour hours hr hrs",
    "d": "day days",
    "m": "meter meters metre metres",
    "mm": "millimeter millimetre",
    "cm": "centimeter centimetre",
    "km": "kilometer kilometre",
    "ft": "feet foot",
    "rad": "radian radians",
    "deg": "° degree degrees º",
    "m/s": "mps m/sec meter/s m·s-1 m*s^-1 m.s-1 ms-1 m.s^-1",
    "km/h": "kmh kph kmph km/hr k/h km/hour",
    "mph": "mi/h mile/h miles/h",
    "kn": "kt kts knot knots",
    "ft/s": "fps ft/sec",
    "rad/s": "rad/sec radian/s radians/s rps",
    "deg/s": "°/s º/s deg/sec degree/s degrees/s degree/sec degrees/sec dps",
    "m/s2": "m/s^2 m/s² m/s/s m/sec^2 m/sec2 m/s**2 mps2 m·s-2 m.s-2 m*s^-2",
    "g": "gee gs g's",
    "1/m": "m-1 m^-1 1/meter",
}
_BY_SPELLING = {spelling: unit for unit, words in _SPELLINGS.items() for spelling in [unit, *words.split()]}

# Units of quantities that a drive log does not have; they show that a row is one of units.
_OTHER_WORDS = """
hz khz mv ma kw nm kn kg bar mbar kpa pa °c degc rpm 1/min min-1 l/h ml db ratio bool boolean enum
count counts psi lb lbf lb-ft hp deg/s2 deg/s^2 rad/s2 rad/s^2 m/s3 m/s^3 kohm ohm lambda n.m n·m kg/h g/s kj
"""
_OTHERS = set(_OTHER_WORDS.split())
_LETTERS = set("VAWNCFKJ")  # in lower case they are names


def unit_of(text: str) -> str | None:
    """The unit that a file's spelling means; None if it is none of ours."""
    plain = text.strip().strip("[]()").strip().replace(" ", "")
    # Case matters for few: 'G' is gravity, 'M' is nothing. All ours are lower case.
    return _BY_SPELLING.get(plain) or _BY_SPELLING.get(plain.lower())


def looks_like_unit(text: str) -> bool:
    """Whether a header's cell reads as a unit."""
    plain = text.strip()
    if re.fullmatch(r"\[.*\]|\(.*\)", plain):
        return True
    return unit_of(plain) is not None or plain in _LETTERS or plain.lower().replace(" ", "") in _OTHERS


def split_unit(name: str) -> tuple[str, str]:
    """A header's name without its unit, and the unit: 'Speed [km/h]', 'Speed (km/h)'."""
    found = re.fullmatch(r"(.*\S)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))", name.strip())
    if found is None:
        return name.strip(), ""
    unit = (found[2] if found[2] is not None else found[3]).strip()
    # 'A(:,2)' and 'speed(filtered)' are names; brackets hold a unit only if it is one.
    if found[2] is None and not looks_like_unit(unit):
        return name.strip(), ""
    if re.fullmatch(r"\d*", unit):
        return name.strip(), ""
    return found[1], unit
