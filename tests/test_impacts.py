"""Impacts: bounces against exact ones, coming to rest, and never a state behind a surface."""

import re

import numpy as np
import pytest
from contact_scenes import (
    LOAD,
    QUIET,
    RHO,
    G,
    H,
    areas,
    bearing,
    fixed,
    flight,
    forces,
    mean_velocity,
    nodes,
    plate,
    resting_gap,
)

from ufl_origami.barrier import Barrier
from ufl_origami.discretise import build
from ufl_origami.dynamics import solve_dynamic
from ufl_origami.errors import ContactWarning, SceneError, SolveError
from ufl_origami.gallery import z_fold
from ufl_origami.history import Record
from ufl_origami.material import Material
from ufl_origami.meshing import mesh_pattern
from ufl_origami.obstacles import Box, Plane, Sphere
from ufl_origami.scene import Scene
from ufl_origami.scene_surroundings import spin
from ufl_origami.solvers.dynamics import TimeSettings
from ufl_origami.suggestions import suggest_barrier

REACH = 0.01
HARD = Barrier(5e4, REACH)  # stops 10 per area at speed 1 with a fifth of the gap left
CONTACT = 0.0206810  # time of that contact, as the test of its duration finds it


def impact(steps, scheme="bdf2", *, model="ddg", E=1e8):
    """A plate that enters the barrier flat at speed 1, with so many steps a contact.

    Returns:
        Its history, heights over the surface, and the exact heights and speed at the end.
    """
    scene = plate(model=model, E=E)
    scene.obstacle("floor", Plane((0.0, 0.0, -REACH)), HARD)
    scene.launch((0.0, 0.0, -1.0))
    record = Record(fields="none", extra={"speed": lambda m: mean_velocity(m)[2]})
    size = CONTACT / steps
    end = round(1.4 * steps) * size
    history = solve_dynamic(scene, [end], fixed(size), scheme=scheme, record=record).history
    return history, REACH + history["position_x0y0_z"], flight(HARD, (REACH, -1.0), history["time"])


def duration(height, speed, end):
    """Time at which a mass that flies off left the barrier."""
    assert height > REACH and speed > 0
    return end - (height - REACH) / speed


def order(errors):
    """Order of errors whose steps are halved."""
    return -np.polyfit(np.arange(len(errors)), np.log2(errors), 1)[0]


def test_bounce_of_bdf2_converges_to_the_exact_one_with_order_two():
    errors = []
    for steps in (20, 40, 80):
        history, height, exact = impact(steps)
        end, speed = history["time"][-1], history["speed"][-1]
        left = duration(height[-1], speed, end)
        exact_left = duration(*exact[:, -1], end)
        assert exact_left == pytest.approx(CONTACT, rel=1e-4)
        errors.append((abs(height - exact[0]).max() / REACH, abs(left / exact_left - 1)))
        lost = 1 - speed**2
        assert 0 < lost == pytest.approx(history["lost_integrator"][-1] / 0.05, rel=1e-6)
    for error in np.transpose(errors):
        assert order(error) == pytest.approx(2.0, abs=0.3)
        assert error[-1] < 0.003
    assert abs(speed - 1) < 3e-4


def test_bounce_of_implicit_euler_loses_speed_in_proportion_to_the_step():
    losses = []
    for steps in (50, 100):
        history = impact(steps, "implicit_euler")[0]
        losses.append(1 - history["speed"][-1])
    assert losses[0] > losses[1] > 0.05
    assert order(losses) == pytest.approx(1.0, abs=0.15)
    assert 2 * losses[1] - losses[0] == pytest.approx(0.0, abs=0.2 * losses[1])


def test_bounce_of_a_stiff_fem_plate_is_the_exact_one():
    history, height, _ = impact(40, model="fem", E=1e10)
    assert history["speed"][-1] == pytest.approx(1.0, abs=0.01)
    left = duration(height[-1], history["speed"][-1], history["time"][-1])
    assert left == pytest.approx(CONTACT, rel=0.01)


