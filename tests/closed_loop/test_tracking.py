"""How well the nominal controller tracks, through the FMUs: the figures that the README promises."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from closed_loop import STEP, drive

CARS = ["c_class", "bmw_320i", "ford_escort", "vw_vanagon", "genesis"]


def drive_on(fmus, paths, road, **options):
    file = road if hasattr(road, "suffix") else paths / f"{road}.csv"
    return drive(file, fmus=fmus, **options)


def test_sudoku_test_route_within_five_centimetres(fmus, paths):
    driven = drive_on(fmus, paths, "sudoku_test")
    e1 = np.abs(driven.columns["e1"])
    assert driven.finished
    assert e1.mean() <= 0.05
    assert np.ptp(driven.columns["station"]) > 1000.0  # a route, not a street
    # It drives, it does not creep: the generator's speeds are 10 to 50 km/h.
    assert driven.columns["vx"].mean() > 15 / 3.6


def test_hairpin_circuit_is_completed(fmus, paths):
    driven = drive_on(fmus, paths, "hairpin_circuit")
    assert driven.finished
    assert np.abs(driven.columns["e1"]).max() < 1.0


def test_real_circuit_is_completed(fmus, paths):
    file = paths.parent.parent / "shared" / "data" / "paths" / "tum_Norisring.csv"
    if not file.is_file():
        pytest.skip("tum_Norisring.csv (racetrack-database, LGPL-3.0) is not here; it is not part of the project")
    driven = drive_on(fmus, paths, file)
    assert driven.finished
    assert np.abs(driven.columns["e1"]).max() < 1.0


@pytest.mark.parametrize("car", CARS)
def test_every_car_is_kept_on_its_lane(fmus, paths, car):
    vehicle = paths.parent / "vehicles" / f"{car}.toml"
    driven = drive_on(fmus, paths, "hairpin_circuit", vehicle=vehicle)
    assert driven.finished
    assert np.abs(driven.columns["e1"]).max() < 1.0


@functools.cache
def usual_drive(fmus, paths):
    return drive_on(fmus, paths, "hairpin_circuit", duration=20.0)


@pytest.mark.parametrize("step", [0.001, 0.005, 0.01, 0.04])
def test_any_communication_step(fmus, paths, step):
    """The car integrates at its own step and the controller computes at its own Ts, whatever the host's step is."""
    usual = usual_drive(fmus, paths).columns
    other = drive_on(fmus, paths, "hairpin_circuit", duration=20.0, step=step).columns
    if step < STEP:
        # The same samples of the controller, the same car: only the sums of the sub-steps are rounded differently.
        every = round(STEP / step)
        for name in ("x", "y", "steer_cmd"):
            rows = min(len(usual[name]), len(other[name][::every]))
            np.testing.assert_allclose(other[name][::every][:rows], usual[name][:rows], atol=1e-6)
    assert np.abs(other["e1"]).max() < 1.0


def test_an_effect_is_felt(fmus, paths):
    """A switch of the plant that any host can set: dead time of the steering makes tracking worse."""
    usual = drive_on(fmus, paths, "hairpin_circuit", duration=40.0)
    delayed = drive_on(fmus, paths, "hairpin_circuit", duration=40.0, settings={"effect.steer_delay": 0.06})
    assert np.abs(delayed.columns["e1"]).mean() > np.abs(usual.columns["e1"]).mean()
