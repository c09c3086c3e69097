"""Distribution of triangles over the ranks, right also where more than two panels meet at an edge.

The cells round an edge of more than two triangles, and those at a vertex where parts of the sheet
touch without a common edge, become one node of the graph that is cut: they share a rank. Every
other edge that the cut crosses gives its two cells to both ranks.
"""

from collections.abc import Callable
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph
from dolfinx import cpp, graph

from ufl_origami.errors import MeshError

GraphPartitioner = Callable[..., object]


@dataclass(frozen=True)
class EdgeTable:
    """Edges of a triangle mesh, numbered in the order of their sorted vertex pairs.

    Attributes:
        triangles: (m, 3) vertices of each triangle.
        vertices: (ne, 2) vertices of each edge, the smaller index first.
        of_triangle: (m, 3) edge opposite to each vertex of each triangle.
        count: (ne,) number of triangles at each edge.
        forward: (m, 3) whether the triangle runs through its edge from the smaller index up.
    """

    triangles: np.ndarray
    vertices: np.ndarray
    of_triangle: np.ndarray
    count: np.ndarray
    forward: np.ndarray

    def side_slots(self) -> np.ndarray:
        """Return (k, 2) places 3 * triangle + local edge on both sides of edges that have two."""
        flat = self.of_triangle.ravel()
        order = np.argsort(flat, kind="stable")
        return order[self.count[flat[order]] == 2].reshape(-1, 2)

    def pairs(self) -> np.ndarray:
        """Return (k, 2) triangles on the two sides of the edges that have exactly two."""
        return self.side_slots() // 3

    def find(self, pairs: np.ndarray) -> np.ndarray:
        """Return the edge of each vertex pair (k, 2), -1 where the pair is no edge."""
        if len(pairs) == 0 or len(self.vertices) == 0:
            return np.full(len(pairs), -1)
        base = 1 + max(int(self.vertices.max()), int(np.max(pairs)))
        keys = pair_keys(self.vertices, base)
        wanted = pair_keys(pairs, base)
        at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[at] == wanted, at, -1)


def pair_keys(pairs: np.ndarray, base: int) -> np.ndarray:
    """Return one integer per vertex pair (k, 2), the same for both directions (indices < base)."""
    pairs = np.asarray(pairs, dtype=np.int64)
    return pairs.min(axis=-1) * base + pairs.max(axis=-1)


def edge_table(triangles: np.ndarray) -> EdgeTable:
    """Return the edges of the triangles (m, 3)."""
    triangles = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
    base = 1 + int(triangles.max(initial=-1))
    start, end = triangles[:, [1, 2, 0]], triangles[:, [2, 0, 1]]
    keys = pair_keys(np.stack([start, end], axis=-1).reshape(-1, 2), max(base, 1))
    unique, inverse, count = np.unique(keys, return_inverse=True, return_counts=True)
    vertices = np.stack(np.divmod(unique, max(base, 1)), axis=1)
    return EdgeTable(triangles, vertices, inverse.reshape(-1, 3), count, start < end)


def pinched_vertices(table: EdgeTable) -> np.ndarray:
    """Return the vertices whose triangles fall in parts that have no edge at the vertex in common.

    dolfinx would number such a vertex twice if the parts were on two ranks.
    """
    corners = 3 * len(table.triangles)
    corner = np.repeat(np.arange(corners), 2)
    edge = table.of_triangle[:, [1, 2, 2, 0, 0, 1]].ravel()
    vertex = table.triangles.ravel()
    half_edge = 2 * edge + (table.vertices[edge, 1] == vertex[corner])
    label = _components(corner, corners + half_edge, corners + 2 * len(table.count))[:corners]
    fans = np.unique(np.stack([vertex, label], axis=1), axis=0)[:, 0]
    return np.flatnonzero(np.bincount(fans) > 1)


