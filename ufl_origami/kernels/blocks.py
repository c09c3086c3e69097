"""Blocks of a triangle's Hessian: written from the scalars' derivatives, curvature added.

y = k jac (6, 9) is the product of the Hessian k in the six scalars with their first derivatives.
"""

from .hinge import side_frame, side_vector
from .jit import inlined
from .vectors import point


@inlined
def project(k, jac, y):
    """Fill y = k jac."""
    for r in range(6):
        for col in range(9):
            value = 0.0
            for a in range(6):
                value += k[r, a] * jac[a, col]
            y[r, col] = value


@inlined
def own_vectors(i, corner, c, force, sides, v):
    """Fill v[a, b] (vectors): the triangle's side of sum_e -W_t c hess theta_e.

    Block (a, b) of that sum is n (x) v[a, b] + v[b, a] (x) n with the face normal n.
    """
    v[:] = 0.0
    normal = point(sides.normal, 3)
    for e in range(3):
        p, q = (e + 1) % 3, (e + 2) % 3
        unit, m, inverse = side_frame(corner[p], corner[q], normal)
        factor = -force[e] * c[i, e]
        vertex, z = (p, q, e), (-inverse, inverse, 0.0)
        for a in range(3):
            for b in range(3):
                w_a, w_b = sides.own[e, a], sides.own[e, b]
                vector = side_vector(w_a, w_b, z[a], z[b], (unit, m))
                for j in range(3):
                    v[vertex[a], vertex[b], j] += factor * vector[j]


@inlined
def write_corners(h, i, sides, v, jac, y):
    """Write the 9 x 9 block of the triangle's vertices, the own side's curvature included."""
    n = point(sides.normal, 3)
    for a in range(3):
        for j in range(3):
            for b in range(a + 1):
                for k in range(3):
                    value = n[j] * v[a, b, k] + v[b, a, j] * n[k]
                    for r in range(6):
                        value += jac[r, 3 * a + j] * y[r, 3 * b + k]
                    h[i, 3 * a + j, 3 * b + k] = value
                    if b < a:
                        h[i, 3 * b + k, 3 * a + j] = value


@inlined
def add_length_curvature(h, i, force):
    """Add sum_e W_L hess L_e: the Laplacian of each edge."""
    for e in range(3):
        p, q = 3 * ((e + 1) % 3), 3 * ((e + 2) % 3)
        value = 2.0 * force[e]
        for j in range(3):
            h[i, p + j, p + j] += value
            h[i, q + j, q + j] += value
            h[i, p + j, q + j] -= value
            h[i, q + j, p + j] -= value


@inlined
def write_opposites(h, i, opp, y, k):
    """Write rows and columns of the opposite vertices, without curvature."""
    for e in range(3):
        for j in range(3):
            row = 9 + 3 * e + j
            for col in range(9):
                h[i, row, col] = h[i, col, row] = opp[e, j] * y[3 + e, col]
            for f in range(3):
                mixed = opp[e, j] * k[3 + e, 3 + f]
                for b in range(3):
                    h[i, row, 9 + 3 * f + b] = mixed * opp[f, b]


@inlined
def add_neighbour_curvature(h, i, e, factor, corner, sides):
    """Add factor times the neighbour's side of hess theta_e."""
    p, q = (e + 1) % 3, (e + 2) % 3
    n = point(sides.normal, e)
    unit, m, inverse = side_frame(corner[q], corner[p], n)
    dofs, z = (3 * q, 3 * p, 9 + 3 * e), (-inverse, inverse, 0.0)
    for a in range(3):
        for b in range(a + 1):
            w_a, w_b = sides.other[e, a], sides.other[e, b]
            ab = side_vector(w_a, w_b, z[a], z[b], (unit, m))
            ba = side_vector(w_b, w_a, z[b], z[a], (unit, m))
            for j in range(3):
                for k in range(3):
                    value = factor * (n[j] * ab[k] + ba[j] * n[k])
                    h[i, dofs[a] + j, dofs[b] + k] -= value
                    if b < a:
                        h[i, dofs[b] + k, dofs[a] + j] -= value


@inlined
def write_slots(h, i, d, opp, y, k):
    """Write rows and columns of the scalar unknowns."""
    count = d.shape[2]
    for e in range(3):
        for m in range(count):
            row = 18 + e * count + m
            factor = d[i, e, m]
            for col in range(9):
                h[i, row, col] = h[i, col, row] = factor * y[3 + e, col]
            for f in range(3):
                mixed = factor * k[3 + e, 3 + f]
                for b in range(3):
                    col = 9 + 3 * f + b
                    h[i, row, col] = h[i, col, row] = mixed * opp[f, b]
                for b in range(count):
                    h[i, row, 18 + f * count + b] = mixed * d[i, f, b]
