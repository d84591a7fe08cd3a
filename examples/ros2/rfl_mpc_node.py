#!/usr/bin/env python3
"""The controller as a ROS 2 node: odometry in, steering and acceleration out.

    source /opt/ros/$ROS_DISTRO/setup.bash
    python3 rfl_mpc_node.py --ros-args -p path_file:=/data/road.csv -p vehicle:=/data/my_car.toml -r odom:=/vehicle/odom

Subscribes `odom` (nav_msgs/Odometry) and publishes `drive` (ackermann_msgs/AckermannDriveStamped), both of the
vehicle's base frame. The controller is that of the Python package `rfl_mpc`, in this process; it computes once per
sample time, and until the first odometry nothing is published.
"""

from __future__ import annotations

import math

import rclpy
import rfl_mpc
from ackermann_msgs.msg import AckermannDriveStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node


class Controller(Node):
    """One controller between two topics."""

    def __init__(self) -> None:
        super().__init__("rfl_mpc")
        texts = {name: self.declare_parameter(name, default).value for name, default in DEFAULTS.items()}
        # From the base frame's origin forward to the centre of gravity, in m.
        self.cg_offset = float(self.declare_parameter("cg_offset", 0.0).value)
        self.controller = rfl_mpc.Controller(
            texts["path_file"] or None, texts["vehicle"], residual=texts["residual_file"] or None
        )
        self.status, self.measured, self.command = None, None, None
        self.publisher = self.create_publisher(AckermannDriveStamped, "drive", 1)
        self.create_subscription(Odometry, "odom", self.take, 1)
        self.create_timer(self.controller.sample_time, self.step)

    def take(self, message: Odometry) -> None:
        """Keeps the newest measurement, moved to the centre of gravity."""
        at, q = message.pose.pose.position, message.pose.pose.orientation
        twist = message.twist.twist
        yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))
        forward = self.cg_offset
        self.measured = {
            "x": at.x + forward * math.cos(yaw),
            "y": at.y + forward * math.sin(yaw),
            "yaw": yaw,
            "vx": twist.linear.x,
            "vy": twist.linear.y + forward * twist.angular.z,
            "yaw_rate": twist.angular.z,
        }

    def step(self) -> None:
        """One sample: the controller judges itself whether its measurements can be true."""
        if self.measured is None:
            return
        self.command = command = self.controller.step(**self.measured)
        if command.status != self.status:
            self.status = command.status
            self.get_logger().info(f"status {command.status}")
        message = AckermannDriveStamped()
        message.header.stamp = self.get_clock().now().to_msg()
        message.drive.steering_angle = command.steer_cmd
        message.drive.acceleration = command.accel_cmd
        message.drive.speed = 0.0 if command.finished else command.speed_ref
        self.publisher.publish(message)


# Parameters of the node: a road, a vehicle (file or built-in name), a learned model; and their defaults.
DEFAULTS = {"path_file": "", "vehicle": "c_class", "residual_file": ""}


def main() -> None:
    rclpy.init()
    node = Controller()
    try:
        rclpy.spin(node)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
