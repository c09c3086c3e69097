"""Contact: derivatives of the barrier, its forces, places that touch, statics, refused starts."""

import numpy as np
import pytest
import ufl
from contact_scenes import QUIET, areas, fixed, forces, nodes, plate
from scenes import build, disturb
from test_terms import remainders, skew_part

from ufl_origami.barrier import Barrier
from ufl_origami.configuration import State
from ufl_origami.dynamics import solve_dynamic
from ufl_origami.errors import ContactWarning, InputError, SceneError, SolveError
from ufl_origami.friction_laws import Coulomb
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.obstacles import Cylinder, Plane, SignedDistance, Sphere
from ufl_origami.run import solve_static
from ufl_origami.scene import Scene
from ufl_origami.solvers.static import StepSettings


def over(body, *, model="ddg", n=(3, 3), E=1e8, barrier=None, **options):
    """Scene of a unit square at z = 0 and one obstacle."""
    scene = plate(n, side=1.0, model=model, E=E)
    scene.obstacle("body", body, barrier or Barrier(10.0, 0.1), **options)
    return scene


INSIDE = r"obstacle 'body': the sheet starts 0.1 inside, at \(0.3333, 0.6667, "


@pytest.mark.parametrize("displaced", [False, True])
@pytest.mark.parametrize("solve", ["static", "dynamic"])
def test_sheet_that_starts_inside_is_refused_where_it_is(solve, displaced):
    shift = np.array([0.1, 0.2, 0.4]) * displaced
    body = Sphere(np.array([1 / 3, 2 / 3, -0.1]) - shift, 0.2)
    scene = over(body, motion=lambda time: shift)
    scene.fix("x0")
    scene.clamp("x0")
    with pytest.raises(SceneError, match=INSIDE):
        if solve == "static":
            solve_static(scene, [1.0], record=QUIET)
        else:
            solve_dynamic(scene, [1e-3], fixed(1e-3), record=QUIET)


NO_DISTANCES = {
    "obstacle 'body': gradient of length 2 is that of no distance": lambda x: 2 * x[2] + 1.0,
    "obstacle 'body': its distance is not finite": lambda x: ufl.sqrt(x[2] - 1.0),
}


@pytest.mark.parametrize("message", NO_DISTANCES)
def test_functions_that_are_no_distance_are_refused(message):
    scene = over(SignedDistance(NO_DISTANCES[message]))
    with pytest.raises(SceneError, match=message):
        solve_dynamic(scene, [1e-3], fixed(1e-3), record=QUIET)


def test_two_obstacles_of_one_name_and_what_is_no_obstacle_are_refused():
    scene = over(Plane((0.0, 0.0, -1.0)))
    with pytest.raises(SceneError, match="obstacle 'body' is declared twice"):
        scene.obstacle("body", Plane((0.0, 0.0, -2.0)), Barrier(1.0, 0.1))
    with pytest.raises(SceneError, match="is no obstacle"):
        scene.obstacle("other", "plane", Barrier(1.0, 0.1))
    with pytest.raises(SceneError, match="obstacle 'other': None is no barrier"):
        scene.obstacle("other", Plane((0.0, 0.0, -2.0)), None)
    with pytest.raises(InputError, match="no edge set is named 'x2'"):
        scene.obstacle("other", Plane((0.0, 0.0, -2.0)), Barrier(1.0, 0.1), on=["x2"])


TOUCHED = {
    "plane": Plane((0.3, 0.2, -0.25), (0.2, -0.1, 1.0)),
    "sphere": Sphere((0.4, 0.5, -2.2), 1.95),
}
WIDE = Barrier(7.0, 0.6)  # all nodes are inside of its reach, and stay there


def touching(shape, model):
    """A disturbed sheet so soft that the barrier is all there is to its energy."""
    scene = over(TOUCHED[shape], model=model, n=(2, 2), E=1e-9, barrier=WIDE)
    return disturb(build(scene), 0.05)


both_models = pytest.mark.parametrize("model", ["ddg", "fem"])
both_shapes = pytest.mark.parametrize("shape", TOUCHED)


@pytest.mark.parametrize("shape", ["plane", pytest.param("sphere", marks=pytest.mark.mpi)])
@both_models
def test_contact_has_exact_forces_and_an_exact_symmetric_tangent(shape, model):
    made = touching(shape, model)
    gap = made.contacts[0].at.gaps.at(made.state.q[made.functions.dofs].reshape(-1, 3))
    assert (gap > 0.1 * WIDE.distance).all() and (gap < 0.99 * WIDE.distance).all()
    energies = made.energies()
    assert energies["contact"] > 1e6 * (energies["membrane"] + energies["bending"])
    for order in (1, 2):
        steps, left = remainders(made, order)
        slope = np.polyfit(np.log(steps), np.log(left), 1)[0]
        assert slope == pytest.approx(order + 1, abs=0.1)
    made.problem.linearise(None, made.x)
    matrix = made.problem.stiffness(made.x)
    assert skew_part(matrix) < 1e-12 * matrix.norm()


