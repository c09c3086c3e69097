"""Rayleigh damping as dissipation potentials of one time step.

In proportion to mass, alpha / (2 rate) |v|^2_M: force -alpha M v. In proportion to stiffness, beta
times the elastic energy's quadratic form in the rates of strain, curvature and fold angle
(Kelvin-Voigt): with e the strains, rate (e - e_base) their rates, it is the elastic energy of the
strains e - e_base with beta rate times the stiffness. Rigid motion strains nothing and is free.
A crease is damped in proportion to the stiffness of its law at the base; where its moment falls
(a fold that snaps), not at all.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ufl_origami.configuration import State
from ufl_origami.terms.base import Keyed, Rates, StencilTerm
from ufl_origami.terms.inertia import Mass, MassTerm


class MassDamping(MassTerm):
    """Damping in proportion to mass.

    Args:
        mass: mass matrix.
        alpha: factor (1 / time).
    """

    kinds = ("damping",)

    def __init__(self, mass: Mass, alpha: float):
        super().__init__(mass)
        self.alpha = alpha

    def pull(self, rates: Rates) -> tuple[float, np.ndarray]:
        """The factor times the velocity."""
        return self.alpha * rates.rate, rates.base


class ElasticShell(Protocol):
    """Panels that can be given another stress-free state and another stiffness."""

    def strains(self, state: State) -> Keyed:
        """Strains (n, k) of this rank's elements in a state, by element."""

    def refer(self, strains: np.ndarray, factor: float) -> None:
        """Take strains (n, k) as stress-free, and the stiffness times a factor."""


class ElasticFold(Protocol):
    """Springs that can be given another stress-free state and another stiffness."""

    def refer(self, scalars: np.ndarray, factor: float) -> None:
        """Take edge unknowns (ns,) as stress-free, and the stiffness times a factor."""


@dataclass(frozen=True)
class ElasticTerms:
    """Copies of a scene's elastic terms, which nothing else uses.

    Attributes:
        shell: the panels, an `ElasticShell`.
        folds: the creases, each an `ElasticFold`.
    """

    shell: Any
    folds: list[Any]


class ViscousFold(StencilTerm):
    """Damping in proportion to the stiffness of one crease.

    Args:
        elastic: a copy of the crease's term.
        beta: factor (time).
        first: first local edge unknown.
    """

    kinds = ("damping",)

    def __init__(self, elastic: Any, beta: float, first: int):
        self._elastic, self._beta, self._first = elastic, beta, first

    def set_time(self, time: float) -> None:
        """Time at which the crease's stiffness is taken."""
        self._elastic.set_time(time)

    def begin_step(self, rates: Rates) -> None:
        """Refer the angles, which are linear in the unknowns, to their base."""
        self._elastic.refer(rates.base[self._first :], self._beta * rates.rate)

    def energies(self, state: State) -> np.ndarray:
        """Dissipation potential of this rank's edges."""
        return self._elastic.energies(state)

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the viscous moments."""
        self._elastic.add_residual(state, out)

    def stencils(self) -> list[np.ndarray]:
        """Those of the crease."""
        return self._elastic.stencils()

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the viscous stiffness."""
        self._elastic.tangent(state, blocks)


class ViscousShell(StencilTerm):
    """Damping in proportion to the stiffness of the panels.

    Args:
        elastic: a copy of the panels' term, at the start's branches of angles.
        beta: factor (time).
        memory: accepted states from which rates follow.
        state: state at the start.
    """

    kinds = ("damping",)

    def __init__(self, elastic: Any, beta: float, memory: int, state: State):
        self._elastic, self.beta = elastic, beta
        start = elastic.strains(state)
        self._keys, self._past = start.keys, memory * [start.values]
        self._reference = start.values, 0.0
        self._rates: Rates | None = None
        self._accepted: tuple[Rates | None, tuple[np.ndarray, float]] = None, self._reference

    def begin_step(self, rates: Rates) -> None:
        """Refer the strains to those of the last states, or of those before at the last rates."""
        accepted, reference = self._accepted
        if rates is not accepted:
            reference = _mean(rates.weights, self._past), self.beta * rates.rate
        self._rates, self._reference = rates, reference
        self._elastic.refer(*self._reference)

    def set_time(self, time: float) -> None:
        """Set prescribed normals."""
        self._elastic.set_time(time)

    def energies(self, state: State) -> np.ndarray:
        """Dissipation potential of this rank's elements."""
        return self._elastic.energies(state).sum(keepdims=True)

    def heat(self, state: State, step: np.ndarray) -> float:
        """Viscous stress times the change of strain, from energies (quadratic in the strains).

        The force's work along the step differs by the strain of its chord, which rigid rotation
        has, too: that part belongs to the integrator.
        """
        ends = self.energies(state) - self.energies(state.moved(-step))
        self._elastic.refer(self._past[0], self._reference[1])
        change = self.energies(state)
        self._elastic.refer(*self._reference)
        return float((ends + change).sum())

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the viscous forces."""
        self._elastic.add_residual(state, out)

    def stencils(self) -> list[np.ndarray]:
        """Those of the elastic term."""
        return self._elastic.stencils()

    def linearise(self, previous: State | None, current: State) -> None:
        """Viscous stress of the next tangent."""
        self._elastic.linearise(previous, current)

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the viscous tangents."""
        self._elastic.tangent(state, blocks)

    def accept(self, state: State) -> None:
        """Remember the strains of an accepted state."""
        self._elastic.accept(state)
        self._accepted = self._rates, self._reference
        self._past = [self._elastic.strains(state).values, *self._past[:-1]]

    def history(self) -> dict[str, Keyed]:
        """Branches of angles, and strains of the last states."""
        strains = {f"strains{k}": Keyed(self._keys, past) for k, past in enumerate(self._past)}
        return self._elastic.history() | strains

    def restore(self, values: dict[str, np.ndarray]) -> None:
        """Go on from the last states of an earlier run."""
        self._elastic.restore({name: values[name] for name in self._elastic.history()})
        self._past = [values[f"strains{k}"] for k in range(len(self._past))]


def _mean(weights: Sequence[float], values: Sequence[np.ndarray]) -> np.ndarray:
    """Weighted sum of the latest values."""
    return np.sum([w * v for w, v in zip(weights, values, strict=False)], axis=0)
