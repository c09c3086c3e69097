"""Checks of the shape of a crease pattern's faces and panels: crossing, area, planarity.

Functions take plain arrays, work on all faces together and raise `PatternError`, which names the
vertex or face and the value.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from ufl_origami.errors import PatternError
from ufl_origami.pattern_checks import fail_at
from ufl_origami.pattern_topology import Corners, Floats, Ints, area_vectors

#: Faces with less area than this times their squared perimeter have none.
AREA_TOLERANCE = 1e-10


def check_duplicates(points: Floats, tolerance: float, allowed: npt.NDArray[np.bool_]) -> None:
    """No two vertices at one place, except where both are `allowed` to touch.

    Args:
        points: (n, 3) coordinates.
        tolerance: distance relative to the pattern's size (diagonal of its bounding box).
        allowed: (n,) vertices that may coincide with each other (ends of cuts).
    """
    distance = tolerance * np.linalg.norm(np.ptp(points, axis=0))
    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    fail_at(
        ~allowed[pairs].all(axis=1),
        lambda k: (
            f"duplicate vertices: {pairs[k, 0]} and {pairs[k, 1]} are both at "
            f"{points[pairs[k, 0]].tolist()}; vertices may touch at the ends of cuts (C) or in a "
            f"frame with the attribute selfTouching"
        ),
    )


def check_crossing(points: Floats, corners: Corners, tolerance: float) -> None:
    """No face may cross or touch itself; faces are treated together by number of vertices."""
    sizes = np.diff(corners.start)
    for size in np.unique(sizes[sizes > 3]):
        faces = np.flatnonzero(sizes == size)
        loops = corners.vertex[corners.start[faces][:, None] + np.arange(size)]
        flat = _in_best_plane(points[loops])
        for i in range(size - 2):
            for j in range(i + 2, size - (i == 0)):
                bad = np.flatnonzero(_segments_meet(flat, i, j, tolerance))
                if len(bad):
                    loop = loops[bad[0]].tolist()
                    raise PatternError(
                        f"face {faces[bad[0]]} crosses or touches itself: its sides "
                        f"{loop[i]}-{loop[i + 1]} and {loop[j]}-{loop[(j + 1) % size]} meet"
                    )


def _in_best_plane(polygons: Floats) -> Floats:
    """Coordinates (k, n, 2) of polygons (k, n, 3) in the plane through their points."""
    centred = polygons - polygons.mean(axis=1, keepdims=True)
    axes = np.linalg.eigh(np.einsum("kni,knj->kij", centred, centred))[1]
    return centred @ axes[:, :, 1:]


def _segments_meet(flat: Floats, i: int, j: int, tolerance: float) -> npt.NDArray[np.bool_]:
    """Whether sides i and j of each polygon (k, n, 2) cross or come within tolerance * size."""
    n = flat.shape[1]
    a, b, c, d = flat[:, i], flat[:, (i + 1) % n], flat[:, j], flat[:, (j + 1) % n]
    crossing = segments_cross(a, b, c, d)
    gap = np.min(
        [
            point_segment_distance(a, c, d),
            point_segment_distance(b, c, d),
            point_segment_distance(c, a, b),
            point_segment_distance(d, a, b),
        ],
        axis=0,
    )
    return crossing | (gap <= tolerance * np.ptp(flat, axis=1).max(axis=1))


def segments_cross(a: Floats, b: Floats, c: Floats, d: Floats) -> npt.NDArray[np.bool_]:
    """Whether the inner parts of segments a-b and c-d, (k, 2) or (1, 2) each, cross."""
    return (_side(a, b, c) * _side(a, b, d) < 0) & (_side(c, d, a) * _side(c, d, b) < 0)


def _side(a: Floats, b: Floats, p: Floats) -> Floats:
    """Positive where p lies left of the line from a to b."""
    u, v = b - a, p - a
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def point_segment_distance(p: Floats, a: Floats, b: Floats) -> Floats:
    """Distance of p from the segment between a and b, (k, 2) or (1, 2) each."""
    u = b - a
    t = ((p - a) * u).sum(axis=1) / np.maximum((u * u).sum(axis=1), 1e-300)
    return np.linalg.norm(p - a - np.clip(t, 0.0, 1.0)[:, None] * u, axis=1)


def check_areas(points: Floats, corners: Corners) -> None:
    """Each face must have an area."""
    areas = np.linalg.norm(area_vectors(points, corners), axis=1)
    perimeters = np.zeros(corners.num_faces)
    sides = np.linalg.norm(points[corners.following] - points[corners.vertex], axis=1)
    np.add.at(perimeters, corners.face, sides)
    fail_at(
        areas <= AREA_TOLERANCE * perimeters**2,
        lambda f: f"face {f} has no area ({areas[f]:.3g} at a perimeter of {perimeters[f]:.3g})",
    )


def check_planarity(
    points: Floats, corners: Corners, panel: Ints, names: Sequence[str], tolerance: float
) -> None:
    """Each panel must be plane at rest.

    Args:
        points: (n, 3) coordinates.
        corners: the face loops.
        panel: (f,) panel of each face.
        names: panel names.
        tolerance: distance from the panel's mean plane allowed, relative to the panel's size.
    """
    height, size = panel_heights(points, corners, panel)
    worst = np.zeros(len(names))
    np.maximum.at(worst, panel[corners.face], height)
    relative = worst / size
    fail_at(
        relative > tolerance,
        lambda p: (
            f"panel {names[p]!r} (faces {np.flatnonzero(panel == p).tolist()}) is not plane at "
            f"rest: vertex {corners.vertex[_worst_corner(height, panel[corners.face] == p)]} is "
            f"{relative[p]:.3g} of the panel's size off its plane, {tolerance:g} is allowed"
        ),
    )


def _worst_corner(height: Floats, mine: npt.NDArray[np.bool_]) -> int:
    return int(np.argmax(np.where(mine, height, -1.0)))


def panel_heights(points: Floats, corners: Corners, panel: Ints) -> tuple[Floats, Floats]:
    """Height of each corner over its panel's mean plane (c,), and each panel's size (p,).

    A panel whose faces turn so far that their normals cancel has an infinite height.
    """
    group = panel[corners.face]
    areas = area_vectors(points, corners)
    total, centre = np.zeros((2, panel.max() + 1, 3))
    np.add.at(total, panel, areas)
    np.add.at(centre, group, points[corners.vertex])
    centre /= np.bincount(group)[:, None]
    scale = np.bincount(panel, weights=np.linalg.norm(areas, axis=1))
    length = np.linalg.norm(total, axis=1)
    turned = length < 0.1 * scale
    normal = total / np.where(turned, 1.0, length)[:, None]
    arm = points[corners.vertex] - centre[group]
    height = np.abs(np.einsum("ci,ci->c", arm, normal[group]))
    size = np.zeros(len(scale))
    np.maximum.at(size, group, 2.0 * np.linalg.norm(arm, axis=1))
    return np.where(turned[group], np.inf, height), size
