"""Units of foreign logs: factors to SI, and the spellings that files use. The list is the library's own."""

from __future__ import annotations

import re
from pathlib import Path

LIST = Path(__file__).parents[2] / "src" / "table" / "units.txt"


def listed() -> list[tuple[str, float, list[str]]]:
    """Our unit, the factor to it and the spellings, of each line of the list."""
    lines = LIST.read_text(encoding="utf-8").splitlines()
    rows = [line.split() for line in lines if not line.startswith("#")]
    return [(ours, float(factor), spellings) for ours, factor, *spellings in rows]


def plain(unit: str) -> str:
    """A unit in small letters, its products and powers in one way of writing: 'm s⁻¹', 'm/sec.' are 'm/s'."""
    signs = str.maketrans(
        {"⁻": "-", "\N{MINUS SIGN}": "-", "¹": "1", "²": "2", "^": "", "*": "", "·": "", ".": "", " ": ""}
    )
    found = re.sub(r"/(seconds|second|sec)", "/s", unit.lower().replace(" per ", "/").translate(signs))
    return re.sub(r"(?<=.)s-([12])$", lambda power: "/s" if power[1] == "1" else "/s2", found)


# Factors to SI by the usual spelling.
UNITS = {spellings[0]: factor for ours, factor, spellings in listed() if ours != "other"}
# Our unit of each: its quantity.
OURS = {spellings[0]: ours for ours, _, spellings in listed() if ours != "other"}
TIMES = tuple(spellings[0] for ours, _, spellings in listed() if ours == "s")

_BY_SPELLING = {
    plain(spelling): spellings[0] for ours, _, spellings in listed() if ours != "other" for spelling in spellings
}
# Units of quantities that a drive log does not have; they show that a row is one of units.
_OTHERS = {plain(spelling) for ours, _, spellings in listed() if ours == "other" for spelling in spellings}


def unit_of(text: str) -> str | None:
    """The unit that a file's spelling means; None if it is none of ours."""
    return _BY_SPELLING.get(plain(text.strip().strip("[]()").strip()))


def looks_like_unit(text: str) -> bool:
    """Whether a header's cell reads as a unit."""
    written = text.strip()
    if re.fullmatch(r"\[.*\]|\(.*\)", written):
        return True
    # In lower case single letters are names: v, a.
    other = plain(written) in _OTHERS and (len(written) > 1 or written.isupper())
    return unit_of(written) is not None or other


# A quotient by a time or a length, degrees, a number before a unit.
_QUOTIENT = re.compile(r".+/(s|h|hr|min|ms|m|km|mi|ft)\d?|.*[°º].*")
_MULTIPLE = re.compile(r"\d+(?:e-?\d+)?x?(\D.*)")


def reads_like_unit(text: str) -> bool:
    """Whether brackets after a name hold a unit, known or not: 'cdeg', 'Nm', 'furlong/h'.

    'GPS', 'FL' and 'A' may as well be a sensor, a side or an index.
    """
    written = plain(text)
    multiple = _MULTIPLE.fullmatch(written)
    return (
        unit_of(text) is not None
        or (len(written) > 1 and written in _OTHERS)
        or _QUOTIENT.fullmatch(written) is not None
        or (multiple is not None and unit_of(multiple[1]) is not None)
    )


def bracketed(name: str) -> str:
    """The word in brackets at the end of a name, with them: '[GPS]', '(filtered)'; empty without one."""
    found = re.search(r"(\[[^\[\]]*[^\W\d_][^\[\]]*\]|\([^()]*[^\W\d_][^()]*\))(#\d+)?$", name.strip())
    return found[1] if found else ""


def split_unit(name: str) -> tuple[str, str]:
    """A header's name without its unit, and the unit: 'Speed [km/h]', 'Speed (km/h)'."""
    found = re.fullmatch(r"(.*\S)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))", name.strip())
    if found is None:
        return name.strip(), ""
    unit = (found[2] if found[2] is not None else found[3]).strip()
    # 'A(:,2)' and 'speed(filtered)' are names; brackets hold a unit only if it is one.
    if found[2] is None and not looks_like_unit(unit) and not reads_like_unit(unit):
        return name.strip(), ""
    # 'm/s (GPS)' is a unit with a remark.
    remarked = re.fullmatch(r"(.*\S)\s*[(\[][^()\[\]]*[)\]]?", unit)
    if remarked and reads_like_unit(remarked[1]):
        unit = remarked[1]
    if re.fullmatch(r"\d*", unit):
        return name.strip(), ""
    return found[1], unit
