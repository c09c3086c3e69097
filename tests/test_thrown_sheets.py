"""Random sheets thrown at random obstacles: no penetration, no NaN, no silent failure."""

import warnings
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from contact_scenes import QUIET, RHO, G, H, distance, nodes
from pattern_samples import random_rotation

from ufl_origami.discretise import build
from ufl_origami.dynamics import solve_dynamic
from ufl_origami.errors import AccuracyWarning, ContactWarning, SolveError
from ufl_origami.friction_laws import Anisotropic, Coulomb, Direction, OneWay
from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.meshing import mesh_pattern
from ufl_origami.obstacles import Box, Cylinder, Plane, Sphere
from ufl_origami.pattern import CreasePattern
from ufl_origami.scene import Scene
from ufl_origami.scene_surroundings import spin
from ufl_origami.solvers.dynamics import TimeSettings
from ufl_origami.suggestions import suggest_barrier

SEEDS = range(30)
QUICK = (0, 1, 6, 23, 25, 29)
DURATION = 0.2
CLEAR = 0.05  # between sheet and obstacles at the start


def random_pattern(rng):
    """A Z-fold or a rectangle, turned any way about the origin."""
    if rng.uniform() < 0.6:
        pattern = z_fold(1.0, rng.uniform(0.7, 1.3), rng.uniform(30.0, 170.0))
    else:
        long = rng.uniform(0.7, 1.3)
        corners = [(0, 0, 0), (long, 0, 0), (long, 1, 0), (0, 1, 0)]
        pattern = CreasePattern.from_arrays(corners, [(0, 1, 2, 3)])
    points = pattern.vertices_coords - pattern.vertices_coords.mean(axis=0)
    return replace(pattern, vertices_coords=points @ random_rotation(rng).T)


def random_body(rng, reach, way):
    """A ball, cylinder or box in the way of a sheet of a radius about the origin."""
    size = rng.uniform(0.2, 0.6)
    kind = rng.integers(3)
    corner = {0: size, 1: size, 2: 0.5 * np.sqrt(3) * size}[int(kind)]
    centre = way / np.linalg.norm(way) * (reach + corner + CLEAR)
    if kind == 0:
        return Sphere(centre, size)
    frame = random_rotation(rng)
    if kind == 1:
        return Cylinder(centre, np.cross(way, frame[0]), size)  # at right angles to the way
    return Box(centre, (size, size, size), (frame[0], frame[1]))


def random_law(rng):
    mu, eps, vector = rng.uniform(0.1, 0.8), rng.uniform(0.02, 0.2), rng.normal(size=3)
    where = Direction(vector, carried=bool(rng.integers(2)))
    laws = (Coulomb(mu, eps), Anisotropic(mu, 0.5 * mu, where, eps), OneWay(mu, where, eps))
    return laws[rng.integers(3)]


def random_scene(seed):
    """Scene of one seed."""
    rng = np.random.default_rng(seed)
    pattern = random_pattern(rng)
    sheet = mesh_pattern(pattern, rng.choice([0.34, 0.5]), structure="structured")
    young = 10.0 ** rng.uniform(6, 8)
    scene = Scene(sheet, Material(young, 0.3, H, RHO))
    for crease in sheet.creases:
        scene.crease(crease, young * H**3 * 10.0 ** rng.uniform(-2, 1))
    speed, reach = rng.uniform(0.5, 8.0), np.linalg.norm(sheet.rest, axis=1).max()
    way = rng.normal(size=3) - [0, 0, 1.5]
    velocity, rate = speed * way / np.linalg.norm(way), rng.normal(size=3) * 3.0
    scene.launch(velocity)
    scene.launch(spin(rate))
    scene.gravity((0.0, 0.0, -G))
    fastest = speed + np.linalg.norm(rate) * reach + G * DURATION
    if seed % 2:
        for panel in sheet.panel_names:
            scene.magnetise(panel, 0.05 * rng.normal(size=3))
        omega, field = rng.uniform(0, 30), 0.05 * rng.normal(size=(2, 3))
        scene.magnetic_field(lambda t: field[0] * np.cos(omega * t) + field[1] * np.sin(omega * t))
    barrier = suggest_barrier(scene, speed=fastest)
    bodies = {"floor": Plane((0, 0, -reach - CLEAR)), "body": random_body(rng, reach, way)}
    for name, body in bodies.items():
        scene.obstacle(name, body, barrier)
        scene.friction(name, random_law(rng), lagged=bool(rng.integers(2)))
    return scene, bodies, ("bdf2", "implicit_euler")[seed // 2 % 2]


@dataclass
class Flight:
    """What came of one scene."""

    model: object
    bodies: dict
    scheme: str
    smallest: float = np.inf
    steps: int = 0
    failure: str = ""
    history: object = None
    warnings: list = field(default_factory=list)

    def __call__(self, step, model):
        """Look at an accepted state."""
        where = nodes(model)
        assert np.isfinite(model.x.array_r).all() and np.isfinite(model.motion.v.array_r).all()
        gaps = [distance(body, where).min() for body in self.bodies.values()]
        self.smallest, self.steps = min(self.smallest, *gaps), self.steps + 1


def throw(seed):
    """Follow a scene; check every accepted state and what a failure says."""
    scene, bodies, scheme = random_scene(seed)
    flight = Flight(build(scene), bodies, scheme)
    settings = TimeSettings(step=2e-3, largest=0.02)
    with warnings.catch_warnings(record=True) as flight.warnings:
        warnings.simplefilter("always")
        try:
            result = solve_dynamic(
                flight.model, [DURATION], settings, scheme=scheme, record=QUIET, on_accept=flight
            )
            flight.history = result.history
        except SolveError as error:
            flight.failure = error.reason
            assert error.reason and error.load_factor == flight.model.problem.time
    return flight


def check(flight):
    """What holds for every scene, however it ended."""
    assert flight.steps > 0 and flight.smallest > 0
    told = {warning.category for warning in flight.warnings}
    assert told <= {AccuracyWarning, ContactWarning}, flight.warnings
    for contact in flight.model.contacts:
        assert contact.smallest >= flight.smallest * (1 - 1e-9)
    if flight.failure:
        return
    history = flight.history
    assert history["time"][-1] == DURATION
    assert all(np.isfinite(history[name].astype(float)).all() for name in ENERGIES)
    largest = history["energy_kinetic"].max()
    assert abs(history["imbalance"]).max() < 1e-8 * largest
    rubbed = history["lost_friction"]
    assert rubbed[-1] >= 0
    if flight.scheme == "implicit_euler":  # whose way is along the velocity that friction sees
        assert (np.diff(rubbed) > -1e-10 * largest).all()


ENERGIES = ("energy_kinetic", "energy_total", "work", "lost_integrator", "imbalance")


@pytest.mark.parametrize("seed", QUICK)
def test_thrown_sheet_ends_without_penetration(seed):
    flight = throw(seed)
    check(flight)
    assert not flight.failure
    assert flight.smallest < H  # it did hit something


@pytest.mark.slow
def test_thirty_thrown_sheets_end_without_penetration_or_silent_failure():
    flights = {seed: throw(seed) for seed in SEEDS}
    for flight in flights.values():
        check(flight)
    failures = {seed: flight.failure for seed, flight in flights.items() if flight.failure}
    assert len(failures) <= 2, failures
    assert sum(flight.smallest < H for flight in flights.values()) >= 28
    assert sum("energy_magnetic" in f.history.columns for f in flights.values() if f.history) >= 13
