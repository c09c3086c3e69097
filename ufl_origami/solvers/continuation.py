"""Path following by arc length, with limit points and bifurcations located on the way.

A step goes along the tangent of the path (Riks 1979, doi:10.1016/0020-7683(79)90081-7; Keller 1977)
and is corrected in the hyperplane normal to it. The arc length is that of the displacements alone
(root of their mean square over the sheet, over its diagonal), so that its unit is the same in
every scene. Each accepted state knows the inertia of its own tangent: its number of negative
eigenvalues at constant load and prescribed motion. Where that number or the direction of the load
changes, the point between is sought.
"""

import logging
import time as clock
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from petsc4py import PETSc

import numpy as np
from scipy.optimize import brentq

from ufl_origami.errors import BranchWarning, InputError, SolveError
from ufl_origami.problem import Memories, Problem
from ufl_origami.solvers.bordered import Bordered, LoadFactor
from ufl_origami.solvers.dynamics import sheet_size
from ufl_origami.solvers.newton import NewtonSolver, area_weights
from ufl_origami.solvers.stability import Mode, crossing_mode
from ufl_origami.solvers.static import Check, Step

log = logging.getLogger(__name__)

EVALUATIONS = 60
"""Points that the search for one event may take."""


@dataclass(frozen=True)
class ArcSettings:
    """Steps along a path.

    Attributes:
        first: first step, in units of the load factor.
        largest: longest step, arc length.
        load: largest change of the load factor in one step.
        shortest: a step below this part of the first one, or of the longest since, is given up.
        growth: factor after an easy step.
        easy: Newton iterations up to which a step is easy; above twice as many the next is shorter.
        bend: largest angle (radians) between the directions at both ends of a step: a sharper bend
            is taken in shorter steps, and may be the jump to another branch.
        stray: largest distance of a state from the predicted one over the length of the step.
        tolerance: length of the interval within which an event is located, over the step's.
        steps: largest number of steps.
        locate: whether limit points and bifurcations are sought.
    """

    first: float = 0.05
    largest: float = 0.1
    load: float = np.inf
    shortest: float = 1e-5
    growth: float = 1.5
    easy: int = 5
    bend: float = np.pi / 6
    stray: float = 0.5
    tolerance: float = 1e-6
    steps: int = 1000
    locate: bool = True

    def __post_init__(self) -> None:
        """Refuse sizes that are none.

        Raises:
            InputError: naming the setting.
        """
        for name, value in vars(self).items():
            if name != "locate" and not value > 0:
                raise InputError(f"arc settings: {name} = {value} is not positive")
        if self.growth < 1:
            raise InputError(f"arc settings: growth {self.growth} is below 1")


class Metric:
    """Inner product of displacements: mean over the sheet, over its diagonal squared.

    Args:
        problem: terms and constraints.
    """

    def __init__(self, problem: Problem):
        self.weights = area_weights(problem.configuration, angles=False)
        self.diagonal = sheet_size(problem)
        self.weights.scale(3.0 / (self.weights.sum() * self.diagonal**2))

    def row(self, vector: PETSc.Vec) -> PETSc.Vec:
        """Coefficients of the product with a vector."""
        out = vector.duplicate()
        out.pointwiseMult(self.weights, vector)
        return out

    def dot(self, one: PETSc.Vec, other: PETSc.Vec) -> float:
        """Product of two vectors of unknowns."""
        return self.row(one).dot(other)

    def norm(self, vector: PETSc.Vec) -> float:
        """Length of a vector."""
        return float(np.sqrt(self.dot(vector, vector)))

    def distance(self, one: PETSc.Vec, other: PETSc.Vec) -> float:
        """Length of the difference of two vectors."""
        difference = one.copy()
        difference.axpy(-1.0, other)
        return self.norm(difference)


class ArcPoint(NamedTuple):
    """A point of a path.

    Attributes:
        x: unknowns.
        load: load factor.
        arc: arc length from the start.
        tangent: change of the unknowns with the arc length.
        slope: change of the load factor with it.
        pivots: negative pivots of the tangent stiffness, None where unknown.
    """

    x: PETSc.Vec
    load: float
    arc: float
    tangent: PETSc.Vec
    slope: float
    pivots: int | None


