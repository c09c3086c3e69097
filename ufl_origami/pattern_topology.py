"""Which faces meet at which edge, face normals and fold angles, for polygons given by loops.

Plain arrays only. A *corner* is one entry of one face loop; corner c of face f stands for its
vertex and for the edge from that vertex to the next one of the loop. All loops are stored one
after the other, so that nothing here loops over faces.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]


def pair_index(pairs: npt.ArrayLike, edges: npt.ArrayLike) -> Ints:
    """Return the index in `edges` of each vertex pair, in either direction; -1 where none.

    Args:
        pairs: (k, 2) vertex pairs.
        edges: (m, 2) vertex pairs without duplicates.
    """
    wanted = np.sort(np.asarray(pairs, dtype=np.int64).reshape(-1, 2), axis=1)
    known = np.sort(np.asarray(edges, dtype=np.int64).reshape(-1, 2), axis=1)
    if not len(known) or not len(wanted):
        return np.full(len(wanted), -1)
    base = int(max(wanted.max(), known.max())) + 1
    keys, targets = known @ [base, 1], wanted @ [base, 1]
    order = np.argsort(keys)
    at = np.minimum(np.searchsorted(keys[order], targets), len(keys) - 1)
    return np.where(keys[order][at] == targets, order[at], -1)


@dataclass(frozen=True)
class Corners:
    """The face loops, stored one after the other.

    Attributes:
        start: (f + 1,) first corner of each face, and the number of corners.
        vertex: (c,) vertex of each corner.
        following: (c,) vertex that follows in the loop.
        face: (c,) face of each corner.
    """

    start: Ints
    vertex: Ints
    following: Ints
    face: Ints

    @classmethod
    def from_loops(cls, faces: Sequence[Sequence[int]]) -> "Corners":
        """Store loops of vertex indices."""
        sizes = np.array([len(loop) for loop in faces], dtype=np.int64)
        start = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        vertex = np.array([v for loop in faces for v in loop], dtype=np.int64)
        successor = np.arange(1, len(vertex) + 1)
        filled = sizes > 0
        successor[start[1:][filled] - 1] = start[:-1][filled]
        return cls(start, vertex, vertex[successor], np.repeat(np.arange(len(sizes)), sizes))

    @property
    def pairs(self) -> Ints:
        """(c, 2) the vertex pair of each corner's edge, in the direction of the loop."""
        return np.stack([self.vertex, self.following], axis=1)

    @property
    def num_faces(self) -> int:
        """Number of faces."""
        return len(self.start) - 1


@dataclass(frozen=True)
class Incidence:
    """Faces round each edge.

    Attributes:
        edge: (c,) edge of each corner.
        forward: (c,) True where the face's loop runs along the edge as the edge is given.
        start: (m + 1,) offsets into `order`, an edge each.
        order: (c,) corners sorted by edge, within an edge by face.
    """

    edge: Ints
    forward: npt.NDArray[np.bool_]
    start: Ints
    order: Ints

    @classmethod
    def build(cls, corners: Corners, edges: Ints) -> "Incidence":
        """Match corners to edges; every corner must have its edge."""
        edge = pair_index(corners.pairs, edges)
        count = np.bincount(edge, minlength=len(edges))
        start = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
        forward = edges[edge, 0] == corners.vertex
        return cls(edge, forward, start, np.argsort(edge, kind="stable"))

    @property
    def num_faces(self) -> Ints:
        """(m,) number of faces at each edge."""
        return np.diff(self.start)

    def corners_of(self, edge: int) -> Ints:
        """Corners that lie on one edge, by ascending face."""
        return self.order[self.start[edge] : self.start[edge + 1]]

    def two_sided(self) -> tuple[Ints, Ints, Ints]:
        """Edges with exactly two faces, and their first and second corner."""
        edges = np.flatnonzero(self.num_faces == 2)
        first = self.start[edges]
        return edges, self.order[first], self.order[first + 1]


def area_vectors(points: Floats, corners: Corners) -> Floats:
    """Vector area of each face by Newell's sum: (f, 3), along the normal, long as the area."""
    origin = points[corners.vertex[corners.start[:-1]]][corners.face]
    terms = np.cross(points[corners.vertex] - origin, points[corners.following] - origin)
    sums = np.zeros((corners.num_faces, 3))
    np.add.at(sums, corners.face, 0.5 * terms)
    return sums


def hinge_angle(normal1: Floats, normal2: Floats, direction: Floats) -> Floats:
    """Signed angle of two faces at an edge: 0 flat, positive in a valley; radians in [-pi, pi].

    theta = atan2((n2 x n1) . e, n1 . n2) with e along the edge as face 1 runs through it and n2
    oriented so that face 2 runs the other way. Lengths of the normals cancel.

    Args:
        normal1: (k, 3) normals of the first faces.
        normal2: (k, 3) normals of the second faces.
        direction: (k, 3) edge vectors in the first faces' orientation, any length.
    """
    e = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    sine = np.einsum("...i,...i", np.cross(normal2, normal1), e)
    return np.arctan2(sine, np.einsum("...i,...i", normal1, normal2))


def join_faces(num_faces: int, links: Ints) -> Ints:
    """Group index of each face when the faces of each (k, 2) link belong together.

    Groups are numbered by their lowest face.
    """
    links = np.asarray(links, dtype=np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(links)), links.T), shape=(num_faces, num_faces))
    label = connected_components(graph, directed=False)[1]
    _, first, group = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[group]


def edges_of(corners: Corners) -> Ints:
    """(m, 2) the edges that face loops run through, in order of first appearance."""
    pairs = corners.pairs
    _, first = np.unique(np.sort(pairs, axis=1), axis=0, return_index=True)
    return pairs[np.sort(first)]


def corner_angles(
    points: Floats, corners: Corners, incidence: Incidence, first: Ints, second: Ints
) -> Floats:
    """Fold angle (radians) from the faces of the first to those of the second corners.

    Each two corners must lie on one edge; the second face is taken in the orientation that
    continues the first one across that edge.
    """
    areas = area_vectors(points, corners)
    normals = areas / np.linalg.norm(areas, axis=1, keepdims=True)
    along = points[corners.following[first]] - points[corners.vertex[first]]
    turn = np.where(incidence.forward[first] == incidence.forward[second], -1.0, 1.0)
    other = turn[:, None] * normals[corners.face[second]]
    return hinge_angle(normals[corners.face[first]], other, along)


def edge_angles(points: Floats, corners: Corners, incidence: Incidence) -> Floats:
    """Fold angle (radians) of each edge (m,), NaN where not two faces meet."""
    edges, first, second = incidence.two_sided()
    angles = np.full(len(incidence.num_faces), np.nan)
    angles[edges] = corner_angles(points, corners, incidence, first, second)
    return angles
