"""Friction between the sheet and one obstacle, under the pressure of its contact barrier.

The drag follows the tangential velocity relative to the obstacle at the end of the time step.
Fully implicit, pressure and normal are those of the step's end: the force has no energy and its
exact tangent is not symmetric. Lagged, they are those of the last accepted state (Li et al. 2020,
doi:10.1145/3386569.3392425): the step then has a potential and a symmetric tangent.
"""

from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from ufl.core.expr import Expr

from ufl_origami.barrier import barrier_pressure
from ufl_origami.configuration import State
from ufl_origami.friction_laws import Direction, FrictionLaw
from ufl_origami.obstacles import length
from ufl_origami.terms.base import MatrixTerm, Rates, StencilTerm, Term
from ufl_origami.terms.contact import ContactTerm
from ufl_origami.terms.form import (
    FormSum,
    FormTerm,
    NodalFormTerm,
    SheetFunctions,
    pushed_forward,
)
from ufl_origami.terms.nodes import NodalSum, full_sum, sparse_sum


@dataclass(frozen=True)
class Sliding:
    """How the nodes slide in the step under way, as UFL functions.

    Attributes:
        rate: factor of the velocities.
        base: displacement from which velocities count.
        last: displacement of the last accepted state.
        belt: velocity of the obstacle.
        before: displacement of the obstacle in the last accepted state.
    """

    rate: fem.Constant
    base: fem.Function
    last: fem.Function
    belt: fem.Constant
    before: fem.Constant

    @classmethod
    def create(cls, functions: SheetFunctions) -> "Sliding":
        """At rest."""
        belt, before = functions.number(np.zeros(3)), functions.number(np.zeros(3))
        return cls(functions.number(1.0), functions.field(), functions.field(), belt, before)


@dataclass(frozen=True)
class FrictionForm:
    """What a friction law comes to for one obstacle.

    Attributes:
        contact: the obstacle's contact.
        sliding: functions of the step under way.
        lagged: whether pressure and normal are those of the last accepted state.
        total: sum over the nodes that have it.
        density: potential per rest area (lagged), or minus the traction paired with a test
            function.
    """

    contact: ContactTerm
    sliding: Sliding
    lagged: bool
    total: NodalSum
    density: Expr

    @property
    def argument(self) -> dict[str, ufl.Form]:
        """The form under the name by which a term takes it."""
        return {"energy" if self.lagged else "force": self.total.of(self.density)}


def friction_form(
    contact: ContactTerm, law: FrictionLaw, share: np.ndarray, *, lagged: bool
) -> FrictionForm:
    """Friction of the nodes (nd,) with share 1; collective.

    Where directions are those of the sheet, all triangles around a node have their part in it.
    """
    functions, at, sliding = contact.functions, contact.at, Sliding.create(contact.functions)
    total = (full_sum if law.couples_nodes else sparse_sum)(functions, share)
    u, place = (sliding.last, sliding.before) if lagged else (functions.u, at.place)
    number, barrier = functions.number, at.surface.barrier
    x = ufl.variable(ufl.SpatialCoordinate(functions.sheet.mesh) + u - place)
    distance, reach = at.surface.obstacle.distance(x, number), number(barrier.distance)
    normal = ufl.diff(distance, x)
    gap = total.only_here(distance, reach)
    pressure = barrier_pressure(gap, number(barrier.stiffness), reach)
    velocity = sliding.rate * (functions.u - sliding.base) - sliding.belt

    def along(vector: Expr) -> Expr:
        return vector - ufl.inner(normal, vector) * normal

    def carry(direction: Direction) -> Expr:
        vector = number(direction.vector)
        flat = along(pushed_forward(u, vector) if direction.carried else vector)
        return flat / length(flat)

    if lagged:
        density = law.potential(along(velocity), number, carry) / sliding.rate
    else:
        drag = law.drag(along(velocity), number, carry)
        density = ufl.inner(drag, ufl.TestFunction(functions.V))
    return FrictionForm(contact, sliding, lagged, total, pressure * density)


def friction_term(
    contact: ContactTerm, law: FrictionLaw, share: np.ndarray, *, lagged: bool = False
) -> "FrictionTerm":
    """Friction on the nodes that touch an obstacle.

    Args:
        contact: the obstacle's contact.
        law: friction law.
        share: (nd,) 1 at the nodes that have it, else 0.
        lagged: take pressure and normal from the last accepted state.
    """
    form, functions = friction_form(contact, law, share, lagged=lagged), contact.functions
    if law.couples_nodes and not lagged:
        return CoupledFriction(form, FormTerm("friction", functions, **form.argument))
    return NodalFriction(
        form, NodalFormTerm(form.total.here, "friction", functions, **form.argument)
    )


class FrictionTerm(Term):
    """Friction on one obstacle.

    Args:
        form: the law's form.
        own: term of that form.
    """

    kinds = ("friction",)

    def __init__(self, form: FrictionForm, own: FormSum):
        self._form, self.contact, self._sliding = own, form.contact, form.sliding
        self.functions, self.lagged = own.functions, form.lagged
        self.conservative = self.symmetric = form.lagged

    def begin_step(self, rates: Rates) -> None:
        """Take over how velocities follow, the last state, and the obstacle's way."""
        sliding, motion, dofs = self._sliding, self.contact.at.surface.motion, self.functions.dofs
        places = [np.asarray(motion(time), dtype=float) for time in rates.times]
        sliding.rate.value = rates.rate
        sliding.base.x.array[:] = rates.base[dofs]
        sliding.last.x.array[:] = rates.last[dofs]
        sliding.before.value[:] = places[0]
        base = sum(w * place for w, place in zip(rates.weights, places, strict=True))
        sliding.belt.value[:] = rates.rate * (self.contact.at.place.value - base)

    def energies(self, state: State) -> np.ndarray:
        """Potential of the lagged drag, else zero."""
        return self._form.energies(state)

    def slope(self, state: State, step: np.ndarray) -> np.ndarray:
        """Minus the work of the drag over a step."""
        return self._form.slope(state, step)

    def drive(self, state: State, since: float) -> float:
        """Work that the moving obstacle does on this rank's nodes."""
        motion = self.contact.at.surface.motion
        way = np.asarray(motion(state.time), dtype=float) - motion(since)
        if not way.any():
            return 0.0
        out = np.zeros(len(state.q))
        self.add_residual(state, out)
        return -float(out[self.functions.dofs].reshape(-1, 3).sum(axis=0) @ way)

    def acts(self, state: State) -> bool:
        """Whether any node of this rank may have drag."""
        return self.lagged or self.contact.near(state)

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the drag."""
        if self.acts(state):
            self._form.add_residual(state, out)


class NodalFriction(FrictionTerm, StencilTerm):
    """Friction that each node feels alone."""

    _form: NodalFormTerm

    def stencils(self) -> list[np.ndarray]:
        """The nodes that can rub."""
        return self._form.stencils()

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the drag's derivative."""
        blocks[0][:] = 0.0
        if self.acts(state):
            self._form.tangent(state, blocks)


class CoupledFriction(FrictionTerm, MatrixTerm):
    """Friction along directions that the sheet carries, which neighbouring nodes turn."""

    _form: FormTerm

    def add_tangent(self, state: State, matrix) -> None:
        """Add the drag's derivative."""
        if self.acts(state):
            self._form.add_tangent(state, matrix)
