"""How the parameters of a type's vehicles are spread: over types, vehicles and drives, by empirical Bayes.

Drive ``d`` of vehicle ``v`` has the parameters

    theta = mu + u_v + w_d,        u_v ~ N(0, U),   w_d ~ N(0, W),   mu ~ N(0, I)

with diagonal ``U`` and ``W``, in units of the tolerances. ``mu`` is what all sisters share: the error of the type's
file. ``U`` and ``W`` are found by expectation and maximisation with a weak inverse-gamma prior, so that a small
fleet keeps what ordinary tolerances say. Marginalising ``w_d`` leaves a drive's likelihood of ``mu + u_v``,

    G~ = G - G (W^-1 + G)^-1 G,        h~ = (I - G (W^-1 + G)^-1) h,

and the same step once more, over ``u_v``, that of ``mu``.

More drives do not make a model's form less wrong: the error that it leaves on one drive, it leaves on the others as
well. So ``mu`` is what the drives of a type scatter about, and no more: its true value is ``mu - b`` with an error
``b ~ N(0, B)`` that all of them repeat. How large it is does not show in their scatter. A summary's own covariance is
the measure of what one log can tell: ``B`` is that of the type's average drive, so that of what all share, any number
of drives tells as much as one of them. Vehicles and drives are compared about ``mu``, where ``b`` cancels; of the type
itself, and of absolute values, ``mu - b`` is said.

Source: Efron and Morris, J. Am. Stat. Assoc. 70 (1975); Dempster, Laird and Rubin, J. R. Stat. Soc. B 39 (1977).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rfl_mpc.fleet.summary import ENVIRONMENT, Drives, Parameter

ROUNDS = 40
"""Steps of expectation and maximisation."""
WEIGHT = 4.0
"""Observations that the prior of a variance counts as."""
SHARES = (1.0 / 3.0, 1.0 / 3.0)
"""Shares of a tolerance's variance beforehand: between vehicles, between drives. The rest is the type's."""
SHARES_OF_ENVIRONMENT = (0.02, 1.0)
LEAST = 1e-6
"""Least variance, in units of the tolerance's."""
NOTHING = 1e-6
"""Precision that is as good as none."""


@dataclass(frozen=True)
class Spread:
    """What is known of a type."""

    free: np.ndarray
    """Parameters that ordinary vehicles differ in."""
    mean: np.ndarray
    """``mu``, of all parameters."""
    covariance: np.ndarray
    """Of ``mu``."""
    between_vehicles: np.ndarray
    """Variances ``U``."""
    between_drives: np.ndarray
    """Variances ``W``."""
    true_mean: np.ndarray
    """``mu - b``: what is left of ``mu`` where an error may be repeated on each drive."""
    true_covariance: np.ndarray
    """Of ``mu - b``."""


def covariance_of(precision: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Covariances under likelihoods with these precisions and a prior with these variances; a variance of 0: fixed."""
    root = np.sqrt(variance)
    inner = np.eye(len(root)) + root[:, None] * precision * root
    return root[:, None] * np.linalg.solve(inner, np.broadcast_to(np.diag(root), inner.shape))


def without(precision: np.ndarray, shift: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Likelihoods after a Gaussian addition with these variances is marginalised; a variance of 0: there is none."""
    gain = precision @ covariance_of(precision, variance)
    left = precision - gain @ precision
    return 0.5 * (left + np.swapaxes(left, -1, -2)), shift - np.einsum("...ij,...j->...i", gain, shift)


def ordinary(parameters: tuple[Parameter, ...]) -> Spread:
    """What is believed of a type before anything is seen."""
    free = np.array([parameter.tolerance > 0.0 for parameter in parameters])
    shares = np.array([SHARES_OF_ENVIRONMENT if it.name in ENVIRONMENT else SHARES for it in parameters])
    mean, covariance = np.zeros(len(free)), np.diag(free.astype(float))
    return Spread(free, mean, covariance, free * shares.T[0], free * shares.T[1], mean, covariance)


def spread(drives: Drives, vehicle: np.ndarray, rounds: int = ROUNDS) -> Spread:
    """Of drives, each with its vehicle's number (from 0)."""
    before = ordinary(drives.parameters)
    free, prior_vehicles, prior_drives = before.free, before.between_vehicles, before.between_drives
    of_vehicles, of_drives = prior_vehicles.copy(), prior_drives.copy()
    count = int(vehicle.max()) + 1
    mean, covariance = before.mean, before.covariance
    for _ in range(rounds):
        mean, covariance, levels, spreads = _type_mean(drives, vehicle, count, free, of_vehicles, of_drives)
        # Of the vehicles' levels, with what is not known of each.
        seen = np.sum(levels**2 + np.einsum("vii->vi", spreads), axis=0)
        new_vehicles = (WEIGHT * prior_vehicles + seen) / (WEIGHT + count)
        # Of the drives about them.
        own = covariance_of(drives.precision, of_drives)
        left = drives.shift - np.einsum("dij,dj->di", drives.precision, mean + levels[vehicle])
        off = np.einsum("dij,dj->di", own, left)
        pull = own @ drives.precision
        more = np.einsum("dij,djk,dik->di", pull, spreads[vehicle], pull)
        seen = np.sum(off**2 + np.einsum("dii->di", own) + more, axis=0)
        new_drives = (WEIGHT * prior_drives + seen) / (WEIGHT + len(drives))
        of_vehicles, of_drives = np.maximum(new_vehicles, LEAST * free), np.maximum(new_drives, LEAST * free)
    return Spread(free, mean, covariance, of_vehicles, of_drives, mean, covariance)


def type_likelihoods(drives: Drives, vehicle: np.ndarray, of: Spread) -> tuple[Drives, Drives]:
    """Likelihoods of ``mu`` and of ``mu - b``, each as that of a single drive."""
    count = int(vehicle.max()) + 1
    total, pulled = _of_vehicles(drives, vehicle, count, of.between_drives)
    each, pull = without(total, pulled, of.between_vehicles)
    seen, pull = each.sum(axis=0), pull.sum(axis=0)
    # (seen^-1 + one^-1)^-1, where a direction may be one that neither tells of.
    one = total.sum(axis=0) / len(drives)
    share = np.linalg.solve(seen + one + NOTHING * np.eye(len(one)), np.column_stack([seen, pull]))
    both = one @ share[:, :-1]
    true = Drives(drives.parameters, 0.5 * (both + both.T)[None], (one @ share[:, -1])[None])
    return Drives(drives.parameters, seen[None], pull[None]), true


def _of_vehicles(drives: Drives, vehicle: np.ndarray, count: int, of_drives: np.ndarray):
    """Likelihoods of ``mu + u`` of each vehicle."""
    precision, shift = without(drives.precision, drives.shift, of_drives)
    total, pulled = np.zeros((count, *precision.shape[1:])), np.zeros((count, shift.shape[1]))
    np.add.at(total, vehicle, precision)
    np.add.at(pulled, vehicle, shift)
    return total, pulled


def _type_mean(drives, vehicle, count, free, of_vehicles, of_drives):
    """``mu`` and its covariance; ``u`` of each vehicle given ``mu``, and its covariances."""
    total, pulled = _of_vehicles(drives, vehicle, count, of_drives)
    of_type, pull = without(total, pulled, of_vehicles)
    covariance = covariance_of(of_type.sum(axis=0), free.astype(float))
    mean = covariance @ pull.sum(axis=0)
    spreads = covariance_of(total, of_vehicles)
    levels = np.einsum("vij,vj->vi", spreads, pulled - total @ mean)
    return mean, covariance, levels, spreads
