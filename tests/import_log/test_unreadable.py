"""One column that cannot be read is named with its reason, and the others are read."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import AY, TIME, VX, YAW_RATE, close, imported, mapping, needs
from import_log import ImportFailed, convert, main, open_log

TABLE = "[time]\ncolumn = 't'\n[columns.vx]\ncolumn = 'v'\n[columns.yaw_rate]\ncolumn = 'r'\n"
CHANNELS = "[columns.vx]\ncolumn = 'v'\n[columns.yaw_rate]\ncolumn = 'r'\n"


def listed(file: Path, monkeypatch, capsys) -> dict:
    """What --list says, as JSON."""
    monkeypatch.setattr(sys, "argv", ["import_log", str(file), "--list", "--json", "-"])
    assert main() == 0
    return json.loads(capsys.readouterr().out)


def check(file: Path, tmp_path: Path, text: str, bad: str, words: str, monkeypatch, capsys) -> None:
    """The others are read; the bad one is named in the list, and refused where the mapping asks for it."""
    close(imported(file, mapping(tmp_path, text), tmp_path), vx=VX, yaw_rate=YAW_RATE)
    unreadable = {entry["name"]: entry["reason"] for entry in listed(file, monkeypatch, capsys)["unreadable"]}
    topic = bad.partition(":")[0]
    assert words in unreadable.get(bad, unreadable.get(topic, "")), unreadable
    file_map = mapping(tmp_path, text + f"[columns.ay]\ncolumn = '{bad}'\n")
    with pytest.raises(ImportFailed) as refused:
        convert(file, file_map, tmp_path / "out.csv")
    for part in (str(file_map), "[columns.ay]", bad, str(file), words):
        assert part in str(refused.value)


def test_a_column_of_text(tmp_path, monkeypatch, capsys):
    file = tmp_path / "log.csv"
    file.write_text("t,v,r,mode\n" + "".join(f"{t:.2f},{v},{r},EXPERT\n" for t, v, r in zip(TIME, VX, YAW_RATE)))
    check(file, tmp_path, TABLE, "mode", "'EXPERT' in line 2 is no number", monkeypatch, capsys)


def test_a_text_channel_of_mf4(tmp_path, monkeypatch, capsys):
    asammdf = needs("asammdf")
    mdf = asammdf.MDF()
    for name, values in {"v": VX, "bad": np.array([b"abc"] * len(TIME)), "r": YAW_RATE}.items():
        encoding = "utf-8" if values.dtype.kind == "S" else None
        mdf.append([asammdf.Signal(values, TIME, name=name, encoding=encoding)])
    file = Path(mdf.save(tmp_path / "log.mf4", overwrite=True))
    check(file, tmp_path, CHANNELS, "bad", "it holds text", monkeypatch, capsys)


def test_a_damaged_channel_of_mf4(tmp_path, monkeypatch, capsys):
    asammdf = needs("asammdf")
    mdf = asammdf.MDF()
    noise = np.random.default_rng(1).normal(size=len(TIME))
    for name, values in {"v": VX, "bad": noise, "r": YAW_RATE}.items():
        mdf.append([asammdf.Signal(values, TIME, name=name)])
    file = Path(mdf.save(tmp_path / "log.mf4", overwrite=True, compression=1))
    # The second compressed block is overwritten.
    data = bytearray(file.read_bytes())
    block = data.index(b"##DZ", data.index(b"##DZ") + 4)
    data[block + 60 : block + 160] = b"\xff" * 100
    file.write_bytes(data)
    check(file, tmp_path, CHANNELS, "bad", "rror", monkeypatch, capsys)


def test_an_enumeration_of_mf4_is_read_by_its_numbers(tmp_path):
    asammdf = needs("asammdf")
    mdf = asammdf.MDF()
    words = {"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on", "default": b""}
    gear = asammdf.Signal((TIME > 5).astype(np.uint8), TIME, name="gear", conversion=words)
    mdf.append([gear])
    series = open_log(Path(mdf.save(tmp_path / "log.mf4", overwrite=True))).get("gear")
    assert set(series.values) == {0.0, 1.0}


def test_nested_columns_of_parquet(tmp_path, monkeypatch, capsys):
    pyarrow = needs("pyarrow")
    from pyarrow import parquet

    columns = {
        "t": TIME,
        "v": VX,
        "r": YAW_RATE,
        "bad": [[1.0, 2.0]] * len(TIME),
        "state": ["on"] * len(TIME),
        "imu": [{"ay": float(value), "far": {"z": 1.0}} for value in AY],
    }
    file = tmp_path / "log.parquet"
    parquet.write_table(pyarrow.table(columns), file)
    check(file, tmp_path, TABLE, "bad", "nested", monkeypatch, capsys)
    check(file, tmp_path, TABLE, "state", "it holds text", monkeypatch, capsys)
    # A structure's fields are columns.
    text = TABLE + "[columns.ay]\ncolumn = 'imu.ay'\n"
    close(imported(file, mapping(tmp_path, text), tmp_path), ay=AY)
    assert "imu.far.z" in open_log(file).names


@pytest.mark.parametrize("kind", ["ns", "us", "ms", "zone", "text", "int", "gap", "duration"])
def test_time_stamps_of_parquet(tmp_path, kind):
    pyarrow = needs("pyarrow")
    from pyarrow import parquet

    nanoseconds = 1_700_000_000_000_000_000 + np.round(TIME * 1e9).astype("int64")
    stamps = nanoseconds.astype("datetime64[ns]")
    times = {
        "ns": lambda: pyarrow.array(stamps),
        "us": lambda: pyarrow.array(stamps.astype("datetime64[us]")),
        "ms": lambda: pyarrow.array(stamps.astype("datetime64[ms]")),
        "zone": lambda: pyarrow.array(nanoseconds).cast(pyarrow.timestamp("ns", tz="Europe/Berlin")),
        "text": lambda: pyarrow.array([str(stamp) for stamp in stamps]),
        "int": lambda: pyarrow.array(nanoseconds),
        "gap": lambda: pyarrow.array([None, *stamps[1:].tolist()], type=pyarrow.timestamp("ns")),
        "duration": lambda: pyarrow.array((nanoseconds - nanoseconds[0]).astype("timedelta64[ns]")),
    }[kind]()
    file = tmp_path / "log.parquet"
    parquet.write_table(pyarrow.table({"t": times, "v": VX, "r": YAW_RATE}), file)
    columns = imported(file, mapping(tmp_path, TABLE), tmp_path)
    start = 0.01 if kind == "gap" else 0.0
    close({**columns, "time": columns["time"] + start}, vx=VX, yaw_rate=YAW_RATE)
    assert np.allclose(np.diff(columns["time"]), 0.01, atol=1e-6)


def test_values_of_matlab_that_are_no_columns(tmp_path, monkeypatch, capsys):
    io = needs("scipy.io")
    cells = np.empty(3, object)
    cells[:] = ["a", np.arange(4.0), {"b": 1.0}]
    many = [{"x": 1.0}] * 200
    content = {"t": TIME, "v": VX, "r": YAW_RATE, "bad": cells, "note": "text", "z": TIME + 1j, "many": many}
    file = tmp_path / "log.mat"
    io.savemat(file, content)
    check(file, tmp_path, TABLE, "bad", "cell array", monkeypatch, capsys)
    check(file, tmp_path, TABLE, "note", "text", monkeypatch, capsys)
    check(file, tmp_path, TABLE, "z", "complex", monkeypatch, capsys)
    check(file, tmp_path, TABLE, "many", "array of structures", monkeypatch, capsys)


def test_structures_and_matrices_of_matlab_are_read(tmp_path):
    io = needs("scipy.io")
    signals = np.array([{"values": VX[:, None], "label": "v"}, {"values": YAW_RATE[:, None], "label": "r"}], object)
    content = {"out": {"time": TIME[:, None], "signals": signals, "A": np.column_stack([AY, VX])}}
    file = tmp_path / "log.mat"
    io.savemat(file, content)
    text = """
    [time]
    column = "out.time"
    [columns.vx]
    column = "out.signals(1).values"
    [columns.yaw_rate]
    column = "out.signals(2).values"
    [columns.ay]
    column = "out.A(:,1)"
    """
    close(imported(file, mapping(tmp_path, text), tmp_path), vx=VX, yaw_rate=YAW_RATE, ay=AY)
    with pytest.raises(ImportFailed, match="a matrix of 2000 x 2; name one of its columns"):
        convert(file, mapping(tmp_path, text.replace("out.A(:,1)", "out.A")), tmp_path / "out.csv")


def bag(tmp_path: Path, kind: str) -> Path:
    """A bag of speed and yaw rate, and a topic that cannot be read."""
    needs("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("float64 value\nstring words\n", "own_msgs/msg/Own"))
    types = store.types
    folder = tmp_path / f"bag {kind}"
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    with Writer(folder, version=8, storage_plugin=plugin) as writer:
        fine, own = "std_msgs/msg/Float64", "own_msgs/msg/Own"
        topics = {"/v": (fine, VX), "/bad": (own, AY), "/r": (fine, YAW_RATE), "/empty": (fine, AY[:0])}
        for topic, (msgtype, values) in topics.items():
            connection = writer.add_connection(topic, msgtype, typestore=store)
            for t, value in zip(TIME, values):
                if msgtype == fine:
                    raw = store.serialize_cdr(types[fine](data=float(value)), fine)
                else:
                    raw = store.serialize_cdr(types[own](value=float(value), words="x"), own)
                if kind != "db3" and topic == "/bad" and t > 10:
                    raw = raw[:7]  # a message that was cut off
                writer.write(connection, round(1.7e18) + round(t * 1e9), raw)
    return folder


BAG = "rate = 100\n[columns.vx]\ncolumn = '/v:data'\n[columns.yaw_rate]\ncolumn = '/r:data'\n"


def without_definitions(folder: Path) -> None:
    """Takes a bag's message definitions away, as recorders before ROS 2 Iron leave it."""
    import sqlite3

    with sqlite3.connect(next(folder.glob("*.db3"))) as data:
        data.execute("delete from message_definitions")


