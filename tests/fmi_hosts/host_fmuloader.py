"""The closed loop on fmuloader, which binds FMI's functions and leaves the master to its user: Jacobi.

Outputs are carried over once before the first step, too.
"""

import json
from contextlib import ExitStack

import fmpy
from fmuloader.fmi2 import Fmi2Slave, Fmi2Type
from wiring import Loop, options


def main() -> None:
    given = options(__doc__)
    loop = Loop(given)
    with ExitStack() as stack:
        units = {}
        for name, file in loop.files.items():
            unit = units[name] = stack.enter_context(Fmi2Slave(file, model_identifier=name))
            guid = fmpy.read_model_description(str(file)).guid
            unit.instantiate(name, Fmi2Type.CO_SIMULATION, guid=guid)
            unit.setup_experiment(0.0)
            for variable, value in loop.parameters.get(name, {}).items():
                reference = [loop.references[name][variable]]
                (unit.set_string if isinstance(value, str) else unit.set_real)(reference, [value])
            unit.enter_initialization_mode()
            unit.exit_initialization_mode()

        def reference(unit: str, name: str) -> list[int]:
            return [loop.references[unit][name]]

        columns = {f"{unit}.{name}": [] for unit, name in loop.recorded}
        for step in range(given.steps):
            carried = [units[source].get_real(reference(source, name)) for source, _, name in loop.wires]
            for (_, sink, name), value in zip(loop.wires, carried):
                units[sink].set_real(reference(sink, name), value)
            for unit in units.values():
                unit.do_step(step * given.step, given.step)
            for unit, name in loop.recorded:
                columns[f"{unit}.{name}"] += units[unit].get_real(reference(unit, name))
        for unit in units.values():
            unit.terminate()
    given.out.write_text(json.dumps(columns))


if __name__ == "__main__":
    main()
