"""Unknowns of the shell element and where each triangle finds its own.

Nodes: the vertices and the edges' midpoints. Angles: at each of the two Gauss points of an edge,
one director xi and, at a crease, one virtual fold angle phi_k between panel 1 and panel k + 1. With
the angle a of the normal against a common frame, the tilt of a triangle's edge is

| edge | tilt |
|---|---|
| smooth, free | a - xi on side 1, a + xi on side 2 |
| clamped | a, measured from the prescribed normal |
| crease of two panels | a - xi - phi/2, a + xi - phi/2 |
| crease of m > 2 panels | a - xi on panel 1, a + xi - phi_k on panel k + 1 |

and the moments pair with it. On a panel that is oriented against the first one xi and phi change
sign.
"""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from ufl_origami.configuration import MIDDLE, Configuration, cells_per_edge
from ufl_origami.sheet import SheetMesh
from ufl_origami.sides import EdgeSides, crease_facets

DIRECTORS = ("director_1", "director_2")


def fold_angle_names(pair: int) -> tuple[str, str]:
    """Virtual angles between panel 1 and panel `pair` + 1 at the two Gauss points (pair from 1)."""
    stem = "fold_angle" if pair == 1 else f"fold_angle_{pair}"
    return f"{stem}_at_1", f"{stem}_at_2"


def edge_unknowns(sheet: SheetMesh, clamped: np.ndarray) -> dict[str, np.ndarray]:
    """Facets that carry each scalar unknown; clamped are the local facets without director."""
    count = cells_per_edge(sheet)
    every = np.arange(len(count), dtype=np.int32)
    unknowns: dict[str, np.ndarray] = dict.fromkeys(MIDDLE, every)
    free = np.setdiff1d(every, clamped).astype(np.int32)
    unknowns |= dict.fromkeys(DIRECTORS, free)
    creases = crease_facets(sheet)
    largest = sheet.comm.allreduce(int(count[creases].max(initial=0)), op=MPI.MAX)
    for pair in range(1, largest):
        unknowns |= dict.fromkeys(fold_angle_names(pair), creases[count[creases] > pair])
    return unknowns


def node_dofs(configuration: Configuration) -> np.ndarray:
    """Local unknowns (nc, 6, 3) of the nodes of all local cells: corners, then opposite edges."""
    sheet = configuration.sheet
    corners = 3 * sheet.cells[:, :, None] + np.arange(3)
    return np.concatenate([corners, configuration.middle_dofs(sheet.cell_edges)], axis=1)


@dataclass(frozen=True)
class TiltTable:
    """How the tilts at the six Gauss points of each owned triangle follow from the angles.

    Attributes:
        slot: (n, 6, 2) local scalar index of director and fold angle, -1 where there is none.
        coefficient: (n, 6, 2).
    """

    slot: np.ndarray
    coefficient: np.ndarray

    def tilts(self, scalars: np.ndarray) -> np.ndarray:
        """Share (n, 6) of the angles in the tilts."""
        return (self.coefficient * self.values(scalars)).sum(axis=2)

    def values(self, scalars: np.ndarray) -> np.ndarray:
        """Angles or their increments (n, 6, 2), zero where there is none."""
        if not len(scalars):
            return np.zeros(self.slot.shape)
        return np.where(self.slot >= 0, scalars[np.maximum(self.slot, 0)], 0.0)


def tilt_table(configuration: Configuration, sides: EdgeSides) -> TiltTable:
    """Fill the table in the module's docstring for the owned triangles."""
    sheet = configuration.sheet
    n = 3 * sheet.num_owned_cells
    facet, rank, count = sides.facet[:n], sides.rank[:n], sides.count[:n]
    orientation = np.where(rank == 0, 1, sides.consistent[:n])
    crease = np.isin(facet, crease_facets(sheet))
    slot, coefficient = np.full((n, 2, 2), -1, dtype=np.int32), np.zeros((n, 2, 2))
    along = runs_upward(sheet, n)
    for q in range(2):
        where = np.where(along, q, 1 - q)
        directors = np.stack([configuration.slot(name)[facet] for name in DIRECTORS])
        slot[:, q, 0] = directors[where, np.arange(n)]
        coefficient[:, q, 0] = np.where(rank == 0, -1, orientation)
        for pair in range(1, int(count[crease].max(initial=0))):
            angles = [configuration.slot(name)[facet] for name in fold_angle_names(pair)]
            share = crease & np.where(count == 2, pair == 1, rank == pair)
            slot[share, q, 1] = np.stack(angles)[where, np.arange(n)][share]
            coefficient[share, q, 1] = (-orientation * np.where(count == 2, 0.5, 1.0))[share]
    coefficient[slot < 0] = 0.0
    return TiltTable(slot.reshape(-1, 6, 2), coefficient.reshape(-1, 6, 2))


def runs_upward(sheet: SheetMesh, count: int) -> np.ndarray:
    """Whether sides 0 .. count - 1 run from the lower to the higher input vertex."""
    ends = np.stack([np.roll(sheet.cells, -1, axis=1), np.roll(sheet.cells, -2, axis=1)], axis=-1)
    ids = sheet.input_vertex[ends.reshape(-1, 2)[:count]]
    return ids[:, 0] < ids[:, 1]
