"""Direct factorisation of the tangent with its inertia."""

from petsc4py import PETSc

from ufl_origami.errors import SolveError

CHOLESKY = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
}
LU = {
    "ksp_type": "preonly",
    "pc_type": "lu",
    "pc_factor_mat_solver_type": "mumps",
}

WORKSPACES = (100, 400, 1600)
"""Percentages beyond MUMPS's estimate of its workspace, tried where that was too small."""


def linear_options(symmetric: bool) -> dict[str, object]:
    """Default options: MUMPS LDLt with inertia for a symmetric tangent, else MUMPS LU."""
    return dict(CHOLESKY if symmetric else LU)


class Factorisation:
    """One KSP whose factorisation tells the number of negative pivots.

    Args:
        ksp: linear solver to use (an SNES's own, or a new one).
        matrix: the matrix.
        symmetric: whether the inertia can be had.
    """

    def __init__(self, ksp: PETSc.KSP, matrix: PETSc.Mat, symmetric: bool):
        self.ksp, self.matrix, self.symmetric = ksp, matrix, symmetric
        self.count = self.zero_pivots = 0

    def factor(self) -> int | None:
        """Factor the matrix as it is now; number of negative pivots, None where unknown.

        Raises:
            SolveError: the solver package ran out of memory.
        """
        self.ksp.setOperators(self.matrix)
        self._ask_inertia()
        self.ksp.setUp()
        self.ksp.pc.setUp()
        self.count += 1
        for workspace in WORKSPACES:
            if not self._short_of_workspace():
                break
            self._enlarge(workspace)
            self.ksp.pc.setUp()
            self.count += 1
        if self.ksp.pc.getFailedReason() == PETSc.PC.FailedReason.FACTOR_OUTMEMORY:
            unknowns = self.matrix.getSize()[0]
            raise SolveError(
                f"the factorisation of {unknowns} unknowns ran out of memory: use more ranks on "
                "more machines, or an iterative solver (NewtonSettings.options)"
            )
        return self.negative_pivots()

    def _ask_inertia(self) -> None:
        """Let MUMPS count pivots (null pivots detected, root node not handed to ScaLAPACK)."""
        pc = self.ksp.pc
        if pc.getType() == "cholesky" and pc.getFactorSolverType() == "mumps":
            pc.setOperators(self.matrix)
            pc.setFactorSetUpSolverType()
            factor = pc.getFactorMatrix()
            factor.setMumpsIcntl(13, 1)
            factor.setMumpsIcntl(24, 1)

    def _short_of_workspace(self) -> bool:
        """Whether MUMPS needs more than it had estimated (delayed pivots)."""
        pc = self.ksp.pc
        if pc.getFactorSolverType() != "mumps":
            return False
        return pc.getFactorMatrix().getMumpsInfog(1) in (-8, -9)

    def _enlarge(self, workspace: int) -> None:
        """Start afresh with more workspace: PETSc skips all work of a factor that once failed."""
        pc = self.ksp.pc
        pc.reset()
        pc.setOperators(self.matrix)
        pc.setFactorSetUpSolverType()
        pc.getFactorMatrix().setMumpsIcntl(14, workspace)
        self._ask_inertia()

    def negative_pivots(self) -> int | None:
        """Negative (and zero) pivots of the last factorisation, None where unknown."""
        if not self.symmetric or self.ksp.pc.getType() != PETSc.PC.Type.CHOLESKY:
            return None
        negative, zero, _ = self.ksp.pc.getFactorMatrix().getInertia()
        self.zero_pivots = zero
        return negative + zero

    def solve(self, rhs: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve with the last factorisation, whatever has been written into the matrix since."""
        self.ksp.pc.setReusePreconditioner(True)
        self.ksp.solve(rhs, solution)
        self.ksp.pc.setReusePreconditioner(False)
