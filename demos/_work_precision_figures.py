"""Charts of the speed-accuracy study; called on rank 0 with all points."""

from collections.abc import Iterable, Iterator, Sequence
from math import inf
from pathlib import Path

from _work_precision_problems import METHODS, PROBLEMS, Problem

from ufl_origami.plotting.work_precision import WorkCurve, WorkPanel, work_precision_chart
from ufl_origami.work_precision import Point, error_names, picked

COSTS = {"seconds": "processor time (s)", "dofs": "unknowns"}
NAMES = {
    "angle": "fold angle",
    "force": "pull",
    "profile": "profile",
    "deflection": "deflection",
    "largest": "largest error",
}
COLUMNS = 3
LEAST = 3e-5  # error at which the overview ends


def known(points: Iterable[Point]) -> list[Problem]:
    """Problems of the points, in the order of the study."""
    names = {point.problem for point in points}
    return [problem for problem in PROBLEMS if problem.name in names]


def chart_title(problem: Problem, thickness: float) -> str:
    """Title of a chart."""
    return f"{problem.title}, {problem.ratio} = {thickness:g}"


def draw_all(points: Sequence[Point], folder: Path) -> list[Path]:
    """One chart a cost with all errors, and an overview with the largest ones against seconds."""
    files = [
        work_precision_chart(
            list(every_panel(points, cost)),
            folder / f"error_{cost}.png",
            columns=COLUMNS,
            abscissa=name,
        )
        for cost, name in COSTS.items()
    ]
    overview = list(overview_panels(points))
    file = folder / "speed_accuracy.png"
    columns = min(COLUMNS, len(overview))
    chart = work_precision_chart(
        overview, file, columns=columns, abscissa=COSTS["seconds"], least=LEAST
    )
    return [chart, *files]


def every_panel(points: Sequence[Point], cost: str) -> Iterator[WorkPanel]:
    """Each error of each problem at each thickness."""
    for problem in known(points):
        own = picked(points, problem=problem.name)
        for error in error_names(own):
            for thickness in dict.fromkeys(p.thickness for p in own):
                yield panel(own, problem, thickness, error, cost)


def overview_panels(points: Sequence[Point]) -> Iterator[WorkPanel]:
    """The largest error: the Z-fold at all thicknesses, the others at their middle one."""
    for problem in known(points):
        own = picked(points, problem=problem.name)
        every = sorted({p.thickness for p in own}, reverse=True)
        some = every if problem is PROBLEMS[0] else every[len(every) // 2 : len(every) // 2 + 1]
        for thickness in some:
            yield panel(own, problem, thickness, "largest", "seconds")


def panel(
    points: Sequence[Point], problem: Problem, thickness: float, error: str, cost: str
) -> WorkPanel:
    """One chart."""
    curves = []
    for method in METHODS:
        for mesh in dict.fromkeys(p.mesh for p in points):
            chosen = picked(points, method=method.name, mesh=mesh, thickness=thickness)
            some = [p for p in chosen if 0 < p.error(error) < inf]
            if some:
                costs = [getattr(p, cost) for p in some]
                errors = [p.error(error) for p in some]
                curves.append(WorkCurve(costs, errors, method.title, mesh))
    ordinate = f"relative error: {NAMES[error]}"
    return WorkPanel(chart_title(problem, thickness), ordinate, curves)