def merge_cells(table: EdgeTable) -> tuple[int, np.ndarray]:
    """Return the number of groups and the group of each cell.

    Cells that share an edge of more than two triangles or a pinched vertex are in one group.
    """
    cells, ne = table.of_triangle.shape[0], len(table.count)
    crowded = np.flatnonzero(table.count[table.of_triangle.ravel()] > 2)
    pinched = np.flatnonzero(np.isin(table.triangles.ravel(), pinched_vertices(table)))
    hub = np.concatenate(
        [table.of_triangle.ravel()[crowded], ne + table.triangles.ravel()[pinched]]
    )
    size = cells + ne + 1 + int(table.triangles.max(initial=-1))
    label = _components(np.concatenate([crowded, pinched]) // 3, cells + hub, size)[:cells]
    unique, group = np.unique(label, return_inverse=True)
    return len(unique), group


def _components(start: np.ndarray, end: np.ndarray, size: int) -> np.ndarray:
    """Return the connected component (size,) of each node of a graph with links start-end."""
    links = scipy.sparse.coo_array((np.ones(len(start), dtype=np.int8), (start, end)), (size, size))
    return scipy.sparse.csgraph.connected_components(links, directed=False)[1]


def cut(groups: int, pairs: np.ndarray, nparts: int, partitioner: GraphPartitioner) -> np.ndarray:
    """Return the part of each group; pairs (k, 2) are the links of the graph."""
    if groups <= nparts:
        return np.arange(groups, dtype=np.int32)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    both = np.concatenate([pairs, pairs[:, ::-1]])
    links = scipy.sparse.coo_array((np.ones(len(both)), both.T), shape=(groups, groups)).tocsr()
    data = links.indices.astype(np.int64)
    dual = graph.adjacencylist(data, links.indptr.astype(np.int32))
    owner = partitioner(MPI.COMM_SELF, nparts, dual, False).array  # type: ignore[attr-defined]
    return np.asarray(owner, dtype=np.int32)


def destinations(
    table: EdgeTable, nparts: int, partitioner: GraphPartitioner | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the ranks of each cell, its owner first, as (data, offsets).

    A cell is also sent to the owners of its edge neighbours (shared-facet halo).

    Args:
        table: edges of the whole mesh.
        nparts: number of ranks.
        partitioner: graph partitioner with dolfinx's signature (comm, number of parts, graph,
            ghosting) that returns the part of each node; default ``dolfinx.graph.partitioner()``.
            It runs on one rank alone.

    Raises:
        MeshError: when the partitioner names a rank that does not exist.
    """
    chosen = graph.partitioner() if partitioner is None else partitioner
    pairs = table.pairs()
    groups, group = merge_cells(table)
    owner = cut(groups, group[pairs], nparts, chosen)[group]
    if len(owner) and not (0 <= owner.min() and owner.max() < nparts):
        raise MeshError(f"the graph partitioner named a rank outside 0..{nparts - 1}")
    split = pairs[owner[pairs[:, 0]] != owner[pairs[:, 1]]]
    both = np.concatenate([split, split[:, ::-1]]).astype(np.int64)
    ghost = np.unique(both[:, 0] * nparts + owner[both[:, 1]])
    cell = np.concatenate([np.arange(len(owner)), ghost // nparts])
    rank = np.concatenate([owner, ghost % nparts])
    order = np.argsort(cell, kind="stable")
    counts = np.bincount(cell, minlength=len(owner))
    return rank[order].astype(np.int32), np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)


def cell_partitioner(data: np.ndarray, offsets: np.ndarray) -> Callable[..., object]:
    """Return a cell partitioner for ``dolfinx.mesh.create_mesh`` that sends cells as listed.

    Args:
        data: ranks of this rank's input cells, for each cell its owner first, then its ghosts.
        offsets: start of each cell's ranks in data.
    """
    return lambda *_: cpp.graph.AdjacencyList_int32(data, offsets)
