"""ROS 1 and 2 bags. A name is TOPIC:FIELD, e.g. /imu/data:angular_velocity.z."""

from __future__ import annotations

import importlib
from array import array
from pathlib import Path

import numpy as np
from progress import followed

from importing.limits import Limits
from importing.log import ImportFailed, Log, Series, load, said


class Bag:
    """A bag's topics, each with its own message definitions: one that is unknown leaves the others alone."""

    def __init__(self, path: Path, limits: Limits):
        self.limits = limits
        load("rosbags", f"{path.name}: ROS bags")
        self.second = path.is_dir() or path.suffix.lower() in (".db3", ".mcap")
        if self.second and not path.is_dir() and (path.parent / "metadata.yaml").is_file():
            path = path.parent
        self.path = path
        self.module = importlib.import_module("rosbags.rosbag2" if self.second else "rosbags.rosbag1")
        self.typesys = importlib.import_module("rosbags.typesys")
        self.broken: dict[str, str] = {}
        self.fields: dict[str, list[str]] = {}
        self.cache: dict[str, tuple[np.ndarray, dict[str, np.ndarray]]] = {}
        self.start: int | None = None
        with self.module.Reader(path) as reader:
            for topic in dict.fromkeys(connection.topic for connection in reader.connections):
                try:
                    self.fields[topic] = self.first_fields(reader, topic)
                except Exception as error:  # A foreign package raises what it likes.
                    self.broken[topic] = said(error)

    def store(self, connection):
        """Message definitions of one topic: its own, or those of ROS 2 Humble or ROS 1 Noetic."""
        stores = self.typesys.Stores
        definition = getattr(connection.msgdef, "data", "")
        if not definition:
            store = self.typesys.get_typestore(stores.ROS2_HUMBLE if self.second else stores.ROS1_NOETIC)
            if connection.msgtype not in store.fielddefs:
                raise ImportFailed(
                    f"its type {connection.msgtype} is unknown: the bag holds no definition of it "
                    "(MCAP bags do, and those of ROS 2 from Iron on)"
                )
            return store
        store = self.typesys.get_typestore(stores.EMPTY)
        if connection.msgdef.format.name == "IDL":
            mark = "=" * 80 + "\n"
            parts = definition.split(mark)[1:] if definition.startswith(f"{mark}IDL: ") else ["\n" + definition]
            for part in parts:
                store.register(self.typesys.get_types_from_idl(part.split("\n", 1)[1]))
        else:
            store.register(self.typesys.get_types_from_msg(definition, connection.msgtype))
        return store

    def messages(self, reader, topic: str):
        """Messages of a topic with the time at which each was written."""
        connections = [connection for connection in reader.connections if connection.topic == topic]
        stores = {connection.id: self.store(connection) for connection in connections}
        for connection, received, raw in reader.messages(connections=connections):
            store = stores[connection.id]
            read = store.deserialize_cdr if self.second else store.deserialize_ros1
            yield received, read(raw, connection.msgtype)

    def first_fields(self, reader, topic: str) -> list[str]:
        first = next(self.messages(reader, topic), None)
        if first is None:
            raise ImportFailed("it holds no messages")
        found = fields(first[1])
        if not found:
            raise ImportFailed("its messages hold no single numbers")
        return found

    def column(self, name: str) -> Series:
        """One field of a topic, on the time of measurement."""
        topic, _, field = name.partition(":")
        if topic not in self.cache:
            self.cache.clear()  # a topic at a time: bags are large
            self.cache[topic] = self.read(topic)
        times, values = self.cache[topic]
        if self.start is None:
            self.start = int(times[0])
        # One beginning for all signals of a bag: nanoseconds since 1970 do not fit a float.
        return Series((times - self.start) * 1e-9, values[field])

    def read(self, topic: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        names = self.fields[topic]
        times = array("q")
        values = {name: array("d") for name in names}
        wide: set[str] = set()
        with self.module.Reader(self.path) as reader:
            count = sum(connection.msgcount for connection in reader.connections if connection.topic == topic)
            self.limits.check_rows(count, what="messages")
            self.limits.check_fields(count * len(names))
            for received, message in followed(self.messages(reader, topic), count, f"reading {topic}"):
                self.limits.check_rows(len(times) + 1, what="messages")
                stamp = getattr(getattr(message, "header", None), "stamp", None)
                # The stamp is when it was measured; the bag's time is when it was written.
                nanosecond = getattr(stamp, "nanosec", getattr(stamp, "nsec", 0))
                times.append(stamp.sec * 10**9 + nanosecond if stamp is not None and stamp.sec > 0 else received)
                for name in names:
                    value = message
                    for part in name.split("."):
                        value = getattr(value, part)
                    if is_quaternion(value):
                        wide.add(name)
                        values[name].extend((value.x, value.y, value.z, value.w))
                    else:
                        values[name].append(value)
        columns = {name: np.frombuffer(series, float) for name, series in values.items()}
        return np.frombuffer(times, "int64"), {
            name: series.reshape(-1, 4) if name in wide else series for name, series in columns.items()
        }


def is_quaternion(value) -> bool:
    return all(hasattr(value, part) for part in "xyzw")


def fields(message, prefix: str = "") -> list[str]:
    """Names of a message's numbers, as dotted paths; quaternions under their own name, too."""
    names = []
    for name in getattr(message, "__dataclass_fields__", ()):
        value = getattr(message, name)
        path = f"{prefix}{name}"
        if isinstance(value, (int, float, np.number)) and name != "__msgtype__":
            names.append(path)
        elif hasattr(value, "__dataclass_fields__"):
            if is_quaternion(value):
                names.append(path)
            names += fields(value, f"{path}.")
    return names


def read_rosbag(path: Path, _wanted: set[str], limits: Limits) -> Log:
    """ROS 1 and 2 bags."""
    bag = Bag(path, limits)
    names = sorted({f"{topic}:{field}" for topic, inner in bag.fields.items() for field in inner})
    return Log(path, names, bag.column, None, {}, dict(bag.broken))
