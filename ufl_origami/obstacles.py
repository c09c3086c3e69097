"""Rigid obstacles: signed distances, positive outside, written once in UFL.

An obstacle may move; it is described where it stands at displacement zero. Its distance function
takes a position and turns its numbers into UFL constants by `number`, so that no form is compiled
anew for another size.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from ufl.core.expr import Expr
from ufl.corealg.traversal import traverse_unique_terminals
from ufl.geometry import SpatialCoordinate

from ufl_origami.errors import SceneError

Number = Callable[..., Expr]
Point = Sequence[float]

TINY = 1e-30
"""Squared length that keeps roots differentiable where they are not needed."""


class Obstacle(ABC):
    """A rigid body that the sheet may not enter.

    Attributes:
        convex: whether the body is convex, so that its distance is a convex function.
    """

    convex: bool = True

    @abstractmethod
    def distance(self, x: Expr, number: Number) -> Expr:
        """Signed distance of a position.

        Args:
            x: position, UFL vector (3,).
            number: makes a UFL constant of a number or vector.
        """


def finite(label: str, values: Sequence[float] | float, shape: tuple[int, ...]) -> np.ndarray:
    """Values as an array of a shape.

    Raises:
        SceneError: another shape, or a value that is not finite.
    """
    array = np.asarray(values, dtype=float)
    if array.shape != shape or not np.isfinite(array).all():
        wanted = "a finite number" if not shape else f"{shape[0]} finite numbers"
        raise SceneError(f"{label}: expected {wanted}, got {values}")
    return array


def positive(label: str, value: float) -> None:
    """Refuse what is no positive number.

    Raises:
        SceneError: naming it.
    """
    if not float(finite(label, value, ())) > 0:
        raise SceneError(f"{label}: {value} must be positive")


def unit(label: str, vector: Point) -> np.ndarray:
    """Unit vector of a direction.

    Raises:
        SceneError: no finite vector, or zero.
    """
    array = finite(label, vector, (3,))
    length = float(np.linalg.norm(array))
    if length == 0:
        raise SceneError(f"{label}: the vector is zero")
    return array / length


def length(vector: Expr) -> Expr:
    """Length of a UFL vector, differentiable at zero."""
    return ufl.sqrt(ufl.max_value(ufl.inner(vector, vector), TINY))


@dataclass(frozen=True)
class Plane(Obstacle):
    """Half-space below a plane.

    Attributes:
        point: a point of the plane.
        normal: outward direction, of any length.
    """

    point: Point = (0.0, 0.0, 0.0)
    normal: Point = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        """Refuse a plane without normal."""
        finite("plane: point", self.point, (3,))
        unit("plane: normal", self.normal)

    def distance(self, x: Expr, number: Number) -> Expr:
        """Height over the plane."""
        return ufl.inner(number(unit("normal", self.normal)), x - number(self.point))


@dataclass(frozen=True)
class Sphere(Obstacle):
    """Ball.

    Attributes:
        centre: its centre.
        radius: its radius.
    """

    centre: Point
    radius: float

    def __post_init__(self) -> None:
        """Refuse a ball without size."""
        finite("sphere: centre", self.centre, (3,))
        positive("sphere: radius", self.radius)

    def distance(self, x: Expr, number: Number) -> Expr:
        """Distance from the centre less the radius."""
        return length(x - number(self.centre)) - number(self.radius)


@dataclass(frozen=True)
class Cylinder(Obstacle):
    """Infinite circular cylinder.

    Attributes:
        point: a point of its axis.
        axis: direction of the axis, of any length.
        radius: its radius.
    """

    point: Point
    axis: Point
    radius: float

    def __post_init__(self) -> None:
        """Refuse a cylinder without axis or size."""
        finite("cylinder: point", self.point, (3,))
        unit("cylinder: axis", self.axis)
        positive("cylinder: radius", self.radius)

    def distance(self, x: Expr, number: Number) -> Expr:
        """Distance from the axis less the radius."""
        axis, arm = number(unit("axis", self.axis)), x - number(self.point)
        return length(arm - ufl.inner(axis, arm) * axis) - number(self.radius)


@dataclass(frozen=True)
class Box(Obstacle):
    """Box with sides along the axes of a frame.

    Attributes:
        centre: its centre.
        sizes: its three lengths.
        axes: directions of the first two lengths, at right angles; default x and y.
    """

    centre: Point
    sizes: Point
    axes: tuple[Point, Point] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))

    def __post_init__(self) -> None:
        """Refuse a box without sizes or a frame that is none."""
        finite("box: centre", self.centre, (3,))
        for size in finite("box: sizes", self.sizes, (3,)):
            positive("box: size", size)
        first, second = (unit("box: axis", axis) for axis in self.axes)
        if abs(first @ second) > 1e-9:
            raise SceneError(f"box: axes {self.axes} are not at right angles")

    def distance(self, x: Expr, number: Number) -> Expr:
        """Exact distance outside, largest distance from a side (negative) inside."""
        first, second = (unit("axis", axis) for axis in self.axes)
        arm, half = x - number(self.centre), 0.5 * np.asarray(self.sizes, dtype=float)
        frame = (first, second, np.cross(first, second))
        over = [
            abs(ufl.inner(number(a), arm)) - number(h) for a, h in zip(frame, half, strict=True)
        ]
        outside = ufl.as_vector([ufl.max_value(value, 0.0) for value in over])
        largest = ufl.max_value(over[0], ufl.max_value(over[1], over[2]))
        return ufl.conditional(ufl.gt(largest, 0.0), length(outside), largest)


@dataclass(frozen=True)
class SignedDistance(Obstacle):
    """Any signed-distance function.

    Attributes:
        function: UFL expression in `ufl.SpatialCoordinate(sheet.mesh)`, or a function that takes a
            position (UFL vector) and returns one. Its gradient must not be longer than 1, or
            contact is found too late; it is checked where the sheet starts.
        convex: see `Obstacle`.
    """

    function: Expr | Callable[[Expr], Expr]
    convex: bool = False

    def distance(self, x: Expr, number: Number) -> Expr:
        """The function at a position.

        Raises:
            SceneError: what it gives is no scalar of UFL.
        """
        if isinstance(self.function, Expr):
            places = {
                node: x
                for node in traverse_unique_terminals(self.function)
                if isinstance(node, SpatialCoordinate)
            }
            found = ufl.replace(self.function, places)
        else:
            found = self.function(x)
        if not isinstance(found, Expr) or found.ufl_shape != ():
            raise SceneError(f"signed distance: {found!r} is no scalar UFL expression")
        return found
