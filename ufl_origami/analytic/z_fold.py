"""Exact Z-fold in tension: two elastic panels joined by an elastic crease, and its limits.

Two inextensible panels of widths W_1, W_2 and bending stiffness EI_1, EI_2 (per unit length of
crease; E h^3 / 12) meet at a crease of stiffness K_r (per unit length) whose rest state is an
included angle phi_0 (pi for a flat sheet). The outer edges are free to turn and are held at z = 0,
a distance s_0 + d_1 apart, s_0 the rest distance. No other force acts, so the reaction P is along
x, the moment at a point is P z, and each panel is an arc of `elastica`. Crease and panels balance:

    K_r (phi - phi_0) = P z_crease,   phi = pi - b_1 - b_2,

b_i the panels' slopes at the crease. eta = K_r W / (E h^3) = K_r W / (12 EI).

What is exact: everything, for nu = 0. For nu != 0 a panel bends like a plate of stiffness
E h^3 / (12 (1 - nu^2)) far from its side edges and like a beam (E h^3 / 12) within about a
thickness to a width of them (anticlastic curvature), so that a finite panel lies between the
solutions with these two stiffnesses and its fold angle varies along the crease; neither is exact.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import acos, cos, degrees, inf, isfinite, pi, radians, sin, sqrt
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ufl_origami.analytic.elastica import ArcIntegrals, arc_integrals, arc_profile
from ufl_origami.errors import InputError, SolveError

REST_ANGLE = radians(35.6)  # included rest angle of the paper's Z-fold
_COMPLEX_STEP = 1e-30
_NEWTON_STEPS = 25
_TOLERANCE = 1e-12  # of the scaled residual: angles in radians, lengths over the width


@dataclass(frozen=True)
class ZFold:
    """Two panels and the crease between them, in consistent units, per unit length of crease.

    Attributes:
        widths: W_1, W_2 (length).
        bending_stiffness: EI_1, EI_2 (force * length), E h^3 / 12.
        crease_stiffness: K_r (force); 0 is a free hinge, inf a stiff fold.
        rest_angle: included rest angle phi_0 (radians), 0 < phi_0 < pi.

    Raises:
        InputError: a value is out of range.
    """

    widths: tuple[float, float]
    bending_stiffness: tuple[float, float]
    crease_stiffness: float
    rest_angle: float = REST_ANGLE

    def __post_init__(self) -> None:
        """Refuse values that give no fold."""
        for name in ("widths", "bending_stiffness"):
            values = getattr(self, name)
            if len(values) != 2 or not all(0 < v < inf for v in values):
                raise InputError(f"z-fold: {name} = {values} must be two positive numbers")
        if not self.crease_stiffness >= 0:
            raise InputError(f"z-fold: crease stiffness {self.crease_stiffness} must be >= 0")
        if not 0 < self.rest_angle < pi:
            raise InputError(f"z-fold: rest angle {self.rest_angle} must lie in (0, pi)")

    @classmethod
    def from_eta(
        cls,
        eta: float,
        *,
        stiffness: float = 1.0,
        width: float = 1.0,
        rest_angle: float = REST_ANGLE,
    ) -> Self:
        """Equal panels of EI = `stiffness` with K_r = 12 EI eta / W."""
        return cls((width, width), (stiffness, stiffness), 12 * stiffness * eta / width, rest_angle)

    @property
    def rest_distance(self) -> float:
        """Distance s_0 of the outer edges at rest (length)."""
        w1, w2 = self.widths
        return sqrt((w1 - w2) ** 2 + 2 * w1 * w2 * (1 - cos(self.rest_angle)))

    @property
    def taut_opening(self) -> float:
        """Opening d_1 at which both panels would lie in one plane (length)."""
        return sum(self.widths) - self.rest_distance

    def rigid_angle(self, opening: float) -> float:
        """Included angle of rigid panels at opening d_1 (radians)."""
        self._check_opening(opening)
        distance, (w1, w2) = self.rest_distance + opening, self.widths
        closed = max(distance**2 - (w1 - w2) ** 2, 0.0)
        return 2 * float(np.arctan2(sqrt(closed), sqrt((w1 + w2) ** 2 - distance**2)))

    def solve(self, opening: float) -> "ZFoldState":
        """Equilibrium at opening d_1, 0 <= d_1 < `taut_opening`.

        Raises:
            InputError: the opening is out of range.
            SolveError: Newton's method failed (with the last opening that converged).
        """
        self._check_opening(opening)
        if opening == 0 or self.crease_stiffness == 0:
            return self._rigid_state(opening)
        return _follow(self, opening)

    def _check_opening(self, opening: float) -> None:
        if not (0 <= opening < self.taut_opening and isfinite(opening)):
            raise InputError(
                f"z-fold: opening {opening} must lie in [0, {self.taut_opening:.6g}) (taut)"
            )

    def _rigid_slopes(self, opening: float) -> tuple[float, float]:
        """Angles of the rigid panels with the line of pull (radians)."""
        distance, (w1, w2) = self.rest_distance + opening, self.widths
        cosines = (
            (distance**2 + w1**2 - w2**2) / (2 * distance * w1),
            (distance**2 + w2**2 - w1**2) / (2 * distance * w2),
        )
        return acos(max(-1.0, min(1.0, cosines[0]))), acos(max(-1.0, min(1.0, cosines[1])))

    def _rigid_state(self, opening: float) -> "ZFoldState":
        """State of flat panels without force: at rest, or with a free hinge."""
        return ZFoldState(self, opening, self._rigid_slopes(opening), (0.0, 0.0), 0.0, 0.0)


@dataclass(frozen=True)
class ZFoldState:
    """Equilibrium of a Z-fold; forces and energies per unit length of crease.

    Attributes:
        fold: the fold.
        opening: d_1 (length).
        slopes: angles of the panels with the x axis at the crease (radians).
        arc_parameters: tau of the two panels' arcs (0: flat panel).
        force: pull P, reaction along x of an outer edge (force per length).
        bending_energy: bending energy of both panels (energy per length).
    """

    fold: ZFold
    opening: float
    slopes: tuple[float, float]
    arc_parameters: tuple[float, float]
    force: float
    bending_energy: float

    @property
    def included_angle(self) -> float:
        """Included angle at the crease (radians)."""
        return pi - sum(self.slopes)

    @property
    def included_angle_deg(self) -> float:
        """Included angle at the crease (degrees)."""
        return degrees(self.included_angle)

    @property
    def crease_moment(self) -> float:
        """Moment the panels exert on the crease, P z_crease (force), from statics."""
        return self.force * float(self.profile(2)[0][-1, 1])

    @property
    def crease_energy(self) -> float:
        """1/2 K_r (phi - phi_0)^2, in the form M^2 / (2 K_r) that also holds for K_r = inf."""
        stiffness = self.fold.crease_stiffness
        return 0.0 if stiffness == 0 else self.crease_moment**2 / (2 * stiffness)

    @property
    def energy(self) -> float:
        """Total energy (energy per length)."""
        return self.bending_energy + self.crease_energy

    def profile(self, points: int = 101) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Both panels as (points, 2) arrays of (x, z), each from its outer edge to the crease.

        The first panel starts at x = 0, the second at x = s_0 + d_1.
        """
        first = self._panel(0, points)
        second = self._panel(1, points)
        second[:, 0] = self.fold.rest_distance + self.opening - second[:, 0]
        return first, second

    def _panel(self, index: int, points: int) -> NDArray[np.float64]:
        width, slope = self.fold.widths[index], self.slopes[index]
        tau = self.arc_parameters[index]
        if tau == 0:
            s = np.linspace(0, width, points)
            return np.column_stack([s * np.cos(slope), s * np.sin(slope)])
        _, axial, lateral = arc_profile(tau, slope, points)
        return width * np.column_stack([axial, lateral])


