"""Jumps: what an unstable equilibrium does when it is let go at a held load factor.

The sheet is pushed a little along its most unstable direction and moves by implicit Euler with
steps that follow the local error, all loads and supports held, until it has come to rest. The
scheme's own losses and the scene's damping take the energy; friction takes no part. Where it rests
is then solved as an equilibrium, which must be stable.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np

from ufl_origami.branches import modes, stability
from ufl_origami.constraints import Constraints
from ufl_origami.errors import InputError, SolveError
from ufl_origami.model import Model
from ufl_origami.motion import Motion
from ufl_origami.problem import Problem
from ufl_origami.solvers.admissible import Admissible
from ufl_origami.solvers.arc import Metric
from ufl_origami.solvers.dynamics import TimePath, TimeSettings, TimeStep
from ufl_origami.solvers.newton import NewtonSettings, NewtonSolver
from ufl_origami.solvers.schemes import ImplicitEuler, Instant
from ufl_origami.solvers.stability import Mode
from ufl_origami.surroundings import damping_terms, make_motion
from ufl_origami.terms.base import Term
from ufl_origami.terms.inertia import Mass, mass_matrix

PUSH = 0.1
"""Default size of the push over the thickness: root of the mean square of the displacements."""

PERIODS = 1000
"""Time after which a sheet that does not rest is given up, over that of the mode's growth."""

AT_REST = 1e-8
"""Kinetic energy over its largest so far, below which a sheet is at rest."""

TOLERANCE = 1e-2
"""Local error of a step over the sheet's diagonal."""


class HeldConstraints(Constraints):
    """Prescribed unknowns that stay as one load factor has them.

    Args:
        constraints: the conditions.
        load: load factor.
    """

    def __init__(self, constraints: Constraints, load: float):
        super().__init__(constraints.configuration)
        self.dofs, self._held = constraints.dofs, constraints.values(load)

    def values(self, time: float) -> np.ndarray:
        """The values held, whatever the time."""
        return self._held


class HeldProblem(Problem):
    """A problem in time whose loads, supports and obstacles stay as one load factor has them.

    Args:
        problem: the problem that is held.
        terms: its terms, and those that act in time.
        load: load factor.
    """

    def __init__(self, problem: Problem, terms: Sequence[Term], load: float):
        constraints = HeldConstraints(problem.constraints, load)
        super().__init__(problem.configuration, terms, constraints)
        self.load = load

    @property
    def moment(self) -> float:
        """The load factor, whatever the time."""
        return self.load

    def longest_step(self, vector: PETSc.Vec, step: PETSc.Vec, since: float | None = None) -> float:
        """As for a problem at rest: obstacles do not move."""
        return super().longest_step(vector, step, self.load)


Row = tuple[float, float, float]


@dataclass(frozen=True)
class Jump:
    """A jump from an unstable state to a stable one.

    Attributes:
        times: (n,) times of the steps, the start first.
        energies: (n,) potential energy at each.
        kinetic: (n,) kinetic energy at each.
    """

    times: np.ndarray
    energies: np.ndarray
    kinetic: np.ndarray

    @property
    def released(self) -> float:
        """Potential energy that was lost."""
        return float(self.energies[0] - self.energies[-1])


def jump(
    model: Model,
    *,
    direction: PETSc.Vec | None = None,
    side: int = 1,
    size: float | None = None,
    newton: NewtonSettings | None = None,
) -> Jump:
    """Let a model go from an unstable equilibrium until it rests in a stable one; collective.

    Args:
        model: the model in the state that a path left it in; in the new state afterwards.
        direction: change of the unknowns that pushes it; default its lowest eigenvector.
        side: 1 or -1: way along the direction.
        size: root of the mean square of the push; default a tenth of the thickness.
        newton: tolerances of a step.

    Raises:
        InputError: the state is stable and no direction is given, or a wrong side.
        SolveError: it did not come to rest, or not in a stable state; the model is back then.
    """
    if side not in (1, -1):
        raise InputError(f"side {side} is neither 1 nor -1")
    load, start, memory = model.problem.time, model.x.copy(), model.problem.memory()
    (mode,) = modes(model, 1)
    if direction is None and mode.value >= 0:
        raise InputError(f"the state at {load:g} is stable: name a direction to push it")
    direction = mode.vector if direction is None else direction
    metric = Metric(model.problem)
    thickness = max(model.scene.panel_material(name).h for name in model.sheet.panel_names)
    push = (PUSH * thickness if size is None else size) / metric.diagonal
    potential = model.problem.potential(model.x)
    try:
        model.x.axpy(side * push / metric.norm(direction), direction)
        log = [(0.0, potential, 0.0)]
        _release(model, load, mode, newton, log)
        return Jump(*np.array(log).T)
    except BaseException:
        start.copy(model.x)
        model.problem.recall(memory)
        model.problem.set_time(load)
        raise


