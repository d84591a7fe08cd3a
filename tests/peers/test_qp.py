"""The controller's quadratic programs, recorded in closed-loop drives, solved by another program: PyPI `daqp`.

The problems are written out in dense form from their definition (`scripts/peer_qp.py`), not by our code.
"""

from __future__ import annotations

import json

import numpy as np
import programs
import pytest

pytest.importorskip("daqp", reason="needs the PyPI package daqp")

from peer_forest import call
from peer_qp import active_bounds, dense, difference, solve_daqp, stationarity, time_daqp

AGREEMENT = 1e-6  # of the inputs' bound


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """Recorded problems with our solutions."""
    file = tmp_path_factory.mktemp("peers") / "problems.json"
    call(programs.example("peers"), "problems", 30, file)
    return json.loads(file.read_text(encoding="utf-8"))


def of_horizon(records, horizon):
    return [record for record in records if record["problem"]["shape"]["horizon"] == horizon]


@pytest.mark.parametrize("horizon", [16, 60])
def test_solutions_agree_with_daqp(records, horizon):
    worst: dict[str, float] = {}
    active = 0
    for record in of_horizon(records, horizon):
        qp = dense(record["problem"])
        z, multipliers = solve_daqp(qp)
        assert stationarity(qp, z, multipliers) < 1e-9, "daqp's solution is not one"
        active += active_bounds(qp, z) > 0
        off = difference(record["problem"], np.array(record["inputs"]), z[: qp.inputs])
        worst[record["case"]] = max(worst.get(record["case"], 0.0), off)
    print(f"N = {horizon}: {len(of_horizon(records, horizon))} problems, {active} with active bounds; largest {worst}")
    assert active >= 15, "the problems must not all be without active bounds"
    for case, off in worst.items():
        assert off <= AGREEMENT, (case, off)


def test_soft_constraints_of_daqp_are_ours(records):
    """What `compare_peers` times of daqp is the same problem."""
    for record in of_horizon(records, 16):
        qp = dense(record["problem"])
        z, _ = solve_daqp(qp)
        u, _ = time_daqp(qp, record["problem"]["shape"]["soft"][0])
        assert difference(record["problem"], u, z[: qp.inputs]) <= 1e-9
