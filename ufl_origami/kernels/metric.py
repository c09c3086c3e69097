"""Metric of triangles: first fundamental form, areas, altitudes, membrane stress.

Triangle (i, j, k) with covariant basis (x_j - x_i, x_k - x_i); its metric is the vector a = (A11,
A12, A22), its membrane energy 1/2 (a - abar)^T C (a - abar) (Saint Venant-Kirchhoff, plane
stress; C from `plane_stress_stiffness`).
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .jit import inlined, kernel
from .vectors import cross, dot, norm, point, sub


class Elastic(NamedTuple):
    """Elastic data of a batch of n triangles.

    Attributes:
        C: (n, 3, 3) membrane stiffness on (A11, A12, A22), area and thickness included.
        abar: (n, 3) rest metric.
        bbar: (n, 3) rest second form (B11, B12, B22).
        D: (n, 3, 3) bending stiffness on (B11, B12, B22): h^2 / 3 times that of the membrane.
    """

    C: np.ndarray
    abar: np.ndarray
    bbar: np.ndarray
    D: np.ndarray


def plane_stress_stiffness(
    abar: npt.NDArray,
    *,
    young: npt.ArrayLike,
    poisson: npt.ArrayLike,
    thickness: npt.ArrayLike,
) -> npt.NDArray:
    """Matrix C of the membrane energy h/8 |Abar^-1 (A - Abar)|^2_SV 2 area.

    |M|^2_SV = lam/2 tr(M)^2 + mu tr(M^2) with plane stress lam = E nu / (1 - nu^2), mu = E / (2
    (1 + nu)) (Weischedel 2012; Chen et al. 2018, doi:10.1145/3197517.3201395).

    Args:
        abar: (n, 3) rest metrics.
        young: Young's modulus, scalar or (n,).
        poisson: Poisson's ratio, scalar or (n,).
        thickness: thickness h, scalar or (n,).

    Returns:
        (n, 3, 3) symmetric matrices on (A11, A12, A22).
    """
    a11, a12, a22 = np.asarray(abar, float).T
    det = a11 * a22 - a12**2
    g11, g12, g22 = a22 / det, -a12 / det, a11 / det
    trace = np.stack([g11, 2 * g12, g22], axis=-1)
    square = np.empty((len(det), 3, 3))
    square[:, 0, 0], square[:, 2, 2] = g11**2, g22**2
    square[:, 1, 1] = 2 * (g12**2 + g11 * g22)
    square[:, 0, 2] = square[:, 2, 0] = g12**2
    square[:, 0, 1] = square[:, 1, 0] = 2 * g11 * g12
    square[:, 1, 2] = square[:, 2, 1] = 2 * g22 * g12
    e, nu, h = (np.asarray(v, float) for v in (young, poisson, thickness))
    lam, mu = e * nu / (1 - nu**2), e / (2 * (1 + nu))
    weight = h * np.sqrt(det) / 4
    outer = trace[:, :, None] * trace[:, None, :]
    return (lam * weight / 2)[:, None, None] * outer + (mu * weight)[:, None, None] * square


@inlined
def metric(xi, xj, xk):
    """First fundamental form (A11, A12, A22)."""
    v, w = sub(xj, xi), sub(xk, xi)
    return dot(v, v), dot(v, w), dot(w, w)


@inlined
def stress(stiffness, i, e):
    """Product C[i] e."""
    c = stiffness
    return (
        c[i, 0, 0] * e[0] + c[i, 0, 1] * e[1] + c[i, 0, 2] * e[2],
        c[i, 1, 0] * e[0] + c[i, 1, 1] * e[1] + c[i, 1, 2] * e[2],
        c[i, 2, 0] * e[0] + c[i, 2, 1] * e[1] + c[i, 2, 2] * e[2],
    )


@kernel
def metrics(x, verts, a):
    """First fundamental forms.

    Args:
        x: (nv, 3) positions.
        verts: (n, 3 or more) int32; the first three are the triangle.
        a: (n, 3) output.
    """
    for i in range(verts.shape[0]):
        xi, xj, xk = point(x, verts[i, 0]), point(x, verts[i, 1]), point(x, verts[i, 2])
        a[i, 0], a[i, 1], a[i, 2] = metric(xi, xj, xk)


@kernel
def areas(x, verts, out):
    """Areas of triangles: x (nv, 3), verts (n, 3 or more) int32, out (n,)."""
    for i in range(verts.shape[0]):
        xi, xj, xk = point(x, verts[i, 0]), point(x, verts[i, 1]), point(x, verts[i, 2])
        out[i] = 0.5 * norm(cross(sub(xj, xi), sub(xk, xi)))


@kernel
def altitudes(x, verts, out):
    """Altitudes onto edge e (opposite vertex e): x (nv, 3), verts (n, 3 or more), out (n, 3)."""
    for i in range(verts.shape[0]):
        xi, xj, xk = point(x, verts[i, 0]), point(x, verts[i, 1]), point(x, verts[i, 2])
        twice_area = norm(cross(sub(xj, xi), sub(xk, xi)))
        out[i, 0] = twice_area / norm(sub(xk, xj))
        out[i, 1] = twice_area / norm(sub(xi, xk))
        out[i, 2] = twice_area / norm(sub(xj, xi))


@kernel
def membrane_stress(x, verts, elastic, sigma):
    """Membrane stress dW/da = C (a - abar), conjugate to (A11, A12, A22).

    Args:
        x: (nv, 3) positions.
        verts: (n, 3 or more) int32.
        elastic: `Elastic`.
        sigma: (n, 3) output.
    """
    for i in range(verts.shape[0]):
        a = metric(point(x, verts[i, 0]), point(x, verts[i, 1]), point(x, verts[i, 2]))
        sigma[i, 0], sigma[i, 1], sigma[i, 2] = stress(elastic.C, i, sub(a, point(elastic.abar, i)))


@kernel
def extrapolated_stress(x_prev, dx, verts, elastic, sigma):
    """Membrane stress advanced linearly: C (a(x_prev) - abar + da(x_prev) . dx).

    It is the stress that a mixed formulation has after the step dx; used in the geometric
    stiffness it gives the mixed-integration-point tangent (Magisano, Leonetti & Garcea 2017,
    doi:10.1016/j.cma.2016.10.040).

    Args:
        x_prev: (nv, 3) positions of the previous iterate.
        dx: (nv, 3) step from there to the current iterate.
        verts: (n, 3 or more) int32.
        elastic: `Elastic`.
        sigma: (n, 3) output.
    """
    for i in range(verts.shape[0]):
        i0, i1, i2 = verts[i, 0], verts[i, 1], verts[i, 2]
        xi, di = point(x_prev, i0), point(dx, i0)
        v, w = sub(point(x_prev, i1), xi), sub(point(x_prev, i2), xi)
        dv, dw = sub(point(dx, i1), di), sub(point(dx, i2), di)
        e = (
            dot(v, v) - elastic.abar[i, 0] + 2.0 * dot(v, dv),
            dot(v, w) - elastic.abar[i, 1] + dot(v, dw) + dot(w, dv),
            dot(w, w) - elastic.abar[i, 2] + 2.0 * dot(w, dw),
        )
        sigma[i, 0], sigma[i, 1], sigma[i, 2] = stress(elastic.C, i, e)
