"""Isotropic plane-stress sheet material (St. Venant-Kirchhoff)."""

from dataclasses import dataclass
from math import isfinite

from ufl_origami.errors import SceneError


@dataclass(frozen=True)
class Material:
    """Elastic sheet, in the user's own consistent units.

    Attributes:
        E: Young's modulus (force / length^2).
        nu: Poisson's ratio, -1 < nu <= 1/2.
        h: thickness (length).
        rho: mass density (mass / length^3); zero where a scene needs no inertia.

    Raises:
        SceneError: a value is not finite or out of range.
    """

    E: float
    nu: float
    h: float
    rho: float = 0.0

    def __post_init__(self) -> None:
        """Refuse values that give no elastic sheet."""
        for name in ("E", "nu", "h", "rho"):
            if not isfinite(getattr(self, name)):
                raise SceneError(f"material: {name} = {getattr(self, name)} is not finite")
        if self.E <= 0:
            raise SceneError(f"material: Young's modulus E = {self.E} must be positive")
        if not -1 < self.nu <= 0.5:
            raise SceneError(f"material: Poisson's ratio nu = {self.nu} must lie in (-1, 1/2]")
        if self.h <= 0:
            raise SceneError(f"material: thickness h = {self.h} must be positive")
        if self.rho < 0:
            raise SceneError(f"material: density rho = {self.rho} must not be negative")

    @property
    def bending_stiffness(self) -> float:
        """D = E h^3 / (12 (1 - nu^2)), moment per curvature and per width."""
        return self.E * self.h**3 / (12 * (1 - self.nu**2))
