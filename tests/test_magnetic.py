"""Magnetised panels: forces, torques and tangents, pendulum, elastica, buckling, wrong scenes."""

import numpy as np
import pytest
import ufl
from scenes import build, disturb, follow, strip_scene
from scipy.constants import mu_0
from scipy.special import ellipk
from test_terms import remainders

from ufl_origami.analytic.elastica import cantilever_end_shear
from ufl_origami.dynamics import solve_dynamic
from ufl_origami.errors import InputError, SceneError, StabilityWarning
from ufl_origami.gallery import z_fold
from ufl_origami.history import Record
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.meshing import mesh_pattern
from ufl_origami.scene import Scene
from ufl_origami.solvers.dynamics import TimeSettings
from ufl_origami.terms.magnetic import MagneticTerm

MODELS = ("ddg", "fem")
LENGTH, WIDTH, H = 2.0, 1.0, 0.01
VOLUME = LENGTH * WIDTH * H
IN_PLANE, NORMAL, OBLIQUE = (0.3, -0.2, 0.0), (0.0, 0.0, 0.4), (0.3, -0.2, 0.4)
FIELD = np.array([0.02, 0.05, -0.03])


def plate(comm, model="ddg", remanence=OBLIQUE, field=FIELD, **material):
    """A free rectangle, so soft by default that next to nothing but the magnets shows."""
    sheet = rectangle(LENGTH, WIDTH, n=(3, 2), comm=comm)
    scene = Scene(sheet, Material(**{"E": 1e-3, "nu": 0.3, "h": H} | material), model=model)
    scene.magnetise(sheet.panel_names[0], remanence)
    scene.magnetic_field(field)
    return scene


def magnets(model):
    return next(term for term in model.problem.terms if isinstance(term, MagneticTerm))


def shape(model, matrix, shift=(0.0, 0.0, 0.0)):
    """Put the sheet where an affine map takes it."""
    configuration, functions = model.configuration, model.functions
    rest = functions.V.tabulate_dof_coordinates()
    moved = rest @ np.transpose(matrix) + shift - rest
    owned = configuration.owns(functions.dofs)
    model.x.array_w[configuration.owned_dofs(functions.dofs[owned])] = moved.ravel()[owned]
    return model


def wrench(model):
    """Force (3,) and torque (3,) about the origin that the field exerts."""
    state, dofs = model.state, model.functions.dofs.reshape(-1, 3)
    share = np.zeros(model.configuration.num_local)
    magnets(model).add_residual(state, share)
    places = model.functions.V.tabulate_dof_coordinates() + state.q[dofs]
    torque = np.cross(places, -share[dofs]).sum(axis=0)
    total = model.configuration.sum([*-share[dofs].sum(axis=0), *torque])
    return total[:3], total[3:]


