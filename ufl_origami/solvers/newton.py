"""One equilibrium by PETSc SNES: Newton with full steps, inertia guard and watchdog.

The default is full Newton steps with the mixed-integration-point tangent (Magisano, Leonetti,
Garcea 2017, doi:10.1016/j.cma.2016.10.040): the membrane stress of the geometric stiffness is
extrapolated from the iterate before. Every factorisation tells the inertia; where negative pivots
show, a mass-weighted diagonal shift is raised until there are none. A watchdog follows a run of
full steps that did not converge by a few steps with an energy line search.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field

from petsc4py import PETSc

import numpy as np

from ufl_origami.errors import InputError
from ufl_origami.problem import Problem
from ufl_origami.solvers.linear import Factorisation, linear_options
from ufl_origami.solvers.options import option_scope
from ufl_origami.solvers.weights import shift_weights

log = logging.getLogger(__name__)

FIRST_SHIFT = 1e-10
"""First diagonal shift, over the largest ratio of tangent diagonal to weight."""

SHIFT_FACTOR = 8.0
"""The guard first tries the last shift over this, then raises it by this."""

SHIFT_TRIES = 40
"""Shifts that the guard tries at one tangent."""

CYCLE = 4
"""Iterations after which one that has not reduced the residual counts as part of a cycle."""

STAGNANT = 0.5
"""Share of the residual two iterations before, above which it counts as not reduced."""

CRITICAL = 5
"""Residuals evaluated along the step of an iteration that is part of a cycle."""

SHORTENING = ("basic", "bt")
"""Line searches that never go beyond the end of a Newton step."""

MANY = 1e4
"""Unknowns above which the tolerance floor grows with the root of their number."""

REASONS = {v: k for k, v in vars(PETSc.SNES.ConvergedReason).items() if isinstance(v, int)}


@dataclass(frozen=True)
class NewtonSettings:
    """How one equilibrium is sought.

    Attributes:
        method: "default" (full steps, MIP tangent, guard, watchdog), "newton" (plain full steps)
            or one of SNES's line searches by name ("bt", "l2", "cp") with the plain tangent;
            beside obstacles only "bt", the others go beyond steps that end before a surface.
        rtol: residual norm over the largest norm of one term's forces.
        iterations: full steps in one run.
        patience: first full steps of a run that the guard leaves alone: the extrapolated stress
            often makes the first tangents indefinite on the way to a minimum, and a shift there
            costs far more iterations than it saves. A run that ends unstable this way is repeated
            with the guard from its first step.
        cycles: runs of the watchdog, each with twice the line-search steps of the one before.
        floor: tolerance floor in units of eps max K_ii max |x|.
        reuse: iterations that the last factorisation may still need, judged by how it reduced the
            residual last, to be kept for them (modified Newton within one solve); 0: factor at each
            iteration.
        prefix: PETSc option prefix; every option of SNES, KSP and PC is reachable through it.
        options: PETSc options under that prefix; those in the database already win.
    """

    method: str = "default"
    rtol: float = 1e-9
    iterations: int = 12
    patience: int = 2
    cycles: int = 4
    floor: float = 30.0
    reuse: float = 0.0
    prefix: str = "ufl_origami_"
    options: Mapping[str, object] = field(default_factory=dict)


@dataclass
class NewtonReport:
    """What one solve did.

    Attributes:
        converged: whether the tolerance was met at an admissible state.
        reason: SNES's reason or the package's own.
        iterations: linear solves, the predictor included.
        factorisations: factorisations, those of the guard included.
        residuals: residual norm before each iteration.
        searched: whether the watchdog had to search.
        strayed: distance of the solution from the predicted state over the predicted step.
    """

    converged: bool = False
    reason: str = ""
    iterations: int = 0
    factorisations: int = 0
    residuals: list[float] = field(default_factory=list)
    searched: bool = False
    strayed: float = 0.0


class NewtonSolver:
    """SNES on a problem.

    Args:
        problem: terms and constraints.
        settings: method, tolerances and PETSc options.

    Raises:
        InputError: an energy that ends somewhere, and a method that does not stop before.

    Attributes:
        shift: last diagonal shift over the weights, 0 before the first one.
        shift_weights: those weights.
        report: what the solve under way did so far.
        allowed: negative pivots that the guard leaves alone (to follow an unstable branch).
        pivots: negative pivots of the last tangent, None where unknown.
    """

    def __init__(self, problem: Problem, settings: NewtonSettings | None = None):
        self.problem, self.settings = problem, settings or NewtonSettings()
        self.report = NewtonReport()
        self.allowed = 0
        self.pivots: int | None = None
        self._first = 0  # residual of the run under way
        self._residual_vector = problem.configuration.create_vector()
        self._previous: PETSc.Vec | None = None
        self._mip = self._guard = self.settings.method == "default"
        self._patience = self.settings.patience
        self._excess = self._unguarded = False  # pivots of the last tangent; left alone before
        self.shift_weights = shift_weights(problem)
        self.shift, self._floor = 0.0, 0.0
        own = {"default": "basic", "newton": "basic"}
        self._full = self._create_snes(own.get(self.settings.method, self.settings.method))
        self._careful: PETSc.SNES | None = None
        self.linear = Factorisation(self._full.getKSP(), problem.tangent.matrix, problem.symmetric)

    @property
    def extrapolates(self) -> bool:
        """Whether tangents take their stress from the iterate before."""
        return self.settings.method == "default"

    def close(self) -> None:
        """Give the factors' memory back: solver and callbacks hold each other."""
        for snes in (self._careful, self._full):
            if snes is not None:
                snes.destroy()

    def _create_snes(self, line_search: str) -> PETSc.SNES:
        matrix = self.problem.tangent.matrix
        snes = PETSc.SNES().create(matrix.comm)
        snes.setOptionsPrefix(self.settings.prefix)
        snes.setFunction(self._function, self._residual_vector.duplicate())
        snes.setJacobian(self._jacobian, matrix, matrix)
        snes.setConvergenceTest(self._converged)
        if self.problem.bounded:
            snes.setLineSearchPreCheck(self._stop_before_bounds)
        if self.problem.conservative and line_search == "bt":
            snes.setObjective(lambda _, x: self.problem.potential(x))
        with self._scope({"snes_linesearch_type": line_search}) as options:
            snes.setFromOptions()
            if self.problem.bounded:
                require_shortening(snes, options.getString("snes_linesearch_type"))
            snes.getKSP().setOperators(matrix)
            snes.getKSP().pc.setOperators(matrix)
            snes.getKSP().pc.setFromOptions()
        return snes

    def _scope(self, own: Mapping[str, object] | None = None):
        """Options of the solver, for as long as it works: MUMPS reads some when it factors."""
        defaults = {
            **(own or {}),
            "snes_type": "newtonls",
            "snes_divergence_tolerance": 1e30,
            **linear_options(self.problem.symmetric),
        }
        return option_scope(self.settings.prefix, {**defaults, **self.settings.options})

    def _function(self, snes: PETSc.SNES, x: PETSc.Vec, out: PETSc.Vec) -> None:
        self.problem.residual(x, out)

    def _stop_before_bounds(self, x: PETSc.Vec, step: PETSc.Vec) -> bool:
        """Shorten a Newton step (SNES goes to x - step) that a barrier would not survive.

        Where iterates jump to and fro across the bend of a friction law, the step also ends where
        the residual is normal to it (a critical point of the energy along the step, if there is
        one).
        """
        ahead = step.copy()
        ahead.scale(-1.0)
        part = self.problem.longest_step(x, ahead)
        if self._cycles():
            part *= self._critical_part(x, ahead, part)
        ahead.scale(-part)
        ahead.copy(step)
        return part < 1.0

    def _critical_part(self, x: PETSc.Vec, step: PETSc.Vec, longest: float) -> float:
        """Part of the longest step where the residual is normal to it, by regula falsi."""
        trial, residual = x.duplicate(), self._residual_vector

        def slope(part: float) -> float:
            x.copy(trial)
            trial.axpy(part * longest, step)
            self.problem.residual(trial, residual)
            return residual.dot(step)

        low, high = 0.0, 1.0
        below, above = slope(low), slope(high)
        if not below < 0 < above:
            return 1.0
        for _ in range(CRITICAL):
            middle = low + (high - low) * min(max(below / (below - above), 0.1), 0.9)
            value = slope(middle)
            if abs(value) < 0.1 * -below:
                break
            if value < 0:
                low, below = middle, value
            else:
                high, above = middle, value
        return middle

    def _cycles(self) -> bool:
        """Whether the residual once did not fall over two iterations, the first ones left out."""
        norms = np.array(self.report.residuals[self._first :])
        return bool((norms[CYCLE:] > STAGNANT * norms[CYCLE - 2 : -2]).any())

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, matrix, _) -> None:
        """Tangent at an iterate, factored and shifted where the guard asks for it."""
        if self._serves(snes):
            x.copy(self._previous)
            return
        self.problem.linearise(self._previous if self._mip else None, x)
        self.problem.stiffness(x)
        self._floor = min(self._floor or np.inf, self._round_off(x))
        self.problem.constrain(matrix, None, None)
        early = self._mip and snes.getIterationNumber() < self._patience
        found = self.pivots = self.factor(snes.getKSP(), shift=not early)
        self._excess = self._guard and (found or 0) > self.allowed
        self._unguarded |= early and self._excess
        if self._previous is None:
            self._previous = x.duplicate()
        x.copy(self._previous)

    def _serves(self, snes: PETSc.SNES) -> bool:
        """Whether the factorisation of the iteration before serves to the end."""
        if not self.settings.reuse or snes.getIterationNumber() == 0:
            return False
        before, now = self.report.residuals[-2:]
        return now < before and now * (now / before) ** self.settings.reuse < self.tolerance()

    def tolerance(self) -> float:
        """Residual norm at which the iteration ends."""
        return max(self.settings.rtol * self.problem.force_scale, self._floor)

    def set_floor(self, x: PETSc.Vec) -> None:
        """Take the tolerance floor from the tangent just assembled at an accepted state.

        Iterates may lower it but not raise it: far off, near a tilt of 90 degrees, their tangent
        has no bound.
        """
        self._floor = self._round_off(x)

    def forget_floor(self) -> None:
        """Take the tolerance floor from the first tangent of the next solve."""
        self._floor = 0.0

    def _round_off(self, x: PETSc.Vec) -> float:
        """Tolerance that the residual's round-off allows: its norm grows with the unknowns."""
        many = max(1.0, np.sqrt(x.getSize() / MANY))
        return self.settings.floor * many * self.problem.round_off(x)

    def factor(self, ksp: PETSc.KSP, *, shift: bool = True) -> int | None:
        """Factor the constrained tangent; with the guard, shift it until positive definite.

        Args:
            ksp: linear solver.
            shift: whether the guard may act.

        Returns:
            Negative pivots of the tangent itself, None where unknown.
        """
        linear = Factorisation(ksp, self.problem.tangent.matrix, self.problem.symmetric)
        with self._scope():
            found = linear.factor()
            if self._guard and shift and found and found > self.allowed:
                self._raise_shift(linear)
        self.report.factorisations += linear.count
        self.linear.zero_pivots = linear.zero_pivots
        return found

    def _raise_shift(self, linear: Factorisation) -> None:
        matrix = linear.matrix
        diagonal = matrix.getDiagonal()
        if not self.shift:
            ratio = diagonal.copy()
            ratio.pointwiseDivide(diagonal, self.shift_weights)
            self.shift = FIRST_SHIFT * ratio.norm(PETSc.NormType.INFINITY)
        shift = self.shift / SHIFT_FACTOR
        for _ in range(SHIFT_TRIES):
            matrix.setDiagonal(diagonal + shift * self.shift_weights)
            if not linear.factor():
                self.shift = shift
                return
            shift *= SHIFT_FACTOR
        log.warning("no shift up to %.1e made the tangent positive definite", shift)

    def _converged(self, snes: PETSc.SNES, iteration: int, norms: tuple) -> int:
        reason = PETSc.SNES.ConvergedReason
        norm = norms[2]
        self.report.residuals.append(norm)
        if not np.isfinite(norm):
            return reason.DIVERGED_FNORM_NAN
        if norm <= self.tolerance():
            return reason.CONVERGED_FNORM_RELATIVE
        return reason.CONVERGED_ITERATING

    def _run(self, snes: PETSc.SNES, x: PETSc.Vec, iterations: int) -> bool:
        snes.setTolerances(max_it=iterations)
        self._first = len(self.report.residuals)
        try:
            snes.solve(None, x)
        except PETSc.Error as error:  # PETSc wraps what its callbacks raise
            if error.__cause__ is not None:
                raise error.__cause__ from None
            raise
        self.report.iterations += snes.getIterationNumber()
        code = snes.getConvergedReason()
        self.report.reason = REASONS.get(code, str(code))
        return code > 0

    def solve(
        self, x: PETSc.Vec, previous: PETSc.Vec | None = None, *, search: bool = True
    ) -> NewtonReport:
        """Seek the equilibrium at the problem's time from x, in place.

        Args:
            x: start, with the prescribed unknowns at their values; the solution on return.
            previous: the state from which a predictor led to x (for the MIP stress), or None.
            search: whether the watchdog may follow a first run of full steps that failed.
        """
        self._previous = None if previous is None else previous.copy()
        settings = self.settings
        self._patience = settings.patience
        if settings.method != "default":
            self.report.converged = self._run(self._full, x, 10 * settings.iterations)
            return self.report
        start = x.copy()
        for cycle in range(settings.cycles if search else 1):
            if self._full_steps(x):
                self.report.converged = True
                return self.report
            self.report.searched |= search
            if search and cycle + 1 < settings.cycles and self._line_search(start, x, 4 * 2**cycle):
                self.report.converged = True
                return self.report
        return self.report

    def _full_steps(self, x: PETSc.Vec) -> bool:
        """One run of full steps; with the guard from the first one where it ends unstable else."""
        start = x.copy()
        previous = None if self._previous is None else self._previous.copy()
        self._unguarded = False
        done = self._run(self._full, x, self.settings.iterations)
        if not (done and self._excess and self._unguarded):
            return done
        start.copy(x)
        self._previous, self._patience = previous, 0
        return self._run(self._full, x, self.settings.iterations)

    def _line_search(self, start: PETSc.Vec, x: PETSc.Vec, iterations: int) -> bool:
        """Watchdog: keep or go back, then steps with line search and the plain tangent."""
        if not self._better(start, x):
            start.copy(x)
        if self._careful is None:
            self._careful = self._create_snes("bt")
            self._careful.setKSP(self.linear.ksp)  # one factor in memory, not two
        self._mip = False
        try:
            done = self._run(self._careful, x, iterations)
        finally:
            self._mip = True
            self._previous = None
        x.copy(start)
        return done

    def _better(self, start: PETSc.Vec, x: PETSc.Vec) -> bool:
        """Whether x has the lower energy (the lower residual where there is no energy)."""
        if self.problem.conservative:
            new, old = self.problem.potential(x), self.problem.potential(start)
        else:
            new, old = self._norm(x), self._norm(start)
        return bool(np.isfinite(new) and new < old)

    def _norm(self, x: PETSc.Vec) -> float:
        self.problem.residual(x, self._residual_vector)
        return self._residual_vector.norm()


def require_shortening(snes: PETSc.SNES, line_search: str) -> None:
    """Refuse a solver whose steps may lead beyond where `_stop_before_bounds` ends them.

    Raises:
        InputError: it is none of Newton's with a line search that only shortens.
    """
    if snes.getType() != PETSc.SNES.Type.NEWTONLS or line_search not in SHORTENING:
        raise InputError(
            f"solver {snes.getType()!r} with line search {line_search!r} may step through an "
            f"obstacle: take 'newtonls' with one of {SHORTENING}"
        )
