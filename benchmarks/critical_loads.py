"""Critical loads by the first change of inertia on a path: error against exact values, and effort.

Columns (N L^2 / EI), columns with a crease (N W^2 / EI), square plates (N b^2 / (pi^2 D)), and a
narrow cantilever that buckles sideways (F L^2 / sqrt(EI GJ)). Evaluations are tangents factored on
the path, those of the search included; seconds hold the whole path, and the best run counts.

    ./run python3 benchmarks/critical_loads.py --problem plate --model fem --output table.json
"""

import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from mpi4py import MPI

from _record import Table, parser

from ufl_origami.errors import MeshWarning
from ufl_origami.gallery import critical_loads as problems
from ufl_origami.gallery.critical_loads import Choice, CriticalProblem

COLUMNS = (
    ("problem", "s"),
    ("model", "s"),
    ("mesh", "s"),
    ("n", "d"),
    ("triangles", "d"),
    ("unknowns", "d"),
    ("critical load", ".4f"),
    ("error %", ".3f"),
    ("evaluations", "d"),
    ("seconds", ".2f"),
)
STRUCTURES = ("structured", "unstructured", "crisscross")


@dataclass(frozen=True)
class Family:
    """Problems of one kind and their meshes.

    Attributes:
        makes: functions from a choice to a problem.
        counts: model -> numbers of segments.
    """

    makes: tuple[Callable[[Choice], CriticalProblem], ...]
    counts: dict[str, tuple[int, ...]]


FAMILIES = {
    "column": Family(
        tuple(lambda choice, ends=ends: problems.column(ends, choice) for ends in problems.EULER),
        {"ddg": (1, 2, 4), "fem": (1, 2)},
    ),
    "crease": Family(
        tuple(
            lambda choice, eta=eta: problems.crease_column(eta, choice)
            for eta in (1e-3, 1e-2, 0.1, 1.0, 10.0)
        ),
        {"ddg": (4, 8, 16), "fem": (2, 4)},
    ),
    "plate": Family(
        tuple(lambda choice, key=key: problems.plate(*key, choice) for key in problems.PLATES),
        {"ddg": (8, 16, 32, 48), "fem": (4, 8, 16)},
    ),
    "blade": Family((problems.blade,), {"ddg": (1, 2, 4), "fem": (1, 2)}),
}


def measure(make: Callable, choice: Choice, repeats: int) -> dict[str, object]:
    """Solve one problem on one mesh, each run from a scene of its own."""
    seconds = []
    for _ in range(repeats):
        begin = time.perf_counter()
        problem = make(choice)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MeshWarning)
            event, path = problem.solve()
        seconds.append(time.perf_counter() - begin)
    return {
        "problem": problem.name,
        "model": choice.model,
        "mesh": choice.structure,
        "n": choice.n,
        "triangles": path.model.sheet.num_cells_global,
        "unknowns": path.model.num_unknowns,
        "exact": problem.exact,
        "critical load": event.load * problem.exact,
        "error %": 100 * (event.load - 1),
        "evaluations": sum(step.factorisations for step in path.steps),
        "seconds": choice.comm.allreduce(min(seconds), op=MPI.MAX),
    }


def cases(arguments) -> Iterator[tuple[Callable, Choice]]:
    """Problems and choices that were asked for."""
    for name in arguments.problem:
        family = FAMILIES[name]
        for make in family.makes:
            for model in arguments.model:
                counts = family.counts[model]
                for mesh in arguments.mesh:
                    for n in arguments.n or (counts[:1] if arguments.quick else counts):
                        yield make, Choice(model, n, mesh)


def main() -> None:
    """Run the cases, print each as it is done."""
    options = parser(__doc__.splitlines()[0])
    options.set_defaults(repeats=1)
    for name, choices in (("problem", FAMILIES), ("model", ("ddg", "fem"))):
        options.add_argument(f"--{name}", nargs="+", choices=choices, default=list(choices))
    options.add_argument("--mesh", nargs="+", choices=STRUCTURES, default=["unstructured"])
    options.add_argument("--n", nargs="+", type=int, help="segments (default: each problem's own)")
    arguments = options.parse_args()
    table = Table(MPI.COMM_WORLD, "critical loads", COLUMNS, {"problem": 26, "mesh": 12})
    for make, choice in cases(arguments):
        table.add(**measure(make, choice, arguments.repeats))
    table.write(arguments.output)


if __name__ == "__main__":
    main()
