"""The fleet's statistics: against dense linear algebra, and on fleets drawn from the model itself."""

from __future__ import annotations

import importlib
import math
from dataclasses import replace

import numpy as np
import pytest


@pytest.fixture(scope="module")
def fleet(rfl_mpc):
    pytest.importorskip("scipy", reason="the extra [fleet] is not installed")

    class Modules:
        summary = importlib.import_module("rfl_mpc.fleet.summary")
        hierarchy = importlib.import_module("rfl_mpc.fleet.hierarchy")
        changes = importlib.import_module("rfl_mpc.fleet.changes")
        reduce = importlib.import_module("rfl_mpc.fleet.reduce")

    return Modules


def parameters(fleet, tolerances, changes, least=-np.inf):
    return tuple(
        fleet.summary.Parameter(f"effect.e{i}", 0.0, "1", False, tolerance, change, least, np.inf, None)
        for i, (tolerance, change) in enumerate(zip(tolerances, changes))
    )


def test_marginalising_is_that_of_dense_gaussians(fleet):
    rng = np.random.default_rng(1)
    slopes = rng.normal(size=(7, 3))
    seen = rng.normal(size=7)
    variance = np.array([0.5, 0.0, 2.0])
    # seen = slopes (theta + w) + noise of deviation 1.
    cover = np.linalg.inv(np.eye(7) + slopes @ np.diag(variance) @ slopes.T)
    precision, shift = fleet.hierarchy.without(slopes.T @ slopes, slopes.T @ seen, variance)
    assert np.allclose(precision, slopes.T @ cover @ slopes, atol=1e-12)
    assert np.allclose(shift, slopes.T @ cover @ seen, atol=1e-12)


def test_probabilities_of_changes_are_those_of_dense_gaussians(fleet):
    """Every hypothesis by the determinant and the quadratic form of the covariance of all measurements."""
    rng = np.random.default_rng(3)
    count, size, rows = 5, 3, 4
    between_vehicles, between_drives = np.array([0.4, 0.3, 0.0]), np.array([0.2, 0.1, 0.0])
    all = parameters(fleet, [1.0, 1.0, 0.0], [3.0, 0.0, 2.0])
    slopes = rng.normal(size=(count, rows, size))
    theta = np.array([[0.3, -0.2, 0.0]] * 3 + [[2.3, -0.2, 0.0]] * 2)
    seen = np.einsum("drs,ds->dr", slopes, theta) + rng.normal(size=(count, rows))
    drives = fleet.summary.Drives(
        all, np.einsum("drs,drt->dst", slopes, slopes), np.einsum("drs,dr->ds", slopes, seen)
    )  # fmt: skip
    nothing = np.zeros((size, size))
    none = np.zeros(size)
    spread = fleet.hierarchy.Spread(
        np.array([True, True, False]), none, nothing, between_vehicles, between_drives, none, nothing
    )
    found = fleet.changes.Vehicle(drives, spread)._next(count, [])
    change, nothing_more = found[0], found[3]

    stacked = slopes.reshape(-1, size)
    drive_of = np.repeat(np.arange(count), rows)
    same = drive_of[:, None] == drive_of
    base = np.eye(len(stacked)) + stacked @ np.diag(between_vehicles) @ stacked.T
    base += same * (stacked @ np.diag(between_drives) @ stacked.T)

    def log_likelihood(cover):
        return -0.5 * (np.linalg.slogdet(cover)[1] + seen.ravel() @ np.linalg.solve(cover, seen.ravel()))

    # Of scaled parameters: one without a tolerance is scaled by the size of what is named.
    deviation = {0: 3.0, 2: 1.0}
    log_prior = {True: [math.log(fleet.changes.ORDINARY.passing)] * count}
    log_prior[False] = [math.log(fleet.changes.FROM_THE_START)] + [math.log(fleet.changes.ORDINARY.lasting)] * (
        count - 1
    )
    weights = {None: 0.0}
    for passing in (False, True):
        for effect in (0, 2):
            for k in range(count):
                has = drive_of == k if passing else drive_of >= k
                column = stacked[:, effect] * has * deviation[effect]
                sizes = [np.outer(column, column) * share**2 for share in fleet.changes.SIZES]
                more = [log_likelihood(base + size) - log_likelihood(base) for size in sizes]
                more = np.logaddexp.reduce(more) - math.log(len(sizes))
                weights[effect, passing, k] = more + log_prior[passing][k] - math.log(2)
    total = np.logaddexp.reduce(list(weights.values()))
    of = [math.exp(weights[0, False, k] - total) for k in range(count)]
    assert change.effect == "e0" and not change.passing and change.since == int(np.argmax(of))
    assert nothing_more == pytest.approx(math.exp(-total), rel=1e-6)
    assert change.probability == pytest.approx(sum(of), rel=1e-6)


