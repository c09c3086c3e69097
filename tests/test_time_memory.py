"""Many steps in time need no more memory than few, but for the history and the list of steps."""

import ctypes
import gc
import sys
import weakref
from pathlib import Path

import numpy as np
import pytest
from time_scenes import fixed, landing

import ufl_origami as uo
from ufl_origami.solvers.newton import NewtonSolver

pytestmark = pytest.mark.serial

NARROW = uo.Record(fields="none", reactions=(), points=(), creases=())
PAGE = 4096


class Heap(ctypes.Structure):
    """What glibc's mallinfo2 gives."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            "arena", "ordblks", "smblks", "hblks", "hblkhd",
            "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost",
        )
    )  # fmt: skip


def heap_in_use():
    """Bytes that are allocated from the C library: PETSc, NumPy, Python's larger objects."""
    function = ctypes.CDLL(None).mallinfo2
    function.restype = Heap
    gc.collect()
    heap = function()
    return heap.uordblks + heap.hblkhd


def resident():
    """Bytes of the process in memory."""
    gc.collect()
    return PAGE * int(Path("/proc/self/statm").read_text().split()[1])


def grown(measure, first, last, time):
    """Growth of a measure between two steps of a landing, and the run's result."""
    seen = {}

    def note(step, _):
        if step.number in (first, last):
            seen[step.number] = measure()

    result = uo.solve_dynamic(landing(), [last * time], fixed(time), record=NARROW, on_accept=note)
    return seen[last] - seen[first], result


def size_of(rows):
    """Bytes of dictionaries with their keys and values, each object counted once."""
    parts = {id(part): part for row in rows for pair in row.items() for part in pair}
    return sum(map(sys.getsizeof, [*rows, *parts.values()]))


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="needs glibc 2.33")
def test_steps_leave_nothing_on_the_heap_but_rows():
    """A vector of the 77 unknowns with its PETSc object takes 2 kB: one a step would show."""
    growth, result = grown(heap_in_use, 60, 160, 1e-3)
    row = max(map(sys.getsizeof, result.history.rows))
    assert growth / 100 < row + 200


def solve_in_time(scene):
    return uo.solve_dynamic(scene, [2e-3], fixed(1e-3), record=NARROW)


def solve_at_rest(scene):
    scene.fix("left")
    return uo.solve_static(scene, [1e-3])


@pytest.mark.parametrize("solve", [solve_in_time, solve_at_rest])
def test_a_solve_gives_its_factors_back_without_the_garbage_collector(monkeypatch, solve):
    solvers, made = [], NewtonSolver.__init__

    def noted(self, *args):
        made(self, *args)
        solvers.append(weakref.ref(self))

    monkeypatch.setattr(NewtonSolver, "__init__", noted)
    scene = landing()
    gc.disable()
    try:
        result = solve(scene)
        assert len(result.steps) and len(solvers) == 1
        assert solvers[0]() is None
    finally:
        gc.enable()


@pytest.mark.slow
def test_ten_thousand_steps_do_not_grow():
    growth, result = grown(resident, 2000, 10000, 1e-3)
    kept = size_of(result.history.rows[2000:])
    kept += size_of([vars(step) for step in result.steps[2000:]])
    assert growth < 1.25 * kept + 1e6  # Python rounds sizes up to 16 bytes: floats take 32 for 24
    assert np.isfinite(result.history["energy_total"]).all()