def test_an_unknown_type_of_a_bag(tmp_path, monkeypatch, capsys):
    folder = bag(tmp_path, "db3")
    without_definitions(folder)
    check(folder, tmp_path, BAG, "/bad:value", "own_msgs/msg/Own is unknown", monkeypatch, capsys)
    # The file alone, without metadata.yaml.
    (folder / "metadata.yaml").unlink()
    check(next(folder.glob("*.db3")), tmp_path, BAG, "/bad:value", "is unknown", monkeypatch, capsys)
    # The folder, as a recorder leaves it that was stopped hard.
    check(folder, tmp_path, BAG, "/bad:value", "is unknown", monkeypatch, capsys)
    (folder / "other.db3").write_bytes(b"")
    with pytest.raises(ImportFailed, match=r"has none; give one of its files: .*other\.db3"):
        convert(folder, mapping(tmp_path, BAG), tmp_path / "out.csv")


@pytest.mark.parametrize("kind", ["mcap", "damaged"])
def test_a_damaged_topic_of_a_bag(tmp_path, monkeypatch, capsys, kind):
    check(bag(tmp_path, kind), tmp_path, BAG, "/bad:value", "rror", monkeypatch, capsys)


def test_an_empty_topic_is_named(tmp_path, monkeypatch, capsys):
    names = {
        entry["name"]: entry["reason"] for entry in listed(bag(tmp_path, "mcap"), monkeypatch, capsys)["unreadable"]
    }
    assert names["/empty"] == "it holds no messages"


