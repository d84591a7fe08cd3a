"""The outcome of a drive in one word, requirements on its figures, and a JUnit file: as `rfl drive` has them.

The rules are those of `src/simulate/outcome.rs`, the figures those of `src/cli/require.rs`.
"""

from __future__ import annotations

import math
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

COMPLETED, STOPPED, LOST, TIMED_OUT = OUTCOMES = ("completed", "stopped", "lost", "timed_out")
STATUS = {COMPLETED: 0, STOPPED: 3, LOST: 4, TIMED_OUT: 5}  # exit status
NOT_MET = 6  # exit status of a requirement that is not met
STATUSES = (
    "exit status: 0 completed, or on the road when the --duration given was over; 1 bad input; 2 wrong usage; "
    "3 stopped; 4 lost; 5 timed out; 6 a requirement is not met; an outcome that --require outcome=... asks for is 0"
)

LANE = 2.0  # m of lateral error beyond which a vehicle has left its lane
TURNED = 1.0  # rad of heading error beyond which it is lost
STANDING_SPEED, STANDING_TIME = 0.05, 5.0  # m/s, s: slower for so long is a stop
END_TOLERANCE = 5.0  # m by which a controller may see the road's end too early
NO_RETURN = 100.0  # m from the road beyond which nothing more is learnt from a drive that is lost


@dataclass(frozen=True)
class Place:
    """Where a vehicle is: s, m, m (positive to the left), rad."""

    time: float
    station: float
    lateral_error: float
    heading_error: float

    def json(self) -> dict[str, float]:
        """As in the results of `rfl drive`."""
        return {"time": self.time, "station": self.station, "lateral_error": self.lateral_error}


@dataclass
class Ending:
    """How a drive ended: the word, the reason, and where its lane was left first."""

    outcome: str
    reason: str
    place: Place | None = None
    departure: Place | None = None
    entered_late: Place | None = None  # where it came into its lane, beside which it began
    length: float = math.nan  # m, of the road
    driven: float = math.nan  # m, along it


@dataclass
class Referee:
    """Watches a drive, one place after another."""

    length: float
    lane: float = LANE
    place: Place | None = None
    departure: Place | None = None
    driven: float = 0.0
    entered: bool = False
    began: Place | None = None  # first place of a vehicle that began beside its lane
    entered_late: Place | None = None  # and where it came in
    standing: float | None = None

    def see(self, place: Place, speed: float) -> None:
        """Takes note of a place and the speed there in m/s."""
        # A lap begins anew within the road's second half; an open road's station never falls by half of it.
        if self.place is None:
            advance = place.station if abs(place.station) < 0.5 * self.length else 0.0
        else:
            advance = place.station - self.place.station
            if abs(advance) > 0.5 * self.length:
                advance -= math.copysign(self.length, advance)
        self.driven += advance
        self.place = place
        inside = abs(place.lateral_error) <= self.lane and abs(place.heading_error) <= TURNED
        if inside:
            if not self.entered and self.began:
                self.entered_late = place
            self.entered = True
        elif not self.entered:
            self.began = self.began or place
        elif self.departure is None:
            self.departure = place
        if abs(speed) >= STANDING_SPEED:
            self.standing = None
        elif self.standing is None:
            self.standing = place.time

    @property
    def at_end(self) -> bool:
        """Whether the road is driven to its end."""
        return self.driven >= self.length - END_TOLERANCE

    @property
    def stands(self) -> bool:
        """Whether the vehicle has stood long enough to be called stopped."""
        return self.standing is not None and self.place.time - self.standing >= STANDING_TIME

    @property
    def astray(self) -> str | None:
        """Words for a vehicle that has left its lane and is not followed any farther: it is too far from its road."""
        if self.departure is None:
            return None
        station = self.place.station
        # A lap has no place beyond its ends.
        distance = math.hypot(self.place.lateral_error, max(-station, station - self.length, 0.0))
        where = f"at {self.place.time:.2f} s and station {station:.0f} m"
        ended = f"it was {distance:.0f} m from its road, and the drive ended there, {where}"
        return ended if distance > NO_RETURN else None

    def ending(self, outcome: str, reason: str) -> Ending:
        """The ending of a drive that came to this end; one that left its lane is lost."""
        departure = self.departure or (None if self.entered else self.place)
        if departure is not None:
            where = f"at {departure.time:.2f} s and station {departure.station:.0f} m"
            outcome, reason = LOST, f"the vehicle was {self._beside(departure)}, {where}; later {reason}"
        if self.entered_late is not None:
            reason += (
                f"; it began {self._beside(self.began)}, and was in its lane from {self.entered_late.time:.2f} s on"
            )
        return Ending(outcome, reason, self.place, departure, self.entered_late, self.length, self.driven)

    def _beside(self, at: Place) -> str:
        if abs(at.lateral_error) > self.lane:
            side = "left" if at.lateral_error > 0 else "right"
            return f"{beyond(abs(at.lateral_error), self.lane)} m {side} of its path, beyond the lane's {self.lane:g} m"
        return f"turned by {abs(at.heading_error):.2f} rad from its path, beyond {TURNED:g} rad"


