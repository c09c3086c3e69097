"""Tilts of the mid-edge normals of a batch of triangles, and their measures.

Edge e of the triangle (i, j, k) is opposite to vertex e and runs in the triangle's orientation.
Its tilt, the angle from the face normal to the mid-edge normal, positive when that leans into the
triangle (valley), is

    t_e = c_e theta_e + sum_m d_em u[slot_em]

with the hinge angle theta_e seen from this triangle (T1). All kinds of edges are choices of c, d,
slot and of the vertex opposite. The shell sees a tilt through its measure s(t): tan, or the sine
of the paper.
"""

from math import cos, sin, tan
from typing import NamedTuple

import numpy as np

from .hinge import hinge_angle
from .jit import kernel
from .vectors import add, point


class Stencil(NamedTuple):
    """Batch of n triangles with m scalar unknowns in each edge's tilt.

    Attributes:
        verts: (n, 6) int32: i, j, k, then the vertex opposite across edge 0, 1, 2 (any index
            where c = 0).
        offset: (n, 3, 3): the opposite vertex of edge e is at x[verts[3 + e]] + offset[e].
        c: (n, 3) factor of the hinge angle; where it is 0 the hinge is not evaluated.
        d: (n, 3, m) factors of the scalar unknowns.
        slot: (n, 3, m) int32 indices of the scalar unknowns.
    """

    verts: np.ndarray
    offset: np.ndarray
    c: np.ndarray
    d: np.ndarray
    slot: np.ndarray


@kernel
def tilts(x, u, stencil, theta_ref, theta, t):
    """Hinge angles and tilts of all edges of all triangles.

    Args:
        x: (nv, 3) positions.
        u: (ns,) scalar unknowns, radians.
        stencil: `Stencil`.
        theta_ref: (n, 3) hinge angles of the last accepted state: theta is taken on the nearest
            branch.
        theta: (n, 3) output, radians; 0 where c = 0, NaN at a triangle without area.
        t: (n, 3) output, radians.
    """
    verts, offset, c, d, slot = stencil
    for i in range(verts.shape[0]):
        for e in range(3):
            theta[i, e] = 0.0
            if c[i, e] != 0.0:
                p, q = verts[i, (e + 1) % 3], verts[i, (e + 2) % 3]
                ghost = add(
                    point(x, verts[i, 3 + e]),
                    (offset[i, e, 0], offset[i, e, 1], offset[i, e, 2]),
                )
                theta[i, e] = hinge_angle(
                    point(x, p), point(x, q), point(x, verts[i, e]), ghost, theta_ref[i, e]
                )
            tilt = c[i, e] * theta[i, e]
            for m in range(d.shape[2]):
                tilt += d[i, e, m] * u[slot[i, e, m]]
            t[i, e] = tilt


@kernel
def tan_measure(t, s):
    """Measure s = tan t: convergent default, infinite at fold-over.

    Args:
        t: (n, 3) tilts, radians.
        s: (n, 3, 3) output: s[:, e] = value, first and second derivative.
    """
    for i in range(t.shape[0]):
        for e in range(3):
            value = tan(t[i, e])
            slope = 1.0 + value * value
            s[i, e, 0], s[i, e, 1], s[i, e, 2] = value, slope, 2.0 * value * slope


@kernel
def sin_measure(t, s):
    """Measure s = sin t of the paper: softer, with a spurious zero-energy state at tilt pi.

    Args:
        t: (n, 3) tilts, radians.
        s: (n, 3, 3) output: s[:, e] = value, first and second derivative.
    """
    for i in range(t.shape[0]):
        for e in range(3):
            value = sin(t[i, e])
            s[i, e, 0], s[i, e, 1], s[i, e, 2] = value, cos(t[i, e]), -value


MEASURES = {"tan": tan_measure, "sin": sin_measure}
