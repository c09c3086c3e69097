"""First guesses of a step that lie on this side of all barriers."""

from petsc4py import PETSc

from ufl_origami.problem import Problem

BLOCKED = "an obstacle or a support would close a gap"

WHOLE = 1 - 1e-9
"""Part of a way from which on, but for round-off, all of it is free."""


def clear_start(
    problem: Problem, x: PETSc.Vec, step: PETSc.Vec, since: float
) -> tuple[PETSc.Vec, str]:
    """Guess x + step, or as much of the step as no barrier forbids.

    Prescribed unknowns and obstacles take their whole step in any case. So where the rest does not,
    the way to the guess is looked at once more: it may neither end nor lead behind a surface.

    Args:
        problem: the problem at the time of the guess.
        x: accepted state.
        step: increments that lead to the guess; not changed.
        since: time of x.

    Returns:
        The guess, and why it cannot be used or an empty string.
    """
    part = problem.longest_step(x, step, since) if problem.bounded else 1.0
    guess = _partial(problem, x, step, part)
    if part == 1.0 or _is_free(problem, x, guess, since):
        return guess, ""
    guess = _partial(problem, x, step, 0.0)
    return guess, "" if _is_free(problem, x, guess, since) else BLOCKED


def _partial(problem: Problem, x: PETSc.Vec, step: PETSc.Vec, part: float) -> PETSc.Vec:
    """Part of a step, the whole of it for prescribed unknowns."""
    guess = x.copy()
    guess.axpy(part, step)
    dofs = problem.constraints.dofs
    guess.array_w[dofs] = problem.constraints.values(problem.time)
    return guess


def _is_free(problem: Problem, x: PETSc.Vec, guess: PETSc.Vec, since: float) -> bool:
    """Whether the straight way to a guess, obstacles moving with it, leaves all gaps open."""
    way = guess.copy()
    way.axpy(-1.0, x)
    return problem.longest_step(x, way, since) >= WHOLE
