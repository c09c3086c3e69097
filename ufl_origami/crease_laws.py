"""Moment-angle laws of creases, per unit length: what a scene says of them, in any model."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ufl_origami.errors import SceneError

TimeFunction = Callable[[float], float]


class CreaseLaw(Protocol):
    """Energy per unit length of a crease as a function of its fold angle and time."""

    def __call__(self, angle: np.ndarray, time: float) -> tuple[np.ndarray, ...]:
        """Energy, moment and stiffness per unit length, each of angle's shape (radians)."""


@dataclass(frozen=True)
class LinearLaw:
    """Spring K_r (phi - phi_0) per unit length.

    Attributes:
        stiffness: K_r (moment per length and radian): number, array of the edges' values, or
            function of time.
        rest_angle: phi_0 (radians): number, array of the edges' values, or function of time.
    """

    stiffness: np.ndarray | float | TimeFunction
    rest_angle: np.ndarray | float | TimeFunction

    def __call__(self, angle: np.ndarray, time: float) -> tuple[np.ndarray, ...]:
        """Energy, moment and stiffness per unit length."""
        stiffness = self.stiffness(time) if callable(self.stiffness) else self.stiffness
        rest = self.rest_angle(time) if callable(self.rest_angle) else self.rest_angle
        opening = angle - rest
        return (
            0.5 * stiffness * opening**2,
            stiffness * opening,
            np.broadcast_to(stiffness, angle.shape),
        )


@dataclass(frozen=True)
class MomentLaw:
    """Crease with any moment-angle curve.

    Attributes:
        moment: function of angles (n,) in radians: moment per unit length (n,).
        stiffness: its derivative, (n,).
        rest_angle: angle from which the energy is counted (radians).
    """

    moment: Callable[[np.ndarray], np.ndarray]
    stiffness: Callable[[np.ndarray], np.ndarray]
    rest_angle: float

    def __post_init__(self) -> None:
        """Refuse a stiffness that is not the moment's derivative."""
        angle = self.rest_angle + np.linspace(-1.0, 1.0, 9)
        step = 1e-5
        slope = (self.moment(angle + step) - self.moment(angle - step)) / (2 * step)
        given = np.broadcast_to(self.stiffness(angle), angle.shape)
        scale = np.abs(given).max() + np.abs(slope).max()
        wrong = np.abs(slope - given) > 1e-4 * scale
        if wrong.any():
            k = int(np.argmax(wrong))
            raise SceneError(
                f"moment law: stiffness {given[k]:g} at angle {angle[k]:g} is not the moment's "
                f"derivative {slope[k]:g}"
            )

    def __call__(self, angle: np.ndarray, time: float) -> tuple[np.ndarray, ...]:
        """Energy (Gauss quadrature of the moment from the rest angle), moment and stiffness."""
        node, weight = np.polynomial.legendre.leggauss(20)
        half = 0.5 * (angle - self.rest_angle)
        at = self.rest_angle + half[:, None] * (1 + node)
        energy = half * (self.moment(at) * weight).sum(axis=1)
        return energy, self.moment(angle), np.broadcast_to(self.stiffness(angle), angle.shape)
