"""Exact planar elastica: an inextensible strip pulled at a moment-free end, and the circle.

A strip of length L and bending stiffness EI (per unit width, force * length) runs from a
moment-free end, where a pull P acts, to an end with a known tangent. With psi the angle between
tangent and line of pull, psi = a at the free end and psi = b at the other, equilibrium is
EI psi'' = P sin(psi), psi' = 0 at the free end. One parameter tau >= 0 solves it:

    tan(psi/2) = tan(a/2) cosh(tau),   k ds = sqrt(1 + tan(a/2)^2) dtau / sqrt(1 + tan(psi/2)^2),

k = sqrt(P/EI). The integrands are positive and analytic in a strip of half width pi/2, so that
composite Gauss quadrature is exact to rounding, from the straight strip (tau -> 0) to the nearly
taut one (tau of several hundred). The same arc is the cantilever under a dead end shear (b = pi/2)
and each panel of a pulled fold. Bisshopp & Drucker 1945, doi:10.1090/qam/13360, hold the
cantilever in elliptic integrals.
"""

from dataclasses import dataclass
from math import atan, ceil, cos, inf, isfinite, pi, sin, sqrt, tan
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from ufl_origami.errors import InputError

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_BENT = 45.0  # further than this from its end an arc is straight: tan(psi/2)^2 < e^-88


@dataclass(frozen=True)
class ArcIntegrals:
    """Integrals over an arc from its moment-free end, as multiples of 1/k, k = sqrt(P/EI).

    Attributes:
        length: arc length times k.
        axial: extent along the line of pull times k.
        lateral: extent across the line of pull times k; also the end curvature over k.
        bending: bending energy over EI k.
    """

    length: Any
    axial: Any
    lateral: Any
    bending: Any


