"""Mid-edge shell, membrane and bending, over a batch of triangles: energy, gradient, Hessian.

The energy of `energy.py` is a function of six scalars (three squared edge lengths L, three tilts
t), hence

    g = sum_r W_r grad r,    H = sum_rs W_rs grad r (x) grad s + sum_r W_r hess r.

Order of the 18 + 3 m degrees of freedom of a triangle: vertices i, j, k and the vertices opposite
across edges 0, 1, 2 (3 components each), then the slots of edge 0, 1, 2 (m each). A ghost vertex
counts as the vertex it rides on. All outputs are overwritten. A triangle without area has NaN
energy.
"""

import numpy as np

from .blocks import (
    add_length_curvature,
    add_neighbour_curvature,
    own_vectors,
    project,
    write_corners,
    write_opposites,
    write_slots,
)
from .energy import (
    altitude_rates,
    bending,
    bending_forces,
    form,
    length_forces,
    membrane,
    scalar_hessian,
    shape,
)
from .jit import inlined, kernel
from .scalars import Sides, hinge_sides, length_gradient, tilt_gradient, triangle
from .vectors import add, point


@kernel
def second_form(x, verts, s, b):
    """Second fundamental forms (B11, B12, B22).

    Args:
        x: (nv, 3) positions.
        verts: (n, 3 or more) int32.
        s: (n, 3, 3) measured tilts.
        b: (n, 3) output.
    """
    for i in range(verts.shape[0]):
        xi, xj, xk = triangle(x, verts, i)
        _, lengths, square = shape(xi, xj, xk)
        value, _, _ = form((s[i, 0, 0], s[i, 1, 0], s[i, 2, 0]), lengths, square)
        b[i, 0], b[i, 1], b[i, 2] = value


@kernel
def shell_energy(x, verts, s, elastic, energy):
    """Energies of all triangles.

    Args:
        x: (nv, 3) positions.
        verts: (n, 3 or more) int32.
        s: (n, 3, 3) measured tilts.
        elastic: `Elastic`.
        energy: (n, 2) output: membrane, bending.
    """
    for i in range(verts.shape[0]):
        xi, xj, xk = triangle(x, verts, i)
        a, lengths, square = shape(xi, xj, xk)
        energy[i, 0], _ = membrane(i, a, elastic)
        tilted = (s[i, 0, 0], s[i, 1, 0], s[i, 2, 0])
        energy[i, 1], _, _, _ = bending(i, tilted, lengths, square, elastic)


@inlined
def write_gradient(g, i, force, jac, opp, d):
    """Write g[i] from the six scalar forces."""
    for j in range(9):
        value = 0.0
        for r in range(6):
            value += force[r] * jac[r, j]
        g[i, j] = value
    for e in range(3):
        for j in range(3):
            g[i, 9 + 3 * e + j] = force[3 + e] * opp[e, j]
        for m in range(d.shape[2]):
            g[i, 18 + e * d.shape[2] + m] = force[3 + e] * d[i, e, m]


@inlined
def tilt_forces(i, s, f, eta):
    """Derivatives of the bending energy with respect to the tilts."""
    return (
        2.0 * f[0] * eta[0] * s[i, 0, 1],
        2.0 * f[1] * eta[1] * s[i, 1, 1],
        2.0 * f[2] * eta[2] * s[i, 2, 1],
    )


@kernel
def shell_gradient(x, stencil, s, elastic, energy, g):
    """Energies and gradients of all triangles.

    Args:
        x: (nv, 3) positions.
        stencil: `Stencil`.
        s: (n, 3, 3) measured tilts.
        elastic: `Elastic`.
        energy: (n, 2) output: membrane, bending.
        g: (n, 18 + 3 m) output.
    """
    rate, jac, opp = np.empty((3, 3)), np.empty((6, 9)), np.empty((3, 3))
    sides = Sides(np.empty((4, 3)), np.empty((3, 3)), np.empty((3, 3)))
    for i in range(stencil.verts.shape[0]):
        corner = triangle(x, stencil.verts, i)
        a, lengths, square = shape(corner[0], corner[1], corner[2])
        energy[i, 0], sigma = membrane(i, a, elastic)
        tilted = (s[i, 0, 0], s[i, 1, 0], s[i, 2, 0])
        energy[i, 1], f, p, eta = bending(i, tilted, lengths, square, elastic)
        altitude_rates(lengths, square, a, rate)
        force = add(length_forces(sigma), bending_forces(f, p, rate)) + tilt_forces(i, s, f, eta)
        length_gradient(corner, jac)
        hinge_sides(x, stencil, i, corner, sides)
        tilt_gradient(stencil.c, i, sides, jac, opp)
        write_gradient(g, i, force, jac, opp, stencil.d)


@kernel
def shell_hessian(x, stencil, s, elastic, sigma, energy, g, h):
    """Energies, gradients and Hessians of all triangles.

    Args:
        x: (nv, 3) positions.
        stencil: `Stencil`.
        s: (n, 3, 3) measured tilts.
        elastic: `Elastic`.
        sigma: (n, 3) membrane stress of the geometric stiffness: `membrane_stress` for the exact
            Hessian.
        energy: (n, 2) output: membrane, bending.
        g: (n, 18 + 3 m) output.
        h: (n, 18 + 3 m, 18 + 3 m) output.
    """
    rate, jac, opp = np.empty((3, 3)), np.empty((6, 9)), np.empty((3, 3))
    q, k, y, v = np.empty((3, 3)), np.empty((6, 6)), np.empty((6, 9)), np.empty((3, 3, 3))
    sides = Sides(np.empty((4, 3)), np.empty((3, 3)), np.empty((3, 3)))
    for i in range(stencil.verts.shape[0]):
        corner = triangle(x, stencil.verts, i)
        a, lengths, square = shape(corner[0], corner[1], corner[2])
        energy[i, 0], current = membrane(i, a, elastic)
        tilted = (s[i, 0, 0], s[i, 1, 0], s[i, 2, 0])
        energy[i, 1], f, p, eta = bending(i, tilted, lengths, square, elastic)
        slope = altitude_rates(lengths, square, a, rate)
        by_length, by_tilt = bending_forces(f, p, rate), tilt_forces(i, s, f, eta)
        length_gradient(corner, jac)
        hinge_sides(x, stencil, i, corner, sides)
        tilt_gradient(stencil.c, i, sides, jac, opp)
        write_gradient(g, i, add(length_forces(current), by_length) + by_tilt, jac, opp, stencil.d)

        state = (lengths, square, slope, f, p, eta)
        scalar_hessian(i, s, state, elastic, (rate, q), k)
        project(k, jac, y)
        own_vectors(i, corner, stencil.c, by_tilt, sides, v)
        write_corners(h, i, sides, v, jac, y)
        add_length_curvature(h, i, add(length_forces(point(sigma, i)), by_length))
        write_opposites(h, i, opp, y, k)
        for e in range(3):
            factor = by_tilt[e] * stencil.c[i, e]
            if factor != 0.0:
                add_neighbour_curvature(h, i, e, factor, corner, sides)
        write_slots(h, i, stencil.d, opp, y, k)
