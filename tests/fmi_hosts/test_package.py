"""What is in an FMU: description, binary, files. Checked by tools that others wrote."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import fmpy.validation
import numpy as np
import pytest
from instance import UNITS as FMUS

GLIBC = (2, 17)  # what the README promises where the cross linker was used

ROOT = Path(__file__).resolve().parents[2]
# FMUs that are built as they are shipped. `scripts/test` builds one of them, and all for this machine alone.
SHIPPED_FOLDER = Path(os.environ.get("RFL_SHIPPED") or os.environ.get("RFL_FMUS") or ROOT / "target" / "fmu-shipped")
SHIPPED = [name for name in FMUS if (SHIPPED_FOLDER / f"{name}.fmu").is_file()]
needs_shipped = pytest.mark.skipif(
    not SHIPPED, reason="no FMU as it is shipped: scripts/build-fmus --only PassengerCar --out target/fmu-shipped"
)

# All functions of the standard's header, of which fmpy has a copy; those for model exchange, too, because some hosts
# look for all of them whatever they use.
HEADER = (Path(fmpy.__file__).parent / "c-code" / "fmi2Functions.h").read_text()
SYMBOLS = set(re.findall(r"fmi2FullName\((fmi2\w+)\)", HEADER))
assert len(SYMBOLS) == 44


def run(*command) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize("name", FMUS)
def test_fmpy_validation_reports_nothing(fmus, name):
    assert fmpy.validation.validate_fmu(str(fmus / f"{name}.fmu")) == []


@pytest.mark.parametrize("name", FMUS)
def test_fmpy_validate_command_reports_nothing(fmus, name):
    command = [sys.executable, "-m", "fmpy", "validate", str(fmus / f"{name}.fmu")]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "no problems found" in (result.stdout + result.stderr).lower()


def fmutool_reports_nothing(fmu: Path, version: str) -> None:
    tool = shutil.which("fmutool", path=str(Path(sys.executable).parent)) or shutil.which("fmutool")
    if tool is None:
        pytest.skip("fmutool (fmu-manipulation-toolbox) is not installed")
    result = subprocess.run([tool, "-input", str(fmu), "-check"], capture_output=True, text=True, check=False)
    output = result.stdout + result.stderr
    assert result.returncode == 0, output
    complaints = [line for line in output.splitlines() if re.match(r"(ERROR|WARNING|CRITICAL)", line)]
    assert not complaints, output
    # The checker did run, and said so.
    assert f"seems to be compliant with FMI-{version}" in output and "No semantic error" in output, output


@pytest.mark.parametrize("name", FMUS)
def test_fmutool_check_reports_nothing(fmus, name):
    fmutool_reports_nothing(fmus / f"{name}.fmu", "2.0")


@pytest.mark.parametrize("name", FMUS)
def test_binary_exports_the_standards_functions_and_nothing_else(libraries, name):
    exported = {line.split()[-1] for line in run("nm", "-D", "--defined-only", libraries[name].binary).splitlines()}
    assert exported == SYMBOLS


@pytest.fixture
def shipped_binaries(tmp_path):
    """The Linux libraries of an FMU that is built as it is shipped, of FMI 2.0 and of 3.0."""

    def binaries(name: str) -> list[Path]:
        found = []
        for folder, platform in (("", "linux64"), ("fmi3", "x86_64-linux")):
            with zipfile.ZipFile(SHIPPED_FOLDER / folder / f"{name}.fmu") as package:
                found.append(Path(package.extract(f"binaries/{platform}/{name}.so", tmp_path / platform)))
        return found

    return binaries


@needs_shipped
@pytest.mark.parametrize("name", SHIPPED or FMUS[:1])
def test_binary_needs_only_libc_libm_and_the_loader(shipped_binaries, name):
    for binary in shipped_binaries(name):
        needed = set(re.findall(r"\(NEEDED\).*\[(.*?)\]", run("readelf", "-d", binary)))
        # Up to glibc 2.33 threads and dlopen are libraries of their own, parts of glibc as libc itself.
        assert needed <= {"libc.so.6", "libm.so.6", "ld-linux-x86-64.so.2", "libpthread.so.0", "libdl.so.2"}, needed


@needs_shipped
@pytest.mark.parametrize("name", SHIPPED or FMUS[:1])
def test_binary_runs_on_an_old_glibc(shipped_binaries, name):
    if shutil.which("cargo-zigbuild", path=str(Path(sys.executable).parent)) is None:
        pytest.skip("cargo-zigbuild is not installed: the FMUs are built for this machine's glibc")
    for binary in shipped_binaries(name):
        versions = re.findall(r"GLIBC_(\d+)\.(\d+)", run("readelf", "--version-info", binary))
        assert max((int(a), int(b)) for a, b in versions) <= GLIBC


@needs_shipped
@pytest.mark.parametrize("name", SHIPPED or FMUS[:1])
def test_no_place_of_the_machine_that_built_it_is_in_the_binary(shipped_binaries, name):
    root = str(ROOT).encode()
    for binary in shipped_binaries(name):
        assert root not in binary.read_bytes()


@needs_shipped
def test_the_bits_are_those_of_any_build(fmus):
    if fmus == SHIPPED_FOLDER:
        pytest.skip("one build only: RFL_SHIPPED names another")
    time = np.arange(0, 5, 0.02)
    columns = [time, np.full_like(time, 1.0), 0.05 * np.sin(time)]
    commands = np.rec.fromarrays(columns, names=["time", "accel_cmd", "steer_cmd"])
    drives = [
        fmpy.simulate_fmu(
            str(folder / "PassengerCar.fmu"),
            stop_time=5,
            input=commands,
            output_interval=0.02,
            output=["x", "y", "yaw"],
            start_values={"initial.vx": 15.0},
        )
        for folder in (fmus, SHIPPED_FOLDER)
    ]
    assert drives[0]["x"][-1] > 50 and abs(drives[0]["yaw"][-1]) > 0.01
    assert drives[0].tobytes() == drives[1].tobytes()


@pytest.mark.parametrize("name", FMUS)
def test_package_has_documentation_licences_and_description(fmus, name):
    with zipfile.ZipFile(fmus / f"{name}.fmu") as package:
        files = package.namelist()
        assert package.testzip() is None
        assert "modelDescription.xml" in files
        assert "documentation/index.html" in files
        assert any(file.startswith("documentation/licenses/") for file in files), files
        assert {"terminalsAndIcons/terminalsAndIcons.xml", "terminalsAndIcons/icon.png", "model.png"} <= set(files)
        committed = Path(__file__).parents[2] / "modelDescription" / f"{name}.xml"
        assert package.read("modelDescription.xml").decode() == committed.read_text(encoding="utf-8")
