"""Static path: load stepping with automatic step size.

Each step starts from the tangent predictor (prescribed motion enters through the tangent's
columns, never by moving boundary vertices alone) and is corrected by Newton. The step grows while
Newton is easy, is cut when it fails or ends at an inadmissible state, and the path gives up with a
clear error at the smallest step. Each accepted state knows the inertia of its own tangent. From an
unstable one the guard first looks for a stable neighbour; where that fails, the unstable branch is
followed, and every state on it is reported.
"""

import logging
import time as clock
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from petsc4py import PETSc

import numpy as np

from ufl_origami.errors import BranchWarning, SolveError, StabilityWarning
from ufl_origami.problem import Problem
from ufl_origami.solvers.clearance import clear_start
from ufl_origami.solvers.newton import NewtonReport, NewtonSolver
from ufl_origami.solvers.stops import require_stops

log = logging.getLogger(__name__)

NEGLIGIBLE = 1e-3
"""Distance over the sheet's size below which no branch is lost."""


DOUBTFUL = 0.1
"""Distance from the predicted state over the step, from which on the way back is looked at."""

JUMPED = 5.0
"""Length of a step over what the tangent at its end says, from which on it may be a jump."""

SAME = 1e-3
"""Distance over a step's length at which the way back has come back."""


@dataclass(frozen=True)
class StepSettings:
    """Sizes of the load steps, in units of the load factor or time.

    Attributes:
        first: first step.
        largest: largest step.
        smallest: a step below this is given up.
        turn: a predicted change (radians) of a fold angle or loaded edge from which on the step is
            cut before it is tried: beyond half a turn its branch would be a guess.
        growth: factor after an easy step.
        retreats: how often a step that does not converge in one run of full Newton steps is cut
            before Newton's watchdog may search further off: what it finds far away may lie on
            another branch.
        stray: distance of the solution from the predicted state, over the predicted step, from
            which on a step is cut as well, twice `retreats` times at most; then a warning tells.
        easy: Newton iterations up to which a step is easy.
    """

    first: float = 0.125
    largest: float = 1.0
    smallest: float = 1e-5
    turn: float = np.pi
    growth: float = 1.5
    easy: int = 9
    retreats: int = 3
    stray: float = 1.0


@dataclass(frozen=True)
class Step:
    """One accepted step.

    Attributes:
        number: from 1.
        time: load factor or time.
        size: step size.
        iterations: linear solves of Newton, the predictor included.
        factorisations: factorisations of the step.
        negative_pivots: inertia of the tangent at the state, None where unknown.
        seconds: wall-clock time of the step.
        cuts: failed tries before it.
        neutral: whether an eigenvalue is zero but for round-off; looked at on paths by arc length.
    """

    number: int
    time: float
    size: float
    iterations: int
    factorisations: int
    negative_pivots: int | None
    seconds: float
    cuts: int
    neutral: bool = False

    @property
    def stability(self) -> str:
        """One of "stable", "neutral", "unstable", "unknown".

        The sign of a pivot that is zero but for round-off is that of chance: one of them does not
        make a neutral state unstable.
        """
        if self.negative_pivots is None:
            return "unknown"
        if self.neutral and self.negative_pivots <= 1:
            return "neutral"
        return "unstable" if self.negative_pivots else "stable"


OnAccept = Callable[[Step, PETSc.Vec], None]
Check = Callable[[PETSc.Vec], str]


