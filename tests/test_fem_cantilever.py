"""Cantilevers of the fem model against the exact elastica and circle, thick and thin."""

from pathlib import Path

import numpy as np
import pytest

from ufl_origami.analytic.reference_tables import read_table
from ufl_origami.gallery.shell_problems import Form, cantilever_moment, cantilever_shear
from ufl_origami.solvers.static import StepSettings

REFERENCE = Path(__file__).parent / "reference"
STOPS = (0.25, 0.5, 0.75, 1.0)
STRUCTURES = ("structured", "unstructured", "crisscross")
THIN = 1e-3  # the extension, which the elastica lacks, stays below the errors


def fem(structure):
    return Form(structure, model="fem")


def largest_error(problem, stops=STOPS):
    """Largest relative error of a column at the stops."""
    errors = problem.exact_errors(problem.solve(stops).history, stops)
    return max(np.abs(e).max() for e in errors.values())


@pytest.mark.parametrize("structure", STRUCTURES)
def test_end_shear_gives_the_elastica(structure):
    assert largest_error(cantilever_shear(2, fem(structure))) < 0.005


@pytest.mark.parametrize("structure", STRUCTURES)
def test_end_moment_rolls_the_strip_up_to_a_full_circle(structure):
    assert largest_error(cantilever_moment(2, fem(structure))) < 0.005


def test_end_shear_agrees_with_the_table_of_sze():
    problem = cantilever_shear(2, fem("structured"))
    table = read_table(REFERENCE / "sze2004_cantilever_end_shear.csv")
    errors = problem.table_errors(problem.solve(STOPS).history, table, STOPS)
    assert max(np.abs(e).max() for e in errors.values()) < 0.005


@pytest.mark.convergence
@pytest.mark.parametrize(
    "make", [cantilever_shear, pytest.param(cantilever_moment, marks=pytest.mark.slow)]
)
def test_one_diagonal_converges_with_order_two_or_better(make):
    counts = (1, 2, 4)
    errors = [largest_error(make(n, fem("structured"), slenderness=THIN)) for n in counts]
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order > 1.9, errors


@pytest.mark.slow
@pytest.mark.convergence
@pytest.mark.parametrize("make", [cantilever_shear, cantilever_moment])
def test_unstructured_meshes_converge_with_order_two_or_better(make):
    counts = (1, 2, 4)
    errors = [largest_error(make(n, fem("unstructured"), slenderness=THIN)) for n in counts]
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order > 1.9, errors


@pytest.mark.parametrize("structure", ["structured", "unstructured"])
def test_a_strip_of_a_ten_thousandth_of_its_length_does_not_lock(structure):
    """The same coarse mesh gives the same deflection from h / L = 1e-2 to 1e-4."""
    errors = [
        largest_error(cantilever_shear(2, fem(structure), slenderness=slenderness), (0.5, 1.0))
        for slenderness in (1e-2, 1e-3, 1e-4)
    ]
    assert max(errors) < 5e-4, errors


@pytest.mark.slow
@pytest.mark.parametrize("structure", ["structured", "unstructured"])
def test_a_strip_of_a_ten_thousandth_of_its_length_rolls_up_to_a_full_circle(structure):
    """In steps of an eighth of a turn: quarters may end in another stable state, with a dimple."""
    problem = cantilever_moment(2, fem(structure), slenderness=1e-4)
    result = problem.solve(STOPS, StepSettings(largest=0.125))
    errors = problem.exact_errors(result.history, STOPS)
    assert max(np.abs(e).max() for e in errors.values()) < 5e-4
    assert result.history["energy_membrane"][-1] < 1e-6 * result.history["energy_bending"][-1]
