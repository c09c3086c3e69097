"""First derivatives of the six scalars (L_0, L_1, L_2, t_0, t_1, t_2) by a triangle's vertices.

They are kept as jac (6, 9), row by scalar, column 3 a + j for component j of vertex a, and opp
(3, 3), the derivative of tilt e by the vertex opposite across edge e. The two sides of each hinge
(see `hinge.py`) are kept for the Hessian as `Sides`.
"""

from typing import NamedTuple

import numpy as np

from .hinge import side_gradient
from .jit import inlined
from .vectors import add, point, sub


class Sides(NamedTuple):
    """Both sides of the three hinges of one triangle (scratch).

    Attributes:
        normal: (4, 3) unit normals of the neighbours across edge 0, 1, 2, then the triangle's own.
        own: (3, 3) weights of the own side of edge e at the vertices (e + 1, e + 2, e).
        other: (3, 3) weights of the neighbour's side at (e + 2, e + 1, opposite).
    """

    normal: np.ndarray
    own: np.ndarray
    other: np.ndarray


@inlined
def triangle(x, verts, i):
    """Positions of the vertices i, j, k."""
    return point(x, verts[i, 0]), point(x, verts[i, 1]), point(x, verts[i, 2])


@inlined
def opposite(x, stencil, i, e):
    """Position of the vertex opposite across edge e."""
    r = stencil.offset
    return add(point(x, stencil.verts[i, 3 + e]), (r[i, e, 0], r[i, e, 1], r[i, e, 2]))


@inlined
def hinge_sides(x, stencil, i, corner, sides):
    """Fill `sides` of triangle i; zero weights where the tilt does not use the hinge (c = 0)."""
    for e in range(3):
        p, q = (e + 1) % 3, (e + 2) % 3
        normal, own = side_gradient(corner[p], corner[q], corner[e])
        for j in range(3):
            sides.normal[3, j] = normal[j]
            sides.own[e, j] = own[j]
        if stencil.c[i, e] != 0.0:
            ghost = opposite(x, stencil, i, e)
            normal, other = side_gradient(corner[q], corner[p], ghost)
            for j in range(3):
                sides.normal[e, j] = normal[j]
                sides.other[e, j] = other[j]
        else:
            for j in range(3):
                sides.normal[e, j] = 0.0
                sides.other[e, j] = 0.0


@inlined
def tilt_gradient(c, i, sides, jac, opp):
    """Fill the rows of the tilts in jac, and opp."""
    normal, own, other = sides
    for e in range(3):
        p, q = (e + 1) % 3, (e + 2) % 3
        factor = c[i, e]
        for j in range(3):
            jac[3 + e, 3 * e + j] = factor * own[e, 2] * normal[3, j]
            jac[3 + e, 3 * p + j] = factor * (own[e, 0] * normal[3, j] + other[e, 1] * normal[e, j])
            jac[3 + e, 3 * q + j] = factor * (own[e, 1] * normal[3, j] + other[e, 0] * normal[e, j])
            opp[e, j] = factor * other[e, 2] * normal[e, j]


@inlined
def length_gradient(corner, jac):
    """Fill the rows of the squared edge lengths in jac."""
    for e in range(3):
        p, q = (e + 1) % 3, (e + 2) % 3
        edge = sub(corner[q], corner[p])
        for j in range(3):
            jac[e, 3 * e + j] = 0.0
            jac[e, 3 * p + j] = -2.0 * edge[j]
            jac[e, 3 * q + j] = 2.0 * edge[j]
