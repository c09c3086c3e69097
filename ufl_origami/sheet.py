"""Triangle mesh of all panels with named panels, creases, edges and points, on any number of ranks.

The triangles keep the orientation of the input. Tags are carried by the input's numbering, never by
coordinates: panels may coincide in space.
"""

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

from mpi4py import MPI

import basix.ufl
import numpy as np
import numpy.typing as npt
from dolfinx import cpp, fem, graph, mesh

from ufl_origami import mesh_checks
from ufl_origami.collective import on_rank0
from ufl_origami.errors import InputError, MeshError
from ufl_origami.partition import (
    EdgeTable,
    GraphPartitioner,
    cell_partitioner,
    destinations,
    edge_table,
    pair_keys,
)

Surface = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class SheetMesh:
    """Mesh of the sheet and its names, seen from one rank.

    Local numbers: vertices are the block dofs of V (owned, then ghosts), cells and facets are
    dolfinx's (owned, then ghosts). Every triangle at the edge of an owned cell is on this rank, and
    all triangles at an edge of more than two panels are owned by one rank.

    Attributes:
        mesh: triangles in 3D, P1 geometry in the rest state, shared-facet ghosts.
        V: Lagrange 1 space of shape (3,).
        rest: (nv, 3) rest coordinates.
        cells: (nc, 3) vertices of each cell in the input's order.
        cell_edges: (nc, 3) facet opposite to each vertex.
        cell_panel: (nc,) panel of each cell.
        num_owned_cells: cells 0..num_owned_cells-1 are owned by this rank.
        panel_names: names of the panels.
        edges: name -> sorted local facets, owned and ghosts; the same names on all ranks.
        creases: the names in edges that are creases.
        points: name -> local vertex, -1 where this rank does not have it.
        input_vertex: (nv,) index of each vertex in the input.
        input_cell: (nc,) index of each cell in the input.
        surface: takes points (n, 3) near a curved rest surface onto it; None: the triangles are the
            rest surface. Models of second order place the edges' midpoints by it.
    """

    mesh: mesh.Mesh
    V: fem.FunctionSpace
    rest: np.ndarray
    cells: np.ndarray
    cell_edges: np.ndarray
    cell_panel: np.ndarray
    num_owned_cells: int
    panel_names: tuple[str, ...]
    edges: dict[str, np.ndarray]
    creases: tuple[str, ...]
    points: dict[str, int]
    input_vertex: np.ndarray
    input_cell: np.ndarray
    surface: Surface | None = None

    @property
    def comm(self) -> MPI.Comm:
        """Communicator of the mesh."""
        return self.mesh.comm

    @property
    def num_owned_vertices(self) -> int:
        """Number of vertices that this rank owns."""
        return self.V.dofmap.index_map.size_local

    @property
    def num_vertices_global(self) -> int:
        """Number of vertices on all ranks."""
        return self.V.dofmap.index_map.size_global

    @property
    def num_cells_global(self) -> int:
        """Number of triangles on all ranks."""
        return self.mesh.topology.index_map(2).size_global

    @property
    def num_owned_edges(self) -> int:
        """Number of facets that this rank owns."""
        return self.mesh.topology.index_map(1).size_local

    def edge_cells(self) -> cpp.graph.AdjacencyList_int32:
        """Return facet -> local cells, ordered by panel, then by input index."""
        cell, facet = self._sorted_incidence()
        counts = np.bincount(facet, minlength=self._num_local_edges)
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        return graph.adjacencylist((cell // 3).astype(np.int32), offsets)

    def edge_vertices(self) -> np.ndarray:
        """Return (nf, 2) vertices of each facet, directed as in its first cell (edge_cells)."""
        slot, facet = self._sorted_incidence()
        _, first = np.unique(facet, return_index=True)
        cell, e = np.divmod(slot[first], 3)
        return np.stack([self.cells[cell, (e + 1) % 3], self.cells[cell, (e + 2) % 3]], axis=1)

    def edge_middles(self) -> np.ndarray:
        """Return the rest position (nf, 3) of each facet's midpoint, on the rest surface."""
        middle = self.rest[self.edge_vertices()].mean(axis=1)
        return self.surface(middle) if self.surface else middle

    def panel_cells(self, name: str) -> np.ndarray:
        """Return the local cells of a panel.

        Raises:
            InputError: when no panel has this name.
        """
        panel = self.panel_names.index(known_name(name, self.panel_names, "panel"))
        return np.flatnonzero(self.cell_panel == panel).astype(np.int32)

    def edge_facets(self, name: str) -> np.ndarray:
        """Return the local facets of a named edge set.

        Raises:
            InputError: when no edge set has this name.
        """
        return self.edges[known_name(name, self.edges, "edge set")]

    def point_vertex(self, name: str) -> int:
        """Return the local vertex of a named point, -1 where this rank does not have it.

        Raises:
            InputError: when no point has this name.
        """
        return self.points[known_name(name, self.points, "point")]

    @property
    def _num_local_edges(self) -> int:
        edge_map = self.mesh.topology.index_map(1)
        return edge_map.size_local + edge_map.num_ghosts

    def _sorted_incidence(self) -> tuple[np.ndarray, np.ndarray]:
        """Return places 3 * cell + local edge and their facets, by facet, panel, input cell."""
        facet = self.cell_edges.ravel()
        cell = np.arange(len(facet)) // 3
        order = np.lexsort((self.input_cell[cell], self.cell_panel[cell], facet))
        return order, facet[order]


@dataclass(frozen=True)
class _Tags:
    """Names of the input in the input's numbering, small enough for every rank."""

    base: int
    num_edges: int
    panel: np.ndarray
    panel_names: tuple[str, ...]
    edges: dict[str, np.ndarray]
    creases: tuple[str, ...]
    points: dict[str, int]


@dataclass(frozen=True)
class _Input:
    """Checked input on rank 0; the other ranks hold no vertex and no triangle."""

    vertices: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    triangles: np.ndarray = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))
    ranks: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int32))
    offsets: np.ndarray = field(default_factory=lambda: np.zeros(1, dtype=np.int32))
    tags: _Tags | None = None


