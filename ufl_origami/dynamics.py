"""One call that follows a scene in time and keeps what it finds (see recording.py)."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import ClassVar

from petsc4py import PETSc

import numpy as np

from ufl_origami.checkpoint import Memory
from ufl_origami.collective import together
from ufl_origami.discretise import build
from ufl_origami.energy_book import EnergyBook
from ufl_origami.errors import InputError, SceneError
from ufl_origami.history import History, Record, Row, time_row
from ufl_origami.model import Model, unchanged_where_refused
from ufl_origami.problem import Problem
from ufl_origami.recording import Log, Recording, recorded
from ufl_origami.scene import Scene
from ufl_origami.solvers.admissible import Admissible
from ufl_origami.solvers.dynamics import TimePath, TimeSettings, TimeStep, sheet_size
from ufl_origami.solvers.newton import NewtonSettings, NewtonSolver
from ufl_origami.solvers.schemes import Instant, Scheme, find_scheme
from ufl_origami.solvers.stops import require_stops
from ufl_origami.surroundings import damping_terms, make_motion
from ufl_origami.terms.base import Term

ITERATIONS = 20
"""Default of `NewtonSettings.iterations` in time: a cut wastes all those of a step."""

REUSE = 3.0
"""Default of `NewtonSettings.reuse` in time: a step's first tangent mostly serves to its end."""

JUMP = 1e-9
"""Distance over the sheet's diagonal, or angle, by which prescribed motion may start off."""

MOMENT = 1e-7
"""Time over which the rate of prescribed motion is measured at the start."""


@dataclass(frozen=True)
class DynamicResult:
    """A motion that reached its last stop.

    Attributes:
        model: the model in its last accepted state; `model.motion` has its rates.
        steps: accepted steps of this call.
        history: what was recorded at the start and after each step, the same on all ranks.
    """

    model: Model
    steps: list[TimeStep]
    history: History


def solve_dynamic(
    scene: Scene | Model,
    stops: Sequence[float],
    time: TimeSettings,
    *,
    scheme: str | Scheme = "bdf2",
    output: str | Path | None = None,
    record: Record | None = None,
    newton: NewtonSettings | None = None,
    resume: bool = False,
    progress: bool | None = None,
    on_accept: Callable[[TimeStep, Model], None] | None = None,
) -> DynamicResult:
    """Follow a scene in time from time 0; collective.

    Numbers that the scene declares (loads, gravity, fields) act in full; functions are functions of
    time. The first Ctrl-C stops after the step under way is accepted, on all ranks; a second one at
    once.

    Args:
        scene: a scene at rest, or a model in the state that a static path or an earlier motion left
            it in (numbers then keep the load factor reached; it is at rest again unless it moved).
        stops: increasing times to be hit exactly.
        time: step sizes.
        scheme: "bdf2" (second order), "implicit_euler", or a scheme of one's own.
        output: folder for history, fields and checkpoint (what an earlier run left there is
            replaced unless this run resumes it); None keeps the history in memory only.
        record: what history and fields hold.
        newton: method and tolerances of one step; default: as in statics, but 20 full steps, and a
            factorisation that will do the rest of a step in three more iterations is kept.
        resume: continue the run in `output` from its last accepted step, on any number of ranks;
            on one rank, with the settings it had, to the same bits.
        progress: show a progress bar; None: where the error stream is a terminal.
        on_accept: called on all ranks with each accepted step and the model in its state, after
            history, fields and checkpoint are written.

    Raises:
        SolveError: a step failed at the smallest size; all accepted steps are on disk and the model
            is in the last accepted state.
        KeyboardInterrupt: after Ctrl-C; all accepted steps are on disk.
        InputError: scene, record or stops are incomplete or wrong, prescribed motion jumps at the
            start, the sheet starts inside an obstacle, or there is no run of this scene to resume;
            model and output are as before.
        OSError: a file could not be written.

    Warns:
        MeshWarning: the mesh cannot represent the form.
        AccuracyWarning: the smallest step was too long for the tolerance.
        ContactWarning: a gap has nearly closed.
    """
    how = Recording(output, resume, progress, on_accept)
    how.require_folder()
    model = scene if isinstance(scene, Model) else build(scene)
    record = record or Record()
    settings = newton or NewtonSettings(iterations=ITERATIONS, reuse=REUSE)
    steps: list[TimeStep] = []
    with unchanged_where_refused(model):
        run = _start(model, time, find_scheme(scheme), settings, record)
        run.path.check_stops(stops)
        if not resume:
            require_stops(stops, model.problem.time)
        log = Log(model, record, run)
    with closing(run.path.newton), recorded(log, how, stops, "time") as record_step:

        def accept(step: TimeStep, _: PETSc.Vec) -> None:
            run.accept(step)
            steps.append(step)
            record_step(step)

        run.path.run(model.x, stops, accept)
    return DynamicResult(model, steps, log.history)