def rotation(axis, angle):
    """Rodrigues' formula."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


TURN = rotation((1.0, -2.0, 0.5), 2.2)
STRETCH = TURN @ np.array([[1.2, 0.3, 0.0], [-0.1, 0.8, 0.0], [0.0, 0.0, 1.0]])


# --- energy, force and torque


@pytest.mark.parametrize("model", MODELS)
def test_energy_of_each_panel_is_its_dipole_moment_in_the_field(model):
    """Its own volume and remanence over mu_0; a panel that is not magnetised has none."""
    sheet = mesh_pattern(z_fold(widths=(1.0, 0.5), included_angle=180.0), 0.5)
    materials = {"left": Material(1.0, 0.3, 0.01), "right": Material(1.0, 0.3, 0.03)}
    for both in (False, True):
        scene = Scene(sheet, materials, model=model)
        scene.crease("crease", 1.0)
        scene.magnetise("right", (0.3, -0.2, 0.4))
        if both:
            scene.magnetise("left", (-0.1, 0.6, 0.2))
        scene.magnetic_field(FIELD)
        found = build(scene)
        found.problem.set_time(1.0)
        moment = np.array([0.3, -0.2, 0.4]) * 0.5 * 0.03
        moment += both * np.array([-0.1, 0.6, 0.2]) * 1.0 * 0.01
        assert found.energies()["magnetic"] == pytest.approx(-moment @ FIELD / mu_0, rel=1e-12)


@pytest.mark.mpi
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("remanence", [IN_PLANE, NORMAL, OBLIQUE])
def test_uniform_field_turns_and_does_not_pull(comm, model, remanence):
    """Torque m x B on a plate that is turned and sheared.

    The in-plane part of the remanence is carried as a material line is, the normal one stays a
    unit normal.
    """
    found = build(plate(comm, model, remanence))
    found.problem.set_time(1.0)
    for matrix in (TURN, STRETCH):
        shape(found, matrix, shift=(0.3, 0.1, -0.7))
        normal = np.cross(matrix[:, 0], matrix[:, 1])
        carried = matrix[:, :2] @ remanence[:2] + remanence[2] * normal / np.linalg.norm(normal)
        moment = VOLUME / mu_0 * carried
        force, torque = wrench(found)
        assert found.energies()["magnetic"] == pytest.approx(-moment @ FIELD, rel=1e-12)
        assert torque == pytest.approx(np.cross(moment, FIELD), rel=1e-11)
        assert np.abs(force).max() < 1e-12 * np.linalg.norm(torque) / WIDTH


@pytest.mark.parametrize("model", MODELS)
def test_field_that_varies_pulls_a_dipole_up_its_gradient(comm, model):
    """Force (m . grad) B and the change of energy over a way of the plate, for a linear field."""
    gradient = np.array([[0.4, 0.1, 0.2], [0.1, -0.7, 0.0], [0.2, 0.0, 0.3]])
    field = lambda place, time: time * ufl.dot(ufl.as_matrix(gradient.tolist()), place)  # noqa: E731
    found = build(plate(comm, model, field=field))
    found.problem.set_time(0.5)
    moment, energies = VOLUME / mu_0 * TURN @ OBLIQUE, []
    way = np.array([0.5, -0.4, 0.3])
    for part in (0.0, 1.0):
        shape(found, TURN, shift=part * way)
        force, _ = wrench(found)
        assert force == pytest.approx(0.5 * gradient @ moment, rel=1e-11)
        energies.append(found.energies()["magnetic"])
    assert energies[0] - energies[1] == pytest.approx(0.5 * way @ gradient @ moment, rel=1e-11)


@pytest.mark.parametrize("model", MODELS)
def test_plate_falls_up_a_gradient_as_a_mass_under_gravity(comm, model):
    """A normal dipole in B_z = b z: acceleration B_r b / (mu_0 rho), by implicit Euler exactly."""
    field = lambda place, time: ufl.as_vector((0.0, 0.0, 0.05 * place[2]))  # noqa: E731
    scene = plate(comm, model, NORMAL, field, E=1e7, rho=1e3)
    dt, steps = 0.01, 3
    record = Record(fields="none", extra={"z": lambda m: m.position("x1y1")[2]})
    settings = TimeSettings(step=dt, fixed=True)
    result = solve_dynamic(scene, [dt * steps], settings, scheme="implicit_euler", record=record)
    n = np.arange(steps + 1)
    pull = NORMAL[2] * 0.05 / (mu_0 * 1e3)
    assert result.history["z"] == pytest.approx(0.5 * pull * dt**2 * n * (n + 1), rel=1e-8)


@pytest.mark.mpi
@pytest.mark.parametrize("model", MODELS)
def test_angles_and_directors_feel_no_field(comm, model):
    found = disturb(build(plate(comm, model)), 0.1)
    found.problem.set_time(1.0)
    term, state = magnets(found), found.state
    force = np.zeros(found.configuration.num_local)
    term.add_residual(state, force)
    angles = np.setdiff1d(np.arange(len(force)), found.functions.dofs)
    assert len(angles) > 0 and np.abs(force).max() > 0
    assert (force[angles] == 0.0).all()
    moved = np.zeros_like(force)
    moved[angles] = 0.3
    assert (term.energies(state.moved(moved)) == term.energies(state)).all()


# --- derivatives


def curved(place, time):
    """A field that varies in space and is no polynomial."""
    x, y, z = place
    return ufl.as_vector((0.02 * ufl.sin(2 * x + z), 0.03 * x * z**2, 0.05 * time * ufl.exp(y)))


@pytest.mark.mpi
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    ("remanence", "field"),
    [(NORMAL, FIELD), (OBLIQUE, curved)],
    ids=["normal, uniform", "both, varying"],
)
def test_taylor_remainders_fall_with_orders_two_and_three(comm, model, remanence, field):
    found = disturb(build(plate(comm, model, remanence, field)), 0.05)
    found.problem.set_time(0.7)
    energies = found.energies()
    assert abs(energies["magnetic"]) > 1e3 * (energies["membrane"] + energies["bending"])
    for order in (1, 2):
        steps, left = remainders(found, order)
        assert np.polyfit(np.log(steps), np.log(left), 1)[0] == pytest.approx(order + 1, abs=0.1)


@pytest.mark.parametrize("model", MODELS)
def test_in_plane_magnets_in_a_uniform_field_are_dead_loads(comm, model):
    """Their energy is linear in the displacement, so that its slope is all there is."""
    found = disturb(build(plate(comm, model, IN_PLANE)), 0.05)
    found.problem.set_time(1.0)
    term, state = magnets(found), found.state
    step = np.zeros(found.configuration.num_local)
    step[found.functions.dofs] = np.sin(1.0 + np.arange(len(found.functions.dofs)))
    force = np.zeros_like(step)
    term.add_residual(state, force)
    change = term.energies(state.moved(step)) - term.energies(state)
    assert abs(force @ step) > 1.0
    assert change == pytest.approx(force @ step, rel=1e-10)
    assert term.slope(state, step) == pytest.approx(force @ step, rel=1e-12)


# --- pendulum

SIDE, RHO, REMANENCE, FLUX = 0.01, 3000.0, 0.1, 5e-3  # metre, kg / m^3, tesla, tesla
STIFF = Material(E=1e9, nu=0.0, h=1e-3, rho=RHO)  # lambda = 5e-4


def swing(model, n, degrees, *, hinged, swings):
    """Angle from the field against time of a plate let go at an angle, over some quarter swings.

    Returns the angles, their times and the exact period, with the history.
    """
    angle = np.radians(degrees)
    sheet = rectangle(SIDE, SIDE / 4, n=n)
    scene = Scene(sheet, STIFF, model=model)
    scene.magnetise(sheet.panel_names[0], (REMANENCE, 0, 0))
    scene.magnetic_field((FLUX * np.cos(angle), 0, FLUX * np.sin(angle)))
    if hinged:
        scene.fix("x0")
    inertia_over_volume = RHO * SIDE**2 / (3 if hinged else 12)
    small = 2 * np.pi * np.sqrt(mu_0 * inertia_over_volume / (REMANENCE * FLUX))
    period = small * 2 / np.pi * ellipk(np.sin(angle / 2) ** 2)
    end = (swings / 4 + 0.03) * period
    settings = TimeSettings(step=end / np.ceil(100 * end / small), fixed=True)
    history = solve_dynamic(scene, [end], settings, record=Record(fields="none")).history
    x, z = (history[f"position_x1y0_{c}"] - history[f"position_x0y0_{c}"] for c in "xz")
    return np.unwrap(np.arctan2(z, x)) - angle, history["time"], period, history


def passages(angles, times):
    """Times at which the field's direction is passed."""
    last = np.flatnonzero(np.diff(np.sign(angles)))
    rate = (angles[last + 1] - angles[last]) / (times[last + 1] - times[last])
    return times[last] - angles[last] / rate


