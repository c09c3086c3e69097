"""What a term of the energy must answer: energy, residual, tangent.

A term is written once and asked these questions by the problem, which knows no physics. A new
energy is one subclass in this folder: `FormTerm` (see form.py) where UFL can say it, else a
`StencilTerm` whose small dense blocks come from a kernel.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
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


@dataclass(frozen=True)
class Rates:
    """How rates follow from the unknowns q at the end of the time step under way.

    Velocity rate (q - base), acceleration inertia (q - target); base is a sum of earlier states.

    Attributes:
        rate: factor of the velocities (1 / time).
        inertia: factor of the accelerations (1 / time^2).
        weights: factors, summing to 1, of the last accepted states in base, latest first.
        times: times of these states.
        last: unknowns (num_local,) of the last accepted state.
        base: (num_local,).
        target: (num_local,).
    """

    rate: float
    inertia: float
    weights: tuple[float, ...]
    times: tuple[float, ...]
    last: np.ndarray
    base: np.ndarray
    target: np.ndarray

    def velocity(self, q: np.ndarray) -> np.ndarray:
        """Velocities (num_local,) at unknowns (num_local,)."""
        return self.rate * (q - self.base)


SHORTEST = 1e-6
"""Part of a step on which its slope is taken at least, however near a bound."""


class Term(ABC):
    """One contribution to the potential energy.

    Attributes:
        kinds: names under which its energies are booked ("membrane", "crease", "load", ...).
        conservative: False where no energy exists (follower loads, friction).
        symmetric: whether the tangent is symmetric.
        bounded: whether its energy ends somewhere (barriers), so that steps must stop before.
    """

    kinds: tuple[str, ...] = ()
    conservative: bool = True
    symmetric: bool = True
    bounded: bool = False

    @abstractmethod
    def energies(self, state: State) -> np.ndarray:
        """Energies of this rank's share, one a kind, (len(kinds),)."""

    @abstractmethod
    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the energy's gradient (or minus the force) to local values (num_local,)."""

    def add_forecast(self, state: State, since: float, out: np.ndarray) -> None:
        """Add the residual from which a predictor starts.

        Args:
            state: last accepted state, at the time to which the term is set.
            since: time of that state; what ends somewhere is extrapolated from there.
            out: local values (num_local,).
        """
        self.add_residual(state, out)

    def set_time(self, time: float) -> None:
        """Load factor or time to which loads, rest angles and prescribed normals are set."""

    def linearise(self, previous: State | None, current: State) -> None:
        """Fix what the next tangent takes from the last iterate (mixed-integration-point stress).

        Args:
            previous: the iterate before, or None: the tangent is then the exact Hessian.
            current: the iterate at which the tangent will be formed.
        """

    def begin_step(self, rates: Rates) -> None:
        """Take over the rates of a time step that begins; statics has none.

        After a step that failed, the rates of the last accepted step are handed over once more.
        """

    def slope(self, state: State, step: np.ndarray) -> np.ndarray:
        """Derivatives (len(kinds),) of this rank's energies along a step from a state.

        They come from the energies alone, so that a force that is not the gradient of its energy
        shows in the energy book; those of a bounded term from the tenth of the way to its bounds
        next to the state. A term without energy gives minus the work of its force.

        Args:
            state: where the derivative is taken.
            step: direction (num_local,).
        """
        if not self.conservative:
            out = np.zeros(len(step))
            self.add_residual(state, out)
            return np.array([out @ step])
        ways = (step, -step) if self.bounded else ()
        free = min((self.longest_step(state, way) for way in ways), default=1.0)
        width = max(free, SHORTEST) / 32
        return central_slope(lambda part: self.energies(state.moved(part * step)), width)

    def heat(self, state: State, step: np.ndarray) -> float:
        """What this rank's force takes over a step that ends in a state and turns into heat."""
        return float(self.slope(state, step).sum())

    def drive(self, state: State, since: float) -> float:
        """Work done on the sheet by bodies that moved since a time, through this rank's force.

        It is no part of what the force takes from the sheet and turns into heat.
        """
        return 0.0

    def carried(self, old: State, new: State) -> float:
        """Work that moving bodies do on this rank's share of a bounded energy over a step."""
        return 0.0

    def longest_step(self, state: State, step: np.ndarray) -> float:
        """Part, at most 1, of a step that keeps this rank's energy well defined all the way.

        A tenth of the distance to where it ends is left.
        """
        return 1.0

    def objection(self, state: State) -> str:
        """Why a converged state must not be accepted, or an empty string; collective."""
        return ""

    def suspicion(self, state: State) -> str:
        """What may keep steps from an accepted state from converging, or nothing; collective."""
        return ""

    def largest_turn(self, state: State, step: np.ndarray) -> float:
        """Largest change (radians) to first order of this rank's unwrapped angles over a step.

        Args:
            state: where the step starts.
            step: increments of the unknowns (num_local,).
        """
        return 0.0

    def accept(self, state: State) -> None:
        """Adopt a converged state as the branch against which angles are unwrapped."""

    def warn(self) -> None:
        """Warn of what the last accepted state has shown, once it is recorded; on all ranks."""

    def history(self) -> dict[str, Keyed]:
        """Values by name that a restart needs beside the unknowns."""
        return {}

    def restore(self, values: dict[str, np.ndarray]) -> None:
        """Take back the values of `history`, in the order of the keys that it gives now."""


def central_slope(function: Callable[[float], np.ndarray], width: float) -> np.ndarray:
    """Derivative at 0 by central differences of order six, exact for polynomials of degree six.

    The energies of straight triangles are quartic along a step but for their angles.
    """
    weights = {1: 0.75, 2: -0.15, 3: 1 / 60}
    parts = [w * (function(k * width) - function(-k * width)) for k, w in weights.items()]
    return np.sum(parts, axis=0) / width


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
