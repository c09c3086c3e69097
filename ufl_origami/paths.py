"""Paths of equilibria by arc length: through limit points, with a verdict on each state.

`follow_path` is to `solve_static` what arc length is to load control: the load factor is one of the
unknowns. All that a scene makes follow the load factor does (loads, rest angles, prescribed motion,
obstacles).
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from petsc4py import PETSc

import numpy as np

from ufl_origami.checkpoint import Memory
from ufl_origami.discretise import build
from ufl_origami.errors import InputError
from ufl_origami.history import History, Record, Row, energy_columns, step_row
from ufl_origami.model import Model, unchanged_where_refused
from ufl_origami.path_stops import PathStop, make_stops
from ufl_origami.quality import warn_sagitta
from ufl_origami.recording import Log, Recording, recorded
from ufl_origami.resolution import warn_round_off
from ufl_origami.run import end_motion
from ufl_origami.scene import Scene
from ufl_origami.solvers.admissible import Admissible
from ufl_origami.solvers.arc import ArcPoint, ArcSettings, Event
from ufl_origami.solvers.continuation import ArcPath, Stop
from ufl_origami.solvers.newton import NewtonSettings, NewtonSolver
from ufl_origami.solvers.static import Step
from ufl_origami.supports import check_supports
from ufl_origami.terms.base import Term


@dataclass(frozen=True)
class PathResult:
    """A path that was followed.

    Attributes:
        model: the model in its last state.
        steps: accepted steps.
        history: what was recorded at each, the start included.
        events: limit points and bifurcations in the order of the path.
        end: last point, with the path's direction there.
        reason: which stop was met, or that all steps are done.
    """

    model: Model
    steps: list[Step]
    history: History
    events: list[Event]
    end: ArcPoint
    reason: str

    @property
    def limit_points(self) -> list[Event]:
        """Points at which the load factor turns."""
        return [event for event in self.events if event.kind == "limit point"]

    @property
    def bifurcations(self) -> list[Event]:
        """Points at which other paths cross."""
        return [event for event in self.events if event.kind == "bifurcation"]


def follow_path(
    scene: Scene | Model,
    stops: Sequence[PathStop | float],
    *,
    turns: int | None = None,
    towards: PETSc.Vec | float = 1.0,
    output: str | Path | None = None,
    record: Record | None = None,
    arc: ArcSettings | None = None,
    newton: NewtonSettings | None = None,
    resume: bool = False,
    progress: bool | None = None,
    on_accept: Callable[[Step, Model], None] | None = None,
) -> PathResult:
    """Follow the equilibria of a scene by arc length until a stop is met; collective.

    Args:
        scene: a scene, or a model in an equilibrium to go on from.
        stops: values at which the path ends, whichever is met first; a number is a load factor.
            A path may start on a stop.
        turns: number of limit points after which the path ends as well.
        towards: direction in which to set out: the sign of the load factor's change, or a change of
            the unknowns (`PathResult.end.tangent` to go on).
        output: folder for history, events, fields and checkpoint; None keeps them in memory only.
        record: what history and fields hold.
        arc: sizes of the steps.
        newton: tolerances and kind of tangent; it never shifts.
        resume: continue the run in `output` from its last accepted step; limit points and
            bifurcations found before have no states then.
        progress: show a progress bar; None: where the error stream is a terminal.
        on_accept: called on all ranks with each accepted step and the model in its state.

    Raises:
        SolveError: a step below the shortest length failed; all accepted steps are on disk and the
            model is in the last accepted state.
        KeyboardInterrupt: after Ctrl-C; all accepted steps are on disk.
        InputError: scene, stops or record are incomplete or wrong, or there is no such run to
            resume.
        OSError: a file could not be written.

    Warns:
        BranchWarning: a limit point or bifurcation was passed and could not be located.
        MeshWarning, RoundOffWarning: as `solve_static` does.
    """
    how = Recording(output, resume, progress, on_accept)
    how.require_folder()
    wanted = make_stops(stops)
    if not wanted and turns is None:
        raise InputError("a path needs a stop, or a number of turns")
    if turns is not None and turns < 1:
        raise InputError(f"turns = {turns}: a path ends after one limit point or more")
    _require_way(towards)
    model = scene if isinstance(scene, Model) else build(scene)
    if not model.scene.terms:
        check_supports(model)
    record = record or Record()
    measures = [Stop(_measure(model, stop), _text(stop)) for stop in wanted]
    with unchanged_where_refused(model), ExitStack() as start:
        end_motion(model)
        for term in model.contacts:
            term.check(model.state)
        solver = NewtonSolver(model.problem, newton or NewtonSettings())
        start.callback(solver.close)
        path = ArcPath(model.problem, solver, arc or ArcSettings(), Admissible(model))
        log = Log(model, record, _PathRun(path, model, record))
        for measure in measures:
            measure.measure(model.x, model.problem.time)
        path.start(model.x.copy(), model.problem.time, towards)
        start.pop_all()
    with closing(solver), recorded(log, how, [], "load factor") as record_step:

        def accept(step: Step, point: ArcPoint) -> None:
            point.x.copy(model.x)
            record_step(step)

        if path.reason not in [*map(_text, wanted), path.turned(turns)] or not path.reason:
            path.run(measures, accept, turns)
    warn_sagitta(model)
    warn_round_off(model)
    assert path.point is not None
    return PathResult(model, path.steps, log.history, path.events, path.point, path.reason)


def _require_way(towards: PETSc.Vec | float) -> None:
    size = towards.norm() if isinstance(towards, PETSc.Vec) else towards
    if size == 0 or not np.isfinite(size):
        raise InputError(f"towards: {size:g} is no direction to set out in")


def _text(stop: PathStop) -> str:
    return f"{stop.text} = {stop.value:g}"


def _measure(model: Model, stop: PathStop) -> Callable[[PETSc.Vec, float], float]:
    """Distance of a stop's measure from its value at a trial state, the model left as it was."""

    def measure(x: PETSc.Vec, load: float) -> float:
        kept, time = model.x, model.problem.time
        model.x = x
        try:
            model.problem.set_time(load)
            return stop.measure(model) - stop.value
        finally:
            model.x = kept
            model.problem.set_time(time)

    return measure


