"""Where methods fail: a declared grid of hard cases, solved and judged by exact solutions.

Each method (discretisation) meets each difficulty with each solver, one difficulty at a time from
a base case, and two declared pairs of difficulties; then difficulties in time with each way to
step, and paths with limit points with each way to lead. A case ends right, wrong (a solution
further than the bound from the exact answer) or failed (none was found). A wrong answer of which
no warning told is the worst kind: failure_map.md lists all of them.

    ./run demo failure_map
    ./run demo failure_map --quick
    ./run demo failure_map --problem impact block skid corner
    ./run demo failure_map --problem truss roof "thin roof"
    ./run demo failure_map -n 2

newton is plain Newton and bt a line search, both with equal load steps and no cuts; default is the
package's own solver in the same steps; auto is the package's own solver with automatic steps, as
solve_static has them, of which only the first one is declared. In time, euler and bdf2 take equal
steps; auto is BDF2 with the automatic steps of solve_dynamic, of which dt is the first one. Past
limit points, newton and bt raise the load in equal steps, load and place are the package's own
solver led by the load or by the place where it acts, arc is follow_path.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

from mpi4py import MPI

import _impact_grid as in_time
import _snap_runs as on_path
from _failure_cases import PROBLEMS, Method, Setting, Sheets
from _failure_figures import draw_all
from _failure_meshes import mesh_kinds
from _failure_runs import Outcome, Solver, run_case
from _failure_text import Rows, Study, describe, flat_rows, write_csv, write_text
from _impact_cases import PROBLEMS as THROWS
from _impact_runs import run_throw
from _snap_cases import PROBLEMS as SNAPS

from ufl_origami.demo import fail_together, read_options, write_summary
from ufl_origami.sheet import known_name

# %% The declared grid
BOUND = 0.03  # error above which a solution is a wrong answer
CLAIMED_ANGLE = 200.0  # degrees to which the claim at the end goes
EXPLAINED = (
    f"An equilibrium is wrong when its error is above {BOUND:.0%} (tip of the cantilever; pull and "
    "fold angle of the z-fold; angle, crease and tip of a closed fold)."
)
BASE = Setting()
FOLD = Setting("z-fold")
METHODS = (
    Method("averaged", "ddg", "averaged"),
    Method("director", "ddg", "director"),
    Method("fem", "fem", plate=(10, 4), pulled=4, closed=4),
)
SOLVERS = (
    Solver("newton", "newton"),
    Solver("bt", "bt"),
    Solver("default", "default"),
    Solver("auto", "default", cuts=True),
)
WHOLE = {
    "mesh": mesh_kinds((10, 5, 2)),
    "h": (1e-1, 1e-2, 1e-3, 1e-4, 1e-5),
    "eta": (1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6),
    "steps": (1, 4, 16),
    "angle": (90.0, 175.0, 200.0, 300.0),
}
QUICK = {
    "mesh": ("one-diagonal", "criss-cross", "Delaunay", "slivers 2 deg"),
    "h": (1e-2, 1e-4),
    "eta": (1e-6, 1.0),
    "steps": (4,),
    "angle": (200.0,),
    "mesh of pairs": ("criss-cross", "Delaunay"),
    "eta of pairs": (1e-6,),
}
CLOSINGS = ("rest angle", "moment", "edge")


def vary(base, name, values):
    """Label -> setting of one difficulty."""
    unit = " deg" if name == "angle" else ""
    return {
        value if name == "mesh" else f"{value:g}{unit}": replace(base, **{name: value})
        for value in values[name]
    }


def declare(values):
    """Groups of rows, title -> label -> setting; the pairs, title -> label -> label -> setting."""
    base = f"h/L = {BASE.h:g}, {BASE.steps} steps"
    groups = {
        f"cantilever, {base}: kind of mesh": vary(BASE, "mesh", values),
        f"cantilever, {BASE.mesh}, {BASE.steps} steps: h/L": vary(BASE, "h", values),
        f"cantilever, {BASE.mesh}, h/L = {BASE.h:g}: steps": vary(BASE, "steps", values),
        f"z-fold, h/W = {FOLD.h:g}, {FOLD.steps} steps: eta": vary(FOLD, "eta", values),
        f"z-fold, h/W = {FOLD.h:g}, eta = {FOLD.eta:g}: steps": vary(FOLD, "steps", values),
    }
    for by in CLOSINGS:
        closing = Setting(f"closed by {by}")
        title = f"flat fold, h/W = {closing.h:g}, {closing.steps} steps: closed by {by} to"
        groups[title] = vary(closing, "angle", values)
    pairs = {}
    for title, start, name in (("cantilever", BASE, "mesh"), ("z-fold", FOLD, "eta")):
        paired = {name: values.get(f"{name} of pairs", values[name])}
        rows = {label: vary(one, "h", values) for label, one in vary(start, name, paired).items()}
        pairs[f"{title}: {name} and h"] = rows
    return groups, pairs


def in_short(setting, method, solver):
    """Whether a case is in the short grid: all solvers meet the plate's single difficulties."""
    single = setting.mesh == BASE.mesh or setting.h == BASE.h
    every = single and setting.problem == "cantilever" and method.model == "ddg"
    return every or solver.name == "auto"


# %% Solution
comm = MPI.COMM_WORLD
fail_together(comm)
names = (*PROBLEMS, *THROWS, *SNAPS)
options = read_options("failure_map", __doc__, {"problem": names}, quick={}, comm=comm)
for name in options.problem:
    known_name(name, names, "problem")


def chosen(tables):
    """The tables of rows or of pairs whose problem was asked for."""
    return {title: rows for title, rows in tables.items() if first(rows) in options.problem}


