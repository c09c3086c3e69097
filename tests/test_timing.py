"""The split of a path's seconds, by a clock that only known work moves."""

import numpy as np
import pytest
from scenes import z_fold_scene

from ufl_origami.assembly import Tangent
from ufl_origami.discretise import build
from ufl_origami.history import Record
from ufl_origami.problem import Problem
from ufl_origami.run import solve_static
from ufl_origami.solvers.linear import Factorisation
from ufl_origami.timing import SECTIONS, timed

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.filterwarnings("ignore::ufl_origami.errors.MeshWarning"),
]
RECORD = Record(energies=False, reactions=(), creases=(), points=(), fields="none")


def pulled(size=0.5):
    """Model and accepted steps of a coarse Z-fold."""
    model = build(z_fold_scene(size, 0.5, structure="structured"))
    return model, solve_static(model, [1.0], record=RECORD, progress=False).steps


class Counter:
    """A clock that only moves when it is told to."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def working(monkeypatch, owner, name, clock, seconds):
    """Let a function take some seconds of the clock; the list counts its calls."""
    original, calls = getattr(owner, name), []

    def slow(*args, **kwargs):
        calls.append(1)
        clock.now += seconds
        return original(*args, **kwargs)

    monkeypatch.setattr(owner, name, slow)
    return calls


def test_each_section_gets_the_seconds_of_its_functions(comm, monkeypatch):
    clock = Counter()
    forces = working(monkeypatch, Problem, "forces", clock, 1.0)
    evaluations = working(monkeypatch, Tangent, "evaluate", clock, 10.0)
    factors = working(monkeypatch, Factorisation, "factor", clock, 100.0)
    constraints = working(monkeypatch, Problem, "constrain", clock, 1000.0)
    with timed(comm, clock) as watch:
        _, steps = pulled()
    times = watch.times()
    assert len(factors) == sum(step.factorisations for step in steps) + 1  # and one at rest
    assert times.assembly == len(forces) + 10.0 * len(evaluations)
    assert times.factorisation == 100.0 * len(factors)
    assert times.rest == 1000.0 * len(constraints)
    assert times.total == times.assembly + times.factorisation + times.rest == clock.now


def test_triangular_solves_of_snes_are_booked(comm):
    """A clock that ticks at each look: each section it opens and closes takes one tick more."""

    class Ticks(Counter):
        def __call__(self):
            self.now += 1.0
            return self.now

    with timed(comm, Ticks()) as watch:
        _, steps = pulled()
    iterations = sum(step.iterations for step in steps)  # each one triangular solve
    factorisations = sum(step.factorisations for step in steps) + 1
    assert watch.spent["factorisation"] == factorisations + iterations


def test_timing_changes_no_result_and_leaves_nothing_behind(comm):
    before = {pair: vars(pair[0])[pair[1]] for pairs in SECTIONS.values() for pair in pairs}
    plain, steps = pulled()
    with timed(comm) as watch:
        model, others = pulled()
    assert np.allclose(plain.x.array_r, model.x.array_r, rtol=0, atol=1e-9)  # MUMPS on two ranks
    assert [s.iterations for s in steps] == [s.iterations for s in others]
    assert {pair: vars(pair[0])[pair[1]] for pair in before} == before
    times = watch.times()
    assert 0 < times.assembly and 0 < times.factorisation and 0 < times.rest
    assert times in comm.allgather(times) and len(set(comm.allgather(times))) == 1


def test_an_error_in_the_block_restores_the_functions(comm):
    original = vars(Problem)["forces"]
    with pytest.raises(ZeroDivisionError), timed(comm):
        assert vars(Problem)["forces"] is not original
        _ = 1 / 0
    assert vars(Problem)["forces"] is original
