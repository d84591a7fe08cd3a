"""Names that other tools give to our signals. They are suggested, never taken unasked: the mapping decides.

A steering WHEEL's angle is marked: it becomes ours only by the factor 1 / steering ratio, which no log knows.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass

from importing.log import Log
from importing.units import UNITS, split_unit, unit_of


@dataclass(frozen=True)
class Known:
    """One tool's name of a signal, in that tool's unit; all count positive to the left, as ours do."""

    tool: str
    name: str
    signal: str
    unit: str
    wheel: bool = False
    quaternion: bool = False


KNOWN = [
    # CarSim, TruckSim: km/h, degrees, g
    Known("CarSim", "Vx", "vx", "km/h"),
    Known("CarSim", "Vy", "vy", "km/h"),
    Known("CarSim", "AVz", "yaw_rate", "deg/s"),
    Known("CarSim", "Ax", "ax", "g"),
    Known("CarSim", "Ay", "ay", "g"),
    Known("CarSim", "Xo", "x", "m"),
    Known("CarSim", "Yo", "y", "m"),
    Known("CarSim", "Yaw", "yaw", "deg"),
    Known("CarSim", "Roll", "roll", "deg"),
    Known("CarSim", "Pitch", "pitch", "deg"),
    Known("CarSim", "Steer_SW", "steer", "deg", wheel=True),
    Known("CarSim", "Steer_L1", "steer", "deg"),
    # CarMaker: SI
    Known("CarMaker", "Car.vx", "vx", "m/s"),
    Known("CarMaker", "Car.vy", "vy", "m/s"),
    Known("CarMaker", "Car.YawRate", "yaw_rate", "rad/s"),
    Known("CarMaker", "Car.Yaw", "yaw", "rad"),
    Known("CarMaker", "Car.Roll", "roll", "rad"),
    Known("CarMaker", "Car.Pitch", "pitch", "rad"),
    Known("CarMaker", "Car.ax", "ax", "m/s2"),
    Known("CarMaker", "Car.ay", "ay", "m/s2"),
    Known("CarMaker", "Car.tx", "x", "m"),
    Known("CarMaker", "Car.ty", "y", "m"),
    Known("CarMaker", "Steer.WhlAng", "steer", "rad", wheel=True),
    Known("CarMaker", "DM.Steer.Ang", "steer_cmd", "rad", wheel=True),
    # comma.ai, openpilot
    Known("comma.ai", "carState.vEgo", "vx", "m/s"),
    Known("comma.ai", "carState.aEgo", "ax", "m/s2"),
    Known("comma.ai", "carState.yawRate", "yaw_rate", "rad/s"),
    Known("comma.ai", "carState.steeringAngleDeg", "steer", "deg", wheel=True),
    Known("comma.ai", "carControl.actuators.steeringAngleDeg", "steer_cmd", "deg", wheel=True),
    Known("comma.ai", "carControl.actuators.accel", "accel_cmd", "m/s2"),
    # Autoware: the end of TOPIC:FIELD
    Known("Autoware", "velocity_status.longitudinal_velocity", "vx", "m/s"),
    Known("Autoware", "velocity_status.lateral_velocity", "vy", "m/s"),
    Known("Autoware", "velocity_status.heading_rate", "yaw_rate", "rad/s"),
    Known("Autoware", "steering_status.steering_tire_angle", "steer", "rad"),
    Known("Autoware", "control_cmd.lateral.steering_tire_angle", "steer_cmd", "rad"),
    Known("Autoware", "control_cmd.longitudinal.acceleration", "accel_cmd", "m/s2"),
    Known("Autoware", "kinematic_state.pose.pose.position.x", "x", "m"),
    Known("Autoware", "kinematic_state.pose.pose.position.y", "y", "m"),
    Known("Autoware", "kinematic_state.pose.pose.orientation", "yaw", "rad", quaternion=True),
    Known("Autoware", "kinematic_state.twist.twist.linear.x", "vx", "m/s"),
    Known("Autoware", "kinematic_state.twist.twist.linear.y", "vy", "m/s"),
    Known("Autoware", "kinematic_state.twist.twist.angular.z", "yaw_rate", "rad/s"),
]
OURS = "rfl"  # the tool of names that are those of our signals
_BY_END = {known.name: known for known in KNOWN}

_WHEEL = re.compile(
    r"steer(ing)?[\s_.-]*(hand[\s_.-]*)?wh(ee)?l|st(ee)?rn?g?_?whl|\bSAS_?|\bLRW|hand[\s_.-]*wheel|lenkrad|\bsteer(ing)?_?sw\b|(^|[._])sw_?angle|\bSWA\b|whl_?ang",
    re.IGNORECASE,
)
_ROAD = re.compile(
    r"road[\s_.-]*wheel|wheel[\s_.-]*(f[lr]\b|l1|r1|front|left|right)|tire|tyre|front[\s_.-]*wheel", re.IGNORECASE
)
_TIME = re.compile(
    r"(.*[._:\s])?(t|time|times|timestamp|time_?stamp|zeit|stamp|date_?time)(_?(s|ms|us|ns|sec))?", re.IGNORECASE
)


@dataclass
class Suggestion:
    """A column that looks like one of our signals, and the entry that a mapping would have."""

    column: str
    signal: str
    tool: str
    unit: str
    by_file: bool  # the unit is the file's own
    wheel: bool = False
    quaternion: bool = False

    def words(self) -> str:
        """The suggestion in a line."""
        if self.tool == OURS:
            return f"'{self.column}' has our own name{f', in {self.unit} (as the file says)' if self.by_file else ''}"
        source = "as the file says" if self.by_file else f"the unit of {self.tool}"
        what = f"the angle of the steering WHEEL, for {self.signal}" if self.wheel else self.signal
        unit = "" if self.quaternion else f", in {self.unit} ({source})"
        return f"'{self.column}' looks like {what}: {self.tool}'s name{unit}"

    def entry(self) -> str:
        """The entry of a mapping file."""
        tool = "" if self.tool == OURS else f"  # {self.tool}"
        lines = [f"[columns.{self.signal}]{tool}", f"column = {json.dumps(self.column, ensure_ascii=False)}"]
        if self.quaternion:
            lines.append("quaternion = true")
        elif UNITS.get(self.unit, 1.0) != 1.0:
            lines.append(f'unit = "{self.unit}"')
        if self.wheel:
            lines.append("factor = ?  # 1 / steering ratio: from the steering wheel to the road wheels")
        return "\n".join(lines)


def plain(column: str) -> str:
    """A column's name without its unit, with points between its parts."""
    return re.sub(r"[/:]+", ".", split_unit(column)[0]).strip(".")


