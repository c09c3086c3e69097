"""What a FOLD frame leaves out: edges from faces, faces from the edges of a plane graph.

FOLD makes every key optional; `complete` returns vertices, edges and faces or says what is
missing. Specification: FOLD 1.2, https://github.com/edemaine/fold, doc/spec.md.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ufl_origami.errors import PatternError
from ufl_origami.pattern_arrays import coordinates, integers, loops
from ufl_origami.pattern_checks import check_coordinates, check_edges, fail_at
from ufl_origami.pattern_shape import point_segment_distance, segments_cross
from ufl_origami.pattern_topology import Corners, Floats, Ints, edges_of, join_faces

Loops = list[list[int]]


def complete(frame: Mapping[str, Any]) -> tuple[Floats, Ints, Sequence[Sequence[int]]]:
    """Return coordinates (n, 3), edges (m, 2) and face loops of a frame.

    Edges come from `edges_vertices`, else from `faces_edges` or the sides of the faces, else from
    `vertices_vertices`. Faces come from `faces_vertices`, else from `faces_edges`, else they are
    the regions of a plane graph.

    Raises:
        PatternError: something needed is missing or contradicts another key.
    """
    if "vertices_coords" not in frame:
        raise PatternError("vertices_coords is missing: a pattern needs the shape of its panels")
    points = coordinates(entries(frame, "vertices_coords"))
    faces = entries(frame, "faces_vertices") if "faces_vertices" in frame else None
    edges = _edges(frame, faces)
    if faces is None and "faces_edges" in frame:
        faces = _loops_from_edges(entries(frame, "faces_edges"), edges)
    if faces is None:
        faces = plane_faces(points, edges)
    return points, edges, faces


def entries(frame: Mapping[str, Any], key: str) -> list[Any]:
    """Array under a key that is there."""
    if not isinstance(frame[key], list | tuple | np.ndarray):
        raise PatternError(f"{key} must be an array, not {frame[key]!r}")
    return list(frame[key])


def _edges(frame: Mapping[str, Any], faces: list[Any] | None) -> Ints:
    """Edges of a frame, given or inferred."""
    if "edges_vertices" in frame:
        return integers(entries(frame, "edges_vertices"), (-1, 2), "edges_vertices")
    if faces is not None and "faces_edges" in frame:
        return _edges_from_faces(faces, entries(frame, "faces_edges"))
    numbered = sorted(key for key in frame if key.startswith("edges_"))
    if numbered:
        raise PatternError(
            f"edges_vertices is missing, so that nothing tells which edges {numbered[0]} is about"
        )
    if faces is not None:
        return edges_of(Corners.from_loops(loops(faces)))
    if "vertices_vertices" in frame:
        neighbours = entries(frame, "vertices_vertices")
        pairs = [sorted((v, w)) for v, near in enumerate(neighbours) for w in near]
        return integers(np.unique(np.array(pairs), axis=0), (-1, 2), "vertices_vertices")
    raise PatternError(
        "edges_vertices and faces_vertices are both missing: nothing tells where the panels are"
    )


def _edges_from_faces(faces: list[Any], faces_edges: list[Any]) -> Ints:
    """Edges numbered as `faces_edges` says: its entry [f][i] joins vertices i, i + 1 of face f."""
    vertices = loops(faces)
    if [len(loop) for loop in vertices] != [len(numbers) for numbers in faces_edges]:
        raise PatternError("faces_edges and faces_vertices have loops of different lengths")
    corners = Corners.from_loops(vertices)
    number = np.array([e for numbers in loops(faces_edges) for e in numbers], dtype=int)
    found, first = np.unique(number, return_index=True)
    fail_at(found != np.arange(len(found)), lambda k: f"faces_edges names no edge {k}")
    edges = corners.pairs[first]
    same = np.sort(edges[number], axis=1) == np.sort(corners.pairs, axis=1)
    fail_at(
        ~same.all(axis=1),
        lambda c: (
            f"faces_edges gives edge {number[c]} to vertices {corners.pairs[c].tolist()} of face "
            f"{corners.face[c]}, but also to vertices {edges[number[c]].tolist()}"
        ),
    )
    return edges


def _loops_from_edges(faces_edges: list[Any], edges: Ints) -> Loops:
    """Loops of vertices from loops of edges."""
    found = []
    for f, numbers in enumerate(loops(faces_edges)):
        if not all(0 <= e < len(edges) for e in numbers):
            raise PatternError(f"faces_edges[{f}] is {list(numbers)}: edges go to {len(edges) - 1}")
        before = np.roll(numbers, 1)
        shared = [set(edges[a]) & set(edges[b]) for a, b in zip(before, numbers, strict=True)]
        bad = [k for k, common in enumerate(shared) if len(common) != 1]
        if bad:
            raise PatternError(
                f"face {f} is not closed: its edges {before[bad[0]]} and {numbers[bad[0]]} do not "
                f"meet in one vertex"
            )
        found.append([int(common.pop()) for common in shared])
    return found


def plane_faces(points: Floats, edges: Ints) -> Loops:
    """Regions of a plane connected graph, counterclockwise, the unbounded one left out.

    Raises:
        PatternError: not plane (z differs), several pieces, or edges that cross or touch.
    """
    missing = "faces_vertices is missing and cannot be inferred"
    check_coordinates(points)
    check_edges(edges, len(points))
    if np.ptp(points[:, 2]) > 0.0:
        raise PatternError(f"{missing}: the coordinates are not plane")
    pieces = len(np.unique(join_faces(len(points), edges)[edges[:, 0]]))
    if pieces != 1:
        raise PatternError(f"{missing}: the edges form {pieces} separate pieces")
    _check_crossings(points[:, :2], edges, missing)
    return [loop for loop in _trace(points, edges) if _area(points[loop]) > 0.0]


def _check_crossings(points: Floats, edges: Ints, missing: str) -> None:
    """No two edges may cross, and no vertex may lie inside an edge; a sweep along x."""
    left, right = np.sort(points[edges, 0], axis=1).T
    order, by_x = np.argsort(left), np.argsort(points[:, 0])
    start, end = points[edges[order, 0]], points[edges[order, 1]]
    slack = 1e-9 * np.ptp(points, axis=0).max()
    last_edge = np.searchsorted(left[order], right[order], side="right")
    first_vertex = np.searchsorted(points[by_x, 0], left[order] - slack)
    last_vertex = np.searchsorted(points[by_x, 0], right[order] + slack)
    for k, e in enumerate(order):
        a, b = start[[k]], end[[k]]
        others = slice(k + 1, last_edge[k])
        cross = segments_cross(a, b, start[others], end[others])
        if cross.any():
            pair = sorted((int(e), int(order[others][np.argmax(cross)])))
            raise PatternError(f"{missing}: edges {pair[0]} and {pair[1]} cross without a vertex")
        near = by_x[first_vertex[k] : last_vertex[k]]
        near = near[point_segment_distance(points[near], a, b) <= slack]
        inside = near[(near != edges[e, 0]) & (near != edges[e, 1])]
        if len(inside):
            raise PatternError(f"{missing}: vertex {inside[0]} lies on edge {e}")


def _trace(points: Floats, edges: Ints) -> Loops:
    """Follow half-edges, each time turning off as far left as possible; one loop a region."""
    tail, head = np.concatenate([edges, edges[:, ::-1]]).T
    direction = points[head] - points[tail]
    angle = np.arctan2(direction[:, 1], direction[:, 0])
    order = np.lexsort((angle, tail))
    start = np.searchsorted(tail[order], np.arange(len(points)))
    degree = np.bincount(tail, minlength=len(points))
    rank = np.empty(len(order), dtype=int)
    rank[order] = np.arange(len(order))
    twin = np.roll(np.arange(len(tail)), len(edges))
    place = (rank[twin] - start[head] - 1) % degree[head]
    following = order[start[head] + place]
    found, seen = [], np.zeros(len(tail), dtype=bool)
    for first in range(len(tail)):
        loop, half = [], first
        while not seen[half]:
            seen[half] = True
            loop.append(int(tail[half]))
            half = following[half]
        if loop:
            found.append(loop)
    return found


def _area(loop: Floats) -> float:
    """Signed area of a plane loop."""
    x, y = (loop[:, :2] - loop[0, :2]).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
