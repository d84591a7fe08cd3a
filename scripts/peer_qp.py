"""Other people's QP solvers on the quadratic programs that our controller solves.

The tracking problem (`src/control/tracking_qp.rs`) is written out here anew, in dense form, from its definition: over
`z = [U, s]`, the inputs over the horizon and one slack for each step and soft bound,

    min 1/2 z' H z + f' z     s.t.  lower <= [z; A z] <= upper
"""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import peer_qp_more
from peer_forest import call

UNBOUNDED = 1e30
REPEATS = 3  # of each problem with a peer; the best counts
SOFT = 8  # daqp's mark of a soft constraint


# Ours; Clarabel as we drive it, updated in place; and the packages of PyPI that are always there.
SOLVERS = ("ours", "ours_clarabel", "daqp", "clarabel")


@dataclass(frozen=True)
class DenseQp:
    """`min 1/2 z'Hz + f'z` with bounds on `z` first, then on the rows of `A`."""

    h: np.ndarray
    f: np.ndarray
    a: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    inputs: int  # the first entries of z


def dense(problem: dict) -> DenseQp:
    """A recorded problem in dense form."""
    shape = problem["shape"]
    horizon, outputs, inputs = shape["horizon"], shape["outputs"], shape["inputs"]
    n = horizon * inputs
    gain = np.array(problem["gain"]).reshape(horizon * outputs, n)
    free, reference = np.array(problem["free"]), np.array(problem["reference"])
    weight = np.tile(np.array(shape["output_weight"], dtype=float), (horizon, 1))
    weight[-1] *= shape["terminal_factor"]
    weight = weight.ravel()
    # u_j - u_{j-1} = change U - before
    change = np.eye(n) - np.eye(n, k=-inputs)
    before = np.concatenate([problem["previous"], np.zeros(n - inputs)])
    rate_weight = np.tile(shape["rate_weight"], horizon)
    soft = shape["soft"]
    slacks = horizon * len(soft)

    h = np.zeros((n + slacks, n + slacks))
    h[:n, :n] = gain.T @ (weight[:, None] * gain) + change.T @ (rate_weight[:, None] * change)
    h[n:, n:] = np.diag(np.tile([bound["quadratic"] for bound in soft], horizon))
    f = np.concatenate(
        [
            gain.T @ (weight * (free - reference)) - change.T @ (rate_weight * before),
            np.tile([bound["linear"] for bound in soft], horizon),
        ]
    )
    bounded = [j * outputs + bound["output"] for j in range(horizon) for bound in soft]
    y, y_free, one = gain[bounded], free[bounded], np.eye(slacks)
    highest = np.tile([bound["max"] for bound in soft], horizon) - y_free
    lowest = np.tile([bound["min"] for bound in soft], horizon) - y_free
    a = np.block([[change, np.zeros((n, slacks))], [y, -one], [y, one]])
    rate_max, endless = np.tile(shape["rate_max"], horizon), np.full(slacks, UNBOUNDED)
    lower = [np.tile(shape["input_min"], horizon), np.zeros(slacks), before - rate_max, -endless, lowest]
    upper = [np.tile(shape["input_max"], horizon), endless, before + rate_max, highest, endless]
    return DenseQp(h, f, a, np.concatenate(lower), np.concatenate(upper), n)


def active_bounds(qp: DenseQp, z: np.ndarray, tolerance: float = 1e-7) -> int:
    """How many bounds hold with equality, those of slacks at zero left out."""
    values = np.concatenate([z, qp.a @ z])
    at = (values - qp.lower < tolerance) | (qp.upper - values < tolerance)
    at[qp.inputs : len(z)] = False
    return int(at.sum())


def stationarity(qp: DenseQp, z: np.ndarray, multipliers: np.ndarray) -> float:
    """Residual of the KKT conditions of a solution: gradient of the Lagrangian and bounds, largest entry."""
    rows = np.vstack([np.eye(len(z)), qp.a])
    values = rows @ z
    gradient = qp.h @ z + qp.f + rows.T @ multipliers
    excess = np.maximum(values - qp.upper, qp.lower - values).max()
    return max(float(np.abs(gradient).max()), float(excess))


def solve_daqp(qp: DenseQp) -> tuple[np.ndarray, np.ndarray]:
    """PyPI `daqp`, a dual active-set method in C: solution and multipliers."""
    import daqp

    sense = np.zeros(len(qp.upper), dtype=np.int32)
    z, _, flag, info = daqp.solve(qp.h, qp.f, qp.a, qp.upper, qp.lower, sense, primal_tol=1e-9)
    if flag != 1:
        raise RuntimeError(f"daqp ended with {flag}")
    return np.array(z), np.array(info["lam"])


def time_daqp(qp: DenseQp, soft: dict) -> tuple[np.ndarray, float]:
    """The same in the form that is fastest for it, with soft constraints of its own in place of slacks: the inputs, and
    the seconds by its own clock, set-up (a factorisation of H) included. All bounds share one weight, that of `soft`.
    """
    import daqp

    n = qp.inputs
    slacks = len(qp.f) - n
    bounds, rates = slice(0, n), slice(n + slacks, 2 * n + slacks)
    above, below = slice(rates.stop, rates.stop + slacks), slice(rates.stop + slacks, rates.stop + 2 * slacks)
    a = np.ascontiguousarray(qp.a[: n + slacks, :n])
    upper = np.concatenate([qp.upper[bounds], qp.upper[rates], qp.upper[above]])
    lower = np.concatenate([qp.lower[bounds], qp.lower[rates], qp.lower[below]])
    sense = np.zeros(len(upper), dtype=np.int32)
    sense[2 * n :] = SOFT
    flexible, price = np.full(len(upper), 1.0 / soft["quadratic"]), np.full(len(upper), soft["linear"])
    times = []
    for _ in range(REPEATS):
        model = daqp.Model()
        model.settings = {"primal_tol": 1e-9}
        _, setup = model.setup(np.ascontiguousarray(qp.h[:n, :n]), qp.f[:n].copy(), a, upper, lower, sense)
        model.soft_weights(flexible, flexible, price, price)
        u, _, flag, info = model.solve()
        if flag <= 0:
            raise RuntimeError(f"daqp ended with {flag}")
        times.append(setup + info["solve_time"])
    return np.array(u), min(times)