def drawn(fleet, rng, vehicles, drives, *, of=None, common=None, change=None, levels=None):
    """A fleet from the model: four parameters with tolerances, one without; ``of``: shares; ``change`` puts one in.
    Vehicles have ``levels``, or are drawn."""
    all = parameters(fleet, [1.0, 1.0, 1.0, 1.0, 0.0], [4.0, 4.0, 0.0, 4.0, 4.0])
    between_vehicles, between_drives = of
    mean = np.array([0.4, -0.6, 0.8, 0.0, 0.0]) if common is None else common
    precision, shift, number = [], [], []
    for vehicle in range(vehicles):
        own = mean + (rng.normal(size=5) * np.sqrt(between_vehicles) if levels is None else levels[vehicle])
        for drive in range(drives):
            slopes = rng.normal(size=(12, 5))
            theta = own + rng.normal(size=5) * np.sqrt(between_drives)
            if change is not None:
                theta = theta + change(vehicle, drive)
            precision.append(slopes.T @ slopes)
            shift.append(slopes.T @ (slopes @ theta + rng.normal(size=12)))
            number.append(vehicle)
    return fleet.summary.Drives(all, np.array(precision), np.array(shift)), np.array(number)


def test_spreads_of_vehicles_and_drives_are_found(fleet):
    rng = np.random.default_rng(5)
    vehicles, drives = np.array([0.5, 0.05, 0.2, 0.3, 0.0]), np.array([0.05, 0.6, 0.2, 0.1, 0.0])
    of, number = drawn(fleet, rng, 60, 20, of=(vehicles, drives))
    found = fleet.hierarchy.spread(of, number)
    for truth, value in [*zip(vehicles[:4], found.between_vehicles), *zip(drives[:4], found.between_drives)]:
        assert 0.5 * truth < value < 2.0 * truth
    off = (found.mean - np.array([0.4, -0.6, 0.8, 0.0, 0.0]))[:4] / np.sqrt(np.diag(found.covariance))[:4]
    assert np.abs(off).max() < 3.5


def reduced(fleet, drives, number):
    """As the command does it, from summaries."""
    triangle = np.tril_indices(len(drives.parameters))
    rows = [
        {"name": it.name, "given": it.given, "unit": it.unit, "tolerance": it.tolerance, "change": it.change}
        | {"value": 0.0, "least": it.least, "greatest": it.greatest, "goes_with": it.goes_with}
        for it in drives.parameters
    ]  # fmt: skip
    size = np.array([it.scale for it in drives.parameters])

    def summaries(vehicle):
        return [
            {
                "parameters": rows,
                "precision": (drives.precision[row] / np.outer(size, size))[triangle].tolist(),
                "gradient": (drives.shift[row] / size).tolist(),
                "temper": 1.0,
            }
            for row in np.flatnonzero(number == int(vehicle))
        ]

    state = fleet.reduce.reduce_type("type", [str(vehicle) for vehicle in range(number.max() + 1)], summaries)
    fleet.reduce.say([state])
    return state


def test_what_all_sisters_share_is_said_of_the_type_and_changes_of_their_vehicles(fleet):
    rng = np.random.default_rng(8)
    shares = (np.array([0.3, 0.3, 0.3, 0.3, 0.0]), np.array([0.2, 0.2, 0.2, 0.2, 0.0]))
    size = {3: (0, 6, 3.0), 9: (3, 4, -3.5), 12: (4, 7, 1.3)}

    def change(vehicle, drive):
        more = np.zeros(5)
        if vehicle in size and drive >= size[vehicle][1]:
            more[size[vehicle][0]] = size[vehicle][2]
        return more

    common = np.array([0.2, 6.0, -0.3, 0.1, 0.0])
    state = reduced(fleet, *drawn(fleet, rng, 24, 12, of=shares, common=common, change=change))
    assert [one.effect for one in state.common] == ["e1"]
    assert state.common[0].low < 6.0 < state.common[0].high
    assert [state.parameters[place].name for place in state.differs] == ["effect.e1"]
    said = {
        int(one.vehicle): [(it.effect, it.since) for it, is_said in zip(one.changes, one.said) if is_said]
        for one in state.vehicles
    }
    assert {vehicle: of for vehicle, of in said.items() if of} == {3: [("e0", 6)], 9: [("e3", 4)], 12: [("e4", 7)]}
    for vehicle, (effect, _, value) in size.items():
        it = next(one for one in state.vehicles if int(one.vehicle) == vehicle).changes[0]
        scale = state.parameters[effect].scale
        assert it.value - it.before == pytest.approx(value * scale, abs=1.0 * scale), vehicle


