"""Time of one tangent assembly per triangle and core, against mesh size, for both bending forms.

Kernels: hinge angles, tilts and their measure, membrane stress, then energy, gradient and Hessian
of each triangle. Insertion: MatSetValuesCOO of all blocks. Residual: gradient alone, with its
scatter. Targets on one core: 3 us for the kernels, 5 us with insertion.

    ./run python3 benchmarks/assembly.py [--quick] [--output FILE]
    ./run mpirun -n 2 python3 benchmarks/assembly.py
"""

import time

from mpi4py import MPI

import numpy as np
from _record import Stopwatch, Table, parser, peak_memory

from ufl_origami.discretise import build
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.model import Model
from ufl_origami.scene import Scene
from ufl_origami.stencils import BENDING_FORMS

TRIANGLES = (1_000, 10_000, 50_000, 100_000, 200_000)
QUICK = (1_000, 10_000)
COLUMNS = (
    ("bending", ""),
    ("triangles", "d"),
    ("dofs", "d"),
    ("kernels us", ".2f"),
    ("insertion us", ".2f"),
    ("sum us", ".2f"),
    ("residual us", ".2f"),
    ("sum cpu us", ".2f"),
    ("set-up s", ".2f"),
    ("peak GB", ".2f"),
)


def plate(triangles: int, bending: str) -> Model:
    """Clamped square plate of one-diagonal triangles."""
    side = max(1, round(np.sqrt(triangles / 2)))
    scene = Scene(rectangle(1.0, 1.0, side), Material(E=1e6, nu=0.3, h=0.01), bending=bending)
    scene.fix("x0")
    scene.clamp("x0")
    return build(scene)


def bend(model: Model) -> None:
    """Bend and stretch a plate unevenly."""
    x, y, _ = model.sheet.rest[: model.configuration.nv_owned].T
    shift = np.stack([0.02 * x * y, 0.03 * x**2, 0.2 * x**2 + 0.1 * np.sin(3 * y)], axis=1)
    model.x.array_w[: shift.size] = shift.ravel()


def measure(triangles: int, bending: str, repeats: int) -> dict[str, object]:
    """One row of the table."""
    watch = Stopwatch(MPI.COMM_WORLD)
    begin = time.perf_counter()
    model = plate(triangles, bending)
    setup = time.perf_counter() - begin
    bend(model)
    problem, state, out = model.problem, model.state, model.x.duplicate()
    for _ in range(repeats + 1):
        with watch.stage("kernels"):
            problem.linearise(None, model.x)
            problem.tangent.evaluate(state)
        with watch.stage("insertion"):
            problem.tangent.insert(state)
        with watch.stage("residual"):
            problem.forces(model.x, out)
    times = watch.best()
    times["sum"] = times["kernels"] + times["insertion"]
    scale = 1e6 * watch.comm.size / model.sheet.num_cells_global
    return {
        "bending": bending,
        "triangles": model.sheet.num_cells_global,
        "dofs": model.num_unknowns,
        **{f"{name} us": scale * timing.wall for name, timing in times.items()},
        **{f"{name} cpu us": scale * timing.cpu for name, timing in times.items()},
        "set-up s": setup,
        "peak GB": peak_memory(watch.comm),
    }


def main() -> None:
    """Run all sizes, small ones first: the memory shown is the largest so far."""
    arguments = parser(__doc__.splitlines()[0]).parse_args()
    table = Table(MPI.COMM_WORLD, "assembly", COLUMNS)
    for triangles in QUICK if arguments.quick else TRIANGLES:
        for bending in reversed(BENDING_FORMS):
            table.add(**measure(triangles, bending, arguments.repeats))
    table.write(arguments.output)


if __name__ == "__main__":
    main()
