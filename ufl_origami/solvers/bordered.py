"""Newton on an equilibrium and one parameter more, held by one linear equation.

The unknowns (x, p) solve R(x, p) = 0 and row . (x - x0) = 0. Each iteration factors the tangent
once and solves twice (block elimination); it may be singular in one direction that the row holds,
so that limit points are passed. Prescribed unknowns follow the parameter through the tangent's
columns. PETSc's own continuation, SNESNEWTONAL, keeps to loads, ends at load factor 1 without its
states in between, and petsc4py has no access to its settings.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

from petsc4py import PETSc

import numpy as np

from ufl_origami.problem import Problem
from ufl_origami.solvers.newton import NewtonSolver

DIFFERENCE = 1e-5
"""Step of the central difference by the load factor: loads are functions without derivative."""


class Parameter(ABC):
    """What an equilibrium depends on beside its unknowns.

    Args:
        problem: terms and constraints.
    """

    def __init__(self, problem: Problem):
        self.problem = problem

    @abstractmethod
    def set(self, value: float) -> None:
        """Give the parameter a value."""

    @abstractmethod
    def residual(self, x: PETSc.Vec, out: PETSc.Vec) -> None:
        """Residual at the value set, prescribed unknowns less their values included."""

    @abstractmethod
    def column(self, x: PETSc.Vec, out: PETSc.Vec) -> None:
        """Derivative of the residual by the parameter at the value set."""


class LoadFactor(Parameter):
    """The load factor: loads, rest angles, obstacles and prescribed motion follow it."""

    def set(self, value: float) -> None:
        """Set all that follows the load factor."""
        self.problem.set_time(value)

    def residual(self, x: PETSc.Vec, out: PETSc.Vec) -> None:
        """The problem's own residual."""
        self.problem.residual(x, out)

    def column(self, x: PETSc.Vec, out: PETSc.Vec) -> None:
        """Central difference, exact for what is linear or quadratic in the load factor."""
        problem, value, other = self.problem, self.problem.time, out.duplicate()
        scale, width = problem.force_scale, DIFFERENCE * max(1.0, abs(value))
        problem.set_time(value + width)
        problem.residual(x, out)
        problem.set_time(value - width)
        problem.residual(x, other)
        problem.set_time(value)
        problem.force_scale = scale
        out.axpy(-1.0, other)
        out.scale(0.5 / width)


class Multiplier(Parameter):
    """Factor of one fixed generalised force, at a constant load factor.

    Args:
        problem: terms and constraints.
        force: the force; its entries at prescribed unknowns are zero.
    """

    def __init__(self, problem: Problem, force: PETSc.Vec):
        super().__init__(problem)
        self.force, self.value = force, 0.0

    def set(self, value: float) -> None:
        """Set the factor."""
        self.value = value

    def residual(self, x: PETSc.Vec, out: PETSc.Vec) -> None:
        """The problem's residual less the force."""
        self.problem.residual(x, out)
        out.axpy(-self.value, self.force)

    def column(self, x: PETSc.Vec, out: PETSc.Vec) -> None:
        """Minus the force."""
        self.force.copy(out)
        out.scale(-1.0)


@dataclass
class BorderedReport:
    """What one bordered solve did.

    Attributes:
        value: the parameter found.
        converged: whether the tolerance was met.
        reason: why it was not.
        iterations: tangents factored.
        residuals: residual norm before each iteration.
    """

    value: float
    converged: bool = False
    reason: str = ""
    iterations: int = 0
    residuals: list[float] = field(default_factory=list)


class Bordered:
    """Newton solver of the bordered system.

    Args:
        newton: its linear solver, tolerances and kind of tangent are used; it never shifts.
        parameter: what is sought with the unknowns.
    """

    def __init__(self, newton: NewtonSolver, parameter: Parameter):
        self.newton, self.parameter, self.problem = newton, parameter, newton.problem
        create = self.problem.configuration.create_vector
        self._residual, self._column, self._known, self._product = (create() for _ in range(4))

    def factor(self, x: PETSc.Vec, previous: PETSc.Vec | None = None) -> int | None:
        """Factor the tangent at x, and make ready for `solve_column`; its negative pivots.

        Args:
            x: unknowns.
            previous: iterate before, from which the stress is extrapolated; None: exact Hessian.
        """
        problem = self.problem
        problem.linearise(previous if self.newton.extrapolates else None, x)
        matrix = problem.stiffness(x)
        if previous is None:
            self.newton.set_floor(x)
        self.parameter.column(x, self._column)
        self._move_known(matrix, self._column)
        self.parameter.residual(x, self._residual)
        self._move_known(matrix, self._residual)
        problem.constrain(matrix, None, None)
        return self.newton.factor(self.newton.linear.ksp, shift=False)

    def _move_known(self, matrix: PETSc.Mat, vector: PETSc.Vec) -> None:
        """Move what prescribed unknowns are known to do into the other rows of a right-hand side.

        The solution of K y = -vector has y = -vector in the prescribed rows.
        """
        dofs = self.problem.constraints.dofs
        self._known.set(0.0)
        self._known.array_w[dofs] = vector.array_r[dofs]
        matrix.mult(self._known, self._product)
        self._product.array_w[dofs] = 0.0
        vector.axpy(-1.0, self._product)

    def solve_column(self, out: PETSc.Vec) -> None:
        """Change of the unknowns with the parameter, dx/dp, with the last factorisation."""
        self.newton.linear.solve(self._column, out)
        out.scale(-1.0)

    def _solve_residual(self, out: PETSc.Vec) -> None:
        self.newton.linear.solve(self._residual, out)
        out.scale(-1.0)

    def solve(
        self, x: PETSc.Vec, value: float, row: PETSc.Vec, previous: PETSc.Vec | None = None
    ) -> BorderedReport:
        """Seek x and the parameter from a guess, in place, with row . x as it is in the guess.

        Args:
            x: guess; the solution on return.
            value: guess of the parameter.
            row: coefficients of the unknowns.
            previous: accepted state from which the guess was made.

        Raises:
            SolveError: the factorisation ran out of memory.
        """
        before = x.copy() if previous is None else previous.copy()
        step, along, report = x.duplicate(), x.duplicate(), BorderedReport(value)
        residuals, settings = report.residuals, self.newton.settings
        self.parameter.set(value)
        for _ in range(settings.iterations + 1):
            self.parameter.residual(x, self._residual)
            residuals.append(self._residual.norm())
            if not np.isfinite(residuals[-1]):
                report.reason = "the residual is not finite"
                return report
            if residuals[-1] <= self.newton.tolerance():
                report.converged = True
                return report
            if report.iterations == settings.iterations:
                break
            self.factor(x, before)
            report.iterations += 1
            self._solve_residual(step)
            self.solve_column(along)
            change = -row.dot(step) / row.dot(along)
            step.axpy(change, along)
            x.copy(before)
            part = self._free_part(x, step, report.value, report.value + change)
            x.axpy(part, step)
            report.value += part * change
            self.parameter.set(report.value)
        report.reason = f"no convergence in {settings.iterations} iterations"
        return report

    def _free_part(self, x: PETSc.Vec, step: PETSc.Vec, old: float, new: float) -> float:
        """Part of an iteration's step that no barrier forbids."""
        if not self.problem.bounded:
            return 1.0
        since = self.problem.time
        self.parameter.set(new)
        part = self.problem.longest_step(x, step, since)
        self.parameter.set(old)
        return part
