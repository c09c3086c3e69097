"""Prescribed unknowns: which entries of the vector follow a function of the load factor."""

from collections.abc import Callable

import numpy as np

from ufl_origami.collective import together
from ufl_origami.configuration import Configuration
from ufl_origami.errors import SceneError

Values = Callable[[float], np.ndarray]


class Constraints:
    """Prescribed unknowns of a scene (this rank's owned ones).

    Args:
        configuration: numbering of the unknowns.
    """

    def __init__(self, configuration: Configuration):
        self.configuration = configuration
        self._parts: list[tuple[np.ndarray, np.ndarray, Values, str]] = []
        self._counts: list[int] = []
        self.dofs = np.empty(0, dtype=np.int64)

    def add(self, local: np.ndarray, values: Values, label: str) -> None:
        """Prescribe local unknowns (n,); values(time) gives (n,) or a number.

        Args:
            local: local indices; those owned by other ranks are left to them.
            values: function of the load factor or time.
            label: name for error messages.
        """
        position = self.configuration.global_ids[local] - self.configuration.offset
        owned = np.flatnonzero((position >= 0) & (position < self.configuration.size_local))
        self._parts.append((position[owned], owned, values, label))
        self._counts.append(len(position))
        self.dofs = np.unique(np.concatenate([self.dofs, position[owned]])).astype(np.int64)

    def values(self, time: float) -> np.ndarray:
        """Prescribed values of `dofs` at a load factor or time."""
        result = np.empty(len(self.dofs))
        for position, owned, values, _ in self._parts:
            result[np.searchsorted(self.dofs, position)] = _entries(values(time), owned)
        return result

    def check(self, time: float) -> None:
        """Refuse values at a load factor or time that no state can have; collective.

        Raises:
            SceneError: on all ranks, when two conditions prescribe different values, a value is
                not finite, or a function gives neither one value nor one a vertex.
        """
        with together(self.configuration.comm):
            result = np.full(len(self.dofs), np.nan)
            for (position, owned, values, label), count in zip(
                self._parts, self._counts, strict=True
            ):
                shape = np.shape(values(time))
                if shape not in ((), (count,)):
                    raise SceneError(
                        f"condition {label!r} at {time:g}: values of shape {shape} for {count} "
                        "vertices; give one number or one for each"
                    )
                given = _entries(values(time), owned)
                if not np.isfinite(given).all():
                    raise SceneError(f"condition {label!r} at {time:g}: value is not finite")
                at = np.searchsorted(self.dofs, position)
                same = np.isclose(result[at], given, rtol=1e-12, atol=1e-14)
                clash = np.isfinite(result[at]) & ~same
                if clash.any():
                    raise SceneError(
                        f"condition {label!r} at {time:g}: value {given[clash][0]:g} contradicts "
                        f"{result[at][clash][0]:g} prescribed before on the same vertex"
                    )
                result[at] = given


def _entries(given: np.ndarray | float, owned: np.ndarray) -> np.ndarray:
    """Values of the owned entries of one condition, from one value for all or one for each."""
    values = np.asarray(given, dtype=float)
    return values[owned] if values.ndim else np.full(len(owned), float(values))