@dataclass
class StaticPath:
    """Follows the equilibrium of a problem over the load factor.

    Attributes:
        problem: terms and constraints.
        newton: solver of one equilibrium.
        settings: step sizes.
        check: returns why a converged state is inadmissible, or an empty string.
        steps: accepted steps so far.
        size: size of the next step; None: the first one of the settings.
    """

    problem: Problem
    newton: NewtonSolver
    settings: StepSettings = field(default_factory=StepSettings)
    check: Check | None = None
    steps: list[Step] = field(default_factory=list)
    size: float | None = None
    _unstable: int = 0
    _effort: int = 0
    _settled: bool = False
    _warnings: list[Warning] = field(default_factory=list)

    def run(
        self, x: PETSc.Vec, start: float, stops: Sequence[float], on_accept: OnAccept | None = None
    ) -> list[Step]:
        """Follow the path from an equilibrium at `start` through all stops.

        Whatever a step raises, x and the problem's time stay those of the last accepted state.

        Args:
            x: unknowns at `start`; those of the last accepted state on return.
            start: load factor or time of x.
            stops: increasing load factors to be hit exactly.
            on_accept: called with each accepted step and its unknowns.

        Raises:
            InputError: the stops are no increasing numbers.
            SolveError: a step below the smallest size failed.

        Warns:
            BranchWarning, StabilityWarning: about an accepted state, once `on_accept` has seen it.
        """
        require_stops(stops)
        time, size = start, self.size or self.settings.first
        self.newton.allowed = 0
        self._unstable = self._factor_at(x, time) or 0
        self._settled = self._in_equilibrium(x)
        for stop in stops:
            while time < stop - 1e-12 * max(1.0, abs(stop)):
                target = stop if time + 1.001 * size >= stop else time + size
                try:
                    step = self._advance(x, time, target)
                except BaseException:
                    self.problem.set_time(time)
                    raise
                time = step.time
                if target != stop or step.cuts:
                    size = step.size
                if self._effort <= self.settings.easy:
                    size = min(self.settings.growth * size, self.settings.largest)
                self.size = size
                if on_accept:
                    on_accept(step, x)
                for warning in self._warnings:
                    warnings.warn(warning, stacklevel=2)
                self.problem.warn()
        return self.steps

    def _factor_at(self, x: PETSc.Vec, time: float) -> int | None:
        """Factor the exact tangent at an accepted state; its inertia."""
        self.problem.set_time(time)
        self.problem.linearise(None, x)
        matrix = self.problem.stiffness(x)
        self.newton.set_floor(x)
        self.problem.constrain(matrix, None, None)
        return self.newton.factor(self.newton.linear.ksp)

    def _advance(self, x: PETSc.Vec, time: float, target: float) -> Step:
        """One accepted step towards target, cut as often as needed."""
        begin, cuts, wanted, last = clock.perf_counter(), 0, target, False
        iterations = factorisations = 0
        while True:
            may_cut = 0.5 * (target - time) >= self.settings.smallest
            hurried = last or not may_cut or bool(self._unstable)
            search = cuts >= self.settings.retreats or hurried
            trial, report = self._try(x, time, target, search=search)
            far = report.searched or report.strayed > self.settings.stray
            iterations += report.iterations
            factorisations += report.factorisations
            why = self._refusal(trial, report, time)
            retreat = not hurried and cuts < 2 * self.settings.retreats
            if not why and retreat and far and not report.searched:
                why = "the state found is further from the predicted one than the step is long"
            if not why:
                break
            if self._unstable and not self.newton.allowed:
                log.info("step to %g failed (%s), follow the unstable branch", target, why)
                self.newton.allowed = self._unstable
                self._factor_at(x, time)
                continue
            size = 0.5 * (target - time)
            if size < self.settings.smallest and target != wanted:
                log.info("step to %g failed (%s), search from the whole step", target, why)
                target, last = wanted, True
                self._factor_at(x, time)
                continue
            log.info("step to %g failed (%s), cut to %g", target, why, size)
            if last or size < self.settings.smallest:
                self.problem.set_time(time)  # for the suspicions
                smallest = f"step below the smallest size {self.settings.smallest:g}"
                reasons = "; ".join([why, *self.problem.suspicions(x)])
                raise SolveError(f"{smallest}: {reasons}", time)
            target, cuts = time + size, cuts + 1
            self._factor_at(x, time)
        self._effort = report.iterations
        self.newton.report = NewtonReport()
        self.newton.allowed = 0
        doubtful = self._settled and report.strayed > DOUBTFUL
        negative, back = self._adopt(x, trial, time, target, doubtful=doubtful)
        self._settled = True
        step = Step(
            number=len(self.steps) + 1,
            time=target,
            size=target - time,
            iterations=iterations + self.newton.report.iterations,
            factorisations=factorisations + self.newton.report.factorisations,
            negative_pivots=negative,
            seconds=clock.perf_counter() - begin,
            cuts=cuts,
        )  # fmt: skip
        self.steps.append(step)
        self._unstable = negative or 0
        self._warnings = remarks(step, far=far or not back)
        PETSc.garbage_cleanup(x.comm)  # on several ranks Python's dropped vectors stay until here
        return step

    def _in_equilibrium(self, x: PETSc.Vec) -> bool:
        """Whether the start is an equilibrium: what a scene holds from the first may have moved."""
        residual = x.duplicate()
        self.problem.residual(x, residual)
        return residual.norm() <= self.newton.tolerance()

    def _adopt(
        self, x: PETSc.Vec, trial: PETSc.Vec, time: float, target: float, *, doubtful: bool
    ) -> tuple[int | None, bool]:
        """Make a trial the accepted state; its inertia, and whether the path leads back from it.

        Whatever is raised on the way leaves the last state as it was.
        """
        before, memory = x.copy(), self.problem.memory()
        try:
            trial.copy(x)
            self.problem.accept(x)
            negative = self._factor_at(x, target)
            return negative, not doubtful or self._leads_back(x, before, time)
        except BaseException:
            before.copy(x)
            self.problem.recall(memory)
            raise

    def _leads_back(self, new: PETSc.Vec, x: PETSc.Vec, time: float) -> bool:
        """Whether the path from a new state leads back to the last one, or has jumped.

        Near a limit point any state beyond is near the predicted one. Where the step is much longer
        than the new state's own tangent says, the way back is solved for.
        """
        target = self.problem.time
        self.newton.report.iterations += 1
        step = self._predict(new, time)
        guess = new.copy()
        guess.axpy(1.0, step)
        length = self._length(x, new)
        if length > JUMPED * self._length(new, guess):
            found = self.newton.solve(guess, new, search=False)
            same = found.converged and self._length(guess, x) < SAME * length
        else:
            same = True
        self._factor_at(new, target)
        return same

    def _refusal(self, trial: PETSc.Vec, report: NewtonReport, time: float) -> str:
        """Why a trial cannot be accepted, or an empty string.

        Raises:
            SolveError: for a reason that no shorter step can mend.
        """
        if not report.converged:
            return report.reason
        try:
            return self.check(trial) if self.check else ""
        except SolveError as error:
            raise SolveError(error.reason, time) from None

    def _try(
        self, x: PETSc.Vec, time: float, target: float, *, search: bool
    ) -> tuple[PETSc.Vec, NewtonReport]:
        """Predictor and Newton from an accepted state whose tangent is factored."""
        self.newton.report = NewtonReport(iterations=1)
        step = self._predict(x, target)
        trial, blocked = clear_start(self.problem, x, step, time)
        if blocked:
            self.newton.report.reason = blocked
            return trial, self.newton.report
        predicted = trial.copy()
        turn = self.problem.largest_turn(x, trial)
        if turn >= self.settings.turn:
            self.newton.report.reason = f"an angle would turn by {np.degrees(turn):.0f} deg"
            return trial, self.newton.report
        report = self.newton.solve(trial, x, search=search)
        step, off = self._length(x, predicted), self._length(predicted, trial)
        report.strayed = off / step if off > NEGLIGIBLE else 0.0
        return trial, report

    def _length(self, start: PETSc.Vec, end: PETSc.Vec) -> float:
        """Norm of the displacements between two states over that of the vertices' places."""
        configuration = self.problem.configuration
        owned = configuration.nv_owned
        change = end.array_r[: 3 * owned] - start.array_r[: 3 * owned]
        rest = configuration.sheet.rest[:owned].ravel()
        moved, size = configuration.sum([change @ change, rest @ rest])
        return float(np.sqrt(moved / size))

    def _predict(self, x: PETSc.Vec, target: float) -> PETSc.Vec:
        """Increments du of the step: K_ff du_f = -f - K_fc du_c with the factored tangent."""
        problem = self.problem
        matrix = problem.tangent.insert(problem.state(x))
        problem.constraints.check(target)
        since = problem.time
        problem.set_time(target)
        rhs, known = x.duplicate(), x.duplicate()
        problem.forces(x, rhs, since)
        rhs.scale(-1.0)
        dofs = problem.constraints.dofs
        known.set(0.0)
        values = problem.constraints.values(target)
        known.array_w[dofs] = values - x.array_r[dofs]
        problem.constrain(matrix, known, rhs)
        step = x.duplicate()
        self.newton.linear.solve(rhs, step)
        return step


def remarks(step: Step, *, far: bool) -> list[Warning]:
    """What is to be told about an accepted state.

    Args:
        step: the step that led to it.
        far: whether it was found far from the predicted one.
    """
    found: list[Warning] = []
    if far:
        text = f"state at {step.time:g} was found far from the predicted one: it may be on another"
        found.append(BranchWarning(f"{text} branch; compare with smaller steps"))
    if step.negative_pivots:
        text = f"state at {step.time:g} is unstable: {step.negative_pivots} negative pivots"
        found.append(StabilityWarning(f"{text} of the tangent"))
    return found
