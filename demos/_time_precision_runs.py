"""Runs of the study in time: fixed steps, adaptive steps, references."""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
from _time_precision_problems import Motion, TimeProblem
from _work_precision_problems import NO_RECORD

from ufl_origami.dynamics import DynamicResult, solve_dynamic
from ufl_origami.errors import MeshWarning, SolveError
from ufl_origami.history import Record
from ufl_origami.solvers.dynamics import TimeSettings
from ufl_origami.timing import Times, timed
from ufl_origami.work_precision import TimePoint

SCHEMES = {"implicit_euler": "implicit Euler", "bdf2": "BDF2"}
CONTROLS = ("fixed", "adaptive")
ENERGY = 10.0  # energy tolerance of adaptive steps over that of the local error
FIRST = 64  # adaptive steps begin with the duration over this
BOOK = Record(reactions=(), creases=(), points=(), fields="none")
TIME_REPEATS = 3  # runs of a point, at most
TIME_ENOUGH = 1.5  # seconds after which a point is not run again
WARM = 2  # steps of the run that compiles all kernels


@dataclass(frozen=True)
class Sweep:
    """What is tried on each motion.

    Attributes:
        counts: scheme -> numbers of fixed steps.
        tolerances: scheme -> local errors of adaptive steps.
        reference: number of fixed steps of BDF2 that all are compared with.
        repeats: runs of a point, at most.
    """

    counts: dict[str, tuple[int, ...]]
    tolerances: dict[str, tuple[float, ...]]
    reference: int
    repeats: int


LOCAL_ERRORS = (1e-2, 1e-3, 1e-4, 1e-5)
QUICKLY = Sweep(
    {"implicit_euler": (32, 128, 512, 2048), "bdf2": (16, 32, 64, 128, 256)},
    {"implicit_euler": (*LOCAL_ERRORS, 2.5e-6), "bdf2": (*LOCAL_ERRORS, 1e-6)},
    1024,
    TIME_REPEATS,
)
SLOWLY = Sweep(
    {"implicit_euler": (64, 256, 1024, 4096), "bdf2": (16, 32, 64, 128, 256, 512)},
    {"implicit_euler": (*LOCAL_ERRORS, 1e-6), "bdf2": (*LOCAL_ERRORS, 1e-6)},
    2048,
    TIME_REPEATS,
)
FULL = {"vibration": QUICKLY, "snap": SLOWLY, "impact": QUICKLY}  # as their errors fall
COARSE = {"implicit_euler": (1e-2,), "bdf2": (1e-3,)}
TASTE = {
    "vibration": Sweep({"implicit_euler": (64, 128), "bdf2": (16, 32, 64)}, COARSE, 128, 1),
    "snap": Sweep({"implicit_euler": (64,), "bdf2": (64, 128)}, COARSE, 256, 1),
    "impact": Sweep({"implicit_euler": (64,), "bdf2": (32, 64)}, COARSE, 128, 1),
}


@dataclass(frozen=True)
class Followed:
    """A motion followed once: result and state at its end, None where it failed, and seconds."""

    result: DynamicResult | None
    state: np.ndarray | None
    times: Times
    dofs: int
    failure: str = ""


@dataclass(frozen=True)
class Reference:
    """What a motion's points are compared with.

    Attributes:
        problem: name of the problem.
        steps: its fixed steps of BDF2.
        seconds: processor seconds.
        error: its own error, from the finest point of BDF2 and its order.
    """

    problem: str
    steps: int
    seconds: float
    error: float


def study(
    problem: TimeProblem,
    sweep: Sweep,
    comm: MPI.Comm,
    observe: Callable[[TimePoint], None],
) -> tuple[list[TimePoint], Reference]:
    """All points of a problem; collective.

    Args:
        problem: the problem.
        sweep: what is tried.
        comm: communicator.
        observe: called with each point.
    """
    motion = problem.make(comm)
    warm_up(motion, comm)
    fine = follow(motion, "bdf2", steps_of(motion, sweep.reference), NO_RECORD, comm)
    if fine.state is None:
        raise SolveError(f"{problem.name}: no reference: {fine.failure}")
    points = []
    for scheme, control, size in tries(sweep):
        points.append(measure(problem, motion, (scheme, control, size), fine.state, sweep, comm))
        observe(points[-1])
    own = own_error(points, sweep)
    return points, Reference(problem.name, sweep.reference, fine.times.total, own)


