"""Lowest eigenpairs of a constrained tangent, by SLEPc.

K phi = mu W phi with mass-like weights W: lumped rest area at displacements, area squared at
angles. The signs of mu do not depend on W (Sylvester), so that as many are negative as the
factorisation has negative pivots.
"""

from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from slepc4py import SLEPc

from ufl_origami.errors import SolveError
from ufl_origami.problem import Problem
from ufl_origami.solvers.linear import linear_options
from ufl_origami.solvers.newton import NewtonSolver
from ufl_origami.solvers.options import option_scope
from ufl_origami.solvers.weights import shift_weights

PREFIX = "ufl_origami_modes_"

TOLERANCE = 1e-10
"""Relative error of an eigenvalue."""


BESIDE = 1e-13
"""Distance of the shift from zero over the largest ratio of diagonal to weight.

At zero itself a singular tangent could not be factored.
"""

SINGULAR = 1e-13
"""Eigenvalue over the largest ratio of tangent diagonal to weight, below which it is round-off."""

ZERO = 1e-9
"""Eigenvalue over the largest of those found, below which its sign may be round-off."""


@dataclass(frozen=True)
class Mode:
    """An eigenpair.

    Attributes:
        value: eigenvalue: energy per area and displacement squared, twice the second variation.
        vector: eigenvector with phi . W phi = 1; prescribed unknowns are zero.
    """

    value: float
    vector: PETSc.Vec


def nearest_modes(problem: Problem, x: PETSc.Vec, load: float, count: int) -> list[Mode]:
    """Eigenpairs nearest to zero, in ascending order.

    Args:
        problem: terms and constraints.
        x: an equilibrium.
        load: its load factor.
        count: number of eigenpairs.

    Raises:
        SolveError: the tangent is not symmetric, or SLEPc did not converge.
    """
    if not problem.symmetric:
        raise SolveError("eigenvectors need a symmetric tangent: no friction or follower loads")
    problem.set_time(load)
    problem.linearise(None, x)
    matrix = problem.stiffness(x)
    problem.constrain(matrix, None, None)
    diagonal, ratio = shift_weights(problem), matrix.getDiagonal()
    weights = PETSc.Mat().createAIJ(matrix.getSizes(), nnz=1, comm=matrix.comm)
    weights.setDiagonal(diagonal)
    weights.assemble()
    solver = SLEPc.EPS().create(matrix.comm)
    try:
        ratio.pointwiseDivide(ratio, diagonal)
        free = np.isfinite(ratio.array_r)
        largest = problem.configuration.comm.allreduce(
            ratio.array_r[free].max(initial=0.0), MPI.MAX
        )
        count = min(count, problem.configuration.size_global)
        return _solve(solver, matrix, weights, count, -BESIDE * largest)
    finally:
        solver.destroy()
        weights.destroy()


def _solve(
    solver: SLEPc.EPS, matrix: PETSc.Mat, weights: PETSc.Mat, count: int, target: float
) -> list[Mode]:
    """Shift-and-invert just below zero; prescribed unknowns have infinite eigenvalues."""
    solver.setOptionsPrefix(PREFIX)
    solver.setOperators(matrix, weights)
    solver.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    solver.setDimensions(count)
    solver.setTarget(target)
    solver.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    solver.setTolerances(TOLERANCE, 200)
    transform = solver.getST()
    transform.setType(SLEPc.ST.Type.SINVERT)
    linear = linear_options(symmetric=True) | {"mat_mumps_icntl_13": 1, "mat_mumps_icntl_24": 1}
    options = {f"st_{name}": value for name, value in linear.items()}
    with option_scope(PREFIX, options):
        solver.setFromOptions()
        solver.solve()
    if solver.getConverged() < count:
        raise SolveError(f"SLEPc found {solver.getConverged()} of {count} eigenpairs")
    modes = []
    for index in range(count):
        vector = matrix.createVecRight()
        value = solver.getEigenpair(index, vector).real
        modes.append(Mode(float(value), vector))
    return sorted(modes, key=lambda mode: mode.value)


def lowest_modes(
    problem: Problem, x: PETSc.Vec, load: float, count: int, pivots: int
) -> list[Mode]:
    """The lowest eigenpairs, in ascending order.

    Args:
        problem: terms and constraints.
        x: an equilibrium.
        load: its load factor.
        count: number of eigenpairs.
        pivots: negative ones among all, as the factorisation counted them.

    Raises:
        SolveError: SLEPc does not find all negative ones.
    """
    many = pivots + count
    for _ in range(4):
        modes = nearest_modes(problem, x, load, many)
        zero = ZERO * max(abs(mode.value) for mode in modes)
        found = sum(mode.value < zero for mode in modes)
        if found >= pivots:
            return modes[:count]
        many *= 2
    raise SolveError(f"SLEPc finds {found} of {pivots} negative eigenvalues")


def crossing_mode(problem: Problem, x: PETSc.Vec, load: float, level: int, pivots: int) -> Mode:
    """The eigenpair that has `level` others below it, near the state where it is zero.

    Where the sign of one that is zero but for round-off contradicts the pivots, it is that one.

    Args:
        problem: terms and constraints.
        x: an equilibrium.
        load: its load factor.
        level: number of lower eigenvalues.
        pivots: number of negative ones.
    """
    modes = nearest_modes(problem, x, load, 2 + abs(pivots - level))
    negative = [mode for mode in modes if mode.value < 0]
    positive = [mode for mode in modes if mode.value >= 0]
    side, place = (negative, level - pivots) if pivots > level else (positive, level - pivots)
    if -len(side) <= place < len(side):
        return side[place]
    return min(modes, key=lambda mode: abs(mode.value))  # zero but for round-off


def singular(newton: NewtonSolver) -> bool:
    """Whether the tangent last factored has an eigenvalue that is zero but for round-off.

    By the factorisation's own count, or by two steps of inverse iteration.
    """
    if newton.linear.zero_pivots:
        return True
    weights, matrix = newton.shift_weights, newton.problem.tangent.matrix
    ratio = matrix.getDiagonal()
    ratio.pointwiseDivide(ratio, weights)
    first, second, load = weights.duplicate(), weights.duplicate(), weights.copy()
    first_entry = weights.getOwnershipRange()[0]
    load.array_w[:] *= np.cos(first_entry + np.arange(len(load.array_r)))
    newton.linear.solve(load, first)
    load.pointwiseMult(weights, first)
    newton.linear.solve(load, second)
    square = second.copy()
    square.pointwiseMult(weights, second)
    nearest = abs(second.dot(load) / square.dot(second))
    return bool(nearest <= SINGULAR * ratio.norm(PETSc.NormType.INFINITY))
