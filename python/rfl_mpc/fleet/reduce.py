"""From the drives' summaries to what differs in which vehicle since when.

Types are reduced one after the other. Spreads are learned from a sample of whole vehicles; then each vehicle is
looked at alone, so that memory holds one vehicle's drives. What all sisters share is the type's, and is said once.
Changes that were found are taken out of the drives before the spreads are learned anew. What began on a later drive
tells itself from what all share: it is taken out before that is looked for, or one changed vehicle among few would pass
for an error of all. What most vehicles differ from, from their first drive on, is no error of all either.

Which changes are said is decided over all vehicles together: the largest set whose expected share of false ones is
below a limit. With probabilities in place of p-values that is the counterpart of Benjamini and Hochberg's rule
(Efron, Large-Scale Inference, 2010, ch. 5).
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.special import ndtri

from rfl_mpc.fleet.changes import ORDINARY, Change, Rates, Vehicle
from rfl_mpc.fleet.hierarchy import Spread, ordinary, spread, type_likelihoods
from rfl_mpc.fleet.summary import Drives, Parameter, drives_of, parameters_of

SAMPLE = 2000
"""Drives of a type that its spreads are learned from."""
PASSES = 3
"""Looks for changes: with ordinary spreads first, then with those learned from drives without what was found."""
FALSE = 0.05
"""Greatest expected share of false ones among the changes that are said."""

Summaries = Callable[[str], list[dict[str, Any]]]
"""Summaries of a vehicle's drives in their order."""


@dataclass(frozen=True)
class VehicleState:
    """What is known of a vehicle."""

    vehicle: str
    type: str
    drives: int
    changes: list[Change]
    candidate: Change | None
    nothing: float
    mean: np.ndarray
    deviation: np.ndarray
    said: list[bool] = field(default_factory=list)
    """Of each change, whether it is said: see :func:`say`."""


@dataclass(frozen=True)
class TypeState:
    """What is known of a type."""

    type: str
    parameters: tuple[Parameter, ...]
    spread: Spread
    common: list[Change]
    """What all its vehicles share."""
    rates: Rates
    """How often its vehicles change."""
    differs: list[int]
    """Places of the parameters in which the fleet surely differs from the simulator, the surest first."""
    vehicles: list[VehicleState]
    drives: int

    def parameter(self, effect: str) -> Parameter:
        """The parameter that an effect is."""
        return next(it for it in self.parameters if it.effect == effect)

    def unit(self, effect: str) -> str:
        """Symbol of an effect's unit."""
        return self.parameter(effect).unit


def reduce_type(
    type: str,
    vehicles: Sequence[str],
    summaries: Summaries,
    progress: Callable[[float], None] = lambda share: None,
) -> TypeState | None:
    """A type and its vehicles; None where no drive of it has a summary."""
    sample = _sample(vehicles, summaries)
    parameters = parameters_of(one for _, of in sample for one in of)
    if not parameters:
        return None
    drives = drives_of([one for _, of in sample for one in of], parameters)
    number = np.repeat(np.arange(len(sample)), [len(of) for _, of in sample])
    rates, found = ORDINARY, ordinary(parameters)
    settled, refused = _without_changes(drives, number, found, rates).later, frozenset()
    for last in range(PASSES):
        found, common, offset = _common(settled, number, found, refused)
        if last == PASSES - 1:
            break
        looked = _without_changes(drives, number, found, rates)
        settled, usual, rates = looked.later, looked.usual, ORDINARY.learned(*looked.expected, len(drives))
        refused |= {it.effect for it in common if 2 * looked.from_start.count(it.effect) > len(sample)}
        # An error that all share is many tolerances off: left in, it would be taken for their spread.
        found = spread(replace(usual, shift=usual.shift - usual.precision @ offset), number)
    states: list[VehicleState] = []
    count = 0
    for done, name in enumerate(vehicles, 1):
        own = summaries(name)
        count += len(own)
        if own:
            # A parameter that no drive of the sample had is told by few: it is left out.
            of = Vehicle(drives_of([_only(one, parameters) for one in own], parameters), found, rates).changes()
            deviation = np.sqrt(np.maximum(np.diag(of.covariance), 0.0))
            states.append(VehicleState(name, type, len(own), of.changes, of.candidate, of.nothing, of.mean, deviation))
        progress(done / len(vehicles))
    return TypeState(type, parameters, found, common, rates, _differs(parameters, found), states, count)


@dataclass(frozen=True)
class _Looked:
    """Drives without changes, and what these were."""

    later: Drives
    """Without those that began after a vehicle's first drive."""
    usual: Drives
    """Without any."""
    expected: tuple[float, float]
    """Expected numbers of lasting ones, and of drives that differ alone."""
    from_start: list[str]
    """Effects that a vehicle has from its first drive on, for each vehicle that does."""


