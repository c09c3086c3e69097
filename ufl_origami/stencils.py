"""Stencil tables: how the tilt of each triangle edge follows from the unknowns.

The tilt of edge e seen from a triangle is `c theta + d . u`: theta the hinge angle across the
edge, u at most two scalar unknowns. All modelling of edges (smooth interior, free, clamped,
crease of two or more panels) is in these coefficients, so one kernel serves them all:

| edge | averaged (paper) | director |
|---|---|---|
| interior | theta/2 | theta/2 + xi, theta/2 - xi |
| free boundary | 0 | xi |
| clamped boundary | theta to the ghost vertex | theta to the ghost vertex |
| crease of two panels | (theta - phi)/2 | (theta - phi)/2 + xi, (theta - phi)/2 - xi |
| crease of m > 2 panels | as director | xi on panel 1, theta_1s - phi_1s - xi on panel s |

Where a panel at a crease is oriented against the first one, phi and xi change sign on it.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from ufl_origami.configuration import Configuration, cells_per_edge
from ufl_origami.sheet import SheetMesh
from ufl_origami.sides import EdgeSides, crease_facets, edge_sides

FOLD_ANGLE, DIRECTOR = "fold_angle", "director"
BENDING_FORMS = ("director", "averaged")


def fold_angle_name(pair: int) -> str:
    """Unknown of the virtual angle between panel 1 and panel `pair` + 1 of a crease (from 1)."""
    return FOLD_ANGLE if pair == 1 else f"{FOLD_ANGLE}_{pair}"


@dataclass
class ShellBatch:
    """Stencils of triangles with the same number m of scalar slots an edge.

    Attributes:
        cells: local owned cells (n,).
        verts: (n, 6) the triangle's vertices, then the one across each edge.
        offset: (n, 3, 3) added to the position of the vertex across (ghost vertices).
        c: (n, 3) coefficients of the hinge angles.
        d: (n, 3, m) coefficients of the scalar unknowns.
        slot: (n, 3, m) local scalar index, -1 where unused.
    """

    cells: np.ndarray
    verts: np.ndarray
    offset: np.ndarray
    c: np.ndarray
    d: np.ndarray
    slot: np.ndarray

    def dofs(self, configuration: Configuration) -> np.ndarray:
        """Local unknowns (n, 18 + 3 m), -1 where a vertex or slot has no influence."""
        n = len(self.cells)
        verts = self.verts.astype(np.int32)
        position = 3 * verts[:, :, None] + np.arange(3, dtype=np.int32)
        position[:, 3:][self.c == 0] = -1
        slots = np.where(self.slot >= 0, 3 * configuration.nv + self.slot, -1)
        return np.hstack([position.reshape(n, 18), slots.reshape(n, -1)]).astype(np.int32)


def edge_unknowns(sheet: SheetMesh, bending: str, clamped: np.ndarray) -> dict[str, np.ndarray]:
    """Facets that carry each scalar unknown.

    Args:
        sheet: the meshed sheet.
        bending: "director" or "averaged".
        clamped: local facets (owned and ghosts) whose normal is prescribed.
    """
    count = cells_per_edge(sheet)
    creases = crease_facets(sheet)
    largest = sheet.comm.allreduce(int(count[creases].max(initial=0)), op=MPI.MAX)
    unknowns = {fold_angle_name(pair): creases[count[creases] > pair] for pair in range(1, largest)}
    if bending == "director":
        free = np.ones(len(count), dtype=bool)
        free[clamped] = False
        unknowns[DIRECTOR] = np.flatnonzero(free).astype(np.int32)
    elif largest > 2:
        unknowns[DIRECTOR] = creases[count[creases] > 2]
    return unknowns


@dataclass
class _Tilts:
    """Coefficients of the tilts of all owned sides: c (n,), d and slot (n, 2)."""

    c: np.ndarray
    d: np.ndarray
    slot: np.ndarray

    def put(self, where: np.ndarray, column: int, coefficient, slots: np.ndarray) -> None:
        self.d[where, column] = np.broadcast_to(coefficient, where.shape)[where]
        self.slot[where, column] = slots[where]


def _tilts(sheet: SheetMesh, sides: EdgeSides, configuration, clamped) -> _Tilts:
    """Fill the table in the module's docstring for the owned sides."""
    n = 3 * sheet.num_owned_cells
    facet, rank, count = sides.facet[:n], sides.rank[:n], sides.count[:n]
    tilts = _Tilts(np.zeros(n), np.zeros((n, 2)), np.full((n, 2), -1, dtype=np.int32))
    crease = np.isin(facet, crease_facets(sheet))
    fork = crease & (count > 2)
    orientation = np.where(rank == 0, 1, sides.consistent[:n])
    side = np.where(rank == 0, 1.0, -orientation)
    tilts.c[count == 2] = 0.5
    tilts.c[np.isin(facet, clamped)] = 1.0
    tilts.c[fork & (rank > 0)] = 1.0
    fold = crease & (count == 2)
    if fold.any():
        tilts.put(fold, 1, -0.5 * orientation, configuration.slot(FOLD_ANGLE)[facet])
    if DIRECTOR in configuration.edge_unknowns:
        director = configuration.slot(DIRECTOR)[facet]
        tilts.put(director >= 0, 0, side, director)
        follower = fork & (rank > 0)
        tilts.put(follower, 0, side, director)
        for pair in range(1, int(count[fork].max(initial=0))):
            phi = configuration.slot(fold_angle_name(pair))[facet]
            tilts.put(follower & (rank == pair), 1, side, phi)
    return tilts


def shell_batches(sheet: SheetMesh, configuration: Configuration, clamped) -> list[ShellBatch]:
    """Tables of all owned triangles, grouped by the number of scalar slots an edge they use.

    Args:
        sheet: the meshed sheet.
        configuration: numbering of the unknowns.
        clamped: local facets whose normal is prescribed.
    """
    sides = edge_sides(sheet)
    n = sheet.num_owned_cells
    tilts = _tilts(sheet, sides, configuration, clamped)
    c, d, slot = (a.reshape(n, 3, *a.shape[1:]) for a in (tilts.c, tilts.d, tilts.slot))
    across = sheet.cells.ravel()[sides.partner[: 3 * n]].reshape(n, 3)
    ghost = np.isin(sheet.cell_edges[:n], clamped) | (c == 0)
    across = np.where(ghost, np.roll(sheet.cells[:n], -1, axis=1), across)
    verts = np.hstack([sheet.cells[:n], across])
    columns = [(), (0,), (1,), (0, 1)]
    key = (slot >= 0).any(axis=1) @ np.array([1, 2])
    batches = []
    for pattern, used in enumerate(columns):
        cells = np.flatnonzero(key == pattern).astype(np.int32)
        if len(cells):
            columns_used = list(used)
            picked = (a[cells][:, :, columns_used] for a in (d, slot))
            offset = np.zeros((len(cells), 3, 3))
            batches.append(ShellBatch(cells, verts[cells], offset, c[cells], *picked))
    return batches
