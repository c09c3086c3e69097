"""Other branches of a path: eigenvectors, switching at bifurcations, energy between two states."""

from collections.abc import Sequence
from typing import Any

from petsc4py import PETSc

import numpy as np

from ufl_origami.errors import InputError, SolveError
from ufl_origami.model import Model
from ufl_origami.path_stops import PathStop
from ufl_origami.paths import PathResult, follow_path
from ufl_origami.solvers.arc import Event, Metric
from ufl_origami.solvers.bordered import Bordered, LoadFactor
from ufl_origami.solvers.newton import NewtonSettings, NewtonSolver
from ufl_origami.solvers.stability import ZERO, Mode, lowest_modes

HALVINGS = 6
"""Tries of `switch_branch`, each half as far from the bifurcation as the one before."""


def stability(model: Model) -> int | None:
    """Number of directions in which a model's equilibrium is unstable; collective.

    That is the number of negative pivots of its constrained tangent: at constant load factor and
    prescribed motion. None where the tangent is not symmetric.
    """
    with _solver(model) as bordered:
        return bordered.factor(model.x)


def verdict(model: Model) -> str:
    """Whether a model's equilibrium is "stable", "neutral", "unstable" or "unknown"; collective.

    Neutral: the lowest eigenvalue is zero but for round-off, as at a limit point, a bifurcation, or
    where a free hinge lets a panel turn. The pivots alone count such a direction as unstable or
    not by chance; here the eigenvalues nearest to zero are looked at.

    Raises:
        SolveError: SLEPc did not converge.
    """
    pivots = stability(model)
    if pivots is None:
        return "unknown"
    lowest = lowest_modes(model.problem, model.x, model.problem.time, pivots + 2, pivots)
    zero = ZERO * max(abs(mode.value) for mode in lowest)
    if lowest[0].value < -zero:
        return "unstable"
    return "neutral" if lowest[0].value <= zero else "stable"


def modes(model: Model, count: int = 1) -> list[Mode]:
    """Lowest eigenpairs of a model's constrained tangent, in ascending order; collective.

    Args:
        model: the model in an equilibrium.
        count: number of eigenpairs.

    Raises:
        SolveError: the tangent is not symmetric, or SLEPc found too few.
    """
    pivots = stability(model) or 0
    return lowest_modes(model.problem, model.x, model.problem.time, count, pivots)


class _solver:
    """Context of a bordered solver for the load factor of a model in its state."""

    def __init__(self, model: Model, newton: NewtonSettings | None = None):
        self.model, self.newton = model, NewtonSolver(model.problem, newton)

    def __enter__(self) -> Bordered:
        problem = self.model.problem
        problem.set_time(problem.time)
        problem.forces(self.model.x, self.model.x.duplicate())
        return Bordered(self.newton, LoadFactor(problem))

    def __exit__(self, *_: object) -> None:
        self.newton.close()


def restore(model: Model, event: Event) -> None:
    """Put a model into the state of a limit point or bifurcation; collective.

    Raises:
        InputError: a resumed run has forgotten the state.
    """
    if event.x is None:
        raise InputError(f"the state of the {event.kind} at {event.load:g} was not kept: resumed")
    event.x.copy(model.x)
    model.problem.recall(event.memory)
    model.problem.set_time(event.load)
    model.problem.accept(model.x)


def switch_branch(
    model: Model,
    event: Event,
    *,
    side: int = 1,
    size: float | None = None,
    newton: NewtonSettings | None = None,
) -> PETSc.Vec:
    """Put a model onto the branch that crosses its path at a bifurcation; collective.

    The state sought has a given component along the critical eigenvector; the load factor is free.

    Args:
        model: the model that found the bifurcation.
        event: the bifurcation.
        side: 1 or -1: direction along the eigenvector.
        size: root of the mean square of the displacements along it; default the thickness.
        newton: tolerances of the solve.

    Returns:
        The way from the bifurcation, a direction for `follow_path`.

    Raises:
        InputError: no eigenvector, a side that is neither 1 nor -1, a size that is not positive.
        SolveError: no state was found there.
    """
    if event.mode is None:
        raise InputError(f"the {event.kind} at {event.load:g} has no eigenvector to leave along")
    if side not in (1, -1):
        raise InputError(f"side {side} is neither 1 nor -1")
    if size is not None and not 0 < size < np.inf:
        raise InputError(f"size {size} of the way to the branch is not positive")
    restore(model, event)
    metric = Metric(model.problem)
    thickness = max(model.scene.panel_material(name).h for name in model.sheet.panel_names)
    length = (thickness if size is None else size) / metric.diagonal
    with _solver(model, newton) as bordered:
        reason = ""
        for _ in range(HALVINGS):
            guess = model.x.copy()
            guess.axpy(side * length, event.mode)
            report = bordered.solve(guess, event.load, metric.row(event.mode), model.x)
            if report.converged:
                way = guess.copy()
                way.axpy(-1.0, model.x)
                guess.copy(model.x)
                model.problem.set_time(report.value)
                model.problem.accept(model.x)
                return way
            reason, length = report.reason, 0.5 * length
    restore(model, event)
    raise SolveError(f"no state beside the bifurcation: {reason}", event.load)


def follow_branch(
    model: Model,
    event: Event,
    stops: Sequence[PathStop | float],
    *,
    side: int = 1,
    size: float | None = None,
    **options: Any,
) -> PathResult:
    """Follow the branch that crosses a path at a bifurcation; collective.

    Args:
        model: see `switch_branch`.
        event: likewise.
        side: likewise.
        size: likewise.
        stops: see `follow_path`.
        options: further arguments of `follow_path`.

    Raises:
        InputError, SolveError: see `switch_branch` and `follow_path`.
    """
    way = switch_branch(model, event, side=side, size=size, newton=options.get("newton"))
    return follow_path(model, stops, towards=way, **options)
