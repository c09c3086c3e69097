"""Newton on thin shells: the whole load in one step, and plain Newton's quadratic convergence."""

import numpy as np
import pytest

from ufl_origami.discretise import build
from ufl_origami.gallery.shell_problems import Form, cantilever_shear
from ufl_origami.solvers.newton import NewtonSettings, NewtonSolver
from ufl_origami.solvers.static import StaticPath, StepSettings

ONE_STEP = StepSettings(first=1.0)


@pytest.mark.mpi
@pytest.mark.parametrize("slenderness", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("structure", ["structured", "unstructured"])
@pytest.mark.parametrize("bending", ["director", "averaged"])
@pytest.mark.filterwarnings("ignore::ufl_origami.errors.MeshWarning")
def test_the_whole_load_of_the_cantilever_in_one_step(slenderness, structure, bending):
    """P L^2 / EI = 4; a line search needs 45 to 10,800 iterations for the same."""
    problem = cantilever_shear(4, Form(structure, bending), slenderness=slenderness)
    (step,) = problem.solve(steps=ONE_STEP).steps
    assert step.iterations <= 10
    assert step.cuts == 0
    assert step.stability == "stable"


def residuals(method, slenderness):
    """Residual norms of one solve of the cantilever's whole load, down to round-off."""
    model = build(cantilever_shear(2, slenderness=slenderness).scene)
    solver = NewtonSolver(model.problem, NewtonSettings(method=method, rtol=0.0))
    reports, solve = [], solver.solve
    solver.solve = lambda *args, **kw: reports.append(solve(*args, **kw)) or reports[-1]
    StaticPath(model.problem, solver, ONE_STEP).run(model.x, 0.0, [1.0])
    return np.array(reports[0].residuals)


@pytest.mark.mpi
def test_plain_newton_converges_quadratically():
    """The last residuals above round-off are C times the square of the one before."""
    r = residuals("newton", 0.1)
    r = r[r > 1e-8][-3:]
    order = np.log(r[2] / r[1]) / np.log(r[1] / r[0])
    assert order == pytest.approx(2.0, abs=0.1), r
    factor = r[1:] / r[:-1] ** 2
    assert factor[1] == pytest.approx(factor[0], rel=0.5), r


@pytest.mark.mpi
def test_extrapolated_stress_saves_half_of_the_iterations_of_plain_newton():
    """The thinner, the more: same equilibrium, 6 iterations against 16 at h / L = 1e-2."""
    assert 2 * len(residuals("default", 1e-2)) < len(residuals("newton", 1e-2))
