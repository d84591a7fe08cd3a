"""The closed loop in Ecos.

Its fixed-step algorithm is Jacobi: all units step in parallel on the values at t_k, then all values are carried over.
Outputs are carried over once before the first step, too.
"""

import json
import os
import sys

from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure
from wiring import Loop, options


def main() -> None:
    given = options(__doc__)
    loop = Loop(given)
    EcosLib.set_log_level("warn")
    parameter_set = None
    if given.ssp:
        assert not loop.parameters, "Ecos takes an SSP's parameters from the SSP alone"
        parameter_set = given.ssp.stem  # the name of its parameters, which Ecos wants to be told
        simulation = EcosSimulation(ssp_path=str(given.ssp), step_size=given.step)
    else:
        structure = EcosSimulationStructure()
        for name, file in loop.files.items():
            structure.add_model(name, file)
        for source, sink, name in loop.wires:
            structure.make_real_connection(f"{source}::{name}", f"{sink}::{name}")
        values = {f"{unit}::{name}": v for unit, of_unit in loop.parameters.items() for name, v in of_unit.items()}
        if values:
            parameter_set = "test"
            structure.add_parameter_set(parameter_set, values)
        simulation = EcosSimulation(structure=structure, step_size=given.step)
    assert simulation.init(parameter_set=parameter_set), EcosLib.get_last_error()

    columns = {f"{unit}.{name}": [] for unit, name in loop.recorded}
    for _ in range(given.steps):
        simulation.step()
        for unit, name in loop.recorded:
            columns[f"{unit}.{name}"].append(simulation.get_real(f"{unit}::{name}"))
    simulation.terminate()
    simulation.free()
    given.out.write_text(json.dumps(columns))
    # TBB's manager of threads (tcmlib 1.6) leaves a handler behind for the end of the process, and is unloaded before:
    # up to one run in five ended in a segmentation fault there, all units freed.
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
