#!/usr/bin/env python3
"""CasADi with IPOPT on the nonlinear MPC problems that our controller solves.

    peer_nmpc.py PROBLEMS.json          problems of `cargo run --release --example peers -- nonlinear 16 50 gp`

NMPC, and GP-NMPC: the same with Gaussian processes, learned by us, for what the bicycle misses in a step. The problem
is written out here anew, from its equations: the nonlinear bicycle along a path (`src/nominal/bicycle.rs`,
`path_model.rs`), Runge-Kutta of 4th order with the speed of a step held, the processes' means
(`src/residual/gp/kernel.rs`), the tracking cost (`src/control/tracking_qp.rs`), by direct multiple shooting with exact
Hessians.

Agreement is judged on the road as it is, a chain of parabolas of curvature. Times are taken on another problem, in
CasADi's favour: the road ahead as one cubic, which it evaluates faster.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import casadi as ca
import numpy as np

SHAPE, GRAVITY = 1.3, 9.81  # of the tyre model
STATES = 5  # station, e1, e2, vy, yaw rate
# Speeds of a step: for the motion along the path, at its end, for tyres and body, and what a process is asked at.
MEAN, END, BODY, PLANNED = range(4)
SPEEDS = 4


class Peer:
    """The problem for a horizon, a number of substeps and of pieces of the road, as a parametric NLP."""

    def __init__(self, document: dict, substeps: int, pieces: int, degree: int):
        self.shape, self.pieces, self.degree = document["shape"], pieces, degree
        horizon = self.horizon = self.shape["horizon"]
        self.learned = document["processes"] is not None
        assert self.shape["outputs"] == 3 and self.shape["inputs"] == 1, "e1, e1', e2 are tracked"
        speeds, references = ca.SX.sym("v", SPEEDS, horizon), ca.SX.sym("ref", 3, horizon)
        accel = ca.SX.sym("accel")
        start, previous = ca.SX.sym("x0", STATES), ca.SX.sym("u_before")
        road = ca.SX.sym("road", pieces * (degree + 2))
        x, u, slack = ca.SX.sym("x", STATES, horizon), ca.SX.sym("u", horizon), ca.SX.sym("s", horizon)
        curvature = self._curvature(road)
        step, errors = self._model(document, substeps)
        step = self._corrected(step, document["processes"], accel)
        bound = self.shape["soft"][0]
        cost, gaps, soft, rates = 0, [], [], []
        for j in range(horizon):
            before = start if j == 0 else x[:, j - 1]
            gaps.append(step(curvature, before, speeds[:, j], u[j]) - x[:, j])
            y = errors(x[:, j], speeds[END, j])
            factor = self.shape["terminal_factor"] if j == horizon - 1 else 1.0
            for i, weight in enumerate(self.shape["output_weight"]):
                cost += 0.5 * weight * factor * (y[i] - references[i, j]) ** 2
            change = u[j] - (previous if j == 0 else u[j - 1])
            cost += 0.5 * self.shape["rate_weight"][0] * change**2
            cost += 0.5 * bound["quadratic"] * slack[j] ** 2 + bound["linear"] * slack[j]
            soft += [y[0] - slack[j], y[0] + slack[j]]
            rates.append(change)
        # Variables in the order of time: the sparse factorisation likes that.
        variables = ca.vertcat(*[ca.vertcat(u[j], x[:, j], slack[j]) for j in range(horizon)])
        parameters = ca.vertcat(start, previous, accel, ca.vec(speeds), ca.vec(references), road)
        nlp = {"x": variables, "p": parameters, "f": cost, "g": ca.vertcat(*gaps, *soft, *rates)}
        options = {
            "print_time": False,
            "ipopt": {
                "print_level": 0,
                "sb": "yes",
                "tol": 1e-9,
                "warm_start_init_point": "yes",
                "mu_init": 1e-6,
                "bound_relax_factor": 0.0,
            },
        }
        self.solver = ca.nlpsol("solver", "ipopt", nlp, options)
        self.roll_out = ca.Function(
            "roll_out", [start, accel, speeds, u, road], [self._roll_out(step, curvature, start, speeds, u)]
        )
        inf, rate = np.inf, self.shape["rate_max"][0]
        self.lbg = np.r_[np.zeros(STATES * horizon), np.tile([-inf, bound["min"]], horizon), np.full(horizon, -rate)]
        self.ubg = np.r_[np.zeros(STATES * horizon), np.tile([bound["max"], inf], horizon), np.full(horizon, rate)]
        free = np.full(STATES, inf)
        self.lbx = np.tile(np.r_[self.shape["input_min"][0], -free, 0.0], horizon)
        self.ubx = np.tile(np.r_[self.shape["input_max"][0], free, inf], horizon)

    def _curvature(self, road):
        """Curvature at a station: pieces, each `station, c0, c1, ..` in the distance from there."""

        def at(station):
            size = self.degree + 2

            def piece(k, u):
                value = 0
                for i in range(size - 1, 0, -1):
                    value = value * u + road[k * size + i]
                return value

            value = piece(0, station - road[0])
            for k in range(1, self.pieces):
                value = ca.if_else(station >= road[k * size], piece(k, station - road[k * size]), value)
            return value

        return at

    @staticmethod
    def _model(document: dict, substeps: int):
        v = document["vehicle"]
        lf, lr, mass = v["lf"], v["lr"], v["mass"]

        def axle(stiffness, lever):
            peak = document["friction"] * mass * GRAVITY * lever / (lf + lr)
            slope = stiffness / (SHAPE * peak)
            return lambda slip: peak * ca.sin(SHAPE * ca.atan(slope * slip))

        front, rear = axle(v["cf"], lr), axle(v["cr"], lf)

        def rates(curvature, x, speed, steer):
            e1, e2, vy, r = x[1], x[2], x[3], x[4]
            k = curvature(x[0])
            vx = speed[MEAN]
            along = (vx * ca.cos(e2) - vy * ca.sin(e2)) / (1 - k * e1)
            across = vx * ca.sin(e2) + vy * ca.cos(e2)
            vx = speed[BODY]
            force_f = front(steer - ca.atan((vy + lf * r) / vx)) * ca.cos(steer)
            force_r = rear(-ca.atan((vy - lr * r) / vx))
            return ca.vertcat(
                along,
                across,
                r - k * along,
                (force_f + force_r) / mass - vx * r,
                (lf * force_f - lr * force_r) / v["yaw_inertia"],
            )

        def step(curvature, x, speed, steer):
            h = document["sample_time"] / substeps
            for _ in range(substeps):
                k1 = rates(curvature, x, speed, steer)
                k2 = rates(curvature, x + h / 2 * k1, speed, steer)
                k3 = rates(curvature, x + h / 2 * k2, speed, steer)
                k4 = rates(curvature, x + h * k3, speed, steer)
                x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            return x

        def errors(x, vx):
            return [x[1], vx * ca.sin(x[2]) + x[3] * ca.cos(x[2]), x[2]]

        return step, errors

    @staticmethod
    def _corrected(step, processes: list[dict] | None, accel):
        """The step with the processes' means added to lateral velocity and yaw rate."""
        if processes is None:
            return step
        learned = []
        for process in processes:
            scales, weights = np.array(process["length_scales"]), np.array(process["weights"])
            points = ca.DM((np.array(process["points"]) / scales).T)
            learned.append((ca.DM(scales), points, ca.DM(process["signal"] ** 2 * weights)))

        def corrected(curvature, x, speed, steer):
            z = ca.vertcat(speed[PLANNED], x[3], x[4], steer, accel)
            after = step(curvature, x, speed, steer)
            means = []
            for scales, points, weights in learned:
                apart = points - ca.repmat(z / scales, 1, points.shape[1])
                means.append(ca.dot(weights, ca.exp(-0.5 * ca.sum1(apart**2)).T))
            return after + ca.vertcat(0, 0, 0, *means)

        return corrected

    def _roll_out(self, step, curvature, start, speeds, u):
        x, states = start, []
        for j in range(self.horizon):
            x = step(curvature, x, speeds[:, j], u[j])
            states.append(x)
        return ca.horzcat(*states)

    def solve(self, problem: dict, road: np.ndarray, guess: list[float]) -> tuple[np.ndarray, float, float]:
        """Plan, objective and seconds."""
        # A process has learned what a body misses that holds the speed at the beginning of a step.
        body = "begin_speed" if self.learned else "mean_speed"
        speeds = np.array([problem[name] for name in ("mean_speed", "end_speed", body, "planned_speed")])
        references = np.array(problem["reference"]).reshape(self.horizon, 3)
        accel = problem["accel"]
        parameters = np.r_[problem["start"], problem["previous"], accel, speeds.T.ravel(), references.ravel(), road]
        states = np.array(self.roll_out(problem["start"], accel, speeds, guess, road))
        first = np.vstack([guess, states, np.zeros(self.horizon)]).T.ravel()
        begin = time.perf_counter()
        found = self.solver(x0=first, p=parameters, lbx=self.lbx, ubx=self.ubx, lbg=self.lbg, ubg=self.ubg)
        seconds = time.perf_counter() - begin
        if not self.solver.stats()["success"]:
            raise RuntimeError(f"IPOPT: {self.solver.stats()['return_status']}")
        by_step = np.array(found["x"]).reshape(self.horizon, STATES + 2)
        # An interior point keeps its slacks positive: the objective is that of the best slacks for its states.
        bound, e1 = self.shape["soft"][0], by_step[:, 2]
        best = np.maximum(np.maximum(e1 - bound["max"], bound["min"] - e1), 0.0)

        def penalty(slack):
            return np.sum(0.5 * bound["quadratic"] * slack**2 + bound["linear"] * slack)

        objective = float(found["f"]) - penalty(by_step[:, -1]) + penalty(best)
        return by_step[:, 0], objective, seconds


