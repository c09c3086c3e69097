"""Hinge angle of two triangles at a common edge: value, gradient, Hessian.

Hinge (x0, x1, x2, x3): T1 = (x0, x1, x2), T2 = (x1, x0, x3), theta = atan2((n2 x n1) . e, n1 .
n2) with e along x1 - x0: 0 flat, valley positive, radians. Both derivatives are sums over the two
*sides*. On one side (p, q, r), edge p -> q of unit vector e and length l, normal n, altitude h of
r, m = n x e (inwards), foot of r at p + lam (q - p), let

    w = (-(1 - lam), -lam, 1) / h,    z = (-1, 1, 0) / l        (one weight for each of p, q, r)

    grad_a theta      = w_a n
    hess_ab theta     = -(n (x) v_ab + v_ba (x) n),     v_ab = (w_a w_b + z_a z_b / 2) m + z_a w_b e

The term in z z is half of its unsymmetric original; the two sides' other halves cancel.
Equivalent to Tamstorf & Grinspun 2013, doi:10.1016/j.gmod.2013.07.001, with fewer
operations.
"""

from math import atan2, floor, pi, sqrt
from typing import NamedTuple

import numpy as np

from .jit import inlined, kernel
from .vectors import add, combine, cross, dot, point, scale, sub


class HingeStencil(NamedTuple):
    """Batch of n hinges whose measured angle is c theta + sum_m d[m] u[slot[m]].

    Attributes:
        verts: (n, 4) int32 vertices x0, x1, x2, x3.
        offset: (n, 3) added to the position of x3 (a ghost vertex rides on a real one).
        c: (n,) factor of theta.
        d: (n, m) factors of the scalar unknowns.
        slot: (n, m) int32 indices of the scalar unknowns.
    """

    verts: np.ndarray
    offset: np.ndarray
    c: np.ndarray
    d: np.ndarray
    slot: np.ndarray


@inlined
def hinge_angle(x0, x1, x2, x3, reference):
    """Hinge angle on the branch nearest to `reference`; NaN when a triangle has no area."""
    e = sub(x1, x0)
    r = sub(x3, x0)
    n1 = cross(e, sub(x2, x0))
    n2 = cross(r, e)
    inverse = 1.0 / (dot(n1, n1) * dot(n2, n2))
    raw = atan2(sqrt(dot(e, e)) * dot(n1, r) * inverse, dot(n1, n2) * inverse)
    return raw + 2.0 * pi * floor((reference - raw) / (2.0 * pi) + 0.5)


@inlined
def side_gradient(p, q, r):
    """Normal n and weights w of a side (p, q, r): its share of grad theta is w_a n."""
    e = sub(q, p)
    a = sub(r, p)
    normal = cross(e, a)
    square = dot(e, e)
    length = sqrt(square)
    inverse = 1.0 / sqrt(dot(normal, normal))
    per_height = length * inverse
    lam = dot(a, e) / square
    return scale(inverse, normal), ((lam - 1.0) * per_height, -lam * per_height, per_height)


@inlined
def side_frame(p, q, n):
    """Unit vector e of the edge p -> q, inward normal m = n x e, and 1 / length."""
    edge = sub(q, p)
    inverse = 1.0 / sqrt(dot(edge, edge))
    e = scale(inverse, edge)
    return e, cross(n, e), inverse


@inlined
def side_vector(wa, wb, za, zb, frame):
    """Vector v_ab of the Hessian of one side, frame = (e, m)."""
    return combine(za * wb, frame[0], wa * wb + 0.5 * za * zb, frame[1])


@inlined
def corners(x, hinge, i):
    """Positions x0, x1, x2, x3 of hinge i."""
    v = hinge.verts
    ghost = add(point(x, v[i, 3]), point(hinge.offset, i))
    return point(x, v[i, 0]), point(x, v[i, 1]), point(x, v[i, 2]), ghost


