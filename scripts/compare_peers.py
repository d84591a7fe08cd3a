#!/usr/bin/env python3
"""Our forest, QP and nonlinear MPC beside other people's software, on the same problems, in one run.

    scripts/compare_peers                       all parts: out/peers.json, docs/results/speed.md, .json and .png
    scripts/compare_peers --only qp             one part; the others stay as they were last measured

Ratios matter; absolute times drift with the machine. What each time contains is said below its table.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
from pathlib import Path

import peer_forest
import peer_qp
from results import speed
from results.common import program

ROOT = Path(__file__).resolve().parent.parent


def processor() -> str:
    """What the system calls the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def compare_nonlinear(programs: Path, kind: str, quick: bool, say) -> dict:
    # CasADi is needed here only: the other parts run where there is none.
    import peer_nmpc

    return peer_nmpc.compare(programs / "peers", kind, 10 if quick else 50, say)


def compare_agreement(programs: Path, quick: bool, say) -> dict:
    say("agreement: solving every problem twice")
    return peer_forest.call(programs / "peers", "agreement", 20 if quick else 700)


def measure_training(programs: Path, quick: bool, say) -> dict:
    """Each size in a process of its own, for its memory."""
    result = {}
    sizes = [10_000, 100_000]
    if not quick:
        sizes.append(1_000_000)
        # The table alone takes 5.4 GB.
        if os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") > 12e9:
            sizes.append(10_000_000)
    for rows in sizes:
        say(f"training: {rows} rows")
        result[str(rows)] = peer_forest.call(programs / "peers", "training", rows)
    return result