def _gauss(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Composite Gauss nodes and weights on [0, 1] with `count` equal parts."""
    nodes = (np.arange(count)[:, None] + (_NODES + 1) / 2) / count
    return nodes.ravel(), np.tile(_WEIGHTS / (2 * count), count)


def _half_tangents(tau: Any, tau_end: Any, end: Any) -> tuple[Any, Any]:
    """tan(a/2) cosh(tau) and tan(a/2) sinh(tau), where end = tan(a/2) cosh(tau_end)."""
    scale = end * np.exp(tau - tau_end) / (1 + np.exp(-2 * tau_end))
    return scale * (1 + np.exp(-2 * tau)), -scale * np.expm1(-2 * tau)


def arc_integrals(tau_end: Any, end_angle: Any) -> ArcIntegrals:
    """Integrals of the arc with parameter `tau_end` and end tangent angle `end_angle`.

    Real or complex arguments (complex ones serve for derivatives by a complex step).

    Args:
        tau_end: parameter of the far end, Re > 0.
        end_angle: angle b between tangent and pull at the far end, radians, 0 < Re b < pi.
    """
    end = np.tan(end_angle / 2)
    straight = max(np.real(tau_end) - _BENT, 0.0)
    bent = tau_end - straight
    nodes, weights = _gauss(ceil(np.real(bent)) + 1)
    t, ta_sinh = _half_tangents(straight + nodes * bent, tau_end, end)
    ta = _half_tangents(0.0, tau_end, end)[0]
    speed = bent * weights * np.sqrt((1 + ta**2) / (1 + t**2))
    end_sinh = _half_tangents(tau_end, tau_end, end)[1]
    return ArcIntegrals(
        length=straight + np.sum(speed),
        axial=straight + np.sum(speed * (1 - t**2) / (1 + t**2)),
        lateral=2 * end_sinh / np.sqrt((1 + end**2) * (1 + ta**2)),
        bending=np.sum(speed * 2 * ta_sinh**2 / ((1 + t**2) * (1 + ta**2))),
    )


def arc_parameter(load: float, end_angle: float) -> float:
    """Parameter tau_end of the arc of given load and end tangent.

    Args:
        load: L sqrt(P/EI) > 0, the arc's dimensionless length.
        end_angle: angle b between tangent and pull at the far end, radians, 0 < b < pi.
    """
    if not 0 < load < inf:
        raise InputError(f"elastica: load L sqrt(P/EI) = {load} must be positive and finite")
    if not 0 < end_angle < pi:
        raise InputError(f"elastica: end angle {end_angle} must lie in (0, pi)")
    high = 2 * load
    while arc_integrals(high, end_angle).length < load:
        high *= 2
    return float(
        brentq(
            lambda tau: arc_integrals(tau, end_angle).length - load,
            load * (1 - 1e-12),  # length <= tau_end, as ds k <= dtau
            high,
            xtol=1e-15 * load,
            rtol=1e-15,
        )
    )


def arc_profile(
    tau_end: float, end_angle: float, points: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Tangent angle, axial and lateral position along the arc, from its moment-free end.

    Args:
        tau_end: parameter of the far end, > 0.
        end_angle: angle between tangent and pull at the far end, radians.
        points: number of points, at least 2, equally spaced in tau.

    Returns:
        psi (points,) in radians, axial and lateral position (points,) in units of arc length.
    """
    if points < 2:
        raise InputError(f"elastica: a profile needs at least 2 points, not {points}")
    end = tan(end_angle / 2)
    nodes, weights = _gauss(ceil(tau_end / (points - 1)) + 1)
    step = tau_end / (points - 1)
    tau = step * (np.arange(points - 1)[:, None] + nodes)
    t = _half_tangents(tau, tau_end, end)[0]
    ta = _half_tangents(0.0, tau_end, end)[0]
    speed = step * weights * np.sqrt((1 + ta**2) / (1 + t**2))
    axial = np.concatenate([[0], np.cumsum(np.sum(speed * (1 - t**2) / (1 + t**2), axis=1))])
    t, ta_sinh = _half_tangents(np.linspace(0, tau_end, points), tau_end, end)
    lateral = 2 * ta_sinh / np.sqrt((1 + t**2) * (1 + ta**2))
    length = np.sum(speed)
    return 2 * np.arctan(t), axial / length, lateral / length


@dataclass(frozen=True)
class TipState:
    """Tip of a cantilever clamped along x at the origin.

    Attributes:
        u: shortening, displacement of the tip along -x (length).
        w: deflection, displacement of the tip along z (length).
        angle: rotation of the tip (radians).
    """

    u: float
    w: float
    angle: float


def cantilever_end_shear(load: float, *, length: float = 1.0) -> TipState:
    """Inextensible cantilever under a dead end force across its first axis.

    Args:
        load: P L^2 / EI >= 0.
        length: L (length).

    Raises:
        InputError: negative load or a length that is not positive.
    """
    _check_cantilever(load, length)
    if load == 0:
        return TipState(0.0, 0.0, 0.0)
    tau_end = arc_parameter(sqrt(load), pi / 2)
    arc = arc_integrals(tau_end, pi / 2)
    tip = pi / 2 - 2 * atan(float(_half_tangents(0.0, tau_end, 1.0)[0]))
    u, w = 1 - arc.lateral / arc.length, arc.axial / arc.length
    return TipState(float(length * u), float(length * w), tip)


def cantilever_end_moment(load: float, *, length: float = 1.0) -> TipState:
    """Inextensible cantilever under an end moment: an arc of a circle of angle M L / EI.

    Args:
        load: M L / EI >= 0; 2 pi rolls the strip into a full circle.
        length: L (length).

    Raises:
        InputError: negative load or a length that is not positive.
    """
    _check_cantilever(load, length)
    if load == 0:
        return TipState(0.0, 0.0, 0.0)
    return TipState(length * (1 - sin(load) / load), length * (1 - cos(load)) / load, load)


def _check_cantilever(load: float, length: float) -> None:
    if not (load >= 0 and isfinite(load)):
        raise InputError(f"cantilever: load = {load} must be finite and not negative")
    if not (length > 0 and isfinite(length)):
        raise InputError(f"cantilever: length = {length} must be positive and finite")