def _start(
    model: Model, time: TimeSettings, scheme: Scheme, newton: NewtonSettings, record: Record
) -> "_Run":
    """Everything that moves a model, checked at its start; collective."""
    begin = _set_clock(model)
    if model.motion is None:
        model.motion = make_motion(model.scene, model.configuration, model.functions)
    problem, motion = model.problem, model.motion
    for contact in model.contacts:
        contact.check(model.state)
    _check_supports(model, begin)
    terms: list[Term] = [*problem.terms, motion.inertia, *model.in_time]
    terms += damping_terms(model, scheme.memory)
    whole = Problem(model.configuration, terms, problem.constraints)
    whole.set_time(begin)
    at = Instant(begin, model.x.copy(), motion.v.copy())
    book = EnergyBook(problem, whole, motion, at) if record.energies else None
    path = TimePath(
        whole,
        NewtonSolver(whole, newton),
        motion.inertia,
        scheme,
        time,
        [at],
        Admissible(model),
        book,
        rates=model.balance.rates if model.balance else None,
    )
    return _Run(path, model, book)


def _set_clock(model: Model) -> float:
    """Time at which the motion starts; the load factor is held from there on.

    A model that moved before goes on in time. Another one starts at time 0: with the full loads,
    or with those of the load factor that a static path has reached.
    """
    if model.motion is not None:
        return model.problem.time
    model.load_factor.held = model.problem.time or 1.0
    model.problem.set_time(0.0)
    return 0.0


def _check_supports(model: Model, begin: float) -> None:
    """Refuse prescribed motion that jumps at the start, else take its rate; collective.

    Raises:
        SceneError: on all ranks.
    """
    constraints, motion = model.problem.constraints, model.motion
    assert motion is not None
    constraints.check(begin)
    values, dofs = constraints.values(begin), constraints.dofs
    allowed = JUMP * _sizes(model)[dofs]
    with together(model.sheet.comm):
        jumps = np.abs(values - model.x.array_r[dofs])
        if (jumps > allowed).any():
            jump = jumps[(jumps / allowed).argmax()]
            raise SceneError(
                f"prescribed motion jumps by {jump:.3g} at time {begin:g}: give a function of time "
                "that starts where the sheet is, or follow a static path first"
            )
    motion.v.array_w[dofs] = (constraints.values(begin + MOMENT) - values) / MOMENT


def _sizes(model: Model) -> np.ndarray:
    """What each owned unknown is measured by: the sheet's diagonal, or a radian; collective."""
    sizes, dofs = np.ones(model.x.local_size), model.functions.dofs
    owned = model.configuration.owned_dofs(dofs[model.configuration.owns(dofs)])
    sizes[owned] = sheet_size(model.problem)
    return sizes


@dataclass
class _Run:
    """A motion as it is recorded."""

    solver: ClassVar[str] = "solve_dynamic"
    path: TimePath
    model: Model
    book: EnergyBook | None
    step: TimeStep = field(init=False)

    def __post_init__(self) -> None:
        self.step = TimeStep(0, self.path.past[0].time)

    @property
    def rows(self) -> int:
        """The start, and one a step."""
        return self.path.number + 1

    @property
    def terms(self) -> Sequence[Term]:
        """All terms of the time steps."""
        return self.path.problem.terms

    def accept(self, step: TimeStep) -> None:
        """Put the model into the state of an accepted step."""
        self.step = step
        model = self.model
        model.problem.time, model.balance = step.time, self.path.problem
        if model.motion:
            self.path.past[0].v.copy(model.motion.v)

    def columns(self) -> Row:
        """Columns of the last step, and the energy book."""
        row = time_row(self.step)
        return {**row, **self.book.account.columns()} if self.book else row

    def vectors(self) -> dict[str, PETSc.Vec]:
        """Rates of the last state, unknowns and rates of those before it.

        Where there are none yet, the oldest stands in.
        """
        past = self.path.past
        vectors = {"rate": past[0].v}
        if self.book:
            vectors["reaction"] = self.book.reactions
        for age in range(1, self.path.scheme.memory):
            state = past[min(age, len(past) - 1)]
            vectors |= {f"before{age}": state.q, f"before{age}.rate": state.v}
        return vectors

    def memory(self) -> Memory:
        """Times of the last states, step sizes, solver's memory, energy book."""
        path = self.path
        return {
            "scheme": path.scheme.name,
            "times": [state.time for state in path.past],
            "steps": path.number,
            "size": path.size,
            "shift": path.newton.shift,
            "book": self.book.memory() if self.book else None,
            "last": asdict(self.step),
        }

    def recall(self, memory: Memory, vectors: dict[str, PETSc.Vec]) -> None:
        """Take up where a checkpoint left the motion.

        Raises:
            InputError: it was followed by another scheme.
        """
        path = self.path
        if (other := memory.get("scheme")) != path.scheme.name:
            raise InputError(f"the run to resume has scheme {other!r}, not {path.scheme.name!r}")
        ages = range(1, path.scheme.memory)
        named = [("", "rate")] + [(f"before{age}", f"before{age}.rate") for age in ages]
        path.past = [
            Instant(time, vectors[q] if q else self.model.x.copy(), vectors[v])
            for time, (q, v) in zip(memory["times"], named, strict=False)
        ]
        settings, size = path.settings, memory["size"]
        path.number = memory["steps"]
        path.size = size and min(max(size, settings.least), settings.most)
        path.newton.shift = memory["shift"]
        path.problem.set_time(memory["time"])
        if self.book and memory["book"]:
            self.book.recall(memory["book"])
            vectors["reaction"].copy(self.book.reactions)
        self.step = TimeStep(**memory["last"])
        if self.model.motion:
            path.past[0].v.copy(self.model.motion.v)