def test_plate_dropped_from_rest_comes_back_after_the_exact_period():
    reach, top = 0.05, 0.1
    barrier = Barrier(4e3, reach)
    time = np.linspace(0.0, 0.6, 1201)
    fine = flight(barrier, (top, 0.0), time, G)
    period = zero_crossings(time, fine[1])[1]
    assert (fine[0] < reach).mean() * 0.6 > 0.2 * period  # no mere free fall
    scene = plate()
    scene.gravity((0.0, 0.0, -G))
    scene.obstacle("floor", Plane((0.0, 0.0, -top)), barrier)
    record = Record(fields="none", extra={"speed": lambda m: mean_velocity(m)[2]})
    size = period / 100
    history = solve_dynamic(scene, [1.1 * period], fixed(size), record=record).history
    turns = zero_crossings(history["time"], history["speed"])
    assert turns[:2] == pytest.approx(zero_crossings(time, fine[1])[:2], rel=3e-3)
    back = history["position_x0y0_z"][100]
    assert -0.01 * top < back < 0  # what the scheme lost, and no more


def zero_crossings(time, values):
    """Times at which values change their sign, the start left out."""
    k = 1 + np.flatnonzero(values[1:-1] * values[2:] < 0)
    return time[k] - values[k] * (time[k + 1] - time[k]) / (values[k + 1] - values[k])


@pytest.mark.parametrize("model", ["ddg", "fem"])
def test_dropped_sheet_comes_to_rest_with_the_balance_closed(model):
    n = {"ddg": (2, 2), "fem": (1, 1)}[model]
    scene = plate(n, side=1.0, model=model, E=1e9)
    scene.gravity((0.0, 0.0, -G))
    scene.damping(mass=60.0)
    scene.launch(spin((0.3, 0.2, 0.0), (0.5, 0.5, 0.0)))
    barrier = suggest_barrier(scene, speed=1.0)
    scene.obstacle("floor", Plane((0.0, 0.0, -0.05)), barrier)
    settings = TimeSettings(step=1e-3, largest=0.1)
    result = solve_dynamic(scene, [1.5], settings, record=QUIET)
    history, made = result.history, result.model
    fallen = history["energy_gravity"][0] - history["energy_gravity"][-1]
    assert fallen > 0.9 * LOAD * (0.05 - H)
    assert history["energy_kinetic"][-1] < 1e-14 * history["energy_kinetic"].max()
    assert abs(history["imbalance"]).max() < 1e-8 * fallen
    lost = history["lost_damping"][-1] + history["lost_integrator"][-1]
    kept = history["energy_total"][-1] - history["energy_total"][0]
    assert lost == pytest.approx(-kept, rel=1e-8) and lost > 0.9 * fallen
    near = 1e-6 * LOAD  # Newton's tolerance, relative to the forces of a stiff membrane
    assert forces(made.contacts[0], made).sum(axis=0) == pytest.approx([0, 0, LOAD], abs=near)
    gap = nodes(made)[:, 2] + 0.05
    if model == "ddg":  # masses and contact have the same shares of the area there
        assert gap == pytest.approx(resting_gap(barrier, LOAD), rel=1e-8)
    pressure = np.array([barrier.pressure(d) for d in gap])
    assert areas(made) @ pressure == pytest.approx(LOAD, abs=near)


def folded(speed, barrier_speed, body, *, model="ddg", E=1e7):
    """A Z-fold of 28 triangles fired down at an obstacle by a speed."""
    sheet = mesh_pattern(z_fold(), 0.5)
    scene = Scene(sheet, Material(E, 0.3, H, RHO), model=model)
    scene.crease("crease", 0.5e-6 * E)
    scene.launch((0.0, 0.0, -speed))
    scene.obstacle("wall", body, suggest_barrier(scene, speed=barrier_speed))
    return scene


WALLS = {
    "plane": (Plane((0.0, 0.0, -1.0)), lambda x: x[:, 2] + 1.0),
    "ball": (
        Sphere((0.1, 0.4, -1.5), 0.5),
        lambda x: np.linalg.norm(x - [0.1, 0.4, -1.5], axis=1) - 0.5,
    ),
}
FAST = 100.0  # times the speed at which the scene is meant to land


