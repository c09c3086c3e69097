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
from ufl_origami.terms.base import MatrixTerm, Rates
from ufl_origami.terms.contact import ContactTerm
from ufl_origami.terms.form import FormTerm, SheetFunctions, pushed_forward


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


class FrictionTerm(MatrixTerm):
    """Friction on the nodes that touch an obstacle.

    Args:
        functions: the scene's shared functions.
        contact: the obstacle's contact.
        law: friction law.
        share: (nd,) 1 at the nodes that have it, else 0.
        lagged: take pressure and normal from the last accepted state.
    """

    kinds = ("friction",)

    def __init__(
        self,
        functions: SheetFunctions,
        contact: ContactTerm,
        law: FrictionLaw,
        share: np.ndarray,
        *,
        lagged: bool = False,
    ):
        self.functions, self.contact, self.lagged = functions, contact, lagged
        number, zero = functions.number, functions.number(np.zeros(3))
        self._sliding = Sliding(
            number(1.0), functions.field(), functions.field(), zero, number(np.zeros(3))
        )
        self._share = fem.Function(contact.at.share.function_space)
        self._share.x.array[:] = share
        self._form = self._make(law)
        self.conservative = self.symmetric = lagged

    def _make(self, law: FrictionLaw) -> FormTerm:
        functions, sliding, at = self.functions, self._sliding, self.contact.at
        u = sliding.last if self.lagged else functions.u
        number, surface = functions.number, at.surface
        place = sliding.before if self.lagged else at.place
        x = ufl.variable(ufl.SpatialCoordinate(functions.sheet.mesh) + u - place)
        gap = surface.obstacle.distance(x, number)
        normal = ufl.diff(gap, x)
        stiffness, reach = number(surface.barrier.stiffness), number(surface.barrier.distance)
        pressure = self._share * barrier_pressure(gap, stiffness, reach)
        velocity = sliding.rate * (functions.u - sliding.base) - sliding.belt

        def along(vector: Expr) -> Expr:
            return vector - ufl.inner(normal, vector) * normal

        def carry(direction: Direction) -> Expr:
            vector = number(direction.vector)
            flat = along(pushed_forward(u, vector) if direction.carried else vector)
            return flat / length(flat)

        slip, dx = along(velocity), functions.nodal()
        if self.lagged:
            potential = law.potential(slip, number, carry) / sliding.rate
            return FormTerm("friction", functions, energy=pressure * potential * dx)
        test = ufl.TestFunction(functions.V)
        drag = law.drag(slip, number, carry)
        return FormTerm("friction", functions, force=pressure * ufl.inner(drag, test) * dx)

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
        out = np.zeros(len(state.q))
        self.add_residual(state, out)
        return -float(out[self.functions.dofs].reshape(-1, 3).sum(axis=0) @ way)

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the drag."""
        if self.lagged or self.contact.near(state):
            self._form.add_residual(state, out)

    def add_tangent(self, state: State, matrix) -> None:
        """Add the drag's derivative."""
        if self.lagged or self.contact.near(state):
            self._form.add_tangent(state, matrix)
