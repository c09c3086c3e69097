"""The panels' term of the FEM model: Koiter shell energy of second order, condensed by element."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ufl_origami.configuration import Configuration, State
from ufl_origami.fem import algebra
from ufl_origami.fem.elements import FlatElements, side_elements
from ufl_origami.fem.pairings import ClampPairings, Pairings
from ufl_origami.fem.unknowns import TiltTable, node_dofs
from ufl_origami.terms.base import Keyed, StencilTerm
from ufl_origami.terms.panels import PanelData


@dataclass(frozen=True)
class ClampedSides:
    """Edges of owned triangles with a prescribed outward tangent.

    Attributes:
        cells: local cells (n,).
        edges: local edges (n,).
        tangent: function of time giving the tangents (n, 3).
        stress_free: tangents (n, 3) at which the rest state has no moment at the edge.
    """

    cells: np.ndarray
    edges: np.ndarray
    tangent: Callable[[float], np.ndarray]
    stress_free: np.ndarray


class FemShellTerm(StencilTerm):
    """Membrane and bending energy of all panels.

    The tangent takes membrane forces and moments extrapolated from the iterate before, as if they
    were independent unknowns (Magisano, Leonetti, Garcea 2017, doi:10.1016/j.cma.2016.10.040).

    Args:
        configuration: numbering of the unknowns.
        elements: flat triangles.
        table: tilts by the angles.
        panels: elastic data of the local cells.
        clamps: sides with a prescribed normal.
        rest: stress-free state.
    """

    kinds = ("membrane", "bending")

    def __init__(
        self,
        configuration: Configuration,
        elements: FlatElements,
        table: TiltTable,
        panels: PanelData,
        clamps: list[ClampedSides],
        rest: State,
    ):
        sheet = configuration.sheet
        n = sheet.num_owned_cells
        self.panels, self.table = panels, table
        self._input_cell = sheet.input_cell[:n]
        self._nodes = node_dofs(configuration)[:n]
        self._rest_nodes = rest_nodes(configuration)[:n]
        used = 3 * configuration.nv + table.slot.reshape(n, 12)
        angles = np.where(table.slot.reshape(n, 12) >= 0, used, -1)
        self._dofs = np.hstack([self._nodes.reshape(n, 18), angles]).astype(np.int32)
        self._scatter = np.maximum(self._dofs, 0)
        self._set_clamps(clamps)
        self.pairings = Pairings(elements, self._rest_nodes, self._clamp_pairings)
        h = panels.thickness[:n]
        stiffness = algebra.plane_stress(panels.young[:n], panels.poisson[:n])
        self._bend = algebra.bending_matrix(elements, (h**3 / 12)[:, None, None] * stiffness)
        self._bend_root = algebra.root(self._bend)
        self._stretch_root = algebra.membrane_root(elements, h[:, None, None] * stiffness)
        self._stretch = self._stretch_root.transpose(0, 2, 1) @ self._stretch_root
        self._weights = algebra.edge_weights(elements, normals=True)
        self._point_values = np.linalg.pinv(self._weights)
        coefficient = table.coefficient.reshape(n, 12)
        self._angle_rate = np.repeat(self._weights, 2, axis=2) * coefficient[:, None, :]
        self.offset = np.zeros((n, 6))
        self._natural: np.ndarray = np.zeros((n, 9))
        self._reference: tuple[np.ndarray, np.ndarray] = np.zeros((n, 9)), np.zeros((n, 12))
        self._given = self._bend, self._stretch, self._bend_root, self._stretch_root
        self._set_rest(rest, elements)
        self._moment, self._force = np.zeros((n, 9)), np.zeros((n, 12))
        self._last: _Linearisation | None = None
        self.linearise(None, rest)

    def _set_clamps(self, clamps: list[ClampedSides]) -> None:
        n = len(self._rest_nodes)
        self.clamps, self._clamped = clamps, np.zeros((n, 3), dtype=bool)
        cells = np.concatenate([np.empty(0, dtype=int), *(sides.cells for sides in clamps)])
        edges = np.concatenate([np.empty(0, dtype=int), *(sides.edges for sides in clamps)])
        self._clamped[cells, edges] = True
        self._clamp_pairings = None
        if len(cells):
            elements = side_elements(self._rest_nodes[cells, :3], edges)
            self._clamp_pairings = ClampPairings(elements, cells)

    def _set_rest(self, rest: State, elements: FlatElements) -> None:
        """Adopt a state as stress-free: its tilts and curvatures, and those of the panels."""
        self._set_outward([sides.stress_free for sides in self.clamps])
        self._place(rest)
        self.offset = -self.table.tilts(rest.scalars) - self._angles()
        self.set_time(0.0)
        self._natural = self.pairings.value("curvature")
        if self.panels.curvature is not None:
            n = len(self._natural)
            frame = elements.frame
            tensor = np.einsum("nai,nij,nbj->nab", frame, self.panels.curvature[:n], frame)
            parts = np.stack([tensor[:, 0, 0], tensor[:, 0, 1], tensor[:, 1, 1]], axis=1)
            share = elements.area[:, None] / 3 * algebra.COMPONENTS * parts
            self._natural += np.tile(share, 3)

    def positions(self, state: State) -> np.ndarray:
        """Current nodes (n, 6, 3)."""
        return self._rest_nodes + state.q[self._nodes]

    def _place(self, state: State) -> None:
        self.pairings.place(self.positions(state))

    def _angles(self) -> np.ndarray:
        """Angles (n, 6) of the normals at the edges' Gauss points against their frames."""
        return np.einsum("npr,nr->np", self._point_values, self.pairings.value("angle"))

    def _bending_pairing(self, state: State) -> np.ndarray:
        """Bending pairings (n, 9) at a state that is placed."""
        tilts = self.table.tilts(state.scalars) + self.offset
        inside = self.pairings.value("curvature") - self._natural - self._reference[0]
        return inside + self.pairings.value("angle") + np.einsum("nrp,np->nr", self._weights, tilts)

    def _membrane_pairing(self) -> np.ndarray:
        """Membrane pairings (n, 12) at a state that is placed."""
        values = np.hstack([self.pairings.value("edge"), self.pairings.value("cell")])
        return values - self._reference[1]

    def strains(self, state: State) -> Keyed:
        """Pairings (n, 21) with the kinematics, by input cell."""
        self._place(state)
        pairings = np.hstack([self._bending_pairing(state), self._membrane_pairing()])
        return Keyed(self._input_cell, pairings + np.hstack(self._reference))

    def refer(self, strains: np.ndarray, factor: float) -> None:
        """Take pairings (n, 21) as stress-free, and the stiffness times a factor."""
        self._reference = strains[:, :9], strains[:, 9:]
        self._bend, self._stretch = (factor * matrix for matrix in self._given[:2])
        root = np.sqrt(factor)
        self._bend_root, self._stretch_root = (root * matrix for matrix in self._given[2:])
        self._last = None

    def stencils(self) -> list[np.ndarray]:
        """Local unknowns of the triangles: 18 positions, 12 angles."""
        return [self._dofs]

    def set_time(self, time: float) -> None:
        """Set the prescribed normals."""
        self._set_outward([sides.tangent(time) for sides in self.clamps])

    def _set_outward(self, tangents: list[np.ndarray]) -> None:
        if self._clamp_pairings:
            self._clamp_pairings.outward.x.array[:] = np.concatenate(tangents).ravel()

    def energies(self, state: State) -> np.ndarray:
        """Membrane and bending energy of this rank's triangles."""
        return np.array([part.sum() for part in self.element_energies(state).values()])

    def element_energies(self, state: State) -> dict[str, np.ndarray]:
        """Energy of each owned triangle (num_owned_cells,), by kind."""
        self._place(state)
        membrane, bending = self._membrane_pairing(), self._bending_pairing(state)
        return {
            "membrane": 0.5 * np.einsum("nr,nrs,ns->n", membrane, self._stretch, membrane),
            "bending": 0.5 * np.einsum("nr,nrs,ns->n", bending, self._bend, bending),
        }

    def clamped_sides(self) -> np.ndarray:
        """Sides 3 * cell + e of owned triangles at which the normal is prescribed."""
        return np.flatnonzero(self._clamped)

    def _stresses(self, bending: np.ndarray, membrane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        moment = np.einsum("nrs,ns->nr", self._bend, bending)
        return moment, np.einsum("nrs,ns->nr", self._stretch, membrane)

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the energy's gradient."""
        self._place(state)
        moment, force = self._stresses(self._bending_pairing(state), self._membrane_pairing())
        self.pairings.set_stresses(moment, force)
        angles = np.einsum("nrp,nr->np", self._angle_rate, moment)
        gradient = np.hstack([self.pairings.force(), angles])
        used = self._dofs >= 0
        out += np.bincount(self._dofs[used], gradient[used], minlength=len(out))

    def linearise(self, previous: State | None, current: State) -> None:
        """Moments and membrane forces of the next tangent: extrapolated from the iterate before."""
        if previous is None:
            self._place(current)
            bending, membrane = self._bending_pairing(current), self._membrane_pairing()
        else:
            bending, membrane = self._at(previous).extrapolated(self._step(previous, current))
        self._moment, self._force = self._stresses(bending, membrane)

    def _step(self, previous: State, current: State) -> np.ndarray:
        step = current.q - previous.q
        return np.where(self._dofs >= 0, step[self._scatter], 0.0)

    def _at(self, state: State) -> "_Linearisation":
        """Pairings and their derivatives at a state, kept for the next call."""
        if self._last is None or not np.array_equal(self._last.q, state.q):
            self._place(state)
            bending = np.concatenate([self.pairings.rate("bending"), self._angle_rate], axis=2)
            edge, cell = self.pairings.rate("edge"), self.pairings.rate("cell")
            membrane = np.concatenate([edge, cell], axis=1)
            values = self._bending_pairing(state), self._membrane_pairing()
            self._last = _Linearisation(state.q.copy(), *values, bending, membrane)
        return self._last

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the Hessians, with the stresses that `linearise` fixed."""
        at, block = self._at(state), blocks[0]
        self._place(state)
        self.pairings.set_stresses(self._moment, self._force)
        block[:] = 0.0
        block[:, :18, :18] = self.pairings.geometric()
        algebra.add_gram(self._bend_root, at.bending_rate, block)
        algebra.add_gram(self._stretch_root, at.membrane_rate, block)

    def accept(self, state: State) -> None:
        """Measure the angles from this state's normals from now on."""
        self._place(state)
        self.offset += np.where(np.repeat(self._clamped, 2, axis=1), 0.0, self._angles())
        self.pairings.base = self.positions(state)
        self._last = None

    def history(self) -> dict[str, Keyed]:
        """Angles (n, 6) of the base state against the rest state's, and its nodes (n, 18)."""
        base = self.pairings.base.reshape(-1, 18).copy()
        return {
            "angle": Keyed(self._input_cell, self.offset),
            "base": Keyed(self._input_cell, base),
        }

    def restore(self, values: dict[str, np.ndarray]) -> None:
        """Measure the angles from the base state of an earlier run."""
        self.offset[:] = values["angle"]
        self.pairings.base = values["base"]
        self._last = None

    def largest_tilt(self, state: State) -> float:
        """Largest |tilt| (radians) of this rank's triangles."""
        self._place(state)
        tilts = self._angles() + self.table.tilts(state.scalars) + self.offset
        return float(np.abs(tilts).max(initial=0.0))

    def smallest_area_ratio(self, state: State) -> float:
        """Smallest ratio of current to rest area at the corners of this rank's triangles."""
        current = corner_areas(self.positions(state))
        return float((current / corner_areas(self._rest_nodes)).min(initial=np.inf))


@dataclass(frozen=True)
class _Linearisation:
    """Pairings at a state and their derivatives by the element's unknowns."""

    q: np.ndarray
    bending: np.ndarray
    membrane: np.ndarray
    bending_rate: np.ndarray
    membrane_rate: np.ndarray

    def extrapolated(self, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pairings (n, 9) and (n, 12), to first order, after a step (n, 30)."""
        return (
            self.bending + np.einsum("nrk,nk->nr", self.bending_rate, step),
            self.membrane + np.einsum("nrk,nk->nr", self.membrane_rate, step[:, :18]),
        )


def rest_nodes(configuration: Configuration) -> np.ndarray:
    """Rest positions (nc, 6, 3) of the nodes of the local cells: corners, then midpoints."""
    sheet = configuration.sheet
    return np.concatenate([sheet.rest[sheet.cells], sheet.edge_middles()[sheet.cell_edges]], axis=1)


def corner_areas(nodes: np.ndarray) -> np.ndarray:
    """Twice the area (n, 3) of the tangent triangles at the corners of P2 elements (n, 6, 3)."""
    x, middle = nodes[:, :3], nodes[:, 3:]
    areas = np.empty((len(nodes), 3))
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        first = 4 * middle[:, c] - 3 * x[:, a] - x[:, b]
        second = 4 * middle[:, b] - 3 * x[:, a] - x[:, c]
        areas[:, a] = np.linalg.norm(np.cross(first, second), axis=1)
    return areas
