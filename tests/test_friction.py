"""Friction: its laws, its forces with their exact tangents, and the places that have it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from contact_scenes import areas, forces, nodes, plate, resting
from dolfinx import fem
from scenes import build, disturb
from test_terms import direction, remainders, skew_part

from ufl_origami.barrier import Barrier
from ufl_origami.errors import InputError, SceneError
from ufl_origami.friction_laws import Anisotropic, Coulomb, Direction, OneWay
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.obstacles import Plane, Sphere
from ufl_origami.problem import Problem
from ufl_origami.scene import Scene
from ufl_origami.terms.base import Rates

MU, EPS = 0.3, 0.2
ALONG, ACROSS = np.array([0.6, 0.8, 0.0]), np.array([-0.8, 0.6, 0.0])
LAWS = {
    "coulomb": Coulomb(MU, EPS),
    "anisotropic": Anisotropic(0.2, 0.5, Direction(2 * ALONG), EPS),
    "one way": OneWay(MU, Direction(2 * ALONG), EPS),
}


@cache
def cloud():
    """A model of 162 triangles, on each of which something slips in its own way."""
    return build(plate((9, 9)))


@cache
def law_functions(name):
    """A law's potential and drag as functions of slips (162, 3)."""
    functions, law = cloud().functions, LAWS[name]
    slip, cells = functions.piecewise(np.zeros((162, 3))), np.arange(162, dtype=np.int32)

    def carry(given):
        return functions.number(np.array(given.vector) / np.linalg.norm(given.vector))

    def function(expression):
        compiled = fem.Expression(expression, np.array([[0.3, 0.3]]))

        def values(slips):
            slip.x.array[:] = np.ravel(slips)
            return compiled.eval(functions.sheet.mesh, cells).reshape(np.shape(slips)[0], -1)

        return values

    return [function(part(slip, functions.number, carry)) for part in (law.potential, law.drag)]


def slips(seed=1):
    """Speeds from 0.1 to 2 eps in all directions of the plane z = 0."""
    rng = np.random.default_rng(seed)
    angle, speed = rng.uniform(0, 2 * np.pi, 162), EPS * rng.uniform(0.1, 2.0, 162)
    return np.outer(speed * np.cos(angle), ALONG) + np.outer(speed * np.sin(angle), ACROSS)


@pytest.mark.parametrize("name", LAWS)
def test_drag_is_the_derivative_of_the_potential(name):
    potential, drag = law_functions(name)
    here, way = slips(), slips(2)
    step = 1e-5
    slope = (potential(here + step * way) - potential(here - step * way))[:, 0] / (2 * step)
    found = (drag(here) * way).sum(axis=1)
    assert abs(found).max() > 0.05
    assert found == pytest.approx(slope, abs=1e-7)
    assert drag(np.zeros((162, 3))) == pytest.approx(np.zeros((162, 3)), abs=1e-9)


def test_coulombs_drag_rises_to_all_of_it_at_eps():
    drag = law_functions("coulomb")[1]
    here = slips()
    y = np.linalg.norm(here, axis=1) / EPS
    size = MU * np.where(y < 1, 2 * y - y**2, 1.0)
    assert drag(here) == pytest.approx(here * (size / y / EPS)[:, None], rel=1e-12, abs=1e-15)
    near = np.linspace(0.999, 1.001, 162)
    sizes = drag(np.outer(near * EPS, ACROSS)) @ ACROSS
    assert (np.diff(sizes) > -1e-15).all()
    assert sizes[near >= 1] == pytest.approx(MU, rel=1e-14)
    assert 1 - sizes[0] / MU == pytest.approx(1e-6, rel=1e-6)  # of second order: no kink


def test_anisotropic_drag_lies_on_the_ellipse_and_opposes_its_normal():
    drag = law_functions("anisotropic")[1]
    here = slips()
    along, across = here @ ALONG, here @ ACROSS
    y = np.hypot(0.2 * along, 0.5 * across) / (0.5 * EPS)
    found = drag(here)
    ratio = np.hypot(found @ ALONG / 0.2, found @ ACROSS / 0.5)
    assert ratio == pytest.approx(np.where(y < 1, 2 * y - y**2, 1.0), rel=1e-12)
    normal = np.column_stack([found @ ALONG / 0.2**2, found @ ACROSS / 0.5**2])
    slip = np.column_stack([along, across])
    assert normal[:, 0] * slip[:, 1] == pytest.approx(normal[:, 1] * slip[:, 0], abs=1e-12)
    assert ((normal * slip).sum(axis=1) > 0).all()
    for vector, mu in ((ALONG, 0.2), (ACROSS, 0.5)):
        assert drag(np.tile(3 * EPS * vector, (162, 1)))[0] == pytest.approx(mu * vector)