@pytest.mark.parametrize("degrees", [2.0, 30.0, 90.0])
def test_plate_swings_about_its_hinge_with_the_period_of_a_pendulum(degrees):
    """T = 2 pi sqrt(mu_0 I / (V B_r B)) 2/pi K(sin(angle / 2)) by first passage and half swing."""
    angles, times, period, history = swing("ddg", (8, 2), degrees, hinged=True, swings=3)
    first, second = passages(angles, times)
    assert 4 * first == pytest.approx(period, rel=0.01)
    assert 2 * (second - first) == pytest.approx(period, rel=0.01)
    volume = SIDE * SIDE / 4 * STIFF.h
    magnetic = history["energy_magnetic"]
    assert magnetic.min() == pytest.approx(-volume * REMANENCE * FLUX / mu_0, rel=2e-3)
    assert np.abs(history["imbalance"]).max() < 1e-6 * np.ptp(magnetic)


@pytest.mark.parametrize(("model", "n"), [("ddg", (8, 2)), ("fem", (2, 1))])
def test_first_passage_from_near_the_upper_rest_takes_a_quarter_of_the_long_period(model, n):
    angles, times, period, _ = swing(model, n, 170.0, hinged=True, swings=1)
    assert 4 * passages(angles, times)[0] == pytest.approx(period, rel=0.01)


