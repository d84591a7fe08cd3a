"""What changed in one vehicle, and since which drive.

Drives in their order have the parameters ``theta_d = mu + u + sum_i [d after k_i] E_i delta_i + w_d``. Hypotheses of
one more change are: none; effect ``j`` since drive ``k``; effect ``j`` on drive ``k`` alone. All are linear and
Gaussian, so that each has a closed evidence. With ``A_k = sum of G~_d`` over the drives that have it, ``x`` all that
is known already (``u`` and earlier changes) with precision ``P``, ``R_k = sum of G~_d T_d`` and ``T_d`` what ``x``
adds to drive ``d``,

    a = E' (A_k - R_k P^-1 R_k') E,     b = E' (s_k - R_k P^-1 s),
    log K = b' (a + D^-1)^-1 b / 2 - log det(I + D a) / 2,

``D`` the prior variance of a change (a mixture of two: small ones are as common as large ones). The part of prior
and posterior that lies outside the effect's range is left out. The most probable change is taken up if it is more
probable than not, and the next is looked for.

Source: exact inference over change points as in Adams and MacKay, Bayesian online changepoint detection, 2007,
arXiv:0710.3742, with parameters that are shared between the segments, for all but the changed effect stay what they
are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import log_ndtr

from rfl_mpc.fleet.hierarchy import Spread
from rfl_mpc.fleet.hierarchy import without as marginal
from rfl_mpc.fleet.summary import Drives, Parameter

DRIVES = 1000
"""Drives that what is believed of the rates beforehand counts as."""
FROM_THE_START = 0.02
"""Vehicles that have something from their first drive on."""
MOST = 4
"""Changes of one vehicle that are looked for."""
TAKEN = 0.5
"""Probability from which on a change is taken up, and the next is looked for."""
LIKELY = 0.9
"""Probability that the drives from ``earliest`` to ``latest`` hold the first changed one."""
SIZES = (0.25, 1.0)
"""Sizes of changes, as shares of the size of what is named: small ones are as common as large ones."""
FORM = 0.03
"""Error of what a model says of a change, as a share of it: a signal's error of form, as in calibration.toml."""
OF_LOAD = 0.3
"""Share of a named shift of the CG by which a load shifts it where no fit has placed it yet."""


@dataclass(frozen=True)
class Rates:
    """How often something differs. Only they tell, on a last drive, a change from a drive that differs alone."""

    lasting: float = 1e-3
    """Changes a drive."""
    passing: float = 5e-3
    """Drives that differ alone: a guest's luggage, or a drive of which a summary says what is not so."""

    def learned(self, lasting: float, passing: float, drives: int) -> Rates:
        """Those of a fleet with so many expected changes and drives that differ alone."""
        weight = drives + DRIVES
        return Rates((lasting + DRIVES * self.lasting) / weight, (passing + DRIVES * self.passing) / weight)


ORDINARY = Rates()
"""Before a fleet says otherwise."""


@dataclass(frozen=True)
class Kind:
    """An effect that may change, with what changes along: places and prior deviations, its own first."""

    effect: str
    places: tuple[int, ...]
    deviations: tuple[float, ...]


Known = Sequence[tuple[np.ndarray, Kind]]
"""Changes: which drives have each, and its kind."""


@dataclass(frozen=True)
class Change:
    """A change that was found, or the first candidate."""

    effect: str
    since: int
    """First drive that has it."""
    earliest: int
    latest: int
    passing: bool
    """Whether that drive alone has it."""
    probability: float
    """That this effect changed; for the best place of it see ``since``."""
    value: float
    """The effect's value after it, with a 95 % interval; before it, ``before``."""
    low: float
    high: float
    before: float
    also: dict[str, float] = field(default_factory=dict)
    """Other effects that it may be, with their probabilities."""


