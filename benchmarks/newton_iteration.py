"""Shares of assembly, factorisation and the rest in one Newton iteration, against mesh size.

Assembly: residual, and kernels and insertion of the tangent. Factorisation: MUMPS with its count of
negative pivots; the analysis of the first one is left out (column "analysis s" has it). The rest:
constraints, triangular solves. Target: assembly under 25 % at 1e5 unknowns.

    ./run python3 benchmarks/newton_iteration.py [--quick] [--output FILE]
    ./run mpirun -n 2 python3 benchmarks/newton_iteration.py
"""

from mpi4py import MPI

from _record import Stopwatch, Table, Timing, parser, peak_memory
from assembly import plate

from ufl_origami.model import Model
from ufl_origami.solvers.newton import NewtonSolver
from ufl_origami.stencils import BENDING_FORMS

UNKNOWNS = (10_000, 100_000, 300_000)
QUICK = (10_000,)
PER_TRIANGLE = {"averaged": 1.5, "director": 3.0}
PARTS = {
    "assembly": ("residual", "kernels", "insertion"),
    "factor": ("factor",),
    "rest": ("constraints", "solve"),
}
COLUMNS = (
    ("bending", ""),
    ("triangles", "d"),
    ("dofs", "d"),
    ("iteration s", ".3f"),
    ("assembly %", ".1f"),
    ("factor %", ".1f"),
    ("rest %", ".1f"),
    ("cpu s", ".3f"),
    ("assembly cpu %", ".1f"),
    ("analysis s", ".2f"),
    ("peak GB", ".2f"),
)


def iterate(model: Model, solver: NewtonSolver, watch: Stopwatch) -> None:
    """Do one Newton iteration from the rest state, stage by stage.

    Raises:
        RuntimeError: the tangent is not positive definite, so that it was factored repeatedly.
    """
    problem, x = model.problem, model.x
    residual, step = x.duplicate(), x.duplicate()
    with watch.stage("residual"):
        problem.residual(x, residual)
    with watch.stage("kernels"):
        problem.linearise(x, x)
        state = problem.state(x)
        problem.tangent.evaluate(state)
    with watch.stage("insertion"):
        matrix = problem.tangent.insert(state)
    with watch.stage("constraints"):
        problem.constrain(matrix, None, None)
    with watch.stage("factor"):
        negative = solver.factor(solver.linear.ksp)
    if negative:
        raise RuntimeError(f"{negative} negative pivots at the rest state")
    with watch.stage("solve"):
        solver.linear.solve(residual, step)


def measure(unknowns: int, bending: str, repeats: int) -> dict[str, object]:
    """One row of the table."""
    watch = Stopwatch(MPI.COMM_WORLD)
    model = plate(round(unknowns / PER_TRIANGLE[bending]), bending)
    solver = NewtonSolver(model.problem)
    for _ in range(repeats + 1):
        iterate(model, solver, watch)
    times = watch.best()
    parts = {p: sum((times[s] for s in stages), Timing(0, 0)) for p, stages in PARTS.items()}
    total = sum(parts.values(), Timing(0, 0))
    return {
        "bending": bending,
        "triangles": model.sheet.num_cells_global,
        "dofs": model.num_unknowns,
        "iteration s": total.wall,
        "cpu s": total.cpu,
        **{f"{part} %": 100 * timing.wall / total.wall for part, timing in parts.items()},
        **{f"{part} cpu %": 100 * timing.cpu / total.cpu for part, timing in parts.items()},
        **{f"{stage} s": timing.wall for stage, timing in times.items()},
        "analysis s": watch.first("factor").wall - times["factor"].wall,
        "peak GB": peak_memory(watch.comm),
    }


def main() -> None:
    """Run all sizes, small ones first: the memory shown is the largest so far."""
    arguments = parser(__doc__.splitlines()[0]).parse_args()
    table = Table(MPI.COMM_WORLD, "newton_iteration", COLUMNS)
    for unknowns in QUICK if arguments.quick else UNKNOWNS:
        for bending in reversed(BENDING_FORMS):
            table.add(**measure(unknowns, bending, arguments.repeats))
    table.write(arguments.output)


if __name__ == "__main__":
    main()