def pieces(problem: dict, count: int) -> np.ndarray:
    """The road's parabolas, filled up to `count` with copies of the last one."""
    rows = [[piece["station"], *piece["coefficients"]] for piece in problem["curvature"]]
    rows += [rows[-1]] * (count - len(rows))
    return np.array(rows).ravel()


def compare_document(document: dict, say) -> dict:
    """Figures over the problems of one horizon."""
    problems, horizon = document["problems"], document["shape"]["horizon"]
    name = "NMPC" if document["processes"] is None else "GP-NMPC"
    if not problems:
        raise RuntimeError(f"no problem with horizon {horizon} was recorded")
    most = max(len(problem["curvature"]) for problem in problems)
    exact: dict[int, Peer] = {}
    simple: dict[int, Peer] = {}
    rows = []
    for done, problem in enumerate(problems):
        substeps = problem["substeps"]
        if substeps not in exact:
            say(f"{name}, N = {horizon}: CasADi problem with {substeps} substeps ({done} of {len(problems)} solved)")
            exact[substeps] = Peer(document, substeps, most, 2)
            simple[substeps] = Peer(document, substeps, 1, 3)
        plan, objective, piecewise_s = exact[substeps].solve(problem, pieces(problem, most), problem["guess"])
        cubic = problem["curvature_cubic"]
        one_piece = np.r_[cubic["station"], cubic["coefficients"]]
        _, _, seconds = simple[substeps].solve(problem, one_piece, problem["guess"])
        difference = np.abs(plan - problem["plan"]).max()
        excess = problem["objective"] - objective
        rows.append([difference, excess, objective, problem["seconds"], seconds, piecewise_s])
    difference, excess, objective, ours, peer, peer_exact = np.array(rows).T
    # Where the vehicle is on the path already, there is nothing to compare with.
    relative = excess[objective > 1e-6] / objective[objective > 1e-6]
    processes = document["processes"] or []
    return {
        "problems": len(problems),
        "points": [len(process["points"]) for process in processes],
        "largest_input_difference_rad": difference.max(),
        "largest_objective_excess": excess.max(),
        "largest_relative_excess": relative.max(),
        "smallest_relative_excess": relative.min(),
        "problems_with_a_relative": len(relative),
        "ours_us": 1e6 * np.median(ours),
        "ours_p99_us": 1e6 * np.quantile(ours, 0.99),
        "ipopt_us": 1e6 * np.median(peer),
        "ipopt_p99_us": 1e6 * np.quantile(peer, 0.99),
        "ipopt_exact_road_us": 1e6 * np.median(peer_exact),
        "ratio": float(np.median(peer) / np.median(ours)),
    }


def compare(program: Path, kind: str, problems: int, say, horizons: tuple[int, ...] = (16, 60)) -> dict:
    """Records problems of a kind, nmpc or gp, with `program` (the example `peers`) and compares; figures by horizon."""
    result = {}
    for horizon in horizons:
        say(f"{kind}, N = {horizon}: recording problems")
        command = [program, "nonlinear", str(horizon), str(problems), kind]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"{program}: {done.stderr.strip()}")
        result[str(horizon)] = compare_document(json.loads(done.stdout), say)
    return result


def main() -> int:
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    document = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    print(json.dumps(compare_document(document, lambda text: print(text, file=sys.stderr)), indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
