"""Barrier of contact: energy per area as a function of the gap, and parameters for a scene.

Psi(d) = -k (d - d_hat)^2 ln(d / d_hat) for 0 < d < d_hat, else 0 (Li et al. 2020,
doi:10.1145/3386569.3392425; there per vertex, here per rest area). It pushes outwards, has a
continuous second derivative and is infinite at d = 0.
"""

from dataclasses import dataclass

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_origami.obstacles import positive


@dataclass(frozen=True)
class Barrier:
    """Strength and reach of a barrier.

    Attributes:
        stiffness: k (energy per area and squared length).
        distance: d_hat (length), the gap at which contact begins.
    """

    stiffness: float
    distance: float

    def __post_init__(self) -> None:
        """Refuse values that give no barrier."""
        positive("barrier: stiffness", self.stiffness)
        positive("barrier: distance", self.distance)

    def energy(self, gap: float) -> float:
        """Energy per area at a gap."""
        y = gap / self.distance
        return 0.0 if y >= 1 else -self.stiffness * self.distance**2 * (y - 1) ** 2 * np.log(y)

    def pressure(self, gap: float) -> float:
        """Force per area at a gap."""
        y = gap / self.distance
        bracket = 2 * (y - 1) * np.log(y) + (y - 1) ** 2 / y
        return 0.0 if y >= 1 else self.stiffness * self.distance * bracket


def barrier_energy(gap: Expr, stiffness: Expr, reach: Expr) -> Expr:
    """Energy per area in UFL."""
    inside = -stiffness * (gap - reach) ** 2 * ufl.ln(gap / reach)
    return ufl.conditional(ufl.lt(gap, reach), inside, 0.0)


def barrier_pressure(gap: Expr, stiffness: Expr, reach: Expr) -> Expr:
    """Force per area in UFL, minus the energy's derivative."""
    closed = gap - reach
    inside = stiffness * (2 * closed * ufl.ln(gap / reach) + closed**2 / gap)
    return ufl.conditional(ufl.lt(gap, reach), inside, 0.0)
