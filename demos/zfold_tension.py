"""Z-fold in tension: two panels that meet in an elastic crease are pulled apart.

Two unit panels of thickness h include 35.6 deg at rest. One outer edge is held, the other moves by
d1 along x; both may turn. The crease has the stiffness K_r = eta E h^3 / W per unit length, so that
a soft crease (small eta) opens like a hinge between flat panels, and a stiff one keeps its angle
while the panels bend. For nu = 0 each panel is exactly a planar elastica, which judges the result:
fold angle within 0.1 deg, pull within 1 %.

Without --eta and --d1 the whole study runs; one value of each computes that case alone, with the
first bending form and Poisson's ratio unless they are given. The fem model has one bending form of
its own and takes triangles five times as long.

    ./run demo zfold_tension
    ./run demo zfold_tension --eta 0.5 --d1 1.0
    ./run demo zfold_tension -n 2 --bending averaged
    ./run demo zfold_tension --model fem
"""

from mpi4py import MPI

import numpy as np
from _zfold_figures import Study, draw_all

from ufl_origami.analytic import ZFold
from ufl_origami.demo import fail_together, print_table, read_options, write_summary
from ufl_origami.errors import InputError
from ufl_origami.gallery import z_fold
from ufl_origami.gather import gather_fold_angles, gather_profile, gather_sheet
from ufl_origami.material import Material
from ufl_origami.meshing import mesh_pattern
from ufl_origami.run import solve_static
from ufl_origami.scene import Scene

# %% Parameters
W, E = 1.0, 1e7  # width of a panel and length of the crease; Young's modulus
PROFILE_ETA = (0.01, 0.5, 100.0)  # low, middle and high crease stiffness, of which profiles show
FEATURED_D1 = 1.0  # opening in the chart of all models, in the picture and in the convergence
SIZES = {"ddg": 0.042, "fem": 0.2}  # of the triangles over W, by default
CONVERGENCE_SIZES = {"ddg": (0.24, 0.12, 0.06, 0.03), "fem": (1.0, 0.5, 0.35, 0.25)}
ANGLE_TOLERANCE, FORCE_TOLERANCE = 0.1, 0.01  # of the claim: degrees, relative

comm = MPI.COMM_WORLD
fail_together(comm)
options = read_options(
    "zfold_tension",
    __doc__,
    {
        "model": "ddg",
        "bending": ("director", "averaged"),
        "eta": (1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2, 0.5, 1.0, 3.0, 10.0, 30.0, 100.0),
        "d1": (0.5, 1.0, 1.2),
        "nu": (0.0, 0.3),
        "h": 0.01,
        "size": SIZES["ddg"],
        "mesh": "unstructured",
    },
    quick={"eta": (0.5,), "d1": (1.0,)},
    comm=comm,
)
if options.model != "ddg" and "bending" in options.given:
    raise InputError("--bending is a choice of the ddg model")
if "size" not in options.given:
    options.size = SIZES[options.model]
etas, openings = sorted(set(options.eta)), sorted(set(options.d1))
single = len(etas) == len(openings) == 1
forms = options.bending if options.model == "ddg" else (None,)  # None: the model's only one
variants = [(bending, nu) for nu in dict.fromkeys(options.nu) for bending in forms]
variants = variants[:1] if single else variants


def nearest(values, wanted):
    """The value whose ratio to the wanted one is closest to 1."""
    return min(values, key=lambda value: abs(np.log(max(value, 1e-12) / wanted)))


profile_etas = sorted({nearest(etas, eta) for eta in PROFILE_ETA})
featured_eta, featured_d1 = nearest(etas, PROFILE_ETA[1]), nearest(openings, FEATURED_D1)


# %% Model: the sheet, its crease, and what is done to its outer edges
def build_scene(sheet, bending, nu, eta):
    """The Z-fold whose load factor is the opening d1."""
    material = Material(E, nu, options.h * W)
    form = {"bending": bending} if bending else {}
    scene = Scene(sheet, material, model=options.model, **form)
    scene.crease("crease", eta * E * (options.h * W) ** 3 / W)
    scene.fix("left_edge")
    scene.move("right_edge", x=1.0, y=0.0, z=0.0)
    return scene


def elastica(eta):
    """The exact fold for nu = 0: EI = E h^3 / 12 per unit length of the crease."""
    return ZFold.from_eta(eta, stiffness=E * (options.h * W) ** 3 / 12, width=W)


def case_folder(bending, nu, eta):
    """Folder of one path's history and fields."""
    return options.output / f"{bending or options.model}_nu{nu:g}_eta{eta:g}"


# %% Solution: one path per crease stiffness, through all openings
def pull(sheet, bending, nu, eta, stops=openings, *, size=options.size, output=None):
    """Pull the fold through the stops: one run each, for summary.json, with what figures need."""
    runs, shapes, done = [], {}, []

    def on_accept(step, model):
        done.append(step)
        if len(runs) == len(stops) or not np.isclose(step.time, stops[len(runs)], rtol=1e-12):
            return
        d1 = stops[len(runs)]
        case = {"model": options.model, "bending": bending, "eta": eta, "d1": d1, "nu": nu}
        case |= {"h": options.h, "size": size}
        runs.append(case | measure(model, done) | exact(nu, eta, d1))
        shapes[d1] = gather_profile(model, "front"), gather_sheet(model)

    solve_static(build_scene(sheet, bending, nu, eta), stops, output=output, on_accept=on_accept)
    return runs, shapes


