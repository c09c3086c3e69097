"""Magnetic flap: a creased sheet in a field that turns, by both models.

Two panels meet in an elastic crease. One is clamped at its outer edge, the other one is
magnetised along its width, and a uniform field turns in the plane across the crease (the crease
may be thought upright: there is no weight). The field's torque over the crease's stiffness is 1.3
rad: the flap follows the field up to that angle, falls behind, and snaps over to the other side,
where it rings until it has caught up. Panels are stiff, so that a rigid flap on a hinge judges the
result: at rest in the field of each instant, K_r (phi - phi_0) = torque, and moving.

Both models run unless --model names one; their meshes are such that they are about equally
accurate. Options in SI units.

    ./run demo magnetic_flap
    ./run demo magnetic_flap --model fem --turns 2
    ./run demo magnetic_flap -n 2 --quick
"""

from math import ceil

from mpi4py import MPI

import numpy as np
from _flap_figures import draw_angles, draw_film
from _flap_theory import RigidFlap
from scipy.constants import mu_0

from ufl_origami.demo import fail_together, print_table, read_options, write_summary
from ufl_origami.dynamics import solve_dynamic
from ufl_origami.energy_book import balance_error
from ufl_origami.gallery import z_fold
from ufl_origami.gather import gather_sheet
from ufl_origami.history import CsvFile, Record
from ufl_origami.material import Material
from ufl_origami.meshing import mesh_pattern
from ufl_origami.plotting import energy_book_chart
from ufl_origami.scene import Scene
from ufl_origami.solvers.dynamics import TimeSettings

# %% Parameters
W, LENGTH = 0.01, 0.006  # width of a panel, length of the crease
SHEET = Material(E=2.4e9, nu=0.3, h=5e-4, rho=2000.0)  # a polymer with magnetic powder
REMANENCE, FLUX = 0.1, 0.01  # tesla
RATIO = 1.3  # largest torque of the field over the crease's stiffness, radians
DAMPING = 30.0  # in proportion to mass, 1 / s
START = 0.1  # seconds in which the field comes to its rate of turning

FOLLOWING = np.radians(150.0)  # angle of the field up to which the flap follows it
BALANCE_TOLERANCE, SNAP_TOLERANCE = 1e-5, 0.03  # over the largest energy; periods

comm = MPI.COMM_WORLD
fail_together(comm)
options = read_options(
    "magnetic_flap",
    __doc__,
    {"model": ("ddg", "fem"), "scheme": "bdf2", "dt": 1.25e-3, "turns": 1.2},
    quick={"dt": 2.5e-3, "turns": 0.7},
    comm=comm,
)
RATE = 3.0 if options.quick else 1.0  # turns of the field a second
SIZES = {"ddg": 0.25, "fem": 1.0} if options.quick else {"ddg": 0.15, "fem": 0.5}  # over W
DT = 2.5e-3 if options.quick else 1.25e-3  # largest time step for which claims are made
REST_TOLERANCE, MODEL_TOLERANCE = (2.0, 4.0) if options.quick else (1.0, 2.0)  # degrees
FRAMES, PIXELS = (8, (420, 315)) if options.quick else (60, (600, 450))

torque = W * SHEET.h * REMANENCE * FLUX / mu_0  # per length of the crease
rigid = RigidFlap(torque / RATIO, torque, SHEET.rho * SHEET.h * W**3 / 3, DAMPING)
steps = ceil((options.turns / RATE + START / 2) / options.dt)
end = steps * options.dt
frames = np.unique(np.linspace(1, steps, FRAMES).astype(int))


# %% Model: the sheet, its crease, the magnet and the field
def field_angle(time):
    """Angle of the field from the flap's rest direction; its rate grows in the beginning."""
    run_up = np.minimum(time, START)
    return 2 * np.pi * RATE * (time - run_up + run_up**2 / (2 * START))


def field(time):
    """Flux density."""
    angle = field_angle(time)
    return FLUX * np.array([np.cos(angle), 0.0, np.sin(angle)])


def build_scene(model):
    """The flap at rest."""
    sheet = mesh_pattern(z_fold(W, LENGTH, 180.0), SIZES[model] * W, comm=comm)
    scene = Scene(sheet, SHEET, model=model)
    scene.crease("crease", rigid.stiffness)
    scene.fix("left_edge")
    scene.clamp("left_edge")
    scene.magnetise("right", (REMANENCE, 0.0, 0.0))
    scene.magnetic_field(field)
    scene.damping(mass=DAMPING)
    return scene