def beyond(value: float, limit: float) -> str:
    """A value in so many digits, two at least, that it shows to be beyond the limit."""
    written = (f"{value:.{digits}f}" for digits in range(2, 15))
    return next((text for text in written if float(text) > limit), repr(value))


def exit_status(outcome: str, cut: bool, met: bool = True, asked: bool = False) -> int:
    """The exit status of an outcome.

    `cut`: the user chose the duration, `met`: all requirements are met, `asked`: one of them asks for this outcome.
    """
    if asked or (outcome == TIMED_OUT and cut):
        outcome = COMPLETED
    return STATUS[outcome] or (0 if met else NOT_MET)


# -- Requirements -----------------------------------------------------------------------------------------------------


def tracking(columns: dict[str, np.ndarray]) -> dict[str, float]:
    """Lateral errors of a drive in m; not a number where nothing was driven."""
    e1 = np.abs(columns["e1"])
    if not len(e1):
        return dict.fromkeys(("mae", "rmse", "max"), math.nan) | {"count": 0}
    return {"mae": float(e1.mean()), "rmse": float(np.sqrt((e1**2).mean())), "max": float(e1.max()), "count": len(e1)}


def step_times(columns: dict[str, np.ndarray], sample_time: float) -> dict[str, float]:
    """Times of the control steps in s."""
    times = np.sort(columns.get("compute_time", np.empty(0)))
    if not len(times):
        return dict.fromkeys(("mean_s", "p99_s", "max_s", "missed"), math.nan)
    return {
        "mean_s": float(times.mean()),
        # Nearest rank: of fewer than 100 steps the longest.
        "p99_s": float(times[-(-len(times) * 99 // 100) - 1]),
        "max_s": float(times[-1]),
        "missed": int((times > sample_time).sum()),
    }


# Name: unit, meaning, whether more is better, the figure of the results.
FIGURES: dict[str, tuple[str, str, bool, Callable[[dict], float]]] = {
    "max_e1": ("m", "largest lateral error", False, lambda r: r["tracking"]["max"]),
    "mean_e1": ("m", "mean absolute lateral error", False, lambda r: r["tracking"]["mae"]),
    "rms_e1": ("m", "root mean square of the lateral error", False, lambda r: r["tracking"]["rmse"]),
    "driven": ("", "share of the road driven, 1 at its end", True, lambda r: r["driven"] / r["length"]),
    "duration": ("s", "time driven", False, lambda r: r["duration"]),
    "mean_step_time": ("s", "mean time of a control step", False, lambda r: r["step"]["mean_s"]),
    "p99_step_time": ("s", "time that 99 % of the steps take at most", False, lambda r: r["step"]["p99_s"]),
    "max_step_time": ("s", "time of the longest step", False, lambda r: r["step"]["max_s"]),
    "missed_steps": ("", "steps that took longer than the sample time", False, lambda r: r["step"]["missed"]),
    "real_time_factor": ("", "time driven for each second of computing", True, lambda r: r["real_time_factor"]),
}


def figures_help() -> str:
    """The figures, for the help."""
    lines = [f"  {'outcome':<17} one of {', '.join(OUTCOMES)}"]
    for name, (unit, meaning, more, _) in FIGURES.items():
        side = "at least" if more else "at most"
        lines.append(f"  {name:<17} {meaning}{f' in {unit}' if unit else ''}; = means {side}")
    return "figures of --require:\n" + "\n".join(lines)


@dataclass
class Check:
    """A test and how it went."""

    name: str
    met: bool
    words: str
    error: bool = False  # no drive, in place of one that is not as required


@dataclass
class Requirement:
    """A figure, a relation and a bound: `max_e1<=0.5`, or `max_e1=0.5` for the better side."""

    text: str
    name: str = field(init=False)
    relation: str = field(init=False)
    bound: float | str = field(init=False)

    def __post_init__(self) -> None:
        self.text = "".join(self.text.split())
        sign = next((sign for sign in ("<=", ">=", "=") if sign in self.text), None)
        if sign is None:
            raise ValueError(f"--require {self.text}: write it as FIGURE<=VALUE, FIGURE>=VALUE or FIGURE=VALUE")
        self.name, value = self.text.split(sign, 1)
        if self.name == "outcome":
            if value not in OUTCOMES or sign != "=":
                raise ValueError(f"--require {self.text}: write outcome= and one of {', '.join(OUTCOMES)}")
            self.relation, self.bound = "=", value
            return
        if self.name not in FIGURES:
            names = ", ".join(("outcome", *FIGURES))
            raise ValueError(f"--require {self.text}: there is no figure '{self.name}'; there are {names}")
        try:
            self.bound = float(value)
        except ValueError:
            self.bound = math.nan
        if not math.isfinite(self.bound):
            raise ValueError(f"--require {self.text}: '{value}' is not a number")
        self.relation = (">=" if FIGURES[self.name][2] else "<=") if sign == "=" else sign

    def asks_for(self, outcome: str) -> bool:
        """Whether it asks for this outcome."""
        return self.name == "outcome" and self.bound == outcome

    def check(self, results: dict) -> Check:
        """Checks the results of a drive."""
        if self.name == "outcome":
            found = results["outcome"]
            return Check(self.text, found == self.bound, f"outcome is {found}, {self.bound} is required")
        unit, _, _, of = FIGURES[self.name]
        value = of(results)
        met = value <= self.bound if self.relation == "<=" else value >= self.bound
        found = "not known" if math.isnan(value) else f"{value:.5g}"
        side = "at most" if self.relation == "<=" else "at least"
        unit = f" {unit}" if unit else ""
        return Check(self.text, bool(met), f"{self.name} is {found}, {side} {self.bound:g}{unit} is required")


# -- Files ------------------------------------------------------------------------------------------------------------


def files_behind(vehicle: Path | str | None) -> list[Path]:
    """The tyre files that a vehicle file names."""
    if vehicle is None or not Path(vehicle).is_file():
        return []
    try:
        text = Path(vehicle).read_text(encoding="utf-8")
    except (OSError, ValueError):  # the FMU says what is wrong with it
        return []
    names = re.findall(r"""^\s*file\s*=\s*["'](.+?)["']""", text, re.MULTILINE)
    return [Path(vehicle).parent / name for name in names]


def check_files(written: dict[str, Path | None], read: dict[str, Path | str | None]) -> None:
    """Checks the files that a command writes, by its options: none is another, nor one that it reads.

    What is read with a vehicle (`--vehicle`) counts, too.
    """

    def is_same(one: Path, other: Path | str) -> bool:
        one, other = Path(one), Path(other)
        if one.exists() and not one.is_file():
            return False  # a pipe or a device may be written twice
        if one.exists() and other.exists():
            return one.samefile(other)
        return one.resolve() == other.resolve()

    over = "and would be written over: name another"
    before: list[tuple[str, Path]] = []
    for option, file in written.items():
        if file is None:
            continue
        if str(file) == "-":
            raise ValueError(f"{option} -: standard output is for words here; name a file")
        for other, there in before:
            if is_same(file, there):
                raise ValueError(f"{other} and {option} are one file, {file}: name two")
        for other, there in read.items():
            if there is not None and Path(there).is_file() and is_same(file, there):
                raise ValueError(f"{option} {file} is the file of {other}, {over}")
        if any(tyre.is_file() and is_same(file, tyre) for tyre in files_behind(read.get("--vehicle"))):
            raise ValueError(f"{option} {file} is read with --vehicle {read['--vehicle']}, {over}")
        before.append((option, file))


def write_whole(file: Path, text: str) -> None:
    """Writes a file beside its place and renames it into it; a link, a pipe or a device is written through."""
    file = Path(file)
    file.parent.mkdir(parents=True, exist_ok=True)
    through = file.is_symlink() or (file.exists() and (not file.is_file() or file.stat().st_nlink > 1))
    draft = file if through else file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        with open(draft, "w", newline="", encoding="utf-8") as out:
            out.write(text)
        if not through:
            os.replace(draft, file)
    except OSError:
        if not through:
            draft.unlink(missing_ok=True)
        raise


def xml_text(text: str) -> str:
    """A text with a replacement for each character that XML 1.0 does not allow."""
    return re.sub("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "\ufffd", text)


def is_junit(file: Path) -> bool:
    """Whether a file is a JUnit file."""
    return file.is_file() and b"<testsuite" in file.read_bytes()[:1000]


def write_junit(file: Path, suite: str, cases: list[tuple[str, float, list[Check]]]) -> None:
    """Writes checks as a JUnit file: for each drive its class, its time in s, and a test case a check."""
    every = [check for _, _, checks in cases for check in checks]
    totals = {
        "tests": str(len(every)),
        "failures": str(sum(not check.met and not check.error for check in every)),
        "errors": str(sum(check.error for check in every)),
        "time": f"{sum(time for _, time, _ in cases):.3f}",
    }
    root = ET.Element("testsuites", totals)
    group = ET.SubElement(root, "testsuite", {"name": suite} | totals)
    for name, _, checks in cases:
        for check in checks:
            words = xml_text(check.words)
            case = ET.SubElement(group, "testcase", classname=xml_text(name), name=xml_text(check.name), time="0")
            if check.met:
                ET.SubElement(case, "system-out").text = words
            else:
                tag, kind = ("error", "error") if check.error else ("failure", "requirement")
                ET.SubElement(case, tag, type=kind, message=words).text = words
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode")
    write_whole(file, f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n')
