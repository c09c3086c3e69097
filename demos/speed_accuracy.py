"""Speed against accuracy: what each method and each integrator pays for a small error.

Z-fold, cantilever, slit annulus and pinched hemisphere are solved by each method on meshes from
coarse to fine, of both kinds, at thickness ratios from 1e-2 to 1e-4 where the reference allows it.
A vibration, a snap and an impact are followed in time by implicit Euler and BDF2, with fixed and
with adaptive steps from long to short. Each point counts errors, unknowns, steps, iterations and
seconds; charts, tables and the text that says who wins are made from the points.

    ./run demo speed_accuracy --quick
    ./run demo speed_accuracy --problem z_fold --method director averaged
    ./run demo speed_accuracy --problem vibration snap impact
    ./run demo speed_accuracy -n 2
"""

from dataclasses import asdict

from mpi4py import MPI

from _time_precision_figures import draw_time
from _time_precision_problems import TIME_PROBLEMS
from _time_precision_runs import FULL, TASTE, study
from _time_precision_text import judge_time, time_order, time_report
from _work_precision_figures import draw_all
from _work_precision_problems import METHODS, PROBLEMS
from _work_precision_runs import REPEATS, Choice, choose, measure, settings, thinner
from _work_precision_text import report

from ufl_origami.demo import fail_together, print_table, read_options, write_summary
from ufl_origami.sheet import known_name
from ufl_origami.work_precision import TimePoint, picked, write_points, write_time_points

# %% Parameters
comm = MPI.COMM_WORLD
fail_together(comm)
names = tuple(problem.name for problem in (*PROBLEMS, *TIME_PROBLEMS))
options = read_options(
    "speed_accuracy",
    __doc__,
    {"problem": names, "method": tuple(method.name for method in METHODS)},
    quick={"problem": ("z_fold", *(problem.name for problem in TIME_PROBLEMS))},
    comm=comm,
)
for name in options.problem:
    known_name(name, names, "problem")
for name in options.method:
    known_name(name, [method.name for method in METHODS], "method")
problems = [problem for problem in PROBLEMS if problem.name in options.problem]
methods = [method for method in METHODS if method.name in options.method]
motions = [problem for problem in TIME_PROBLEMS if problem.name in options.problem]

COLUMNS = {
    "problem": "s", "thickness": "g", "mesh": "s", "method": "s", "n": "d", "triangles": "d",
    "dofs": "d", "factorisations": "d", "seconds": ".3f", "assembly_seconds": ".3f",
    "factorisation_seconds": ".3f", "error": ".3%", "failure": "s",
}  # fmt: skip
TIME_COLUMNS = {
    "problem": "s", "scheme": "s", "control": "s", "size": ".2e", "dofs": "d", "steps": "d",
    "newton_iterations": "d", "cuts": "d", "seconds": ".3f", "deviation": ".3%", "failure": "s",
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

# %% Points over meshes
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


# %% Points over time steps
def show(p: TimePoint) -> None:
    """Print a point."""
    if comm.rank == 0:
        what = f"{p.problem} {p.scheme} {p.control} {p.size:.2g}"
        print(f"{what}: {p.error():.3%} in {p.seconds:.3f} s {p.failure}", flush=True)


in_time, references = [], []
for motion in motions:
    sweep = (TASTE if options.quick else FULL)[motion.name]
    found, reference = study(motion, sweep, comm, show)
    in_time += found
    references.append(reference)
    if comm.rank == 0:
        write_time_points(options.output / "time_precision.csv", in_time)

# %% Results
if comm.rank == 0:
    texts = []
    if points:
        print()
        print_table([asdict(point) | {"error": point.error()} for point in points], COLUMNS)
        texts.append(report(points, choices, thin, comm.size))
        draw_all(points, options.output)
    if in_time:
        print()
        print_table([asdict(point) for point in in_time], TIME_COLUMNS)
        texts.append(time_report(in_time, references, comm.size))
        draw_time(in_time, options.output)
    text = "\n".join(texts)
    write_summary(options.output, [asdict(point) for point in (*points, *in_time)])
    (options.output / "speed_accuracy.md").write_text(text, encoding="ascii")
    print(f"\n{text}")
    print(f"charts, tables (CSV), speed_accuracy.md and summary.json are in {options.output}")

# %% The claim: on any mesh of the Z-fold directors converge, and beat averaged normals
for mesh, thickness in dict.fromkeys((p.mesh, p.thickness) for p in points):
    fold = picked(points, problem="z_fold", mesh=mesh, thickness=thickness)
    director, averaged = (picked(fold, method=name) for name in ("director", "averaged"))
    if director:
        assert director[-1].error() < 0.3 * director[0].error(), f"director, {mesh}, {thickness:g}"
    if director and averaged and mesh == "unstructured":
        assert director[-1].error() < averaged[-1].error(), f"averaged wins, {thickness:g}"

# %% The claim: in time BDF2 is of second order, implicit Euler of first, and loses at 1 %
for verdict in judge_time(in_time):
    if verdict.tolerance == 0.01:
        euler, bdf2 = verdict.best("implicit_euler"), verdict.best("bdf2")
        assert bdf2 < euler, f"implicit Euler wins, {verdict.problem.name}"
if any(motion.name == "vibration" for motion in motions):
    for scheme, expected in (("implicit_euler", 1.0), ("bdf2", 2.0)):
        order = time_order(in_time, "vibration", scheme)
        assert abs(order - expected) < 0.2, f"{scheme} has order {order:.2f}"
