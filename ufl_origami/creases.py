"""Creases as tables: the panels at each crease edge, their rest fold angles, springs between them.

The sides of an edge are ordered by panel. The virtual angle k of an edge is the fold angle between
side 0 and side k; the fold angle between any two sides follows from those linearly.
"""

import numpy as np

from ufl_origami import kernels
from ufl_origami.configuration import Configuration
from ufl_origami.sheet import SheetMesh
from ufl_origami.sides import EdgeFan, fold_combination, full_turns, side_ends
from ufl_origami.stencils import fold_angle_name
from ufl_origami.terms.crease import CreaseEdges


def mesh_angles(
    sheet: SheetMesh,
    fan: EdgeFan,
    pair: tuple[int, int],
    x: np.ndarray,
    near: np.ndarray | None = None,
) -> np.ndarray:
    """Dihedral fold angles of the triangles on two sides of a crease's edges.

    Args:
        sheet: the meshed sheet.
        fan: edges of the crease.
        pair: positions of the two sides; the first one's orientation counts.
        x: positions (nv, 3).
        near: angles (n,) by which the branch is chosen (radians), None: within half a turn.

    Returns:
        Angles (n,) in radians, valley positive.
    """
    opposite = sheet.cells.ravel()
    first, second = (fan.sides[:, side] for side in pair)
    verts = np.column_stack([side_ends(sheet, first), opposite[first], opposite[second]])
    n = len(verts)
    angle, near = np.zeros(n), np.zeros(n) if near is None else near
    verts = np.ascontiguousarray(verts, dtype=np.int32)
    kernels.hinge_angles(x, verts, np.zeros((n, 3)), near, angle)
    return angle


def spring_edges(
    fan: EdgeFan, configuration: Configuration, pair: tuple[int, int], rest: np.ndarray
) -> CreaseEdges:
    """Spring between two sides of a fan, its angle in the orientation of the first one's panel.

    Args:
        fan: edges of the crease.
        configuration: numbering of the unknowns.
        pair: positions r, s of the two sides.
        rest: virtual angles (n, m - 1) of the rest state, by which the branch is chosen.
    """
    n = len(fan.facets)
    slot, coefficient = np.full((n, 2), -1, dtype=np.int32), np.zeros((n, 2))
    signs = fold_combination(fan, pair)
    for column, (k, sign) in enumerate(signs):
        slot[:, column] = configuration.slot(fold_angle_name(k))[fan.facets]
        coefficient[:, column] = sign
    constant = np.zeros(n)
    if all(pair):
        constant = full_turns(sum(sign * rest[:, k - 1] for k, sign in signs))
    return CreaseEdges(fan.length, slot, coefficient, constant)
