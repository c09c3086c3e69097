"""One call that follows a scene's static path and keeps what it finds.

In the output folder:

* history.csv: one row an accepted step (see history.py);
* fields.*: the state at the start and after each accepted step (see output.py); a resumed run
  writes fields_from_STEP.* beside them;
* checkpoint/: the last accepted step (see checkpoint.py).
"""

import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

from petsc4py import PETSc

from tqdm import tqdm

from ufl_origami.checkpoint import Checkpoint, Progress
from ufl_origami.collective import on_rank0
from ufl_origami.discretise import build
from ufl_origami.errors import InputError, SolveError
from ufl_origami.history import CsvFile, History, Record, Recorder, Row, read_history, step_row
from ufl_origami.interrupt import InterruptRequest
from ufl_origami.model import Model
from ufl_origami.output import FieldWriter
from ufl_origami.quality import warn_sagitta
from ufl_origami.resolution import warn_round_off
from ufl_origami.scene import Scene
from ufl_origami.solvers.admissible import Admissible
from ufl_origami.solvers.newton import SHIFT_FACTOR, NewtonSettings, NewtonSolver
from ufl_origami.solvers.static import StaticPath, Step, StepSettings
from ufl_origami.supports import check_supports

HISTORY_FILE = "history.csv"
CHECKPOINT_FOLDER = "checkpoint"
COLLECTIVE_ERRORS = (SolveError, InputError, KeyboardInterrupt, OSError)


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
        scene: a scene, or a model to be continued from its current state.
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
        InputError: scene or record are incomplete or wrong, or there is no run of this scene to
            resume.
        OSError: a file could not be written.

    Warns:
        SupportWarning: a piece of the sheet may turn freely.
        MeshWarning: the mesh cannot represent the form, or the curvature that was found.
        StabilityWarning: an accepted state is unstable.
        BranchWarning: an accepted state was found far from the predicted one.
        RoundOffWarning: the forces at the end are smaller than their round-off.
    """
    if resume and output is None:
        raise InputError("resume: name the output folder of the run to resume")
    model = scene if isinstance(scene, Model) else build(scene)
    if not model.scene.terms:  # a term of the user's own may hold the sheet as well
        check_supports(model)
    solver = NewtonSolver(model.problem, newton or NewtonSettings())
    path = StaticPath(model.problem, solver, steps or StepSettings(), Admissible(model))
    log = _Log(model, record or Record())
    with ExitStack() as stack:
        observers = [log.observe]
        if output is not None:
            disk = stack.enter_context(_Disk(path, log, Path(output)))
            disk.resume() if resume else disk.begin()
            observers.append(disk.observe)
        bar = stack.enter_context(closing(_ProgressBar(model, stops, progress)))
        request = stack.enter_context(InterruptRequest())

        def accept(step: Step, x: PETSc.Vec) -> None:
            for observe in [*observers, bar.observe]:
                observe(step)
            if on_accept:
                on_accept(step, model)
            if request.agreed(model.sheet.comm):
                raise KeyboardInterrupt(f"stopped after the step to {step.time:g} was accepted")

        path.run(model.x, model.problem.time, stops, accept)
    warn_sagitta(model)
    warn_round_off(model)
    return StaticResult(model, path.steps, log.history)


class _Log:
    """History in memory, the same on all ranks."""

    def __init__(self, model: Model, record: Record):
        self.model, self.record, self.history = model, record, History()
        self._recorder = Recorder(model, record)

    def row(self, step: Step) -> Row:
        """Columns of a step, whose state the model is in; collective."""
        return step_row(step) | self._recorder.measure()

    def observe(self, step: Step) -> None:
        """Add the step's row, that of rank 0 (whose clock counts)."""
        self.history.rows.append(self.model.sheet.comm.bcast(self.row(step), root=0))


