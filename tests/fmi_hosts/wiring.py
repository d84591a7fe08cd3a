"""What the drivers of other hosts share: wires by equal names, parameters, and the drive as a JSON of columns."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import fmpy

# Components are named for their FMUs, as in ClosedLoop.ssp.
CONTROLLER, CAR = "RflMpc", "PassengerCar"
RECORDED = ["x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay", "steer"]  # of the car
COMMANDS = ["steer_cmd", "accel_cmd"]  # of the controller


class Loop:
    """The closed loop as data: two FMUs, the wires between them, the parameters to set."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.files = {name: options.fmus / f"{name}.fmu" for name in (CONTROLLER, CAR)}
        self.references, inputs, outputs = {}, {}, {}
        for name, file in self.files.items():
            variables = fmpy.read_model_description(str(file)).modelVariables
            self.references[name] = {v.name: v.valueReference for v in variables}
            inputs[name] = [v.name for v in variables if v.causality == "input"]
            outputs[name] = {v.name for v in variables if v.causality == "output"}
        self.wires = [(CAR, CONTROLLER, n) for n in inputs[CONTROLLER] if n in outputs[CAR]]
        self.wires += [(CONTROLLER, CAR, n) for n in inputs[CAR] if n in outputs[CONTROLLER]]
        self.parameters = json.loads(options.parameters)
        self.recorded = [(CAR, n) for n in RECORDED] + [(CONTROLLER, n) for n in COMMANDS]


def options(doc: str) -> argparse.Namespace:
    """The drivers' command line."""
    parser = argparse.ArgumentParser(description=doc)
    parser.add_argument("--fmus", type=Path, required=True)
    parser.add_argument("--ssp", type=Path, help="run this system instead of wiring the two FMUs here")
    parser.add_argument("--parameters", default="{}", help='JSON: {"PassengerCar": {name: value}, "RflMpc": {...}}')
    parser.add_argument("--step", type=float, default=0.02)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True, help="JSON of columns, one row after each step")
    return parser.parse_args()