@both_shapes
@both_models
def test_energy_and_outward_forces_are_the_barriers_times_the_nodes_areas(shape, model):
    made = touching(shape, model)
    contact, where, share = made.contacts[0], nodes(made), areas(made)
    body = TOUCHED[shape]
    if shape == "plane":
        normal = np.tile(np.array(body.normal) / np.linalg.norm(body.normal), (len(where), 1))
        gap = ((where - body.point) * normal).sum(axis=1)
    else:
        arm = where - body.centre
        gap, normal = np.linalg.norm(arm, axis=1) - body.radius, arm
        normal = arm / np.linalg.norm(arm, axis=1)[:, None]
    energy = sum(a * WIDE.energy(d) for a, d in zip(share, gap, strict=True))
    assert contact.energies(made.state)[0] == pytest.approx(energy, rel=1e-12)
    pressure = np.array([WIDE.pressure(d) for d in gap])
    assert (pressure > 0).all()
    expected = (share * pressure)[:, None] * normal
    scale = abs(expected).max()
    assert forces(contact, made) == pytest.approx(expected, rel=1e-12, abs=1e-13 * scale)


def test_pressure_is_the_slope_of_the_energy_and_ends_with_it():
    gaps = WIDE.distance * np.array([1e-3, 0.1, 0.5, 0.9])
    step = 1e-6 * gaps
    slope = [
        (WIDE.energy(d + s) - WIDE.energy(d - s)) / (2 * s) for d, s in zip(gaps, step, strict=True)
    ]
    assert [-WIDE.pressure(d) for d in gaps] == pytest.approx(slope, rel=1e-7)
    assert WIDE.energy(0.5 * WIDE.distance) == pytest.approx(7.0 * 0.6**2 * 0.25 * np.log(2.0))
    assert WIDE.energy(1.1 * WIDE.distance) == WIDE.pressure(1.1 * WIDE.distance) == 0.0


