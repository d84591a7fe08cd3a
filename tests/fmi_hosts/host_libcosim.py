"""The closed loop in libcosim (Open Simulation Platform).

Its fixed-step algorithm is Jacobi: all units step in parallel on the values at t_k, then all values are carried over.
Outputs are carried over once before the first step, too.
"""

import json

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
from wiring import Loop, options

NANOSECONDS = 1_000_000_000
SUCCESS = 0


def main() -> None:
    given = options(__doc__)
    loop = Loop(given)
    log_output_level(CosimLogLevel.WARNING)
    step = round(given.step * NANOSECONDS)
    if given.ssp:
        execution = CosimExecution.from_ssp_file(str(given.ssp), step)
        index = {name: execution.slave_index_from_instance_name(name) for name in loop.files}
    else:
        execution = CosimExecution.from_step_size(step)
        slaves = {name: CosimLocalSlave(str(file), name) for name, file in loop.files.items()}
        index = {name: execution.add_local_slave(slave) for name, slave in slaves.items()}
        for source, sink, name in loop.wires:
            result = execution.connect_real_variables(
                index[source], loop.references[source][name], index[sink], loop.references[sink][name]
            )
            assert result == SUCCESS, f"libcosim cannot connect {source}.{name} with {sink}.{name}"
    for unit, values in loop.parameters.items():
        for name, value in values.items():
            kind = "string" if isinstance(value, str) else "real"
            set_initial = getattr(execution, f"{kind}_initial_value")
            assert set_initial(index[unit], loop.references[unit][name], value), f"libcosim cannot set {unit}.{name}"

    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    columns = {f"{unit}.{name}": [] for unit, name in loop.recorded}
    for _ in range(given.steps):
        assert execution.step(), "libcosim could not make a step"
        for unit in (loop.vehicle, loop.controller):
            names = [name for owner, name in loop.recorded if owner == unit]
            values = observer.last_real_values(index[unit], [loop.references[unit][name] for name in names])
            for name, value in zip(names, values):
                columns[f"{unit}.{name}"].append(value)
    given.out.write_text(json.dumps(columns))


if __name__ == "__main__":
    main()
