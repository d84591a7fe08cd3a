"""What an FMU and a system say of themselves to tools for credible simulation: SRMD, read by a foreign reader.

The meta data of an archive are those of its content: checksums, GUID and version are compared with what stands in it.
"""

from __future__ import annotations

import hashlib
import zipfile
from pathlib import Path

import fmpy
import pytest
import tomllib
from fmpy.validation import validate_fmu
from instance import UNITS as FMUS
from wiring import SYSTEMS

pyssp = pytest.importorskip("pyssp_standard", reason="pyssp-standard, which reads SRMD, is not on this platform")

FILE = "extra/org.ssp-standard.ssp-traceability.srmd/resourceMetaData.srmd"
VERSIONS = ["", "fmi3"]
VERSION = tomllib.loads((Path(__file__).parents[2] / "Cargo.toml").read_text())["workspace"]["package"]["version"]


def read(archive: Path, tmp_path: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Keywords of the model, and checksums of what is compared with them by the way."""
    with zipfile.ZipFile(archive) as package:
        file = Path(package.extract(FILE, tmp_path))
        with pyssp.SRMD(file) as srmd:
            srmd.__check_compliance__()  # against the schema, of XSD 1.1
            model, content = (
                {entry.keyword: entry.text for entry in classification.classification_entries}
                for classification in srmd.classifications
            )
        for name, checksum in content.items():
            assert checksum == f"sha3-256:{hashlib.sha3_256(package.read(name)).hexdigest()}", name
        parts = ("binaries/", "modelDescription.xml", "resources/", "SystemStructure.ssd")
        assert set(content) == {name for name in package.namelist() if name.startswith(parts)}
    assert model["model.name"] == archive.stem and model["model.version"] == VERSION
    return model, content


@pytest.mark.parametrize("folder", VERSIONS)
@pytest.mark.parametrize("name", FMUS)
def test_an_fmu_tells_what_it_is(fmus, tmp_path, name, folder):
    fmu = fmus / folder / f"{name}.fmu"
    model, _ = read(fmu, tmp_path)
    description = fmpy.read_model_description(str(fmu))
    assert model["model.guid"] == description.guid
    assert model["model.implementation.format"] == f"FMI {description.fmiVersion}"
    assert validate_fmu(str(fmu)) == []


@pytest.mark.parametrize("folder", VERSIONS)
@pytest.mark.parametrize("name", SYSTEMS)
def test_a_system_tells_what_it_is_made_of(fmus, tmp_path, name, folder):
    _, content = read(fmus / folder / f"{name}.ssp", tmp_path)
    assert {f"resources/{unit}.fmu" for unit in SYSTEMS[name]} <= set(content)