def known_name(column: str) -> Known | None:
    """The tool's name that a column ends with."""
    parts = plain(column).split(".")
    return next((_BY_END[end] for i in range(len(parts)) if (end := ".".join(parts[i:])) in _BY_END), None)


def is_steering_wheel(column: str) -> bool:
    """Whether a name says that it is the angle of the steering wheel, not of the road wheels."""
    known = known_name(column)
    if known is not None:
        return known.wheel
    return bool(_WHEEL.search(plain(column))) and not _ROAD.search(plain(column))


def looks_like_time(column: str) -> bool:
    """Whether a name is one of a time column."""
    return _TIME.fullmatch(plain(column)) is not None


def suggestions(log: Log, vocabulary: list[str]) -> list[Suggestion]:
    """Columns that look like our signals, in the order of the drive log's columns."""
    found = []
    for column in log.names:
        if column in log.broken:
            continue
        own = unit_of(log.units.get(column, "")) if log.units.get(column) else None
        known = known_name(column)
        if known is not None:
            same = own is not None and own != "1"
            found.append(
                Suggestion(
                    column, known.signal, known.tool, own if same else known.unit, same, known.wheel, known.quaternion
                )
            )
        elif plain(column) in vocabulary[1:]:
            found.append(Suggestion(column, plain(column), OURS, own or "SI", own is not None))
    return sorted(found, key=lambda suggestion: vocabulary.index(suggestion.signal))


def snippet(found: list[Suggestion]) -> str:
    """Entries for a mapping file; a second column for the same signal is commented out."""
    seen: set[str] = set()
    blocks = []
    for suggestion in found:
        entry = suggestion.entry()
        if suggestion.signal in seen:
            entry = "\n".join(f"# {line}" for line in entry.split("\n"))
        seen.add(suggestion.signal)
        blocks.append(entry)
    return "\n\n".join(blocks)
