"""Further QP solvers of PyPI on the dense problems of `peer_qp.py`: OSQP, PIQP and ProxQP, each where it is installed.

Each is set up anew for each problem, as a new linearisation asks, with bounds on variables where it knows such, and
with a tolerance that gives inputs as exact as a controller wants; what comes out says how exact they are.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable

import numpy as np

UNBOUNDED = 1e30
TOLERANCE = 1e-8


def _best(repeats: int, solve: Callable[[], np.ndarray]) -> tuple[np.ndarray, float]:
    """What `solve` gives, and the least seconds that it takes."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        z = solve()
        times.append(time.perf_counter() - begin)
    return z, min(times)


def time_osqp(qp, repeats: int) -> tuple[np.ndarray, float]:
    """OSQP, an operator-splitting method: precision has its price, so the tolerance is 1e-6; answers are polished."""
    import osqp
    from scipy import sparse

    cost = sparse.triu(sparse.csc_matrix(qp.h), format="csc")
    rows = sparse.csc_matrix(np.vstack([np.eye(len(qp.f)), qp.a]))

    def solve() -> np.ndarray:
        solver = osqp.OSQP()
        solver.setup(
            cost,
            qp.f,
            rows,
            qp.lower,
            qp.upper,
            eps_abs=1e-6,
            eps_rel=1e-6,
            polishing=True,
            max_iter=20000,
            verbose=False,
        )
        return solver.solve().x

    z, seconds = _best(repeats, solve)
    return z[: qp.inputs], seconds


def time_piqp(qp, repeats: int) -> tuple[np.ndarray, float]:
    """PIQP, a proximal interior-point method, dense."""
    import piqp

    n = len(qp.f)
    cost, rows = np.asfortranarray(qp.h), np.asfortranarray(qp.a)

    def solve() -> np.ndarray:
        solver = piqp.DenseSolver()
        solver.settings.eps_abs = solver.settings.eps_rel = TOLERANCE
        solver.setup(cost, qp.f, None, None, rows, qp.lower[n:], qp.upper[n:], qp.lower[:n], qp.upper[:n])
        solver.solve()
        return np.array(solver.result.x)

    z, seconds = _best(repeats, solve)
    return z[: qp.inputs], seconds


def time_proxqp(qp, repeats: int) -> tuple[np.ndarray, float]:
    """ProxQP of ProxSuite, a proximal augmented Lagrangian method, dense."""
    from proxsuite import proxqp

    n = len(qp.f)

    def solve() -> np.ndarray:
        solver = proxqp.dense.QP(n, 0, len(qp.a), True)
        solver.settings.eps_abs, solver.settings.eps_rel = TOLERANCE, 0.0
        solver.init(qp.h, qp.f, None, None, qp.a, qp.lower[n:], qp.upper[n:], l_box=qp.lower[:n], u_box=qp.upper[:n])
        solver.solve()
        return np.array(solver.results.x)

    z, seconds = _best(repeats, solve)
    return z[: qp.inputs], seconds


# By the name of the figures: the package, and how it is timed.
_ALL = {"osqp": ("osqp", time_osqp), "piqp": ("piqp", time_piqp), "proxqp": ("proxsuite", time_proxqp)}


def installed() -> dict[str, Callable]:
    """Those of them that are there."""
    return {name: timed for name, (package, timed) in _ALL.items() if importlib.util.find_spec(package)}