def first(rows) -> str:
    """Problem of the first setting of a table."""
    row = next(iter(rows.values()))
    return first(row) if isinstance(row, dict) else row.problem


groups, pairs = map(chosen, declare(QUICK if options.quick else WHOLE))
throws = chosen(in_time.declare(in_time.QUICK if options.quick else in_time.WHOLE))
snaps = chosen(on_path.declare(on_path.QUICK if options.quick else on_path.WHOLE))
sheets = Sheets(comm, coarser=2 if options.quick else 1)


def solve(tables: Mapping[str, Rows], methods, solvers, run: Callable, in_short: Callable) -> dict:
    """Outcomes of all cases of some tables, or of those in the short grid."""
    outcomes: dict[tuple, Outcome] = {}
    for title, rows in tables.items():
        found = [
            run(setting, method, solver)
            for setting in dict.fromkeys(rows.values())
            for method in methods
            for solver in solvers
            if (setting, method.name, solver.name) not in outcomes
            and (in_short(setting, method, solver) or not options.quick)
        ]
        outcomes |= {(one.setting, one.method, one.solver): one for one in found}
        if found and comm.rank == 0:
            seconds = sum(one.seconds for one in found)
            print(f"{title}: {len(found)} cases in {seconds:.0f} s", flush=True)
    return outcomes


tables = {**groups, **{f"{t}, {k}": row for t, pair in pairs.items() for k, row in pair.items()}}
statics = Study(
    name="failure_map",
    title="Where methods fail",
    explained=EXPLAINED,
    methods=[method.name for method in METHODS],
    solvers=[solver.name for solver in SOLVERS],
    own=("default", "auto"),
    groups=groups,
    pairs=pairs,
    outcomes=solve(
        tables, METHODS, SOLVERS, lambda *case: run_case(*case, sheets, BOUND), in_short
    ),
    number=lambda outcome: str(outcome.iterations),
    numbers="Newton iterations",
)
dynamics = Study(
    name="failure_map_time",
    title="Where methods fail in time",
    explained=in_time.EXPLAINED,
    methods=[method.name for method in in_time.METHODS],
    solvers=[way.name for way in in_time.WAYS],
    own=in_time.OWN,
    groups=throws,
    pairs={},
    outcomes=solve(
        throws,
        in_time.METHODS,
        in_time.WAYS,
        lambda *case: run_throw(*case, comm, in_time.BOUND),
        in_time.in_short,
    ),
    number=lambda outcome: "" if outcome.error is None else f"{100 * outcome.error:.1f}",
    numbers="error in per cent; T: the contact's time, of a block that of its slide",
    columns=2,
)

paths = Study(
    name="failure_map_path",
    title="Which way gets past which limit point",
    explained=on_path.EXPLAINED,
    methods=[method.name for method in on_path.METHODS],
    solvers=[lead.name for lead in on_path.LEADS],
    own=on_path.OWN,
    groups=snaps,
    pairs={},
    outcomes=solve(
        snaps,
        on_path.METHODS,
        on_path.LEADS,
        lambda *case: on_path.run_snap(*case, comm),
        on_path.in_short,
    ),
    number=lambda outcome: f"{outcome.measured['limit_points']}/{outcome.measured['of']}",
    numbers="limit points found, of those there are",
)

# %% Results
studies = [study for study in (statics, dynamics, paths) if study.outcomes]
if comm.rank == 0:
    rows = flat_rows(studies)
    write_summary(options.output, rows)
    write_csv(options.output, rows)
    print("\n" + write_text(options.output, studies))
    draw_all(options.output, studies)
    print(f"\nfailure_map.md, failure_map.csv, summary.json and the maps are in {options.output}")

# %% The claims
singles = {setting for setting in statics.singles() if setting.angle <= CLAIMED_ANGLE}
claimed = [one for one in statics.picked("director", "auto") if one.setting in singles]
missed = [describe(one.setting) for one in claimed if one.verdict != "right"]
thrown = [one for method in in_time.METHODS for one in dynamics.picked(method.name, "auto")]
failed = [one for one in thrown if one.verdict == "failed" and in_time.names_barrier(one)]
lost = [describe(one.setting) for one in thrown if one.verdict != "right" and one not in failed]
gaps = [one.measured["min_gap"] for one in dynamics.outcomes.values()]
through = sum(gap is not None and gap <= 0 for gap in gaps)
if statics.outcomes and comm.rank == 0:
    text = f"director, auto: {len(claimed) - len(missed)} of {len(claimed)} single difficulties"
    print(f"{text} (folds closed to at most {CLAIMED_ANGLE:g} deg) end right")
if dynamics.outcomes and comm.rank == 0:
    text = f"in time, auto: {len(thrown) - len(failed) - len(lost)} of {len(thrown)} single"
    text += f" difficulties end right, {len(failed)} fail and name the barrier"
    print(f"{text}; {through} of all sheets go through the floor")
arcs = [one for method in on_path.METHODS for one in paths.picked(method.name, "arc")]
short = [describe(one.setting) for one in arcs if not on_path.passed(one)]
hidden = [describe(one.setting) for one in paths.outcomes.values() if on_path.hidden(one)]
if paths.outcomes and comm.rank == 0:
    text = f"by arc length: {len(arcs) - len(short)} of {len(arcs)} paths end right with all their"
    print(f"{text} limit points; {len(hidden)} ways jumped past one without a word")
assert not missed, f"the claim fails: {missed}"
assert not lost, f"the claim in time fails: {lost}"
assert not through, f"{through} sheets went through the floor"
assert not short, f"the claim about arc length fails: {short}"
assert not hidden, f"jumps without a warning: {hidden}"
