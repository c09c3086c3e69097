"""A distributed model's arrays on rank 0, in the order of the input: for figures and tables."""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from ufl_origami.model import FoldAngles, Model, place_vertices


@dataclass(frozen=True)
class Shape:
    """A sheet's current shape, as the pictures of `plotting` take it.

    Attributes:
        points: vertices (n, 3).
        triangles: vertex indices (m, 3).
        crease_edges: vertex pairs (k, 2).
    """

    points: np.ndarray
    triangles: np.ndarray
    crease_edges: np.ndarray


def gather_rows(comm: MPI.Comm, rows: np.ndarray) -> np.ndarray | None:
    """Rows of all ranks, one rank after the other, on rank 0; None on the others. Collective."""
    parts = comm.gather(rows)
    return None if parts is None else np.concatenate(parts)


def gather_sheet(model: Model) -> Shape | None:
    """Current shape with its creases, ready to draw, on rank 0; collective."""
    sheet = model.sheet
    n, nc, ne = sheet.num_owned_vertices, sheet.num_owned_cells, sheet.num_owned_edges
    facets = [f[f < ne] for f in (sheet.edge_facets(name) for name in sheet.creases)]
    ends = sheet.edge_vertices()[np.concatenate([np.zeros(0, dtype=int), *facets])]
    places = gather_rows(sheet.comm, sheet.input_vertex[:n])
    points = gather_rows(sheet.comm, model.state.x[:n])
    triangles = gather_rows(sheet.comm, sheet.input_vertex[sheet.cells[:nc]])
    creases = gather_rows(sheet.comm, sheet.input_vertex[ends])
    if places is None or points is None or triangles is None or creases is None:
        return None
    ordered = np.empty_like(points)
    ordered[places] = points
    return Shape(ordered, triangles, creases)


def gather_profile(model: Model, name: str) -> tuple[np.ndarray, np.ndarray] | None:
    """Rest and current positions (n, 3) of an edge set's vertices on rank 0; collective.

    The vertices are ordered by their rest coordinates x, then y, then z.
    """
    vertices = place_vertices(model.sheet, name)
    vertices = vertices[vertices < model.sheet.num_owned_vertices]
    rest = gather_rows(model.sheet.comm, model.sheet.rest[vertices])
    current = gather_rows(model.sheet.comm, model.state.x[vertices])
    if rest is None or current is None:
        return None
    order = _by_position(rest)
    return rest[order], current[order]


def gather_fold_angles(model: Model, crease: str) -> FoldAngles:
    """Fold angles of all edges of a crease on all ranks, ordered by position; collective."""
    mine = model.fold_angles(crease)
    columns = np.column_stack([mine.middle, mine.length, mine.virtual, mine.mesh])
    every = np.concatenate(model.sheet.comm.allgather(columns))
    every = every[_by_position(every[:, :3])]
    return FoldAngles(every[:, :3], every[:, 3], every[:, 4], every[:, 5])


def _by_position(points: np.ndarray) -> np.ndarray:
    """Order of points (n, 3) by x, then y, then z, blind to round-off."""
    extent = np.ptp(points, axis=0).max(initial=0.0) or 1.0
    return np.lexsort(np.round(points / extent, 9).T[::-1])
