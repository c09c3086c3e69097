"""What a scene consists of: named declarations and the values that they take.

Values: a number or vector is multiplied by the load factor; a function of time is taken as it is.
In statics time is the load factor; while real time runs the load factor is held (1 in a run that
starts at rest). Displacement components may also be functions f(time, rest) of the rest
coordinates (n, 3) of the nodes.
"""

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ufl_origami.crease_laws import CreaseLaw
from ufl_origami.errors import SceneError

TimeFunction = Callable[[float], float]
Scalar = float | TimeFunction
Displacement = Scalar | Callable[..., np.ndarray | float]
Vector = Sequence[float] | Callable[[float], np.ndarray]
Pair = tuple[str, str]


@dataclass
class LoadFactor:
    """Factor of all numbers that a scene declares, as a function of time.

    Attributes:
        held: the factor while real time runs; None: time is the load factor.
    """

    held: float | None = None

    def __call__(self, time: float) -> float:
        """Factor at a time."""
        return time if self.held is None else self.held


def scalar_function(value: Scalar, label: str, factor: LoadFactor) -> TimeFunction:
    """Function of time from a number (times the load factor) or a function.

    Raises:
        SceneError: the number is not finite.
    """
    if callable(value):
        return value
    if not np.isfinite(value):
        raise SceneError(f"{label}: value {value} is not finite")
    return lambda time: value * factor(time)


def vector_function(value: Vector, label: str, factor: LoadFactor) -> Callable[[float], np.ndarray]:
    """Function of time from a vector (times the load factor) or a function.

    Raises:
        SceneError: not three finite numbers; for a function, when it is called.
    """

    def checked(given) -> np.ndarray:
        vector = np.asarray(given, dtype=float)
        if vector.shape != (3,) or not np.isfinite(vector).all():
            raise SceneError(f"{label}: expected three finite numbers, got {given}")
        return vector

    if callable(value):
        function: Callable[[float], np.ndarray] = value
        return lambda time: checked(function(time))
    vector = checked(value)
    return lambda time: vector * factor(time)


@dataclass(frozen=True)
class CreaseSpec:
    """Spring of one crease between two of its panels (None: its only two)."""

    name: str
    law: CreaseLaw | None
    stiffness: Scalar
    rest_angle: Scalar | None
    pair: Pair | None

    @property
    def stiff(self) -> bool:
        """Whether the fold is held (infinite stiffness) instead of sprung."""
        return self.law is None and not callable(self.stiffness) and bool(np.isinf(self.stiffness))


@dataclass(frozen=True)
class MotionSpec:
    """Prescribed displacement components (None: free) of a named point, edge set or panel."""

    name: str
    components: tuple[Displacement | None, ...]


@dataclass(frozen=True)
class ClampSpec:
    """Prescribed outward tangent of a boundary; None: that of the rest face.

    Attributes:
        name: boundary.
        tangent: function of time and rest tangents (n, 3), giving (3,) or (n, 3), or None.
        natural: whether the rest face is stress-free, else the prescribed tangent at time 0 is.
    """

    name: str
    tangent: Callable[[float, np.ndarray], np.ndarray] | None
    natural: bool = True


@dataclass(frozen=True)
class LoadSpec:
    """A load of one kind ("point", "line", "area", "pressure", "moment") on a named thing."""

    kind: str
    name: str
    value: Scalar | Vector

    @property
    def label(self) -> str:
        """How messages call it."""
        return f"{'edge moment' if self.kind == 'moment' else self.kind + ' load'} {self.name!r}"

    def function(self, factor: LoadFactor) -> Callable:
        """Its value as a function of time.

        Raises:
            SceneError: a number that is not finite, a vector that is not three finite numbers.
        """
        value: Any = self.value
        if self.kind in ("pressure", "moment"):
            return scalar_function(value, self.label, factor)
        return vector_function(value, self.label, factor)


def displacement_function(value: Displacement, rest: np.ndarray, label: str, factor: LoadFactor):
    """Function of time giving displacements (n,) of vertices with rest coordinates (n, 3)."""
    if not callable(value):
        return scalar_function(value, label, factor)
    function: Callable[..., np.ndarray | float] = value
    if required_arguments(function) > 1:
        return lambda time: function(time, rest)
    return function


def required_arguments(function: Callable) -> int:
    """Number of positional arguments without default; 1 where Python cannot tell (builtins)."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:
        return 1
    positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return sum(p.kind in positional and p.default is p.empty for p in parameters)
