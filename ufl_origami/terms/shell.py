"""Membrane and bending of the panels: the mid-edge shell on its stencil tables.

W = h/8 |Abar^-1 (A - Abar)|^2 + h^3/24 |Abar^-1 (B - Bbar)|^2, each times twice the rest area, with
the second fundamental form B a sum over the three tilts (Grinspun et al. 2006,
doi:10.1111/j.1467-8659.2006.00974.x; the tilts of each form are in stencils.py).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ufl_origami import kernels
from ufl_origami.configuration import Configuration, State
from ufl_origami.stencils import ShellBatch
from ufl_origami.terms.base import Keyed, StencilTerm
from ufl_origami.terms.panels import PanelData


@dataclass(frozen=True)
class Ghosts:
    """Ghost vertices of one clamped edge set within one batch.

    Attributes:
        rows: stencils of the batch (k,).
        edges: their edge 0, 1, 2 (k,).
        tangent: function of time: outward tangent of the continued surface (k, 3).
    """

    rows: np.ndarray
    edges: np.ndarray
    tangent: Callable[[float], np.ndarray]


class _Batch:
    """One group of stencils with its elastic data and work arrays."""

    def __init__(self, table: ShellBatch, ghosts: list[Ghosts], configuration: Configuration):
        self.table, self.ghosts = table, ghosts
        self.dofs = table.dofs(configuration)
        self.scatter = np.maximum(self.dofs, 0)
        slot = np.ascontiguousarray(np.maximum(table.slot, 0), dtype=np.int32)
        self.stencil = kernels.Stencil(
            np.ascontiguousarray(table.verts, dtype=np.int32),
            table.offset,
            np.ascontiguousarray(table.c),
            np.ascontiguousarray(table.d),
            slot,
        )
        n, k = self.dofs.shape
        self.theta, self.theta_ref, self.t = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
        self.s, self.energy, self.g = np.zeros((n, 3, 3)), np.zeros((n, 2)), np.zeros((n, k))
        self.sigma = np.zeros((n, 3))

    def place_ghosts(self, time: float) -> None:
        for ghosts in self.ghosts:
            self.table.offset[ghosts.rows, ghosts.edges] = ghosts.tangent(time)

    def measure(self, state: State, measure) -> None:
        """Hinge angles, tilts and their measure at a state."""
        kernels.tilts(state.x, state.scalars, self.stencil, self.theta_ref, self.theta, self.t)
        measure(self.t, self.s)

    def set_rest(self, state: State, panels: PanelData, measure) -> None:
        """Adopt a state, with the ghosts as the table has them, as stress-free."""
        cells, verts = self.table.cells, self.stencil.verts
        self.measure(state, measure)
        self.theta_ref[:] = self.theta
        abar, bbar = np.zeros((len(cells), 3)), np.zeros((len(cells), 3))
        kernels.metrics(state.x, verts, abar)
        kernels.second_form(state.x, verts, self.s, bbar)
        if panels.curvature is not None:
            bbar += covariant(panels.curvature[cells], state.x, verts)
        h = panels.thickness[cells]
        stiffness = kernels.plane_stress_stiffness(
            abar, young=panels.young[cells], poisson=panels.poisson[cells], thickness=h
        )
        membrane = stiffness if panels.membrane else np.zeros_like(stiffness)
        bending = (h**2 / 3)[:, None, None] * stiffness
        self.elastic = self.given = kernels.Elastic(membrane, abar, bbar, bending)

    def refer(self, strains: np.ndarray, factor: float) -> None:
        a, b = np.ascontiguousarray(strains[:, :3]), np.ascontiguousarray(strains[:, 3:])
        self.elastic = kernels.Elastic(factor * self.given.C, a, b, factor * self.given.D)


def covariant(tensor: np.ndarray, x: np.ndarray, verts: np.ndarray) -> np.ndarray:
    """Components 11, 12, 22 of tensors (n, 3, 3) in the basis (v_j - v_i, v_k - v_i): (n, 3)."""
    base = x[verts[:, 1:3]] - x[verts[:, :1]]
    form = np.einsum("nai,nij,nbj->nab", base, tensor, base)
    return np.stack([form[:, 0, 0], form[:, 0, 1], form[:, 1, 1]], axis=1)


class ShellTerm(StencilTerm):
    """Membrane and bending energy of all panels.

    Args:
        configuration: numbering of the unknowns.
        batches: stencil tables with the ghosts of each.
        panels: elastic data of the cells.
        rest: stress-free state.
        measure: "tan" (default form) or "sin" (the paper's) of the tilts.
    """

    kinds = ("membrane", "bending")

    def __init__(
        self,
        configuration: Configuration,
        batches: list[tuple[ShellBatch, list[Ghosts]]],
        panels: PanelData,
        rest: State,
        measure: str = "tan",
    ):
        self._measure = kernels.MEASURES[measure]
        self._input_cell = configuration.sheet.input_cell
        self._num_cells = configuration.sheet.num_owned_cells
        self.panels = panels
        self.batches = [_Batch(table, ghosts, configuration) for table, ghosts in batches]
        for batch in self.batches:
            batch.set_rest(rest, panels, self._measure)
        self.linearise(None, rest)

    def stencils(self) -> list[np.ndarray]:
        """Local unknowns of each batch."""
        return [batch.dofs for batch in self.batches]

    def set_time(self, time: float) -> None:
        """Place the ghost vertices of the clamps."""
        for batch in self.batches:
            batch.place_ghosts(time)

    def energies(self, state: State) -> np.ndarray:
        """Membrane and bending energy of this rank's triangles."""
        total = np.zeros(2)
        for batch in self.batches:
            batch.measure(state, self._measure)
            kernels.shell_energy(state.x, batch.stencil.verts, batch.s, batch.elastic, batch.energy)
            total += batch.energy.sum(axis=0)
        return total

    def element_energies(self, state: State) -> dict[str, np.ndarray]:
        """Energy of each owned triangle (num_owned_cells,), by kind."""
        self.energies(state)
        values = np.zeros((self._num_cells, 2))
        for batch in self.batches:
            values[batch.table.cells] = batch.energy
        membrane, bending = values.T
        return (
            {"membrane": membrane, "bending": bending}
            if self.panels.membrane
            else {"bending": bending}
        )

    def clamped_sides(self) -> np.ndarray:
        """Sides 3 * cell + e of owned triangles at which the normal is prescribed."""
        sides = [
            3 * batch.table.cells[ghosts.rows] + ghosts.edges
            for batch in self.batches
            for ghosts in batch.ghosts
        ]
        return np.concatenate([np.empty(0, dtype=np.int64), *sides])

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the energy's gradient."""
        for batch in self.batches:
            batch.measure(state, self._measure)
            kernels.shell_gradient(
                state.x, batch.stencil, batch.s, batch.elastic, batch.energy, batch.g
            )
            kernels.add_at(batch.g, batch.scatter, out)

    def linearise(self, previous: State | None, current: State) -> None:
        """Membrane stress of the next tangent: extrapolated from the iterate before, if any."""
        for batch in self.batches:
            verts = batch.stencil.verts
            if previous is None:
                kernels.membrane_stress(current.x, verts, batch.elastic, batch.sigma)
            else:
                step = current.x - previous.x
                kernels.extrapolated_stress(previous.x, step, verts, batch.elastic, batch.sigma)

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the Hessians, with the membrane stress that `linearise` fixed."""
        for batch, block in zip(self.batches, blocks, strict=True):
            batch.measure(state, self._measure)
            kernels.shell_hessian(
                state.x, batch.stencil, batch.s, batch.elastic, batch.sigma,
                batch.energy, batch.g, block,
            )  # fmt: skip

    def accept(self, state: State) -> None:
        """Unwrap hinge angles against this state from now on."""
        for batch in self.batches:
            batch.measure(state, self._measure)
            batch.theta_ref[:] = batch.theta

    def second_forms(self, state: State) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Local cells, rest metrics (A11, A12, A22) and second forms (B11, B12, B22) by batch."""
        for batch in self.batches:
            batch.measure(state, self._measure)
            b = np.zeros((len(batch.t), 3))
            kernels.second_form(state.x, batch.stencil.verts, batch.s, b)
            yield batch.table.cells, batch.elastic.abar, b

    def strains(self, state: State) -> Keyed:
        """Metrics and second forms (n, 6) by input cell."""
        forms = []
        for batch in self.batches:
            a = np.zeros((len(batch.t), 3))
            kernels.metrics(state.x, batch.stencil.verts, a)
            forms.append(a)
        seconds = [b for _, _, b in self.second_forms(state)]
        return self._keyed([np.hstack(pair) for pair in zip(forms, seconds, strict=True)], 6)

    def refer(self, strains: np.ndarray, factor: float) -> None:
        """Take metrics and second forms (n, 6) as stress-free, and the stiffness times a factor."""
        for batch, part in zip(self.batches, self._split(strains), strict=True):
            batch.refer(part, factor)

    def history(self) -> dict[str, Keyed]:
        """Hinge angles (n, 3) of the accepted state, by input cell."""
        return {"hinge_angle": self._keyed([batch.theta_ref for batch in self.batches], 3)}

    def restore(self, values: dict[str, np.ndarray]) -> None:
        """Unwrap hinge angles against those of an earlier run."""
        for batch, part in zip(self.batches, self._split(values["hinge_angle"]), strict=True):
            batch.theta_ref[:] = part

    def _keyed(self, parts: list[np.ndarray], width: int) -> Keyed:
        """Values (n, width) of the batches by input cell."""
        cells = [self._input_cell[batch.table.cells] for batch in self.batches]
        none = np.empty(0, dtype=np.int64), np.empty((0, width))
        return Keyed(np.concatenate([none[0], *cells]), np.concatenate([none[1], *parts]))

    def _split(self, values: np.ndarray) -> list[np.ndarray]:
        """Values (n, ...) of each batch."""
        ends = np.cumsum([len(batch.theta_ref) for batch in self.batches])
        return np.split(values, ends[:-1]) if self.batches else []

    def largest_tilt(self, state: State) -> float:
        """Largest |tilt| (radians) of this rank's triangles."""
        largest = 0.0
        for batch in self.batches:
            batch.measure(state, self._measure)
            largest = max(largest, float(np.abs(batch.t).max(initial=0.0)))
        return largest

    def smallest_area_ratio(self, state: State) -> float:
        """Smallest ratio of current to rest area of this rank's triangles."""
        smallest = np.inf
        for batch in self.batches:
            area, abar = np.zeros(len(batch.t)), batch.elastic.abar
            kernels.areas(state.x, batch.stencil.verts, area)
            rest = 0.5 * np.sqrt(abar[:, 0] * abar[:, 2] - abar[:, 1] ** 2)
            smallest = min(smallest, float((area / rest).min(initial=np.inf)))
        return smallest
