"""Critical loads of columns, a crease column, plates and a blade, by the first change of inertia.

Load factor 1 is the exact critical load of each scene.
"""

import pytest

import ufl_origami as uo
from ufl_origami.gallery import critical_loads as problems
from ufl_origami.gallery.critical_loads import Choice

ETA = [1e-3, 1e-2, 0.1, 1.0, 10.0]


def assert_critical(problem, tolerance=0.01):
    """The first bifurcation is at 1, and it is the first loss of stability."""
    found, path = problem.solve()
    assert found.load == pytest.approx(1.0, abs=tolerance)
    assert (found.before, found.after) == (0, 1)
    assert not path.limit_points
    return found, path


@pytest.mark.parametrize("ends", problems.EULER)
@pytest.mark.parametrize(("model", "n"), [("ddg", 2), ("fem", 1)])
def test_euler_column(ends, model, n):
    assert_critical(problems.column(ends, Choice(model, n)))


@pytest.mark.parametrize("eta", ETA)
@pytest.mark.parametrize(("model", "n"), [("ddg", 8), ("fem", 2)])
def test_crease_column(eta, model, n):
    """k W tan(k W) = 24 eta, in the mode that folds in the middle."""
    found, path = assert_critical(problems.crease_column(eta, Choice(model, n)), 0.003)
    uo.restore(path.model, found)
    path.model.x.axpy(0.01, found.mode)
    assert abs(path.model.mean_fold_angle("crease")) > 1e-4


@pytest.mark.parametrize(("load", "edges"), problems.PLATES)
def test_plate(load, edges):
    assert_critical(problems.plate(load, edges, Choice("fem", 8)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("load", "edges", "n"),
    [
        ("pressed", "hinged", 20),
        ("pressed", "clamped", 40),
        ("sheared", "hinged", 36),
        ("sheared", "clamped", 48),
    ],
)
def test_plate_of_discrete_shell(load, edges, n):
    assert_critical(problems.plate(load, edges, Choice("ddg", n)))


def test_discrete_plate_gains_with_the_square_of_the_mesh():
    errors = [
        1 - problems.plate("pressed", "hinged", Choice("ddg", n)).solve()[0].load for n in (8, 16)
    ]
    assert errors[0] < 0.05
    assert 3 < errors[0] / errors[1] < 5


@pytest.mark.parametrize(("model", "n"), [("ddg", 2), ("fem", 1)])
def test_blade(model, n):
    assert_critical(problems.blade(Choice(model, n)))


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("make", "load", "count"),
    [
        (lambda: problems.column("hinged", Choice("ddg", 2)), 10.0, 3),
        (lambda: problems.crease_column(0.1, Choice("ddg", 8)), 5.0, 1),
        (lambda: problems.plate("pressed", "hinged", Choice("fem", 6)), 3.0, 3),
    ],
)
def test_pivots_are_as_many_as_negative_eigenvalues(make, load, count):
    """The columns have passed 1, 4, 9 and 1; the plate (m + 1/m)^2 / 4 for m = 1, 2, 3."""
    arc = uo.ArcSettings(first=2.0, locate=False)
    path = uo.follow_path(make().scene, [load], arc=arc)
    pivots = uo.stability(path.model)
    assert pivots == count == path.history["negative_pivots"][-1]
    values = [mode.value for mode in uo.modes(path.model, count + 2)]
    assert values == sorted(values)
    assert sum(value < 0 for value in values) == count


@pytest.mark.parametrize(
    "make",
    [
        lambda choice: problems.column("free", choice),
        lambda choice: problems.plate("pressed", "free", choice),
    ],
)
def test_unknown_problems_are_refused(make):
    with pytest.raises(uo.InputError, match=r"'free'.* is none of"):
        make(Choice("ddg", 2))


def test_a_problem_that_does_not_buckle_says_so():
    problem = problems.column("hinged", Choice("ddg", 1))
    with pytest.raises(uo.SolveError, match="column, hinged: no bifurcation"):
        problem.solve(0.5)
