"""FMU instances through the C interface itself: every call gives its status, and nothing is hidden by a host.

FMUs of FMI 2.0 and 3.0 have one face here, with 2.0's words; `Library.make` gives an instance of either.

Also a closed loop of two of them, for tests that save, restore, interleave and run in threads.
"""

from __future__ import annotations

import ctypes
import math
import shutil
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_int64, c_size_t, c_uint, c_void_p
from pathlib import Path

import fmpy
import fmpy.fmi2
import fmpy.fmi3
from closed_loop import callbacks_into
from wiring import SYSTEMS

# All FMUs.
UNITS = ["RflMpc", "PassengerCar", "TruckRflMpc", "SemiTrailerTruck"]
OK, WARNING, DISCARD, ERROR, FATAL = range(5)
STEP = 0.02
# Versions of FMI, and where their FMUs lie below those of 2.0.
VERSIONS = {"2.0": ".", "3.0": "fmi3"}
# Elements of the wheels' arrays, in order; a car has the first four.
WHEELS = ["front_left", "front_right", "rear_left", "rear_right", "trailer_left", "trailer_right"]
CLOCKED = "compute_time"  # the only variable that may differ between two equal runs


class Library:
    """An unpacked FMU with its library loaded."""

    def __init__(self, file: Path, folder: Path) -> None:
        self.folder = Path(folder)
        fmpy.extract(str(file), str(folder))
        self.description = fmpy.read_model_description(str(file))
        self.variables = {v.name: v for v in self.description.modelVariables}
        identifier = self.description.coSimulation.modelIdentifier
        suffix = fmpy.sharedLibraryExtension
        self.version = self.description.fmiVersion
        platform = fmpy.platform if self.version == "2.0" else fmpy.platform_tuple
        self.binary = self.folder / "binaries" / platform / f"{identifier}{suffix}"
        self.dll = ctypes.CDLL(str(self.binary))
        if self.version == "3.0":
            self._declare_3()
            return
        self.dll.fmi2Instantiate.restype = c_void_p
        self.dll.fmi2Instantiate.argtypes = [c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int]
        self.dll.fmi2FreeInstance.restype = None
        self.dll.fmi2FreeInstance.argtypes = [c_void_p]
        self.dll.fmi2DoStep.argtypes = [c_void_p, c_double, c_double, c_int]
        self.dll.fmi2SetupExperiment.argtypes = [c_void_p, c_int, c_double, c_double, c_int, c_double]

    def _declare_3(self) -> None:
        self.dll.fmi3InstantiateCoSimulation.restype = c_void_p
        self.dll.fmi3InstantiateCoSimulation.argtypes = [
            *(c_char_p, c_char_p, c_char_p, c_bool, c_bool, c_bool, c_bool),
            *(c_void_p, c_size_t, c_void_p, c_void_p, c_void_p),
        ]
        self.dll.fmi3FreeInstance.restype = None
        self.dll.fmi3FreeInstance.argtypes = [c_void_p]
        self.dll.fmi3DoStep.argtypes = [c_void_p, c_double, c_double, c_bool, *[c_void_p] * 4]
        self.dll.fmi3EnterInitializationMode.argtypes = [c_void_p, c_bool, c_double, c_double, c_bool, c_double]

    def make(self, name="unit", **options) -> Instance:
        """An instance."""
        return (Instance if self.version == "2.0" else Instance3)(self, name, **options)

    @property
    def outputs(self) -> list[str]:
        """Real outputs that are the same in every run."""
        real = "Real" if self.version == "2.0" else "Float64"
        return [n for n, v in self.variables.items() if (v.causality, v.type) == ("output", real) and n != CLOCKED]

    def size(self, name: str) -> int:
        """Number of values of a variable; an array has several."""
        return math.prod(self.variables[name].shape or (1,))

    def in_scalars(self, names) -> list[str]:
        """The same variables as 2.0 names them: an array by its elements."""
        scalars = []
        for name in names:
            if self.size(name) == 1:
                scalars.append(name)
            elif name.startswith("wheel."):
                of_wheel = name.removeprefix("wheel.")
                scalars += [f"wheel.{place}.{of_wheel}" for place in WHEELS[: self.size(name)]]
            else:
                scalars += [f"{name}[{i + 1}]" for i in range(self.size(name))]
        return scalars

    @property
    def inputs(self) -> list[str]:
        """All inputs; all are reals."""
        return [n for n, v in self.variables.items() if v.causality == "input"]


