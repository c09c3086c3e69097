"""Loads: dead forces, follower pressure and edge moments.

Sign: every load enters the potential as minus its work, so that its residual is minus the force.
"""

from collections.abc import Callable

import numpy as np
import ufl

from ufl_origami import kernels
from ufl_origami.configuration import Configuration, State
from ufl_origami.partition import pair_keys
from ufl_origami.terms.base import Keyed, StencilTerm, Term
from ufl_origami.terms.form import FormTerm, SheetFunctions, deformed_jacobian

Amplitude = Callable[[float], float]
VectorFunction = Callable[[float], np.ndarray]


class NodalLoad(Term):
    """Dead forces on nodes: -f(t) . sum_a w_a u_a.

    Args:
        dofs: local unknowns (n, 3) of nodes, owned or ghost; contributions of all ranks add up.
        weights: (n,) share of each node (1 for a point, length for a line load).
        force: function of time: force (3,), per length for a line load.
        kind: name under which the energy is booked.
    """

    def __init__(
        self, dofs: np.ndarray, weights: np.ndarray, force: VectorFunction, kind: str = "load"
    ):
        self.kinds = (kind,)
        self._dofs, self._weights, self._force = dofs, weights, force
        self._time = 0.0

    def set_time(self, time: float) -> None:
        """Time at which the force is taken."""
        self._time = time

    def _forces(self) -> np.ndarray:
        return self._weights[:, None] * np.asarray(self._force(self._time), dtype=float)

    def energies(self, state: State) -> np.ndarray:
        """Minus the work of the forces on this rank's share."""
        return np.array([-(self._forces() * state.q[self._dofs]).sum()])

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Subtract the forces."""
        np.add.at(out, self._dofs, -self._forces())


def area_load(
    functions: SheetFunctions, density: np.ndarray, direction: VectorFunction, kind: str = "load"
):
    """Dead load per rest area, -int density f(t) . u dA.

    Args:
        functions: the scene's shared functions.
        density: local values (nc,): 1 on the loaded triangles and 0 elsewhere, or masses per area.
        direction: function of time: force per rest area (3,), or acceleration.
        kind: name under which the energy is booked.
    """
    return _TimedForm(
        functions,
        direction,
        lambda f: {"energy": -functions.piecewise(density) * ufl.inner(f, functions.u) * ufl.dx},
        kind,
    )


def follower_pressure(functions: SheetFunctions, density: np.ndarray, pressure: Amplitude):
    """Pressure along the current normal (positive along the panels' normals), per current area.

    Force per rest area p (a_1 x a_2) / |A_1 x A_2| with current and rest bases a, A; at free
    boundaries it has no potential, and its tangent is not symmetric.
    """
    rest, current = deformed_jacobian(functions.u)
    area = ufl.sqrt(ufl.inner(*(2 * [ufl.cross(rest[:, 0], rest[:, 1])])))
    normal = ufl.cross(current[:, 0], current[:, 1]) / area
    v = ufl.TestFunction(functions.V)
    p = functions.piecewise(density)
    return _TimedForm(
        functions,
        lambda t: np.array([0.0, 0.0, pressure(t)]),
        lambda f: {"force": -p * f[2] * ufl.inner(normal, v) * ufl.dx},
    )


class _TimedForm(FormTerm):
    """A load form with one vector that follows a function of time."""

    def __init__(self, functions: SheetFunctions, value: VectorFunction, form, kind: str = "load"):
        self._vector = functions.number(np.zeros(3))
        self._value = value
        super().__init__(kind, functions, **form(self._vector))

    def set_time(self, time: float) -> None:
        """Set the vector to its value at a time."""
        self._vector.value[:] = self._value(time)


class EdgeMoment(StencilTerm):
    """Moment per rest length on a boundary, conjugate to the rotation of the edge's normal.

    The rotation is that of the face about the edge, measured against the rest tangent as a fixed
    direction and unwrapped, plus the director's: energy -M(t) Lbar (xi - theta_ghost).

    Args:
        configuration: numbering of the unknowns.
        hinge: stencils of the edges (x0, x1, x2, ghost).
        dofs: (n, 12 + m) local unknowns.
        length: (n,) rest lengths.
        moment: function of time: moment per length, positive where it lifts the outward tangent
            towards the panel's normal.
    """

    kinds = ("load",)

    def __init__(
        self,
        configuration: Configuration,
        hinge: kernels.HingeStencil,
        dofs: np.ndarray,
        length: np.ndarray,
        moment: Amplitude,
    ):
        self._hinge, self._dofs, self._length, self._moment = hinge, dofs, length, moment
        self._theta, self._ref = np.zeros(len(dofs)), np.zeros(len(dofs))
        self._time = 0.0
        sheet = configuration.sheet
        self._keys = pair_keys(sheet.input_vertex[hinge.verts[:, :2]], sheet.num_vertices_global)

    def set_time(self, time: float) -> None:
        """Time at which the moment is taken."""
        self._time = time

    def _work(self) -> np.ndarray:
        return self._moment(self._time) * self._length

    def _angles(self, state: State) -> np.ndarray:
        h = self._hinge
        kernels.hinge_angles(state.x, h.verts, h.offset, self._ref, self._theta)
        return self._theta

    def energies(self, state: State) -> np.ndarray:
        """Minus the work of the moments on this rank's edges."""
        energy = np.zeros(len(self._dofs))
        kernels.hinge_work_energy(
            state.scalars, self._hinge, self._angles(state), self._work(), energy
        )
        return np.array([energy.sum()])

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the energy's gradient."""
        g = np.zeros(self._dofs.shape)
        kernels.hinge_work_gradient(state.x, self._hinge, self._work(), g)
        kernels.add_at(g, self._dofs, out)

    def stencils(self) -> list[np.ndarray]:
        """Local unknowns of the edges."""
        return [self._dofs]

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the Hessians of the rotation times the moment."""
        kernels.hinge_work_hessian(state.x, self._hinge, self._work(), blocks[0])

    def largest_turn(self, state: State, step: np.ndarray) -> float:
        """Largest linear change (radians) of the boundary's rotation over a step."""
        turn = np.zeros(self._dofs.shape)
        kernels.hinge_work_gradient(state.x, self._hinge, np.ones(len(turn)), turn)
        return float(np.abs((turn * step[self._dofs]).sum(axis=1)).max(initial=0.0))

    def accept(self, state: State) -> None:
        """Unwrap the rotation against this state from now on."""
        self._ref[:] = self._angles(state)

    def history(self) -> dict[str, Keyed]:
        """Rotation (n,) of the accepted state, by edge."""
        return {"rotation": Keyed(self._keys, self._ref)}

    def restore(self, values: dict[str, np.ndarray]) -> None:
        """Unwrap the rotation against that of an earlier run."""
        self._ref[:] = values["rotation"]
