"""Where a path ends: a value that the load factor, a displacement, an angle or a gap reaches."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from ufl_origami.errors import InputError
from ufl_origami.model import Model
from ufl_origami.sheet import known_name

Measure = Callable[[Model], float]
AXES = "xyz"


@dataclass(frozen=True)
class PathStop:
    """A value at which a path ends, on whichever side it comes from.

    Attributes:
        measure: function of the model (collective).
        value: value at which the path ends.
        text: how messages call it.
    """

    measure: Measure
    value: float
    text: str

    def __post_init__(self) -> None:
        """Refuse a value that no state reaches."""
        if not np.isfinite(self.value):
            raise InputError(f"stop at {self.text} = {self.value}: the value is not finite")


def at_load(value: float) -> PathStop:
    """Where the load factor has a value."""
    return PathStop(lambda model: model.problem.time, value, "load factor")


def at_position(point: str, axis: str, value: float) -> PathStop:
    """Where a coordinate ("x", "y" or "z") of a named point has a value.

    Raises:
        InputError: unknown axis; on use, an unknown point.
    """
    if axis not in tuple(AXES):
        raise InputError(f"stop at {point!r}: axis {axis!r} is none of 'x', 'y', 'z'")
    index = AXES.index(axis)
    return PathStop(lambda model: float(model.position(point)[index]), value, f"{point}, {axis}")


def at_fold_angle(crease: str, degrees: float) -> PathStop:
    """Where the mean virtual fold angle of a crease (valley positive) has a value in degrees."""

    def measure(model: Model) -> float:
        known_name(crease, model.creases, "crease")
        return float(np.degrees(model.mean_fold_angle(crease)))

    return PathStop(measure, degrees, f"fold angle of {crease!r}")


def at_gap(obstacle: str, value: float) -> PathStop:
    """Where the smallest gap to an obstacle has a value."""

    def measure(model: Model) -> float:
        contacts = {term.at.surface.name: term for term in model.contacts}
        term = contacts[known_name(obstacle, contacts, "obstacle")]
        return float(model.sheet.comm.allreduce(term.gap(model.state), op=MPI.MIN))

    return PathStop(measure, value, f"gap to {obstacle!r}")


def make_stops(stops: Sequence[PathStop | float]) -> list[PathStop]:
    """Stops from stops and load factors.

    Raises:
        InputError: there is none, or one is neither.
    """
    made = []
    for stop in [stops] if isinstance(stops, PathStop | float | int) else stops:
        if not isinstance(stop, PathStop | float | int):
            raise InputError(f"{stop!r} is neither a load factor nor a PathStop")
        made.append(stop if isinstance(stop, PathStop) else at_load(float(stop)))
    return made