def test_steps_see_obstacles_move():
    rise, fall = 3.0, np.array([0.0, 0.0, -1.0])
    scene = over(Plane((0.0, 0.0, -0.5)), motion=lambda time: (0.0, 0.0, rise * time))
    model = build(scene)
    contact, step = model.contacts[0], np.zeros(model.configuration.num_local)
    before = State(model.state.q, model.state.x, 0.1)  # the gap is 0.2 then
    contact.set_time(0.6)
    assert contact.longest_step(before, step) == pytest.approx(0.9 * 0.2 / 1.5, rel=1e-12)
    step[model.functions.dofs] = np.tile(fall, len(model.functions.dofs) // 3)
    assert contact.longest_step(before, step) == pytest.approx(0.9 * 0.2 / 2.5, rel=1e-12)
    assert contact.longest_step(before, -1.5 * step) == 1.0
    assert contact.gap(State(model.state.q, model.state.x, 0.6)) == pytest.approx(-1.3)


def test_no_part_of_a_step_that_is_not_finite_is_free():
    contact = build(over(Plane((0.0, 0.0, -0.5)))).contacts[0]
    here = np.zeros((len(contact.at.gaps), 3))
    assert contact.at.gaps.free_part(here, here) == 1.0
    for value in (np.nan, np.inf):
        there = here.copy()
        there[0, 2] = value
        assert contact.at.gaps.free_part(here, there) == 0.0


@both_models
def test_forecast_is_the_force_to_first_order_in_the_obstacles_way(model):
    scene = over(TOUCHED["sphere"], model=model, n=(2, 2), E=1e-9, barrier=WIDE)
    scene.obstacles.clear()
    scene.obstacle("body", TOUCHED["sphere"], WIDE, motion=lambda t: (0.3 * t, 0.1 * t, t))
    made = disturb(build(scene), 0.05)
    contact, state, left = made.contacts[0], made.state, []
    steps = 0.02 * 0.5 ** np.arange(4)
    for step in steps:
        contact.set_time(step)
        there = State(state.q, state.x, step)
        right, guess = np.zeros_like(state.q), np.zeros_like(state.q)
        contact.add_residual(there, right)
        contact.add_forecast(there, 0.0, guess)
        left.append(np.linalg.norm(guess - right))
    assert np.polyfit(np.log(steps), np.log(left), 1)[0] == pytest.approx(2.0, abs=0.1)


STRIP = Material(1e7, 0.0, 0.02)
LENGTH, WIDTH = 1.0, 0.2
EI = STRIP.bending_stiffness * WIDTH
PRESSES = {
    "cylinder": Cylinder((LENGTH, 0.0, -0.21), (0.0, 1.0, 0.0), 0.2),
    "incline": Plane((LENGTH, 0.0, -0.01), (-0.3, 0.0, 1.0)),
}


@pytest.mark.parametrize("body", PRESSES)
@both_models
def test_cantilever_pressed_up_at_its_end_bears_the_contact_force(body, model):
    mesh = rectangle(LENGTH, WIDTH, n={"ddg": (10, 2), "fem": (4, 1)}[model])
    scene = Scene(mesh, STRIP, model=model)
    scene.fix("x0")
    scene.clamp("x0")
    barrier = Barrier(200.0, 0.01)
    scene.obstacle("press", PRESSES[body], barrier, motion=lambda s: (0.0, 0.0, 0.03 * s))
    made = solve_static(scene, [1.0], record=QUIET).model
    contact, share = made.contacts[0], forces(made.contacts[0], made)
    force = share.sum(axis=0)
    touched = np.abs(share).max(axis=1) > 0
    assert made.functions.V.tabulate_dof_coordinates()[touched, 0] == pytest.approx(LENGTH)
    assert 0 < contact.smallest < barrier.distance
    assert made.reaction("x0") == pytest.approx(-force, abs=1e-6 * force[2])
    lift = made.position("x1y0")[2]
    assert 0.02 < lift < 0.03  # the press's way, less what was left of the gap
    assert force[2] == pytest.approx(3 * EI * lift / LENGTH**3, rel=0.02)
    sideways = {"cylinder": 0.0, "incline": -0.3}[body]  # forces are normal to the surface
    assert force[0] / force[2] == pytest.approx(sideways, abs=2e-3)


def test_static_press_moves_by_many_reaches_of_its_barrier_in_few_steps():
    scene = Scene(rectangle(LENGTH, WIDTH, n=(10, 2)), STRIP)
    scene.fix("x0")
    scene.clamp("x0")
    barrier, way = Barrier(2e5, 1e-4), 0.03
    rise = {"motion": lambda s: (0.0, 0.0, way * s)}
    scene.obstacle("press", Plane((0.0, 0.0, -0.5e-4)), barrier, on=["x1"], **rise)
    result = solve_static(scene, [1.0], record=QUIET)
    assert 0 < result.model.contacts[0].smallest < barrier.distance
    assert result.model.position("x1y0")[2] == pytest.approx(way, abs=barrier.distance)
    assert len(result.steps) < 0.2 * way / barrier.distance


def test_static_load_that_a_barrier_cannot_bear_is_an_error_at_the_last_state():
    scene = Scene(rectangle(LENGTH, WIDTH, n=(10, 2)), STRIP)
    scene.fix("x0")
    scene.clamp("x0")
    scene.line_load("x1", (0.0, 0.0, -5.0))
    scene.obstacle("floor", Plane((0.0, 0.0, -0.05)), Barrier(1e-3, 1e-3))
    made, times = build(scene), [0.0]
    with (
        pytest.warns(ContactWarning),
        pytest.raises(SolveError, match=r"obstacle 'floor': its barrier .* too weak") as caught,
    ):
        steps = StepSettings(largest=0.03)
        note = {"on_accept": lambda step, _: times.append(step.time)}
        solve_static(made, [1.0], record=QUIET, steps=steps, **note)
    assert caught.value.load_factor == made.problem.time == times[-1] > 0


PLACES = {
    "x1": lambda x: x[:, 0] > 1 - 1e-9,
    "x0y1": lambda x: x[:, 0] - x[:, 1] < 1e-9 - 1,
    "sheet": lambda x: x[:, 2] == 0.0,
}


@both_models
def test_only_nodes_of_the_named_places_touch(model):
    for places in (("x1",), ("x0y1",), ("x0y1", "x1"), ("sheet",)):
        scene = over(Plane((0.0, 0.0, -0.05)), model=model, n=(2, 2), on=places)
        made = build(scene)
        share = forces(made.contacts[0], made)
        rest = made.functions.V.tabulate_dof_coordinates()
        touched = np.any([PLACES[name](rest) for name in places], axis=0)
        assert 0 < touched.sum() == len(made.contacts[0].at.gaps)
        pressure = Barrier(10.0, 0.1).pressure(0.05)
        expected = areas(made) * pressure * touched
        assert share[:, 2] == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_places_that_cannot_touch_may_be_inside():
    scene = over(Sphere((1.0, 0.5, 0.0), 0.3), on=("x0",))
    result = solve_dynamic(scene, [1e-3], fixed(1e-3), record=QUIET)
    assert result.model.contacts[0].smallest == pytest.approx(
        np.sqrt(1.0 + (0.5 - 1 / 3) ** 2) - 0.3
    )


@both_models
@pytest.mark.parametrize("lagged", [False, True])
def test_nodes_that_cannot_touch_may_be_inside_beside_some_that_do(model, lagged):
    """An edge at a gap of 0.1 rubs on a surface that the rest of the sheet is behind of."""
    barrier = Barrier(1e4, 0.2)
    scene = over(Plane((0.9, 0.0, 0.0), (1.0, 0.0, 0.0)), model=model, barrier=barrier, on=("x1",))
    scene.friction("body", Coulomb(0.5, eps=1e-3), lagged=lagged)
    scene.launch((0.0, 0.0, 1.0))
    made = build(scene)
    share, touched = forces(made.contacts[0], made), PLACES["x1"](nodes(made))
    assert share[:, 0] == pytest.approx(areas(made) * barrier.pressure(0.1) * touched, rel=1e-12)
    history = solve_dynamic(made, [1e-7], fixed(1e-7), record=QUIET).history
    drag = 0.5 * share[:, 0].sum()
    assert history["lost_friction"][-1] == pytest.approx(drag * 1e-7, rel=1e-3)
