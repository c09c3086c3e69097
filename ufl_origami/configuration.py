"""Unknowns of a sheet and their numbering: 3 displacements a vertex, named scalars on edges.

Displacements of the edges' midpoints, where a model has them, are three of these scalars.

Each rank owns the contiguous range [3 x owned vertices | owned edge scalars] of the global
vector. Locally the order is [3 x (owned, ghost) vertices | (owned, ghost) scalars], so that the
first part is the array of a P1 vector function and any UFL form over it can be added as it is.
"""

from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from dolfinx import la

from ufl_origami.sheet import SheetMesh


def spread(index_map, values: np.ndarray) -> np.ndarray:
    """Copy owned integer values (n_owned,) to the ghosts of an index map: (n_local,) int64."""
    vector = la.vector(index_map, 1, dtype=np.int64)
    vector.array[: index_map.size_local] = values
    vector.scatter_forward()
    return vector.array.copy()


def gather_marks(index_map, local: np.ndarray) -> np.ndarray:
    """Sorted local indices of what any rank marks in an index map, ghosts included; collective.

    A rank may own a vertex of a named edge without having a triangle at that edge.
    """
    marks = la.vector(index_map, 1, dtype=np.int64)
    marks.array[:] = 0
    marks.array[local] = 1
    marks.scatter_reverse(la.InsertMode.add)
    marks.scatter_forward()
    return np.flatnonzero(marks.array)


def cells_per_edge(sheet: SheetMesh) -> np.ndarray:
    """Number of triangles at each local facet (nf,), as its owner counts them."""
    facet_map = sheet.mesh.topology.index_map(1)
    counts = np.diff(sheet.edge_cells().offsets)
    return spread(facet_map, counts[: facet_map.size_local])


@dataclass
class State:
    """Local values of all unknowns (owned and ghosts) at one load factor or time.

    Attributes:
        q: (3 nv + ns,) displacements, then edge scalars (radians).
        x: (nv, 3) current positions.
        time: load factor or time.
    """

    q: np.ndarray
    x: np.ndarray
    time: float

    @property
    def scalars(self) -> np.ndarray:
        """Edge unknowns (ns,): virtual fold angles and directors, radians."""
        return self.q[3 * len(self.x) :]

    def moved(self, step: np.ndarray) -> "State":
        """State after an increment (3 nv + ns,) of the unknowns, at the same time."""
        nodes = step[: 3 * len(self.x)].reshape(-1, 3)
        return State(self.q + step, self.x + nodes, self.time)


MIDDLE = ("middle_x", "middle_y", "middle_z")
"""Edge unknowns that are the displacement of the edge's midpoint, in models of second order."""


