"""Published shell benchmarks against Kirchhoff-Love tables and those of Sze, Liu & Lo (2004).

Coarse meshes in the fast suite; the finest ones, with the accuracy that is promised, are slow.
"""

import json
import os
import subprocess
import sys
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

pytestmark = pytest.mark.filterwarnings("ignore::ufl_origami.errors.MeshWarning")

REFERENCE = Path(__file__).parent / "reference"
STOPS = (0.25, 0.5, 0.75, 1.0)
STRUCTURES = ("structured", "unstructured", "crisscross")
EVEN = ("structured", "unstructured")


def solve(problem, stops=STOPS):
    """Steps and largest error (by column) against the Kirchhoff-Love and Sze's table."""
    result = problem.solve(stops)
    errors = []
    for kind in ("kirchhoff_love", "sze2004"):
        table = read_table(REFERENCE / f"{kind}_{problem.name}.csv")
        found = problem.table_errors(result.history, table, stops)
        errors.append({name: float(np.abs(e).max()) for name, e in found.items()})
    return result.steps, *errors


def assert_stable(steps, cuts=2):
    """Default settings get through with few cuts and without an unstable state."""
    assert [step.stability for step in steps] == ["stable"] * len(steps)
    assert sum(step.cuts for step in steps) <= cuts


@pytest.mark.parametrize("structure", STRUCTURES)
def test_coarse_annulus(structure):
    steps, exact, _ = solve(slit_annular_plate(4, Form(structure)))
    assert_stable(steps)
    assert max(exact.values()) < 0.02


@pytest.mark.mpi
@pytest.mark.parametrize("structure", STRUCTURES)
def test_coarse_hemisphere(structure):
    steps, exact, _ = solve(pinched_hemisphere(16, Form(structure)))
    assert_stable(steps)
    assert max(exact.values()) < 0.025


@pytest.mark.filterwarnings("ignore::ufl_origami.errors.BranchWarning")
@pytest.mark.parametrize("structure", STRUCTURES)
def test_coarse_cylinder_snaps_through(structure):
    """The free end's flattening snaps back near half the load."""
    n = 20 if structure == "crisscross" else 24  # twice as many triangles for each
    steps, exact, _ = solve(cylinder_pullout(n, Form(structure)))
    assert_stable(steps, cuts=20)  # those of the snap, of which a warning tells
    assert max(exact.values()) < 0.02


@pytest.mark.parametrize(
    ("structure", "low", "high"), [("structured", 0.02, 0.04), ("crisscross", 0.3, 0.4)]
)
def test_averaged_normals_on_the_hemisphere(structure, low, high):
    """Off by 3 % where they are consistent, by a third where they are not."""
    _, exact, _ = solve(pinched_hemisphere(32, Form(structure, "averaged")))
    assert low < max(exact.values()) < high


@pytest.mark.serial
def test_the_command_prints_and_writes_what_it_found(tmp_path):
    script = Path(__file__).parents[1] / "benchmarks" / "shell_benchmarks.py"
    file = tmp_path / "table.json"
    choice = "--problem hemisphere_18deg_hole --mesh unstructured --method director --n 16"
    done = subprocess.run(
        [sys.executable, str(script), *choice.split(), "--output", str(file)],
        capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(script.parents[1])},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (row,) = json.loads(file.read_text())["rows"]
    _, exact, published = solve(pinched_hemisphere(16, Form("unstructured")))
    for kind, expected in (("kirchhoff_love", exact), ("sze", published)):
        found = {name: max(map(abs, e)) / 100 for name, e in row["errors"][kind].items()}
        assert found == pytest.approx(expected, rel=1e-6)
        assert f"{100 * max(expected.values()):.3f}" in done.stdout
    assert len(done.stdout.splitlines()) == 2


@pytest.mark.slow
@pytest.mark.parametrize("structure", STRUCTURES)
def test_annulus(structure):
    steps, exact, published = solve(slit_annular_plate(24, Form(structure)))
    assert_stable(steps)
    assert max(exact.values()) < 0.005
    assert max(published.values()) < 0.01


@pytest.mark.slow
@pytest.mark.convergence
@pytest.mark.parametrize("structure", EVEN)
def test_annulus_converges_with_the_measured_order(structure):
    """Second order in the end, less while the constant-strain membrane locks."""
    counts = (8, 16, 24)
    errors = [max(solve(slit_annular_plate(n, Form(structure)))[1].values()) for n in counts]
    first, last = -np.diff(np.log(errors)) / np.diff(np.log(counts))
    assert 1.2 < first < last < 2.3, errors


@pytest.mark.slow
@pytest.mark.parametrize("structure", STRUCTURES)
def test_hemisphere(structure):
    steps, exact, published = solve(pinched_hemisphere(64, Form(structure)))
    assert_stable(steps)
    assert max(exact.values()) < 0.005
    assert max(published.values()) < 0.025


@pytest.mark.slow
@pytest.mark.parametrize("structure", STRUCTURES)
def test_cylinder(structure):
    """Away from the point load the tables agree; under it no mesh-independent value exists.

    Where the sheet slopes, the point force pulls in its plane, and the displacement under it grows
    with the logarithm of the element there: at the four loads the table's splines (elements four
    times h) give W_A 0.13, 0.27, 0.45 and 0.6 % less than splines graded down to h / 2, with U_B
    and U_C the same to 0.1 %. Ours lies 0.5 to 1.2 % above the table, below Sze's.
    """
    steps, exact, published = solve(cylinder_pullout(64, Form(structure)))
    assert_stable(steps)
    assert max(exact["minus_U_B"], exact["minus_U_C"]) < 0.005
    assert exact["W_A"] < 0.015
    assert max(published.values()) < 0.01
