"""FMUs unpacked once for all tests of the C interface."""

import pytest
from instance import VERSIONS, Library, unpack


@pytest.fixture(scope="session")
def libraries(fmus, tmp_path_factory) -> dict[str, Library]:
    return unpack(fmus, tmp_path_factory.mktemp("fmus"))


@pytest.fixture(scope="session")
def of_version(fmus, tmp_path_factory):
    """FMUs of a version of FMI, unpacked; gives the same at each call."""
    unpacked: dict[str, dict[str, Library]] = {}

    def of_version(version: str) -> dict[str, Library]:
        if version not in unpacked:
            unpacked[version] = unpack(fmus / VERSIONS[version], tmp_path_factory.mktemp(f"fmi-{version}"))
        return unpacked[version]

    return of_version