def measure(model, steps):
    """What one run reports of the current state."""
    angles = gather_fold_angles(model, "crease")
    included = 180 - np.degrees(np.abs(angles.virtual))
    energies = model.energies()
    return {
        "triangles": model.sheet.num_cells_global,
        "dofs": model.num_unknowns,
        "fold_angle_deg": float(np.average(included, weights=angles.length)),
        "fold_angle_mid_deg": float(np.interp(0.5 * W, angles.middle[:, 1], included)),
        "force": float(model.reaction("right_edge")[0]),
        "energy": sum(energies.values()),
        **{f"energy_{kind}": energies[kind] for kind in ("membrane", "bending", "crease")},
        "newton_iterations": sum(step.iterations for step in steps),
        "seconds": sum(step.seconds for step in steps),
    }


def exact(nu, eta, d1):
    """The elastica's answer where there is one: nu = 0, panels not yet taut."""
    if nu != 0 or d1 >= elastica(eta).taut_opening:
        return {}
    state = elastica(eta).solve(d1)
    return {
        "elastica_fold_angle_deg": state.included_angle_deg,
        "elastica_force": state.force * W,
    }


sheet = mesh_pattern(z_fold(W, W), options.size * W, structure=options.mesh, comm=comm)
runs, shapes = [], {}
for bending, nu in variants:
    for eta in etas:
        output = case_folder(bending, nu, eta) if eta in profile_etas else None
        found, shapes[bending, nu, eta] = pull(sheet, bending, nu, eta, output=output)
        runs += found
        if comm.rank == 0:
            text = f"{bending or options.model}, nu = {nu:g}, eta = {eta:g}: {len(found)} openings"
            print(f"{text}, {found[-1]['newton_iterations']} Newton iterations", flush=True)

# %% Convergence with the mesh size, in the whole study only
refined = []
if not options.quick and not {"eta", "d1"} & options.given and 0 in options.nu:
    for size in CONVERGENCE_SIZES[options.model]:
        mesh = mesh_pattern(z_fold(W, W), size * W, structure=options.mesh, comm=comm)
        for bending in forms:
            refined += pull(mesh, bending, 0.0, featured_eta, [featured_d1], size=size)[0]


# %% Results
def deviations(run):
    """Distance of a run from the elastica: degrees, relative force; empty where there is none."""
    if "elastica_force" not in run:
        return {}
    angle = run["fold_angle_deg"] - run["elastica_fold_angle_deg"]
    force = run["force"] / run["elastica_force"] - 1 if run["elastica_force"] else None
    return {"angle off": angle, "force off": force}


COLUMNS = {
    "eta": "g", "d1": "g", "fold_angle_deg": ".3f", "fold_angle_mid_deg": ".3f",
    "elastica_fold_angle_deg": ".3f", "angle off": "+.3f", "force": ".5g",
    "elastica_force": ".5g", "force off": "+.2%", "newton_iterations": "d", "seconds": ".1f",
}  # fmt: skip


def report():
    """Tables of all runs."""
    for bending, nu in variants:
        rows = [run for run in runs if (run["bending"], run["nu"]) == (bending, nu)]
        size = f"{rows[0]['triangles']} triangles, {rows[0]['dofs']} unknowns"
        print(f"\n{bending or options.model}, nu = {nu:g}, {size}")
        print_table([run | deviations(run) for run in rows], COLUMNS)
    if refined:
        print("\nconvergence with the size of the triangles")
        columns = {"bending": "s", "size": "g", "triangles": "d", **COLUMNS}
        print_table([run | deviations(run) for run in refined], columns)


if comm.rank == 0:
    report()
    write_summary(options.output, runs)
    draw_all(
        Study(
            folder=options.output,
            model=options.model,
            variants=variants,
            etas=etas,
            openings=openings,
            profile_etas=profile_etas,
            featured=(featured_eta, featured_d1),
            elastica=elastica,
            runs=runs,
            refined=refined,
            shapes=shapes,
        )
    )
    print(f"\nsummary.json and the figures are in {options.output},")
    print(f"histories and fields in its folders, such as {case_folder(*variants[0], featured_eta)}")


# %% The claim
def claimed(run):
    """Whether the agreement with the elastica is promised for a run."""
    form = run["bending"] in ("director", None) and options.mesh == "unstructured"
    thin, fine = 1e-3 <= run["h"] <= 0.01, run["size"] <= SIZES[options.model]
    known = "elastica_force" in run and run["d1"] <= 1.2 and 1e-3 <= run["eta"] <= 100
    return form and thin and fine and known


judged = [deviations(run) for run in runs + refined if claimed(run)]
if judged:
    angle = max(abs(d["angle off"]) for d in judged)
    force = max(abs(d["force off"]) for d in judged)
    name = "director" if options.model == "ddg" else options.model
    text = f"{name}, nu = 0: at most {angle:.3f} deg and {force:.2%} from the elastica"
    if comm.rank == 0:
        print(f"{text} ({len(judged)} runs)")
    assert angle < ANGLE_TOLERANCE and force < FORCE_TOLERANCE, f"the claim fails: {text}"