class Instance:
    """One instance; methods are named for the standard's functions and return their status."""

    def __init__(self, library: Library, name="unit", *, guid=None, resources=None, kind=1, with_logger=True) -> None:
        self.library, self.dll = library, library.dll
        self.messages: list[tuple[int, str, str]] = []
        self.callbacks = callbacks_into(self.messages)
        if not with_logger:
            self.callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE()
        guid = library.description.guid if guid is None else guid
        location = (library.folder / "resources").as_uri() if resources is None else resources
        self.handle = self.dll.fmi2Instantiate(
            name.encode(), kind, guid.encode(), location.encode() if location else None, byref(self.callbacks), 0, 0
        )

    def call(self, function: str, *arguments) -> int:
        return getattr(self.dll, function)(c_void_p(self.handle), *arguments)

    def references(self, names) -> ctypes.Array:
        return (c_uint * len(names))(*(self.library.variables[name].valueReference for name in names))

    def set_reals(self, values: dict[str, float]) -> int:
        buffer = (c_double * len(values))(*values.values())
        return self.call("fmi2SetReal", self.references(list(values)), c_size_t(len(values)), buffer)

    def set_integers(self, values: dict[str, int]) -> int:
        """Integers and enumerations."""
        buffer = (c_int * len(values))(*values.values())
        return self.call("fmi2SetInteger", self.references(list(values)), c_size_t(len(values)), buffer)

    def set_booleans(self, values: dict[str, bool]) -> int:
        buffer = (c_int * len(values))(*values.values())
        return self.call("fmi2SetBoolean", self.references(list(values)), c_size_t(len(values)), buffer)

    def get_reals(self, names) -> list[float]:
        buffer = (c_double * len(names))()
        status = self.call("fmi2GetReal", self.references(names), c_size_t(len(names)), buffer)
        assert status <= WARNING, self.said
        return list(buffer)

    def get_integer(self, name: str, function="fmi2GetInteger") -> int:
        value = c_int()
        assert self.call(function, self.references([name]), c_size_t(1), byref(value)) <= WARNING, self.said
        return value.value

    def set_string(self, name: str, value: str) -> int:
        return self.call("fmi2SetString", self.references([name]), c_size_t(1), (c_char_p * 1)(str(value).encode()))

    def setup(self, start=0.0, stop=None) -> int:
        return self.call("fmi2SetupExperiment", 0, 0.0, start, int(stop is not None), stop or 0.0)

    def enter(self) -> int:
        return self.call("fmi2EnterInitializationMode")

    def exit(self) -> int:
        return self.call("fmi2ExitInitializationMode")

    def initialize(self) -> int:
        """The three calls; the first status that is worse than a warning, else the worst."""
        worst = OK
        for call in (self.setup, self.enter, self.exit):
            worst = max(worst, call())
            if worst > WARNING:
                break
        return worst

    def step(self, at: float, length: float = STEP) -> int:
        return self.dll.fmi2DoStep(c_void_p(self.handle), at, length, 1)

    def save(self) -> c_void_p:
        state = c_void_p()
        assert self.call("fmi2GetFMUstate", byref(state)) == OK, self.said
        return state

    def restore(self, state: c_void_p) -> int:
        return self.call("fmi2SetFMUstate", state)

    def serialize(self, state: c_void_p) -> bytes:
        size = c_size_t()
        assert self.call("fmi2SerializedFMUstateSize", state, byref(size)) == OK, self.said
        buffer = ctypes.create_string_buffer(size.value)
        assert self.call("fmi2SerializeFMUstate", state, buffer, size) == OK, self.said
        return buffer.raw

    def deserialize(self, data: bytes) -> tuple[int, c_void_p]:
        state = c_void_p()
        return self.call("fmi2DeSerializeFMUstate", c_char_p(data), c_size_t(len(data)), byref(state)), state

    def free_state(self, state: c_void_p) -> int:
        return self.call("fmi2FreeFMUstate", byref(state))

    def reset(self) -> int:
        return self.call("fmi2Reset")

    def terminate(self) -> int:
        return self.call("fmi2Terminate")

    def free(self) -> None:
        self.dll.fmi2FreeInstance(c_void_p(self.handle))
        self.handle = None

    @property
    def said(self) -> str:
        """All that was logged with a warning or worse."""
        return " | ".join(text for status, _, text in self.messages if status >= WARNING)


