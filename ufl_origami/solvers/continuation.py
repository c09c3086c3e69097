"""Path following by arc length, with limit points and bifurcations located on the way.

A step goes along the tangent of the path (Riks 1979, doi:10.1016/0020-7683(79)90081-7; Keller 1977)
and is corrected in the hyperplane normal to it. The arc length is that of the displacements alone
(root of their mean square over the sheet, over its diagonal), so that its unit is the same in
every scene. Each accepted state knows the inertia of its own tangent: its number of negative
eigenvalues at constant load and prescribed motion. Where that number or the direction of the load
changes, the point between is sought (path_events.py).
"""

import logging
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from petsc4py import PETSc

import numpy as np
from scipy.optimize import brentq

from ufl_origami.errors import SolveError
from ufl_origami.problem import Problem
from ufl_origami.solvers.arc import ArcPoint, ArcSettings, Event, Metric
from ufl_origami.solvers.bordered import Bordered, LoadFactor
from ufl_origami.solvers.newton import NewtonSolver
from ufl_origami.solvers.path_events import EVALUATIONS, EventSearch
from ufl_origami.solvers.stability import singular
from ufl_origami.solvers.static import Check, Step

log = logging.getLogger(__name__)

ON_A_STOP = 1e-6
"""Part of the first step within which a path starts on a stop: as well as states are solved."""


@dataclass(frozen=True)
class Stop:
    """Where a path ends.

    Attributes:
        measure: function of unknowns and load factor (collective) that passes zero there.
        reason: how messages call it.
    """

    measure: Callable[[PETSc.Vec, float], float]
    reason: str


class _Refused(Exception):
    """A step that cannot be accepted."""


OnAccept = Callable[[Step, ArcPoint], None]


