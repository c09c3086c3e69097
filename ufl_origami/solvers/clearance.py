"""First guesses of a step that lie on this side of all barriers."""

from petsc4py import PETSc

from ufl_origami.problem import Problem

BLOCKED = "an obstacle or a support would close a gap"


def clear_start(
    problem: Problem, x: PETSc.Vec, step: PETSc.Vec, since: float
) -> tuple[PETSc.Vec, str]:
    """Guess x + step, or as much of the step as no barrier forbids.

    Prescribed unknowns take their whole step in any case.

    Args:
        problem: the problem at the time of the guess.
        x: accepted state.
        step: increments that lead to the guess; not changed.
        since: time of x.

    Returns:
        The guess, and why it cannot be used or an empty string.
    """
    part = problem.longest_step(x, step, since) if problem.bounded else 1.0
    guess = x.copy()
    guess.axpy(part, step)
    dofs = problem.constraints.dofs
    guess.array_w[dofs] = problem.constraints.values(problem.time)
    if part == 1.0:
        return guess, ""
    still = step.duplicate()
    still.set(0.0)
    return guess, "" if problem.longest_step(guess, still) > 0 else BLOCKED