@dataclass(frozen=True)
class _PathRun:
    """A path as it is recorded."""

    solver: ClassVar[str] = "follow_path"
    path: ArcPath
    model: Model
    record: Record

    @property
    def rows(self) -> int:
        """The start, and one a step."""
        return len(self.path.steps) + 1

    @property
    def terms(self) -> Sequence[Term]:
        """All terms of the model."""
        return self.model.problem.terms

    @property
    def point(self) -> ArcPoint:
        """Where the path has come to."""
        assert self.path.point is not None
        return self.path.point

    def columns(self) -> Row:
        """Columns of the last step, arc length, events so far, and energies."""
        point, steps = self.point, self.path.steps
        start = Step(0, point.load, 0.0, 0, 0, point.pivots, 0.0, 0, point.neutral)
        kinds = [event.kind for event in self.path.events]
        own: Row = {
            "arc_length": point.arc,
            "limit_points": kinds.count("limit point"),
            "bifurcations": kinds.count("bifurcation"),
        }
        energies = energy_columns(self.model.energies()) if self.record.energies else {}
        return step_row(steps[-1] if steps else start) | own | energies

    def vectors(self) -> dict[str, PETSc.Vec]:
        """Direction of the path."""
        return {"tangent": self.point.tangent}

    def memory(self) -> Memory:
        """Steps, events without their states, and where the path is."""
        point, path = self.point, self.path
        return {
            "path": [point.load, point.arc, point.slope, point.pivots, point.neutral],
            "steps": list(map(asdict, path.steps)),
            "size": path.size,
            "longest": path.longest,
            "reason": path.reason,
            "events": [event_row(event) for event in path.events],
        }

    def recall(self, memory: Memory, vectors: dict[str, PETSc.Vec]) -> None:
        """Take up the path."""
        path, (load, arc, *rest) = self.path, memory["path"]
        path.point = ArcPoint(self.model.x.copy(), load, arc, vectors["tangent"], *rest)
        path.steps[:] = [Step(**step) for step in memory["steps"]]
        path.size, path.longest = memory["size"], memory["longest"]
        path.reason = memory["reason"]
        path.events[:] = [_event(row) for row in memory["events"]]


EVENT_COLUMNS = ("kind", "load", "arc", "before", "after")


def event_row(event: Event) -> dict[str, Any]:
    """An event without its state, as JSON and tables hold it."""
    return {name: getattr(event, name) for name in EVENT_COLUMNS}


def _event(row: Mapping[str, Any]) -> Event:
    return Event(**row, x=None)
