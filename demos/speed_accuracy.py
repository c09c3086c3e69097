"""Speed against accuracy: what each method pays for a small error.

Z-fold, cantilever, slit annulus and pinched hemisphere are solved by each method on meshes from
coarse to fine, of both kinds, at thickness ratios from 1e-2 to 1e-4 where the reference allows it.
Each point counts errors, unknowns, iterations and seconds; charts, tables and the text that says
who wins are made from the points.

    ./run demo speed_accuracy --quick
    ./run demo speed_accuracy --problem z_fold --method director averaged
    ./run demo speed_accuracy -n 2
"""

from dataclasses import asdict

from mpi4py import MPI

from _work_precision_figures import draw_all
from _work_precision_problems import METHODS, PROBLEMS
from _work_precision_runs import REPEATS, Choice, choose, measure, settings, thinner
from _work_precision_text import report

from ufl_origami.demo import fail_together, print_table, read_options, write_summary
from ufl_origami.sheet import known_name
from ufl_origami.work_precision import picked, write_points

# %% Parameters
comm = MPI.COMM_WORLD
fail_together(comm)
options = read_options(
    "speed_accuracy",
    __doc__,
    {
        "problem": tuple(problem.name for problem in PROBLEMS),
        "method": tuple(method.name for method in METHODS),
    },
    quick={"problem": ("z_fold",)},
    comm=comm,
)
for name in options.problem:
    known_name(name, [problem.name for problem in PROBLEMS], "problem")
for name in options.method:
    known_name(name, [method.name for method in METHODS], "method")
problems = [problem for problem in PROBLEMS if problem.name in options.problem]
methods = [method for method in METHODS if method.name in options.method]

COLUMNS = {
    "problem": "s", "thickness": "g", "mesh": "s", "method": "s", "n": "d", "triangles": "d",
    "dofs": "d", "factorisations": "d", "seconds": ".3f", "assembly_seconds": ".3f",
    "factorisation_seconds": ".3f", "error": ".3%", "failure": "s",
}  # fmt: skip

# %% Settings: each method's own for each problem, by a scan that also compiles all kernels
choices: dict[str, dict[str, Choice]] = {}
for problem in problems:
    choices[problem.name] = {}
    for method in methods:
        choice = choose(problem, method, comm, quick=options.quick)
        choices[problem.name][method.name] = choice
        if comm.rank == 0:
            chosen = f"step {choice.step:g} {choice.measure}"
            print(f"{problem.name}, {method.name}: {chosen}", flush=True)

# %% Points
points = []
for problem in problems:
    for setting in settings(problem, methods, comm, quick=options.quick):
        choice = choices[problem.name][setting.method.name]
        points.append(measure(problem, setting, choice, 1 if options.quick else REPEATS))
        if comm.rank == 0:
            p = points[-1]
            what = f"{p.problem} {p.thickness:g} {p.mesh} {p.method} n = {p.n}"
            print(f"{what}: {p.error():.3%} in {p.seconds:.3f} s {p.failure}", flush=True)
    if comm.rank == 0:
        write_points(options.output / "speed_accuracy.csv", points)

# %% Whether the tables serve other thicknesses
thin = {
    problem.name: thinner(problem, methods, choices[problem.name], comm)
    for problem in problems
    if not options.quick
}

# %% Results
if comm.rank == 0:
    print()
    print_table([asdict(point) | {"error": point.error()} for point in points], COLUMNS)
    write_summary(options.output, [asdict(point) for point in points])
    text = report(points, choices, thin, comm.size)
    (options.output / "speed_accuracy.md").write_text(text, encoding="ascii")
    draw_all(points, options.output)
    print(f"\n{text}")
    print(f"charts, speed_accuracy.csv, speed_accuracy.md and summary.json are in {options.output}")

# %% The claim: on any mesh of the Z-fold directors converge, and beat averaged normals
for mesh, thickness in dict.fromkeys((p.mesh, p.thickness) for p in points):
    fold = picked(points, problem="z_fold", mesh=mesh, thickness=thickness)
    director, averaged = (picked(fold, method=name) for name in ("director", "averaged"))
    if director:
        assert director[-1].error() < 0.3 * director[0].error(), f"director, {mesh}, {thickness:g}"
    if director and averaged and mesh == "unstructured":
        assert director[-1].error() < averaged[-1].error(), f"averaged wins, {thickness:g}"
