"""Friction laws: traction over normal pressure as a function of the sliding velocity, in UFL.

A law regularises Coulomb's at the speed eps: nothing truly sticks, and at rest on an incline a
block creeps (for the isotropic law at eps (1 - sqrt(1 - tan(slope) / mu))).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import ufl
from ufl.core.expr import Expr

from ufl_origami.errors import SceneError
from ufl_origami.obstacles import finite, positive, unit

Number = Callable[..., Expr]
Carry = Callable[["Direction"], Expr]
TINY = 1e-20
"""Squared sliding speed over eps that keeps the root differentiable at rest."""


@dataclass(frozen=True)
class Direction:
    """A direction along the obstacle's surface.

    Attributes:
        vector: (3,) of any length; its part along the surface counts.
        carried: whether it is one of the sheet at rest, carried along, or one fixed in space.
    """

    vector: Sequence[float]
    carried: bool = True

    def __post_init__(self) -> None:
        """Refuse a vector that is none."""
        unit("friction: direction", self.vector)


def require_direction(direction: object) -> None:
    """Refuse what is no direction.

    Raises:
        SceneError: telling how to make one.
    """
    if not isinstance(direction, Direction):
        raise SceneError(
            f"friction: {direction!r} is no direction: Direction(vector) is carried by the sheet, "
            "Direction(vector, carried=False) fixed in space"
        )


def coefficient(label: str, value: float) -> None:
    """Refuse a friction coefficient that is negative or not finite.

    Raises:
        SceneError: naming it.
    """
    if not float(finite(label, value, ())) >= 0:
        raise SceneError(f"{label}: {value} must not be negative")


class FrictionLaw(ABC):
    """Traction that slows sliding, the derivative of a convex potential in the velocity.

    Attributes:
        couples_nodes: whether it has directions that the sheet carries.
    """

    couples_nodes: bool = False

    @abstractmethod
    def potential(self, slip: Expr, number: Number, carry: Carry) -> Expr:
        """Potential over the normal pressure.

        Args:
            slip: tangential velocity relative to the obstacle, UFL vector (3,).
            number: makes a UFL constant of a number or vector.
            carry: current unit vector of a direction along the surface.
        """

    def drag(self, slip: Expr, number: Number, carry: Carry) -> Expr:
        """Minus the traction over the normal pressure, a UFL vector (3,)."""
        velocity = ufl.variable(slip)
        return ufl.diff(self.potential(velocity, number, carry), velocity)


def coulomb_potential(y: Expr) -> Expr:
    """Integral of 2 y - y^2 below 1, else 1 (Li et al. 2020, doi:10.1145/3386569.3392425)."""
    return ufl.conditional(ufl.lt(y, 1.0), y**2 - y**3 / 3, y - 1 / 3)


def one_way_potential(y: Expr) -> Expr:
    """Integral of 0 for y < 0, 3 y^2 - 2 y^3 up to 1, then 1."""
    rising = ufl.conditional(ufl.lt(y, 1.0), y**3 - 0.5 * y**4, y - 0.5)
    return ufl.conditional(ufl.lt(y, 0.0), 0.0, rising)


def root(square: Expr) -> Expr:
    """Square root, differentiable at zero."""
    return ufl.sqrt(ufl.max_value(square, TINY))


@dataclass(frozen=True)
class Coulomb(FrictionLaw):
    """Drag mu f(|v| / eps) along v, f(y) = 2 y - y^2 below 1, else 1.

    Attributes:
        mu: coefficient of friction.
        eps: sliding speed from which on the whole friction acts.
    """

    mu: float
    eps: float

    def __post_init__(self) -> None:
        """Refuse a negative coefficient or a speed that is not positive."""
        coefficient("friction: mu", self.mu)
        positive("friction: eps", self.eps)

    def potential(self, slip: Expr, number: Number, carry: Carry) -> Expr:
        """Potential of speed alone."""
        y = root(ufl.inner(slip, slip) / number(self.eps) ** 2)
        return number(self.mu) * number(self.eps) * coulomb_potential(y)


@dataclass(frozen=True)
class Anisotropic(FrictionLaw):
    """Coefficients along and across a direction: the drag lies on their ellipse.

    With w = (mu_along v_along, mu_across v_across) and y = |w| / (mu_max eps) the potential is
    mu_max eps times Coulomb's of y, so that sliding in a direction meets its own coefficient.

    Attributes:
        mu_along: coefficient for sliding along the direction.
        mu_across: coefficient for sliding across it.
        direction: the direction.
        eps: sliding speed, in the direction of the larger coefficient, from which on the whole
            friction acts.
    """

    mu_along: float
    mu_across: float
    direction: Direction
    eps: float

    def __post_init__(self) -> None:
        """Refuse negative coefficients, two zeros, a speed that is not positive, no direction."""
        coefficient("friction: mu_along", self.mu_along)
        coefficient("friction: mu_across", self.mu_across)
        positive("friction: larger coefficient", max(self.mu_along, self.mu_across))
        positive("friction: eps", self.eps)
        require_direction(self.direction)

    @property
    def couples_nodes(self) -> bool:  # type: ignore[override]
        """Whether the direction is carried by the sheet."""
        return self.direction.carried

    def potential(self, slip: Expr, number: Number, carry: Carry) -> Expr:
        """Potential of the weighted speed."""
        largest, eps = number(max(self.mu_along, self.mu_across)), number(self.eps)
        along = ufl.inner(slip, carry(self.direction))
        across = ufl.inner(slip, slip) - along**2
        weighted = number(self.mu_along) ** 2 * along**2 + number(self.mu_across) ** 2 * across
        return largest * eps * coulomb_potential(root(weighted / (largest * eps) ** 2))


@dataclass(frozen=True)
class OneWay(FrictionLaw):
    """Drag mu g(v . direction / eps) along a direction: free the other way and across.

    g(y) = 0 for y < 0, 3 y^2 - 2 y^3 up to 1, then 1: a foot of a crawler.

    Attributes:
        mu: coefficient of friction.
        direction: sliding this way meets the friction.
        eps: sliding speed from which on the whole friction acts.
    """

    mu: float
    direction: Direction
    eps: float

    def __post_init__(self) -> None:
        """Refuse a negative coefficient, a speed that is not positive, or no direction."""
        coefficient("friction: mu", self.mu)
        positive("friction: eps", self.eps)
        require_direction(self.direction)

    @property
    def couples_nodes(self) -> bool:  # type: ignore[override]
        """Whether the direction is carried by the sheet."""
        return self.direction.carried

    def potential(self, slip: Expr, number: Number, carry: Carry) -> Expr:
        """Potential of the speed along the direction."""
        y = ufl.inner(slip, carry(self.direction)) / number(self.eps)
        return number(self.mu) * number(self.eps) * one_way_potential(y)