def sheet_from_arrays(
    comm: MPI.Comm,
    vertices: np.ndarray | None,
    triangles: np.ndarray | None,
    *,
    panel: np.ndarray | None = None,
    panel_names: Iterable[str] | None = None,
    edges: Mapping[str, npt.ArrayLike] | None = None,
    creases: Iterable[str] = (),
    points: Mapping[str, int] | None = None,
    partitioner: GraphPartitioner | None = None,
    surface: Surface | None = None,
) -> SheetMesh:
    """Build the sheet from vertices and triangles.

    Collective; the arrays and names are read on rank 0, other ranks may pass None.

    Args:
        comm: communicator.
        vertices: (n, 3) rest coordinates.
        triangles: (m, 3) vertices of each triangle, oriented as the panel.
        panel: (m,) panel of each triangle, default all 0.
        panel_names: default "panel0", "panel1", ...
        edges: name -> (k, 2) vertex pairs. The set "boundary", all edges of one triangle, is added
            when the name is free.
        creases: the names in edges that are creases.
        points: name -> vertex.
        partitioner: graph partitioner, see :func:`ufl_origami.partition.destinations`.
        surface: see :class:`SheetMesh`; given on all ranks.

    Raises:
        MeshError: on all ranks, when the arrays are no sheet: not finite, degenerate or inverted
            triangle, unused vertex, pair that is no edge, open crease, panel oriented two ways,
            more than two triangles at an edge that is no crease.
    """

    def prepare() -> _Input:
        names = _Names(panel, panel_names, edges or {}, creases, points or {})
        return _checked_input(comm.size, vertices, triangles, names, partitioner)

    given = on_rank0(comm, prepare) or _Input()
    tags = comm.bcast(given.tags, root=0)
    return replace(_distribute(comm, given, tags), surface=surface)


@dataclass(frozen=True)
class _Names:
    """Names as the user gave them."""

    panel: np.ndarray | None
    panel_names: Iterable[str] | None
    edges: Mapping[str, npt.ArrayLike]
    creases: Iterable[str]
    points: Mapping[str, int]

    def panels(self, num_cells: int) -> tuple[np.ndarray, tuple[str, ...]]:
        """Return the panel of each triangle and the panels' names."""
        panel = np.zeros(num_cells) if self.panel is None else np.asarray(self.panel)
        panel = panel.astype(np.int32)
        if self.panel_names is not None:
            return panel, tuple(self.panel_names)
        return panel, tuple(f"panel{i}" for i in range(1 + panel.max(initial=-1)))


