"""Critical loads of columns, a crease column, plates and a blade, by the first change of inertia.

Load factor 1 is the exact critical load of each scene.
"""

import path_scenes as scenes
import pytest

import ufl_origami as uo

ETA = [1e-3, 1e-2, 0.1, 1.0, 10.0]


def assert_critical(scene, tolerance=0.01):
    """The first bifurcation is at 1, and it is the first loss of stability."""
    found, path = scenes.first_bifurcation(scene)
    assert found.load == pytest.approx(1.0, abs=tolerance)
    assert (found.before, found.after) == (0, 1)
    assert not path.limit_points
    return found, path


@pytest.mark.parametrize("ends", scenes.EULER)
@pytest.mark.parametrize(("model", "n"), [("ddg", (24, 2)), ("fem", (6, 1))])
def test_euler_column(ends, model, n):
    assert_critical(scenes.column(ends, model, n))


@pytest.mark.mpi
@pytest.mark.parametrize("eta", ETA)
@pytest.mark.parametrize(("model", "size"), [("ddg", 0.125), ("fem", 0.5)])
def test_crease_column(eta, model, size):
    """k W tan(k W) = 24 eta; the column folds in the middle, alike on both sides."""
    found, path = assert_critical(scenes.crease_column(eta, model, size))
    uo.restore(path.model, found)
    path.model.x.axpy(0.01, found.mode)
    assert abs(path.model.mean_fold_angle("crease")) > 1e-4


@pytest.mark.parametrize(("load", "edges"), scenes.PLATES)
def test_plate(load, edges):
    assert_critical(scenes.plate(load, edges, "fem", 8))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("load", "edges", "n"),
    [
        ("pressed", "hinged", 20),
        ("pressed", "clamped", 40),
        ("sheared", "hinged", 36),
        ("sheared", "clamped", 56),
    ],
)
def test_plate_of_discrete_shell(load, edges, n):
    assert_critical(scenes.plate(load, edges, "ddg", n))


def test_discrete_plate_gains_with_the_square_of_the_mesh():
    errors = [
        1 - scenes.first_bifurcation(scenes.plate("pressed", "hinged", "ddg", n))[0].load
        for n in (8, 16)
    ]
    assert errors[0] < 0.05
    assert 3 < errors[0] / errors[1] < 5


@pytest.mark.parametrize(("model", "n"), [("ddg", (80, 2)), ("fem", (20, 1))])
def test_blade(model, n):
    """F L^2 / sqrt(EI GJ) = 4.0126, and half a per cent more for the warping held at the clamp."""
    assert_critical(scenes.blade(model, n))


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("make", "load", "count"),
    [
        (lambda: scenes.column("hinged", "ddg"), 10.0, 3),
        (lambda: scenes.crease_column(0.1, "ddg"), 5.0, 1),
        (lambda: scenes.plate("pressed", "hinged", "fem", 6), 3.0, 3),
    ],
)
def test_pivots_are_as_many_as_negative_eigenvalues(make, load, count):
    """The columns have passed 1, 4, 9 and 1; the plate (m + 1/m)^2 / 4 for m = 1, 2, 3."""
    path = uo.follow_path(make(), [load], arc=uo.ArcSettings(first=2.0, locate=False))
    pivots = uo.stability(path.model)
    assert pivots == count == path.history["negative_pivots"][-1]
    values = [mode.value for mode in uo.modes(path.model, count + 2)]
    assert values == sorted(values)
    assert sum(value < 0 for value in values) == count
