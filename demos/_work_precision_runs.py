"""Runs of the speed-accuracy study: choice of settings, timed solutions."""

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from mpi4py import MPI

import numpy as np
from _work_precision_problems import Case, Method, Problem, Setting

from ufl_origami.discretise import build
from ufl_origami.errors import MeshWarning, SolveError, StabilityWarning
from ufl_origami.recommendation import panel_length, sheet_area
from ufl_origami.run import StaticResult, solve_static
from ufl_origami.solvers.static import StepSettings
from ufl_origami.timing import Times, timed
from ufl_origami.work_precision import Point

STEPS = (0.125, 0.25, 0.5, 1.0)
QUICK_STEPS = (0.5, 1.0)
MESHES = ("structured", "unstructured")
REPEATS = 10  # runs of a point, at most
ENOUGH = 0.5  # seconds after which a point is not run again
SMALLEST = 16.0  # part of the load step below which a path counts as failed
THINNER = 3.0  # ratio of thicknesses in the check of the tables' reach
SAME = 1e-6  # errors that differ by less are those of the same equilibrium


@dataclass(frozen=True)
class Trial:
    """One try of the scan for settings.

    Attributes:
        n, mesh, measure, step: mesh, tilt measure (empty: none), load step.
        factorisations: of the whole path, 0 where it failed.
        errors: relative errors, empty where it failed.
    """

    n: int
    mesh: str
    measure: str
    step: float
    factorisations: int
    errors: dict[str, float]

    @property
    def largest(self) -> float:
        """Largest error, inf where the path failed."""
        return max(map(abs, self.errors.values()), default=np.inf)


@dataclass(frozen=True)
class Choice:
    """Settings of a method for a problem, and how they were found.

    Attributes:
        step: load step.
        measure: tilt measure, empty where the method has none.
        steps: tries of the load steps.
        measures: tries of the measures.
    """

    step: float
    measure: str
    steps: list[Trial]
    measures: list[Trial]


@dataclass(frozen=True)
class Solved:
    """A solved case: result, errors, seconds of the path, of its building; None where it failed."""

    result: StaticResult | None
    errors: dict[str, float]
    times: Times
    build_seconds: float
    dofs: int
    failure: str = ""


def choose(problem: Problem, method: Method, comm: MPI.Comm, *, quick: bool) -> Choice:
    """Settings of a method on the problem's middle meshes, at its middle thickness; collective."""
    counts = problem.quick[method.model][1:2] if quick else problem.middle[method.model]
    measures = method.measures or ("",)

    def tries(measure: str, step: float) -> list[Trial]:
        return [
            attempt(problem, Setting(n, mesh, method, measure or None, thickness, comm), step)
            for mesh in MESHES
            for n in counts
        ]

    thickness = problem.middle_thickness
    sizes = QUICK_STEPS if quick else STEPS
    steps = [trial for size in sizes for trial in tries(measures[0], size)]
    step = best_step(steps)
    tried = [t for measure in measures for t in tries(measure, step) if len(measures) > 1]
    return Choice(step, best_measure(tried) if tried else measures[0], steps, tried)


def attempt(problem: Problem, setting: Setting, step: float) -> Trial:
    """One try; collective."""
    solved = solve(problem.make(setting), step, setting.comm)
    done = solved.result.steps if solved.result else []
    count = sum(one.factorisations for one in done)
    return Trial(setting.n, setting.mesh, setting.measure or "", step, count, solved.errors)


def thinner(
    problem: Problem, methods: Sequence[Method], choices: Mapping[str, Choice], comm: MPI.Comm
) -> list[Trial]:
    """The last method at a third of the thickness, the bending stiffness kept; collective.

    Empty where the reference is exact. Tells whether a table may serve other thicknesses.
    """
    method, thickness = methods[-1], problem.middle_thickness / THINNER
    step, measure = choices[method.name].step, choices[method.name].measure or None
    return [
        attempt(problem, Setting(n, MESHES[0], method, measure, thickness, comm), step)
        for n in problem.counts[method.model][-2:]
        if problem.table
    ]


