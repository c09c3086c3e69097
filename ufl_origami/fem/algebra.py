"""Condensation of the element: from pairings with the kinematics to energy, force and stiffness.

Moments and membrane strains live on single elements and enter quadratically, so they are eliminated
there: with the pairings y(q) of the forms and the constant matrices D below, the energy is
1/2 y.D y, the stresses of the functionals are s = D y.
"""

import numpy as np
from numba import njit

from ufl_origami.fem.elements import GAUSS, FlatElements

COMPONENTS = np.array([1.0, 2.0, 1.0])
"""How often the components 11, 12, 22 occur in the product of two symmetric tensors."""


def plane_stress(young: np.ndarray, poisson: np.ndarray) -> np.ndarray:
    """Matrices C (n, 3, 3): energy density 1/2 e.C e of strains e = (e_11, e_12, e_22)."""
    c = np.zeros((len(young), 3, 3))
    c[:, 0, 0] = c[:, 2, 2] = 1.0
    c[:, 0, 2] = c[:, 2, 0] = poisson
    c[:, 1, 1] = 2 * (1 - poisson)
    return (young / (1 - poisson**2))[:, None, None] * c


def products(matrix: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Kronecker products (n, 9, 9) of one matrix over the corners with (n, 3, 3) of components."""
    return np.einsum("ab,ncd->nacbd", matrix, c).reshape(len(c), 9, 9)


def bending_matrix(elements: FlatElements, stiffness: np.ndarray) -> np.ndarray:
    """Matrix D (n, 9, 9) of the bending pairings for stiffnesses (n, 3, 3) per area."""
    inverse_mass = 12.0 * (np.eye(3) - 0.25)
    scaled = stiffness / (COMPONENTS[:, None] * COMPONENTS * elements.area[:, None, None])
    return products(inverse_mass, scaled)


def gauss_shapes() -> np.ndarray:
    """Corner functions (6, 3) at the points of edge 0, 1, 2, counter-clockwise."""
    shapes = np.zeros((6, 3))
    for e in range(3):
        for q, s in enumerate(GAUSS):
            shapes[2 * e + q, [(e + 1) % 3, (e + 2) % 3]] = 1 - s, s
    return shapes


def squares(vectors: np.ndarray) -> np.ndarray:
    """(v1 v1, 2 v1 v2, v2 v2): the product v.T v with the components of a tensor T."""
    v1, v2 = vectors[..., 0], vectors[..., 1]
    return np.stack([v1**2, 2 * v1 * v2, v2**2], axis=-1)


def edge_weights(elements: FlatElements, *, normals: bool) -> np.ndarray:
    """Matrix R (n, 9, 6): pairing of each basis tensor with values at the edges' Gauss points.

    Args:
        elements: flat triangles.
        normals: take the tensor's normal component on the edge, else the tangential one.
    """
    edges = elements.edge_vectors
    length = np.linalg.norm(edges, axis=2)
    tangent = edges / length[:, :, None]
    if normals:
        tangent = np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1)
    along = np.repeat(squares(tangent) * 0.5 * length[:, :, None], 2, axis=1)
    return np.einsum("pa,npc->nacp", gauss_shapes(), along).reshape(len(edges), 9, 6)


def membrane_root(elements: FlatElements, stiffness: np.ndarray) -> np.ndarray:
    """Matrix r (n, 9, 12), D = r^T r, of the 9 edge and 3 cell pairings; stiffnesses as above.

    The Regge interpolant is the P1 tensor with the strain's tangential components at the edges'
    Gauss points and its mean.
    """
    n = len(elements.area)
    weights = edge_weights(elements, normals=False)
    length = np.linalg.norm(elements.edge_vectors, axis=2)
    values = np.zeros((n, 9, 9))
    values[:, :6] = weights.transpose(0, 2, 1) / np.repeat(0.5 * length, 2, axis=1)[:, :, None]
    values[:, 6:] = np.tile(np.eye(3) / 3, 3)
    pairings = np.zeros((n, 9, 12))
    pairings[:, :6, :9] = np.linalg.pinv(weights)
    pairings[:, 6:, 9:] = np.eye(3) / (COMPONENTS * elements.area[:, None])[:, :, None]
    interpolation = np.linalg.solve(values, pairings)
    mass = elements.area[:, None, None] * products((np.eye(3) + 1) / 12, stiffness)
    return root(mass) @ interpolation


def root(d: np.ndarray) -> np.ndarray:
    """Matrices r (n, k, k) with r^T r = d, for positive definite d."""
    return np.ascontiguousarray(np.linalg.cholesky(d).transpose(0, 2, 1))


@njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def add_gram(r, b, out):
    """Add (r b)^T (r b) to the leading rows and columns of out, element by element.

    Args:
        r: (n, k, rows).
        b: (n, rows, columns).
        out: (n, m, m), m >= columns.
    """
    n, rows, columns = b.shape
    k = r.shape[1]
    c = np.zeros((k, columns))
    for element in range(n):
        c[:] = 0.0
        for i in range(k):
            for a in range(rows):
                value = r[element, i, a]
                if value != 0.0:
                    for j in range(columns):
                        c[i, j] += value * b[element, a, j]
        for i in range(columns):
            for a in range(k):
                value = c[a, i]
                for j in range(columns):
                    out[element, i, j] += value * c[a, j]