def _without_changes(drives: Drives, number: np.ndarray, of: Spread, rates: Rates) -> _Looked:
    """Looks for changes in each vehicle, and takes them out."""
    later, usual, expected, from_start = drives.shift.copy(), drives.shift.copy(), [0.0, 0.0], []
    for one in np.unique(number):
        own = number == one
        vehicle = Vehicle(drives.take(own), of, rates)
        found = vehicle.changes()
        for it in found.changes:
            expected[it.passing] += it.probability
        from_start += [kind.effect for mask, kind in found.known if mask.all()]
        for shift, offsets in zip((later, usual), vehicle.offsets(found.known)):
            shift[own] -= np.einsum("dij,dj->di", drives.precision[own], offsets)
    return _Looked(replace(drives, shift=later), replace(drives, shift=usual), (expected[0], expected[1]), from_start)


def _differs(parameters: tuple[Parameter, ...], of: Spread) -> list[int]:
    """Parameters whose mean is not the simulator's: all intervals together hold with 95 % (Bonferroni)."""
    variance = np.diag(of.true_covariance)
    surely = -ndtri(0.5 * 0.05 / max(len(parameters), 1))
    z = np.where(variance > 0.0, np.abs(of.true_mean) / np.sqrt(np.maximum(variance, 1e-300)), 0.0)
    return [int(place) for place in np.argsort(-z, kind="stable") if z[place] > surely]


def _only(summary: dict[str, Any], parameters: tuple[Parameter, ...]) -> dict[str, Any]:
    """A summary without parameters that are not known."""
    names = {parameter.name for parameter in parameters}
    keep = [i for i, one in enumerate(summary["parameters"]) if one["name"] in names]
    if len(keep) == len(summary["parameters"]):
        return summary
    count = len(summary["parameters"])
    full = np.zeros((count, count))
    full[np.tril_indices(count)] = summary["precision"]
    small = full[np.ix_(keep, keep)]
    return {
        "parameters": [summary["parameters"][i] for i in keep],
        "precision": small[np.tril_indices(len(keep))].tolist(),
        "gradient": [summary["gradient"][i] for i in keep],
        "temper": summary["temper"],
    }


def _sample(vehicles: Sequence[str], summaries: Summaries) -> list[tuple[str, list[dict[str, Any]]]]:
    """Whole vehicles up to so many drives, drawn by a hash of their names: the same ones whatever the order."""
    drawn, count = [], 0
    for vehicle in sorted(vehicles, key=lambda name: (zlib.crc32(name.encode()), name)):
        own = summaries(vehicle)
        if own:
            drawn.append((vehicle, own))
            count += len(own)
        if count >= SAMPLE:
            break
    return sorted(drawn)


def _common(
    drives: Drives, number: np.ndarray, of: Spread, refused: frozenset[str]
) -> tuple[Spread, list[Change], np.ndarray]:
    """Effects that all vehicles of a type have, the spread about them, and what they add to the parameters."""
    seen, true = type_likelihoods(drives, number, of)
    usual = of.free.astype(float)
    nothing, none = np.zeros_like(usual), np.zeros((len(usual), len(usual)))
    about = Spread(of.free, nothing, none, usual, nothing, nothing, none)
    sisters = Vehicle(true, about, without=refused)
    found = sisters.changes()
    center = Vehicle(seen, about)
    mean, covariance = center.last(found.known)
    learned = replace(of, mean=mean, covariance=covariance, true_mean=found.mean, true_covariance=found.covariance)
    return learned, found.changes, center.offsets(found.known)[1][0]


def say(types: Iterable[TypeState], false: float = FALSE) -> None:
    """Decides over all vehicles which changes are said."""
    all = [(change.probability, state, place) for of in types for state in of.vehicles
           for place, change in enumerate(state.changes)]  # fmt: skip
    all.sort(key=lambda one: (-one[0], one[1].vehicle, one[2]))
    count = held([probability for probability, _, _ in all], false)
    for of in types:
        for state in of.vehicles:
            state.said[:] = [False] * len(state.changes)
    for _, state, place in all[:count]:
        state.said[place] = True


def held(probabilities: Sequence[float], false: float = FALSE) -> int:
    """How many of the most probable, given in falling order, keep the expected share of false ones below a limit."""
    if not len(probabilities):
        return 0
    wrong = np.cumsum(1.0 - np.asarray(probabilities)) / np.arange(1, len(probabilities) + 1)
    below = np.flatnonzero(wrong <= false)
    return int(below[-1]) + 1 if len(below) else 0
