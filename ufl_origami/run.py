"""One call that follows a scene's static path and keeps what it finds (see recording.py)."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import ClassVar

from petsc4py import PETSc

from ufl_origami.checkpoint import Memory
from ufl_origami.discretise import build
from ufl_origami.history import History, Record, Row, energy_columns, step_row
from ufl_origami.model import Model, unchanged_where_refused
from ufl_origami.quality import warn_sagitta
from ufl_origami.recording import Log, Recording, recorded
from ufl_origami.resolution import warn_round_off
from ufl_origami.scene import Scene
from ufl_origami.solvers.admissible import Admissible
from ufl_origami.solvers.newton import SHIFT_FACTOR, NewtonSettings, NewtonSolver
from ufl_origami.solvers.static import StaticPath, Step, StepSettings
from ufl_origami.solvers.stops import require_stops
from ufl_origami.supports import check_supports
from ufl_origami.terms.base import Term


@dataclass(frozen=True)
class StaticResult:
    """A static path that reached its last stop.

    Attributes:
        model: the model in its last accepted state.
        steps: accepted steps, those before a restart included.
        history: what was recorded at each step, the same on all ranks.
    """

    model: Model
    steps: list[Step]
    history: History


def solve_static(
    scene: Scene | Model,
    stops: Sequence[float],
    *,
    output: str | Path | None = None,
    record: Record | None = None,
    steps: StepSettings | None = None,
    newton: NewtonSettings | None = None,
    resume: bool = False,
    progress: bool | None = None,
    on_accept: Callable[[Step, Model], None] | None = None,
) -> StaticResult:
    """Follow the equilibrium of a scene over the load factor; collective.

    The first Ctrl-C stops after the step under way is accepted, on all ranks; a second one at once.

    Args:
        scene: a scene, or a model to be continued from its current state (after a motion at the
            load factor that was held in it).
        stops: increasing load factors to be hit exactly.
        output: folder for history, fields and checkpoint (what an earlier run left there is
            replaced unless this run resumes it); None keeps the history in memory only.
        record: what history and fields hold.
        steps: step sizes.
        newton: method and tolerances of one equilibrium.
        resume: continue the run in `output` from its last accepted step, on any number of ranks;
            on one rank, with the settings it had, to the same bits.
        progress: show a progress bar; None: where the error stream is a terminal.
        on_accept: called on all ranks with each accepted step and the model in its state, after
            history, fields and checkpoint are written.

    Raises:
        SolveError: a step below the smallest size failed; all accepted steps are on disk and the
            model is in the last accepted state.
        KeyboardInterrupt: after Ctrl-C; all accepted steps are on disk.
        InputError: scene, record or stops are incomplete or wrong, or there is no run of this scene
            to resume; model and output are as before.
        OSError: a file could not be written.

    Warns:
        SupportWarning: a piece of the sheet may turn freely.
        MeshWarning: the mesh cannot represent the form, or the curvature that was found.
        StabilityWarning: an accepted state is unstable.
        BranchWarning: an accepted state was found far from the predicted one.
        RoundOffWarning: the forces at the end are smaller than their round-off.
    """
    how = Recording(output, resume, progress, on_accept)
    how.require_folder()
    model = scene if isinstance(scene, Model) else build(scene)
    if not model.scene.terms:  # a term of the user's own may hold the sheet as well
        check_supports(model)
    record = record or Record()
    with unchanged_where_refused(model):
        end_motion(model)
        require_stops(stops, None if resume else model.problem.time)
        for term in model.contacts:
            term.check(model.state)
        solver = NewtonSolver(model.problem, newton or NewtonSettings())
        path = StaticPath(model.problem, solver, steps or StepSettings(), Admissible(model))
        log = Log(model, record, _StaticRun(path, model, record))
    with closing(solver), recorded(log, how, stops, "load factor") as accept:
        path.run(model.x, model.problem.time, stops, lambda step, _: accept(step))
    warn_sagitta(model)
    warn_round_off(model)
    return StaticResult(model, path.steps, log.history)


def end_motion(model: Model) -> None:
    """End a motion: the path goes on at the load factor that was held in it."""
    if model.load_factor.held is not None:
        start, model.load_factor.held = model.load_factor.held, None
        model.problem.set_time(start)
    model.motion = model.balance = None


@dataclass(frozen=True)
class _StaticRun:
    """A static path as it is recorded."""

    solver: ClassVar[str] = "solve_static"
    path: StaticPath
    model: Model
    record: Record

    @property
    def rows(self) -> int:
        """One a step."""
        return len(self.path.steps)

    @property
    def terms(self) -> Sequence[Term]:
        """All terms of the model."""
        return self.model.problem.terms

    def columns(self) -> Row:
        """Columns of the last step, and energies."""
        energies = energy_columns(self.model.energies()) if self.record.energies else {}
        return step_row(self.path.steps[-1]) | energies

    def vectors(self) -> dict[str, PETSc.Vec]:
        """None."""
        return {}

    def memory(self) -> Memory:
        """Steps and sizes, with the solver's memory as the first factorisation will need it.

        A continued run factors the tangent of its first state once more. Where that needed a
        shift, the guard has to find the same one at its first try.
        """
        steps, shift = self.path.steps, self.path.newton.shift
        if steps and steps[-1].negative_pivots:
            shift *= SHIFT_FACTOR
        return {"steps": list(map(asdict, steps)), "size": self.path.size, "shift": shift}

    def recall(self, memory: Memory, vectors: dict[str, PETSc.Vec]) -> None:
        """Take up solver and steps."""
        self.path.steps[:] = [Step(**step) for step in memory["steps"]]
        size, largest = memory["size"], self.path.settings.largest
        self.path.size = size and min(size, largest)
        self.path.newton.shift = memory["shift"]
