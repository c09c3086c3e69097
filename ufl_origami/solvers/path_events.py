"""The search for limit points and bifurcations between two points of a path."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass

from scipy.optimize import brentq

from ufl_origami.errors import BranchWarning, SolveError
from ufl_origami.problem import Problem
from ufl_origami.solvers.arc import ArcPoint, Event, Metric
from ufl_origami.solvers.stability import Mode, crossing_mode

EVALUATIONS = 60
"""Points that the search for one event may take."""

BESIDE = 1e-3
"""Part of a step next to a limit point within which a change of inertia counts as its own."""


@dataclass(frozen=True)
class EventSearch:
    """Locates what happens within a step.

    Attributes:
        problem: terms and constraints.
        metric: inner product of the path.
        tolerance: length of the interval within which an event is located, over the step's.
        between: gives the point of the path at an arc length behind an accepted one.
    """

    problem: Problem
    metric: Metric
    tolerance: float
    between: Callable[[ArcPoint, float], ArcPoint]

    def find(self, old: ArcPoint, new: ArcPoint) -> list[Event]:
        """Locate the limit points and bifurcations between two accepted points.

        The inertia counts eigenvalues that change sign. What changes at the turn of the load is
        told apart from what changes before and after it.

        Warns:
            BranchWarning: one could not be located.
        """
        found: list[Event] = []
        ends = [old, new]
        try:
            if old.slope * new.slope < 0:
                limit, low, high = self._limit_point(old, new)
                found.append(limit)
                ends = [old, low, high, new]
            for first, last in zip(ends[::2], ends[1::2], strict=True):
                found += self._bifurcations(old, first, last)
        except SolveError as error:
            text = f"an event between load factors {old.load:g} and {new.load:g} was not located"
            warnings.warn(f"{text}: {error.reason}", BranchWarning, stacklevel=3)
        self.problem.set_time(new.load)
        return sorted(found, key=lambda event: event.arc)

    def _limit_point(self, old: ArcPoint, new: ArcPoint) -> tuple[Event, ArcPoint, ArcPoint]:
        """Where the load factor turns, and points close before and behind it."""
        length = new.arc - old.arc
        points = {0.0: old, length: new}

        def point(size: float) -> ArcPoint:
            if size not in points:
                points[size] = self.between(old, size)
            return points[size]

        tolerance = self.tolerance * length
        size = brentq(
            lambda size: point(size).slope, 0.0, length, xtol=tolerance, maxiter=EVALUATIONS
        )
        at, beside = point(size), max(BESIDE * length, 10 * tolerance)
        low, high = point(max(size - beside, 0.0)), point(min(size + beside, length))
        memory = self.problem.memory()
        args = (at.load, at.arc, low.pivots, high.pivots, at.x)
        return Event("limit point", *args, memory=memory), low, high

    def _bifurcations(self, old: ArcPoint, first: ArcPoint, last: ArcPoint) -> list[Event]:
        """Where eigenvalues pass zero between two points of the step that starts at `old`."""
        found: list[Event] = []
        before, after = first.pivots, last.pivots
        if before is None or after is None:
            return found
        for level in range(min(before, after), max(before, after)):
            point, mode = self._crossing(old, first, last, level)
            counts = (level, level + 1) if after > before else (level + 1, level)
            mode.vector.scale(1.0 / self.metric.norm(mode.vector))
            args = (point.load, point.arc, *counts, point.x, mode.vector)
            found.append(Event("bifurcation", *args, memory=self.problem.memory()))
        return found

    def _crossing(
        self, old: ArcPoint, first: ArcPoint, last: ArcPoint, level: int
    ) -> tuple[ArcPoint, Mode]:
        """Where the eigenvalue above `level` others passes zero, by secants within bisection."""
        low, high = first.arc - old.arc, last.arc - old.arc
        values: list[float | None] = [None, None]
        tolerance = self.tolerance * (high - low)
        for _ in range(EVALUATIONS):
            middle = 0.5 * (low + high)
            one, other = values
            if one is not None and other is not None and one * other < 0:
                secant = low + (high - low) * one / (one - other)
                margin = 0.05 * (high - low)
                middle = secant if low + margin < secant < high - margin else middle
            point = self.between(old, middle)
            mode = crossing_mode(self.problem, point.x, point.load, level, point.pivots or 0)
            if ((point.pivots or 0) > level) == ((first.pivots or 0) > level):
                low, values[0] = middle, mode.value
            else:
                high, values[1] = middle, mode.value
            if high - low < tolerance or abs(mode.value) < 1e-12:
                break
        return point, mode