def jump_motion(model: Model) -> Motion:
    """Masses of a model at rest: its own, or one per area where a panel has no density."""
    scene, configuration, functions = model.scene, model.configuration, model.functions
    materials = [scene.panel_material(name) for name in model.sheet.panel_names]
    if all(material.rho for material in materials):
        motion = make_motion(scene, configuration, functions)
        motion.v.set(0.0)
        return motion
    ones = np.ones(len(model.sheet.cells))
    return Motion(configuration, functions, Mass(mass_matrix(configuration, functions, ones)))


def _release(
    model: Model, load: float, mode: Mode, newton: NewtonSettings | None, log: list[Row]
) -> None:
    """Motion from the model's state until it rests, and the equilibrium there; rows for the log."""
    motion = model.motion = jump_motion(model)
    terms = [*model.problem.terms, motion.inertia, *damping_terms(model, ImplicitEuler.memory)]
    held = HeldProblem(model.problem, terms, load)
    held.set_time(0.0)
    unit = 1.0 / growth_rate(model, motion, mode)
    path = TimePath(
        held,
        NewtonSolver(held, newton or NewtonSettings(iterations=20, reuse=3.0)),
        motion.inertia,
        ImplicitEuler(),
        TimeSettings(step=0.1 * unit, tolerance=TOLERANCE),
        [Instant(0.0, model.x.copy(), motion.v.copy())],
        Admissible(model),
    )

    def accept(step: TimeStep, x: PETSc.Vec) -> None:
        kinetic = motion.kinetic_energy(path.past[0].v)
        log.append((step.time, model.problem.potential(x), kinetic))

    try:
        _move_until_rest(path, model.x, unit, log, accept)
    finally:
        path.newton.close()
        model.motion = None
    _settle(model, load, newton)
    log.append((path.past[0].time, model.problem.potential(model.x), 0.0))


def growth_rate(model: Model, motion: Motion, mode: Mode) -> float:
    """Rate at which a displacement along an eigenvector grows or swings (1 / time).

    Angles have no mass: the rate is that of the displacements alone under the same stiffness.
    """
    return float(np.sqrt(abs(mode.value) / motion.product(mode.vector, mode.vector)))


def _move_until_rest(path: TimePath, x: PETSc.Vec, unit: float, log, accept) -> None:
    for stop in range(1, PERIODS + 1):
        path.run(x, [stop * unit], accept)
        _, potentials, kinetic = np.array(log).T
        lost = potentials[0] - potentials[-1]
        if kinetic.max() > 0 and kinetic[-1] <= AT_REST * max(kinetic.max(), lost):
            return
    raise SolveError(f"the sheet does not come to rest within {PERIODS * unit:.3g}")


def _settle(model: Model, load: float, newton: NewtonSettings | None) -> None:
    """Equilibrium at the held load factor near the state where the sheet rests.

    Raises:
        SolveError: there is none, or it is unstable.
    """
    model.problem.set_time(load)
    solver = NewtonSolver(model.problem, newton)
    try:
        report = solver.solve(model.x)
    finally:
        solver.close()
    if not report.converged:
        raise SolveError(f"no equilibrium where the sheet rests: {report.reason}", load)
    model.problem.accept(model.x)
    if unstable := stability(model):
        raise SolveError(f"the sheet rests in a state with {unstable} unstable directions", load)
