"""Drives the demo's roads with the FMUs, prints the table, writes results and a page to look at.

Then the same car with a slow steering: the default controller, one that knows the steering, and one that has learned.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path

import demo_learning
import demo_page
import numpy as np
from closed_loop import FMUS, STEP, Drive, DriveProgress, checks_of, drive, known, verdict
from outcome import COMPLETED, STATUSES, Requirement, exit_status, figures_help, write_junit, write_whole

ROOT = Path(__file__).resolve().parent.parent
ROUTES = {
    "sudoku_test": ROOT / "paths" / "sudoku_test.csv",
    "hairpin_circuit": ROOT / "paths" / "hairpin_circuit.csv",
}
# A real circuit that is not part of the project (racetrack-database, LGPL-3.0): driven where it is.
OPTIONAL_ROUTES = {"norisring": ROOT.parent / "shared" / "data" / "paths" / "tum_Norisring.csv"}


@dataclass
class Route:
    """A road, how it was driven, and the figures of the table."""

    name: str
    file: Path
    drive: Drive

    @property
    def error(self) -> dict[str, float]:
        """Lateral error over all steps from the start: mean absolute, root mean square, largest; in metres."""
        figures = self.drive.results()["tracking"]
        return {name: figures[name] for name in ("mae", "rmse", "max")}

    @property
    def time(self) -> float:
        """Seconds driven."""
        return self.drive.results()["duration"]

    @property
    def outcome(self) -> str:
        """The outcome in one word."""
        return self.drive.outcome


def results(routes: list[Route]) -> dict:
    """The contents of results.json: outcome and figures of each route, and of all controller steps together."""
    step = np.concatenate([route.drive.columns["compute_time"] for route in routes])
    return {
        "routes": {
            route.name: route.error | {"outcome": route.outcome, "reason": route.drive.ending.reason}
            for route in routes
        },
        "step": {
            "mean_s": float(step.mean()),
            "p99_s": float(np.percentile(step, 99)),
            "max_s": float(step.max()),
            "missed": int((step > STEP).sum()),
        },
        "real_time_factor": sum(route.time for route in routes) / sum(route.drive.wall for route in routes),
    }


def table(routes: list[Route], result: dict) -> str:
    """The table that the demo ends with."""
    width = max(len("route"), *(len(route.name) for route in routes))
    lines = [
        f"{'':<{width}}    driven   in time                  lateral error",
        f"{'route':<{width}}       [m]       [s]  end             mean    RMSE     max  [m]",
    ]
    for route in routes:
        error = result["routes"][route.name]
        length = float(np.ptp(route.drive.columns["station"]))
        lines.append(
            f"{route.name:<{width}}  {length:8.0f}  {route.time:8.1f}  {route.outcome:<13}"
            f"{error['mae']:7.4f} {error['rmse']:7.4f} {error['max']:7.4f}"
        )
    step = result["step"]
    count = sum(len(route.drive.columns["time"]) for route in routes)
    lines += [
        "",
        f"controller step: mean {1e3 * step['mean_s']:.3f} ms, p99 {1e3 * step['p99_s']:.3f} ms, "
        f"max {1e3 * step['max_s']:.3f} ms; missed deadlines: {step['missed']} of {count} "
        f"(Ts = {1e3 * STEP:.0f} ms)",
        f"real-time factor: {result['real_time_factor']:.0f} (controller and car in fmpy, one process)",
    ]
    return "\n".join(lines)


def short(folder: Path) -> Path:
    """A folder as the user would type it from here."""
    here = Path.cwd()
    return folder.relative_to(here) if folder.is_relative_to(here) else folder


def choose(options: argparse.Namespace) -> dict[str, Path]:
    """The roads to drive; says which are left out and why."""
    if options.path:
        return {file.stem: file for file in options.path}
    routes = dict(ROUTES)
    for name, file in OPTIONAL_ROUTES.items():
        if file.is_file():
            routes[name] = file
        else:
            print(f"{name}: skipped, its file is not here; any road can be driven with --path FILE")
    return routes


def learn_and_compare(options: argparse.Namespace, routes: dict[str, Path]) -> list[demo_learning.Row]:
    """The drives of the car with a slow steering."""
    folder = options.learned or options.out / "learn"
    if not options.learned:
        print(f"\nlearning {demo_learning.WORDS} on other roads: rfl learn, half a minute", flush=True)
        demo_learning.learn(options.rfl, options.vehicle, folder, options.quiet)
    return demo_learning.compare(routes, options.vehicle, folder, options.duration, options.fmus, options.quiet)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="scripts/demo",
        description=__doc__,
        epilog=f"{figures_help()}\n\n{STATUSES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--path", type=Path, action="append", metavar="FILE", help="a road of your own; repeatable")
    parser.add_argument("--vehicle", metavar="FILE", help="a car of your own, or a built-in name (see vehicles/)")
    parser.add_argument("--duration", type=float, metavar="S", help="stop each drive after so many seconds")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "demo", help="folder for results (out/demo)")
    parser.add_argument("--fmus", type=Path, default=FMUS, help="folder of the FMUs (target/fmu)")
    parser.add_argument("--rfl", type=Path, default=ROOT / "target" / "release" / "rfl", help="the program rfl")
    parser.add_argument("--plain", action="store_true", help="without the car with a slow steering")
    parser.add_argument("--learned", type=Path, metavar="DIR", help="what rfl learn wrote, instead of learning now")
    parser.add_argument("--require", action="append", default=[], metavar="FIGURE<=VALUE", help="a test; repeatable")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="file for outcomes and requirements, a JUnit XML")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    options = parser.parse_args()
    try:
        requirements = [Requirement(text) for text in options.require]
    except ValueError as error:
        parser.error(str(error))

    # A road that cannot be driven keeps none of the others from its log and the page.
    routes, refused = [], 0
    for name, file in choose(options).items():
        progress = DriveProgress(name, options.quiet)
        try:
            driven = drive(
                file,
                options.vehicle,
                duration=options.duration,
                fmus=options.fmus,
                progress=progress,
            )
        except (RuntimeError, ValueError, OSError) as error:
            print(f"\ndemo: {name}: {error}", file=sys.stderr)
            refused += 1
            continue
        finally:
            progress.close()
        if not len(driven.columns["time"]):
            print(f"\ndemo: {name}: {driven.ending.reason}", file=sys.stderr)
            refused += 1
            continue
        routes.append(Route(name, file, driven))
        for message in driven.messages[:5]:
            print(f"{name}: {message}", file=sys.stderr)

    if not routes:
        return 1

    result = results(routes)
    options.out.mkdir(parents=True, exist_ok=True)
    compared = []
    if not options.plain:
        try:
            compared = learn_and_compare(options, {route.name: route.file for route in routes})
        except (RuntimeError, ValueError, OSError) as error:
            print(f"demo: a slow steering: {error}", file=sys.stderr)
            refused += 1
    if compared:
        result["slow_steering"] = demo_learning.results(compared)
    write_whole(options.out / "results.json", json.dumps(known(result), indent=2) + "\n")
    for route in routes:
        route.drive.write_csv(options.out / f"{route.name}.csv")
    page = options.out / "index.html"
    write_whole(page, demo_page.render(routes, result, compared))

    shown = short(options.out)
    print(f"\n{table(routes, result)}\n")
    if compared:
        print(f"{demo_learning.table(result['slow_steering'])}\n")
    print(f"FMUs:    {short(options.fmus)}/*.fmu and ClosedLoop.ssp")
    print(f"results: {shown}/results.json, drive logs {shown}/*.csv")
    print(f"look at: {shown}/index.html")
    cut = options.duration is not None
    cases, status = [], 1 if refused else 0
    for route in routes:
        checks = checks_of(route.drive, requirements, cut)
        cases.append((f"demo.{route.name}", route.drive.wall, checks))
        if route.outcome != COMPLETED:
            print(f"{route.name}: {verdict(route.drive)}", file=sys.stderr)
        for check in checks[1:]:
            if not check.met:
                print(f"{route.name}: NOT met: {check.words}", file=sys.stderr)
        # The first road that went wrong gives the status.
        asked = any(requirement.asks_for(route.outcome) for requirement in requirements)
        status = status or exit_status(route.outcome, cut, all(check.met for check in checks[1:]), asked)
    for row in compared:
        for driven in row.drives.values():
            status = status or exit_status(driven.outcome, cut)
    if options.junit:
        write_junit(options.junit, "demo", cases)
    return status


if __name__ == "__main__":
    sys.exit(main())
