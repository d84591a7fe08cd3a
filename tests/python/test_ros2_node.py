"""The ROS 2 node on a stub of rclpy: odometry of the car's FMU in, its command out, as in a direct loop."""

from __future__ import annotations

import importlib.util
import math
import sys
from contextlib import closing
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from closed_loop import Unit

NODE = Path(__file__).resolve().parents[2] / "examples" / "ros2" / "rfl_mpc_node.py"
PARAMETERS: dict[str, object] = {}


class Message:
    """A message whose fields come into being when they are named."""

    def __getattr__(self, name):
        self.__dict__[name] = Message()
        return self.__dict__[name]


class StubNode:
    """As much of rclpy's node as ours uses; `tick` is the executor."""

    def __init__(self, name) -> None:
        self.name, self.published, self.said = name, [], []

    def declare_parameter(self, name, default):
        return SimpleNamespace(value=PARAMETERS.get(name, default))

    def create_publisher(self, kind, topic, depth):
        return SimpleNamespace(publish=self.published.append)

    def create_subscription(self, kind, topic, callback, depth) -> None:
        self.callback = callback

    def create_timer(self, period, callback) -> None:
        self.tick = callback

    def get_logger(self):
        return SimpleNamespace(info=self.said.append)

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: 0))


def module(name: str, **content) -> ModuleType:
    made = ModuleType(name)
    made.__dict__.update(content)
    return made


@pytest.fixture
def node_class(rfl_mpc, monkeypatch):
    """The node's class, loaded with stubs in the place of ROS."""
    monkeypatch.setitem(sys.modules, "rclpy", module("rclpy"))
    monkeypatch.setitem(sys.modules, "rclpy.node", module("rclpy.node", Node=StubNode))
    for package, kind in [("ackermann_msgs", "AckermannDriveStamped"), ("nav_msgs", "Odometry")]:
        monkeypatch.setitem(sys.modules, package, module(package))
        monkeypatch.setitem(sys.modules, f"{package}.msg", module(f"{package}.msg", **{kind: Message}))
    spec = importlib.util.spec_from_file_location("rfl_mpc_node", NODE)
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded.Controller


def odometry(x, y, yaw, vx, vy, yaw_rate, offset) -> Message:
    """What a localisation says of a base frame that lies `offset` behind the centre of gravity."""
    message = Message()
    position, q = message.pose.pose.position, message.pose.pose.orientation
    position.x, position.y = x - offset * math.cos(yaw), y - offset * math.sin(yaw)
    q.w, q.x, q.y, q.z = math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)
    message.twist.twist.linear.x, message.twist.twist.linear.y = vx, vy - offset * yaw_rate
    message.twist.twist.angular.z = yaw_rate
    return message


@pytest.mark.parametrize("offset", [0.0, 1.4])
def test_the_node_drives_the_car(rfl_mpc, fmus, paths, node_class, offset, monkeypatch):
    road = paths / "sudoku_turns.csv"
    monkeypatch.setitem(PARAMETERS, "path_file", str(road))
    monkeypatch.setitem(PARAMETERS, "cg_offset", offset)
    node = node_class()
    node.tick()
    assert node.published == [], "nothing is said before the first odometry"
    with closing(Unit(fmus / "PassengerCar.fmu", "car")) as car:
        for name, start in zip(("x", "y", "yaw", "vx"), node.controller.start):
            car.set(f"initial.{name}", start)
        car.initialize()
        read, write = car.reader(["x", "y", "yaw", "vx", "vy", "yaw_rate"]), car.writer(["steer_cmd", "accel_cmd"])
        errors = []
        for k in range(750):
            node.callback(odometry(*read(), offset))
            node.tick()
            drive = node.published[-1].drive
            write([drive.steering_angle, drive.acceleration])
            car.step(k * node.controller.sample_time, node.controller.sample_time)
            errors.append(node.command.e1)
        driven = node.command.station
    assert driven > 50.0 and np.abs(errors).max() < 0.2, (driven, np.abs(errors).max())
    assert any("status" in line for line in node.said)