def test_an_error_of_many_tolerances_is_the_type_s_and_no_spread(fleet):
    rng = np.random.default_rng(11)
    shares = (np.array([0.3, 0.3, 0.3, 0.3, 0.0]), np.array([0.2, 0.2, 0.2, 0.2, 0.0]))
    common = np.array([0.2, 14.0, -0.3, 0.1, 0.0])
    state = reduced(fleet, *drawn(fleet, rng, 9, 25, of=shares, common=common))
    assert [one.effect for one in state.common] == ["e1"]
    assert state.common[0].low < 14.0 < state.common[0].high
    assert state.spread.between_vehicles[1] < 1.0
    assert not any(any(one.said) for one in state.vehicles)


@pytest.mark.parametrize("begin", [0, 1])
def test_one_changed_vehicle_of_two_is_no_error_of_both(fleet, begin):
    rng = np.random.default_rng(19)
    shares = (np.array([0.3, 0.3, 0.3, 0.3, 0.0]), np.array([0.2, 0.2, 0.2, 0.2, 0.0]))

    def change(vehicle, drive):
        return np.array([0.0, 9.0, 0.0, 0.0, 0.0]) * (vehicle == 1 and drive >= begin)

    state = reduced(fleet, *drawn(fleet, rng, 2, 3, of=shares, common=np.zeros(5), change=change))
    assert not state.common
    sound, changed = state.vehicles
    assert not any(sound.said)
    assert [(one.effect, one.since) for one, said in zip(changed.changes, changed.said) if said] == [("e1", begin)]


def test_what_lies_outside_an_effect_s_range_is_not_named(fleet):
    shares = fleet.changes._log_share(np.array([-1.0, 40.0, -45.0]), np.array([1.0, 41.0, -44.0]))
    assert shares[0] == pytest.approx(math.log(0.6826894921370859))
    # log of e^(-z^2 / 2) / (z sqrt(2 pi)) far out.
    for found, z in zip(shares[1:], (40.0, 44.0)):
        assert found == pytest.approx(-0.5 * z * z - math.log(z * math.sqrt(2.0 * math.pi)), abs=1e-2)
    rng = np.random.default_rng(23)
    shares = (np.array([0.3, 0.3, 0.3, 0.3, 0.0]), np.array([0.2, 0.2, 0.2, 0.2, 0.0]))

    def change(vehicle, drive):
        return np.array([0.0, -9.0, 0.0, 0.0, 0.0]) * (vehicle == 1 and drive >= 4)

    drives, number = drawn(fleet, rng, 5, 9, of=shares, common=np.zeros(5), change=change)
    # A load is never less than none.
    bounded = tuple(replace(it, least=0.0) if it.effect == "e1" else it for it in drives.parameters)
    state = reduced(fleet, replace(drives, parameters=bounded), number)
    found = [it for one in state.vehicles for it in one.changes]
    assert not state.common and not [it for it in found if it.effect == "e1" and not it.passing]
    assert not any(any(one.said) for one in state.vehicles)