def kinds(parameters: tuple[Parameter, ...]) -> list[Kind]:
    """All that may change."""
    place = {parameter.name: i for i, parameter in enumerate(parameters)}
    found = []
    for i, parameter in enumerate(parameters):
        if parameter.effect is None:
            continue
        places, deviations = [i], [parameter.change / parameter.scale]
        for j, other in enumerate(parameters):
            if other.goes_with == parameter.name:
                places.append(j)
                deviations.append(other.change / other.scale)
        shift = place.get("effect.cg_shift")
        if parameter.name == "effect.payload" and shift is not None:
            places.append(shift)
            deviations.append(OF_LOAD * parameters[shift].change / parameters[shift].scale)
        found.append(Kind(parameter.effect, tuple(places), tuple(deviations)))
    return found


@dataclass(frozen=True)
class Found:
    """What a vehicle's drives say."""

    changes: list[Change]
    """Those that were taken up, in the order of finding."""
    candidate: Change | None
    """The likeliest one that was not."""
    nothing: float
    """Probability that there is no further one."""
    mean: np.ndarray
    """Parameters after the last drive, as scaled differences."""
    covariance: np.ndarray
    known: Known
    """Drives that have each change, and its kind."""


class Vehicle:
    """Drives of one vehicle in their order, and what of it is known."""

    def __init__(
        self, drives: Drives, spread: Spread, rates: Rates = ORDINARY, without: frozenset[str] = frozenset()
    ) -> None:
        self.parameters, self.rates = drives.parameters, rates
        self.kinds = [kind for kind in kinds(drives.parameters) if kind.effect not in without]
        self.precision, shift = marginal(drives.precision, drives.shift, spread.between_drives)
        self.shift = shift - self.precision @ spread.mean
        variance = np.diag(spread.between_vehicles) + spread.covariance
        self.free = np.flatnonzero(np.diag(variance) > 0.0)
        # Vehicles are compared about ``mu``; a value is said with what the type's error may be.
        self.mean, self.of_type = spread.true_mean, spread.true_covariance
        self.prior = np.linalg.inv(variance[np.ix_(self.free, self.free)])

    def changes(self, count: int | None = None) -> Found:
        """Changes within the first ``count`` drives."""
        count = len(self.shift) if count is None else count
        known: list[tuple[np.ndarray, Kind]] = []
        taken: list[Change] = []
        while count:
            change, mask, kind, nothing = self._next(count, known)
            if change is None or change.probability < TAKEN or len(taken) == MOST:
                # Earlier ones are worth what they are beside the later ones.
                taken = [replace(it, **self._values(count, known, place)) for place, it in enumerate(taken)]
                return Found(taken, change, nothing, *self.last(known, count), known)
            taken.append(change)
            known.append((mask, kind))
        return Found([], None, 1.0, *self.last(known, count), known)

    def by_drive(self, effect: str, known: Known = ()) -> tuple[np.ndarray, np.ndarray]:
        """Value of an effect by each drive alone, all else as the vehicle is known, and its standard deviation."""
        kind = next(kind for kind in self.kinds if kind.effect == effect)
        count = len(self.shift)
        covariance, mean, products = self._state(count, known)
        reduced, pull = self._reduced(covariance, mean, (self.precision, products, self.shift))
        found, solved, _ = self._fitted(kind, reduced, pull)
        parameter = self.parameters[kind.places[0]]
        level = self._levels(count, known, mean, before=False)[:, kind.places[0]] + self.mean[kind.places[0]]
        deviation = np.sqrt(np.maximum(solved[:, 0, 0], 0.0)) * (1.0 if parameter.reciprocal else parameter.scale)
        values = np.array([parameter.value(one) for one in level + found[:, 0]])
        return values, deviation * values / parameter.given if parameter.is_logarithm else deviation

    def offsets(self, known: Known) -> tuple[np.ndarray, np.ndarray]:
        """What changes add to each drive's parameters, ``(drives, parameters)``: those since a later drive; all."""
        count, q = len(self.shift), len(self.free)
        _, mean, _ = self._state(count, known)
        added = self._added(count, known)[:, :, q:]
        later = [not mask[0] for mask, kind in known for _ in kind.places]
        return added @ np.where(later, mean[q:], 0.0), added @ mean[q:]

    def last(self, known: Known, count: int | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Parameters after the last drive, scaled differences, and their covariance."""
        count = len(self.shift) if count is None else count
        covariance, mean, _ = self._state(count, known)
        add = self._added(count, known)[-1]
        return self.mean + add @ mean, self.of_type + add @ covariance @ add.T

    def _added(self, count: int, known: Known, before: bool = False) -> np.ndarray:
        """``T_d``: what the state (``u``, then the changes) adds to the parameters on each drive, or just before it."""
        q = len(self.free)
        add = np.zeros((count, len(self.mean), q + sum(len(kind.places) for _, kind in known)))
        add[:, self.free, np.arange(q)] = 1.0
        at = q
        for mask, kind in known:
            held = np.concatenate([[False], mask[: count - 1]]) if before else mask[:count]
            for place in kind.places:
                add[held, place, at] = 1.0
                at += 1
        return add

    def _state(self, count: int, known: Known):
        """Posterior of all that is known: covariance, mean, and ``R_k`` after each drive."""
        add = self._added(count, known)
        q = len(self.free)
        precision = np.zeros((add.shape[2], add.shape[2]))
        precision[:q, :q] = self.prior
        changed = [deviation**-2 for _, kind in known for deviation in kind.deviations]
        precision[range(q, len(precision)), range(q, len(precision))] = changed
        products = self.precision[:count] @ add
        normal = precision + np.einsum("dpa,dpb->ab", add, products)
        pulled = np.einsum("dpa,dp->a", add, self.shift[:count])
        covariance = np.linalg.inv(normal)
        return covariance, covariance @ pulled, products

    @staticmethod
    def _reduced(covariance: np.ndarray, mean: np.ndarray, of: tuple[np.ndarray, np.ndarray, np.ndarray]):
        """Information on parameters of some drives beside what is known."""
        precision, products, shift = of
        return precision - products @ covariance @ np.swapaxes(products, 1, 2), shift - products @ mean

    @staticmethod
    def _fitted(kind: Kind, reduced: np.ndarray, pull: np.ndarray, share: float = 1.0):
        """Size, covariance and log evidence of a change for each of some drives; ``share`` of the prior deviation."""
        places, deviation = list(kind.places), share * np.array(kind.deviations)
        a, b = reduced[np.ix_(range(len(pull)), places, places)], pull[:, places]
        inner = np.eye(len(places)) + deviation[:, None] * a * deviation
        solved = np.linalg.solve(inner, np.broadcast_to(np.diag(deviation), a.shape)) * deviation[:, None]
        found = np.einsum("kij,kj->ki", solved, b)
        return found, solved, 0.5 * np.einsum("ki,ki->k", found, b) - 0.5 * np.linalg.slogdet(inner)[1]

    def _next(self, count: int, known: Known):
        """The most probable further change, with the drives that have it and its kind; and the probability of none."""
        covariance, mean, products = self._state(count, known)
        single = (self.precision[:count], products, self.shift[:count])
        lasting = tuple(np.cumsum(of[::-1], axis=0)[::-1] for of in single)
        level = self._levels(count, known, mean)
        size = len(self.kinds)
        weight = np.full((2, size, count), -np.inf)
        start = np.array([FROM_THE_START] + [self.rates.lasting] * (count - 1))
        for passing, of in enumerate((lasting, single)):
            if passing and count == 1:
                continue
            reduced, pull = self._reduced(covariance, mean, of)
            prior = np.log(np.full(count, self.rates.passing) if passing else start) - math.log(size * len(SIZES))
            for j, kind in enumerate(self.kinds):
                for share in SIZES:
                    found, solved, evidence = self._fitted(kind, reduced, pull, share)
                    deviation = np.sqrt(np.maximum(solved[:, 0, 0], 1e-300))
                    within = self._within(kind, level, found[:, 0], deviation, share)
                    weight[passing, j] = np.logaddexp(weight[passing, j], evidence + within + prior)
                for mask, other in known:
                    if other is kind:
                        weight[passing, j, np.flatnonzero(np.diff(mask[:count], prepend=False))] = -np.inf
        if not np.isfinite(weight).any():
            return None, None, None, 1.0
        most = max(0.0, float(weight.max()))
        share = np.exp(weight - most)
        total = math.exp(-most) + share.sum()
        share /= total
        # A lasting change and one on a drive alone are two things to say; effects are told apart within each.
        by = share.sum(axis=2)
        passing, j = np.unravel_index(int(np.argmax(by)), by.shape)
        kind, k = self.kinds[j], int(np.argmax(share[passing, j]))
        others = sorted(((by[passing, i], i) for i in range(size) if i != j), reverse=True)
        earliest, latest = _interval(share[passing, j])
        mask = np.zeros(len(self.shift), dtype=bool)
        mask[k : k + 1 if passing else None] = True
        also = {self.kinds[i].effect: float(one) for one, i in others if one > 0.05}
        values = self._values(count, [*known, (mask, kind)], len(known))
        change = Change(kind.effect, k, earliest, latest, bool(passing), float(by[passing, j]), **values, also=also)
        return change, mask, kind, math.exp(-most) / total

    def _values(self, count: int, known: Known, which: int) -> dict[str, float]:
        """The value of a changed effect before and after it, with an interval, beside all that is known."""
        covariance, mean, _ = self._state(count, known)
        mask, kind = known[which]
        k, place = int(np.argmax(mask)), kind.places[0]
        parameter = self.parameters[place]
        before = self.mean[place] + self._levels(count, known, mean)[k, place]
        own = self._added(count, known)[k, place]
        after = self.mean[place] + own @ mean
        known_to = max(own @ covariance @ own + self.of_type[place, place], 0.0)
        deviation = math.hypot(math.sqrt(known_to), FORM * (after - before))
        # Within the effect's range, if the value is.
        least, greatest = (
            min(parameter.least / parameter.scale, after),
            max(parameter.greatest / parameter.scale, after),
        )
        ends = [parameter.value(np.clip(after + side * 1.96 * deviation, least, greatest)) for side in (-1.0, 1.0)]
        return {
            "value": parameter.value(after), "low": min(ends), "high": max(ends), "before": parameter.value(before),
        }  # fmt: skip

    def _levels(self, count: int, known: Known, mean: np.ndarray, before: bool = True) -> np.ndarray:
        """Parameters over ``mu`` just before each drive, or on it."""
        return self._added(count, known, before) @ mean

    def _within(
        self, kind: Kind, level: np.ndarray, found: np.ndarray, deviation: np.ndarray, size: float
    ) -> np.ndarray:
        """Logarithm of the share of a change's posterior that stays in range, over that of its prior."""
        place = kind.places[0]
        parameter, base = self.parameters[place], level[:, place] + self.mean[place]
        least, greatest = parameter.least / parameter.scale, parameter.greatest / parameter.scale

        def share(mean: np.ndarray, deviation: np.ndarray | float) -> np.ndarray:
            return _log_share((least - mean) / deviation, (greatest - mean) / deviation)

        # Noise may leave a level a little outside; a change begins within.
        found_share = share(base + found, deviation) - share(np.clip(base, least, greatest), size * kind.deviations[0])
        if len(kind.places) == 1:
            return found_share
        # What goes along is nothing without the effect itself: no load shifts the CG by being less than none.
        return np.where((base + found >= least) & (base + found <= greatest), found_share, -np.inf)


def _log_share(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Logarithm of a normal's share between two places, far out in its tails as well."""
    low, high = np.minimum(low, high), np.maximum(low, high)
    # The upper tail is the lower one's mirror image.
    low, high = np.where(low > 0.0, -high, low), np.where(low > 0.0, -low, high)
    most = log_ndtr(high)
    return most + np.log1p(-np.exp(np.minimum(log_ndtr(low) - most, -1e-300)))


def _interval(shares: np.ndarray) -> tuple[int, int]:
    """The shortest run of drives that holds ``LIKELY`` of a probability."""
    total = shares.sum()
    best = (0, len(shares) - 1)
    for first in range(len(shares)):
        held = np.cumsum(shares[first:])
        enough = np.flatnonzero(held >= LIKELY * total)
        if len(enough) and enough[0] < best[1] - best[0]:
            best = (first, first + int(enough[0]))
    return best
