"""Drop: a folded sheet falls onto an incline, bounces, slides and settles to a creep.

Two panels of paper joined by an elastic crease stand like a tent. They are thrown down an incline,
on which Coulomb friction regularised at the speed eps acts: mu f(v / eps), f(y) = 2 y - y^2 below
1. Such friction never holds anything at rest. Where tan(alpha) < mu the sheet slows down to the
speed at which friction bears its weight, f(v / eps) = tan(alpha) / mu, or

    v = eps (1 - sqrt(1 - tan(alpha) / mu)),

for any shape, mesh and distribution of the pressure. This, the energy book (the balance closes, no
energy is gained) and a gap that never closes judge the run.

Time steps adapt to error and effort, or are all --dt long. What impacts do to the sheet depends on
the integrator (implicit Euler takes several times the energy that BDF2 takes), the creep does not.

    ./run demo drop
    ./run demo drop --scheme implicit_euler
    ./run demo drop --dt 5e-4
    ./run demo drop -n 2 --model fem
"""

from dataclasses import replace
from math import cos, radians, sin, sqrt, tan

from mpi4py import MPI

import numpy as np
from _drop_figures import draw_charts, draw_film

import ufl_origami as uo
from ufl_origami.demo import fail_together, print_table, read_options, write_summary
from ufl_origami.energy_book import LOSSES, balance_error, energy_changes
from ufl_origami.gather import gather_sheet
from ufl_origami.plotting import Look

# %% Parameters, in m, kg, s
WIDTH, LENGTH, INCLUDED = 0.08, 0.10, 50.0  # panels across and along the crease, angle in degrees
PAPER = uo.Material(E=2e9, nu=0.3, h=3e-4, rho=800.0)
CREASE = 0.3  # moment per length and radian
DAMPING = 5e-4  # in proportion to the stiffness: none of it acts on the creep
SLOPE, YAW = 12.0, 25.0  # of the incline; of the crease to its horizontal; degrees
MU, EPS = 0.4, 0.1  # friction, and the speed from which on all of it acts
REACH = 5e-4  # gap at which contact begins
GRAVITY = 9.81
HEIGHT, THROW, END = 0.08, 0.2, 0.8  # gap and speed down the incline at the start; last time
STEP, LARGEST = 2e-4, 2e-3  # first and largest time step where they adapt
LOSS = 1e-3  # energy that the integrator may take or give in such a step, over the largest one
FRAME, PIXELS = 0.01, (800, 500)  # time between the pictures of the film and fields, their size
SETTLED = 0.1  # time at the end over which the creep is judged
SIZES = {"ddg": (0.016, 0.04), "fem": (0.04, 0.08)}  # of the triangles, and with --quick
CREEP_TOLERANCE, ENERGY_TOLERANCE = 0.02, 1e-6  # of the claim; the latter over the largest energy

comm = MPI.COMM_WORLD
fail_together(comm)
options = read_options(
    "drop", __doc__, {"model": "ddg", "scheme": "bdf2", "dt": None}, quick={}, comm=comm
)
size = SIZES[options.model][options.quick]
if options.quick:  # coarser triangles, steps and pictures, a lower fall, a shorter slide
    HEIGHT, THROW, END = 0.01, 0.1, 0.4
    LARGEST, FRAME, PIXELS = 4e-3, 0.04, (480, 300)
    SETTLED, LOSS = 0.05, 3e-3
predicted = EPS * (1 - sqrt(1 - tan(radians(SLOPE)) / MU))

# %% Sheet: the Z-fold upside down, its outer edges parallel to the incline and HEIGHT above it
down = np.array([cos(radians(SLOPE)), 0.0, -sin(radians(SLOPE))])
across = np.array([0.0, 1.0, 0.0])
normal = np.cross(down, across)


def standing(pattern):
    """The pattern as it stands above the incline, the middle of its feet over the origin."""
    ahead = cos(radians(YAW)) * down + sin(radians(YAW)) * across
    ridge = np.cross(normal, ahead)
    places = pattern.vertices_coords - [0.0, 0.5 * LENGTH, 0.0]  # outer edges at z = 0
    return replace(
        pattern, vertices_coords=places @ np.array([-ahead, ridge, -normal]) + HEIGHT * normal
    )


sheet = uo.mesh_pattern(standing(uo.gallery.z_fold(WIDTH, LENGTH, INCLUDED)), size, comm=comm)

