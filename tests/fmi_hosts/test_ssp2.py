"""Systems of FMUs of FMI 3.0, in SSP 2.0: the schema holds, and they are the systems of SSP 1.0 in other words.

No master here runs SSP 2.0 with units of FMI 3.0 (Ecos and fmpy know 1.0): the drive is our own, of what stands in the
archive.
"""

from __future__ import annotations

import importlib.util
import json
import zipfile
from pathlib import Path

import pytest
from lxml import etree
from test_same_drive import assert_same_drive, exact_lengths, in_host, jacobi
from wiring import SYSTEMS

SSP = "http://ssp-standard.org/SSP1/SystemStructure"
NAMES = {"ssd": f"{SSP}Description", "ssc": f"{SSP}Common", "ssv": f"{SSP}ParameterValues"}
FOLDERS = {"1.0": ".", "2.0": "fmi3"}


def read(fmus: Path, version: str, system: str, entry="SystemStructure.ssd") -> etree._Element:
    with zipfile.ZipFile(fmus / FOLDERS[version] / f"{system}.ssp") as package:
        root = etree.fromstring(package.read(entry))
    assert root.get("version") == version
    return root


def parameters(root: etree._Element) -> dict[str, str]:
    """Values by name, whatever their type."""
    found = root.findall(".//ssv:Parameter", NAMES)
    return {parameter.get("name"): parameter[0].get("value") for parameter in found}


@pytest.mark.parametrize("system", SYSTEMS)
def test_schema_of_2_0_holds(fmus, system):
    package = importlib.util.find_spec("pyssp_standard")
    if package is None:
        pytest.skip("pyssp-standard, which has the schema of SSP 2.0, is not installed on this platform")
    schemas = Path(package.origin).parent / "resources" / "ssp2"
    for kind, entry in (("Description", "SystemStructure.ssd"), ("ParameterValues", f"resources/{system}.ssv")):
        schema = etree.XMLSchema(file=str(schemas / f"SystemStructure{kind}.xsd"))
        schema.assertValid(read(fmus, "2.0", system, entry))


@pytest.mark.parametrize("system", SYSTEMS)
def test_systems_are_those_of_1_0(fmus, system):
    old, new = (read(fmus, version, system) for version in FOLDERS)
    for element in ("Component", "Connection"):
        both = ([dict(found.attrib) for found in root.iterfind(f".//ssd:{element}", NAMES)] for root in (old, new))
        assert next(both) == next(both)
    assert parameters(new) == parameters(old) != {}
    assert new.find(".//ssc:Dimension", NAMES) is not None and new.find(".//ssc:Real", NAMES) is None


@pytest.mark.parametrize("system", SYSTEMS)
def test_units_are_those_of_3_0(fmus, system):
    with zipfile.ZipFile(fmus / "fmi3" / f"{system}.ssp") as package:
        for name in SYSTEMS[system]:
            assert package.read(f"resources/{name}.fmu") == (fmus / "fmi3" / f"{name}.fmu").read_bytes()


@pytest.mark.parametrize("system", SYSTEMS)
def test_drive_is_that_of_1_0(fmus, tmp_path, system):
    """Units, wires and values out of the archive, on fmuloader."""
    root = read(fmus, "2.0", system)
    with zipfile.ZipFile(fmus / "fmi3" / f"{system}.ssp") as package:
        for component in root.iterfind(".//ssd:Component", NAMES):
            (tmp_path / f"{component.get('name')}.fmu").write_bytes(package.read(component.get("source")))
    values = {
        component.get("name"): {name: json.loads(value) for name, value in parameters(component).items()}
        for component in root.iterfind(".//ssd:Component", NAMES)
    }
    theirs = in_host("fmuloader", tmp_path, tmp_path / "drive.json", values, system=system)
    assert_same_drive(theirs, jacobi(fmus, None, exact_lengths, system=system))