@kernel
def hinge_angles(x, verts, offset, theta_ref, theta):
    """Hinge angles, unwrapped to the branch nearest to theta_ref.

    Args:
        x: (nv, 3) positions.
        verts: (n, 4) int32 hinges.
        offset: (n, 3) added to the last vertex.
        theta_ref: (n,) angles of the last accepted state, radians.
        theta: (n,) output, radians; NaN at a triangle without area.
    """
    for i in range(verts.shape[0]):
        x3 = add(point(x, verts[i, 3]), point(offset, i))
        x0, x1, x2 = point(x, verts[i, 0]), point(x, verts[i, 1]), point(x, verts[i, 2])
        theta[i] = hinge_angle(x0, x1, x2, x3, theta_ref[i])


@kernel
def hinge_work_energy(u, hinge, theta, work, energy):
    """Potential of moments that turn hinges: -work (c theta + sum_m d u).

    Args:
        u: (ns,) scalar unknowns, radians.
        hinge: `HingeStencil`.
        theta: (n,) angles from `hinge_angles`.
        work: (n,) moment times edge length, energy per radian.
        energy: (n,) output.
    """
    for i in range(theta.shape[0]):
        angle = hinge.c[i] * theta[i]
        for j in range(hinge.d.shape[1]):
            angle += hinge.d[i, j] * u[hinge.slot[i, j]]
        energy[i] = -work[i] * angle


@kernel
def hinge_work_gradient(x, hinge, work, g):
    """Gradient of `hinge_work_energy`, which does not depend on the angle's branch.

    Args:
        x: (nv, 3) positions.
        hinge: `HingeStencil`.
        work: (n,) moment times edge length, energy per radian.
        g: (n, 12 + m) output; order: x0, x1, x2, x3 (3 components each), slots.
    """
    for i in range(work.shape[0]):
        x0, x1, x2, x3 = corners(x, hinge, i)
        n1, w1 = side_gradient(x0, x1, x2)
        n2, w2 = side_gradient(x1, x0, x3)
        factor = -work[i] * hinge.c[i]
        for k in range(3):
            g[i, k] = factor * (w1[0] * n1[k] + w2[1] * n2[k])
            g[i, 3 + k] = factor * (w1[1] * n1[k] + w2[0] * n2[k])
            g[i, 6 + k] = factor * w1[2] * n1[k]
            g[i, 9 + k] = factor * w2[2] * n2[k]
        for j in range(hinge.d.shape[1]):
            g[i, 12 + j] = -work[i] * hinge.d[i, j]


@inlined
def add_side_hessian(block, i, factor, dofs, p, q, r):
    """Add factor times one side's share of hess theta to block[i] at its first dofs."""
    n, w = side_gradient(p, q, r)
    e, m, inverse = side_frame(p, q, n)
    z = (-inverse, inverse, 0.0)
    for a in range(3):
        for b in range(3):
            v_ab = side_vector(w[a], w[b], z[a], z[b], (e, m))
            v_ba = side_vector(w[b], w[a], z[b], z[a], (e, m))
            for j in range(3):
                for k in range(3):
                    block[i, dofs[a] + j, dofs[b] + k] -= factor * (n[j] * v_ab[k] + v_ba[j] * n[k])


@kernel
def hinge_work_hessian(x, hinge, work, hessian):
    """Hessian of `hinge_work_energy`.

    Args:
        x: (nv, 3) positions.
        hinge: `HingeStencil`.
        work: (n,) moment times edge length, energy per radian.
        hessian: (n, 12 + m, 12 + m) output, order as in `hinge_work_gradient`.
    """
    hessian[:] = 0.0
    for i in range(work.shape[0]):
        x0, x1, x2, x3 = corners(x, hinge, i)
        factor = -work[i] * hinge.c[i]
        add_side_hessian(hessian, i, factor, (0, 3, 6), x0, x1, x2)
        add_side_hessian(hessian, i, factor, (3, 0, 9), x1, x0, x3)