def rigid_force(fold: ZFold, opening: float) -> float:
    """Pull P of rigid panels with an elastic crease: K_r (beta - phi_0) / z_crease.

    Force per length; the limit of `ZFold.solve` for eta -> 0 (relative to K_r).
    """
    beta = fold.rigid_angle(opening)
    height = fold.widths[0] * sin(fold._rigid_slopes(opening)[0])
    return fold.crease_stiffness * (beta - fold.rest_angle) / height


def ritz_angle(eta: Any, rigid: float, rest: float = REST_ANGLE) -> Any:
    """The paper's one-parameter Ritz line: beta + eta (phi_0 - beta) / (1/2 + eta).

    Its 1/2 does not come from elasticity (three to four times too stiff panels); drawn as the
    paper's own line, not as a reference.

    Args:
        eta: K_r W / (E h^3), scalar or array.
        rigid: included angle beta of rigid panels.
        rest: included rest angle phi_0, in the unit of `rigid`.
    """
    return rigid + eta * (rest - rigid) / (0.5 + eta)


def linear_beam_angle(eta: Any, rigid: float, rest: float = REST_ANGLE, *, nu: float = 0.0) -> Any:
    """Linear beam theory, outer edges free to turn: `ritz_angle` with 1 / (8 (1 - nu^2)) for 1/2.

    Each panel turns by M W / (3 EI) at the crease, EI = E h^3 / (12 (1 - nu^2)), M the crease
    moment. The limit of the elastica for small eta or small openings of equal panels (nu = 0,
    or wide panels).

    Args:
        eta: K_r W / (E h^3), scalar or array.
        rigid: included angle beta of rigid panels.
        rest: included rest angle phi_0, in the unit of `rigid`.
        nu: Poisson's ratio.
    """
    return rigid + eta * (rest - rigid) / (1 / (8 * (1 - nu**2)) + eta)


