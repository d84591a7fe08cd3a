"""The mapping file: which column becomes which of our signals."""

from __future__ import annotations

import re
from difflib import get_close_matches
from pathlib import Path

from importing.limits import MEGABYTE, TEXT, check_kind
from importing.log import ImportFailed, Log, load
from importing.units import OURS, TIMES, UNITS, split_unit, unit_of

PROJECT = Path(__file__).resolve().parent.parent.parent


def vocabulary() -> list[str]:
    """Our signals, in order, from where they are declared."""
    text = (PROJECT / "src" / "signal.rs").read_text(encoding="utf-8")
    return re.findall(r'^    [A-Z0-9_]+ = "(\w+)" [A-Z]\w+ "', text, re.MULTILINE)


def signal_units() -> dict[str, str]:
    """The unit of each signal, from where they are declared."""
    text = (PROJECT / "src" / "signal.rs").read_text(encoding="utf-8")
    symbols = dict(re.findall(r'^    ([A-Z0-9_]+) = "([^"]+)" \[kg', text, re.MULTILINE))
    signals = re.findall(r'^    [A-Z0-9_]+ = "(\w+)" ([A-Z]\w+) "', text, re.MULTILINE)
    return {name: symbols[constant] for name, constant in signals}


def units_for(ours: str) -> list[str]:
    """Units that become ours."""
    return [unit for unit in UNITS if OURS[unit] == ours]


def read_mapping(file: Path) -> dict:
    """A mapping file, checked."""
    try:
        import tomllib
    except ImportError:  # Python 3.10
        tomllib = load("tomli", f"{file}: reading TOML before Python 3.11")
    try:
        if check_kind(file) > TEXT:
            raise ImportFailed(f"it is larger than {TEXT // MEGABYTE} MB, and no mapping file")
        mapping = tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except ImportFailed as error:
        raise ImportFailed(f"{file}: {error}") from error
    except OSError as error:
        raise ImportFailed(f"{file}: {error.strerror}; see scripts/import_examples/") from error
    except UnicodeDecodeError as error:
        raise ImportFailed(f"{file}: it is not UTF-8, as TOML is") from error
    except tomllib.TOMLDecodeError as error:
        raise ImportFailed(f"{file}: {error}") from error
    known = vocabulary()
    columns = mapping.get("columns", {})
    if not isinstance(columns, dict) or not columns:
        raise ImportFailed(f"{file}: no [columns.SIGNAL] in it; see scripts/import_examples/")
    for name, column in columns.items():
        if name not in known or name == "time":
            near = get_close_matches(name, known, 1)
            hint = f"; did you mean {near[0]}?" if near else f"; signals are {', '.join(known[1:])}"
            raise ImportFailed(f"{file}: '{name}' is none of our signals{hint}")
        keys = {"column", "unit", "factor", "offset", "sign", "quaternion"}
        check(file, f"columns.{name}", column, keys, units_for(signal_units()[name]) or ["1"])
    if "time" in mapping:
        check_time(file, mapping["time"])
    if unknown := mapping.keys() - {"rate", "time", "columns"}:
        raise ImportFailed(f"{file}: '{min(unknown)}' is not known; there are rate, [time] and [columns.SIGNAL]")
    check_rate(f"{file}: rate", mapping.get("rate", 100))
    return mapping


def is_number(value) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300


def check_rate(where: str, rate) -> None:
    if not is_number(rate) or not 0 < rate <= 1e5:
        raise ImportFailed(f"{where} = {rate!r} is no number of samples a second")


def check_time(file: Path, table) -> None:
    """[time] holds a column, or a constant rate for a table that has none."""
    if isinstance(table, dict) and "rate" in table:
        if "column" in table:
            raise ImportFailed(f"{file}: [time] has a column and a rate; it is one of both")
        check_rate(f"{file}: [time] rate", table["rate"])
        table = {**table, "column": ""}
    check(file, "time", table, {"column", "unit", "rate"}, list(TIMES))
    if unit_of(table.get("unit", "s")) not in TIMES:
        raise ImportFailed(f"{file}: [time] has the unit '{table['unit']}'; there are {', '.join(TIMES)}")


def check(file: Path, where: str, table, known: set[str], units: list[str]) -> None:
    if not isinstance(table, dict) or not isinstance(table.get("column"), str):
        raise ImportFailed(f'{file}: [{where}] needs column = "..."')
    if unknown := table.keys() - known:
        raise ImportFailed(f"{file}: [{where}] does not know '{min(unknown)}'; there are {', '.join(sorted(known))}")
    if not isinstance(table.get("unit", "1"), str) or unit_of(table.get("unit", "1")) is None:
        raise ImportFailed(f"{file}: [{where}] has the unit '{table['unit']}'; there are {', '.join(units)}")
    if table.get("sign", 1) not in (1, -1):
        raise ImportFailed(f"{file}: [{where}] has sign = {table['sign']}; it is 1 or -1")
    for key in ("factor", "offset"):
        if not is_number(table.get(key, 1.0)):
            raise ImportFailed(f"{file}: [{where}] has {key} = {table[key]!r}, which is no number")


def wanted(mapping: dict) -> set[str]:
    """Columns that a mapping asks for."""
    tables = [*mapping["columns"].values(), mapping.get("time", {})]
    return {table["column"] for table in tables if "column" in table}


def nearest(name: str, names: list[str]) -> list[str]:
    """Existing names that a wrong one may stand for: other case, other unit, a part of it, a slip."""
    by_lower: dict[str, list[str]] = {}
    for other in names:
        bare = re.sub(r"#\d+$", "", other)
        for key in {other.lower(), bare.lower(), split_unit(bare)[0].lower()}:
            by_lower.setdefault(key, []).append(other)
    low = name.strip().lower()
    keys = [key for key in by_lower if key == low]
    keys += get_close_matches(low, list(by_lower), 3, 0.5)
    keys += [key for key in by_lower if len(low) > 1 and len(key) > 1 and (low in key or key in low)]
    return list(dict.fromkeys(other for key in keys for other in by_lower[key]))[:4]


def resolve(log: Log, mapping_file: Path, key: str, name: str) -> str:
    """The log's column that an entry of the mapping names."""
    if name in log.names:
        return name
    where = f'{mapping_file}: [{key}] column = "{name}"'
    topic = name.partition(":")[0]
    if name in log.broken or topic in log.broken:
        reason = log.broken.get(name) or log.broken[topic]
        raise ImportFailed(f"{where} cannot be read from {log.file}: {reason}")
    if log.aliases.get(name):
        return log.aliases[name]
    near = nearest(name, log.names)
    there = [f'"{other}"' for other in near or log.names[:4]]
    words = f"there is {', '.join(there)}" if near else f"nothing is named like it, there is {', '.join(there)}, ..."
    raise ImportFailed(f"{where}: {log.file} has no such column; {words} (--list shows all)")
