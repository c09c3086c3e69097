"""Other branches of a path: eigenvectors, switching at bifurcations, energy between two states."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from petsc4py import PETSc

import numpy as np

from ufl_origami.errors import InputError, SolveError
from ufl_origami.model import Model
from ufl_origami.path_stops import PathStop
from ufl_origami.paths import PathResult, follow_path
from ufl_origami.solvers.arc import Event, Metric
from ufl_origami.solvers.bordered import Bordered, LoadFactor, Multiplier
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


@dataclass(frozen=True)
class Landscape:
    """Energy between two states at one load factor.

    Attributes:
        places: (n,) part of the way, from 0 to 1.
        energies: (n,) least potential energy at each.
        forces: (n,) generalised force that holds the sheet there, positive towards 1.
    """

    places: np.ndarray
    energies: np.ndarray
    forces: np.ndarray

    @property
    def barrier(self) -> float:
        """Height of the highest place above the start."""
        return float(self.energies.max() - self.energies[0])


def landscape(
    model: Model,
    start: PETSc.Vec,
    end: PETSc.Vec,
    count: int = 21,
    *,
    newton: NewtonSettings | None = None,
    on_state: Callable[[float, Model], None] | None = None,
) -> Landscape:
    """Potential energy on the way from one state to another at the model's load factor; collective.

    The displacements' component along the straight way (by nodal area) is prescribed step by step,
    all else is in equilibrium: where the force vanishes is an equilibrium, and between two stable
    ones the highest place is an upper bound of the lowest barrier.

    Args:
        model: the model; its state is the end's afterwards.
        start: unknowns of an equilibrium at the model's load factor, whose fold angles are within
            half a turn of the model's own.
        end: those of another one.
        count: number of places.
        newton: tolerances.
        on_state: called with each place and the model in its state.

    Raises:
        InputError: the states are one, or fewer than two places.
        SolveError: no equilibrium was found at a place.
    """
    metric, load = Metric(model.problem), model.problem.time
    way = end.copy()
    way.axpy(-1.0, start)
    length = metric.norm(way)
    if count < 2 or length == 0.0:
        raise InputError("a landscape needs two places and two different states")
    row = metric.row(way)
    row.array_w[model.problem.constraints.dofs] = 0.0
    row.scale(1.0 / row.dot(way))
    start.copy(model.x)
    places, energies, forces = np.linspace(0.0, 1.0, count), [], []
    solver = NewtonSolver(model.problem, newton)
    try:
        model.problem.set_time(load)
        model.problem.accept(model.x)
        model.problem.forces(model.x, model.x.duplicate())
        bordered, factor = Bordered(solver, Multiplier(model.problem, row)), 0.0
        for place in places:
            guess = model.x.copy()
            guess.axpy(place - row.dot(guess) + row.dot(start), way)
            report = bordered.solve(guess, factor, row, model.x)
            if not report.converged:
                raise SolveError(f"landscape at {place:g} of the way: {report.reason}", load)
            guess.copy(model.x)
            model.problem.accept(model.x)
            factor = report.value
            energies.append(model.problem.potential(model.x))
            forces.append(factor)
            if on_state:
                on_state(float(place), model)
    finally:
        solver.close()
    return Landscape(places, np.array(energies), np.array(forces))