class Watch:
    """Keeps, as `on_accept`, the smallest gap of all accepted states, and the last state."""

    def __init__(self, gap):
        self.gap, self.smallest, self.time, self.x = gap, np.inf, 0.0, None

    def __call__(self, step, model):
        self.smallest = min(self.smallest, self.gap(nodes(model)).min())
        self.time, self.x = step.time, model.x.array_r.copy()


def fire(model, watch, until=0.25 / FAST):
    settings = TimeSettings(step=until / 50, largest=until / 10)
    return solve_dynamic(model, [until], settings, record=QUIET, on_accept=watch)


@pytest.mark.parametrize("wall", WALLS)
def test_fast_impact_passes_with_parameters_for_its_speed(wall):
    body, gap = WALLS[wall]
    watch = Watch(gap)
    result = fire(build(folded(FAST, FAST, body)), watch)
    contact = result.model.contacts[0]
    assert contact.smallest == pytest.approx(watch.smallest, rel=1e-9)
    assert 0.01 * H < watch.smallest < H
    history = result.history
    assert history["energy_contact"].max() > 0.01 * history["energy_kinetic"][0]
    assert abs(history["imbalance"]).max() < 1e-8 * history["energy_kinetic"][0]


@pytest.mark.slow
@pytest.mark.parametrize("wall", WALLS)
def test_fast_impact_of_a_stiffer_fem_sheet_passes(wall):
    body, gap = WALLS[wall]
    watch = Watch(gap)
    fire(build(folded(FAST, FAST, body, model="fem", E=1e9)), watch)
    assert 0.01 * H < watch.smallest < H


def stale(kind):
    """A sheet fired at the plane with a barrier for a hundredth of its speed."""
    body = WALLS["plane"][0]
    if kind == "folded":
        return folded(FAST, 1.0, body)
    scene = plate(side=0.5, model=kind, E=1e9)
    scene.launch((0.0, 0.0, -FAST))
    scene.obstacle("wall", body, suggest_barrier(scene, speed=1.0))
    return scene


@pytest.mark.parametrize("kind", ["folded", "ddg", "fem"])
def test_fast_impact_on_a_stale_barrier_is_announced_and_ends_before_it(kind):
    watch, made = Watch(WALLS["plane"][1]), build(stale(kind))
    closing = "obstacle 'wall': the gap closed to .* a stiffer one is due"
    with pytest.warns(ContactWarning, match=closing), pytest.raises(SolveError) as caught:
        fire(made, watch, 2 / FAST)
    assert caught.value.reason
    assert caught.value.load_factor == watch.time == made.problem.time > 0
    assert (made.x.array_r == watch.x).all()
    assert 0 < watch.smallest < 0.01 * H
    assert made.contacts[0].smallest == pytest.approx(watch.smallest, rel=1e-9)


def test_plate_flung_at_a_thin_wall_in_steps_longer_than_it_does_not_come_out_behind():
    wall, gap = Box((0.0, 0.0, -0.25), (9.0, 9.0, 2e-3)), lambda x: x[:, 2] + 0.249
    for step in (0.1, 0.5):
        scene, watch = plate(), Watch(gap)
        scene.obstacle("wall", wall, HARD)
        scene.launch((0.0, 0.0, -1.0))
        result = solve_dynamic(scene, [1.0], fixed(step), record=QUIET, on_accept=watch)
        assert watch.smallest > 0 and nodes(result.model)[:, 2].min() > -0.25
        assert mean_velocity(result.model)[2] > 0  # thrown back, though most of its energy is lost


def test_suggested_barrier_bears_gravity_that_grows_with_time():
    scene, steady = plate(), plate()
    steady.gravity((0.0, 0.0, -G))
    scene.gravity(lambda time: (0.0, 0.0, -G * min(time / 0.1, 1.0)))
    with pytest.raises(SceneError, match="give the time at which it is largest"):
        suggest_barrier(scene, speed=1e-3)
    assert suggest_barrier(scene, speed=1e-3, time=0.1) == suggest_barrier(steady, speed=1e-3)
    weaker = suggest_barrier(scene, speed=1e-3, time=0.05)
    assert weaker.stiffness == pytest.approx(0.5 * suggest_barrier(steady, 1e-3).stiffness)


