"""One call that follows a scene's static path and keeps what it finds."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from petsc4py import PETSc

from ufl_origami.build import build
from ufl_origami.history import CsvFile, History, Record, Recorder, step_row
from ufl_origami.model import Model
from ufl_origami.scene import Scene
from ufl_origami.solvers.newton import NewtonSettings, NewtonSolver
from ufl_origami.solvers.static import StaticPath, Step, StepSettings

HISTORY_FILE = "history.csv"


@dataclass(frozen=True)
class StaticResult:
    """A static path that reached its last stop.

    Attributes:
        model: the model in its last accepted state.
        steps: accepted steps.
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
) -> StaticResult:
    """Follow the equilibrium of a scene over the load factor; collective.

    Args:
        scene: a scene, or a model to be continued from its current state.
        stops: increasing load factors to be hit exactly.
        output: folder for history.csv; None keeps the history in memory only.
        record: what the history holds.
        steps: step sizes.
        newton: method and tolerances of one equilibrium.

    Raises:
        SolveError: a step below the smallest size failed; all accepted steps are on disk and the
            model is in the last accepted state.
        InputError: the scene or the record is incomplete or wrong.
    """
    model = scene if isinstance(scene, Model) else build(scene)
    recorder = Recorder(model, record or Record())
    history = History()
    solver = NewtonSolver(model.problem, newton or NewtonSettings())
    path = StaticPath(model.problem, solver, steps or StepSettings())
    csv_file = None
    if output is not None and model.sheet.comm.rank == 0:
        Path(output).mkdir(parents=True, exist_ok=True)
        csv_file = CsvFile(Path(output) / HISTORY_FILE)

    def on_accept(step: Step, x: PETSc.Vec) -> None:
        row = step_row(step) | recorder.measure()
        history.rows.append(row)
        if csv_file:
            csv_file.write(row)

    try:
        path.run(model.x, model.problem.time, stops, on_accept)
    finally:
        if csv_file:
            csv_file.close()
    return StaticResult(model, path.steps, history)