def test_free_plate_swings_about_its_centre_which_stays():
    angles, times, period, history = swing("fem", (2, 1), 90.0, hinged=False, swings=1)
    assert 4 * passages(angles, times)[0] == pytest.approx(period, rel=0.01)
    for axis, rest in (("x", SIDE), ("z", 0.0)):
        ends = history[f"position_x1y0_{axis}"] + history[f"position_x0y0_{axis}"]
        assert np.abs(ends - rest).max() < 1e-6 * SIDE


# --- cantilever

L, THICK, EI_MODULUS = 10.0, 0.1, 1.2e6  # those of strip_scene


def flux_for(load):
    """Flux density times remanence for which 12 B_r B L^2 / (mu_0 E h^2) is a load."""
    return load * mu_0 * EI_MODULUS * THICK**2 / (12 * L**2)


def magnetised_strip(model, n, remanence, field):
    scene = strip_scene(n, model=model)
    scene.magnetise(scene.sheet.panel_names[0], remanence)
    scene.magnetic_field(field)
    return build(scene)


def end_angle(model):
    """Slope of the front edge at the free end, to second order from its last three nodes."""
    functions = model.functions
    rest = functions.V.tabulate_dof_coordinates()
    front = np.flatnonzero(np.isclose(rest[:, 1], 0.0))
    last = front[np.argsort(rest[front, 0])][:-4:-1]
    places = rest[last] + model.state.q[functions.dofs.reshape(-1, 3)[last]]
    x, _, z = np.array([3.0, -4.0, 1.0]) @ places
    return np.degrees(np.arctan2(z, x))


@pytest.mark.parametrize(("model", "n"), [("ddg", (24, 3)), ("fem", (6, 1))])
@pytest.mark.parametrize("kind", ["along", "normal"])
def test_magnetised_cantilever_is_the_elastica_of_an_end_force(model, n, kind):
    """Magnetised along in a field across it, or across in a field against it: the same torque."""
    unit = flux_for(1.0) / 0.5
    remanence, field = {
        "along": ((0.5, 0.0, 0.0), (0.0, 0.0, unit)),
        "normal": ((0.0, 0.0, 0.5), (-unit, 0.0, 0.0)),
    }[kind]
    table = {1.0: (26.434, 0.30172), 5.0: (69.635, 0.71379), 10.0: (81.949, 0.81061)}
    found = magnetised_strip(model, n, remanence, field)
    seen = {}

    def on_accept(step, x):
        seen[step.time] = end_angle(found), found.position("x1y0")[2] / L

    follow(found, tuple(table), first=1.0, on_accept=on_accept)
    for load, (angle, deflection) in table.items():
        exact = cantilever_end_shear(load)
        assert np.degrees(exact.angle) == pytest.approx(angle, abs=1e-3)
        assert exact.w == pytest.approx(deflection, abs=1e-5)
        assert seen[load] == pytest.approx((angle, deflection), rel=0.01)


