"""A log that is too large is refused early, with the limit and what to do: a file of 3 MB may unpack to 2 GB."""

from __future__ import annotations

import gzip
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import PLAIN, TIME, VX, YAW_RATE, close, imported, mapping, needs, table
from import_log import ImportFailed, convert, main, open_log
from importing.limits import MEGABYTE, STANDARD, USUAL, Limits
from importing.mapping import read_mapping
from importing.text import HEAD

ROOT = Path(__file__).resolve().parents[2]
SMALL = Limits(bytes=MEGABYTE)


def refused(file: Path, limits: Limits) -> str:
    """Words of a refusal, without the file that they name."""
    with pytest.raises(ImportFailed) as error:
        log = open_log(file, limits=limits)
        for name in log.names:
            log.get(name)
    words = str(error.value)
    return words.removeprefix(f"{file}: ")


def packed(tmp_path: Path, text: bytes) -> Path:
    file = tmp_path / "bomb.csv.gz"
    file.write_bytes(gzip.compress(text))
    return file


def test_the_limits_are_those_of_rfl():
    text = (ROOT / "src" / "table" / "table_error.rs").read_text(encoding="utf-8")
    assert f"bytes: {USUAL} << 20, rows: 5_000_000" in text and STANDARD.rows == 5_000_000
    assert "LONGEST_LINE: u64 = 1 << 20" in text
    assert "512 for a log" in (ROOT / "src" / "cli" / "logs.rs").read_text(encoding="utf-8")
    # A larger file may have more rows, a smaller one has no fewer.
    assert Limits.of(None) == STANDARD
    assert (Limits.of(1).bytes, Limits.of(1).rows) == (MEGABYTE, 5_000_000)
    assert (Limits.of(1100).bytes, Limits.of(1100).rows) == (1100 * MEGABYTE, 10_000_000)


def test_a_file_that_unpacks_to_much_is_refused(tmp_path):
    file = packed(tmp_path, b"t,v\n" + b"1,2\n" * 300_000)
    words = "it has more than 1 MB unpacked, the limit of a log; cut it into several files, or raise the limit: --limit"
    assert file.stat().st_size < 10_000 and refused(file, SMALL).startswith(words)
    for filler in (b"\n", b"#\n", b'"\n'):
        assert refused(packed(tmp_path, b"t,v\n" + filler * 2_000_000), SMALL).startswith(words)
    # Several packed parts are one file.
    file.write_bytes(gzip.compress(b"t,v\n" + b"1,2\n" * 100_000) * 4)
    assert refused(file, SMALL).startswith(words)


