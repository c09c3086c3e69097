"""The energy between two equilibria at one load factor."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np

from ufl_origami.errors import InputError, SolveError
from ufl_origami.model import Model
from ufl_origami.solvers.admissible import Admissible
from ufl_origami.solvers.arc import Metric
from ufl_origami.solvers.bordered import Bordered, Multiplier
from ufl_origami.solvers.newton import NewtonSettings, NewtonSolver

SMALLEST = 1e-3
"""Step over the distance of two places, below which a way is given up."""


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
        SolveError: no admissible equilibrium was found at a place, in however small steps.
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
    with closing(NewtonSolver(model.problem, newton)) as solver:
        model.problem.set_time(load)
        model.problem.accept(model.x)
        model.problem.forces(model.x, model.x.duplicate())
        leader = _Leader(model, Bordered(solver, Multiplier(model.problem, row)), row, way)
        for place in places:
            leader.lead(float(place), SMALLEST / (count - 1))
            energies.append(model.problem.potential(model.x))
            forces.append(leader.force)
            if on_state:
                on_state(float(place), model)
    return Landscape(places, np.array(energies), np.array(forces))


class _Leader:
    """Leads a model along a way.

    Args:
        model: the model at the start of the way.
        bordered: solver for the force along the way.
        row: coefficients of the place on the way.
        way: direction, one unit of place long.
    """

    def __init__(self, model: Model, bordered: Bordered, row: PETSc.Vec, way: PETSc.Vec):
        self.model, self.bordered, self.row, self.way = model, bordered, row, way
        self.place, self.force, self._check = 0.0, 0.0, Admissible(model)

    def lead(self, place: float, smallest: float) -> None:
        """Go to a place, in smaller steps where there is no other way.

        Raises:
            SolveError: a step below the smallest one failed.
        """
        targets = [place]
        while targets:
            why = self._step(targets[-1])
            if not why:
                self.place = targets.pop()
            elif abs(targets[-1] - self.place) < 2 * smallest:
                load = self.model.problem.time
                raise SolveError(f"landscape at {targets[-1]:.4g} of the way: {why}", load)
            else:
                targets.append(0.5 * (self.place + targets[-1]))

    def _step(self, place: float) -> str:
        """Equilibrium at a place, taken over by the model; why there is none, or nothing."""
        model, guess = self.model, self.model.x.copy()
        guess.axpy(place - self.place, self.way)
        report = self.bordered.solve(guess, self.force, self.row, model.x)
        why = self._check(guess) if report.converged else report.reason
        if not why:
            guess.copy(model.x)
            model.problem.accept(model.x)
            self.force = report.value
        return why
