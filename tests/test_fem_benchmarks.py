"""Published shell benchmarks of the fem model against Kirchhoff-Love tables."""

from pathlib import Path

import numpy as np
import pytest

from ufl_origami.analytic.reference_tables import read_table
from ufl_origami.gallery.shell_problems import (
    Form,
    cylinder_pullout,
    pinched_hemisphere,
    slit_annular_plate,
)

REFERENCE = Path(__file__).parent / "reference"
STOPS = (0.25, 0.5, 0.75, 1.0)
EVEN = ("structured", "unstructured")


def solve(make, n, structure, stops=STOPS):
    """Steps and largest error (by column) against the Kirchhoff-Love table."""
    problem = make(n, Form(structure, model="fem"))
    result = problem.solve(stops)
    table = read_table(REFERENCE / f"kirchhoff_love_{problem.name}.csv")
    errors = problem.table_errors(result.history, table, stops)
    return result.steps, {name: float(np.abs(e).max()) for name, e in errors.items()}


def assert_followed(steps):
    """Default settings get through without a cut and without an unstable state."""
    assert [step.stability for step in steps] == ["stable"] * len(steps)
    assert sum(step.cuts for step in steps) == 0


def test_coarse_annulus():
    steps, errors = solve(slit_annular_plate, 4, "unstructured")
    assert_followed(steps)
    assert max(errors.values()) < 0.01


@pytest.mark.mpi
def test_coarse_hemisphere():
    steps, errors = solve(pinched_hemisphere, 12, "unstructured")
    assert_followed(steps)
    assert max(errors.values()) < 0.01


def test_coarse_cylinder_snaps_through():
    """All columns agree with the table but for W_A, which has no limit: see below."""
    steps, errors = solve(cylinder_pullout, 12, "unstructured")
    assert_followed(steps)
    assert max(errors["minus_U_B"], errors["minus_U_C"]) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("structure", EVEN)
def test_annulus(structure):
    steps, errors = solve(slit_annular_plate, 8, structure)
    assert_followed(steps)
    assert max(errors.values()) < 0.002


@pytest.mark.slow
@pytest.mark.parametrize("structure", EVEN)
def test_hemisphere(structure):
    """Both kinds of mesh tend to 0.3 % above the table at full load, and to its values at half.

    The table's own check (in its head) moves by 1.8 % at full load between its last two meshes.
    """
    steps, errors = solve(pinched_hemisphere, 32, structure)
    assert_followed(steps)
    assert max(errors.values()) < 0.005


@pytest.mark.slow
@pytest.mark.parametrize("structure", EVEN)
def test_cylinder(structure):
    """Away from the point load; under it no mesh-independent value exists (test_shell_benchmarks).

    There the displacement grows with the logarithm of the element, and the table's splines, with
    elements of four times h, give up to 0.6 % less than graded ones.
    """
    steps, errors = solve(cylinder_pullout, 24, structure)
    assert_followed(steps)
    assert max(errors["minus_U_B"], errors["minus_U_C"]) < 0.005
    assert errors["W_A"] < 0.015


@pytest.mark.slow
@pytest.mark.convergence
@pytest.mark.parametrize(
    ("make", "counts", "left_out", "stops"),
    [
        (slit_annular_plate, (2, 4, 8), (), STOPS),
        (pinched_hemisphere, (8, 16, 32), (), STOPS[:2]),
        (cylinder_pullout, (6, 12, 24), ("W_A",), STOPS),
    ],
)
def test_benchmarks_converge_with_order_two_or_better(make, counts, left_out, stops):
    """Against what is exact in the tables: see the tests before."""
    errors = []
    for n in counts:
        found = solve(make, n, "structured", stops)[1]
        errors.append(max(error for name, error in found.items() if name not in left_out))
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order > 1.9, errors
