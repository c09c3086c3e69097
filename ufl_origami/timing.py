"""Where the seconds of a solve go: assembly, factorisation with its solves, and the rest.

Seconds are processor seconds of the slowest rank, which are the elapsed ones on an idle machine
(one thread a rank) and do not count what other programs take on a shared one. While a block is
timed, the functions below report when they start and end; what they compute is unchanged.

| section | what counts |
|---|---|
| assembly | forces, energies, stress of the next tangent, tangent |
| factorisation | factorisations, those of the inertia guard included, and triangular solves |
| rest | all else: constraints, norms, checks of accepted states, records |
"""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import wraps

from mpi4py import MPI
from petsc4py import PETSc

from ufl_origami.assembly import Tangent
from ufl_origami.problem import Problem
from ufl_origami.solvers.linear import Factorisation

Clock = Callable[[], float]

SECTIONS: dict[str, tuple[tuple[type, str], ...]] = {
    "assembly": (
        (Problem, "forces"),
        (Problem, "energies"),
        (Problem, "linearise"),
        (Problem, "stiffness"),
        (Tangent, "insert"),
    ),
    "factorisation": ((Factorisation, "factor"), (Factorisation, "solve")),
}
"""Functions of each section; of nested ones the outermost counts."""


@dataclass(frozen=True)
class Times:
    """Seconds of one timed block on the slowest rank.

    Attributes:
        total: processor seconds of the block.
        assembly: those of assembly.
        factorisation: those of factorisations and triangular solves.
        elapsed: seconds that passed, on a shared machine more than `total`.
    """

    total: float
    assembly: float
    factorisation: float
    elapsed: float

    @property
    def rest(self) -> float:
        """Processor seconds of neither assembly nor factorisation."""
        return self.total - self.assembly - self.factorisation


@dataclass
class Stopwatch:
    """Clock of the sections of one block.

    Attributes:
        comm: communicator of the ranks that run the block.
        clock: processor seconds of this rank.
        spent: section -> seconds so far.
    """

    comm: MPI.Comm
    clock: Clock = time.process_time
    spent: dict[str, float] = field(default_factory=lambda: dict.fromkeys(SECTIONS, 0.0))
    _depth: int = 0
    _since: float = 0.0
    _block: tuple[float, float] = (0.0, 0.0)

    def enter(self) -> None:
        """Start a section, unless one is under way."""
        if self._depth == 0:
            self._since = self.clock()
        self._depth += 1

    def leave(self, section: str) -> None:
        """End what `enter` started; the outermost section is booked."""
        self._depth -= 1
        if self._depth == 0:
            self.spent[section] += self.clock() - self._since

    def begin(self) -> None:
        """Start the block."""
        self._block = self.clock(), time.perf_counter()

    def end(self) -> None:
        """End the block."""
        processor, wall = self._block
        self._block = self.clock() - processor, time.perf_counter() - wall

    def times(self) -> Times:
        """Seconds of the slowest rank, once the block has ended; collective."""
        total, elapsed = self._block
        mine = Times(total, self.spent["assembly"], self.spent["factorisation"], elapsed)
        return max(self.comm.allgather(mine), key=lambda found: found.total)

    def wrapped(self, function: Callable, section: str) -> Callable:
        """The function, reporting to this clock."""

        @wraps(function)
        def timed(*args, **kwargs):
            self.enter()
            try:
                return function(*args, **kwargs)
            finally:
                self.leave(section)

        return timed

    def watch_solves(self, ksp: PETSc.KSP) -> None:
        """Book the triangular solves that SNES asks of its own linear solver."""
        ksp.setPreSolve(lambda *_: self.enter())
        ksp.setPostSolve(lambda *_: self.leave("factorisation"))


@contextmanager
def timed(comm: MPI.Comm, clock: Clock = time.process_time) -> Iterator[Stopwatch]:
    """Time a block of solves by section; not to be nested.

    Args:
        comm: communicator of the ranks that run the block.
        clock: seconds of this rank.
    """
    watch = Stopwatch(comm, clock)
    with ExitStack() as stack:
        for section, functions in SECTIONS.items():
            for owner, name in functions:
                stack.enter_context(_replaced(owner, name, watch, section))
        stack.enter_context(_solves_watched(watch))
        watch.begin()
        try:
            yield watch
        finally:
            watch.end()


@contextmanager
def _replaced(owner: type, name: str, watch: Stopwatch, section: str) -> Iterator[None]:
    original = vars(owner)[name]
    setattr(owner, name, watch.wrapped(original, section))
    try:
        yield
    finally:
        setattr(owner, name, original)


@contextmanager
def _solves_watched(watch: Stopwatch) -> Iterator[None]:
    """Hook the linear solver of every factorisation, and unhook it at the end."""
    seen: list[PETSc.KSP] = []
    factor = Factorisation.factor

    @wraps(factor)
    def hooked(self: Factorisation) -> int | None:
        if all(ksp != self.ksp for ksp in seen):
            watch.watch_solves(self.ksp)
            seen.append(self.ksp)
        return factor(self)

    Factorisation.factor = hooked  # type: ignore[method-assign]
    try:
        yield
    finally:
        Factorisation.factor = factor  # type: ignore[method-assign]
        for ksp in seen:
            ksp.setPreSolve(None)
            ksp.setPostSolve(None)
