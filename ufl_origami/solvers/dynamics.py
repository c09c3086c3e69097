"""Path in time: steps of an incremental potential, fixed or adapted to error and effort.

Each step starts from the last state moved on by its rates, stopped before any barrier, and is
solved by Newton. Adapted steps are cut when Newton fails, a check refuses the state or its local
error is too large, and follow the local error otherwise.
"""

import logging
import time as clock
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import ceil, inf
from typing import Any, Protocol

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from ufl_origami.collective import reduced
from ufl_origami.errors import AccuracyWarning, InputError, SolveError
from ufl_origami.problem import Problem
from ufl_origami.solvers.clearance import clear_start
from ufl_origami.solvers.newton import NewtonReport, NewtonSolver
from ufl_origami.solvers.schemes import Formula, Instant, Scheme
from ufl_origami.solvers.stops import require_stops
from ufl_origami.terms.base import Rates
from ufl_origami.terms.inertia import InertiaTerm

log = logging.getLogger(__name__)

TOO_LARGE = 2.0
"""Local error over the tolerance from which on a step is done again."""

SAFETY = 0.9
"""Share of the step that the local error would allow."""

OFF_STEP = 1e-6
"""Distance, over a fixed step, by which a stop may miss the end of one."""

SHRINK = 0.2
"""Largest cut of a step at once."""


@dataclass(frozen=True)
class TimeSettings:
    """Sizes of the time steps.

    Attributes:
        step: first step, or the only size of all.
        fixed: all steps are `step` long; one that fails ends the run.
        tolerance: local error of a step to be kept: displacements (mean square by mass) over the
            size of the sheet.
        energy_tolerance: energy that the integrator may lose or gain in a step to be kept, over the
            largest energy so far; needs the energy book.
        smallest: a step below this is given up; None: a ten thousandth of `step`.
        largest: largest step; None: no bound.
        growth: largest factor between steps.
        easy: Newton iterations up to which a step may grow; above twice as many it shrinks.
    """

    step: float
    fixed: bool = False
    tolerance: float = 1e-3
    energy_tolerance: float = 3e-3
    smallest: float | None = None
    largest: float | None = None
    growth: float = 1.5
    easy: int = 8

    def __post_init__(self) -> None:
        """Refuse sizes that are none."""
        names = ("step", "tolerance", "energy_tolerance", "smallest", "largest", "growth")
        for name in names:
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InputError(f"time settings: {name} = {value} is no positive number")
        if not self.least <= self.step <= self.most:
            raise InputError(f"time settings: step {self.step} is not in [smallest, largest]")
        for name in ("growth", "easy"):
            if not getattr(self, name) >= 1:
                raise InputError(f"time settings: {name} {getattr(self, name)} is below 1")

    @property
    def least(self) -> float:
        """Smallest step."""
        return 1e-4 * self.step if self.smallest is None else self.smallest

    @property
    def most(self) -> float:
        """Largest step."""
        return inf if self.largest is None else self.largest


@dataclass(frozen=True)
class TimeStep:
    """One accepted step; number 0 is the start.

    Attributes:
        number: from 1.
        time: time at its end.
        size: step size.
        iterations: Newton iterations.
        factorisations: factorisations, those of failed tries included.
        negative_pivots: inertia of the last tangent, None where unknown.
        error: local error over the size of the sheet.
        seconds: wall-clock time of the step.
        cuts: failed tries before it.
    """

    number: int
    time: float
    size: float = 0.0
    iterations: int = 0
    factorisations: int = 0
    negative_pivots: int | None = None
    error: float = 0.0
    seconds: float = 0.0
    cuts: int = 0


OnAccept = Callable[[TimeStep, PETSc.Vec], None]
Check = Callable[[PETSc.Vec], str]


class Book(Protocol):
    """Energy book of a motion, see energy_book.py."""

    def draft(self, old: Instant, new: Instant, formula: Formula) -> Any:
        """The account after a step, while the terms stand at its end."""

    def loss(self, account: Any) -> float:
        """What the integrator took or gave in the step to an account, over the largest energy."""

    def post(self, account: Any) -> None:
        """Adopt the account of an accepted step."""


@dataclass(frozen=True)
class _Try:
    """A step that was tried: its end, effort, account, errors, and why it may not be accepted.

    Attributes:
        excess: largest of the errors over their tolerances.
        factor: of the step, with which all of them would be met.
    """

    new: Instant
    report: NewtonReport
    account: Any
    error: float
    excess: float
    factor: float
    why: str


