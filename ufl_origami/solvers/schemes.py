"""Time integrators as incremental potentials: implicit Euler and BDF2.

A step to time t1 makes Pi(q, t1) + inertia/2 |q - target|^2_M stationary. A scheme says how base,
target and factors follow from the last accepted states: the new velocity is rate (q - base), the
acceleration inertia (q - target). Unknowns without mass are in equilibrium at every step.

Both schemes are backward differences applied to q' = v and to M v' = -grad Pi. A new one is a
subclass with `formula` and `error`, given to `solve_dynamic` by itself or, once it stands in
`SCHEMES`, by name.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from petsc4py import PETSc

from ufl_origami.errors import InputError


@dataclass(frozen=True)
class Instant:
    """An accepted state.

    Attributes:
        time: its time.
        q: unknowns.
        v: their rates.
    """

    time: float
    q: PETSc.Vec
    v: PETSc.Vec


@dataclass(frozen=True)
class Formula:
    """Rates at the end of one step as functions of the unknowns there.

    Attributes:
        rate, inertia: see the module.
        weights: factors of the last states' unknowns in base, latest first.
        base, target: see the module.
    """

    rate: float
    inertia: float
    weights: tuple[float, ...]
    base: PETSc.Vec
    target: PETSc.Vec

    def velocity(self, q: PETSc.Vec) -> PETSc.Vec:
        """Rates at the end of the step."""
        return combination((self.rate, q), (-self.rate, self.base))


def combination(*parts: tuple[float, PETSc.Vec]) -> PETSc.Vec:
    """Linear combination of vectors."""
    (factor, first), *others = parts
    result = first.copy()
    result.scale(factor)
    for factor, vector in others:
        result.axpy(factor, vector)
    return result


class Scheme(ABC):
    """One-parameter family of backward formulas.

    Attributes:
        name: how options call it.
        order: order of accuracy of positions and velocities.
        memory: accepted states that a step needs, once there are so many.
        largest_ratio: largest stable ratio of a step to the one before.
    """

    name: str
    order: int
    memory: int
    largest_ratio: float

    @abstractmethod
    def formula(self, time: float, past: Sequence[Instant]) -> Formula:
        """Formula of the step from past[0], the last accepted state, to a time."""

    @abstractmethod
    def error(self, new: Instant, past: Sequence[Instant]) -> PETSc.Vec:
        """Leading term of the local error of the new positions."""


class ImplicitEuler(Scheme):
    """q1 = q0 + dt v1, M v1 = M v0 - dt grad Pi(q1): first order, strongly dissipative."""

    name, order, memory, largest_ratio = "implicit_euler", 1, 1, float("inf")

    def formula(self, time: float, past: Sequence[Instant]) -> Formula:
        """Base q0, target q0 + dt v0."""
        last = past[0]
        dt = time - last.time
        target = combination((1.0, last.q), (dt, last.v))
        return Formula(1 / dt, 1 / dt**2, (1.0,), last.q.copy(), target)

    def error(self, new: Instant, past: Sequence[Instant]) -> PETSc.Vec:
        """Half the squared step times the acceleration."""
        half = 0.5 * (new.time - past[0].time)
        return combination((half, new.v), (-half, past[0].v))


class Bdf2(Scheme):
    """Backward differences of second order with variable steps; the first step is Euler's.

    With r = dt / dt_before: dt v1 = a0 q1 - a1 q0 + a2 q_before, a0 = (1 + 2 r) / (1 + r), a1 = 1 +
    r, a2 = r^2 / (1 + r), and the same for v. Zero-stable for r < 1 + sqrt(2) (Hairer, Norsett &
    Wanner 1993, doi:10.1007/978-3-540-78862-1, III.5).
    """

    name, order, memory, largest_ratio = "bdf2", 2, 2, 2.4

    def formula(self, time: float, past: Sequence[Instant]) -> Formula:
        """Base and target from the last two states."""
        if len(past) < 2:
            return ImplicitEuler().formula(time, past)
        now, before = past[0], past[1]
        dt = time - now.time
        r = dt / (now.time - before.time)
        a0 = (1 + 2 * r) / (1 + r)
        rate, weights = a0 / dt, ((1 + r) / a0, -(r**2) / (1 + r) / a0)
        base = combination((weights[0], now.q), (weights[1], before.q))
        velocity = combination((weights[0], now.v), (weights[1], before.v))
        target = combination((1.0, base), (1 / rate, velocity))
        return Formula(rate, rate**2, weights, base, target)

    def error(self, new: Instant, past: Sequence[Instant]) -> PETSc.Vec:
        """(1 + r)^2 / (6 r (1 + 2 r)) dt^3 q''', q''' by the last three velocities."""
        if len(past) < 2:
            return ImplicitEuler().error(new, past)
        now, before = past[0], past[1]
        dt, dt_before = new.time - now.time, now.time - before.time
        r = dt / dt_before
        factor = 2 * dt**3 / (dt + dt_before) * (1 + r) ** 2 / (6 * r * (1 + 2 * r))
        return combination(
            (factor / dt, new.v),
            (-factor * (1 / dt + 1 / dt_before), now.v),
            (factor / dt_before, before.v),
        )


SCHEMES: dict[str, type[Scheme]] = {kind.name: kind for kind in (ImplicitEuler, Bdf2)}
"""Schemes by name."""


def find_scheme(scheme: str | Scheme) -> Scheme:
    """A scheme by name, or itself.

    Raises:
        InputError: unknown name.
    """
    if isinstance(scheme, Scheme):
        return scheme
    if scheme not in SCHEMES:
        raise InputError(f"time scheme {scheme!r} is none of {tuple(SCHEMES)}")
    return SCHEMES[scheme]()