def test_one_way_drag_is_free_backwards_and_across():
    drag = law_functions("one way")[1]
    here = slips()
    y = here @ ALONG / EPS
    size = MU * np.select([y < 0, y < 1], [0.0, 3 * y**2 - 2 * y**3], 1.0)
    assert (y < 0).any() and ((y > 0) & (y < 1)).any() and (y > 1).any()
    assert drag(here) == pytest.approx(np.outer(size, ALONG), rel=1e-12, abs=1e-15)


REFUSED = {
    "friction: mu: -0.1 must not be negative": lambda: Coulomb(-0.1, EPS),
    "friction: mu: expected a finite number": lambda: Coulomb(np.nan, EPS),
    "friction: eps: 0.0 must be positive": lambda: Coulomb(MU, 0.0),
    "friction: mu_across: -0.5 must not": lambda: Anisotropic(0.2, -0.5, Direction(ALONG), EPS),
    "friction: larger coefficient: 0.0": lambda: Anisotropic(0.0, 0.0, Direction(ALONG), EPS),
    "friction: direction: the vector is zero": lambda: OneWay(MU, Direction((0.0,) * 3), EPS),
    "friction: direction: expected 3 finite": lambda: OneWay(MU, Direction((1.0, 0.0)), EPS),
    "friction: eps: -1.0 must be positive": lambda: OneWay(MU, Direction(ALONG), -1.0),
    r"\(1, 0, 0\) is no direction: Direction\(": lambda: OneWay(MU, (1, 0, 0), EPS),
    "'x' is no direction": lambda: Anisotropic(0.2, 0.5, "x", EPS),
    "no obstacle is named 'roof'; there are": lambda: block().friction("roof", LAWS["coulomb"]),
    "on 'floor': 0.3 is no friction law": lambda: block().friction("floor", 0.3),
}


def test_laws_and_places_that_are_none_are_refused():
    for message, make in REFUSED.items():
        with pytest.raises(SceneError, match=message):
            make()
    with pytest.raises(InputError, match="'x2'"):
        block().friction("floor", LAWS["coulomb"], on=["x2"])


@pytest.mark.mpi
def test_friction_of_places_that_cannot_touch_is_refused(comm):
    scene = Scene(rectangle(1.0, 1.0, n=(2, 2), comm=comm), Material(1e8, 0.3, 0.01, rho=1.0))
    scene.obstacle("body", BODIES["plane"], WIDE, on=["x0"])
    scene.friction("body", LAWS["coulomb"], on=["y0"])  # they have a corner in common
    assert len(build(scene).in_time) == 1
    scene.friction("body", LAWS["coulomb"], on=["x1"])
    with pytest.raises(SceneError, match=r"on 'body': none of \['x1'\] can touch the obstacle"):
        build(scene)


def block():
    """A plate at rest on its floor."""
    return resting(plate())


WIDE = Barrier(7.0, 0.6)  # all nodes are inside of its reach, and stay there
BODIES = {
    "plane": Plane((0.3, 0.2, -0.25), (0.2, -0.1, 1.0)),
    "sphere": Sphere((0.4, 0.5, -2.2), 1.95),
}
TIMES = (0.3, 0.1)  # end and start of a step
RATE = 2.5


def belt(time):
    return np.array([0.3, -0.2, 0.1]) * time


def rubbing(body, law, *, model="ddg", lagged=False):
    """A soft disturbed sheet in mid step: contact, friction and their forces are all there is."""
    scene = plate((2, 2), side=1.0, model=model, E=1e-9)
    scene.obstacle("body", BODIES[body], WIDE, motion=belt)
    scene.friction("body", law, lagged=lagged)
    made = disturb(build(scene), 0.02, seed=3)
    configuration = made.configuration
    whole = Problem(configuration, [*made.problem.terms, *made.in_time], made.problem.constraints)
    whole.set_time(TIMES[0])
    old = configuration.to_local(made.x)
    disturb(made, 0.05)
    rates = Rates(RATE, RATE**2, (1.0,), (TIMES[1],), last=old, base=old, target=old)
    whole.begin_step(rates)
    return replace(made, problem=whole), old


