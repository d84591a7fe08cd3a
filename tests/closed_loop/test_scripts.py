"""What users start: the demo and the master's command line. They write what they promise, and explain what is wrong."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


def run(script: str, *arguments, ok=True) -> subprocess.CompletedProcess:
    command = [sys.executable, SCRIPTS / script, *arguments]
    result = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    assert (result.returncode == 0) == ok, result.stdout + result.stderr
    assert "Traceback" not in result.stderr
    return result


@pytest.fixture(scope="module")
def demo(fmus, tmp_path_factory):
    out = tmp_path_factory.mktemp("demo")
    result = run("demo.py", "--plain", "--fmus", fmus, "--duration", "20", "--out", out)
    return out, result.stdout


def test_demo_writes_results(demo):
    out, _ = demo
    results = json.loads((out / "results.json").read_text())
    assert set(results) == {"routes", "step", "real_time_factor"}
    assert (
        {"sudoku_test", "hairpin_circuit"} <= set(results["routes"]) <= {"sudoku_test", "hairpin_circuit", "norisring"}
    )
    for figures in results["routes"].values():
        assert set(figures) == {"mae", "rmse", "max", "outcome", "reason"}
        # Cut by --duration, on the road until then.
        assert figures["outcome"] == "timed_out" and "duration was over" in figures["reason"]
        assert 0 < figures["mae"] <= figures["rmse"] <= figures["max"]
    step = results["step"]
    assert set(step) == {"mean_s", "p99_s", "max_s", "missed"}
    assert 0 < step["mean_s"] <= step["max_s"] and step["p99_s"] <= step["max_s"]
    assert results["real_time_factor"] > 1


def test_demo_prints_the_table(demo):
    out, printed = demo
    results = json.loads((out / "results.json").read_text())
    for name, figures in results["routes"].items():
        line = next(line for line in printed.splitlines() if line.startswith(name))
        assert [f"{figures[key]:.4f}" for key in ("mae", "rmse", "max")] == line.split()[-3:]
    for words in ("missed deadlines", "real-time factor", "index.html"):
        assert words in printed


def test_demo_page_is_self_contained(demo):
    out, _ = demo
    page = (out / "index.html").read_text(encoding="utf-8")
    own = page.replace(page[page.index("<script>") : page.index("</script>")], "")  # without the embedded library
    assert "http://" not in own and "https://" not in own
    assert "<link" not in own and "src=" not in own
    assert "prefers-color-scheme: dark" in own and "@media print" in own
    for name in json.loads((out / "results.json").read_text())["routes"]:
        assert f"<h2>{name}</h2>" in own


def test_drive_log_has_the_vocabularys_columns(demo):
    out, _ = demo
    with open(out / "sudoku_test.csv", newline="") as file:
        header, *rows = csv.reader(file)
    vocabulary = [
        "time",
        "steer_cmd",
        "accel_cmd",
        "x",
        "y",
        "yaw",
        "vx",
        "vy",
        "yaw_rate",
        "ax",
        "ay",
        "steer",
        "roll",
    ]
    vocabulary += ["e1", "e1_rate", "e2", "e2_rate", "station", "curvature", "status"]
    assert [name for name in header if name in vocabulary] == vocabulary
    assert len(rows) == 1000
    assert all(float(a[0]) < float(b[0]) for a, b in pairwise(rows))
    assert header[-1] == "status" and "optimal" in {row[-1] for row in rows}


def test_master_drives_and_logs(fmus, paths, tmp_path):
    log = tmp_path / "drive.csv"
    road = paths / "hairpin_circuit.csv"
    result = run("closed_loop.py", "--fmus", fmus, "--path", road, "--duration", "5", "--log", log)
    assert "lateral error" in result.stdout
    assert len(log.read_text().splitlines()) == 251


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--path", "nowhere.csv"], ["nowhere.csv", "cannot be read"]),
        (["--vehicle", "nothing.toml"], ["nothing.toml"]),
        (["--set", "mpc.q_e7=1"], ["mpc.q_e7", "no variable", "mpc.q_e1"]),
        (["--set", "mpc.q_e1"], ["NAME=VALUE"]),
        (["--set", "mpc.q_e1=-1e9"], ["mpc.q_e1", "range"]),
        (["--set", "vehicle.mass=heavy"], ["vehicle.mass", "heavy"]),
        (["--step", "0"], ["--step 0", "0.001 and 0.2 s"]),
        (["--step", "nan"], ["--step nan", "0.001 and 0.2 s"]),
        (["--step", "1e-9"], ["--step 1e-09", "0.001 and 0.2 s"]),
        (["--lane", "0"], ["--lane 0", "m"]),
        (["--log", "one.csv", "--json", "one.csv"], ["--log and --json are one file"]),
    ],
)
def test_master_explains_what_is_wrong(fmus, arguments, words):
    result = run("closed_loop.py", "--fmus", fmus, "--duration", "1", *arguments, ok=False)
    for word in words:
        assert word in result.stderr


def test_missing_fmus_are_explained(tmp_path):
    result = run("closed_loop.py", "--fmus", tmp_path, ok=False)
    assert "RflMpc.fmu" in result.stderr and "scripts/build-fmus" in result.stderr