def test_of_what_all_share_any_number_of_drives_tells_as_much_as_one(fleet):
    """The likelihoods of a type against dense Gaussians: with an error that all repeat, and without."""
    rng = np.random.default_rng(29)
    shares = (np.array([0.3, 0.3, 0.3, 0.3, 0.0]), np.array([0.2, 0.2, 0.2, 0.2, 0.0]))
    drives, number = drawn(fleet, rng, 3, 4, of=shares)
    usual = fleet.hierarchy.ordinary(drives.parameters)
    seen, true = fleet.hierarchy.type_likelihoods(drives, number, usual)
    own = [np.linalg.inv(np.linalg.inv(of) + np.diag(usual.between_drives)) for of in drives.precision]
    cover = np.linalg.inv(sum(
        np.linalg.inv(np.linalg.inv(sum(own[4 * v : 4 * v + 4])) + np.diag(usual.between_vehicles)) for v in range(3)
    ))  # fmt: skip
    assert np.allclose(np.linalg.inv(seen.precision[0]), cover, rtol=1e-4)
    repeated = np.linalg.inv(sum(own) / 12)
    assert np.allclose(np.linalg.inv(true.precision[0]), cover + repeated, rtol=1e-4)
    mean = [np.linalg.solve(of.precision[0], of.shift[0]) for of in (seen, true)]
    assert np.allclose(*mean, atol=1e-4)


SHARES = (np.array([0.3, 0.2, 0.4, 0.3, 0.0]), np.array([0.2, 0.3, 0.1, 0.2, 0.0]))


def test_over_many_fleets_intervals_hold_alarms_are_few_and_changes_are_named_in_time(fleet):
    """Drawn from the model, with an error that all drives of a type repeat: an average drive has the precision 12."""
    vehicles, drives = 8, 10
    held, of_type, in_time, alarms = [], [], [], 0
    fleets = 25
    for trial in range(fleets):
        rng = np.random.default_rng([31, trial])
        type_of, repeated = (np.append(rng.normal(size=4), 0.0) * share**0.5 for share in (1.0 / 3.0, 1.0 / 12.0))
        levels = rng.normal(size=(vehicles, 5)) * np.sqrt(SHARES[0])
        changed = {
            int(vehicle): (int(rng.choice([0, 1, 3, 4])), int(rng.integers(2, drives - 3)), 4.0 * rng.choice([-1, 1]))
            for vehicle in rng.choice(vehicles, 2, replace=False)
        }

        def change(vehicle, drive, changed=changed):
            place, since, size = changed.get(vehicle, (0, drives, 0.0))
            return np.eye(5)[place] * size * (drive >= since)

        of = drawn(fleet, rng, vehicles, drives, of=SHARES, common=type_of + repeated, change=change, levels=levels)
        state = reduced(fleet, *of)
        assert not state.common
        deviation = np.sqrt(np.diag(state.spread.true_covariance)[:4])
        of_type += list(np.abs(state.spread.true_mean - type_of)[:4] < 1.96 * deviation)
        for one in state.vehicles:
            place, since, size = changed.get(int(one.vehicle), (None, drives, 0.0))
            for it, said in zip(one.changes, one.said):
                if said and not it.passing:
                    if it.effect == f"e{place}" and it.earliest <= since <= it.latest:
                        # A parameter without a tolerance is scaled by the size of what is named.
                        value = (type_of + levels[int(one.vehicle)])[place] + size
                        held.append(it.low <= value * state.parameters[place].scale <= it.high)
                    else:
                        alarms += 1
            if place is not None:
                own = fleet.changes.Vehicle(of[0].take(of[1] == int(one.vehicle)), state.spread, state.rates)
                found = own.changes(since + 3).changes
                in_time.append(any(it.effect == f"e{place}" and it.probability > 0.9 for it in found))
    assert min(np.mean(held), np.mean(of_type)) > 0.9
    assert np.mean(in_time) > 0.9
    assert alarms <= 1e-3 * fleets * vehicles * drives


def test_drives_whose_fits_are_far_apart_agree_on_a_stiffness(fleet):
    """A gap that is the logarithm's (between a stiffness and its inverse), each drive linear about a fit of its own."""
    row = {"name": "effect.roll_stiffness", "given": 1.0, "unit": "1", "tolerance": 0.07, "change": 0.5}
    row |= {"least": -0.7, "greatest": 4.0}
    truth, noise = 1.6, 0.02
    summaries = []
    for fit in (1.0, 1.2, 1.6, 2.0):
        slope = 1.0 / fit
        gap = math.log(truth) - math.log(fit)
        summaries.append({"parameters": [row | {"value": fit - 1.0}], "precision": [(slope / noise) ** 2],
                          "gradient": [slope * gap / noise**2], "temper": 1.0})  # fmt: skip
    drives = fleet.summary.drives_of(summaries)
    (parameter,) = drives.parameters
    for precision, shift in zip(drives.precision, drives.shift):
        assert parameter.value(float(shift[0] / precision[0, 0])) == pytest.approx(truth)
    assert parameter.value(parameter.greatest / parameter.scale) == pytest.approx(5.0)
    assert parameter.value(parameter.least / parameter.scale) == pytest.approx(0.3)


