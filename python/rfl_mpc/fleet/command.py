"""The command ``rfl fleet``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

EXAMPLES = """examples:
  rfl fleet logs/                              each folder below holds the drives of a vehicle
  rfl fleet drives.csv --vehicle my_car.toml   a table: log, vehicle, and perhaps time, vehicle_file, reference
  rfl fleet drives.parquet --dask tcp://10.0.0.1:8786    on another's cluster: its workers read the same files
  rfl fleet drives.csv --dry-run               what would be done

Run again after new drives, a crash or Ctrl-C: what is done is not done again.
Exit status: 0 done, 1 bad input or a failure, 2 wrong usage, 3 a vehicle has changed."""


def main(words: Sequence[str]) -> int:
    """Runs the command; gives its exit status."""
    options = parser().parse_args(words)
    try:
        from rfl_mpc._native import RflError
        from rfl_mpc.fleet import run
    except ImportError as error:
        print(
            f"error: {error.name} is missing: install the package with its extra, pip install 'rfl-mpc[fleet]'",
            file=sys.stderr,
        )
        return 1
    try:
        found = run(
            options.sources,
            vehicle=options.vehicle,
            out=options.out,
            dask=options.dask,
            workers=options.workers,
            dry_run=options.dry_run,
            again=options.again,
            time_limit=options.time_limit,
            reports=options.reports,
            pairs=not options.no_pairs,
            trust=options.trust,
            rate=options.rate,
            quiet=options.quiet,
        )
    except RflError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("stopped; what was done is kept: run again to go on", file=sys.stderr)
        return 130
    print(found)
    if found.report.get("errors") == found.report["drives"]:
        print("error: no drive was diagnosed", file=sys.stderr)
        return 1
    return 3 if found.changed else 0


def parser() -> argparse.ArgumentParser:
    """The options."""
    made = argparse.ArgumentParser(
        prog="rfl fleet",
        description="What differs in which vehicle, and since when: each drive is diagnosed, and those of a vehicle "
        "and of a type together. Writes verdicts.parquet, vehicles.parquet, types.parquet, fleet.json and index.html.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("sources", nargs="+", metavar="LOGS|FOLDER|TABLE", help="logs, folders of them, manifests")
    made.add_argument("--vehicle", default=None, help="vehicle file of drives that name none (default: c_class)")
    made.add_argument("--out", default="fleet", help="folder to write into, and to go on from (default: %(default)s)")
    made.add_argument(
        "--dask",
        default=None,
        metavar="ADDRESS",
        help="scheduler, such as tcp://host:8786 (default: workers on this machine)",
    )
    made.add_argument(
        "--workers", type=int, default=None, help="worker processes on this machine (default: one a processor)"
    )
    made.add_argument(
        "--dry-run", action="store_true", help="say what would be done and which files are missing, and do nothing"
    )
    made.add_argument("--again", action="store_true", help="try drives that gave an error once more")
    made.add_argument(
        "--time-limit",
        type=float,
        default=600.0,
        metavar="S",
        help="longest diagnosis of a drive (default: %(default)g s)",
    )
    made.add_argument(
        "--reports",
        type=int,
        default=20,
        metavar="N",
        help="single reports of first changed drives (default: %(default)s)",
    )
    made.add_argument("--no-pairs", action="store_true", help="look for one effect a drive only: a third faster")
    made.add_argument(
        "--trust", choices=("low", "usual", "high"), default=None, help="how good the vehicle files' numbers are"
    )
    made.add_argument("--rate", type=float, default=None, metavar="HZ", help="rows a second of logs without time")
    made.add_argument("--quiet", action="store_true", help="no progress")
    return made


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
