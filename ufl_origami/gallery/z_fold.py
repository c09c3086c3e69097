"""The Z-fold: two plane panels that meet in one valley crease."""

import math

import numpy as np

from ufl_origami.errors import PatternError
from ufl_origami.pattern import CreasePattern
from ufl_origami.pattern_names import PatternNames


def z_fold(
    width: float = 1.0,
    length: float = 1.0,
    included_angle: float = 35.6,
    *,
    widths: tuple[float, float] | None = None,
) -> CreasePattern:
    """Two rectangular panels, folded so that they include a given angle.

    The crease runs along y at x = 0 below the outer edges, which lie at z = 0 and are parallel to
    it; normals point up, so the crease is a valley of fold angle 180 deg - included angle. Equal
    panels have their outer edges 2 W sin(included / 2) apart, for which the defaults give
    0.61139.

    Panels `left`, `right`; crease `crease`; boundaries `left_edge`, `right_edge` (outer edges),
    `front` (y = 0) and `back` (y = length), each on both panels; points `A` (front) and `B`
    (back) are the crease's ends.

    Args:
        width: width of both panels, across the crease.
        length: length of the crease.
        included_angle: angle between the panels in degrees, above 0 and at most 180 (flat).
        widths: widths of the left and the right panel, instead of `width`.

    Raises:
        PatternError: a size that is not positive or an angle out of range.
    """
    left, right = widths if widths is not None else (width, width)
    if not (min(left, right, length) > 0.0 and math.isfinite(left + right + length)):
        raise PatternError(f"Z-fold: widths {left}, {right} and length {length} must be positive")
    if not 0.0 < included_angle <= 180.0:
        raise PatternError(f"Z-fold: included angle {included_angle} deg is not in (0, 180]")
    x1, x2, depth = _outer_edges(left, right, math.radians(included_angle))
    profile = [(x1, 0.0), (0.0, -depth), (x2, 0.0)]
    edges = {
        "crease": [(1, 4)],
        "left_edge": [(3, 0)],
        "right_edge": [(2, 5)],
        "front": [(0, 1), (1, 2)],
        "back": [(4, 3), (5, 4)],
    }
    return CreasePattern(
        np.array([(x, y, z) for y in (0.0, length) for x, z in profile]),
        np.array([pair for pairs in edges.values() for pair in pairs]),
        ("V", *"BBBBBB"),
        ((0, 1, 4, 3), (1, 2, 5, 4)),
        np.array([180.0 - included_angle, *6 * [0.0]]),
        PatternNames(
            vertices=(None, "A", None, None, "B", None),
            edges=tuple(name for name, pairs in edges.items() for _ in pairs),
            faces=("left", "right"),
        ),
        source={
            "file_spec": 1.2,
            "file_creator": "ufl_origami",
            "frame_title": "Z-fold",
            "frame_classes": ["foldedForm"],
            "frame_attributes": ["3D", "manifold", "orientable", "convexFaces"],
        },
    )


def _outer_edges(left: float, right: float, angle: float) -> tuple[float, float, float]:
    """Positions of the outer edges along their chord from the crease, and the crease's depth.

    The crease and the outer edges are a triangle with the angle at the crease; its foot divides
    the chord c = sqrt(l^2 + r^2 - 2 l r cos(angle)) at l (l - r cos(angle)) / c from the left.
    """
    cosine = math.cos(angle)
    chord = math.sqrt((left - right) ** 2 + 4.0 * left * right * math.sin(0.5 * angle) ** 2)
    depth = left * right * math.sin(angle) / chord
    return left * (right * cosine - left) / chord, right * (right - left * cosine) / chord, depth