@dataclass
class ArcPath:
    """Follows the equilibria of a problem by arc length.

    Attributes:
        problem: terms and constraints.
        newton: linear solver and tolerances.
        settings: steps.
        check: returns why a converged state is inadmissible, or an empty string.
        steps: accepted steps so far.
        events: limit points and bifurcations so far.
        point: where the path has come to.
        size: length of the next step; None: by the settings.
        longest: longest step so far.
        reason: why the path ended.
    """

    problem: Problem
    newton: NewtonSolver
    settings: ArcSettings = field(default_factory=ArcSettings)
    check: Check | None = None
    steps: list[Step] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    point: ArcPoint | None = None
    size: float | None = None
    longest: float = 0.0
    reason: str = ""

    def __post_init__(self) -> None:
        self.bordered = Bordered(self.newton, LoadFactor(self.problem))
        self.metric = Metric(self.problem)
        tolerance = self.settings.tolerance
        self.search = EventSearch(self.problem, self.metric, tolerance, self._between)
        self._iterations = self._factorisations = 0

    def start(self, x: PETSc.Vec, load: float, towards: PETSc.Vec | float) -> ArcPoint:
        """The first point, an equilibrium.

        Args:
            x: unknowns.
            load: load factor.
            towards: direction of the path: a change of the unknowns, or the sign of the load's.

        Raises:
            SolveError: nothing moves with the load factor.
        """
        self.bordered.parameter.set(load)
        self.problem.forces(x, x.duplicate())
        self.point = self._point(x, load, 0.0, towards)
        if self.size is None:
            self.size = min(self.settings.first / abs(self.point.slope), self.settings.largest)
        self.longest = self.size
        return self.point

    def _point(self, x: PETSc.Vec, load: float, arc: float, towards) -> ArcPoint:
        """Direction and inertia of the path at an equilibrium."""
        self.bordered.parameter.set(load)
        pivots = self.bordered.factor(x)
        self._factorisations += 1
        tangent = x.duplicate()
        self.bordered.solve_column(tangent)
        length = self.metric.norm(tangent)
        if not np.isfinite(length) or length == 0.0:
            raise SolveError("nothing moves with the load factor: the path has no direction", load)
        ahead = towards if np.isscalar(towards) else self.metric.dot(towards, tangent)
        slope = float(np.copysign(1.0 / length, ahead))
        tangent.scale(slope)
        neutral = pivots is not None and singular(self.newton)
        return ArcPoint(x, load, arc, tangent, slope, pivots, neutral)

    def run(
        self, stops: Sequence[Stop], on_accept: OnAccept | None = None, turns: int | None = None
    ) -> list[Step]:
        """Follow the path from its point until it meets a stop, or all steps are done.

        Args:
            stops: where it ends; a path that starts on a stop goes on to the next time it meets it.
            on_accept: called with each accepted step.
            turns: number of limit points after which it ends as well.

        Raises:
            SolveError: a step below the shortest length failed; `point` is the last accepted state.
        """
        point = self.point
        if point is None:
            raise ValueError("a path must be started before it is followed")
        self.reason = ""
        try:
            self._follow(point, stops, on_accept, turns)
        except BaseException:
            self.problem.set_time((self.point or point).load)
            raise
        return self.steps

    def _follow(self, point: ArcPoint, stops, on_accept, turns: int | None) -> None:
        before = [stop.measure(point.x, point.load) for stop in stops]
        while not self.reason and len(self.steps) < self.settings.steps:
            begin = clock.perf_counter()
            self._iterations = self._factorisations = 0
            new, cuts, stopped = self._advance(point, stops, before)
            if self.settings.locate:
                self.events += self.search.find(point, new)
            step = Step(
                number=len(self.steps) + 1,
                time=new.load,
                size=new.arc - point.arc,
                iterations=self._iterations,
                factorisations=self._factorisations,
                negative_pivots=new.pivots,
                neutral=new.neutral,
                seconds=clock.perf_counter() - begin,
                cuts=cuts,
            )
            self._adopt(new)
            before = [stop.measure(new.x, new.load) for stop in stops]
            self.reason = stopped.reason if stopped else self.turned(turns)
            self.steps.append(step)
            point = new
            if on_accept:
                on_accept(step, new)
        self.reason = self.reason or f"{len(self.steps)} steps are done"

    def turned(self, turns: int | None) -> str:
        """That there were as many limit points as asked for, or nothing."""
        found = sum(event.kind == "limit point" for event in self.events)
        return f"{found} limit points" if turns is not None and found >= turns else ""

    def _adopt(self, new: ArcPoint) -> None:
        self.problem.set_time(new.load)
        self.problem.accept(new.x)
        self.point = new
        PETSc.garbage_cleanup(new.x.comm)

    def _advance(self, old: ArcPoint, stops, before) -> tuple[ArcPoint, int, Stop | None]:
        """The next point, cut as often as needed, the stop that it meets, and the next length."""
        settings, cuts = self.settings, 0
        size = min(self.size or 0.0, settings.largest, settings.load / abs(old.slope))
        while True:
            try:
                new, iterations = self._try(old, size)
                self._refuse_bend(old, new)
                break
            except _Refused as refused:
                log.info("step of %g from load %g failed: %s", size, old.load, refused)
                cuts, size = cuts + 1, 0.5 * size
                if size < settings.shortest * self.longest:
                    reasons = "; ".join([str(refused), *self.problem.suspicions(old.x)])
                    raise SolveError(
                        f"step below the shortest length: {reasons}", old.load
                    ) from None
        self.longest = max(self.longest, size)
        growth = settings.growth if iterations <= settings.easy and not cuts else 1.0
        self.size = size * (0.6 if iterations > 2 * settings.easy else growth)
        for stop, value in zip(stops, before, strict=True):
            after = stop.measure(new.x, new.load)
            if value * after < 0 or (after == 0 and value != 0):
                met = self._stopped(old, new, stop, value, after)
                if met is not None:
                    return met, cuts, stop
        return new, cuts, None

    def _try(self, old: ArcPoint, size: float) -> tuple[ArcPoint, int]:
        """A point so far along the path, and its Newton iterations.

        Raises:
            _Refused: there is none that can be accepted.
        """
        settings, trial = self.settings, old.x.copy()
        trial.axpy(size, old.tangent)
        load = old.load + size * old.slope
        self._look_ahead(old, trial, load)
        predicted = trial.copy()
        row = self.metric.row(old.tangent)
        report = self.bordered.solve(trial, load, row, old.x)
        self._iterations += report.iterations
        self._factorisations += report.iterations
        if not report.converged:
            raise _Refused(report.reason)
        off = self.metric.distance(trial, predicted)
        if off > settings.stray * size:
            raise _Refused(f"the state is {off / size:.2g} of the step's length off the predicted")
        if self.check and (why := self.check(trial)):
            raise _Refused(why)
        new = self._point(trial, report.value, old.arc + size, old.tangent)
        return new, report.iterations

    def _refuse_bend(self, old: ArcPoint, new: ArcPoint) -> None:
        """Refuse a point whose direction is far from the one before.

        Very near a bifurcation the direction is lost in round-off.

        Raises:
            _Refused: it turned too far.
        """
        bend = float(np.arccos(np.clip(self.metric.dot(old.tangent, new.tangent), -1.0, 1.0)))
        if bend > self.settings.bend:
            raise _Refused(f"the path bends by {np.degrees(bend):.0f} deg")

    def _look_ahead(self, old: ArcPoint, trial: PETSc.Vec, load: float) -> None:
        """Refuse a guess behind a barrier, or with angles whose branch would be a guess.

        Raises:
            _Refused: it must not be tried.
        """
        problem = self.problem
        problem.constraints.check(load)
        problem.set_time(load)
        if problem.bounded:
            step = trial.copy()
            step.axpy(-1.0, old.x)
            if problem.longest_step(old.x, step, old.load) < 1.0:
                raise _Refused("an obstacle would close a gap")
        turn = problem.largest_turn(old.x, trial)
        if turn >= np.pi:
            raise _Refused(f"an angle would turn by {np.degrees(turn):.0f} deg")

    def _between(self, old: ArcPoint, size: float) -> ArcPoint:
        """A point between two accepted ones, counted from the first."""
        try:
            return self._try(old, size)[0]
        except _Refused as refused:
            raise SolveError(f"between two states of the path: {refused}", old.load) from None

    def _stopped(self, old: ArcPoint, new: ArcPoint, stop: Stop, below, above) -> ArcPoint | None:
        """The point at which a stop's measure is zero; None where the path starts there."""
        length, found = new.arc - old.arc, {0.0: below, new.arc - old.arc: above}

        def value(size: float) -> float:
            if size not in found:
                point = self._between(old, size)
                found[size] = stop.measure(point.x, point.load)
            return found[size]

        size = brentq(value, 0.0, length, xtol=1e-12 * length, rtol=1e-14, maxiter=EVALUATIONS)
        if old.arc == 0.0 and size <= ON_A_STOP * length:
            return None
        return self._between(old, size) if size < length else new
