"""Masses, and the incremental potential of inertia in one time step, inertia/2 |q - target|^2_M.

M comes from the UFL form int rho h u . v dA over the rest area. On P1 displacements it is
integrated at the vertices, which lumps it: a third of each triangle at its corners. On P2
displacements it stays consistent, since lumping costs the element its order. Masses of points are
added on the diagonal. Angles have no mass.
"""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from scipy import sparse

from ufl_origami import compat
from ufl_origami.configuration import Configuration, State
from ufl_origami.terms.base import Rates, StencilTerm
from ufl_origami.terms.form import JIT_OPTIONS, SheetFunctions


def mass_matrix(
    configuration: Configuration, functions: SheetFunctions, density: np.ndarray
) -> sparse.csr_matrix:
    """This rank's share (num_local, num_local) of the panels' mass matrix.

    Args:
        configuration: numbering of the unknowns.
        functions: the scene's shared functions.
        density: (nc,) mass per rest area of the local cells.
    """
    u, v = ufl.TrialFunction(functions.V), ufl.TestFunction(functions.V)
    lumped = {"quadrature_rule": "vertex", "quadrature_degree": 1}
    dx = ufl.dx(metadata=None if configuration.has_midpoints else lumped)
    form = fem.form(functions.piecewise(density) * ufl.inner(u, v) * dx, jit_options=JIT_OPTIONS)
    own = compat.local_matrix(form).tocoo()
    own.eliminate_zeros()  # among them columns that only other ranks' entries have
    dofs, size = functions.dofs, configuration.num_local
    return sparse.csr_matrix((own.data, (dofs[own.row], dofs[own.col])), shape=(size, size))


@dataclass(frozen=True)
class Mass:
    """Mass matrix as a sum over ranks of local shares.

    Attributes:
        matrix: (num_local, num_local) share of this rank, symmetric.
    """

    matrix: sparse.csr_matrix

    def times(self, values: np.ndarray) -> np.ndarray:
        """Share (num_local,) of the product with local values (num_local,)."""
        return self.matrix @ values

    def product(self, first: np.ndarray, second: np.ndarray) -> float:
        """Share of first . M second."""
        return float(first @ (self.matrix @ second))

    def pairs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Unknowns (n,) and values of the diagonal, and pairs (m, 2) and values above it."""
        entries = sparse.triu(self.matrix, format="coo")
        used = entries.data != 0
        row, col, data = entries.row[used], entries.col[used], entries.data[used]
        on = row == col
        return row[on], data[on], np.column_stack([row[~on], col[~on]]), data[~on]


class MassTerm(StencilTerm):
    """A potential factor/2 |q - reference|^2_M within a time step.

    Args:
        mass: mass matrix.
    """

    def __init__(self, mass: Mass):
        self.mass = mass
        diagonal, self._lumped, off, self._coupled = mass.pairs()
        self._dofs = diagonal[:, None].astype(np.int32), off.astype(np.int32)
        self._factor, self._reference = 0.0, np.zeros(mass.matrix.shape[0])

    @abstractmethod
    def pull(self, rates: Rates) -> tuple[float, np.ndarray]:
        """Factor and reference (num_local,) in a time step."""

    def begin_step(self, rates: Rates) -> None:
        """Take over factor and reference."""
        self._factor, self._reference = self.pull(rates)

    def energies(self, state: State) -> np.ndarray:
        """This rank's share of the potential."""
        off = state.q - self._reference
        return np.array([0.5 * self._factor * self.mass.product(off, off)])

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the factor times mass times distance."""
        out += self._factor * self.mass.times(state.q - self._reference)

    def stencils(self) -> list[np.ndarray]:
        """Unknowns with mass, and pairs of them."""
        return list(self._dofs)

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the factor times the masses."""
        blocks[0][:, 0, 0] = self._factor * self._lumped
        blocks[1][:] = 0.0
        blocks[1][:, 0, 1] = blocks[1][:, 1, 0] = self._factor * self._coupled


class InertiaTerm(MassTerm):
    """The incremental potential of the masses, inertia/2 |q - target|^2_M."""

    kinds = ("inertia",)

    def pull(self, rates: Rates) -> tuple[float, np.ndarray]:
        """Mass times acceleration."""
        return rates.inertia, rates.target