def test_a_large_file_is_refused_with_the_limit_that_it_needs(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("t,v\n" + "1,2\n" * 600_000)
    words = refused(file, SMALL)
    assert "more than 1 MB, the limit" in words and words.endswith("--limit 3")
    assert len(open_log(file, limits=Limits.of(3)).get("v").values) == 600_000


@pytest.mark.parametrize("rows", [100, HEAD + 100])
def test_too_many_rows_are_refused(tmp_path, rows):
    file = tmp_path / "log.csv"
    file.write_text("t,v\n" + "1,2\n" * rows)
    assert len(open_log(file, limits=Limits(rows=rows)).get("v").values) == rows
    words = refused(file, Limits(rows=rows - 1))
    assert words.startswith(f"line {rows + 1}: it has more than {rows - 1} rows") and words.endswith("--limit 1024")


def test_too_many_rows_are_refused_before_they_are_taken(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("t,v\n" + "1,2\n" * (2 * HEAD))
    assert refused(file, Limits(rows=100)).startswith("it has more than 100 rows")


def test_long_lines_names_and_many_columns_are_refused(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("t,v\n1,2\n" + "1," * MEGABYTE)
    assert refused(file, STANDARD).startswith("line 3: it has more than 1 MB; a table is")
    file.write_text(",".join("abcde") + "\n" + "1,2,3,4,5\n" * 9)
    assert refused(file, Limits(columns=4)).startswith("it has 5 columns, more than 4, the limit")
    file.write_text("t," + "v" * 1001 + "\n" + "1,2\n" * 9)
    assert "has more than 1000 letters" in refused(file, STANDARD)


def test_fields_count_as_they_take_memory(tmp_path):
    file = tmp_path / "log.csv"
    limits = Limits(fields=1000)
    file.write_text("a,b,c,d\n" + ",,,1\n" * 250)
    assert len(open_log(file, limits=limits).names) == 4
    file.write_text("a,b,c,d\n" + ",,,1\n" * 251)
    assert "it has more than 1000 fields" in refused(file, limits)
    file.write_text("a,b,c,d\n" + "x,,,1\n" * 250)
    assert "it has more than 1000 fields" in refused(file, limits)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes have names on Unix only")
def test_what_is_no_file_is_not_begun(tmp_path):
    pipe, device, folder = tmp_path / "pipe.csv", tmp_path / "zero.csv", tmp_path / "folder.toml"
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    folder.mkdir()
    assert refused(pipe, STANDARD) == "it is a pipe (FIFO), not a file"
    assert refused(device, STANDARD) == "it is a device, not a file"
    for file in (pipe, device, folder):
        with pytest.raises(ImportFailed, match=f"{file.name}: it is a"):
            read_mapping(file)


def test_the_option_of_the_command(tmp_path, monkeypatch, capsys):
    file = tmp_path / "log.csv"
    file.write_text("t,v\n" + "1,2\n" * 300_000)
    monkeypatch.setattr(sys, "argv", ["import_log", str(file), "--list", "--limit", "1"])
    assert main() == 1
    assert "has more than 1 MB, the limit" in capsys.readouterr().err
    monkeypatch.setattr(sys, "argv", ["import_log", str(file), "--list", "--limit", "2"])
    assert main() == 0
    for wrong in ("0", "-1", "1.5", "\uff12", str((1 << 20) + 1)):
        monkeypatch.setattr(sys, "argv", ["import_log", str(file), "--list", f"--limit={wrong}"])
        with pytest.raises(SystemExit):
            main()
        assert "is no number of MB from 1 to 1048576" in capsys.readouterr().err


def test_a_drive_log_of_too_many_rows_is_not_made(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("t,v,r\n" + "".join(f"{t},1,2\n" for t in (0, 0.001, 0.002, 1e9)))
    with pytest.raises(ImportFailed, match=r"would have 1e\+11 rows .* and 5000000 is the limit: are the time stamps"):
        convert(file, mapping(tmp_path, "rate = 100\n" + PLAIN), tmp_path / "out.csv")


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="only Linux tells a process's greatest memory")
def test_memory_stays_bounded(tmp_path):
    # 120 MB, refused at 30 MB.
    file = packed(tmp_path, b"t,v,r\n" + b"100,200,300000000000000000000\n" * 4_000_000)
    code = "import import_log; import_log.main(); print(open('/proc/self/status').read())"
    done = subprocess.run(
        [sys.executable, "-c", code, str(file), "--list", "--limit", "30"],
        capture_output=True, text=True, check=True, cwd=ROOT / "scripts",
    )  # fmt: skip
    assert "it has more than 30 MB unpacked" in done.stderr
    most = re.search(r"VmHWM:\s*(\d+) kB", done.stdout)
    assert int(most[1]) < 100 * 1024


def test_matlab_is_unpacked_before_it_is_believed(tmp_path):
    io = needs("scipy.io")
    file = tmp_path / "log.mat"
    io.savemat(file, {"t": np.zeros(200_000), "v": np.zeros(200_000)}, do_compression=True)
    assert "it has more than 1 MB unpacked" in refused(file, SMALL)
    # A size that the file only states.
    io.savemat(file, {"t": np.zeros(3)})
    data = bytearray(file.read_bytes())
    place = data.index((1).to_bytes(4, "little") + (3).to_bytes(4, "little"))
    data[place : place + 8] = (1 << 30).to_bytes(4, "little") + (1 << 30).to_bytes(4, "little")
    file.write_bytes(data)
    assert "'t': it has more than" in refused(file, STANDARD)


def test_parquet_is_held_against_what_it_says(tmp_path):
    pyarrow = needs("pyarrow")
    from pyarrow import parquet

    file = tmp_path / "log.parquet"
    noise = np.random.default_rng(1).normal(size=200_000)
    parquet.write_table(pyarrow.table({"t": noise}), file, compression="zstd")
    assert "it has more than 200 rows" in refused(file, Limits(rows=200))
    parquet.write_table(pyarrow.table({"t": np.round(noise)}), file, compression="zstd", use_dictionary=False)
    assert file.stat().st_size < MEGABYTE and "it has more than 1 MB unpacked" in refused(file, SMALL)
    # A long text that is repeated is stored once.
    parquet.write_table(pyarrow.table({"t": ["x" * 1000] * 5000, "v": np.arange(5000.0)}), file)
    log = open_log(file, limits=SMALL)
    with pytest.raises(ImportFailed, match="no time stamps"):
        log.clock("t", None)


def test_mf4_is_held_against_what_it_says(tmp_path):
    asammdf = needs("asammdf")
    mdf = asammdf.MDF()
    time = np.arange(100_000.0)
    mdf.append([asammdf.Signal(np.zeros(len(time)), time, name="v")])
    file = Path(mdf.save(tmp_path / "log.mf4", overwrite=True, compression=1))
    assert file.stat().st_size < MEGABYTE
    assert "it has more than 99999 samples in a group" in refused(file, Limits(rows=99_999))
    assert "it has more than 1 MB unpacked" in refused(file, SMALL)
    assert len(open_log(file).get("v").values) == len(time)


def test_a_bag_is_held_against_what_it_says(tmp_path):
    needs("rosbags")
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store, kind = get_typestore(Stores.ROS2_HUMBLE), "std_msgs/msg/Float64"
    folder = tmp_path / "bag"
    with Writer(folder, version=8) as writer:
        connection = writer.add_connection("/v", kind, typestore=store)
        raw = store.serialize_cdr(store.types[kind](data=1.0), kind)
        for place in range(100):
            writer.write(connection, place, raw)
    assert "it has more than 99 messages" in refused(folder, Limits(rows=99))
    assert "it has more than 0 MB, the limit" in refused(folder, Limits(bytes=1000))
    assert len(open_log(folder).get("/v:data").values) == 100


def test_a_log_longer_than_the_head_is_read_as_a_short_one(tmp_path):
    # Twelve times the drive, with blank lines, comments and a gap beyond the lines in which names are found.
    short = table(tmp_path).read_text().splitlines()
    header, lines = short[0], short[1:]
    many = [header]
    for lap in range(12):
        for line in lines:
            t, rest = line.split(",", 1)
            many.append(f"{float(t) + 20 * lap:.3f},{rest}")
    many[11_000] = many[11_000].rsplit(",", 1)[0] + ","
    many[12_000:12_000] = ["", "# a break", "   "]
    file = tmp_path / "long.csv"
    file.write_text("\n".join(many) + "\n")
    columns = imported(file, mapping(tmp_path, PLAIN), tmp_path)
    assert len(columns["time"]) == 12 * len(TIME) and np.isfinite(columns["yaw_rate"]).all()
    close({name: values[: len(TIME)] for name, values in columns.items()}, vx=VX, yaw_rate=YAW_RATE)
    last = slice(11 * len(TIME), None)
    close({n: values[last] - (220 if n == "time" else 0) for n, values in columns.items()}, vx=VX, yaw_rate=YAW_RATE)
    many[15_000] = many[15_000].rsplit(",", 1)[0] + ",SENSOR"
    file.write_text("\n".join(many) + "\n")
    assert any("'SENSOR' in line 15001" in note for note in open_log(file).notes)


def test_a_wide_table_is_read(tmp_path):
    file = tmp_path / "wide.csv"
    names = [f"channel number {place}" for place in range(10_000)]
    file.write_text(",".join(names) + "\n" + (",".join(["1.5"] * len(names)) + "\n") * 5)
    assert len(",".join(names)) > 131_072  # the longest field that csv takes by itself
    assert open_log(file).names == names