def test_gap_that_nearly_closes_gives_a_warning():
    left = 0.005
    weak = Barrier(0.5 * RHO * H / (-((left - 1) ** 2) * np.log(left)) / REACH**2, REACH)
    scene = plate()
    scene.obstacle("floor", Plane((0.0, 0.0, -REACH)), weak)
    scene.launch((0.0, 0.0, -1.0))
    with pytest.warns(ContactWarning, match="obstacle 'floor': the gap closed to 0") as caught:
        result = solve_dynamic(scene, [0.012], fixed(1e-4), record=QUIET)
    smallest = result.model.contacts[0].smallest / REACH
    assert smallest == pytest.approx(left, rel=0.2)
    said = float(re.search(r"closed to (\S+) %", str(caught[-1].message))[1]) / 100
    assert 0.98 * smallest < said < 2.02 * smallest  # told again where it halves


@pytest.mark.mpi
def test_contact_warning_made_an_error_is_raised_on_all_ranks_with_its_step_taken():
    scene, seen = plate(), []
    for name in ("floor", "double floor"):
        scene.obstacle(name, Plane((0.0, 0.0, -REACH)), Barrier(500.0, REACH))
    scene.launch((0.0, 0.0, -1.0))
    made, note = build(scene), {"on_accept": lambda step, _: seen.append(step.time)}
    with pytest.raises(ContactWarning, match="obstacle 'floor'"):
        solve_dynamic(made, [0.012], fixed(1e-4), record=QUIET, **note)
    assert seen[-1] == made.problem.time
    first, second = made.contacts
    assert first.smallest == second.smallest < 0.01 * REACH


def press(speed):
    """A plate at rest over a plane that rises."""
    scene = plate()
    rise = {"motion": lambda time: (0.0, 0.0, speed * time)}
    scene.obstacle("press", Plane((0.0, 0.0, -REACH)), HARD, **rise)
    return scene


def test_press_throws_a_plate_up_at_twice_its_speed_and_its_work_is_booked():
    exact, work = 2.0 * RHO * H * 0.1**2, []
    for steps in (40, 80):
        size = CONTACT / steps
        result = solve_dynamic(press(1.0), [1.4 * steps * size], fixed(size), record=QUIET)
        history = result.history
        assert 0 < result.model.contacts[0].smallest < REACH
        assert abs(history["imbalance"]).max() < 1e-9 * exact
        work.append(history["work"][-1])
    assert mean_velocity(result.model)[2] == pytest.approx(2.0, rel=1e-3)
    assert history["energy_kinetic"][-1] == pytest.approx(exact, rel=2e-3)
    assert order([abs(w - exact) for w in work]) > 1.9
    assert work[1] == pytest.approx(exact, rel=1e-3)


@pytest.mark.mpi
def test_press_that_closes_the_gap_in_one_fixed_step_is_an_error():
    made = build(press(1.0))
    with pytest.raises(SolveError, match=r"fixed step 0\.05 failed: an obstacle or a sup"):
        solve_dynamic(made, [0.05], fixed(0.05), record=QUIET)
    assert (made.x.array_r == 0).all() and made.problem.time == 0
    result = solve_dynamic(press(1.0), [0.05], TimeSettings(step=0.05), record=QUIET)
    assert result.history["cuts"].sum() > 0  # shorter steps pass
    assert mean_velocity(result.model)[2] == pytest.approx(2.0, rel=0.05)


def test_support_that_moves_into_an_obstacle_is_an_error():
    scene = plate()
    scene.move("sheet", x=0.0, y=0.0, z=lambda time: -time)
    scene.obstacle("floor", Plane((0.0, 0.0, -REACH)), bearing(LOAD))
    settings = TimeSettings(step=1e-3, smallest=5e-4, largest=1e-3)
    message = (
        r"step of the smallest size 0\.0005 failed: an obstacle or a support would close a gap"
    )
    quiet = Record(energies=False, fields="none")
    with pytest.raises(SolveError, match=message) as caught:
        solve_dynamic(scene, [0.02], settings, record=quiet)
    assert 0.008 < caught.value.load_factor < 0.01