# %% Solution: the same steps for both models
def turn(model):
    """Follow one model through the turns; its result and its shapes at the film's instants."""
    shapes = {}

    def on_accept(step, model):
        if step.number in frames:
            shapes[step.time] = gather_sheet(model)

    result = solve_dynamic(
        build_scene(model),
        [end],
        TimeSettings(options.dt, fixed=True),
        scheme=options.scheme,
        record=Record(reactions=(), points=()),
        on_accept=on_accept,
    )
    return result, list(shapes.values())


results, shapes = {}, {}
for model in options.model:
    results[model], shapes[model] = turn(model)
    if comm.rank == 0:
        print(f"{model}: {len(results[model].steps)} steps", flush=True)

# %% Results
times = results[options.model[0]].history["time"]
angles = {model: result.history["fold_virtual_crease"] for model, result in results.items()}
references = {
    "at rest": np.degrees(rigid.at_rest(field_angle(times))),
    "in time": np.degrees(rigid.in_time(times, field_angle)),
}


def snap(angle):
    """Time at which the flap first passes its rest direction downwards, None where it does not."""
    down = np.flatnonzero((angle[:-1] > 0) & (angle[1:] <= 0))
    if not len(down):
        return None
    i = down[0]
    return float(times[i] + options.dt * angle[i] / (angle[i] - angle[i + 1]))


def summarise(model):
    """One object of summary.json."""
    history = results[model].history
    return {
        "model": model,
        "scheme": options.scheme,
        "dt": options.dt,
        "steps": len(results[model].steps),
        "triangles": results[model].model.sheet.num_cells_global,
        "dofs": results[model].model.num_unknowns,
        "seconds": float(history["seconds"].sum()),
        "newton_iterations": int(history["newton_iterations"].sum()),
        "energy_balance_error": balance_error(history),
        "min_gap": None,
        "largest_angle_deg": float(angles[model].max()),
        "smallest_angle_deg": float(angles[model].min()),
        "snap_time": snap(angles[model]),
        "rigid_snap_time": snap(references["in time"]),
        "lost_damping": float(history["lost_damping"][-1]),
        "lost_integrator": float(history["lost_integrator"][-1]),
    }


COLUMNS = {
    "model": "s", "triangles": "d", "dofs": "d", "steps": "d", "newton_iterations": "d",
    "seconds": ".1f", "energy_balance_error": ".1e", "largest_angle_deg": ".2f",
    "smallest_angle_deg": ".2f", "snap_time": ".4f", "rigid_snap_time": ".4f",
}  # fmt: skip
runs = [summarise(model) for model in options.model]
if comm.rank == 0:
    print_table(runs, COLUMNS)
    write_summary(options.output, runs)
    draw_angles(options.output / "angle.png", times, angles, references)
    for model, result in results.items():
        file = options.output / f"energy_book_{model}.png"
        CsvFile(options.output / f"history_{model}.csv", result.history.rows).close()
        energy_book_chart(result.history, file, title=f"Energy book of the flap, {model}")
    arrows = field_angle(options.dt * frames)
    draw_film(options.output / "film.gif", shapes, arrows, width=W, size=PIXELS)
    print(f"\nsummary.json, histories, charts and film are in {options.output}")

# %% The claims
following = field_angle(times) <= FOLLOWING
balance = max(run["energy_balance_error"] for run in runs)
claims = {"imbalance over the largest energy": (balance, BALANCE_TOLERANCE)}
if options.scheme == "bdf2" and options.dt <= DT:
    off = [np.abs(found - references["at rest"])[following].max() for found in angles.values()]
    claims["degrees off the flap at rest while it follows"] = max(off), REST_TOLERANCE
    due = snap(references["in time"])
    if due is not None:
        late = max(abs((snap(found) or np.inf) - due) for found in angles.values())
        name = "snap off that of the rigid flap, in periods"
        claims[name] = late / rigid.period, SNAP_TOLERANCE
    if len(angles) == 2:
        apart = np.abs(angles["ddg"] - angles["fem"])
        claims["degrees between the models"] = apart.max(), MODEL_TOLERANCE
if comm.rank == 0:
    for text, (value, bound) in claims.items():
        print(f"{text}: {value:.2g} (at most {bound:g})")
for text, (value, bound) in claims.items():
    assert value < bound, f"the claim fails: {text}: {value:.3g}"
