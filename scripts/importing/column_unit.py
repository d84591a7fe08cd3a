"""The unit of a mapped column: the mapping's, else the file's; it has to be one of the signal's quantity."""

from __future__ import annotations

import re

from importing.known_names import plain as plain_name
from importing.log import ImportFailed, Log
from importing.mapping import signal_units, units_for
from importing.units import OURS, UNITS, bracketed, plain, unit_of

_GEOGRAPHIC = re.compile(r"(gps_?)?(lat|latitude|lon|lng|long|longitude)", re.IGNORECASE)
PLANE = (
    "x and y are metres in a plane, x to the east and y to the north. Are they latitude and longitude? Give metres to "
    "the east and north: docs/import.md has the entries of a mapping that convert them"
)


def unit_for(log: Log, signal: str, name: str, table: dict) -> str:
    """The unit of a column: the mapping's; else the file's, and said."""
    unit, said_by = chosen(log, signal, name, table)
    needed = signal_units()[signal]
    # A slope in per cent is its angle, near enough; `rfl path` takes it so, too.
    if unit == "1" or OURS[unit] == needed or (unit == "%" and signal in ("bank", "grade")):
        if unit == "1" and "unit" not in table and "factor" not in table and is_geographic(signal, name):
            raise ImportFailed(f"[columns.{signal}]: {PLANE}. If '{name}' is in metres, write unit = \"m\"")
        return unit
    words = f"'{name}' is in {unit}, as the {said_by} says, and {signal} is in {needed}"
    if table.get("factor", 1.0) != 1.0:
        # A radius makes a speed of a wheel's rpm.
        log.notes.append(f"columns.{signal}: {words}: the factor is taken for what makes one of the other")
        return unit
    if signal in ("x", "y") and OURS[unit] == "rad":
        raise ImportFailed(f"[columns.{signal}]: {words}. {PLANE}")
    raise ImportFailed(
        f"[columns.{signal}]: {words}: name another column, or write the unit that the numbers have "
        f'({", ".join(units_for(needed)) or needed}); unit = "1" takes them as they are'
    )


def chosen(log: Log, signal: str, name: str, table: dict) -> tuple[str, str]:
    """The unit that counts, and who says it."""
    key, needed = f"columns.{signal}", signal_units()[signal]
    given = unit_of(table["unit"]) if "unit" in table else None
    stated = log.units.get(name, "").strip()
    # Without a unit, or in one of ours that the list lacks, numbers are taken as they are.
    by_file = "1" if not stated else unit_of(stated) or ("1" if plain(stated) == plain(needed) else None)
    if given is not None:
        if by_file is None or (by_file != "1" and (UNITS[given], OURS[given]) != (UNITS[by_file], OURS[by_file])):
            log.notes.append(
                f"{key}: the file says that '{name}' is in {by_file or stated}; the mapping's {given} is taken"
            )
        return given, "mapping"
    if by_file is None:
        raise ImportFailed(
            f"[{key}]: '{name}' is in '{stated}', as the file says, and that is no unit that is known for {signal}: "
            f"write its unit ({', '.join(units_for(needed)) or '1'}), and a factor where that is another one"
        )
    if by_file == "1":
        if word := bracketed(name) if not stated else "":
            log.notes.append(
                f"{key}: {word} of '{name}' is taken for a part of the name, and the numbers as {needed}; "
                "if it is their unit, give unit in the mapping"
            )
        return "1", "file"
    if "factor" in table and UNITS[by_file] != 1.0:
        raise ImportFailed(
            f"[{key}]: '{name}' is in {by_file}, as the file says, and the mapping has a factor and no unit: write "
            f'unit = "{by_file}" (the factor comes on top of it), or unit = "1" if the factor converts it'
        )
    if UNITS[by_file] != 1.0:
        log.notes.append(f"{key}: '{name}' is in {by_file}, as the file says; converted")
    return by_file, "file"


def is_geographic(signal: str, name: str) -> bool:
    """Whether a column for x or y is a latitude or a longitude by its name."""
    return signal in ("x", "y") and _GEOGRAPHIC.fullmatch(plain_name(name).rpartition(".")[2]) is not None
