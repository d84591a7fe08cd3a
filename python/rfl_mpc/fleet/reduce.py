"""From the drives' summaries to what differs in which vehicle since when.

Types are reduced one after the other. Spreads are learned from a sample of whole vehicles; then each vehicle is
looked at alone, so that memory holds one vehicle's drives. What all sisters share is the type's, and is said once.
Changes that were found are taken out of the drives before the spreads are learned anew.

Which changes are said is decided over all vehicles together: the largest set whose expected share of false ones is
below a limit. With probabilities in place of p-values that is the counterpart of Benjamini and Hochberg's rule
(Efron, Large-Scale Inference, 2010, ch. 5).
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.special import ndtri

from rfl_mpc.fleet.changes import RATE, Change, Vehicle, rate_of
from rfl_mpc.fleet.hierarchy import Spread, ordinary, spread, type_likelihood
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
    rate: float
    """Changes a drive."""
    differs: list[int]
    """Places of the parameters in which the fleet surely differs from the simulator, the surest first."""
    vehicles: list[VehicleState]
    drives: int

    def unit(self, effect: str) -> str:
        """Symbol of an effect's unit."""
        return next(it.unit for it in self.parameters if it.effect == effect)


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
    rate, settled, found = RATE, drives, ordinary(parameters)
    for last in range(PASSES):
        found, common, offset = _common(settled, number, found)
        if last == PASSES - 1:
            break
        shift, expected = drives.shift.copy(), 0.0
        for row in range(len(sample)):
            own = number == row
            vehicle = Vehicle(drives.take(own), found, rate)
            changes = vehicle.changes()
            expected += sum(it.probability for it in changes.changes if not it.passing)
            shift[own] -= np.einsum("dij,dj->di", drives.precision[own], vehicle.offsets(changes.known))
        rate = rate_of(expected, len(drives))
        settled = Drives(parameters, drives.precision, shift)
        # An error that all share is many tolerances off: left in, it would be taken for their spread.
        found = spread(Drives(parameters, drives.precision, shift - drives.precision @ offset), number)
    states: list[VehicleState] = []
    count = 0
    for done, name in enumerate(vehicles, 1):
        own = summaries(name)
        count += len(own)
        if own:
            # A parameter that no drive of the sample had is told by few: it is left out.
            of = Vehicle(drives_of([_only(one, parameters) for one in own], parameters), found, rate).changes()
            deviation = np.sqrt(np.maximum(np.diag(of.covariance), 0.0))
            states.append(VehicleState(name, type, len(own), of.changes, of.candidate, of.nothing, of.mean, deviation))
        progress(done / len(vehicles))
    return TypeState(type, parameters, found, common, rate, _differs(parameters, found), states, count)


def _differs(parameters: tuple[Parameter, ...], of: Spread) -> list[int]:
    """Parameters whose mean is not the simulator's: all intervals together hold with 95 % (Bonferroni)."""
    deviation = np.sqrt(np.maximum(np.diag(of.covariance), 1e-300))
    surely = -ndtri(0.5 * 0.05 / max(len(parameters), 1))
    z = np.where(np.diag(of.covariance) > 0.0, np.abs(of.mean) / deviation, 0.0)
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


def _common(drives: Drives, number: np.ndarray, of: Spread) -> tuple[Spread, list[Change], np.ndarray]:
    """Effects that all vehicles of a type have, the spread about them, and what they add to the parameters."""
    precision, shift = type_likelihood(drives, number, of)
    usual = of.free.astype(float)
    nothing = np.zeros_like(usual)
    about = Spread(of.free, nothing, np.zeros((len(usual), len(usual))), usual, nothing)
    sisters = Vehicle(Drives(drives.parameters, precision[None], shift[None]), about)
    found = sisters.changes()
    learned = Spread(of.free, found.mean, found.covariance, of.between_vehicles, of.between_drives)
    return learned, found.changes, sisters.offsets(found.known)[0]


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
