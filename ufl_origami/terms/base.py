"""What a term of the energy must answer: energy, residual, tangent.

A term is written once and asked these questions by the problem, which knows no physics. A new
energy is one subclass in this folder: `FormTerm` (see form.py) where UFL can say it, else a
`StencilTerm` whose small dense blocks come from a kernel.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from ufl_origami.configuration import State


@dataclass(frozen=True)
class Keyed:
    """This rank's share of values under integers that do not depend on the partition.

    Attributes:
        keys: (n,) int64, unique over the ranks.
        values: (n, ...).
    """

    keys: np.ndarray
    values: np.ndarray


class Term(ABC):
    """One contribution to the potential energy.

    Attributes:
        kinds: names under which its energies are booked ("membrane", "crease", "load", ...).
        conservative: False where no energy exists (follower loads, friction).
        symmetric: whether the tangent is symmetric.
    """

    kinds: tuple[str, ...] = ()
    conservative: bool = True
    symmetric: bool = True

    @abstractmethod
    def energies(self, state: State) -> np.ndarray:
        """Energies of this rank's share, one a kind, (len(kinds),)."""

    @abstractmethod
    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the energy's gradient (or minus the force) to local values (num_local,)."""

    def set_time(self, time: float) -> None:
        """Load factor or time to which loads, rest angles and prescribed normals are set."""

    def linearise(self, previous: State | None, current: State) -> None:
        """Fix what the next tangent takes from the last iterate (mixed-integration-point stress).

        Args:
            previous: the iterate before, or None: the tangent is then the exact Hessian.
            current: the iterate at which the tangent will be formed.
        """

    def largest_turn(self, state: State, step: np.ndarray) -> float:
        """Largest change (radians) to first order of this rank's unwrapped angles over a step.

        Args:
            state: where the step starts.
            step: increments of the unknowns (num_local,).
        """
        return 0.0

    def accept(self, state: State) -> None:
        """Adopt a converged state as the branch against which angles are unwrapped."""

    def history(self) -> dict[str, Keyed]:
        """Values by name that a restart needs beside the unknowns."""
        return {}

    def restore(self, values: dict[str, np.ndarray]) -> None:
        """Take back the values of `history`, in the order of the keys that it gives now."""


class StencilTerm(Term):
    """A term that is a sum over small stencils, with dense tangent blocks."""

    @abstractmethod
    def stencils(self) -> list[np.ndarray]:
        """Local unknowns of each batch of stencils: arrays (n, k) int32, -1 where unused."""

    @abstractmethod
    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the Hessians of each batch into its block array (n, k, k)."""


class MatrixTerm(Term):
    """A term that adds its tangent into the assembled matrix itself (UFL forms)."""

    @abstractmethod
    def add_tangent(self, state: State, matrix) -> None:
        """Add the tangent to a PETSc matrix by local indices."""
