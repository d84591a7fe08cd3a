"""What the drivers of other hosts share: wires by equal names, parameters, and the drive as a JSON of columns."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import fmpy

# Systems with their controller and vehicle; components are named for their FMUs, as in the SSP of that name.
SYSTEMS = {"ClosedLoop": ("RflMpc", "PassengerCar"), "TruckLoop": ("TruckRflMpc", "SemiTrailerTruck")}
RECORDED = ["x", "y", "yaw", "vx", "vy", "yaw_rate", "ax", "ay", "steer"]  # of the vehicle
COMMANDS = ["steer_cmd", "accel_cmd"]  # of the controller


class Loop:
    """The closed loop as data: two FMUs, the wires between them, the parameters to set."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.controller, self.vehicle = controller, vehicle = SYSTEMS[options.system]
        self.files = {name: options.fmus / f"{name}.fmu" for name in (controller, vehicle)}
        self.references, inputs, outputs = {}, {}, {}
        for name, file in self.files.items():
            variables = fmpy.read_model_description(str(file)).modelVariables
            self.references[name] = {v.name: v.valueReference for v in variables}
            inputs[name] = [v.name for v in variables if v.causality == "input"]
            outputs[name] = {v.name for v in variables if v.causality == "output"}
        self.wires = [(vehicle, controller, n) for n in inputs[controller] if n in outputs[vehicle]]
        self.wires += [(controller, vehicle, n) for n in inputs[vehicle] if n in outputs[controller]]
        self.parameters = json.loads(options.parameters)
        self.recorded = recorded(options.system)


def recorded(system: str) -> list[tuple[str, str]]:
    """What a drive holds of a system: component and variable."""
    controller, vehicle = SYSTEMS[system]
    return [(vehicle, n) for n in RECORDED] + [(controller, n) for n in COMMANDS]


def options(doc: str) -> argparse.Namespace:
    """The drivers' command line."""
    parser = argparse.ArgumentParser(description=doc)
    parser.add_argument("--fmus", type=Path, required=True)
    parser.add_argument("--system", choices=SYSTEMS, default="ClosedLoop")
    parser.add_argument("--ssp", type=Path, help="run this system instead of wiring the two FMUs here")
    parser.add_argument("--parameters", default="{}", help='JSON: {"PassengerCar": {name: value}, "RflMpc": {...}}')
    parser.add_argument("--step", type=float, default=0.02)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True, help="JSON of columns, one row after each step")
    return parser.parse_args()