def tries(sweep: Sweep) -> Iterator[tuple[str, str, float]]:
    """Scheme, control of the steps and size of each point, from coarse to fine on each curve."""
    for scheme in SCHEMES:
        for count in sweep.counts[scheme]:
            yield scheme, "fixed", 1.0 / count
        for tolerance in sweep.tolerances[scheme]:
            yield scheme, "adaptive", tolerance


def own_error(points: list[TimePoint], sweep: Sweep) -> float:
    """Error of the reference, if that of BDF2 falls by the square of the steps."""
    count = max(sweep.counts["bdf2"])
    (last,) = (p for p in points if (p.scheme, p.control, p.size) == ("bdf2", "fixed", 1.0 / count))
    return last.error() / ((sweep.reference / count) ** 2 - 1.0)


def steps_of(motion: Motion, count: int) -> TimeSettings:
    """So many fixed steps."""
    return TimeSettings(motion.end / count, fixed=True)


def adapted(motion: Motion, tolerance: float) -> TimeSettings:
    """Adaptive steps."""
    return TimeSettings(
        motion.end / FIRST, tolerance=tolerance, energy_tolerance=ENERGY * tolerance
    )


def warm_up(motion: Motion, comm: MPI.Comm) -> None:
    """Two steps with everything that the points need, so that it is compiled; collective."""
    short = Motion(motion.start, WARM * motion.end / FIRST, motion.state)
    follow(short, "bdf2", steps_of(short, WARM), BOOK, comm)


def follow(
    motion: Motion, scheme: str, settings: TimeSettings, record: Record, comm: MPI.Comm
) -> Followed:
    """Follow a motion once, timed; collective. A motion that fails is a result as well."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MeshWarning)
        model = motion.start()
        result, failure = None, ""
        with timed(comm) as watch:
            try:
                result = solve_dynamic(
                    model, [motion.end], settings, scheme=scheme, record=record, progress=False
                )
            except SolveError as error:
                failure = str(error)
    state = motion.state(model) if result else None
    return Followed(result, state, watch.times(), model.num_unknowns, failure)


def measure(
    problem: TimeProblem,
    motion: Motion,
    what: tuple[str, str, float],
    reference: np.ndarray,
    sweep: Sweep,
    comm: MPI.Comm,
) -> TimePoint:
    """One point: the fastest of a few runs; collective.

    Adaptive steps need the energy book; fixed ones do without.
    """
    scheme, control, size = what
    fixed = control == "fixed"
    settings = steps_of(motion, round(1.0 / size)) if fixed else adapted(motion, size)
    record = NO_RECORD if fixed else BOOK
    best, spent = follow(motion, scheme, settings, record, comm), 0.0
    for _ in range(sweep.repeats - 1):
        spent += best.times.total
        if spent > TIME_ENOUGH or best.failure:
            break
        again = follow(motion, scheme, settings, record, comm)
        best = min(best, again, key=lambda followed: followed.times.total)
    return point(problem, motion, what, reference, best)


def point(
    problem: TimeProblem,
    motion: Motion,
    what: tuple[str, str, float],
    reference: np.ndarray,
    followed: Followed,
) -> TimePoint:
    """What is kept of a motion."""
    scheme, control, size = what
    steps, times = followed.result.steps if followed.result else [], followed.times
    off = None if followed.state is None else float(np.linalg.norm(followed.state - reference))
    return TimePoint(
        problem=problem.name,
        scheme=scheme,
        control=control,
        size=size,
        duration=motion.end,
        dofs=followed.dofs,
        steps=len(steps),
        newton_iterations=sum(step.iterations for step in steps),
        factorisations=sum(step.factorisations for step in steps),
        cuts=sum(step.cuts for step in steps),
        smallest_step=min((step.size for step in steps), default=0.0),
        largest_step=max((step.size for step in steps), default=0.0),
        seconds=times.total,
        assembly_seconds=times.assembly,
        factorisation_seconds=times.factorisation,
        rest_seconds=times.rest,
        elapsed=times.elapsed,
        deviation=off,
        failure=followed.failure,
    )