class _Disk:
    """History file, fields and checkpoint of one run, written in this order at each step.

    A run killed in between has rows and fields beyond its checkpoint; resuming drops such rows.
    """

    def __init__(self, path: StaticPath, log: _Log, folder: Path):
        self.path, self.log, self.folder = path, log, folder
        self.comm = log.model.sheet.comm
        self._checkpoint = Checkpoint(log.model, folder / CHECKPOINT_FOLDER)
        self._csv: CsvFile | None = None
        self._fields: FieldWriter | None = None

    def begin(self) -> None:
        """Start afresh: an earlier run's history, fields and checkpoint are replaced."""
        self._checkpoint.clear()
        self._open("fields")
        if self._fields:
            self._fields.write()
        self._save()

    def resume(self) -> None:
        """Take up model, solver, steps and history where the checkpoint left them.

        Raises:
            InputError: no checkpoint of this scene, or a history that does not fit it.
        """
        progress = self._checkpoint.read()
        self.path.steps[:] = progress.steps
        self.path.size, self.path.newton.shift = progress.size, progress.shift
        count = len(progress.steps)
        file = self.folder / HISTORY_FILE
        rows = on_rank0(self.comm, lambda: read_history(file, count).rows if count else [])
        self.log.history.rows[:] = self.comm.bcast(rows, root=0)
        self._require_history(progress.steps)
        self._open(f"fields_from_{count}")

    def _require_history(self, steps: list[Step]) -> None:
        history, file = self.log.history, self.folder / HISTORY_FILE
        if len(history) != len(steps):
            raise InputError(f"{file} has {len(history)} of the checkpoint's {len(steps)} steps")
        columns = tuple(self.log.row(steps[-1])) if steps else ()
        if columns != history.columns:
            other = sorted(set(columns) ^ set(history.columns))
            raise InputError(f"{file} was recorded with other columns: {other}")

    def _open(self, fields: str) -> None:
        """Open history and fields."""
        file = self.folder / HISTORY_FILE
        self._csv = on_rank0(self.comm, lambda: CsvFile(file, self.log.history.rows))
        if self.log.record.fields != "none":
            path = self.folder / fields
            self._fields = FieldWriter(self.log.model, path, self.log.record.fields)

    def observe(self, step: Step) -> None:
        """Write the state of an accepted step."""
        file, row = self._csv, self.log.history.rows[-1]
        on_rank0(self.comm, lambda: file.write(row) if file else None)
        if self._fields:
            self._fields.write()
        self._save()

    def _save(self) -> None:
        """Checkpoint, with the solver's memory as the first factorisation will need it.

        A continued run factors the tangent of its first state once more. Where that needed a
        shift, the guard has to find the same one at its first try.
        """
        steps, shift = self.path.steps, self.path.newton.shift
        if steps and steps[-1].negative_pivots:
            shift *= SHIFT_FACTOR
        time = self.log.model.problem.time
        self._checkpoint.write(Progress(time, steps, self.path.size, shift))

    def __enter__(self) -> "_Disk":
        """Files are opened by `begin` or `resume`."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Close the files.

        Fields are closed by all ranks together: not after an error that one rank may have alone,
        which waiting for the others would hide.
        """
        if self._csv:
            self._csv.close()
        together = kind is None or issubclass(kind, COLLECTIVE_ERRORS) or self.comm.size == 1
        if self._fields and together:
            self._fields.close()


class _ProgressBar:
    """Load factor, step, Newton iterations and step size on the error stream of rank 0."""

    def __init__(self, model: Model, stops: Sequence[float], shown: bool | None):
        start, self._bar = model.problem.time, None
        if model.sheet.comm.rank == 0 and (sys.stderr.isatty() if shown is None else shown):
            self._bar = tqdm(
                total=max([start, *stops]), initial=start, desc="load factor",
                bar_format="{desc} {n:.4g}/{total:.4g} |{bar}| {elapsed}{postfix}",
            )  # fmt: skip

    def observe(self, step: Step) -> None:
        """Show an accepted step."""
        if self._bar is not None:
            values = {"step": step.number, "newton": step.iterations, "size": f"{step.size:.3g}"}
            self._bar.set_postfix(values, refresh=False)
            self._bar.update(step.time - self._bar.n)

    def close(self) -> None:
        """Leave the last line standing."""
        if self._bar is not None:
            self._bar.close()
