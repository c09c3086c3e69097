"""Each rank's share of a model's state, under keys that do not depend on the partition.

Displacements go by input vertex, edge unknowns by the pair of input vertices, and what a term
remembers (branches of angles) by the term's own keys.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np

from ufl_origami.identity import edge_keys
from ufl_origami.model import Model
from ufl_origami.terms.base import Keyed, Term


@dataclass(frozen=True)
class _EdgeShare:
    """Owned values of one edge unknown: positions in the owned vector and keys (n,)."""

    positions: np.ndarray
    keys: np.ndarray


class Shares:
    """Reads and sets this rank's share of a model's state.

    Args:
        model: the model.
        terms: terms whose memories belong to the state.
    """

    def __init__(self, model: Model, terms: Sequence[Term]):
        self.model, self.terms = model, list(terms)
        configuration, sheet = model.configuration, model.sheet
        self._num_positions = 3 * configuration.nv_owned
        self._vertex_keys = sheet.input_vertex[: configuration.nv_owned].astype(np.int64)
        self._edges: dict[str, _EdgeShare] = {}
        for name in configuration.edge_unknowns:
            slot = configuration.slot(name)[: sheet.num_owned_edges]
            facets = np.flatnonzero(slot >= 0)
            positions = self._num_positions + slot[facets]
            self._edges[name] = _EdgeShare(positions, edge_keys(sheet, facets))

    def get(self, vectors: Mapping[str, PETSc.Vec]) -> dict[str, Keyed]:
        """Copies of the current values by label."""
        shares: dict[str, Keyed] = {}
        for prefix, vector in self._all(vectors).items():
            owned = vector.array_r
            displacement = owned[: self._num_positions].reshape(-1, 3).copy()
            shares[f"{prefix}displacement"] = Keyed(self._vertex_keys, displacement)
            for name, share in self._edges.items():
                shares[f"{prefix}edge.{name}"] = Keyed(share.keys, owned[share.positions])
        for i, term in enumerate(self.terms):
            shares |= {f"term{i}.{name}": share for name, share in term.history().items()}
        return shares

    def _all(self, vectors: Mapping[str, PETSc.Vec]) -> dict[str, PETSc.Vec]:
        """The model's unknowns and further vectors, by the prefix of their labels."""
        return {"": self.model.x} | {f"{name}.": vector for name, vector in vectors.items()}

    def set(self, values: dict[str, np.ndarray], vectors: Mapping[str, PETSc.Vec]) -> None:
        """Set the state from values by label, in the order of the keys of `get`."""
        for prefix, vector in self._all(vectors).items():
            owned = vector.array_w
            owned[: self._num_positions] = values[f"{prefix}displacement"].ravel()
            for name, share in self._edges.items():
                owned[share.positions] = values[f"{prefix}edge.{name}"]
        for i, term in enumerate(self.terms):
            term.restore({name: values[f"term{i}.{name}"] for name in term.history()})


class Finder:
    """Collects the values of wanted keys from the parts of several ranks.

    Args:
        share: the keys, and values of the shape and kind to be found.
    """

    def __init__(self, share: Keyed):
        self._order = np.argsort(share.keys)
        self._sorted = share.keys[self._order]
        self._found = np.zeros(len(share.keys), dtype=bool)
        self.values = np.empty_like(share.values)

    @property
    def missing(self) -> int:
        """Number of wanted keys not found yet."""
        return int((~self._found).sum())

    def look(self, share: Keyed) -> None:
        """Take what is wanted from one part."""
        if not len(self._sorted):
            return
        at = np.minimum(np.searchsorted(self._sorted, share.keys), len(self._sorted) - 1)
        hit = self._sorted[at] == share.keys
        rows = self._order[at[hit]]
        self.values[rows] = share.values[hit]
        self._found[rows] = True
