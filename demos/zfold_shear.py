"""Z-fold in shear: from d1 = 1 on, the outer edge moves along the crease, and branches part.

Two unit panels of thickness 0.01 include 35.6 deg at rest. One outer edge is held, the other moves
by d1 = 1 along x and then by d2 along the crease; both may turn. The sheared fold has one symmetry,
the half-turn about z, which exchanges the ends A and B of the crease, and the meshes have it too.
Branches of equilibria are followed by arc length over d2, each state with its number of unstable
directions:

symmetric: what the fold does unperturbed; A and B are equally high.
broken: A and B differ; with crease stiffness it leaves the symmetric branch at its first
    bifurcation, without any it is reached by pushing the panels one up, one down while d2 < 0.004.
arched: without stiffness only, both panels pushed up; symmetric as well.

The runs differ in the crease stiffness eta = K_r W / (E h^3). Nudges that are let go at some d2
tell what selects the branch. Both models run unless --model names one.

    ./run demo zfold_shear
    ./run demo zfold_shear --model fem --eta 0.1 1 --d2 0.1 0.2
    ./run demo zfold_shear -n 2 --quick
"""

from dataclasses import replace

from mpi4py import MPI

from _zfold_shear_figures import draw_all
from _zfold_shear_paths import Case, onset, selection, with_stiffness, without_stiffness
from _zfold_shear_verdicts import account, find, judge, places, text

from ufl_origami.demo import fail_together, print_table, read_options, write_summary

# %% Parameters
SIZES = {"ddg": 0.08, "fem": 0.16}  # of the triangles over W, by default
QUICK_SIZES = {"ddg": 0.15, "fem": 0.35}
ONSET_ETAS = (0.01, 0.1, 1.0, 10.0, 100.0)  # of the chart of onsets, in the whole study only
NUDGES = ((0, 0), (1, -1), (-1, 1))  # up or down, left and right panel
LETTING_GO = (0.05, 0.15)  # shears before and beyond the onset
HEIGHT_TOLERANCE = 1e-6  # of equal heights, over W
APART = 0.05  # heights of A and B that differ, over W
MODEL_TOLERANCE = 0.03  # energies of the two models, relative

comm = MPI.COMM_WORLD
fail_together(comm)
options = read_options(
    "zfold_shear",
    __doc__,
    {
        "model": ("ddg", "fem"),
        "eta": (0.0, 0.5),
        "d2": (0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
        "nu": (0.3,),
        "size": SIZES["ddg"],
    },
    quick={"eta": (0.5,), "d2": (0.05, 0.12), "size": QUICK_SIZES["ddg"]},
    comm=comm,
)
sizes = QUICK_SIZES if options.quick else SIZES
stops = tuple(sorted(set(options.d2)))
sides = (1,) if options.quick else (1, -1)
whole = not options.quick and "eta" not in options.given


def size_of(model):
    """Size of the triangles: as given, or the model's own."""
    return options.size if "size" in options.given else sizes[model]


# %% Solution: all branches of each case
cases = [
    Case(model, eta, nu, size_of(model), stops, comm)
    for nu in dict.fromkeys(options.nu)
    for eta in sorted(set(options.eta))
    for model in options.model
]
found = {}
for case in cases:
    found[case] = (with_stiffness if case.eta > 0 else without_stiffness)(case, sides)
    if comm.rank == 0:
        done = ", ".join(f"{b.name} {len(b.rows)} states" for b in found[case])
        print(f"{case.model}, eta = {case.eta:g}, nu = {case.nu:g}: {done}", flush=True)

# %% What selects the branch, and where the symmetric one loses its stability
selected, onsets = [], {}
if not options.quick:
    for case in cases:
        if case.eta > 0:
            selected += selection(case, NUDGES, [s for s in LETTING_GO if s <= stops[-1]])
for case in cases:
    if case.eta > 0 and case.nu == options.nu[0]:
        parting = places(find(found[case], "symmetric"), "bifurcation")
        onsets[case.model, case.eta] = parting[0] if parting else None
if whole:
    for model in options.model:
        for eta in ONSET_ETAS:
            onsets[model, eta] = onset(replace(cases[0], model=model, eta=eta, size=size_of(model)))

# %% Results
runs = [run for branches in found.values() for branch in branches for run in branch.runs]
COLUMNS = {
    "model": "s", "eta": "g", "branch": "s", "side": "d", "d2": "g", "energy": ".5f", "z_a": ".5f",
    "z_b": ".5f", "force_x": ".4f", "force_y": ".4f", "unstable_directions": "d",
}  # fmt: skip
SELECTED = {
    "model": "s", "eta": "g", "push": "s", "until": "g", "difference": "+.4f", "energy": ".4f",
    "unstable_directions": "d",
}  # fmt: skip
verdicts = []
if comm.rank == 0:
    verdicts = [judge(branches) for branches in found.values()]
    print()
    print_table(runs, COLUMNS)
    ended = [b for branches in found.values() for b in branches if b.ended]
    for branch in ended:
        print(f"{branch.case.model}, eta = {branch.case.eta:g}: {branch.name} {branch.ended}")
    if selected:
        print("\nnudged (left and right panel) and let go: difference is z_a - z_b")
        print_table(selected, SELECTED)
    lines = [text(verdict) for verdict in verdicts] + account(verdicts, onsets)
    print("\n" + "\n".join(lines))
    write_summary(options.output, runs)
    (options.output / "findings.txt").write_text("\n".join(lines) + "\n")
    draw_all(options.output, found, onsets)
    print(f"\nsummary.json, findings.txt and the figures are in {options.output}")


# %% The claim
def claims():
    """What the demo promises on meshes that are fine enough."""
    for run in runs:
        gap = abs(run["z_a"] - run["z_b"])
        if run["branch"] == "broken":
            yield "broken heights differ", gap > APART or run["d2"] < 0.1
        else:
            yield "symmetric heights agree", gap < HEIGHT_TOLERANCE
    ends = {(r["model"], r["eta"], r["nu"], r["branch"]): r for r in runs if r["d2"] == stops[-1]}
    for (model, eta, nu, branch), run in ends.items():
        other = ends.get(("fem", eta, nu, branch))
        if model == "ddg" and other:
            off = abs(run["energy"] / other["energy"] - 1)
            yield "the models agree in energy", off < MODEL_TOLERANCE
        lower = ends.get((model, eta, nu, "broken"))
        if branch == "symmetric" and lower and stops[-1] >= 0.2:
            yield "the broken branch ends lower", lower["energy"] < run["energy"]
            yield "and is stable", lower["unstable_directions"] == 0


for claim, holds in claims():
    assert holds, f"the claim fails: {claim}"