@dataclass(frozen=True)
class Event:
    """A limit point or a bifurcation.

    Attributes:
        kind: "limit point" or "bifurcation".
        load: load factor.
        arc: arc length at which it lies.
        before: negative pivots before it, None where unknown.
        after: negative pivots after it.
        x: unknowns; None where a resumed run has forgotten them.
        mode: the critical eigenvector, of length 1 by the path's metric; None where there is none.
        memories: what the terms remember, without which the unknowns are no state (angles are
            measured from the state accepted before).
    """

    kind: str
    load: float
    arc: float
    before: int | None
    after: int | None
    x: PETSc.Vec | None
    mode: PETSc.Vec | None = None
    memories: Memories | None = field(default=None, repr=False, compare=False)


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
        return ArcPoint(x, load, arc, tangent, slope, pivots)

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
                self._look_for_events(point, new)
            step = Step(
                number=len(self.steps) + 1,
                time=new.load,
                size=new.arc - point.arc,
                iterations=self._iterations,
                factorisations=self._factorisations,
                negative_pivots=new.pivots,
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
                return self._stopped(old, new, stop, value, after), cuts, stop
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

    def _stopped(self, old: ArcPoint, new: ArcPoint, stop: Stop, below, above) -> ArcPoint:
        """The point on the way at which a stop's measure is zero."""
        length, found = new.arc - old.arc, {0.0: below, new.arc - old.arc: above}

        def value(size: float) -> float:
            if size not in found:
                point = self._between(old, size)
                found[size] = stop.measure(point.x, point.load)
            return found[size]

        size = brentq(value, 0.0, length, xtol=1e-12 * length, rtol=1e-14, maxiter=EVALUATIONS)
        return self._between(old, size) if 0 < size < length else new

    def _look_for_events(self, old: ArcPoint, new: ArcPoint) -> None:
        """Locate the limit points and bifurcations of one step.

        The inertia counts eigenvalues that change sign. One of them belongs to a turn of the load.
        """
        turned, change = old.slope * new.slope < 0, (new.pivots or 0) - (old.pivots or 0)
        found: list[Event] = []
        try:
            if turned:
                found.append(self._limit_point(old, new))
            if None not in (old.pivots, new.pivots) and abs(change) != turned:
                found += self._bifurcations(old, new, found)
        except SolveError as error:
            text = f"an event between load factors {old.load:g} and {new.load:g} was not located"
            warnings.warn(f"{text}: {error.reason}", BranchWarning, stacklevel=2)
        memories = self.problem.memories() if found else None
        found = [replace(event, memories=memories) for event in found]
        self.events += sorted(found, key=lambda event: event.arc)
        self.problem.set_time(new.load)

    def _limit_point(self, old: ArcPoint, new: ArcPoint) -> Event:
        """Where the load factor turns."""
        length = new.arc - old.arc
        points = {0.0: old, length: new}

        def slope(size: float) -> float:
            if size not in points:
                points[size] = self._between(old, size)
            return points[size].slope

        tolerance = self.settings.tolerance * length
        size = brentq(slope, 0.0, length, xtol=tolerance, maxiter=EVALUATIONS)
        slope(size)
        at, low, high = points[size], _count(old, new, min), _count(old, new, max)
        rises = _count(old, new, lambda a, b: a) == low
        before, after = (low, high) if rises else (high, low)
        return Event("limit point", at.load, at.arc, before, after, at.x, None)

    def _bifurcations(self, old: ArcPoint, new: ArcPoint, limits: list[Event]) -> list[Event]:
        """Where eigenvalues pass zero that are not those of a turning load."""
        found: list[Event] = []
        for level in _levels(old.pivots, new.pivots):
            point, mode = self._crossing(old, new, level)
            close = 1e-3 * (new.arc - old.arc)
            if any(abs(limit.arc - point.arc) < close for limit in limits):
                continue
            up = (new.pivots or 0) > (old.pivots or 0)
            before, after = (level, level + 1) if up else (level + 1, level)
            mode.vector.scale(1.0 / self.metric.norm(mode.vector))
            args = (point.load, point.arc, before, after, point.x, mode.vector)
            found.append(Event("bifurcation", *args))
        return found

    def _crossing(self, old: ArcPoint, new: ArcPoint, level: int) -> tuple[ArcPoint, Mode]:
        """Where the eigenvalue above `level` others passes zero, by secants within bisection."""
        length = new.arc - old.arc
        low, high = (0.0, old), (length, new)
        values: list[float | None] = [None, None]
        tolerance = self.settings.tolerance * length
        for _ in range(EVALUATIONS):
            middle = 0.5 * (low[0] + high[0])
            one, other = values
            if one is not None and other is not None and one * other < 0:
                secant = low[0] + (high[0] - low[0]) * one / (one - other)
                margin = 0.05 * (high[0] - low[0])
                inside = low[0] + margin < secant < high[0] - margin
                middle = secant if inside else middle
            point = self._between(old, middle)
            mode = crossing_mode(self.problem, point.x, point.load, level, point.pivots or 0)
            if ((point.pivots or 0) > level) == ((old.pivots or 0) > level):
                low, values[0] = (middle, point), mode.value
            else:
                high, values[1] = (middle, point), mode.value
            if high[0] - low[0] < tolerance or abs(mode.value) < 1e-12:
                break
        return point, mode


def _count(old: ArcPoint, new: ArcPoint, choose) -> int | None:
    if old.pivots is None or new.pivots is None:
        return None
    return choose(old.pivots, new.pivots)


def _levels(before: int | None, after: int | None) -> range:
    """Numbers of negative eigenvalues below each one that changes sign."""
    low, high = sorted((before or 0, after or 0))
    return range(low, high)