def measure_fmpy(fmus: Path, quick: bool, say) -> dict:
    """Car and controller in fmpy, the median of some drives; none where the FMUs are not built."""
    import closed_loop

    if not (fmus / "RflMpc.fmu").is_file():
        raise RuntimeError(f"{fmus} holds no FMUs; run scripts/build-fmus, or leave out the part 'fmpy'")
    say("fmpy: driving")
    duration, factors = (10.0, 3) if quick else (60.0, 5)
    factors = sorted(duration / closed_loop.drive(duration=duration, fmus=fmus).wall for _ in range(factors))
    return {"x_real_time": factors[len(factors) // 2], "duration_s": duration}


# Each part: the folder of our side's programs, a folder for files, whether in short; gives figures.
PARTS = {
    "forest": lambda programs, folder, quick, say: peer_forest.compare_training(
        programs / "peers", folder, 5_000 if quick else 100_000, say
    ),
    "lookup": lambda programs, folder, quick, say: peer_forest.compare_lookup(programs / "peers", folder, say),
    "qp": lambda programs, folder, quick, say: peer_qp.compare(programs / "peers", folder, 20 if quick else 100, say),
    "nmpc": lambda programs, folder, quick, say: compare_nonlinear(programs, "nmpc", quick, say),
    "gp_nmpc": lambda programs, folder, quick, say: compare_nonlinear(programs, "gp", quick, say),
    "agreement": lambda programs, folder, quick, say: compare_agreement(programs, quick, say),
    "speed": lambda programs, folder, quick, say: peer_forest.call(programs / "peers", "steps"),
    "growth": lambda programs, folder, quick, say: peer_forest.call(programs / "peers", "growth"),
    "instances": lambda programs, folder, quick, say: peer_forest.call(programs / "peers", "instances"),
    "training": lambda programs, folder, quick, say: measure_training(programs, quick, say),
    "fmpy": lambda programs, folder, quick, say: measure_fmpy(ROOT / "target" / "fmu", quick, say),
}


def report(result: dict) -> str:
    """The figures as text."""
    lines = []
    if part := result.get("forest"):
        lines += [
            f"\nTraining, {part['rows']} x {part['columns']}, 20 trees of depth 6, 8 features a split, 4 outputs, "
            f"{part['threads']} threads",
            f"{'':<24}{'time s':>10}{'CPU s':>10}{'test RMSE':>12}",
            f"{'ours':<24}{part['ours_s']:>10.2f}{part['ours_cpu_s']:>10.2f}{part['ours_test_rmse']:>12.4f}",
            f"{'scikit-learn':<24}{part['sklearn_s']:>10.2f}{part['sklearn_cpu_s']:>10.2f}"
            f"{part['sklearn_test_rmse']:>12.4f}   {part['ratio']:.1f} times ours, {part['cpu_ratio']:.1f} in CPU time",
        ]
    if part := result.get("lookup"):
        lines += [
            f"\n{part['rows']} rows looked up in 20 trees of depth 6, leaves' 17 x 4 coefficients averaged, 1 thread",
            f"{'':<24}{'time us':>10}",
            f"{'ours':<24}{part['ours_us']:>10.1f}",
            f"{'scikit-learn, apply':<24}{part['sklearn_apply_and_average_us']:>10.1f}   "
            f"{part['ratio']:.0f} times ours",
            f"{'scikit-learn, predict':<24}{part['sklearn_predict_us']:>10.1f}   constant leaves",
        ]
    for horizon, part in result.get("qp", {}).items():
        lines += [
            f"\nQP, N = {horizon}: {part['problems']} problems of closed-loop drives, "
            f"{part['with_active_bounds']} with active bounds (up to {part['most_active_bounds']})",
            f"{'':<24}{'median us':>10}{'p99 us':>10}{'difference':>12}",
        ]
        for name in part["solvers"]:
            ratio = "" if name == "ours" else f"   {part[f'{name}_us'] / part['ours_us']:.2f} times ours"
            lines.append(
                f"{name.replace('_', ', '):<24}{part[f'{name}_us']:>10.1f}{part[f'{name}_p99_us']:>10.1f}"
                f"{part[f'{name}_difference']:>12.1e}{ratio}"
            )
    if "qp" in result:
        lines.append(
            "difference: largest of an input, relative to the inputs' bound, to a solution whose KKT residual is at "
            f"most {max(part['daqp_kkt_residual'] for part in result['qp'].values()):.0e}\n"
            "ours, and ours with Clarabel alone: from gains to inputs, the cost's Hessian included, after the problem "
            "before\nit in the drive; the others: Hessian given, set up anew for each problem, best of 3"
        )
    nonlinear = [
        (title, horizon, part)
        for name, title in speed.NONLINEAR.items()
        for horizon, part in result.get(name, {}).items()
    ]
    for title, horizon, part in nonlinear:
        lines += [
            f"\n{title}, N = {horizon}: {part['problems']} problems of a closed-loop drive; objective above IPOPT's by "
            f"at most {part['largest_relative_excess']:.0e} of it, inputs apart by at most "
            f"{part['largest_input_difference_rad']:.0e} rad",
            f"{'':<24}{'median us':>10}{'p99 us':>10}",
            f"{'ours':<24}{part['ours_us']:>10.0f}{part['ours_p99_us']:>10.0f}",
            f"{'CasADi, IPOPT':<24}{part['ipopt_us']:>10.0f}{part['ipopt_p99_us']:>10.0f}   "
            f"{part['ratio']:.0f} times ours",
        ]
    if nonlinear:
        lines.append(
            "both from the same plan, that of the step before; ours stops as in the drive, IPOPT at 1e-9; IPOPT's time "
            "is\nwith the road as one cubic, in its favour, and agreement is judged on the road as it is"
        )
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=PARTS, action="append", help="a part of it; repeatable")
    parser.add_argument("--quick", action="store_true", help="smaller tables, fewer problems")
    parser.add_argument("--results", type=Path, default=ROOT / "docs" / "results", help="folder for speed.md")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "peers.json", help="file for the figures")
    parser.add_argument(
        "--programs",
        type=Path,
        default=ROOT / "target" / "release" / "examples",
        help="folder of our side of it: the example peers",
    )
    options = parser.parse_args()

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    result: dict = {"machine": {"cores": os.cpu_count(), "processor": processor()}, "program": program()}
    # Parts that are not measured now stay as they were.
    if options.only and options.out.is_file():
        result = json.loads(options.out.read_text(encoding="utf-8")) | result
    try:
        with tempfile.TemporaryDirectory() as folder:
            for name in options.only or PARTS:
                result[name] = PARTS[name](options.programs, Path(folder), options.quick, say)
    except (RuntimeError, OSError, ImportError) as error:
        print(f"compare_peers: {error}", file=sys.stderr)
        return 1
    print(report(result))
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    print(f"\n{options.out}")
    if not options.quick:
        speed.write(result, options.results)
        print(options.results / "speed.md")
    return 0


if __name__ == "__main__":
    sys.exit(main())
