"""One case of the failure map: solved within a budget, judged, with the warnings it gave."""

import time
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from petsc4py import PETSc

from _failure_cases import Method, Setting, Sheets, Task, task

from ufl_origami.discretise import build
from ufl_origami.errors import (
    BranchWarning,
    MeshWarning,
    RoundOffWarning,
    SolveError,
    StabilityWarning,
    SupportWarning,
)
from ufl_origami.model import Model
from ufl_origami.quality import check_mesh, check_model, warn_sagitta
from ufl_origami.resolution import warn_round_off
from ufl_origami.solvers.admissible import Admissible
from ufl_origami.solvers.newton import NewtonReport, NewtonSettings, NewtonSolver
from ufl_origami.solvers.static import StaticPath, StepSettings
from ufl_origami.supports import check_supports

BUDGET = 1000  # Newton iterations of one case, after which no further try is begun
SMALLEST = 1e-3  # step at which the automatic solver gives up
KINDS = {
    BranchWarning: "branch",
    MeshWarning: "mesh",
    RoundOffWarning: "round-off",
    StabilityWarning: "unstable",
    SupportWarning: "supports",
}
VERDICTS = ("right", "wrong", "failed")


@dataclass(frozen=True)
class Solver:
    """A way to solve.

    Attributes:
        name: name in tables and maps.
        newton: `NewtonSettings.method`.
        cuts: whether steps may be cut and grow, as in `solve_static`.
    """

    name: str
    newton: str
    cuts: bool = False


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Attributes:
        setting, method, solver: the case.
        verdict: "right", "wrong" (a solution beyond the bound) or "failed".
        error: distance from the exact answer, None where it failed.
        iterations: Newton iterations, those of failed tries included.
        reached: load factor of the last accepted state, or its share of the time.
        reason: why it failed, or an empty string.
        warned: kinds of the warnings given, sorted.
        triangles, unknowns: size of the model.
        seconds: wall-clock time, the model's assembly included.
        measured: what else was measured, by name.
    """

    setting: Any
    method: str
    solver: str
    verdict: str
    error: float | None
    iterations: int
    reached: float
    reason: str
    warned: tuple[str, ...]
    triangles: int
    unknowns: int
    seconds: float
    measured: Mapping[str, Any] = field(default_factory=dict)

    @property
    def silent(self) -> bool:
        """Whether it is wrong and nothing said so."""
        return self.verdict == "wrong" and not self.warned

    def row(self) -> dict[str, Any]:
        """Flat values, for CSV and summary.json."""
        values = asdict(self)
        setting, measured = values.pop("setting"), values.pop("measured")
        return setting | values | measured | {"warned": "; ".join(self.warned)}


class Budgeted(NewtonSolver):
    """Newton that counts its iterations and begins no further try once they are spent."""

    spent = 0

    def solve(
        self, x: PETSc.Vec, previous: PETSc.Vec | None = None, *, search: bool = True
    ) -> NewtonReport:
        """Seek an equilibrium, see `NewtonSolver.solve`.

        Raises:
            SolveError: the budget is spent.
        """
        if self.spent >= BUDGET:
            raise SolveError(f"budget of {BUDGET} iterations is spent")
        try:
            return super().solve(x, previous, search=search)
        finally:
            self.spent += self.report.iterations


def run_case(
    setting: Setting, method: Method, solver: Solver, sheets: Sheets, bound: float
) -> Outcome:
    """Solve and judge one case; collective."""
    begin = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        case = task(setting, method, sheets)
        model = build(case.scene)
        check_supports(model)
        newton = Budgeted(model.problem, NewtonSettings(method=solver.newton))
        path = StaticPath(model.problem, newton, _steps(setting, solver), Admissible(model))
        reason = _follow(path, model)
        if not reason:
            warn_sagitta(model)
            warn_round_off(model)
    error = None if reason else case.error(model)
    return Outcome(
        setting=setting,
        method=method.name,
        solver=solver.name,
        verdict=judge(error, bound),
        error=error,
        iterations=newton.spent,
        reached=path.steps[-1].time if path.steps else 0.0,
        reason=reason,
        warned=_kinds(caught, case, model),
        triangles=model.sheet.num_cells_global,
        unknowns=model.num_unknowns,
        seconds=time.perf_counter() - begin,
    )


def _steps(setting: Setting, solver: Solver) -> StepSettings:
    size = 1.0 / setting.steps
    if solver.cuts:
        return StepSettings(first=size, smallest=SMALLEST)
    return StepSettings(first=size, largest=size, smallest=0.75 * size)


def _follow(path: StaticPath, model: Model) -> str:
    """Follow the path to load factor 1; why it failed, or an empty string."""
    try:
        path.run(model.x, 0.0, [1.0])
    except SolveError as error:
        return error.reason
    return ""


def judge(error: float | None, bound: float) -> str:
    """Verdict on a solution by its error, on none by None."""
    if error is None:
        return "failed"
    return "right" if error <= bound else "wrong"


def _kinds(caught: list[warnings.WarningMessage], case: Task, model: Model) -> tuple[str, ...]:
    """Kinds of the package's own warnings: the finding's, else the name of the class."""
    own = [w for w in caught if w.category in KINDS]
    if not own:
        return ()
    findings = [*check_mesh(case.scene), *check_model(model)]
    kinds = {finding.message: finding.kind for finding in findings}
    return tuple(sorted({kinds.get(str(w.message), KINDS[w.category]) for w in own}))
