"""Accuracy of the shell on published benchmark problems: prints a table, writes JSON.

Errors are in percent, the largest over the columns and the load factors 1/4, 1/2, 3/4, 1: against
the exact elastica or circle for the cantilevers (of the length for the rolled-up one, whose
deflection returns to zero), against the Kirchhoff-Love tables and those of Sze, Liu & Lo 2004
(doi:10.1016/j.finel.2003.11.001) for the others. A method is a bending form of the ddg model or
the fem model, which takes coarser meshes. `sagitta/h` above 1 tells of membrane locking (ddg).

    ./run python3 benchmarks/shell_benchmarks.py --problem slit_annular_plate --output table.json
    ./run python3 benchmarks/shell_benchmarks.py --method director fem --mesh unstructured
"""

import argparse
import json
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

from mpi4py import MPI

import numpy as np
from _record import machine

from ufl_origami.analytic.reference_tables import read_table
from ufl_origami.errors import MeshWarning, SolveError
from ufl_origami.gallery import shell_problems as shells
from ufl_origami.quality import sagitta
from ufl_origami.run import StaticResult

REFERENCE = Path(__file__).parents[1] / "tests" / "reference"
STOPS = (0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class Problem:
    """A benchmark problem and the meshes of its convergence study.

    Attributes:
        make: the problem from the number of segments and the form.
        counts: model -> numbers of segments.
    """

    make: Callable
    counts: dict[str, tuple[int, ...]]


PROBLEMS = {
    "cantilever_end_shear": Problem(
        shells.cantilever_shear, {"ddg": (1, 2, 4, 8), "fem": (1, 2, 4)}
    ),
    "cantilever_end_moment": Problem(
        shells.cantilever_moment, {"ddg": (1, 2, 4, 8), "fem": (1, 2, 4)}
    ),
    "slit_annular_plate": Problem(
        shells.slit_annular_plate, {"ddg": (4, 8, 16, 24), "fem": (2, 4, 8)}
    ),
    "hemisphere_18deg_hole": Problem(
        shells.pinched_hemisphere, {"ddg": (8, 16, 32, 64), "fem": (4, 8, 16, 32)}
    ),
    "cylinder_open_end_pullout": Problem(
        shells.cylinder_pullout, {"ddg": (12, 24, 48, 72), "fem": (6, 12, 24)}
    ),
}
STRUCTURES = ("structured", "unstructured", "crisscross")
METHODS = {
    "director": {"model": "ddg", "bending": "director"},
    "averaged": {"model": "ddg", "bending": "averaged"},
    "fem": {"model": "fem"},
}


@dataclass
class Row:
    """One run; errors in percent by column of the tables, at the stops.

    Attributes:
        problem, mesh, n, method: what was run; n counts segments as the problem's function does.
        triangles, dofs, steps, iterations, factorisations, seconds: size and effort.
        unstable: accepted states with negative pivots.
        result: displacements at load factor 1.
        errors: reference ("exact", "kirchhoff_love", "sze") -> column -> errors.
        sagitta: sagitta over thickness in the last state of the ddg model, else None.
        failure: why the run stopped, or an empty string.
    """

    problem: str
    mesh: str
    n: int
    method: str
    triangles: int
    dofs: int
    steps: int = 0
    iterations: int = 0
    factorisations: int = 0
    seconds: float = 0.0
    unstable: int = 0
    result: dict[str, float] = field(default_factory=dict)
    errors: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    sagitta: float | None = None
    failure: str = ""

    def line(self) -> str:
        """The row of the printed table."""
        head = f"{self.problem:26}{self.mesh:13}{self.n:4}  {self.method:9}{self.triangles:7}"
        effort = f"{self.dofs:7}{self.steps:4}{self.iterations:5}{self.seconds:7.1f}"
        if self.failure:
            return f"{head}{effort}  {self.failure}"
        errors = "".join(
            f"{_largest(self.errors[name]):9.3f}" if name in self.errors else f"{'-':>9}"
            for name in ("exact", "kirchhoff_love", "sze")
        )
        result = "  ".join(f"{name} {value:.5g}" for name, value in self.result.items())
        sagitta = f"{'-':>9}" if self.sagitta is None else f"{self.sagitta:9.2f}"
        return f"{head}{effort}{errors}{sagitta}  {result}"


HEAD = (
    f"{'problem':26}{'mesh':13}{'n':>4}  {'method':9}{'tri':>7}{'dofs':>7}{'st':>4}{'its':>5}"
    f"{'s':>7}{'exact %':>9}{'K-L %':>9}{'Sze %':>9}{'sagit/h':>9}  at the largest load"
)


def _largest(errors: dict[str, list[float]]) -> float:
    return max(float(np.abs(values).max()) for values in errors.values())


def measure(name: str, mesh: str, n: int, method: str) -> Row:
    """Solve one problem on one mesh."""
    begin = time.perf_counter()
    problem = PROBLEMS[name].make(n, shells.Form(mesh, **METHODS[method]))
    row = Row(name, mesh, n, method, problem.scene.sheet.num_cells_global, 0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MeshWarning)
            result = problem.solve(STOPS)
    except SolveError as error:
        row.failure = str(error)
        return row
    row.seconds = time.perf_counter() - begin
    _fill(row, problem, result)
    return row


def _fill(row: Row, problem: shells.ShellProblem, result: StaticResult) -> None:
    steps, history = result.steps, result.history
    row.dofs, row.steps = result.model.num_unknowns, len(steps)
    row.iterations = sum(step.iterations for step in steps)
    row.factorisations = sum(step.factorisations for step in steps)
    row.unstable = sum(bool(step.negative_pivots) for step in steps)
    row.result = {name: float(history[name][-1]) for name in problem.measures}
    if METHODS[row.method]["model"] == "ddg":
        row.sagitta = sagitta(result.model)[0].value
    if problem.exact:
        row.errors["exact"] = _percent(problem.exact_errors(history, STOPS))
    for kind, stem in (("kirchhoff_love", "kirchhoff_love"), ("sze", "sze2004")):
        file = REFERENCE / f"{stem}_{row.problem}.csv"
        if file.exists() and not problem.exact:
            row.errors[kind] = _percent(problem.table_errors(history, read_table(file), STOPS))


def _percent(errors: dict[str, np.ndarray]) -> dict[str, list[float]]:
    return {name: (100 * values).tolist() for name, values in errors.items()}


def cases(options: argparse.Namespace) -> Iterator[tuple[str, str, int, str]]:
    """Problems, meshes, sizes and methods that were asked for."""
    for name in options.problem:
        for method in options.method:
            counts = PROBLEMS[name].counts[METHODS[method]["model"]]
            for mesh in options.mesh:
                for n in options.n or (counts[:2] if options.quick else counts):
                    yield name, mesh, n, method


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for name, choices in (("problem", PROBLEMS), ("mesh", STRUCTURES), ("method", METHODS)):
        every = list(choices)
        parser.add_argument(f"--{name}", nargs="+", choices=every, default=every)
    parser.add_argument("--n", nargs="+", type=int, help="segments (default: each problem's own)")
    parser.add_argument("--quick", action="store_true", help="the two coarsest meshes only")
    parser.add_argument("--output", type=Path, metavar="FILE", help="write JSON")
    return parser.parse_args(arguments)


def main() -> None:
    """Run the cases, print each as it is done."""
    options, rank = parse(), MPI.COMM_WORLD.rank
    rows = []
    if rank == 0:
        print(HEAD)
    for case in cases(options):
        rows.append(measure(*case))
        if rank == 0:
            print(rows[-1].line(), flush=True)
    if options.output and rank == 0:
        data = {
            "benchmark": "shell accuracy",
            "machine": machine(MPI.COMM_WORLD),
            "stops": STOPS,
            "rows": [asdict(row) for row in rows],
        }
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(json.dumps(data, indent=1) + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