# %% Model: what the sheet is, and what surrounds it
scene = uo.Scene(sheet, PAPER, model=options.model)
scene.crease("crease", CREASE)
scene.damping(stiffness=DAMPING)
scene.gravity((0.0, 0.0, -GRAVITY))
impact = sqrt(2 * GRAVITY * cos(radians(SLOPE)) * HEIGHT)
barrier = uo.suggest_barrier(scene, impact, distance=REACH)
scene.obstacle("incline", uo.Plane(normal=tuple(normal)), barrier)
scene.friction("incline", uo.Coulomb(MU, EPS))
scene.launch(THROW * down)


# %% Solution: one run through the frames of the film, which fixed steps meet as well as they can
def speed(model):
    """Speed of the centre of mass down the incline."""
    return model.motion.momentum() @ down / model.motion.total_mass


def height(model):
    """Height of the centre of mass over the incline."""
    return model.motion.centre(model.x) @ normal


def gap(model):
    """Smallest distance of the sheet from the incline."""
    return comm.allreduce(model.contacts[0].gap(model.state), op=MPI.MIN)


stops = FRAME * np.arange(1, round(END / FRAME) + 1)
if options.dt:
    stops = options.dt * np.unique(np.maximum(1, np.round(stops / options.dt)))
model = uo.build(scene)
frames = [gather_sheet(model)]


def on_accept(step, model):
    """Keep the shape at each stop."""
    if np.isclose(step.time, stops, rtol=1e-9).any():
        frames.append(gather_sheet(model))


times = uo.TimeSettings(STEP, largest=LARGEST, energy_tolerance=LOSS)
if options.dt:
    times = uo.TimeSettings(options.dt, fixed=True)
result = uo.solve_dynamic(
    model,
    list(stops),
    times,
    scheme=options.scheme,
    output=options.output,
    record=uo.Record(extra={"speed": speed, "height": height, "gap": gap}, every=FRAME),
    on_accept=on_accept,
)

# %% Results
history = result.history
time, total = history["time"], history["energy_total"]
late = time >= time[-1] - SETTLED
largest = max(np.abs(values).max() for values in energy_changes(history).values())
flying = history["gap"] > REACH  # out of contact
touched = np.maximum.accumulate(~flying)
run = {
    "model": options.model,
    "scheme": options.scheme,
    "dt": options.dt,
    "steps": len(result.steps),
    "cuts": sum(step.cuts for step in result.steps),
    "smallest_step": float(min(step.size for step in result.steps)),
    "triangles": sheet.num_cells_global,
    "dofs": result.model.num_unknowns,
    "seconds": sum(step.seconds for step in result.steps),
    "newton_iterations": sum(step.iterations for step in result.steps),
    "energy_balance_error": balance_error(history),
    "energy_gain": float((total - total[0]).max() / largest),
    "integrator_gain": float(max(0.0, -history["lost_integrator"].min() / largest)),
    **{f"lost_{way}": float(history[f"lost_{way}"][-1] / largest) for way in LOSSES},
    "min_gap": float(history["gap"].min()),
    "bounces": int(np.count_nonzero(np.diff((flying & touched).astype(int)) == 1)),
    "creep_speed": float(np.trapezoid(history["speed"][late], time[late]) / np.ptp(time[late])),
    "predicted_creep_speed": predicted,
    "creep_error": float(np.abs(history["speed"][late] / predicted - 1).max()),
}
COLUMNS = {
    "model": "s", "scheme": "s", "steps": "d", "cuts": "d", "newton_iterations": "d",
    "seconds": ".1f", "energy_balance_error": ".1e", "lost_integrator": ".3f", "min_gap": ".2e",
    "bounces": "d", "creep_speed": ".5f", "predicted_creep_speed": ".5f",
}  # fmt: skip
if comm.rank == 0:
    print_table([run], COLUMNS)
    write_summary(options.output, [run])
    draw_charts(history, options.output, predicted, CREEP_TOLERANCE)
    draw_film(
        frames,
        np.array([down, across, normal]),
        options.output / "drop.gif",
        Look(camera=(-20.0, 15.0), scale_label="m", edges=False, size=PIXELS),
    )
    print(f"film, charts, summary.json, history and fields are in {options.output}")

# %% The claim
assert run["min_gap"] > 0, f"the sheet went through the incline: {run}"
assert run["creep_error"] < CREEP_TOLERANCE, f"no creep at the predicted speed: {run}"
assert run["energy_balance_error"] < ENERGY_TOLERANCE, f"the energy book is open: {run}"
assert run["energy_gain"] < ENERGY_TOLERANCE, f"energy was gained: {run}"
assert run["lost_integrator"] > 0, f"the integrator made energy: {run}"
