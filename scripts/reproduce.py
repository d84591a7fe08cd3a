#!/usr/bin/env python3
"""Writes the results of car and truck, Markdown, JSON and plots, from what `rfl evaluate` measured.

scripts/reproduce runs both.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from results import car, robustness, truck
from results.common import ROOT


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--raw", type=Path, help="folder that rfl evaluate wrote for the car")
    parser.add_argument("--raw-truck", type=Path, help="folder that rfl evaluate wrote for the truck")
    parser.add_argument("--raw-robustness", type=Path, help="folder that the example robustness wrote")
    parser.add_argument("--out", type=Path, default=ROOT / "docs/results", help="folder for the results")
    arguments = parser.parse_args()
    if arguments.raw is None and arguments.raw_truck is None and arguments.raw_robustness is None:
        parser.error("give --raw, --raw-truck or --raw-robustness")
    arguments.out.mkdir(parents=True, exist_ok=True)
    if arguments.raw is not None:
        car.write(arguments.raw, arguments.out)
    if arguments.raw_truck is not None:
        truck.write(arguments.raw_truck, arguments.out)
    if arguments.raw_robustness is not None:
        robustness.write(arguments.raw_robustness, arguments.out)


if __name__ == "__main__":
    main()
