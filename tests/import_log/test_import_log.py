"""Logs of other tools become drive logs: each format by its example mapping, and words for what is wrong.

A format whose reader is not installed is skipped, saying so; in continuous integration that is a failure.
"""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import AY, PLAIN, STEER, TIME, VX, YAW_RATE, close, imported, mapping, needs, table
from import_log import ImportFailed, convert, main, vocabulary


def test_the_vocabulary_is_that_of_the_program():
    assert vocabulary()[:3] == ["time", "steer_cmd", "accel_cmd"]
    assert {"yaw_rate", "articulation_rate", "station"} <= set(vocabulary())


def test_csv(tmp_path):
    columns = imported(table(tmp_path), mapping(tmp_path, PLAIN), tmp_path)
    assert list(columns) == ["time", "vx", "yaw_rate"]
    close(columns, vx=VX, yaw_rate=YAW_RATE)


def test_sign_factor_offset_and_rate(tmp_path):
    text = "rate = 20\n" + PLAIN + "sign = -1\nfactor = 2.0\noffset = 0.1\n"
    columns = imported(table(tmp_path), mapping(tmp_path, text), tmp_path)
    assert np.allclose(np.diff(columns["time"]), 0.05)
    close(columns, yaw_rate=-(2 * YAW_RATE + 0.1))


def test_mf4(tmp_path):
    asammdf = needs("asammdf")
    mdf, degrees = asammdf.MDF(), np.degrees
    slow = TIME[::5]
    mdf.append([asammdf.Signal(degrees(15.8 * STEER), TIME, name="SteeringWheelAngle", unit="deg")])
    mdf.append([asammdf.Signal(3.6 * VX[::5], slow, name="VehicleSpeed", unit="km/h")])
    for name, values in {"ESP_YawRate": degrees(YAW_RATE), "ESP_LatAcc": AY, "ESP_LongAcc": 0.1 * AY}.items():
        mdf.append([asammdf.Signal(values, TIME + 0.003, name=name)])
    file = Path(mdf.save(tmp_path / "log.mf4", overwrite=True))
    columns = imported(file, "mf4.toml", tmp_path)
    close(
        {**columns, "time": columns["time"] + 0.003},
        steer=STEER,
        vx=VX,
        yaw_rate=np.interp(TIME, TIME + 0.003, YAW_RATE),
    )


def test_parquet(tmp_path):
    pyarrow = needs("pyarrow")
    from pyarrow import parquet

    degrees = np.degrees
    columns = {
        "timestamp_ms": 1000 * TIME,
        "target_steer_deg": degrees(STEER),
        "steer_deg": degrees(STEER),
        "speed_kmh": 3.6 * VX,
        "yaw_rate_degps": -degrees(YAW_RATE),
        "ay_g": -AY / 9.80665,
    }
    parquet.write_table(pyarrow.table(columns), tmp_path / "log.parquet")
    close(
        imported(tmp_path / "log.parquet", "parquet.toml", tmp_path), steer_cmd=STEER, vx=VX, yaw_rate=YAW_RATE, ay=AY
    )


def test_matlab(tmp_path):
    io = needs("scipy.io")
    log = {"t": TIME, "delta_cmd": STEER, "a_cmd": 0.1 * AY, "pos": {"x": 12 * TIME, "y": AY}, "psi": AY, "v": VX,
           "psi_dot": YAW_RATE}  # fmt: skip
    io.savemat(tmp_path / "log.mat", {"log": log})
    close(
        imported(tmp_path / "log.mat", "matlab.toml", tmp_path), steer_cmd=STEER, x=12 * TIME, vx=VX, yaw_rate=YAW_RATE
    )


