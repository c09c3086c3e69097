"""Rotational energy of the creases, on the virtual fold angles alone.

U = sum over crease edges of Lbar w(phi) with w = 1/2 K_r (phi - phi_0)^2 per unit length or any
callable law; Lbar is the rest length of the edge.
"""

from dataclasses import dataclass

import numpy as np

from ufl_origami.configuration import Configuration, State
from ufl_origami.crease_laws import CreaseLaw, LinearLaw
from ufl_origami.terms.base import StencilTerm


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
        self._given = law
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

    def refer(self, scalars: np.ndarray, factor: float) -> None:
        """Take edge unknowns (ns,) as stress-free, and the law's stiffness there times a factor.

        Where the law's moment falls there is none.
        """
        angle = self.edges.angle(scalars)
        stiffness = np.maximum(self._given(angle, self._time)[2], 0.0)
        self.law = LinearLaw(factor * stiffness, angle)

    def largest_turn(self, state: State, step: np.ndarray) -> float:
        """Largest change (radians) of the virtual fold angles over a step."""
        change = np.where(self._dofs >= 0, step[self._dofs], 0.0) * self.edges.coefficient
        return float(np.abs(change.sum(axis=1)).max(initial=0.0))

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the rotational stiffness of each edge."""
        k = self.edges.coefficient
        blocks[0][:] = self._law(state)[2][:, None, None] * k[:, :, None] * k[:, None, :]
