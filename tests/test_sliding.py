"""Blocks that slide, creep, stop and are carried along, against exact solutions."""

import numpy as np
import pytest
from contact_scenes import RHO, G, H, fixed, mean_velocity, plate, resting

from ufl_origami.barrier import Barrier
from ufl_origami.dynamics import solve_dynamic
from ufl_origami.friction_laws import Anisotropic, Coulomb, Direction, OneWay
from ufl_origami.history import Record
from ufl_origami.obstacles import Plane

MU, EPS = 0.3, 0.2
ALONG, ACROSS = np.array([0.6, 0.8, 0.0]), np.array([-0.8, 0.6, 0.0])


def block(model="ddg", slope=0.0):
    """A stiff plate at rest on its floor."""
    return resting(plate(model=model, E=1e9), slope)


def slide(scene, velocity, law, end, *, step=0.01, lagged=False, scheme="bdf2"):
    """Result of a block launched on its floor, its velocity recorded."""
    scene.friction("floor", law, lagged=lagged)
    scene.launch(velocity)
    speeds = {f"v{'xyz'[k]}": lambda m, k=k: mean_velocity(m)[k] for k in range(3)}
    record = Record(fields="none", extra=speeds)
    return solve_dynamic(scene, [end], fixed(step), scheme=scheme, record=record)


def stopping_distance(speed, mu, eps):
    """Way of a block under the regularised law until it stands."""
    return (speed**2 - eps**2) / (2 * mu * G) + np.log(2) * eps**2 / (mu * G)


def centre(model):
    """Displacement of the centre of mass."""
    motion, x = model.motion, model.x
    still = x.duplicate()
    still.set(0.0)
    return motion.centre(x) - motion.centre(still)


@pytest.mark.parametrize(
    ("model", "lagged"),
    [pytest.param("ddg", False, marks=pytest.mark.mpi), ("ddg", True), ("fem", False)],
)
def test_block_slides_the_exact_distance(model, lagged):
    result = slide(block(model), (1.0, 0.0, 0.0), Coulomb(MU, EPS), 0.6, lagged=lagged)
    way, exact = centre(result.model), stopping_distance(1.0, MU, EPS)
    assert way[0] == pytest.approx(exact, rel={"ddg": 1e-3, "fem": 3e-3}[model])
    assert abs(way[1]) < 1e-9
    history = result.history
    energy = history["energy_kinetic"][0]
    assert history["energy_kinetic"][-1] < 1e-6 * energy
    assert history["lost_friction"][-1] == pytest.approx(energy, rel=0.01)
    assert abs(history["imbalance"]).max() < 1e-8 * energy