@pytest.mark.parametrize(("model", "n"), [("ddg", (16, 2)), ("fem", (2, 1))])
def test_antiparallel_field_buckles_the_cantilever_at_a_quarter_of_pi_squared(model, n):
    """The lowest pivot changes sign within 1 % of the load, and never in a parallel field."""
    critical = flux_for(np.pi**2 / 4) / 0.5
    found = magnetised_strip(model, n, (0.5, 0.0, 0.0), (-critical, 0.0, 0.0))
    with pytest.warns(StabilityWarning, match="1 negative pivot"):
        path = follow(found, (0.99, 1.01), first=0.5)
    pivots = {step.time: step.negative_pivots for step in path.steps}
    assert pivots[0.99] == 0 and pivots[1.01] == 1
    parallel = magnetised_strip(model, n, (0.5, 0.0, 0.0), (critical, 0.0, 0.0))
    assert [s.negative_pivots for s in follow(parallel, (2.0,), first=2.0).steps] == [0]


# --- what scenes declare


def test_load_factor_scales_numbers_and_leaves_functions_of_time_alone(comm):
    given = build(plate(comm))
    function = build(plate(comm, field=lambda time: FIELD * (1 + time) ** 2))
    for factor in (0.25, 2.0):
        for found, scale in ((given, factor), (function, (1 + factor) ** 2)):
            found.problem.set_time(factor)
            exact = -scale * VOLUME / mu_0 * np.dot(OBLIQUE, FIELD)
            assert found.energies()["magnetic"] == pytest.approx(exact, rel=1e-12)


def bare(comm=None):
    return Scene(rectangle(1.0, 1.0, n=1), Material(1.0, 0.3, 0.01))


def test_magnets_need_a_field_and_a_field_needs_magnets():
    lone = bare()
    lone.magnetise(lone.sheet.panel_names[0], OBLIQUE)
    with pytest.raises(SceneError, match="the scene has no magnetic field"):
        build(lone)
    empty = bare()
    empty.magnetic_field(FIELD)
    with pytest.raises(SceneError, match="the scene has no magnetised panel"):
        build(empty)


def test_wrong_magnets_and_fields_are_refused_where_they_are_declared():
    scene = bare()
    (panel,) = scene.sheet.panel_names
    with pytest.raises(InputError, match="no panel is named 'lid'"):
        scene.magnetise("lid", OBLIQUE)
    for wrong in ((0.1, 0.2), (0.1, 0.2, np.nan), [[0.1, 0.2, 0.3]]):
        with pytest.raises(SceneError, match=f"magnetise '{panel}'"):
            scene.magnetise(panel, wrong)
        with pytest.raises(SceneError, match="magnetic field: expected three finite numbers"):
            scene.magnetic_field(wrong)
    scene.magnetise(panel, OBLIQUE)
    scene.magnetic_field(FIELD)
    with pytest.raises(SceneError, match="magnetised already"):
        scene.magnetise(panel, OBLIQUE)
    with pytest.raises(SceneError, match="a magnetic field is declared already"):
        scene.magnetic_field(FIELD)


@pytest.mark.parametrize(
    "field",
    [
        lambda place, time: ufl.as_vector((place[0], time)),
        lambda place, time: place[2],
        lambda place, time: np.zeros(3),
    ],
    ids=["two components", "scalar", "array"],
)
def test_a_field_of_place_that_is_no_vector_is_refused(comm, field):
    with pytest.raises(SceneError, match="is no UFL vector of three components"):
        build(plate(comm, field=field))


def test_a_function_of_time_that_gives_no_vector_is_refused(comm):
    with pytest.raises(SceneError, match="magnetic field: expected three finite numbers"):
        build(plate(comm, field=lambda time: (time, 0.0)))
