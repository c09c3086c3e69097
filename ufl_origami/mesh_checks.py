"""Checks of a triangle mesh given as arrays: everything that no model could carry is an error."""

from collections.abc import Iterable, Mapping

import numpy as np

from ufl_origami.errors import MeshError
from ufl_origami.partition import EdgeTable

#: Least ratio of a triangle's smallest altitude to its longest edge that is not degenerate.
DEGENERATE = 1e-8
#: Triangles of one panel whose normals make an angle with a cosine below this fold over.
FOLDED_OVER = -0.5


def triangle_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the cross products (m, 3), twice the area long, of the triangles' edges."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def altitude_ratios(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return smallest altitude / longest edge (m,) of the triangles, 0.866 when equilateral."""
    corners = vertices[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    twice_area = np.linalg.norm(triangle_normals(vertices, triangles), axis=1)
    safe = np.where(longest > 0.0, longest, 1.0)
    return np.where(longest > 0.0, twice_area / safe**2, 0.0)


def check_arrays(vertices: np.ndarray, triangles: np.ndarray, panel: np.ndarray, names) -> None:
    """Check shapes, finite coordinates, index ranges, panel indices and unused vertices."""
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise MeshError(f"vertices must have the shape (n, 3), got {vertices.shape}")
    if triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) == 0:
        raise MeshError(f"triangles must have the shape (m, 3) with m > 0, got {triangles.shape}")
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        raise MeshError(f"vertex {bad[0]} has coordinates {vertices[bad[0]]}")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        row = np.flatnonzero(((triangles < 0) | (triangles >= len(vertices))).any(axis=1))[0]
        raise MeshError(f"triangle {row} {triangles[row]} names a vertex outside 0..n-1")
    unused = np.setdiff1d(np.arange(len(vertices)), triangles)
    if len(unused):
        raise MeshError(f"{len(unused)} vertices are in no triangle, the first is {unused[0]}")
    if panel.shape != (len(triangles),):
        raise MeshError(f"panel must have the shape ({len(triangles)},), got {panel.shape}")
    if panel.min() < 0 or panel.max() >= len(names):
        raise MeshError(f"panel indices {panel.min()}..{panel.max()} with {len(names)} panel names")
    if len(set(names)) < len(names):
        raise MeshError(f"panel names are not unique: {sorted(names)}")


def check_shapes(vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Check that no triangle is degenerate."""
    ratio = altitude_ratios(vertices, triangles)
    worst = int(np.argmin(ratio))
    if ratio[worst] < DEGENERATE:
        raise MeshError(
            f"triangle {worst} {triangles[worst]} is degenerate: smallest altitude / longest edge"
            f" {ratio[worst]:.2e}"
        )


def check_tags(
    table: EdgeTable, nv: int, edges: Mapping[str, np.ndarray], points: Mapping[str, int]
) -> dict[str, np.ndarray]:
    """Check the named edges and points; return the sorted edge numbers of each named edge set."""
    found = {}
    for name, pairs in edges.items():
        if not len(pairs):
            raise MeshError(f"edge set {name!r} is empty")
        index = table.find(pairs)
        if (index < 0).any():
            pair = pairs[np.argmin(index)]
            raise MeshError(f"edge set {name!r}: ({pair[0]}, {pair[1]}) is no edge of the mesh")
        found[name] = np.unique(index)
    for name, vertex in points.items():
        if not 0 <= vertex < nv:
            raise MeshError(f"point {name!r}: vertex {vertex} is outside 0..{nv - 1}")
    return found


def check_creases(
    table: EdgeTable, edges: Mapping[str, np.ndarray], creases: Iterable[str]
) -> np.ndarray:
    """Check that creases are named and have panels on both sides; return a mask of their edges."""
    is_crease = np.zeros(len(table.count), dtype=bool)
    for name in creases:
        if name not in edges:
            raise MeshError(f"crease {name!r} is no named edge set; there are {sorted(edges)}")
        is_crease[edges[name]] = True
        open_edges = edges[name][table.count[edges[name]] < 2]
        if len(open_edges):
            a, b = table.vertices[open_edges[0]]
            raise MeshError(f"crease {name!r} is open: edge ({a}, {b}) has one triangle only")
    return is_crease


def check_interior(
    vertices: np.ndarray, triangles: np.ndarray, table: EdgeTable, is_crease: np.ndarray
) -> None:
    """Check the edges that are no creases: two triangles at most, oriented alike, not folded over.

    Raises:
        MeshError: naming the edge and its triangles.
    """
    crowded = np.flatnonzero((table.count > 2) & ~is_crease)
    if len(crowded):
        a, b = table.vertices[crowded[0]]
        raise MeshError(
            f"edge ({a}, {b}) has {table.count[crowded[0]]} triangles but is not declared a crease"
        )
    sides, local = np.divmod(table.side_slots(), 3)
    edge = table.of_triangle[sides[:, 0], local[:, 0]]
    plain = ~is_crease[edge]
    sides, local, edge = sides[plain], local[plain], edge[plain]
    alike = table.forward[sides[:, 0], local[:, 0]] == table.forward[sides[:, 1], local[:, 1]]
    _raise_first(alike, "are oriented against each other", sides, table.vertices[edge])
    n1, n2 = (triangle_normals(vertices, triangles[sides[:, i]]) for i in range(2))
    cosine = (n1 * n2).sum(axis=1) / np.linalg.norm(n1, axis=1) / np.linalg.norm(n2, axis=1)
    over = cosine < FOLDED_OVER
    _raise_first(over, "fold over: one is inverted", sides, table.vertices[edge])


def _raise_first(bad: np.ndarray, what: str, sides: np.ndarray, edges: np.ndarray) -> None:
    if bad.any():
        at = int(np.argmax(bad))
        raise MeshError(
            f"triangles {sides[at, 0]} and {sides[at, 1]} at edge ({edges[at, 0]}, {edges[at, 1]}),"
            f" which is no crease, {what}"
        )