def best_step(trials: Sequence[Trial]) -> float:
    """Load step of the fewest factorisations on all meshes together, the largest of equals.

    It has to find the equilibrium of the smallest step on each of them.

    Raises:
        SolveError: no step does.
    """
    smallest = min(trial.step for trial in trials)
    found = {(t.mesh, t.n): t.errors for t in trials if t.step == smallest}
    total: dict[float, int] = {}
    for step in dict.fromkeys(trial.step for trial in trials):
        some = [trial for trial in trials if trial.step == step]
        if all(same(trial.errors, found[trial.mesh, trial.n]) for trial in some):
            total[step] = sum(trial.factorisations for trial in some)
    if not total:
        raise SolveError("no load step led to the end of the path on all meshes of the scan")
    return min(total, key=lambda step: (total[step], -step))


def same(errors: dict[str, float], others: dict[str, float]) -> bool:
    """Whether two paths ended in one equilibrium."""
    return bool(errors) and all(abs(errors[k] - others.get(k, np.inf)) < SAME for k in errors)


def best_measure(trials: Iterable[Trial]) -> str:
    """Measure of the smallest geometric mean of the largest errors."""
    errors: dict[str, list[float]] = {}
    for trial in trials:
        errors.setdefault(trial.measure, []).append(trial.largest)
    return min(errors, key=lambda measure: float(np.prod(errors[measure])))


def solve(case: Case, step: float, comm: MPI.Comm) -> Solved:
    """Build and solve a case once, timed; collective. Warnings of mesh and stability are left out.

    A path that fails is a result as well.
    """
    with warnings.catch_warnings():
        for kind in (MeshWarning, StabilityWarning):
            warnings.simplefilter("ignore", kind)
        with timed(comm) as building:
            model = build(case.scene)
        result, failure = None, ""
        with timed(comm) as watch:
            try:
                sizes = StepSettings(step, step, smallest=step / SMALLEST)
                result = solve_static(model, [1.0], record=case.record, steps=sizes, progress=False)
            except SolveError as error:
                failure = str(error)
    errors = case.errors(result) if result else {}
    seconds = building.times().total
    return Solved(result, errors, watch.times(), seconds, model.num_unknowns, failure)


def measure(problem: Problem, setting: Setting, choice: Choice, repeats: int) -> Point:
    """One point: the fastest of a few runs on one mesh; collective."""
    case = problem.make(replace(setting, measure=choice.measure or None))
    best, spent = solve(case, choice.step, setting.comm), 0.0
    for _ in range(repeats - 1):
        spent += best.times.total
        if spent > ENOUGH or best.failure:
            break
        again = solve(case, choice.step, setting.comm)
        best = min(best, again, key=lambda solved: solved.times.total)
    return point(problem, setting, choice, case, best)


def point(problem: Problem, setting: Setting, choice: Choice, case: Case, solved: Solved) -> Point:
    """What is kept of a solved case; collective."""
    steps = solved.result.steps if solved.result else []
    ddg, times, sheet = setting.method.model == "ddg", solved.times, case.scene.sheet
    return Point(
        problem=problem.name,
        method=setting.method.name,
        mesh=setting.mesh,
        model=setting.method.model,
        bending=setting.method.bending if ddg else "",
        measure=choice.measure,
        step=choice.step,
        thickness=setting.thickness,
        n=setting.n,
        size=case.size,
        h=case.scene.panel_material(sheet.panel_names[0]).h,
        panel_length=panel_length(sheet),
        sheet_area=sheet_area(sheet),
        triangles=sheet.num_cells_global,
        dofs=solved.dofs,
        steps=len(steps),
        newton_iterations=sum(step.iterations for step in steps),
        factorisations=sum(step.factorisations for step in steps),
        cuts=sum(step.cuts for step in steps),
        unstable=sum(bool(step.negative_pivots) for step in steps),
        seconds=times.total,
        assembly_seconds=times.assembly,
        factorisation_seconds=times.factorisation,
        rest_seconds=times.rest,
        elapsed=times.elapsed,
        build_seconds=solved.build_seconds,
        failure=solved.failure,
        **{f"error_{name}": value for name, value in solved.errors.items()},
    )


def settings(
    problem: Problem, methods: Iterable[Method], comm: MPI.Comm, *, quick: bool
) -> Iterator[Setting]:
    """Meshes, thicknesses and methods of a problem, the smallest first."""
    thicknesses = problem.thicknesses[:1] if quick else problem.thicknesses
    for thickness in thicknesses:
        for mesh in MESHES:
            for method in methods:
                for n in (problem.quick if quick else problem.counts)[method.model]:
                    yield Setting(n, mesh, method, None, thickness, comm)
