"""The mid-edge shell's energy of one triangle as a function of six scalars, with its derivatives.

Scalars: the squared edge lengths L_e and the measured tilts s_e (e opposite vertex e). With twice
the area squared D = 4 A^2, altitudes eta_e = sqrt(D / L_e) and p_e = 2 s_e eta_e, the discrete
second fundamental form is

    B = p_0 [[1, 1], [1, 1]] + p_1 [[1, 0], [0, 0]] + p_2 [[0, 0], [0, 1]]

in the basis (x_j - x_i, x_k - x_i), and the energy

    W = 1/2 (a - abar)^T C (a - abar) + 1/2 (b - bbar)^T (h^2/3 C) (b - bbar)

with a = (A11, A12, A22), b = (B11, B12, B22) (mid-edge operator: Grinspun, Gingold, Reisman &
Zorin 2006, doi:10.1111/j.1467-8659.2006.00974.x; energy: Chen et al. 2018,
doi:10.1145/3197517.3201395; the tilt form is ours).

    d ln eta_e / d L_f = rate_ef = D_f / (2 D) - delta_ef / (2 L_e),    D_f = (sum_g L_g) / 2 - L_f
"""

from math import sqrt

from .jit import inlined
from .metric import metric, stress
from .vectors import cross, dot, point, sub


@inlined
def shape(xi, xj, xk):
    """Metric a, squared edge lengths L and D = 4 area^2 of a triangle."""
    a = metric(xi, xj, xk)
    edge = sub(xk, xj)
    normal = cross(sub(xj, xi), sub(xk, xi))
    return a, (dot(edge, edge), a[2], a[0]), dot(normal, normal)


@inlined
def membrane(i, a, elastic):
    """Membrane energy and stress dW/da."""
    strain = sub(a, point(elastic.abar, i))
    sigma = stress(elastic.C, i, strain)
    return 0.5 * dot(sigma, strain), sigma


@inlined
def form(s, lengths, square):
    """Second fundamental form b = (B11, B12, B22), p_e and the altitudes; NaN without area."""
    eta = (
        square / sqrt(square * lengths[0]),
        square / sqrt(square * lengths[1]),
        square / sqrt(square * lengths[2]),
    )
    p = (2.0 * s[0] * eta[0], 2.0 * s[1] * eta[1], 2.0 * s[2] * eta[2])
    return (p[0] + p[1], p[0], p[0] + p[2]), p, eta


@inlined
def bending(i, s, lengths, square, elastic):
    """Bending energy, its derivative f_e with respect to p_e, p_e and the altitudes."""
    b, p, eta = form(s, lengths, square)
    change = sub(b, point(elastic.bbar, i))
    m = stress(elastic.D, i, change)
    return 0.5 * dot(m, change), (m[0] + m[1] + m[2], m[0], m[2]), p, eta


@inlined
def altitude_rates(lengths, square, a, rate):
    """Fill rate[e, f] = d ln eta_e / d L_f; return the D_f."""
    d = (a[1], a[0] - a[1], a[2] - a[1])
    for e in range(3):
        for f in range(3):
            rate[e, f] = 0.5 * d[f] / square
        rate[e, e] -= 0.5 / lengths[e]
    return d


@inlined
def length_forces(sigma):
    """Derivatives with respect to the squared edge lengths, given those with respect to a."""
    half = 0.5 * sigma[1]
    return -half, sigma[2] + half, sigma[0] + half


@inlined
def bending_forces(f, p, rate):
    """Derivatives of the bending energy with respect to the squared edge lengths."""
    return (
        f[0] * p[0] * rate[0, 0] + f[1] * p[1] * rate[1, 0] + f[2] * p[2] * rate[2, 0],
        f[0] * p[0] * rate[0, 1] + f[1] * p[1] * rate[1, 1] + f[2] * p[2] * rate[2, 1],
        f[0] * p[0] * rate[0, 2] + f[1] * p[1] * rate[1, 2] + f[2] * p[2] * rate[2, 2],
    )


@inlined
def stiffness_of_form(c, i, q):
    """Fill q[e, g] with the second derivatives of 1/2 b^T c[i] b with respect to the p_e."""
    q[1, 1] = c[i, 0, 0]
    q[2, 2] = c[i, 2, 2]
    q[1, 2] = q[2, 1] = c[i, 0, 2]
    q[0, 1] = q[1, 0] = c[i, 0, 0] + c[i, 0, 1] + c[i, 0, 2]
    q[0, 2] = q[2, 0] = c[i, 2, 2] + c[i, 1, 2] + c[i, 0, 2]
    q[0, 0] = q[0, 1] + q[0, 2] + c[i, 0, 1] + c[i, 1, 1] + c[i, 1, 2]


@inlined
def stiffness_of_lengths(c, i, k):
    """Fill k[e, g], e, g < 3: second derivatives of 1/2 a^T c[i] a by squared lengths."""
    quarter = 0.25 * c[i, 1, 1]
    k[0, 0] = quarter
    k[0, 1] = k[1, 0] = -quarter - 0.5 * c[i, 1, 2]
    k[0, 2] = k[2, 0] = -quarter - 0.5 * c[i, 0, 1]
    k[1, 1] = quarter + c[i, 1, 2] + c[i, 2, 2]
    k[2, 2] = quarter + c[i, 0, 1] + c[i, 0, 0]
    k[1, 2] = k[2, 1] = quarter + 0.5 * (c[i, 0, 1] + c[i, 1, 2]) + c[i, 0, 2]


@inlined
def scalar_hessian(i, s, state, elastic, work, k):
    """Fill k (6, 6) with the Hessian in (L_0, L_1, L_2, t_0, t_1, t_2).

    Args:
        i: triangle.
        s: (n, 3, 3) measured tilts with derivatives.
        state: (lengths, square, d, f, p, eta) of this triangle.
        elastic: `Elastic`.
        work: (rate, q) scratch (3, 3); rate filled by `altitude_rates`.
        k: output.
    """
    lengths, square, d, f, p, eta = state
    rate, q = work
    stiffness_of_form(elastic.D, i, q)
    stiffness_of_lengths(elastic.C, i, k)
    half = 0.5 * (f[0] * p[0] + f[1] * p[1] + f[2] * p[2]) / square
    for g in range(3):
        for e in range(g + 1):
            value = half * (0.5 - d[e] * d[g] / square)
            for a in range(3):
                row = 0.0
                for b in range(3):
                    row += q[a, b] * p[b] * rate[b, g]
                value += p[a] * rate[a, e] * (row + f[a] * rate[a, g])
            k[e, g] += value
        k[g, g] += 0.5 * f[g] * p[g] / (lengths[g] * lengths[g]) - half
    k[1, 0], k[2, 0], k[2, 1] = k[0, 1], k[0, 2], k[1, 2]
    for e in range(3):
        slope = 2.0 * eta[e] * s[i, e, 1]
        for g in range(3):
            row = f[e] * rate[e, g]
            for a in range(3):
                row += q[e, a] * p[a] * rate[a, g]
            k[3 + e, g] = k[g, 3 + e] = slope * row
            k[3 + e, 3 + g] = slope * q[e, g] * 2.0 * eta[g] * s[i, g, 1]
        k[3 + e, 3 + e] += 2.0 * eta[e] * f[e] * s[i, e, 2]
