"""fmi-sim, a host of both versions of FMI that others wrote in Rust, where it is installed.

    LIBCLANG_PATH=... cargo install fmi-sim

fmi-sim 0.7.0 does not read the attribute `unit` of a `Float64`, which the schema of 3.0 has, and asks
for one value of an array of several. It gets copies of the FMUs whose descriptions have no units and no
arrays, and all else as it is.
"""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest
from instance import CLOCKED, STEP, UNITS

STOP = 2.0  # s
UNIT = re.compile(rb' (?:unit|displayUnit|quantity)="[^"]*"')
ARRAY = re.compile(rb'\s*<Float64 [^>]*valueReference="(\d+)"[^>]*>\s*<Dimension [^>]*/>\s*</Float64>')
FMI_SIM = shutil.which("fmi-sim", path=os.pathsep.join([os.environ["PATH"], str(Path.home() / ".cargo" / "bin")]))
pytestmark = pytest.mark.skipif(FMI_SIM is None, reason="FMI-SIM IS NOT TRIED: it is missing (cargo install fmi-sim)")


def simplified(file: Path, copy: Path) -> Path:
    """A copy of an FMU of 3.0 whose description has no units and no arrays."""
    with zipfile.ZipFile(file) as package, zipfile.ZipFile(copy, "w", zipfile.ZIP_DEFLATED) as out:
        for name in package.namelist():
            content = package.read(name)
            if name == "modelDescription.xml":
                content = re.sub(rb"<Float64(?:Type)? [^>]*>", lambda element: UNIT.sub(b"", element[0]), content)
                for reference in ARRAY.findall(content):
                    known = rb'\s*<(?:Output|InitialUnknown) valueReference="%s"[^>]*/>' % reference
                    content = re.sub(known, b"", content)
                content = ARRAY.sub(b"", content)
            out.writestr(name, content)
    return copy


def simulate(file: Path, out: Path) -> list[dict[str, str]]:
    """The outputs at each step."""
    options = ["-f", str(STOP), "--step", str(STEP), "--output-interval", str(STEP)]
    command = [FMI_SIM, "--model", file, "-o", out, "co-simulation", *options]
    made = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stdout + made.stderr
    with open(out, newline="") as table:
        return list(csv.DictReader(table))


@pytest.mark.parametrize("name", UNITS)
def test_both_versions_give_the_same(fmus, tmp_path, name):
    old = simulate(fmus / f"{name}.fmu", tmp_path / "2.csv")
    new = simulate(simplified(fmus / "fmi3" / f"{name}.fmu", tmp_path / f"{name}.fmu"), tmp_path / "3.csv")
    assert len(old) == len(new) == round(STOP / STEP) + 1
    # fmi-sim leaves enumerations of 3.0 out; arrays have other columns than 2.0's scalars.
    shared = [column for column in new[0] if column in old[0] and column != CLOCKED]
    assert len(shared) > 10
    assert [[row[column] for column in shared] for row in new] == [[row[column] for column in shared] for row in old]
