"""Seconds of one implicit time step against unknowns, and the share that each term costs.

A square plate that spins and slides on a floor, all its vertices in contact, is magnetised in a
field that turns, each with as much of this as the row names. Seconds are processor seconds of the
slowest rank (the elapsed ones on an idle machine), those of the fastest run of a few steps; Newton
iterations are their mean. Building the scene and its first step, which analyses the matrix, are
left out. "surroundings" is what gravity, contact, friction and magnets cost in all: forces,
tangents, energies, distances and step bounds; "book" is the energy book, the energies of these
terms included; "full / kept" are the seconds of a step with a factorisation at each iteration over
those of the default, which keeps one that will do the rest. Implicit friction has a tangent that is
not symmetric, which MUMPS factors by LU; lagged friction and all else by LDLt.

Target: surroundings under 15 % of a step at 1e4 unknowns.

    ./run python3 benchmarks/time_step.py [--quick] [--output FILE]
    ./run mpirun -n 2 python3 benchmarks/time_step.py
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps

from mpi4py import MPI

import numpy as np
from _record import Table, parser
from scipy.optimize import brentq

from ufl_origami.barrier import Barrier
from ufl_origami.discretise import build
from ufl_origami.dynamics import solve_dynamic
from ufl_origami.energy_book import EnergyBook
from ufl_origami.friction_laws import Coulomb
from ufl_origami.history import Record
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.model import Model
from ufl_origami.obstacles import Plane
from ufl_origami.scene import Scene
from ufl_origami.scene_surroundings import spin
from ufl_origami.solvers.dynamics import TimeSettings, TimeStep
from ufl_origami.solvers.newton import NewtonSettings
from ufl_origami.terms.base import Term
from ufl_origami.timing import Times, timed

UNKNOWNS = (1_000, 10_000, 100_000)
QUICK = (1_000,)
ROWS: dict[str, tuple[str, ...]] = {
    "free": (),
    "gravity": ("gravity",),
    "contact": ("gravity", "contact"),
    "lagged friction": ("gravity", "contact", "lagged"),
    "implicit friction": ("gravity", "contact", "implicit"),
    "magnets": ("magnets",),
    "all, lagged": ("gravity", "contact", "lagged", "magnets"),
    "all, implicit": ("gravity", "contact", "implicit", "magnets"),
}
KINDS = ("gravity", "contact", "friction", "magnetic")
METHODS = (
    "set_time", "begin_step", "energies", "slope", "drive", "longest_step", "objection", "accept",
    "add_residual", "add_tangent", "tangent", "near",
)  # fmt: skip
COLUMNS = (
    ("scene", ""),
    ("dofs", "d"),
    ("step s", ".4f"),
    ("newton", ".1f"),
    ("assembly %", ".1f"),
    ("factor %", ".1f"),
    ("rest %", ".1f"),
    ("surroundings %", ".1f"),
    *((f"{kind} %", ".1f") for kind in KINDS),
    ("factor ms", ".2f"),
    ("book %", ".1f"),
    ("full / kept", ".2f"),
)
FULL_NEWTON = NewtonSettings(iterations=20)
STEPS, STEP = 4, 5e-4
G, RHO, H, E = 9.81, 1000.0, 0.01, 1e7


def scene(unknowns: int, names: tuple[str, ...]) -> Scene:
    """A plate of about so many unknowns with the surroundings named."""
    n = max(2, round((unknowns / 6.0) ** 0.5))
    sheet = rectangle(1.0, 1.0, n=(n, n))
    result = Scene(sheet, Material(E=E, nu=0.3, h=H, rho=RHO))
    result.launch((1.0, 0.0, -0.1))
    result.launch(spin((0.3, 0.0, 3.0), (0.5, 0.5, 0.0)))
    if "gravity" in names:
        result.gravity((0.0, 0.0, -G))
    if "contact" in names:
        barrier = Barrier(4 * RHO * G, H)
        gap = brentq(lambda d: barrier.pressure(d) - RHO * H * G, 1e-3 * H, 0.999 * H)
        result.obstacle("floor", Plane((0.0, 0.0, -gap)), barrier)
    if {"lagged", "implicit"} & set(names):
        result.friction("floor", Coulomb(0.3, eps=0.01), lagged="lagged" in names)
    if "magnets" in names:
        result.magnetise("sheet", (0.05, 0.0, 0.0))
        result.magnetic_field(lambda t: 0.01 * np.array([np.cos(9 * t), 0.0, np.sin(9 * t)]))
    return result


class TermClock:
    """Processor seconds of this rank in the methods of terms, by their kind."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = dict.fromkeys((*KINDS, "book"), 0.0)
        self._depth: dict[str, int] = dict.fromkeys(self.spent, 0)

    def watch(self, term: Term) -> None:
        """Book what a term does from now on."""
        if term.kinds and term.kinds[0] in KINDS:
            for name in METHODS:
                if hasattr(term, name):
                    setattr(term, name, self.wrapped(getattr(term, name), term.kinds[0]))

    def leave(self, term: Term) -> None:
        """Give a term its own methods back."""
        for name in METHODS:
            vars(term).pop(name, None)

    def wrapped(self, method, kind: str):
        """The method, booked under a kind; of nested ones the outermost counts."""

        @wraps(method)
        def booked(*args, **kwargs):
            self._depth[kind] += 1
            begin = time.process_time()
            try:
                return method(*args, **kwargs)
            finally:
                self._depth[kind] -= 1
                if self._depth[kind] == 0:
                    self.spent[kind] += time.process_time() - begin

        return booked