class Configuration:
    """Numbering of the unknowns of one scene over the ranks.

    Args:
        sheet: the meshed sheet.
        edge_unknowns: name -> local facets (owned and ghosts) that carry one scalar each.
    """

    def __init__(self, sheet: SheetMesh, edge_unknowns: dict[str, np.ndarray]):
        self.sheet = sheet
        self.comm = sheet.comm
        vertex_map = sheet.V.dofmap.index_map
        self.nv, self.nv_owned = len(sheet.rest), vertex_map.size_local
        self._slots, self.ns, self.ns_owned = self._number_scalars(edge_unknowns)
        self.size_local = 3 * self.nv_owned + self.ns_owned
        self.num_local = 3 * self.nv + self.ns
        sizes = self.comm.allgather(self.size_local)
        self.offset = sum(sizes[: self.comm.rank])
        self.size_global = sum(sizes)
        self.global_ids = self._global_ids(vertex_map).astype(PETSc.IntType)
        self._set_up_scatter()

    def _number_scalars(self, edge_unknowns):
        """Local scalar index of each unknown on each local facet (-1: none), and the counts."""
        facet_map = self.sheet.mesh.topology.index_map(1)
        num_facets = facet_map.size_local + facet_map.num_ghosts
        slots = {name: np.full(num_facets, -1, dtype=np.int32) for name in edge_unknowns}
        count = 0
        for ghosts in (False, True):
            for name, facets in edge_unknowns.items():
                part = facets[(facets >= facet_map.size_local) == ghosts]
                slots[name][part] = np.arange(count, count + len(part), dtype=np.int32)
                count += len(part)
            if not ghosts:
                owned = count
        return slots, count, owned

    def _global_ids(self, vertex_map) -> np.ndarray:
        """Global index of each local unknown (num_local,)."""
        first = spread(vertex_map, self.offset + 3 * np.arange(self.nv_owned))
        ids = np.empty(self.num_local, dtype=np.int64)
        ids[: 3 * self.nv] = (first[:, None] + np.arange(3)).ravel()
        facet_map = self.sheet.mesh.topology.index_map(1)
        base = self.offset + 3 * self.nv_owned
        for slot in self._slots.values():
            ids_of_facets = spread(facet_map, base + slot[: facet_map.size_local])
            ids[3 * self.nv + slot[slot >= 0]] = ids_of_facets[slot >= 0]
        return ids

    def _set_up_scatter(self) -> None:
        self.lgmap = PETSc.LGMap().create(self.global_ids, comm=self.comm)
        self._local = PETSc.Vec().createSeq(self.num_local)
        source = PETSc.IS().createGeneral(self.global_ids, comm=PETSc.COMM_SELF)
        self._scatter = PETSc.Scatter().create(self.create_vector(), source, self._local, None)

    def create_vector(self) -> PETSc.Vec:
        """Global vector of the unknowns, zero."""
        vector = PETSc.Vec().createMPI((self.size_local, PETSc.DETERMINE), comm=self.comm)
        vector.setLGMap(self.lgmap)
        return vector

    def slot(self, name: str) -> np.ndarray:
        """Local scalar index of the named unknown on each local facet, -1 where there is none."""
        return self._slots[name]

    @property
    def edge_unknowns(self) -> tuple[str, ...]:
        """Names of the edge unknowns, in the order of their numbering."""
        return tuple(self._slots)

    @property
    def has_midpoints(self) -> bool:
        """Whether the edges' midpoints move on their own."""
        return MIDDLE[0] in self._slots

    def middle_dofs(self, facets: np.ndarray) -> np.ndarray:
        """Local unknowns (..., 3) of the midpoints of local facets (...,)."""
        slots = [self.slot(name)[facets] for name in MIDDLE]
        return 3 * self.nv + np.stack(slots, axis=-1)

    def to_local(self, vector: PETSc.Vec) -> np.ndarray:
        """Owned and ghost values (num_local,) of a global vector."""
        self._scatter.scatter(vector, self._local, addv=PETSc.InsertMode.INSERT)
        return self._local.array_r.copy()

    def add_to_global(self, values: np.ndarray, vector: PETSc.Vec) -> None:
        """Add local contributions (num_local,), ghosts included, into a global vector."""
        self._local.array_w[:] = values
        self._scatter.scatter(
            self._local, vector, addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE
        )

    def state(self, vector: PETSc.Vec, time: float) -> State:
        """Local view of a global vector of unknowns."""
        q = self.to_local(vector)
        return State(q, self.sheet.rest + q[: 3 * self.nv].reshape(-1, 3), time)

    def owns(self, local: np.ndarray) -> np.ndarray:
        """Whether this rank owns each of some local unknowns, an array of their shape."""
        owned = self.global_ids[local] - self.offset
        return (owned >= 0) & (owned < self.size_local)

    def owned_dofs(self, local: np.ndarray) -> np.ndarray:
        """Positions in the owned part of the global vector of those local unknowns it owns."""
        local = np.asarray(local, dtype=np.int64)
        owned = self.global_ids[local] - self.offset
        return owned[(owned >= 0) & (owned < self.size_local)]

    def sum(self, values) -> np.ndarray:
        """Sum of per-rank numbers over the ranks."""
        return self.comm.allreduce(np.asarray(values, dtype=float), op=MPI.SUM)