def assert_tangent_is_exact(model):
    """Forces change as the tangent says, but for terms of second order."""
    problem, x = model.problem, model.x
    d, start, product = direction(model), x.duplicate(), x.duplicate()
    problem.forces(x, start)
    problem.linearise(None, x)
    problem.stiffness(x).mult(d, product)
    steps, left = 0.003 * 0.5 ** np.arange(5), []
    for t in steps:
        y, force = x.copy(), x.duplicate()
        y.axpy(t, d)
        problem.forces(y, force)
        force.axpy(-1.0, start)
        force.axpy(-t, product)
        left.append(force.norm())
    assert np.polyfit(np.log(steps), np.log(left), 1)[0] == pytest.approx(2.0, abs=0.1)


CASES = [
    ("ddg", "plane", "coulomb"),
    pytest.param("ddg", "sphere", "coulomb", marks=pytest.mark.mpi),
    ("fem", "sphere", "coulomb"),
    pytest.param("ddg", "sphere", "anisotropic", marks=pytest.mark.mpi),
    ("fem", "plane", "one way"),
]
cases = pytest.mark.parametrize(("model", "body", "law"), CASES)


@cases
def test_implicit_friction_has_an_exact_tangent_that_is_not_symmetric(model, body, law):
    made, _ = rubbing(body, LAWS[law], model=model)
    assert_tangent_is_exact(made)
    assert not made.problem.symmetric and not made.problem.conservative
    matrix = made.problem.stiffness(made.x)
    assert skew_part(matrix) > 1e-2 * matrix.norm()


@cases
def test_lagged_friction_has_a_potential_and_an_exact_symmetric_tangent(model, body, law):
    made, _ = rubbing(body, LAWS[law], model=model, lagged=True)
    assert made.problem.symmetric and made.problem.conservative
    energies = made.problem.energies(made.x)
    assert energies["friction"] > 1e-3 * energies["contact"]
    for order in (1, 2):
        steps, left = remainders(made, order)
        slope = np.polyfit(np.log(steps), np.log(left), 1)[0]
        assert slope == pytest.approx(order + 1, abs=0.1)
    matrix = made.problem.stiffness(made.x)
    assert skew_part(matrix) < 1e-12 * matrix.norm()


@pytest.mark.parametrize("lagged", [False, True])
@pytest.mark.parametrize("model", ["ddg", "fem"])
def test_drag_on_a_sphere_opposes_sliding_by_mu_times_the_pressure(model, lagged):
    made, old = rubbing("sphere", LAWS["coulomb"], model=model, lagged=lagged)
    body, dofs = BODIES["sphere"], made.functions.dofs
    rest = made.functions.V.tabulate_dof_coordinates()
    before, here = rest + old[dofs].reshape(-1, 3), nodes(made)
    where, time = (before, TIMES[1]) if lagged else (here, TIMES[0])
    arm = where - body.centre - belt(time)
    far = np.linalg.norm(arm, axis=1)
    normal, pressure = arm / far[:, None], [WIDE.pressure(gap) for gap in far - body.radius]
    slip = RATE * (here - before) - RATE * (belt(TIMES[0]) - belt(TIMES[1]))
    slip -= (slip * normal).sum(axis=1)[:, None] * normal
    y = np.linalg.norm(slip, axis=1) / EPS
    assert (y < 1).any() and (y > 1).any()
    size = MU * np.where(y < 1, 2 * y - y**2, 1.0) * pressure * areas(made)
    expected = -slip * (size / y / EPS)[:, None]
    scale = abs(expected).max()
    assert forces(made.in_time[0], made) == pytest.approx(expected, abs=1e-12 * scale)


def test_friction_acts_on_the_named_places_and_declarations_add_up():
    scene = plate((2, 2), side=1.0)
    scene.obstacle("body", BODIES["plane"], WIDE)
    scene.friction("body", LAWS["coulomb"])
    scene.friction("body", LAWS["coulomb"], on=["x1", "x0y0"])
    made = disturb(build(scene), 0.05)
    zero = np.zeros(made.configuration.num_local)
    for term in made.in_time:
        term.begin_step(Rates(RATE, RATE**2, (1.0,), (0.0,), last=zero, base=zero, target=zero))
    everywhere, somewhere = (forces(term, made) for term in made.in_time)
    rest = made.functions.V.tabulate_dof_coordinates()
    named = (rest[:, 0] > 1 - 1e-9) | (rest[:, 0] + rest[:, 1] < 1e-9)
    assert named.sum() == 4 and (abs(everywhere).max(axis=1) > 0).all()
    assert somewhere[named] == pytest.approx(everywhere[named], rel=1e-14)
    assert (somewhere[~named] == 0).all()