@contextmanager
def watched(model: Model) -> Iterator[TermClock]:
    """Clock of all terms of a model's surroundings."""
    clock, terms = TermClock(), [*model.problem.terms, *model.in_time]
    for term in terms:
        clock.watch(term)
    draft = EnergyBook.draft
    EnergyBook.draft = clock.wrapped(draft, "book")
    try:
        yield clock
    finally:
        EnergyBook.draft = draft
        for term in terms:
            clock.leave(term)


def follow(
    model: Model, count: int, begin: Callable[[], None], newton: NewtonSettings | None
) -> list[TimeStep]:
    """Go on for one step, begin to count, and go on for some more; the steps counted."""
    stop = model.problem.time + (count + 1) * STEP
    record = Record(reactions=(), creases=(), points=(), fields="none")
    accepted: list[TimeStep] = []

    def on_accept(step: TimeStep, _: Model) -> None:
        accepted.append(step)
        if len(accepted) == 1:
            begin()

    time = TimeSettings(step=STEP, fixed=True)
    solve_dynamic(model, [stop], time, record=record, newton=newton, on_accept=on_accept)
    return accepted[1:]


@dataclass(frozen=True)
class Cost:
    """What some steps took.

    Attributes:
        times: seconds by section.
        shares: seconds by kind of term.
        steps: the steps.
    """

    times: Times
    shares: dict[str, float]
    steps: list[TimeStep]


def cost(model: Model, newton: NewtonSettings | None = None) -> Cost:
    """Cost of a few steps; collective."""
    comm = MPI.COMM_WORLD
    with watched(model) as clock, timed(comm) as watch:

        def begin() -> None:
            clock.spent.update(dict.fromkeys(clock.spent, 0.0))
            watch.spent.update(dict.fromkeys(watch.spent, 0.0))
            watch.begin()

        steps = follow(model, STEPS, begin, newton)
    shares = {kind: comm.allreduce(spent, op=MPI.MAX) for kind, spent in clock.spent.items()}
    return Cost(watch.times(), shares, steps)


def measure(name: str, unknowns: int, repeats: int) -> dict[str, object]:
    """One row of the table."""
    model = build(scene(unknowns, ROWS[name]))
    runs = [cost(model) for _ in range(repeats + 1)][1:]  # the first one compiles
    best = min(runs, key=lambda run: run.times.total)
    full = min(cost(model, FULL_NEWTON).times.total for _ in range(repeats))
    total, times = best.times.total, best.times
    return {
        "scene": name,
        "dofs": model.num_unknowns,
        "step s": total / STEPS,
        "newton": np.mean([step.iterations for step in best.steps]),
        "assembly %": 100 * times.assembly / total,
        "factor %": 100 * times.factorisation / total,
        "rest %": 100 * times.rest / total,
        "surroundings %": 100 * sum(best.shares[kind] for kind in KINDS) / total,
        **{f"{kind} %": 100 * best.shares[kind] / total for kind in KINDS},
        "factor ms": 1e3 * times.factorisation / sum(step.factorisations for step in best.steps),
        "book %": 100 * best.shares["book"] / total,
        "full / kept": full / total,
    }


def main() -> None:
    """Run all sizes and scenes."""
    arguments = parser(__doc__.splitlines()[0]).parse_args()
    table = Table(MPI.COMM_WORLD, "time_step", COLUMNS)
    for unknowns in QUICK if arguments.quick else UNKNOWNS:
        for name in ROWS:
            table.add(**measure(name, unknowns, arguments.repeats))
    table.write(arguments.output)


if __name__ == "__main__":
    main()
