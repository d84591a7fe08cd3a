"""FMUs unpacked once for all tests of the C interface."""

import pytest
from instance import Library, unpack


@pytest.fixture(scope="session")
def libraries(fmus, tmp_path_factory) -> dict[str, Library]:
    return unpack(fmus, tmp_path_factory.mktemp("fmus"))
