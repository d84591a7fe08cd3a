"""Instances do not know of each other, and every way back leads to the same bits.

Compared are all real outputs of controller and vehicle over the closed loop, except the wall-clock `compute_time`.
"""

from __future__ import annotations

import ctypes
import gc
import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest
from instance import OK, UNITS, VERSIONS, WARNING, ClosedLoop

BEFORE, AFTER = 500, 500  # steps before and after the event under test


ROADS = {"ClosedLoop": "sudoku_test", "TruckLoop": "off_road"}


@pytest.fixture(scope="module", params=[(version, system) for version in VERSIONS for system in ROADS], ids="-".join)
def start(request, of_version, paths):
    """Starts a loop of a system of a version of FMI, on its road unless another is named."""
    version, system = request.param

    def start(road: str = ROADS[system]) -> ClosedLoop:
        return ClosedLoop(of_version(version), paths / f"{road}.csv", system)

    return start


@pytest.fixture(scope="module")
def reference(start) -> list[list[float]]:
    """An undisturbed drive."""
    loop = start()
    rows = loop.drive(BEFORE + AFTER)
    loop.free()
    assert rows[-1] != rows[0]
    return rows


def test_reset_starts_anew(start, reference):
    loop = start()
    loop.drive(137, outputs=False)
    for unit in loop.units:
        assert unit.reset() == OK, unit.said
    loop.start()
    assert loop.drive(BEFORE + AFTER) == reference
    loop.free()


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", ["RflMpc", "TruckRflMpc"])
def test_reset_forgets_parameters(of_version, name, version):
    controller = of_version(version)[name].make()
    before = controller.library.variables["mpc.q_e1"].start
    assert controller.set_reals({"mpc.q_e1": 2 * float(before)}) == OK
    assert controller.reset() == OK
    assert controller.initialize() <= WARNING, controller.said
    assert controller.get_reals(["mpc.q_e1"]) == [float(before)]
    controller.free()


def test_interleaved_second_loop_changes_nothing(start, reference):
    loop, other = start(), start("hairpin_circuit")
    rows = []
    for k in range(BEFORE + AFTER):
        rows += loop.drive(1)
        if k % 3 == 0:
            other.drive(2, outputs=False)
    assert rows == reference
    loop.free()
    other.free()


def test_save_and_restore_in_mid_run(start, reference):
    loop = start()
    assert loop.drive(BEFORE) == reference[:BEFORE]
    saved = loop.save()
    assert loop.drive(AFTER) == reference[BEFORE:]
    for _ in range(2):  # a state can be restored again and again
        loop.restore(saved)
        assert loop.drive(AFTER) == reference[BEFORE:]
    loop.free_saved(saved)
    loop.free()


def test_serialised_state_continues_in_another_instance(start, reference):
    loop = start()
    loop.drive(BEFORE, outputs=False)
    saved = loop.save()
    data = [unit.serialize(state) for unit, state in zip(loop.units, saved[1])]
    loop.free_saved(saved)
    loop.free()

    other = start()
    other.drive(11, outputs=False)
    states = []
    for unit, content in zip(other.units, data):
        status, state = unit.deserialize(content)
        assert status == OK, unit.said
        states.append(state)
    other.restore((BEFORE, states))
    assert other.drive(AFTER) == reference[BEFORE:]
    other.free_saved((BEFORE, states))
    other.free()


STATES_OF_A_PROCESS = """
import sys
from pathlib import Path
from instance import ClosedLoop, unpack

fmus, folder, road, system, steps = sys.argv[1:]
loop = ClosedLoop(unpack(Path(fmus), Path(folder)), Path(road), system)
loop.drive(int(steps), outputs=False)
for unit, state in zip(loop.units, loop.save()[1]):
    Path(folder, unit.library.description.modelName).with_suffix(".state").write_bytes(unit.serialize(state))
"""


def test_serialised_state_continues_in_another_process(start, reference, fmus, tmp_path):
    """A process of its own drives half of the way and leaves the bytes of its states."""
    here = start()
    library = here.controller.library
    system = "TruckLoop" if library.description.modelName == "TruckRflMpc" else "ClosedLoop"
    folder = fmus / VERSIONS[library.version]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", STATES_OF_A_PROCESS, folder, tmp_path, here.path, system, str(BEFORE)]
    subprocess.run(command, check=True, env=environment)
    states = []
    for unit in here.units:
        content = tmp_path.joinpath(unit.library.description.modelName).with_suffix(".state").read_bytes()
        status, state = unit.deserialize(content)
        assert status == OK, unit.said
        states.append(state)
    here.restore((BEFORE, states))
    assert here.drive(AFTER) == reference[BEFORE:]
    here.free_saved((BEFORE, states))
    here.free()


def test_sixteen_loops_on_eight_threads(start, reference):
    # ctypes lets go of Python's lock in each call, so the FMUs do run at the same time.
    def one(_):
        loop = start()
        rows = loop.drive(BEFORE)
        loop.free()
        return rows == reference[:BEFORE]

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(one, range(16))) == [True] * 16


def test_loops_move_between_threads(start, reference):
    loops = [start() for _ in range(4)]
    rows = [[] for _ in loops]
    with ThreadPoolExecutor(8) as pool:
        for _ in range(10):
            for i, part in enumerate(pool.map(lambda loop: loop.drive(20), loops)):
                rows[i] += part
    assert all(r == reference[:200] for r in rows)
    for loop in loops:
        loop.free()


class Heap(ctypes.Structure):
    """What glibc says of its heaps (`mallinfo2`, since 2.33): the FMUs allocate there."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in (
            "arena",
            "ordblks",
            "smblks",
            "hblks",
            "hblkhd",
            "usmblks",
            "fsmblks",
            "uordblks",
            "fordblks",
            "keep",
        )
    ]


MALLINFO = getattr(ctypes.CDLL(None), "mallinfo2", None)


def allocated() -> int:
    """Bytes that are allocated and not freed."""
    MALLINFO.restype = Heap
    gc.collect()
    heap = MALLINFO()
    return heap.uordblks + heap.hblkhd


def leaves_nothing_behind(lives: Callable[[int], None], count: int) -> bool:
    """Whether a round of `count` lives leaves less than a pointer for each. What is lost is lost in every round; the
    allocator's own caches, which count as allocated, are full after some."""

    def growth() -> int:
        before = allocated()
        lives(count)
        return allocated() - before

    return any(growth() < 8 * count for _ in range(12))


@pytest.mark.skipif(MALLINFO is None, reason="allocated memory is told by glibc 2.33 and later")
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", UNITS)
def test_instances_leave_no_memory_behind(of_version, name, version):
    library = of_version(version)[name]

    def lives(count: int) -> None:
        for k in range(count):
            unit = library.make(with_logger=False)
            assert unit.initialize() <= WARNING
            assert unit.step(0.0) <= WARNING
            if k % 2:  # freed with and without a state and a proper end
                assert unit.free_state(unit.save()) == OK
                assert unit.terminate() == OK
            unit.free()

    assert leaves_nothing_behind(lives, 50)


@pytest.mark.skipif(MALLINFO is None, reason="allocated memory is told by glibc 2.33 and later")
def test_states_leave_no_memory_behind(start):
    loop = start()
    loop.drive(50, outputs=False)

    def cycles(count: int) -> None:
        for _ in range(count):
            saved = loop.save()
            loop.restore(saved)
            loop.free_saved(saved)

    assert leaves_nothing_behind(cycles, 200)
    loop.free()