@pytest.mark.parametrize("lagged", [False, True])
def test_block_creeps_below_the_threshold_and_accelerates_above(lagged):
    law = Coulomb(MU, EPS)
    gentle, steep = np.arctan(0.5 * MU), np.arctan(2.0 * MU)
    creep = EPS * (1 - np.sqrt(1 - 0.5))
    result = slide(block(slope=gentle), (0.0, 0.0, 0.0), law, 0.8, step=0.02, lagged=lagged)
    assert mean_velocity(result.model)[0] == pytest.approx(creep, rel=1e-6)
    result = slide(block(slope=steep), (1.5 * EPS, 0.0, 0.0), law, 0.1, step=0.01, lagged=lagged)
    speed, time = result.history["vx"], result.history["time"]
    exact = G * (np.sin(steep) - MU * np.cos(steep)) * time
    assert speed - speed[0] == pytest.approx(exact, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("across", [False, True])
def test_anisotropic_block_slides_as_far_as_its_direction_lets_it(across):
    law = Anisotropic(0.2, 0.5, Direction(ALONG), 0.1)
    mu, vector = (0.5, ACROSS) if across else (0.2, ALONG)
    result = slide(block(), vector, law, 0.9 if not across else 0.5)
    way, exact = centre(result.model), stopping_distance(1.0, mu, 0.1 * 0.5 / mu)
    assert way @ vector == pytest.approx(exact, rel=2e-3)
    assert np.cross(way, vector)[2] == pytest.approx(0.0, abs=1e-9)


def test_anisotropic_block_turns_towards_the_direction_that_brakes_least():
    law = Anisotropic(0.2, 0.4, Direction(ALONG), 0.1)
    history = slide(block(), ALONG + ACROSS, law, 0.25).history
    v = np.column_stack([history["vx"], history["vy"]])
    along, across = v @ ALONG[:2], v @ ACROSS[:2]
    assert across[-1] < 0.3
    assert np.log(along[1:]) == pytest.approx(0.25 * np.log(across[1:]), rel=0.01, abs=2e-4)


def test_one_way_block_is_free_backwards_and_braked_forwards():
    law = OneWay(MU, Direction(ALONG), EPS)
    back = slide(block(), ACROSS - ALONG, law, 0.1).model
    assert mean_velocity(back) == pytest.approx(ACROSS - ALONG, abs=1e-9)
    ahead = slide(block(), ACROSS + ALONG, law, 0.1).model
    slowed = ACROSS + (1 - MU * G * 0.1) * ALONG
    assert mean_velocity(ahead) == pytest.approx(slowed, abs=1e-9)


def test_conveyor_carries_a_block_along_and_its_work_is_booked():
    speed, mu, eps = 1.0, 0.5, 0.05
    scene = plate(E=1e9)
    barrier = resting(plate()).obstacles[0].barrier
    scene.gravity((0.0, 0.0, -G))
    travel = {"motion": lambda time: (speed * time, 0.0, 0.0)}
    scene.obstacle("floor", Plane((0.0, 0.0, -0.5 * barrier.distance)), barrier, **travel)
    result = slide(scene, (0.0, 0.0, 0.0), Coulomb(mu, eps), 0.4, step=4e-3)
    history, mass = result.history, RHO * H * 0.1**2
    assert mean_velocity(result.model) == pytest.approx([speed, 0, 0], abs=1e-6)
    lag = speed * 0.4 - centre(result.model)[0]
    assert lag == pytest.approx(stopping_distance(speed, mu, eps), rel=3e-3)
    kinetic, heat = history["energy_kinetic"][-1], history["lost_friction"][-1]
    assert kinetic == pytest.approx(0.5 * mass * speed**2, rel=1e-5)
    assert heat == pytest.approx(0.5 * mass * speed**2, rel=0.01)
    assert history["work"][-1] == pytest.approx(kinetic + heat, rel=0.01)
    assert abs(history["imbalance"]).max() < 1e-8 * kinetic


def oblique(steps, *, lagged):
    """Way and velocity of a plate thrown askew onto a floor on which it slips all the time."""
    barrier, contact = Barrier(5e4, 0.01), 0.0206810  # as in test_impacts.py
    scene = plate(E=1e9)
    scene.obstacle("floor", Plane((0.0, 0.0, -0.01)), barrier)
    size = contact / steps
    model = slide(
        scene, (1.0, 0.0, -1.0), Coulomb(MU, 0.01), 1.25 * contact, step=size, lagged=lagged
    ).model
    return centre(model)[0], mean_velocity(model)


def test_lagged_friction_approaches_the_implicit_one_with_order_one():
    apart = []
    for steps in (12, 24, 48):
        (implicit, speed), (lagged, _) = (oblique(steps, lagged=choice) for choice in (False, True))
        apart.append(abs(lagged - implicit))
    assert -np.polyfit(range(3), np.log2(apart), 1)[0] == pytest.approx(1.0, abs=0.1)
    # the impulse of friction is mu times that of the bounce
    assert speed[0] == pytest.approx(1 - MU * (speed[2] + 1), abs=2e-3)
    assert speed[2] == pytest.approx(1.0, abs=2e-3)
