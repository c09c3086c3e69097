"""Where methods fail: a declared grid of hard cases, solved and judged by exact solutions.

Each method (discretisation) meets each difficulty with each solver, one difficulty at a time from
a base case, and two declared pairs of difficulties. A case ends right, wrong (an equilibrium
further than the bound from the exact answer) or failed (no equilibrium found). A wrong answer of
which no warning told is the worst kind: failure_map.md lists all of them.

    ./run demo failure_map
    ./run demo failure_map --quick
    ./run demo failure_map -n 2

newton is plain Newton and bt a line search, both with equal load steps and no cuts; default is the
package's own solver in the same steps; auto is the package's own solver with automatic steps, as
solve_static has them, of which only the first one is declared.
"""

from dataclasses import replace

from mpi4py import MPI

from _failure_cases import Method, Setting, Sheets
from _failure_figures import draw_all
from _failure_meshes import mesh_kinds
from _failure_runs import Solver, run_case
from _failure_text import Study, describe, write_csv, write_text

from ufl_origami.demo import fail_together, read_options, write_summary

# %% The declared grid
BOUND = 0.03  # error above which an equilibrium is a wrong answer
CLAIMED_ANGLE = 200.0  # degrees to which the claim at the end goes
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
    "steps": (1, 4),
    "angle": (200.0,),
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
    pairs = {
        f"{title}: {name} and h": {
            label: vary(one, "h", values) for label, one in vary(start, name, values).items()
        }
        for title, start, name in (("cantilever", BASE, "mesh"), ("z-fold", FOLD, "eta"))
    }
    return groups, pairs


# %% Solution
comm = MPI.COMM_WORLD
fail_together(comm)
options = read_options("failure_map", __doc__, {}, quick={}, comm=comm)
groups, pairs = declare(QUICK if options.quick else WHOLE)
tables = {**groups, **{f"{t}, {k}": row for t, pair in pairs.items() for k, row in pair.items()}}
sheets, outcomes = Sheets(comm, coarser=2 if options.quick else 1), {}
for title, rows in tables.items():
    found = [
        run_case(setting, method, solver, sheets, BOUND)
        for setting in rows.values()
        for method in METHODS
        for solver in SOLVERS
        if (setting, method.name, solver.name) not in outcomes
    ]
    outcomes |= {(one.setting, one.method, one.solver): one for one in found}
    if found and comm.rank == 0:
        seconds = sum(one.seconds for one in found)
        print(f"{title}: {len(found)} cases in {seconds:.0f} s", flush=True)

# %% Results
study = Study(
    folder=options.output,
    bound=BOUND,
    methods=[method.name for method in METHODS],
    solvers=[solver.name for solver in SOLVERS],
    groups=groups,
    pairs=pairs,
    outcomes=outcomes,
)
if comm.rank == 0:
    write_summary(options.output, [one.row() for one in outcomes.values()])
    write_csv(study)
    print("\n" + write_text(study))
    draw_all(study)
    print(f"\nfailure_map.md, failure_map.csv, summary.json and the maps are in {options.output}")

# %% The claim
singles = {setting for rows in groups.values() for setting in rows.values()}
singles = {setting for setting in singles if setting.angle <= CLAIMED_ANGLE}
claimed = [one for one in study.picked("director", "auto") if one.setting in singles]
missed = [describe(one.setting) for one in claimed if one.verdict != "right"]
if comm.rank == 0:
    text = f"director, auto: {len(claimed) - len(missed)} of {len(claimed)} single difficulties"
    print(f"{text} (folds closed to at most {CLAIMED_ANGLE:g} deg) end right")
assert not missed, f"the claim fails: {missed}"
