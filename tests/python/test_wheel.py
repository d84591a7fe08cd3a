"""The wheel in a new environment, without Rust: installed, and to a report; with RFL_WHEELS=1, on a wheel in dist/."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = """
import json, os, shutil, sys, warnings
assert shutil.which("cargo") is None and shutil.which("rustc") is None
import rfl_mpc
assert rfl_mpc.__file__.startswith(sys.prefix), rfl_mpc.__file__
drive = rfl_mpc.drive("sudoku_turns", set={"effect.steer_lag": 0.08, "effect.steer_delay": 0.06}, duration=30)
report = rfl_mpc.diagnose(drive.log, out="out")
assert os.path.getsize("out/report.html") > 100_000
print(json.dumps({"kind": report.verdict["kind"], "fmus": sorted(rfl_mpc.fmus("3.0")), "version": rfl_mpc.__version__}))
"""


@pytest.mark.skipif(not os.environ.get("RFL_WHEELS"), reason="installs packages: RFL_WHEELS=1, after scripts/wheels")
def test_a_clean_environment_comes_to_a_report(tmp_path):
    machine = sysconfig.get_platform().split("-")[-1]
    wheels = [file for file in sorted((ROOT / "dist").glob("*.whl")) if machine in file.name and "linux" in file.name]
    assert wheels, f"there is no wheel for {machine} in dist/: run scripts/wheels"
    begin = time.monotonic()
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)} | {
        name: value for name, value in os.environ.items() if name.startswith(("PIP_", "SSL_", "REQUESTS_"))
    }
    base = getattr(sys, "_base_executable", sys.executable)
    subprocess.run([base, "-m", "venv", tmp_path / "venv"], check=True, env=environment)
    python = tmp_path / "venv" / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "--quiet", wheels[-1]], check=True, env=environment)
    installed = time.monotonic()
    done = subprocess.run(
        [python, "-c", SCRIPT], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert '"kind"' in done.stdout and "TruckRflMpc" in done.stdout
    program = tmp_path / "venv" / "bin" / "rfl"
    told = subprocess.run([program, "--version"], capture_output=True, text=True, check=True, env=environment)
    assert told.stdout.startswith("rfl ")
    ended = time.monotonic()
    print(f"installed in {installed - begin:.1f} s, report after {ended - begin:.1f} s")