class Instance3(Instance):
    """The same of FMI 3.0."""

    def __init__(
        self, library: Library, name="unit", *, token=None, resources=None, with_logger=True, ends_early=False
    ) -> None:
        self.library, self.dll = library, library.dll
        self.messages: list[tuple[int, str, str]] = []
        self.start, self.stop = 0.0, None

        def listen(_environment, status, category, message) -> None:
            self.messages.append((status, category.decode(), message.decode()))

        self.logger = fmpy.fmi3.fmi3LogMessageCallback(listen if with_logger else 0)
        token = library.description.guid if token is None else token
        folder = f"{library.folder / 'resources'}/" if resources is None else resources
        self.last_successful_time = c_double()
        self.flags = [c_bool(True) for _ in range(3)]  # eventHandlingNeeded, terminateSimulation, earlyReturn
        self.told = [byref(value) for value in (*self.flags, self.last_successful_time)]
        self.handle = self.dll.fmi3InstantiateCoSimulation(
            *(name.encode(), token.encode(), folder.encode() if folder else None),
            *(False, True, False, ends_early, None, 0, None, ctypes.cast(self.logger, c_void_p), None),
        )

    def _set(self, kind: str, c_type, values: dict) -> int:
        count, buffer = c_size_t(len(values)), (c_type * len(values))(*values.values())
        return self.call(f"fmi3Set{kind}", self.references(list(values)), count, buffer, count)

    def set_reals(self, values: dict[str, float]) -> int:
        return self._set("Float64", c_double, values)

    def set_integers(self, values: dict[str, int]) -> int:
        """Integers, or enumerations."""
        is_enumeration = {self.library.variables[name].type == "Enumeration" for name in values}
        assert len(is_enumeration) == 1
        return self._set("Int64", c_int64, values) if is_enumeration == {True} else self._set("Int32", c_int, values)

    def set_booleans(self, values: dict[str, bool]) -> int:
        return self._set("Boolean", c_bool, values)

    def set_string(self, name: str, value: str) -> int:
        return self._set("String", c_char_p, {name: str(value).encode()})

    def set_binary(self, name: str, value: bytes) -> int:
        one, size = c_size_t(1), c_size_t(len(value))
        return self.call("fmi3SetBinary", self.references([name]), one, byref(size), byref(c_char_p(value)), one)

    def get_binary(self, name: str) -> bytes:
        one, size, value = c_size_t(1), c_size_t(), c_void_p()
        status = self.call("fmi3GetBinary", self.references([name]), one, byref(size), byref(value), one)
        assert status == OK, self.said
        return ctypes.string_at(value, size.value) if size.value else b""

    def _get(self, kind: str, c_type, names) -> list:
        values = sum(self.library.size(name) for name in names)
        buffer, references = (c_type * values)(), self.references(names)
        status = self.call(f"fmi3Get{kind}", references, c_size_t(len(names)), buffer, c_size_t(values))
        assert status <= WARNING, self.said
        return list(buffer)

    def get_reals(self, names) -> list[float]:
        """Values one after the other, all of an array."""
        return self._get("Float64", c_double, names)

    def get_integer(self, name: str) -> int:
        kinds = {"Int32": c_int, "Enumeration": c_int64, "Boolean": c_bool}
        kind = self.library.variables[name].type
        return int(self._get(kind.replace("Enumeration", "Int64"), kinds[kind], [name])[0])

    def setup(self, start=0.0, stop=None) -> int:
        """What `enter` passes."""
        self.start, self.stop = start, stop
        return OK

    def enter(self) -> int:
        stop = self.stop is not None
        return self.call("fmi3EnterInitializationMode", False, 0.0, self.start, stop, self.stop or 0.0)

    def exit(self) -> int:
        return self.call("fmi3ExitInitializationMode")

    def step(self, at: float, length: float = STEP) -> int:
        return self.dll.fmi3DoStep(c_void_p(self.handle), at, length, True, *self.told)

    def save(self) -> c_void_p:
        state = c_void_p()
        assert self.call("fmi3GetFMUState", byref(state)) == OK, self.said
        return state

    def restore(self, state: c_void_p) -> int:
        return self.call("fmi3SetFMUState", state)

    def serialize(self, state: c_void_p) -> bytes:
        size = c_size_t()
        assert self.call("fmi3SerializedFMUStateSize", state, byref(size)) == OK, self.said
        buffer = ctypes.create_string_buffer(size.value)
        assert self.call("fmi3SerializeFMUState", state, buffer, size) == OK, self.said
        return buffer.raw

    def deserialize(self, data: bytes) -> tuple[int, c_void_p]:
        state = c_void_p()
        return self.call("fmi3DeserializeFMUState", c_char_p(data), c_size_t(len(data)), byref(state)), state

    def free_state(self, state: c_void_p) -> int:
        return self.call("fmi3FreeFMUState", byref(state))

    def reset(self) -> int:
        return self.call("fmi3Reset")

    def terminate(self) -> int:
        return self.call("fmi3Terminate")

    def free(self) -> None:
        self.dll.fmi3FreeInstance(c_void_p(self.handle))
        self.handle = None