def test_a_bag_of_ros_1(tmp_path, monkeypatch, capsys):
    needs("rosbags")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    kind, file = "std_msgs/msg/Float64", tmp_path / "log.bag"
    with Writer(file) as writer:
        for topic, values in {"/v": VX, "/bad": AY, "/r": YAW_RATE}.items():
            connection = writer.add_connection(topic, kind, typestore=store)
            for t, value in zip(TIME, values):
                raw = bytes(store.serialize_ros1(store.types[kind](data=float(value)), kind))
                writer.write(connection, round(1.7e18) + round(t * 1e9), raw[:5] if topic == "/bad" else raw)
    check(file, tmp_path, BAG, "/bad:data", "rror", monkeypatch, capsys)


def test_number_types_of_parquet(tmp_path):
    pyarrow = needs("pyarrow")
    from decimal import Decimal

    from pyarrow import parquet

    columns = {
        "t": pyarrow.array(TIME),
        "v": pyarrow.array([Decimal(f"{value:.6f}") for value in VX]),
        "r": pyarrow.array(YAW_RATE).dictionary_encode(),
    }
    file = tmp_path / "log.parquet"
    parquet.write_table(pyarrow.table(columns), file)
    close(imported(file, mapping(tmp_path, TABLE), tmp_path), vx=VX, yaw_rate=YAW_RATE)