def _checked_input(nparts: int, vertices, triangles, names: _Names, partitioner) -> _Input:
    x = np.ascontiguousarray(vertices, dtype=np.float64)
    cells = np.ascontiguousarray(triangles, dtype=np.int64)
    panel, panel_names = names.panels(len(cells))
    mesh_checks.check_arrays(x, cells, panel, panel_names)
    mesh_checks.check_shapes(x, cells)
    table = edge_table(cells)
    pairs = {k: np.asarray(v, dtype=np.int64).reshape(-1, 2) for k, v in names.edges.items()}
    points = {k: int(v) for k, v in names.points.items()}
    index = mesh_checks.check_tags(table, len(x), pairs, points)
    creases = tuple(names.creases)
    mesh_checks.check_interior(x, cells, table, mesh_checks.check_creases(table, index, creases))
    index.setdefault("boundary", np.flatnonzero(table.count == 1))
    keys = {k: pair_keys(table.vertices[v], len(x)) for k, v in index.items()}
    tags = _Tags(len(x), len(table.count), panel, panel_names, keys, creases, points)
    ranks, offsets = _ranks(table, nparts, partitioner)
    return _Input(x, cells, ranks, offsets, tags)


def _ranks(table: EdgeTable, nparts: int, partitioner) -> tuple[np.ndarray, np.ndarray]:
    """Return (data, offsets) of the cells' ranks; one rank needs no cut."""
    if nparts > 1:
        return destinations(table, nparts, partitioner)
    cells = len(table.of_triangle)
    return np.zeros(cells, dtype=np.int32), np.arange(cells + 1, dtype=np.int32)


def _distribute(comm: MPI.Comm, given: _Input, tags: _Tags) -> SheetMesh:
    element = basix.ufl.element("Lagrange", "triangle", 1, shape=(3,))
    send = cell_partitioner(given.ranks, given.offsets)
    msh = mesh.create_mesh(comm, given.triangles, given.vertices, element, send)
    msh.topology.create_connectivity(2, 1)
    msh.topology.create_connectivity(1, 2)
    V = fem.functionspace(msh, ("Lagrange", 1, (3,)))
    _check_numbering(V, tags)
    cells = np.array(V.dofmap.list, dtype=np.int32)
    vertex_map = V.dofmap.index_map
    node = np.empty(vertex_map.size_local + vertex_map.num_ghosts, dtype=np.int64)
    node[cells.ravel()] = msh.geometry.dofmap.ravel()
    input_vertex = np.asarray(msh.geometry.input_global_indices)[node]
    input_cell = np.asarray(msh.topology.original_cell_index)
    cell_edges = msh.topology.connectivity(2, 1).array.reshape(-1, 3).astype(np.int32)
    return SheetMesh(
        mesh=msh,
        V=V,
        rest=msh.geometry.x[node].copy(),
        cells=cells,
        cell_edges=cell_edges,
        cell_panel=tags.panel[input_cell],
        num_owned_cells=msh.topology.index_map(2).size_local,
        panel_names=tags.panel_names,
        edges=_local_edges(tags, input_vertex[cells], cell_edges),
        creases=tags.creases,
        points=_local_points(tags, input_vertex),
        input_vertex=input_vertex,
        input_cell=input_cell,
    )


def _check_numbering(V: fem.FunctionSpace, tags: _Tags) -> None:
    """Check that no vertex and no edge was numbered twice when the mesh was split."""
    vertices = V.dofmap.index_map.size_global
    edges = V.mesh.topology.index_map(1).size_global
    if (vertices, edges) != (tags.base, tags.num_edges):
        raise MeshError(
            f"the split mesh has {vertices} vertices and {edges} edges, the input {tags.base} and"
            f" {tags.num_edges}: this partition cannot be numbered"
        )


def _local_edges(tags: _Tags, corners: np.ndarray, cell_edges: np.ndarray) -> dict[str, np.ndarray]:
    """Return the local facets of each named set; corners (nc, 3) are input vertices."""
    ends = np.stack([corners[:, [1, 2, 0]], corners[:, [2, 0, 1]]], axis=-1)
    facets, first = np.unique(cell_edges, return_index=True)
    keys = pair_keys(ends, tags.base).ravel()[first]
    return {
        name: facets[np.isin(keys, wanted)].astype(np.int32) for name, wanted in tags.edges.items()
    }


def _local_points(tags: _Tags, input_vertex: np.ndarray) -> dict[str, int]:
    here = np.flatnonzero(np.isin(input_vertex, list(tags.points.values())))
    local = {int(input_vertex[i]): int(i) for i in here}
    return {name: local.get(vertex, -1) for name, vertex in tags.points.items()}


def known_name(
    name: str, names: Iterable[str], kind: str, error: type[InputError] = InputError
) -> str:
    """Return the name.

    Raises:
        InputError: (or the class given) when it is none of the names, with close ones.
    """
    names = list(names)
    if name in names:
        return name
    close = difflib.get_close_matches(name, names) or sorted(names)
    raise error(f"no {kind} is named {name!r}; did you mean {', '.join(map(repr, close))}?")