# Unknowns y = (tau_1^2 EI_1 / (W_1^2 P*), the same of panel 2, b_1, b_2); P* = K_eff / W, K_eff the
# stiffness of crease and panels in series. tau^2 EI / W^2 tends to the pull for small deflections,
# so that y is of order one for any ratio of stiffness.


def _scale(fold: ZFold) -> float:
    flexibility = 1 / fold.crease_stiffness + sum(
        w / (3 * ei) for w, ei in zip(fold.widths, fold.bending_stiffness, strict=True)
    )
    return 1 / (flexibility * max(fold.widths))


def _arcs(fold: ZFold, y: NDArray) -> list[ArcIntegrals]:
    """Arcs of the two panels: y holds tau^2 in units of P* W_i^2 / EI_i."""
    scale = _scale(fold)
    return [
        arc_integrals(np.sqrt(y[i] * scale * w**2 / ei), y[2 + i])
        for i, (w, ei) in enumerate(zip(fold.widths, fold.bending_stiffness, strict=True))
    ]


def _pull(fold: ZFold, arcs: list[ArcIntegrals], index: int) -> Any:
    """P = EI k^2 of one panel, k = (dimensionless length) / W."""
    return fold.bending_stiffness[index] * (arcs[index].length / fold.widths[index]) ** 2


def _residual(fold: ZFold, distance: float) -> Callable[[NDArray], NDArray]:
    """Equal pulls, equal heights at the crease, moment balance, prescribed distance."""

    def residual(y: NDArray) -> NDArray:
        arcs = _arcs(fold, y)
        x, z = (
            [w * getattr(arc, side) / arc.length for w, arc in zip(fold.widths, arcs, strict=True)]
            for side in ("axial", "lateral")
        )
        pull = _pull(fold, arcs, 0)
        turned = pi - y[2] - y[3] - fold.rest_angle
        return np.array(
            [
                _pull(fold, arcs, 1) / pull - 1,
                (z[0] - z[1]) / max(fold.widths),
                turned - pull * z[0] / fold.crease_stiffness,
                (x[0] + x[1] - distance) / max(fold.widths),
            ]
        )

    return residual


def _newton(residual: Callable[[NDArray], NDArray], y: NDArray) -> NDArray | None:
    """Newton's method with a complex-step Jacobian; None where it leaves the domain."""
    best = inf
    for _ in range(_NEWTON_STEPS):
        if not (np.all(y[:2] > 0) and np.all((y[2:] > 0) & (y[2:] < pi))):
            return None
        value = residual(y)
        size = float(np.max(np.abs(value)))
        if size < _TOLERANCE and size >= 0.1 * best:
            return y
        best = min(best, size)
        columns = [residual(y + _COMPLEX_STEP * 1j * unit).imag for unit in np.eye(4)]
        y = y - np.linalg.solve(np.column_stack(columns) / _COMPLEX_STEP, value)
    return y if best < _TOLERANCE else None


def _follow(fold: ZFold, opening: float) -> ZFoldState:
    """Follow the equilibrium from rest to the opening, by ever smaller distances to taut."""
    taut = fold.taut_opening
    y, at, ratio = None, 0.0, 0.8
    while at < opening:
        target = max(taut - (taut - at) * ratio, 0.0)
        target = opening if target >= opening else target
        start = _first_guess(fold, target) if y is None else y
        found = _newton(_residual(fold, fold.rest_distance + target), start)
        if found is None:
            ratio = sqrt(ratio)
            if ratio > 1 - 1e-6:
                raise SolveError("z-fold elastica: Newton's method failed", at)
            continue
        y, at = found, target
    assert y is not None
    return _state(fold, opening, y)


def _first_guess(fold: ZFold, opening: float) -> NDArray:
    """Linear estimate from rest: crease and panels in series."""
    turn = fold.rigid_angle(opening) - fold.rest_angle
    slopes = fold._rigid_slopes(opening)
    height = fold.widths[0] * sin(slopes[0])
    pull = turn * max(fold.widths) / height
    bend = [
        pull * _scale(fold) * height * w / (3 * ei)
        for w, ei in zip(fold.widths, fold.bending_stiffness, strict=True)
    ]
    return np.array([pull, pull, slopes[0] + bend[0], slopes[1] + bend[1]])


def _state(fold: ZFold, opening: float, y: NDArray) -> ZFoldState:
    arcs = _arcs(fold, y)
    pairs = list(zip(fold.widths, fold.bending_stiffness, strict=True))
    tau = [sqrt(y[i] * _scale(fold) * w**2 / ei) for i, (w, ei) in enumerate(pairs)]
    bending = sum(
        ei * arc.length * arc.bending / w for (w, ei), arc in zip(pairs, arcs, strict=True)
    )
    return ZFoldState(
        fold,
        opening,
        (float(y[2]), float(y[3])),
        (tau[0], tau[1]),
        float(_pull(fold, arcs, 0)),
        float(bending),
    )
