"""One case of the map of limit points: led by load, by place or by arc length, and judged."""

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
from _failure_cases import Method
from _failure_runs import KINDS, Outcome, judge
from _snap_cases import PROBLEMS, Snap, SnapCase

from ufl_origami.discretise import build
from ufl_origami.errors import SolveError
from ufl_origami.history import History, Record
from ufl_origami.model import Model
from ufl_origami.path_stops import PathStop
from ufl_origami.paths import follow_path
from ufl_origami.run import solve_static
from ufl_origami.solvers.arc import ArcSettings
from ufl_origami.solvers.newton import NewtonSettings
from ufl_origami.solvers.static import Step, StepSettings

METHODS = (Method("director", "ddg"), Method("fem", "fem"))
OWN = ("load", "place", "arc")
BOUND = 0.03  # error above which an end state or a limit load is wrong
EXPLAINED = (
    "An end is wrong when its place (where the load leads) or its load (over the largest one) is "
    f"more than {BOUND:.0%} off. A limit point counts as found when the load of its event (arc), "
    "or of the parabola through the three states about it, is within that bound."
)


@dataclass(frozen=True)
class Lead:
    """A way to go along a path.

    Attributes:
        name: name in tables and maps.
        by: "load", "place" or "arc".
        newton: `NewtonSettings.method`.
        cuts: whether steps are cut and grow.
    """

    name: str
    by: str
    newton: str = "default"
    cuts: bool = True


LEADS = (
    Lead("newton", "load", "newton", cuts=False),
    Lead("bt", "load", "bt", cuts=False),
    Lead("load", "load"),
    Lead("place", "place"),
    Lead("arc", "arc"),
)
WHOLE = {"problem": tuple(PROBLEMS), "steps": (4, 16, 64)}
QUICK = {"problem": ("truss",), "steps": (16,)}


def declare(values: dict) -> dict[str, dict[str, Snap]]:
    """Groups of rows, title -> label -> case."""
    return {
        f"limit points, {problem}: steps": {f"{n}": Snap(problem, n) for n in values["steps"]}
        for problem in values["problem"]
    }


def in_short(snap: Snap, method: Method, lead: Lead) -> bool:
    """Whether a case is in the short grid: all of its few are."""
    return True


def run_snap(snap: Snap, method: Method, lead: Lead, comm: MPI.Comm) -> Outcome:
    """Follow and judge one case; collective."""
    begin = time.perf_counter()
    case = PROBLEMS[snap.problem].case(method.model, comm)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model = build(case.make(lead.by != "place"))
        rows = History()
        reason, found = _follow(snap, case, lead, model, rows)
    loads, places = (_column(rows, name) for name in ("load", "place"))
    error = None if reason else _error(case, lead, loads[-1], places[-1])
    return Outcome(
        setting=snap,
        method=method.name,
        solver=lead.name,
        verdict=judge(error, BOUND),
        error=error,
        iterations=int(sum(row["newton_iterations"] or 0 for row in rows.rows)),
        reached=float(places[-1] / case.end[1]) if len(places) else 0.0,
        reason=reason,
        warned=tuple(sorted({KINDS[w.category] for w in caught if w.category in KINDS})),
        triangles=model.sheet.num_cells_global,
        unknowns=model.num_unknowns,
        seconds=time.perf_counter() - begin,
        measured={
            "limit_points": found,
            "of": len(case.limits),
        },
    )


def load_of(model: Model, case: SnapCase, lead: Lead) -> float:
    """Load factor, or the reaction that takes its place; collective."""
    if lead.by != "place":
        return model.problem.time
    name, unit = case.reaction
    return float(model.reaction(name)[2]) / unit


def _follow(snap: Snap, case: SnapCase, lead: Lead, model: Model, rows: History) -> tuple[str, int]:
    """Go to the end: why it failed or an empty string, and the number of limit points found.

    A row is kept of each accepted step.
    """
    record = Record(energies=False, reactions=(), creases=(), points=(), fields="none")
    newton = NewtonSettings(method=lead.newton)

    def keep(step: Step, built: Model) -> None:
        values = {"place": case.place(built), "load": load_of(built, case, lead)}
        rows.rows.append(values | {"newton_iterations": step.iterations})

    options = {"record": record, "newton": newton, "on_accept": keep, "progress": False}
    try:
        if lead.by == "arc":
            stop = PathStop(case.place, case.end[1], "place")
            arc = ArcSettings(first=case.last / snap.steps, largest=1.0 / snap.steps)
            path = follow_path(model, [stop], arc=arc, **options)
            return "", matches([event.load for event in path.limit_points], case.limits)
        end = case.last if lead.by == "load" else 1.0
        size = end / snap.steps
        steps = StepSettings(first=size, largest=size, smallest=0.75 * size)
        if lead.cuts:
            steps = StepSettings(first=size, largest=size, smallest=1e-3 * size)
        solve_static(model, [end], steps=steps, **options)
    except SolveError as error:
        return error.reason, 0
    return "", matches(turns(_column(rows, "place"), _column(rows, "load")), case.limits)


def passed(outcome: Outcome) -> bool:
    """Whether a path ended right with all its limit points."""
    whole = outcome.measured["limit_points"] == outcome.measured["of"]
    return outcome.verdict == "right" and whole


def hidden(outcome: Outcome) -> bool:
    """Whether a load that leads got past a limit point without a warning."""
    led = outcome.solver not in ("place", "arc") and outcome.verdict != "failed"
    return led and not outcome.warned


def _column(rows: History, name: str) -> np.ndarray:
    return np.array([row[name] for row in rows.rows], dtype=float)


def _error(case: SnapCase, lead: Lead, load: float, place: float) -> float:
    """Distance of the end from the known one, in what does not lead.

    For the thin roof no place is known at a load that it has beyond the limit points only: there a
    load that leads must end beyond the other ways' end.
    """
    end_load, end_place = case.end
    if lead.by != "load":
        return abs(load - end_load) / max(end_load, *map(abs, case.limits))
    if case.last > end_load:
        return max(0.0, 1.0 - place / end_place)
    return abs(place / end_place - 1.0)


def turns(places: np.ndarray, loads: np.ndarray) -> list[float]:
    """Loads at which a history of loads turns: of the parabola through three states each."""
    found = []
    for i in range(len(loads) - 2):
        place, load = places[i : i + 3], loads[i : i + 3]
        if (load[1] - load[0]) * (load[2] - load[1]) < 0 and len(set(place)) == 3:
            parabola = np.polynomial.Polynomial.fit(place, load, 2)
            found.append(float(parabola(parabola.deriv().roots()[0])))
    return found


def matches(found: Sequence[float], limits: Sequence[float]) -> int:
    """How many limit points are among the turns found, in their order."""
    count = 0
    for load in found:
        if count < len(limits) and abs(load / limits[count] - 1.0) < BOUND:
            count += 1
    return count