def test_rosbag(tmp_path):
    needs("rosbags")
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    ackermann = (
        "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n"
    )
    stamped = "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n"
    store.register(get_types_from_msg(ackermann, "ackermann_msgs/msg/AckermannDrive"))
    store.register(get_types_from_msg(stamped, "ackermann_msgs/msg/AckermannDriveStamped"))
    types, start = store.types, 1_700_000_000
    yaw = np.cumsum(YAW_RATE) * 0.01

    def header(t: float):
        nanoseconds = round(t * 1e9)
        stamp = types["builtin_interfaces/msg/Time"](sec=start + nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id="")

    def vector(x=0.0, y=0.0, z=0.0):
        return types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z)

    def quaternion(angle: float):
        return types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=np.sin(angle / 2), w=np.cos(angle / 2))

    def odometry(i: int):
        point = types["geometry_msgs/msg/Point"](x=12 * TIME[i], y=AY[i], z=0.0)
        pose = types["geometry_msgs/msg/Pose"](position=point, orientation=quaternion(yaw[i]))
        twist = types["geometry_msgs/msg/Twist"](linear=vector(VX[i]), angular=vector(z=YAW_RATE[i]))
        return types["nav_msgs/msg/Odometry"](
            header=header(TIME[i]),
            child_frame_id="",
            pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
            twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36)),
        )

    def imu(i: int):
        nine = np.zeros(9)
        return types["sensor_msgs/msg/Imu"](
            header=header(TIME[i]), orientation=quaternion(0.0), orientation_covariance=nine,
            angular_velocity=vector(z=YAW_RATE[i]), angular_velocity_covariance=nine,
            linear_acceleration=vector(y=AY[i]), linear_acceleration_covariance=nine,
        )  # fmt: skip

    def command(i: int):
        drive = types["ackermann_msgs/msg/AckermannDrive"](
            steering_angle=STEER[i], steering_angle_velocity=0.0, speed=0.0, acceleration=0.1, jerk=0.0
        )
        return types["ackermann_msgs/msg/AckermannDriveStamped"](header=header(TIME[i]), drive=drive)

    with Writer(tmp_path / "bag", version=8) as writer:
        topics = {
            "/drive": ("ackermann_msgs/msg/AckermannDriveStamped", command),
            "/odom": ("nav_msgs/msg/Odometry", odometry),
            "/imu/data": ("sensor_msgs/msg/Imu", imu),
        }
        for topic, (kind, make) in topics.items():
            connection = writer.add_connection(topic, kind, typestore=store)
            for i in range(0, len(TIME), 2):
                # Written late: what counts is when it was measured.
                late = (start * 10**9) + round(TIME[i] * 1e9) + 30_000_000
                writer.write(connection, late, store.serialize_cdr(make(i), kind))
    columns = imported(tmp_path / "bag", "rosbag.toml", tmp_path)
    close(columns, steer_cmd=STEER, x=12 * TIME, vx=VX, yaw=yaw, yaw_rate=YAW_RATE, ay=AY)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no [columns.SIGNAL]"),
        ("[columns.yawrate]\ncolumn = 'r'\n", "did you mean yaw_rate"),
        ("[columns.vx]\n", "needs column"),
        ("[columns.vx]\ncolumn = 'v'\nunit = 'furlong'\n", "unit 'furlong'"),
        ("[columns.vx]\ncolumn = 'v'\nsing = -1\n", "does not know 'sing'"),
        ("[columns.vx]\ncolumn = 'v'\nsign = 2\n", "it is 1 or -1"),
        ("[columns.vx]\ncolumn = 'v'\nfactor = 'x'\n", "no number"),
        ("[columns.vx]\ncolumn = 'v'\n", "no clock"),
        ("[time]\ncolumn = 't'\n[columns.vx]\ncolumn = 'vv'\n", 'there is "v"'),
        ("[time]\ncolumn = 't'\n[columns.yaw]\ncolumn = 'v'\nquaternion = true\n", "no quaternion"),
        ("rate = -1\n[columns.vx]\ncolumn = 'v'\n", "rate = -1"),
        ("time = \n", "line 1"),
    ],
)
def test_a_wrong_mapping_is_explained(tmp_path, text, words):
    with pytest.raises(ImportFailed, match=words.replace("[", r"\[")):
        convert(table(tmp_path), mapping(tmp_path, text), tmp_path / "out.csv")
    assert not (tmp_path / "out.csv").exists()


def test_wrong_files_are_explained(tmp_path, monkeypatch, capsys):
    plain = mapping(tmp_path, PLAIN)
    (tmp_path / "log.xyz").write_text("")
    (tmp_path / "log.mat").write_bytes(b"no MATLAB file")
    for name, words in {"missing.csv": "no such file", "log.xyz": "its ending", "log.mat": "log.mat"}.items():
        monkeypatch.setattr("sys.argv", ["import_log", str(tmp_path / name), str(plain)])
        assert main() == 1
        assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("file", "package"),
    [("log.mf4", "asammdf"), ("log.parquet", "pyarrow"), ("log.mat", "scipy"), ("log.bag", "rosbags")],
)
def test_a_missing_package_is_named(tmp_path, monkeypatch, file, package):
    found = importlib.import_module

    def without(name: str, *rest):
        if name.split(".")[0] == package:
            raise ImportError(name)
        return found(name, *rest)

    monkeypatch.setattr(importlib, "import_module", without)
    (tmp_path / file).write_bytes(b"x" * 200)
    with pytest.raises(ImportFailed, match=f"pip install {package}"):
        convert(tmp_path / file, mapping(tmp_path, PLAIN), tmp_path / "out.csv")
