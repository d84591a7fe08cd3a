#!/usr/bin/env python3
"""The controller as a ROS 2 node: odometry in, steering and acceleration out.

    source /opt/ros/$ROS_DISTRO/setup.bash
    python3 rfl_mpc_node.py --ros-args -p fmu:=RflMpc.fmu -p path_file:=/data/road.csv -r odom:=/vehicle/odom

Subscribes `odom` (nav_msgs/Odometry) and publishes `drive` (ackermann_msgs/AckermannDriveStamped), both of the vehicle's
base frame. The FMU runs in this process through fmpy; it computes once per sample time, and until the first odometry nothing
is published.
"""

from __future__ import annotations

import math
import sys
from contextlib import closing
from pathlib import Path

import rclpy
from ackermann_msgs.msg import AckermannDriveStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
from closed_loop import Unit

INPUTS = ["x", "y", "yaw", "vx", "vy", "yaw_rate"]
OUTPUTS = ["steer_cmd", "accel_cmd", "speed_ref", "status", "finished"]


class Controller(Node):
    """One `RflMpc` FMU between two topics."""

    def __init__(self) -> None:
        super().__init__("rfl_mpc")
        texts = {name: self.declare_parameter(name, default).value for name, default in DEFAULTS.items()}
        # From the base frame's origin forward to the centre of gravity, in m.
        self.cg_offset = float(self.declare_parameter("cg_offset", 0.0).value)
        self.unit = Unit(Path(texts["fmu"]), "rfl_mpc")
        for name in ("path_file", "vehicle_file", "residual.file"):
            if text := texts[name]:
                self.unit.set(name, text)
        self.unit.initialize()
        self.period = float(self.unit.get("mpc.sample_time"))
        self.write, self.read = self.unit.writer(INPUTS), self.unit.reader(OUTPUTS)
        self.words = self.unit.items("status")
        self.steps, self.status, self.measured = 0, None, None
        self.publisher = self.create_publisher(AckermannDriveStamped, "drive", 1)
        self.create_subscription(Odometry, "odom", self.take, 1)
        self.create_timer(self.period, self.step)

    def take(self, message: Odometry) -> None:
        """Keeps the newest measurement, moved to the centre of gravity."""
        at, q = message.pose.pose.position, message.pose.pose.orientation
        twist = message.twist.twist
        yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))
        forward = self.cg_offset
        self.measured = [
            at.x + forward * math.cos(yaw),
            at.y + forward * math.sin(yaw),
            yaw,
            twist.linear.x,
            twist.linear.y + forward * twist.angular.z,
            twist.angular.z,
        ]

    def step(self) -> None:
        """One sample: the controller judges itself whether its measurements can be true."""
        if self.measured is None:
            return
        self.write(self.measured)
        self.unit.step(self.steps * self.period, self.period)
        self.steps += 1
        steer, accel, speed, status, finished = self.read()
        if status != self.status:
            self.status = status
            self.get_logger().info(f"status {self.words[int(status)]}")
        message = AckermannDriveStamped()
        message.header.stamp = self.get_clock().now().to_msg()
        message.drive.steering_angle = float(steer)
        message.drive.acceleration = float(accel)
        message.drive.speed = 0.0 if finished else float(speed)
        self.publisher.publish(message)


# Parameters of the node: files, and their defaults.
DEFAULTS = {"fmu": "RflMpc.fmu", "path_file": "", "vehicle_file": "", "residual.file": ""}


def main() -> None:
    rclpy.init()
    node = Controller()
    try:
        with closing(node.unit):
            rclpy.spin(node)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