class ClosedLoop:
    """Controller and vehicle, stepped in Gauss-Seidel order; `drive` gives every output at every step."""

    def __init__(self, libraries: dict[str, Library], path: Path | None = None, system="ClosedLoop") -> None:
        self.path = path
        controller, vehicle = SYSTEMS[system]
        self.controller = libraries[controller].make("controller")
        self.vehicle = libraries[vehicle].make("vehicle")
        assert self.controller.handle and self.vehicle.handle
        self.to_controller = [n for n in self.controller.library.inputs if n in self.vehicle.library.outputs]
        self.to_vehicle = [n for n in self.vehicle.library.inputs if n in self.controller.library.outputs]
        self.start()

    def start(self) -> None:
        """From instantiated or reset to the first communication point."""
        if self.path:
            assert self.controller.set_string("path_file", self.path) == OK
            assert self.vehicle.set_string("road_file", self.path) == OK
        assert self.controller.initialize() <= WARNING, self.controller.said
        start = self.controller.get_reals(["start.x", "start.y", "start.yaw", "start.speed"])
        assert self.vehicle.set_reals(dict(zip(["initial.x", "initial.y", "initial.yaw", "initial.vx"], start))) == OK
        assert self.vehicle.initialize() <= WARNING, self.vehicle.said
        self.k = 0

    def drive(self, steps: int, outputs=True) -> list[list[float]]:
        rows = []
        for _ in range(steps):
            at = self.k * STEP
            state = dict(zip(self.to_controller, self.vehicle.get_reals(self.to_controller)))
            assert self.controller.set_reals(state) == OK, self.controller.said
            assert self.controller.step(at) <= WARNING, self.controller.said
            command = dict(zip(self.to_vehicle, self.controller.get_reals(self.to_vehicle)))
            assert self.vehicle.set_reals(command) == OK, self.vehicle.said
            assert self.vehicle.step(at) <= WARNING, self.vehicle.said
            self.k += 1
            if outputs:
                rows.append([v for unit in self.units for v in unit.get_reals(unit.library.outputs)])
        return rows

    @property
    def units(self) -> tuple[Instance, Instance]:
        return self.controller, self.vehicle

    def save(self):
        return self.k, [unit.save() for unit in self.units]

    def restore(self, saved) -> None:
        self.k, states = saved
        for unit, state in zip(self.units, states):
            assert unit.restore(state) == OK, unit.said

    def free_saved(self, saved) -> None:
        for unit, state in zip(self.units, saved[1]):
            assert unit.free_state(state) == OK

    def free(self) -> None:
        for unit in self.units:
            unit.free()


def unpack(fmus: Path, folder: Path) -> dict[str, Library]:
    """All FMUs, unpacked beside each other."""
    shutil.rmtree(folder, ignore_errors=True)
    return {name: Library(fmus / f"{name}.fmu", folder / name) for name in UNITS}
