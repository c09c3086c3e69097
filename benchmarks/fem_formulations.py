"""The fem model against the shells that it was chosen from: errors and cost on a thin cantilever.

Cantilever under a dead end shear, P L^2 / EI = 4, nu = 0, for h / L from 1e-2 to 1e-4. Errors are
in percent of the exact elastica's tip deflections, w along the force and u along the strip; at 1e-2
the strip's extension, which the elastica lacks, accounts for 0.004 %.

`twin` is the package's fem model with its own load steps, the others are in
`_formulations_shells.py`: full Newton steps on MUMPS LU of all their unknowns, in the fewest equal
load steps of 1, 2, 4 .. 256 that converge (the iterations of fewer ones are not counted). Times are
processor time: "tangent ms" and "factor ms" of one iteration at the full load, the best of several;
"compile s" of the forms' code with empty caches (left out by --quick).

    ./run python3 benchmarks/fem_formulations.py [--quick] [--output FILE]
    ./run python3 benchmarks/fem_formulations.py --formulation twin naghdi --n 1 --thinness 1e-4
"""

import os
import tempfile
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import product

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from _formulations_shells import SHELLS, Shell, Strip
from _record import Stopwatch, Table, parser
from dolfinx import jit
from dolfinx.fem import petsc
from newton_iteration import iterate

from ufl_origami.discretise import build
from ufl_origami.errors import SolveError
from ufl_origami.gallery.shell_problems import Form, ShellProblem, cantilever_shear
from ufl_origami.model import Model
from ufl_origami.solvers.linear import Factorisation, linear_options
from ufl_origami.solvers.newton import NewtonSolver
from ufl_origami.solvers.options import option_scope

TWIN = "twin"
FORMULATIONS = (TWIN, *SHELLS)
MESHES = ("structured", "unstructured")
ACROSS, THINNESS = (1, 2, 4), (1e-2, 1e-3, 1e-4)
LENGTH = 10.0
LOAD_STEPS = (1, 2, 4, 8, 16, 32, 64, 128, 256)
ITERATIONS = 30
"""Newton iterations allowed in one load step."""
CLOSE, LOST = 1e-6 * LENGTH, 1e3 * LENGTH
"""Largest changes of a displacement at which Newton has converged, and has failed."""
ERRORS = {"w %": "Uz_tip", "u %": "minus_Ux_tip"}
EFFORT = ("steps", "iterations", "tangent ms", "factor ms")
COLUMNS = (
    ("formulation", ""),
    ("mesh", ""),
    ("n", "d"),
    ("h/L", ".0e"),
    ("triangles", "d"),
    ("dofs", "d"),
    ("w %", ".4f"),
    ("u %", ".4f"),
    ("steps", "d"),
    ("iterations", "d"),
    ("tangent ms", ".2f"),
    ("factor ms", ".2f"),
    ("compile s", ".1f"),
    ("failure", ""),
)


@dataclass
class Found:
    """What a formulation made of the problem.

    Attributes:
        dofs: unknowns, prescribed ones included.
        tip: measured column of the problem -> value, empty where the formulation failed.
        effort: column of the table -> figure.
        failure: why it failed, or an empty string.
    """

    dofs: int
    tip: Mapping[str, float] = field(default_factory=dict)
    effort: dict[str, float] = field(default_factory=dict)
    failure: str = ""


class Newton:
    """Full Newton steps on a shell's equations.

    Args:
        shell: the equations.
    """

    def __init__(self, shell: Shell):
        self.shell = shell
        self.matrix = petsc.create_matrix(shell.tangent)
        self._residual = petsc.create_vector(shell.residual)
        self._step = self._residual.duplicate()
        ksp = PETSc.KSP().create(MPI.COMM_SELF)
        with option_scope("fem_formulations_", linear_options(symmetric=False)):
            ksp.setOptionsPrefix("fem_formulations_")
            ksp.setFromOptions()
        self.linear = Factorisation(ksp, self.matrix, symmetric=False)

    def assemble(self) -> None:
        """Tangent at the current unknowns."""
        self.matrix.zeroEntries()
        petsc.assemble_matrix(self.matrix, self.shell.tangent, bcs=self.shell.conditions)
        self.matrix.assemble()

    def improve(self) -> float:
        """Do one iteration; largest change of a displacement."""
        self.assemble()
        self.linear.factor()
        with self._residual.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self._residual, self.shell.residual)
        petsc.set_bc(self._residual, self.shell.conditions)
        self.linear.solve(self._residual, self._step)
        self.shell.unknown.x.array[:] -= self._step.array
        return float(np.abs(self._step.array[self.shell.displacements]).max())

    def solve(self, steps: int) -> int | None:
        """Iterations from rest to the full load in equal steps, None where one failed."""
        self.shell.unknown.x.array[:] = 0.0
        count = 0
        for step in range(1, steps + 1):
            self.shell.factor.value = step / steps
            for _ in range(ITERATIONS):
                count += 1
                change = self.improve()
                if not CLOSE < change < LOST:
                    break
            if not change <= CLOSE:
                return None
        return count


