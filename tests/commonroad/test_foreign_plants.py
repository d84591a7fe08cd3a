"""The default controller's FMU on plants of others: none is lost, whatever its steering."""

import pytest

pytest.importorskip("vehiclemodels", reason="commonroad-vehicle-models is not installed")

from foreign_plants import SUV, cases, make


@pytest.mark.parametrize("name", ["ford_escort", "bmw_320i", "vw_vanagon", "suv"])
def test_an_unknown_steering_is_driven(name, tmp_path, rfl, fmus):
    if name == "suv" and not SUV.is_dir():
        pytest.skip(f"{SUV} is absent")
    case = next(case for case in cases(tmp_path, rfl, 1) if (case.plant, case.row) == (name, "default"))
    driven = make((case, fmus, None))
    assert driven["outcome"] == "completed", driven["reason"]
    assert driven["max"] <= 0.4
