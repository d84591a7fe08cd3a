"""What the drives of one vehicle type say, as arrays: summaries of reports on a common list of parameters.

A report's ``information`` is a Gaussian likelihood around the fit of its first hypothesis. With precision ``G``,
gradient ``g`` and fit ``x`` it is, of the parameters' differences ``theta`` from the simulator,

    log L(theta) = h' theta - theta' G theta / 2 + const,        h = g + G x,

so that drives add up. A stiffness is taken by its logarithm, with the slope at ``x``. A diagnosis tempers its
likelihood, for one log cannot tell how far its model's form is off; a fleet can, by what its drives scatter beyond it
(``hierarchy.py``), and takes the temper out. Parameters are scaled by their tolerance (without one by the size of what
is named): numbers of order 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

ENVIRONMENT = frozenset(f"effect.{name}" for name in ("wind_x", "wind_y", "road_bank", "road_grade", "road_friction"))
"""What belongs to the day and the road: it differs from drive to drive, and is no change of a vehicle."""


MASSES = {"vehicle.mass": "effect.payload", "tractor.mass": "effect.payload", "trailer.mass": "effect.trailer_payload"}
"""Masses of a vehicle file, and what loads them. A load is not below zero: in a lighter vehicle the mass is wrong."""

STIFFNESSES = frozenset(
    f"effect.{name}" for name in ("tyre_stiffness_front", "tyre_stiffness_rear", "roll_stiffness", "trailer_stiffness")
)
"""Factors that act by their inverse where the motion gives the forces, and by themselves where it gives the angles:
their logarithm lies between. A drive's fit may be far from what all drives say, and is linear about itself."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of the summaries; numbers in its unit, as differences from ``given``."""

    name: str
    given: float
    unit: str
    reciprocal: bool
    tolerance: float
    """Standard deviation of ordinary simulators; 0: none has it."""
    change: float
    """Standard deviation of what is named; 0: it cannot be named."""
    least: float
    greatest: float
    goes_with: str | None

    @property
    def effect(self) -> str | None:
        """Name of the effect, or of the file's number, that it is, if it can be named alone."""
        can = self.change > 0.0 and self.goes_with is None and self.name not in ENVIRONMENT
        return self.name.removeprefix("effect.") if can else None

    @property
    def scale(self) -> float:
        return self.tolerance or self.change or 1.0

    @property
    def is_logarithm(self) -> bool:
        """Whether differences are those of the logarithm, times what is ``given``."""
        return self.name in STIFFNESSES and self.given > 0.0

    def value(self, scaled: float) -> float:
        """The value that a scaled difference stands for."""
        off = scaled * self.scale
        if self.is_logarithm:
            return self.given * math.exp(off / self.given)
        if self.reciprocal:
            return 1.0 / off if off > 0.0 else float("inf")
        return self.given + off


@dataclass(frozen=True)
class Drives:
    """Drives of a type: likelihoods in scaled parameters."""

    parameters: tuple[Parameter, ...]
    precision: np.ndarray
    """Shape ``(drives, parameters, parameters)``."""
    shift: np.ndarray
    """Precision times mean, shape ``(drives, parameters)``."""

    def __len__(self) -> int:
        return len(self.shift)

    def take(self, rows: Sequence[int] | np.ndarray | slice) -> Drives:
        return Drives(self.parameters, self.precision[rows], self.shift[rows])


def parameters_of(summaries: Iterable[Mapping[str, Any]]) -> tuple[Parameter, ...]:
    """All parameters of some summaries, in the order in which they come; numbers are medians over the drives."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for summary in summaries:
        for one in summary["parameters"]:
            found.setdefault(one["name"], []).append(one)

    def median(of: list[Mapping[str, Any]], key: str, default: float) -> float:
        values = (one.get(key) for one in of)
        return float(np.median([default if value is None else value for value in values]))

    all = {
        name: Parameter(
            name,
            median(of, "given", 0.0),
            of[0]["unit"],
            bool(of[0].get("reciprocal", False)),
            median(of, "tolerance", 0.0),
            median(of, "change", 0.0),
            median(of, "least", -np.inf),
            median(of, "greatest", np.inf),
            of[0].get("goes_with"),
        )
        for name, of in found.items()
    }
    for mass, load in MASSES.items():
        if mass in all and load in all:
            all[mass] = replace(all[mass], change=all[load].change, least=-all[mass].given, greatest=0.0)
    for name, it in all.items():
        if it.is_logarithm:
            least, greatest = (it.given * math.log(max(1.0 + end / it.given, 1e-3)) for end in (it.least, it.greatest))
            all[name] = replace(it, least=least, greatest=greatest)
    return tuple(all.values())


def drives_of(summaries: Sequence[Mapping[str, Any]], parameters: tuple[Parameter, ...] | None = None) -> Drives:
    """Summaries as arrays; a parameter that a drive does not have is one that it says nothing of."""
    parameters = parameters or parameters_of(summaries)
    place = {parameter.name: i for i, parameter in enumerate(parameters)}
    scale = np.array([parameter.scale for parameter in parameters])
    count = len(parameters)
    logarithm = np.array([parameter.is_logarithm for parameter in parameters])
    given = np.array([parameter.given if parameter.is_logarithm else 1.0 for parameter in parameters])
    precision, shift = np.zeros((len(summaries), count, count)), np.zeros((len(summaries), count))
    for row, summary in enumerate(summaries):
        own = summary["parameters"]
        at = np.array([place[one["name"]] for one in own], dtype=int)
        full = np.zeros((len(own), len(own)))
        full[np.tril_indices(len(own))] = summary["precision"]
        full += np.tril(full, -1).T
        full /= summary["temper"]
        value = np.array([one["value"] for one in own])
        # Slopes by a logarithm are those at the drive's fit.
        ratio = np.where(logarithm[at], 1.0 + value / given[at], 1.0)
        value = np.where(logarithm[at], given[at] * np.log(ratio), value)
        size = scale[at] * ratio
        precision[row][np.ix_(at, at)] = full * np.outer(size, size)
        shift[row][at] = (np.asarray(summary["gradient"]) / summary["temper"] + full @ (ratio * value)) * size
    return Drives(parameters, precision, shift)