def other(problem: ShellProblem, name: str, repeats: int) -> Found:
    """Solve with one of the other shells."""
    shell = SHELLS[name](Strip.of(problem))
    newton = Newton(shell)
    dofs = len(shell.unknown.x.array)
    for steps in LOAD_STEPS:
        iterations = newton.solve(steps)
        if iterations:
            break
    else:
        return Found(dofs, failure=f"diverges in {steps} load steps")
    watch = Stopwatch(MPI.COMM_SELF)
    for _ in range(repeats + 1):
        with watch.stage("tangent ms"):
            newton.assemble()
        with watch.stage("factor ms"):
            newton.linear.factor()
    costs = {stage: 1e3 * run.cpu for stage, run in watch.best().items()}
    u, _, w = shell.tip()
    tip = {"minus_Ux_tip": -u, "Uz_tip": w}
    return Found(dofs, tip, {"steps": steps, "iterations": iterations, **costs})


def twin(problem: ShellProblem, repeats: int) -> Found:
    """Solve with the package's fem model."""
    try:
        result = problem.solve()
    except SolveError as error:
        return Found(build(problem.scene).num_unknowns, failure=str(error))
    count = sum(step.iterations for step in result.steps)
    costs = twin_costs(result.model, repeats)
    effort = {"steps": len(result.steps), "iterations": count, **costs}
    return Found(result.model.num_unknowns, result.history.rows[-1], effort)


def twin_costs(model: Model, repeats: int) -> dict[str, float]:
    """Milliseconds of tangent and factorisation in the model's current state."""
    watch, solver = Stopwatch(MPI.COMM_SELF), NewtonSolver(model.problem)
    for _ in range(repeats + 1):
        iterate(model, solver, watch)
    times = watch.best()
    tangent = sum(times[stage].cpu for stage in ("kernels", "insertion", "constraints"))
    return {"tangent ms": 1e3 * tangent, "factor ms": 1e3 * times["factor"].cpu}


@contextmanager
def empty_cache() -> Iterator[None]:
    """Let dolfinx compile all forms of the block anew."""
    kept = jit.DOLFINX_DEFAULT_JIT_OPTIONS["cache_dir"]
    with tempfile.TemporaryDirectory() as folder:
        jit.DOLFINX_DEFAULT_JIT_OPTIONS["cache_dir"] = (folder, kept[1])
        try:
            yield
        finally:
            jit.DOLFINX_DEFAULT_JIT_OPTIONS["cache_dir"] = kept


def seconds(make: Callable[[], object]) -> float:
    """Processor seconds of a call, those of the compilers that it starts included."""
    begin = sum(os.times()[:4])
    make()
    return sum(os.times()[:4]) - begin


def compile_seconds(name: str) -> float:
    """Seconds by which a formulation's set-up takes longer with an empty cache."""
    problem = cantilever(1, MESHES[0], THINNESS[0])

    def make() -> object:
        return build(problem.scene) if name == TWIN else SHELLS[name](Strip.of(problem))

    make()
    with empty_cache():
        cold = seconds(make)
    return cold - seconds(make)


def cantilever(n: int, structure: str, thinness: float) -> ShellProblem:
    """The problem, n segments across."""
    form = Form(structure, model="fem", comm=MPI.COMM_SELF)
    return cantilever_shear(n, form, slenderness=thinness)


def measure(name: str, structure: str, n: int, thinness: float, repeats: int) -> dict[str, object]:
    """One row of the table."""
    problem = cantilever(n, structure, thinness)
    found = twin(problem, repeats) if name == TWIN else other(problem, name, repeats)
    exact, tip = problem.exact(1.0), found.tip
    errors = {name: 100 * (tip[at] / exact[at] - 1) if tip else None for name, at in ERRORS.items()}
    return {
        "formulation": name,
        "mesh": structure,
        "n": n,
        "h/L": thinness,
        "triangles": problem.scene.sheet.num_cells_global,
        "dofs": found.dofs,
        **errors,
        **dict.fromkeys(EFFORT),
        **found.effort,
        "failure": found.failure,
    }


class Results(Table):
    """Table with a dash where there is no figure."""

    def add(self, **row: object) -> None:
        """Print and keep a row."""
        self.rows.append(row)
        cells = []
        for name, form in self.columns:
            value, form = ("-", "") if row[name] is None else (row[name], form)
            cells.append(f"{value:>{self._width(name)}{form}}")
        self._print("  ".join(cells).rstrip())


def parse(arguments: list[str] | None = None) -> Namespace:
    """Command line."""
    result = parser(__doc__.splitlines()[0])
    for name, choices in (("formulation", FORMULATIONS), ("mesh", MESHES)):
        result.add_argument(f"--{name}", nargs="+", choices=choices, default=choices)
    result.add_argument("--n", nargs="+", type=int, help="segments across (default 1 2 4)")
    result.add_argument("--thinness", nargs="+", type=float, help="h / L (default 1e-2 1e-3 1e-4)")
    options = result.parse_args(arguments)
    options.n = options.n or (ACROSS[:2] if options.quick else ACROSS)
    options.thinness = options.thinness or (THINNESS[:1] if options.quick else THINNESS)
    return options


def main() -> None:
    """Run all cases, formulation by formulation."""
    options = parse()
    if MPI.COMM_WORLD.size > 1:
        raise SystemExit("fem_formulations runs on one rank")
    table = Results(MPI.COMM_WORLD, "fem_formulations", COLUMNS)
    for name in options.formulation:
        took = None if options.quick else compile_seconds(name)
        for case in product(options.mesh, options.n, options.thinness):
            table.add(**measure(name, *case, options.repeats), **{"compile s": took})
    table.write(options.output)


if __name__ == "__main__":
    main()
