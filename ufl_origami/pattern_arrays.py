"""Input of a crease pattern as read-only numpy arrays, with errors that name the entry."""

from collections.abc import Mapping, Sequence, Sized
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from ufl_origami.errors import PatternError
from ufl_origami.pattern_topology import Floats, Ints


def read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return a copy that cannot be written to."""
    copy = np.array(array)
    copy.setflags(write=False)
    return copy


def integers(values: Any, shape: tuple[int, ...], what: str) -> Ints:
    """Return whole numbers as a read-only array of a shape (-1: any length)."""
    try:
        array = np.asarray(values)
        if array.size == 0:
            array = array.reshape([max(n, 0) for n in shape])
        whole = array.dtype.kind in "iu" or (array.dtype.kind == "f" and (array % 1 == 0).all())
    except (ValueError, TypeError) as error:
        raise PatternError(f"{what} must be an array of whole numbers: {error}") from error
    fits = array.ndim == len(shape) and all(
        n in (-1, s) for n, s in zip(shape, array.shape, strict=True)
    )
    if not (fits and (whole or array.size == 0)):
        wanted = " x ".join("any" if n < 0 else str(n) for n in shape)
        raise PatternError(
            f"{what} must be whole numbers of shape ({wanted}), not {array.dtype} {array.shape}"
        )
    return read_only(array.astype(np.int64))


def loops(faces: Sequence[Any]) -> tuple[tuple[int, ...], ...]:
    """Return loops of vertices (or edges) as tuples of whole numbers."""
    return tuple(
        tuple(map(int, integers(loop, (-1,), f"face {f}"))) for f, loop in enumerate(faces)
    )


def coordinates(rows: Any) -> Floats:
    """Return read-only (n, 3) coordinates from rows of two or three numbers (two: z = 0)."""
    points = np.zeros((len(rows), 3))
    for v, row in enumerate(rows):
        if not 2 <= np.size(row) <= 3:
            raise PatternError(f"vertex {v} has {np.size(row)} coordinates, 2 or 3 are needed")
        try:
            points[v, : np.size(row)] = row
        except (TypeError, ValueError) as error:
            raise PatternError(f"vertex {v} has coordinates {row}: not numbers") from error
    return read_only(points)


def degrees(values: Any, num_edges: int) -> Floats:
    """Return read-only fold angles; None, as a whole or for one edge, becomes NaN."""
    if values is None:
        return read_only(np.full(num_edges, np.nan))
    try:
        return read_only(np.array([np.nan if v is None else v for v in values], dtype=float))
    except (TypeError, ValueError) as error:
        raise PatternError(f"edges_foldAngle must hold numbers or null: {error}") from error


def property_array(values: Any) -> npt.NDArray[Any]:
    """Return a property as a read-only array: float (None is NaN), bool (None is False), object."""
    if isinstance(values, np.ndarray) and values.dtype.kind in "bf":
        return read_only(values)
    known = [v for v in values if v is not None]
    if known and all(isinstance(v, bool | np.bool_) for v in known):
        return read_only(np.array([bool(v) for v in values]))
    if all(isinstance(v, int | float | np.number) and not isinstance(v, bool) for v in known):
        return read_only(np.array([np.nan if v is None else v for v in values], dtype=float))
    array = np.empty(len(values), dtype=object)
    array[:] = list(values)
    return read_only(array)


def properties(given: Mapping[str, Any]) -> Mapping[str, npt.NDArray[Any]]:
    """Return all properties as read-only arrays; `name` is no property (it holds names)."""
    if "name" in given:
        raise PatternError("a property cannot be called 'name': that key holds the names")
    return MappingProxyType({name: property_array(values) for name, values in given.items()})


def check_length(what: str, values: Sized, number: int, of: str) -> None:
    """Raise PatternError unless there is one value for each of a number of things."""
    if np.ndim(values) != 1 or len(values) != number:  # type: ignore[arg-type]
        raise PatternError(f"{what} has {len(values)} values, but there are {number} {of}")