def time_clarabel(qp: DenseQp) -> tuple[np.ndarray, float]:
    """PyPI `clarabel`, an interior-point method in Rust, in the form that is fastest for it: the softly bounded outputs
    are variables, so that each dense row stands once. The inputs, and the seconds with set-up.
    """
    import clarabel
    from scipy import sparse

    n = qp.inputs
    slacks = len(qp.f) - n
    # v = [U, s, y]; y = G U is an equation, and the bounds on y - s and y + s are sparse.
    change, gain = qp.a[:n, :n], qp.a[n : n + slacks, :n]
    one, wide = np.eye(slacks), np.zeros((slacks, n))
    rows = np.vstack(
        [
            np.eye(n + slacks, n + 2 * slacks),
            np.hstack([change, np.zeros((n, 2 * slacks))]),
            np.hstack([wide, -one, one]),
            np.hstack([wide, one, one]),
        ]
    )
    up, low = qp.upper < UNBOUNDED, qp.lower > -UNBOUNDED
    matrix = np.vstack([np.hstack([-gain, np.zeros((slacks, slacks)), one]), rows[up], -rows[low]])
    bound = np.concatenate([np.zeros(slacks), qp.upper[up], -qp.lower[low]])
    h = np.zeros((n + 2 * slacks, n + 2 * slacks))
    h[: n + slacks, : n + slacks] = qp.h
    cost, matrix = sparse.triu(sparse.csc_matrix(h), format="csc"), sparse.csc_matrix(matrix)
    cones = [clarabel.ZeroConeT(slacks), clarabel.NonnegativeConeT(len(bound) - slacks)]
    settings = clarabel.DefaultSettings()
    # One thread and this factorisation are its fastest for problems of this size.
    settings.verbose, settings.direct_solve_method, settings.max_threads = False, "qdldl", 1
    f = np.concatenate([qp.f, np.zeros(slacks)])
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        solution = clarabel.DefaultSolver(cost, f, matrix, bound, cones, settings).solve()
        times.append(time.perf_counter() - begin)
    if str(solution.status) != "Solved":
        raise RuntimeError(f"clarabel ended with {solution.status}")
    return np.array(solution.x)[:n], min(times)


def difference(problem: dict, ours: np.ndarray, theirs: np.ndarray) -> float:
    """Largest difference of two solutions' inputs, relative to the inputs' bounds."""
    shape = problem["shape"]
    bound = np.tile(np.maximum(np.abs(shape["input_min"]), np.abs(shape["input_max"])), shape["horizon"])
    return float((np.abs(ours - theirs) / bound).max())


def compare(program: Path, folder: Path, count: int = 100, say=print) -> dict:
    """Recorded problems, by horizon: times of each solver, differences of solutions to daqp's, which are certified."""
    file = folder / "problems.json"
    say("qp: recording drives")
    call(program, "problems", count, file)
    records = json.loads(file.read_text(encoding="utf-8"))
    file.unlink()
    result = {}
    more = peer_qp_more.installed()
    names = (*SOLVERS, *more)
    for horizon in sorted({record["problem"]["shape"]["horizon"] for record in records}):
        say(f"qp: N = {horizon}")
        of_horizon = [record for record in records if record["problem"]["shape"]["horizon"] == horizon]
        rows = []
        for record in of_horizon:
            problem = record["problem"]
            qp = dense(problem)
            z, multipliers = solve_daqp(qp)
            exact = z[: qp.inputs]
            daqp_u, daqp_s = time_daqp(qp, problem["shape"]["soft"][0])
            clarabel_u, clarabel_s = time_clarabel(qp)
            further = [timed(qp, REPEATS) for timed in more.values()]
            found = (record["inputs"], record["clarabel_inputs"], daqp_u, clarabel_u, *(u for u, _ in further))
            differences = [difference(problem, np.array(u), exact) for u in found]
            times = [record["seconds"], record["clarabel_seconds"], daqp_s, clarabel_s, *(s for _, s in further)]
            rows.append([active_bounds(qp, z), stationarity(qp, z, multipliers), *times, *differences])
        active, certificate, *columns = np.array(rows).T
        result[str(horizon)] = {
            "problems": len(rows),
            "with_active_bounds": int((active > 0).sum()),
            "most_active_bounds": int(active.max()),
            "daqp_kkt_residual": float(certificate.max()),
            "solvers": names,
        }
        for name, seconds, off in zip(names, columns[: len(names)], columns[len(names) :], strict=True):
            result[str(horizon)] |= {
                f"{name}_us": 1e6 * float(np.median(seconds)),
                f"{name}_p99_us": 1e6 * float(np.percentile(seconds, 99)),
                f"{name}_difference": float(off.max()),
            }
    return result
