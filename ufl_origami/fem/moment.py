"""Edge moments of the FEM model: conjugate to the rotation of the boundary's directors."""

from collections.abc import Callable

import numpy as np
import ufl
from dolfinx import fem

from ufl_origami.conditions import outward_tangents
from ufl_origami.configuration import Configuration, State
from ufl_origami.fem import forms
from ufl_origami.fem.elements import FREE, GAUSS, side_elements
from ufl_origami.fem.shell import FemShellTerm
from ufl_origami.fem.unknowns import node_dofs
from ufl_origami.partition import pair_keys
from ufl_origami.sides import side_ends
from ufl_origami.terms.base import Keyed, StencilTerm


class FemEdgeMoment(StencilTerm):
    """Moment per rest length on a boundary, lifting its outward tangent to the normal.

    The rotation is that of the director about the edge, against the rest tangent as a fixed
    direction: the shell's tilt less the angle of the face; energy -M(t) int rotation ds.

    Args:
        configuration: numbering of the unknowns.
        shell: the panels' term, whose frames the directors are measured in.
        sides: sides 3 * cell + e (n,) of owned triangles.
        moment: function of time: moment per length.
    """

    kinds = ("load",)

    def __init__(
        self,
        configuration: Configuration,
        shell: FemShellTerm,
        sides: np.ndarray,
        moment: Callable[[float], float],
    ):
        sheet = configuration.sheet
        self._shell, self._moment, self._time = shell, moment, 0.0
        self._cells, edges = np.divmod(sides, 3)
        self._points = 2 * edges[:, None] + np.arange(2)
        ends = side_ends(sheet, sides)
        self._length = np.linalg.norm(sheet.rest[ends[:, 1]] - sheet.rest[ends[:, 0]], axis=1)
        positions = sheet.rest[sheet.cells[self._cells]]
        elements = side_elements(positions, edges)
        self._x, self._base = fem.Function(elements.P), fem.Function(elements.P)
        outward = fem.Function(elements.V0)
        outward.x.array[:] = outward_tangents(sheet, sides).ravel()
        angle = forms.frame_angle(elements, self._x, self._base, outward)
        weight = ufl.TestFunction(fem.functionspace(elements.mesh, ("DG", 1)))
        self._angle = forms.compiled(angle * weight * forms.edges(elements, FREE))
        total = angle * forms.edges(elements, FREE)
        force = ufl.derivative(total, self._x, ufl.TestFunction(elements.P))
        self._force = forms.compiled(force)
        stiffness = ufl.derivative(force, self._x, ufl.TrialFunction(elements.P))
        self._stiffness = forms.ElementMatrix(stiffness, 18)
        self._ends = np.stack([(edges + 1) % 3, (edges + 2) % 3], axis=1)
        rows, points = self._cells[:, None], self._points
        slot = shell.table.slot[rows, points, 0]
        self._slot, self._rate = slot, shell.table.coefficient[rows, points, 0]
        nodes = node_dofs(configuration)[self._cells].reshape(-1, 18)
        self._dofs = np.hstack([nodes, 3 * configuration.nv + slot]).astype(np.int32)
        self._reference = np.zeros(points.shape)
        ids = sheet.input_vertex[ends]
        self._keys = pair_keys(ids, sheet.num_vertices_global)

    def set_time(self, time: float) -> None:
        """Time at which the moment is taken."""
        self._time = time

    def _place(self, state: State) -> None:
        self._x.x.array[:] = self._shell.positions(state)[self._cells].ravel()
        self._base.x.array[:] = self._shell.pairings.base[self._cells].ravel()

    def _rotations(self, state: State) -> np.ndarray:
        """Rotations (n, 2) of the directors at the Gauss points, near those accepted last."""
        self._place(state)
        pairing = fem.assemble_vector(self._angle).array.reshape(-1, 3)
        pairing = np.take_along_axis(pairing, self._ends, axis=1) / (0.5 * self._length[:, None])
        face = np.linalg.solve(np.array([1 - GAUSS, GAUSS]), pairing.T).T
        offset = self._shell.offset[self._cells[:, None], self._points]
        rotation = offset + self._rate * state.scalars[self._slot] - face
        return rotation + 2 * np.pi * np.round((self._reference - rotation) / (2 * np.pi))

    def energies(self, state: State) -> np.ndarray:
        """Minus the work of the moments on this rank's edges."""
        if not len(self._cells):
            return np.zeros(1)
        work = (0.5 * self._length[:, None] * self._rotations(state)).sum()
        return np.array([-self._moment(self._time) * work])

    def _turn(self, state: State) -> np.ndarray:
        """Derivative (n, 20) of the integrals of the rotation along the edges."""
        self._place(state)
        face = fem.assemble_vector(self._force).array.reshape(-1, 18)
        return np.hstack([-face, 0.5 * self._length[:, None] * self._rate])

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Subtract the moments."""
        if len(self._cells):
            np.add.at(out, self._dofs, -self._moment(self._time) * self._turn(state))

    def stencils(self) -> list[np.ndarray]:
        """Local unknowns of the loaded edges' triangles: 18 positions, 2 directors."""
        return [self._dofs]

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the Hessians of the rotation times the moment."""
        blocks[0][:] = 0.0
        if len(self._cells):
            self._place(state)
            blocks[0][:, :18, :18] = self._moment(self._time) * self._stiffness.blocks()

    def largest_turn(self, state: State, step: np.ndarray) -> float:
        """Largest linear change (radians) of an edge's mean rotation over a step."""
        if not len(self._cells):
            return 0.0
        turn = (self._turn(state) * step[self._dofs]).sum(axis=1) / self._length
        return float(np.abs(turn).max())

    def accept(self, state: State) -> None:
        """Unwrap the rotation against this state from now on."""
        if len(self._cells):
            self._reference[:] = self._rotations(state)

    def history(self) -> dict[str, Keyed]:
        """Rotations (n, 2) of the accepted state, by edge."""
        return {"rotation": Keyed(self._keys, self._reference)}

    def restore(self, values: dict[str, np.ndarray]) -> None:
        """Unwrap the rotation against that of an earlier run."""
        self._reference[:] = values["rotation"]
