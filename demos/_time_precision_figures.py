"""Chart of the study in time; called on rank 0 with all points."""

from collections.abc import Iterable, Sequence
from math import inf
from pathlib import Path

from _time_precision_problems import TIME_PROBLEMS, TimeProblem
from _time_precision_runs import CONTROLS, SCHEMES

from ufl_origami.plotting.work_precision import WorkCurve, WorkPanel, work_precision_chart
from ufl_origami.work_precision import TimePoint, picked


def moved(points: Iterable[TimePoint]) -> list[TimeProblem]:
    """Problems of the points, in the order of the study."""
    names = {point.problem for point in points}
    return [problem for problem in TIME_PROBLEMS if problem.name in names]


def draw_time(points: Sequence[TimePoint], folder: Path) -> Path:
    """Error against seconds, one panel a problem, schemes by colour, kinds of steps by line."""
    panels = [panel(points, problem) for problem in moved(points)]
    return work_precision_chart(
        panels,
        folder / "time_precision.png",
        columns=len(panels),
        abscissa="processor time (s)",
        refined="steps",
    )


def panel(points: Sequence[TimePoint], problem: TimeProblem) -> WorkPanel:
    """One problem."""
    curves = []
    for scheme, title in SCHEMES.items():
        for control in CONTROLS:
            own = picked(points, problem=problem.name, scheme=scheme, control=control)
            some = [p for p in own if 0 < p.error() < inf]
            if some:
                costs, errors = [p.seconds for p in some], [p.error() for p in some]
                curves.append(WorkCurve(costs, errors, title, control))
    return WorkPanel(problem.title, "relative error at the end", curves)
