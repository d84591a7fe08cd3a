"""The closed loop on fmuloader, which binds FMI 2.0 and 3.0, and leaves the master to its user: Jacobi.

Outputs are carried over once before the first step, too.
"""

import json
from contextlib import ExitStack

import fmpy
from fmuloader.fmi2 import Fmi2Slave, Fmi2Type
from fmuloader.fmi3 import Fmi3Slave
from wiring import Loop, options


class Unit3(Fmi3Slave):
    """A unit of 3.0 with 2.0's words."""

    def instantiate(self, name: str, _kind, guid: str) -> None:
        self.instantiate_co_simulation(name, instantiation_token=guid)

    def setup_experiment(self, _start: float) -> None:
        """In 3.0 a part of entering initialisation mode."""

    get_real, set_real = Fmi3Slave.get_float64, Fmi3Slave.set_float64


def main() -> None:
    given = options(__doc__)
    loop = Loop(given)
    with ExitStack() as stack:
        units = {}
        for name, file in loop.files.items():
            description = fmpy.read_model_description(str(file))
            slave = Fmi2Slave if description.fmiVersion == "2.0" else Unit3
            unit = units[name] = stack.enter_context(slave(file, model_identifier=name))
            unit.instantiate(name, Fmi2Type.CO_SIMULATION, guid=description.guid)
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