@dataclass
class TimePath:
    """Follows a problem in time.

    Attributes:
        problem: terms, inertia among them, and constraints.
        newton: solver of one step.
        inertia: the inertia term.
        scheme: integrator.
        settings: step sizes.
        past: last accepted states, latest first; one to begin with.
        check: returns why a converged state is inadmissible, or an empty string.
        book: energy book, or None.
        number: number of accepted steps.
        size: size of the next step; None: the first one of the settings.
        rates: those with which the last state was accepted; None: at a start.
    """

    problem: Problem
    newton: NewtonSolver
    inertia: InertiaTerm
    scheme: Scheme
    settings: TimeSettings
    past: list[Instant]
    check: Check | None = None
    book: Book | None = None
    number: int = 0
    size: float | None = None
    rates: Rates | None = None
    _warning: str = ""
    _length: float = field(init=False)
    _mass: float = field(init=False)

    def __post_init__(self) -> None:
        """Measure the sheet, to which local errors refer."""
        self._length = sheet_size(self.problem)
        self._mass = self._norm2(self._ones()) / 3  # of the three components

    def _ones(self) -> PETSc.Vec:
        ones = self.past[0].q.duplicate()
        ones.set(1.0)
        return ones

    def _norm2(self, vector: PETSc.Vec) -> float:
        """Vector . M vector."""
        local = self.problem.configuration.to_local(vector)
        share = self.inertia.mass.product(local, local)
        return float(self.problem.configuration.sum(share))

    def run(self, x: PETSc.Vec, stops: Sequence[float], on_accept: OnAccept | None = None) -> None:
        """Follow the motion through all stops.

        Whatever a step raises, x and the terms' time and rates stay those of the last state.

        Args:
            x: unknowns of past[0]; those of the last accepted state on return.
            stops: increasing times to be hit exactly.
            on_accept: called with each accepted step and its unknowns.

        Raises:
            InputError: see `check_stops`.
            SolveError: a step below the smallest size (or a fixed one) failed.

        Warns:
            AccuracyWarning: about an accepted state, once `on_accept` has seen it.
        """
        self.check_stops(stops)
        for stop in stops:
            while self.past[0].time < stop - 1e-9 * self.settings.step:
                try:
                    step = self._advance(x, stop)
                except BaseException:
                    self._return()
                    raise
                if on_accept:
                    on_accept(step, x)
                if self._warning:
                    warnings.warn(self._warning, AccuracyWarning, stacklevel=2)
                self.problem.warn()

    def _return(self) -> None:
        """Set the terms back to the last accepted state."""
        self.problem.set_time(self.past[0].time)
        if self.rates:
            self.problem.begin_step(self.rates)

    def check_stops(self, stops: Sequence[float]) -> None:
        """Refuse stops that do not increase, or that fixed steps do not hit.

        Raises:
            InputError: the message names the stops.
        """
        require_stops(stops)
        start, step = self.past[0].time, self.settings.step
        for stop in stops:
            count = (stop - start) / step
            if self.settings.fixed and count > 0 and abs(count - round(count)) > OFF_STEP:
                raise InputError(
                    f"stop {stop:g} is {count:.10g} fixed steps of {step:g} after "
                    f"{start:g}: give a multiple, or let the step adapt"
                )

    def _target(self, stop: float) -> float:
        """End of the next step: short of a stop or exactly on it, without a tiny last step."""
        now, settings = self.past[0].time, self.settings
        size = settings.step if settings.fixed else self.size or settings.step
        left = stop - now
        if left <= size * (1 + 1e-6):
            return stop
        return now + (left / ceil(left / size) if left < 2 * size and not settings.fixed else size)

    def _advance(self, x: PETSc.Vec, stop: float) -> TimeStep:
        """One accepted step towards a stop, cut as often as needed."""
        begin, tries = clock.perf_counter(), []
        target, now = self._target(stop), self.past[0].time
        size, least = target - now, self.settings.least
        while True:
            tried = self._try(x, target)
            tries.append(tried.report)
            smaller = self._smaller(tried, size)
            if smaller is None or (not tried.why and size <= least):
                break
            why = tried.why or f"errors of {tried.excess:.2g} times the tolerance"
            if self.settings.fixed or size <= least:
                self._give_up(why)
            log.info("step to %g failed (%s), cut to %g", target, why, smaller)
            size = max(smaller, least)  # target - now differs from it by round-off
            target = now + size
        text = f"step to {target:g}: errors of {tried.excess:.2g} times the tolerance at the"
        self._warning = f"{text} smallest step {size:g}" if smaller is not None else ""
        self._accept(x, tried)
        self.size = self._next_size(size, tried)
        return TimeStep(
            number=self.number,
            time=target,
            size=size,
            iterations=sum(report.iterations for report in tries),
            factorisations=sum(report.factorisations for report in tries),
            negative_pivots=self.newton.pivots,
            error=tried.error,
            seconds=clock.perf_counter() - begin,
            cuts=len(tries) - 1,
        )

    def _accept(self, x: PETSc.Vec, tried: _Try) -> None:
        """Make the end of a step the state from which the next one starts."""
        if self.book:
            self.book.post(tried.account)
        tried.new.q.copy(x)
        self.problem.accept(x)
        self.past = [tried.new, *self.past[: self.scheme.memory - 1]]
        self.rates = self.problem.rates
        self.number += 1
        PETSc.garbage_cleanup(x.comm)  # on several ranks Python's dropped vectors stay until here

    def _give_up(self, why: str) -> None:
        time, settings = self.past[0].time, self.settings
        self.problem.set_time(time)  # for the suspicions
        kind = "fixed step" if settings.fixed else "step of the smallest size"
        size = settings.step if settings.fixed else settings.least
        reasons = "; ".join([why, *self.problem.suspicions(self.past[0].q)])
        raise SolveError(f"{kind} {size:g} failed: {reasons}", time)

    def _smaller(self, tried: _Try, size: float) -> float | None:
        """Step to be tried instead, or None where the tried one is good."""
        if tried.why:
            return 0.5 * size
        if self.settings.fixed or tried.excess <= TOO_LARGE:
            return None
        return size * max(SHRINK, tried.factor)

    def _next_size(self, size: float, tried: _Try) -> float:
        settings, iterations = self.settings, tried.report.iterations
        factor = min(settings.growth, self.scheme.largest_ratio, tried.factor)
        if iterations > settings.easy:
            factor = min(factor, 1.0)
        if iterations > 2 * settings.easy:
            factor = min(factor, 1 / settings.growth)
        return min(max(size * factor, settings.least), settings.most)

    def _try(self, x: PETSc.Vec, target: float) -> _Try:
        """Solve one step from the last accepted state."""
        problem, newton = self.problem, self.newton
        formula = self.scheme.formula(target, self.past)
        problem.constraints.check(target)
        problem.set_time(target)
        problem.begin_step(local_rates(problem, formula, self.past))
        newton.report = NewtonReport()
        newton.forget_floor()
        trial, why = self._guess(x, target)
        if not why:
            report = newton.solve(trial, self.past[0].q, search=self.settings.fixed)
            why = "" if report.converged else report.reason
        if not why and self.check:
            why = self._checked(trial)
        new = Instant(target, trial, formula.velocity(trial))
        if why:
            return _Try(new, newton.report, None, 0.0, inf, 0.5, why)
        return self._judged(new, formula)

    def _judged(self, new: Instant, formula: Formula) -> _Try:
        """A solved step with its account and errors."""
        settings, order = self.settings, self.scheme.order
        error = self._error(new)
        excess = error / settings.tolerance
        factor = SAFETY * excess ** (-1 / (order + 1)) if excess else inf
        account = None
        if self.book:
            account = self.book.draft(self.past[0], new, formula)
            loss = self.book.loss(account) / settings.energy_tolerance
            slows = self._norm2(new.v) < self._norm2(self.past[0].v)
            if loss > 0 and (self.number or slows):  # Euler's first step halves what is set off
                excess = max(excess, loss)
                factor = min(factor, SAFETY * loss ** (-0.5 / order))
        return _Try(new, self.newton.report, account, error, excess, factor, "")

    def _checked(self, trial: PETSc.Vec) -> str:
        """Why a converged state is inadmissible; what no shorter step can mend is raised."""
        assert self.check is not None
        try:
            return self.check(trial)
        except SolveError as error:
            raise SolveError(error.reason, self.past[0].time) from None

    def _error(self, new: Instant) -> float:
        off = self.scheme.error(new, self.past)
        return float(np.sqrt(self._norm2(off) / self._mass) / self._length)

    def _guess(self, x: PETSc.Vec, target: float) -> tuple[PETSc.Vec, str]:
        """Last state moved on by its rates, prescribed unknowns at their values, or why not."""
        last, constraints = self.past[0], self.problem.constraints
        step = last.v.copy()
        step.scale(target - last.time)
        dofs = constraints.dofs
        step.array_w[dofs] = constraints.values(target) - x.array_r[dofs]
        return clear_start(self.problem, x, step, last.time)


def local_rates(problem: Problem, formula: Formula, past: Sequence[Instant]) -> Rates:
    """The formula with local vectors, as terms take it."""
    local = problem.configuration.to_local
    return Rates(
        rate=formula.rate,
        inertia=formula.inertia,
        weights=formula.weights,
        times=tuple(state.time for state in past[: len(formula.weights)]),
        last=local(past[0].q),
        base=local(formula.base),
        target=local(formula.target),
    )


def sheet_size(problem: Problem) -> float:
    """Diagonal of the bounding box of the sheet at rest."""
    configuration = problem.configuration
    rest = configuration.sheet.rest
    corners = np.concatenate([rest.max(axis=0, initial=-inf), (-rest).max(axis=0, initial=-inf)])
    high_low = reduced(configuration.comm, corners, MPI.MAX)
    return float(np.linalg.norm(high_low[:3] + high_low[3:]))