def lighter(fleet, rng, kilograms, vehicles=6, drives=8):
    """Sisters whose mass is not the file's; a load has a place, which shifts the response as the CG does."""
    file = fleet.summary.parameters_of([{"parameters": [
        {"name": "effect.payload", "given": 0.0, "unit": "kg", "tolerance": 0.0, "change": 350.0, "least": 0.0},
        {"name": "effect.payload_x", "given": 0.0, "unit": "m", "change": 0.8, "goes_with": "effect.payload"},
        {"name": "effect.cg_shift", "given": 0.0, "unit": "m", "tolerance": 0.02, "change": 0.25},
        {"name": "vehicle.mass", "given": 1400.0, "unit": "kg", "tolerance": 42.0},
    ]}])  # fmt: skip
    precision, shift = [], []
    for _ in range(vehicles * drives):
        slopes = rng.normal(size=(12, 4))
        slopes[:, 0] = slopes[:, 3] * 350.0 / 42.0  # a load is a mass
        off = np.array([0.0, 0.0, 3.0, kilograms / 42.0]) + rng.normal(size=4) * [0.0, 0.0, 0.5, 0.4]
        precision.append(slopes.T @ slopes)
        shift.append(slopes.T @ (slopes @ off + rng.normal(size=12)))
    number = np.repeat(np.arange(vehicles), drives)
    return fleet.summary.Drives(file, np.array(precision), np.array(shift)), number


@pytest.mark.parametrize(("kilograms", "effect"), [(-330.0, "vehicle.mass"), (330.0, "payload"), (-20.0, None)])
def test_sisters_lighter_than_their_file_have_a_wrong_mass_and_no_load_below_none(fleet, kilograms, effect):
    state = reduced(fleet, *lighter(fleet, np.random.default_rng(37), kilograms))
    assert [one.effect for one in state.common] == ([effect] if effect else [])
    if effect:
        given = 1400.0 if effect == "vehicle.mass" else 0.0
        assert state.common[0].value == pytest.approx(given + kilograms, abs=100.0)
        assert state.unit(effect) == "kg"
    assert not any(any(one.said) for one in state.vehicles)


def test_a_fleet_in_which_nothing_changes_has_no_changes(fleet):
    rng = np.random.default_rng(11)
    shares = (np.array([0.3, 0.1, 0.3, 0.5, 0.0]), np.array([0.2, 0.5, 0.1, 0.3, 0.0]))
    state = reduced(fleet, *drawn(fleet, rng, 30, 20, of=shares))
    assert not state.common
    assert not [one.vehicle for one in state.vehicles if any(one.said)]


def test_a_single_strange_drive_is_no_change(fleet):
    rng = np.random.default_rng(13)
    shares = (np.array([0.3, 0.1, 0.3, 0.3, 0.0]), np.array([0.1, 0.1, 0.1, 0.1, 0.0]))

    def change(vehicle, drive):
        return np.array([4.0, 0.0, 0.0, 0.0, 0.0]) * (vehicle == 2 and drive == 5)

    state = reduced(fleet, *drawn(fleet, rng, 12, 12, of=shares, change=change))
    found = next(one for one in state.vehicles if one.vehicle == "2")
    assert [(one.effect, one.since, one.passing) for one in found.changes] == [("e0", 5, True)]


def test_the_order_of_vehicles_does_not_matter(fleet):
    rng = np.random.default_rng(17)
    shares = (np.array([0.3, 0.1, 0.3, 0.3, 0.0]), np.array([0.1, 0.1, 0.1, 0.1, 0.0]))
    drives, number = drawn(fleet, rng, 8, 6, of=shares)
    state = reduced(fleet, drives, number)
    again = reduced(fleet, drives, number)
    assert np.array_equal(state.spread.mean, again.spread.mean)
    assert [one.nothing for one in state.vehicles] == [one.nothing for one in again.vehicles]


def test_the_expected_share_of_false_ones_is_limited(fleet):
    assert fleet.reduce.held([]) == 0
    assert fleet.reduce.held([0.99, 0.97, 0.9, 0.6], 0.05) == 3
    assert fleet.reduce.held([0.6, 0.55], 0.05) == 0
