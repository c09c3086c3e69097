"""Rotational energy of the creases, on the virtual fold angles alone.

U = sum over crease edges of Lbar w(phi) with w = 1/2 K_r (phi - phi_0)^2 per unit length or any
callable law; Lbar is the rest length of the edge.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ufl_origami.configuration import Configuration, State
from ufl_origami.errors import SceneError
from ufl_origami.terms.base import StencilTerm

TimeFunction = Callable[[float], float]


class CreaseLaw(Protocol):
    """Energy per unit length of a crease as a function of its fold angle and time."""

    def __call__(self, angle: np.ndarray, time: float) -> tuple[np.ndarray, ...]:
        """Energy, moment and stiffness per unit length, each of angle's shape (radians)."""


@dataclass(frozen=True)
class LinearLaw:
    """Spring K_r (phi - phi_0) per unit length.

    Attributes:
        stiffness: K_r (moment per length and radian), number or function of time.
        rest_angle: phi_0 (radians): number, array of the edges' values, or function of time.
    """

    stiffness: float | TimeFunction
    rest_angle: np.ndarray | float | TimeFunction

    def __call__(self, angle: np.ndarray, time: float) -> tuple[np.ndarray, ...]:
        """Energy, moment and stiffness per unit length."""
        stiffness = self.stiffness(time) if callable(self.stiffness) else self.stiffness
        rest = self.rest_angle(time) if callable(self.rest_angle) else self.rest_angle
        opening = angle - rest
        return (
            0.5 * stiffness * opening**2,
            stiffness * opening,
            np.full_like(angle, stiffness),
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


@dataclass(frozen=True)
class CreaseEdges:
    """Edges of one spring between two panels: angle = constant + coefficients . unknowns.

    Attributes:
        length: (n,) rest lengths.
        slot: (n, 2) local scalar indices, -1 where unused.
        coefficient: (n, 2) factors of the unknowns.
        constant: (n,) radians.
    """

    length: np.ndarray
    slot: np.ndarray
    coefficient: np.ndarray
    constant: np.ndarray

    def angle(self, scalars: np.ndarray) -> np.ndarray:
        """Virtual fold angle (n,) in radians."""
        if not len(self.slot):
            return self.constant
        used = np.where(self.slot >= 0, scalars[np.maximum(self.slot, 0)], 0.0)
        return self.constant + (self.coefficient * used).sum(axis=1)


class CreaseTerm(StencilTerm):
    """Springs of one named crease.

    Args:
        configuration: numbering of the unknowns.
        edges: this rank's owned edges.
        law: energy, moment and stiffness per unit length.
    """

    kinds = ("crease",)

    def __init__(self, configuration: Configuration, edges: CreaseEdges, law: CreaseLaw):
        self.edges, self.law = edges, law
        self._dofs = np.where(edges.slot >= 0, 3 * configuration.nv + edges.slot, -1).astype(
            np.int32
        )
        self._time = 0.0

    def set_time(self, time: float) -> None:
        """Time at which the law is taken."""
        self._time = time

    def stencils(self) -> list[np.ndarray]:
        """Virtual angles of each edge."""
        return [self._dofs]

    def _law(self, state: State) -> tuple[np.ndarray, ...]:
        values = self.law(self.edges.angle(state.scalars), self._time)
        return tuple(self.edges.length * value for value in values)

    def energies(self, state: State) -> np.ndarray:
        """Rotational energy of this rank's edges."""
        return np.array([self._law(state)[0].sum()])

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the moments to the virtual angles."""
        moment = self._law(state)[1][:, None] * self.edges.coefficient
        used = self._dofs >= 0
        np.add.at(out, self._dofs[used], moment[used])

    def largest_turn(self, state: State, step: np.ndarray) -> float:
        """Largest change (radians) of the virtual fold angles over a step."""
        change = np.where(self._dofs >= 0, step[self._dofs], 0.0) * self.edges.coefficient
        return float(np.abs(change.sum(axis=1)).max(initial=0.0))

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the rotational stiffness of each edge."""
        k = self.edges.coefficient
        blocks[0][:] = self._law(state)[2][:, None, None] * k[:, :, None] * k[:, None, :]
