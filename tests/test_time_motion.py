"""Motions against exact facts: conserved momenta, frequencies, rigid rotation, attached bodies."""

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh
from time_scenes import (
    ALONE,
    PLAIN,
    SHARP,
    fixed,
    flap,
    folded,
    free_square,
    matrices,
    modes,
    momenta,
    unbalanced,
)

import ufl_origami as uo
from ufl_origami.mesh_shapes import rectangle

MODELS = ("ddg", "fem")
SLOW_FEM = ("ddg", pytest.param("fem", marks=pytest.mark.slow))


def thrown(model, comm=ALONE):
    """Folded sheet, its panels limp, thrown with a spin."""
    scene = folded(model, comm, size=0.5 if model == "ddg" else 1.0, E=1e3)
    scene.launch((0.3, -0.2, 0.1))
    scene.launch(uo.spin((0.5, 2.0, 0.3), (0.0, 0.5, -0.3)))
    return scene


@pytest.mark.convergence
@pytest.mark.parametrize("model", SLOW_FEM)
@pytest.mark.parametrize(("scheme", "order"), [("implicit_euler", 1), ("bdf2", 2)])
def test_momenta_in_free_flight(model, scheme, order):
    """Linear momentum is kept to round-off, angular momentum with the scheme's order."""
    steps, errors = 0.04 * 0.5 ** np.arange(3), []
    start = momenta(uo.solve_dynamic(thrown(model), [], fixed(0.1), record=PLAIN).model)
    for dt in steps:
        seen = []
        result = uo.solve_dynamic(
            thrown(model),
            [0.8],
            fixed(dt),
            scheme=scheme,
            record=PLAIN,
            newton=SHARP,
            on_accept=lambda _, model, seen=seen: seen.append(momenta(model)),
        )
        off = np.array(seen) - start
        assert np.abs(off[:, :3]).max() < 1e-11 * np.linalg.norm(start[:3])
        errors.append(np.linalg.norm(off[-1, 3:]) / np.linalg.norm(start[3:]))
    history = result.history
    flexed = history["energy_bending"].max() + history["energy_crease"].max()
    assert flexed > 0.01 * history["energy_kinetic"][0]
    found = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert found == pytest.approx(order, abs=0.15), errors


@pytest.mark.mpi
def test_momenta_on_all_ranks(comm):
    seen = []
    scene = thrown("ddg", comm)
    uo.solve_dynamic(
        scene, [0.1], fixed(0.02), record=PLAIN, newton=SHARP,
        on_accept=lambda _, model: seen.append([*momenta(model), *model.motion.centre(model.x)]),
    )  # fmt: skip
    seen = np.array(seen)
    alone = uo.solve_dynamic(thrown("ddg"), [0.1], fixed(0.02), record=PLAIN, newton=SHARP).model
    assert seen[-1, :6] == pytest.approx(momenta(alone), abs=1e-12)
    assert seen[:, :3] == pytest.approx(np.tile(seen[0, :3], (5, 1)), abs=1e-13)
    drift = np.diff(seen[:, 6:], axis=0) * alone.motion.total_mass
    # BDF2 moves the centre exactly, too: 3/2 (z2 - z1) - 1/2 (z1 - z0) = v dt.
    assert 1.5 * drift[1:] - 0.5 * drift[:-1] == pytest.approx(0.02 * seen[2:, :3], abs=1e-13)


E, NU, H, RHO = 1e7, 0.3, 0.01, 1e3
PLATE = np.sqrt(E * H**2 / (12 * RHO * (1 - NU**2)))  # sqrt(D / (rho h)) / L^2, L = 1


def plate(model, n):
    """Square cantilever."""
    structure = "unstructured" if model == "ddg" else "structured"
    sheet = rectangle(1.0, 1.0, n=(n, n), structure=structure, comm=ALONE)
    scene = uo.Scene(sheet, uo.Material(E, NU, H, rho=RHO), model=model)
    scene.fix("x0")
    scene.clamp("x0")
    return scene


@pytest.mark.parametrize(("model", "n"), [("ddg", 22), ("fem", 4)])
def test_frequencies_of_the_square_cantilever(model, n):
    """Leissa 1969, NASA SP-160: omega L^2 sqrt(rho h / D) = 3.471, 8.507, 21.285."""
    stiffness, mass, free = matrices(uo.build(plate(model, n)))
    held = np.ix_(free, free)
    squares = eigsh(stiffness[held], 3, mass[held], sigma=0.0, return_eigenvectors=False)
    omega = np.sqrt(np.sort(squares)) / PLATE
    assert omega == pytest.approx([3.471, 8.507, 21.285], rel=0.01)


def crossings(time, values):
    """Times at which values change sign, by straight lines between the samples."""
    k = np.flatnonzero(values[1:] * values[:-1] < 0)
    return time[k] - values[k] * (time[k + 1] - time[k]) / (values[k + 1] - values[k])


def test_period_of_the_vibrating_square_cantilever():
    """At 80 steps a period BDF2 lags by z^2 / 3 = 0.2 % of the period."""
    period = 2 * np.pi / (3.471 * PLATE)
    result, _ = modes(plate("fem", 3)).swing(1e-6, period / 80, 64, newton=uo.NewtonSettings())
    time = result.history["time"]
    first, second = crossings(time, result.history["position_x1y0_z"])
    assert 2 * (second - first) == pytest.approx(period, rel=0.01)


@pytest.mark.parametrize(("model", "size"), [("ddg", 0.2), ("fem", 0.5)])
def test_frequency_of_the_crease_flap(model, size):
    """Rigid panel on a spring: sqrt(3 K_r / (rho h W^3)), lumped masses 1 / (2 n^2) heavier."""
    bending = 1e4 * 0.05**3 / (12 * (1 - 0.3**2))
    spring = 1e-3 * bending
    omega = modes(flap(model, size=size, spring=spring)).omega[0]
    rigid = np.sqrt(3 * spring / 0.05)
    assert omega == pytest.approx(rigid, rel=0.011 if model == "ddg" else 1e-3)
    if model == "ddg":
        assert omega == pytest.approx(rigid / np.sqrt(1 + size**2 / 2), rel=1e-3)


@pytest.mark.parametrize("model", MODELS)
def test_rigid_rotation_is_not_damped_by_stiffness(model):
    """A stiff folded sheet turns by a radian as without damping, but for its small strain."""
    ends = []
    for beta in (0.0, 0.5):
        scene = folded(model, size=1.0, spring=1e3, E=1e6)
        scene.damping(stiffness=beta)
        scene.launch(uo.spin((0.6, 0.8, 0.0), (0.0, 0.5, 0.0)))
        result = uo.solve_dynamic(scene, [1.0], fixed(0.05), record=PLAIN, newton=SHARP)
        history = result.history
        ends.append([history["energy_kinetic"][-1], *momenta(result.model)[3:]])
        assert unbalanced(history) < 1e-8
    lost = history["lost_damping"][-1] / history["energy_kinetic"][0]
    assert 0 < lost < 1e-4  # in straining by its own spin
    scale = np.abs(ends[0])
    assert np.abs(np.subtract(*ends)) == pytest.approx(np.zeros(4), abs=1e-5 * scale.max())


def launched(scene):
    """A scene's motion at its start."""
    model = uo.solve_dynamic(scene, [], fixed(0.1), record=PLAIN).model
    return model, model.motion


@pytest.mark.mpi
@pytest.mark.parametrize("model", MODELS)
def test_mass_centre_and_inertia_of_a_spinning_panel(comm, model):
    """J = m / 12 diag(1, 1, 2), and m / (12 n^2) diag(1, 1, 2) more with lumped masses.

    Lumping adds A / 4 sum xi^2 to a triangle's second moment, xi from its centroid to its corners.
    """
    n, omega = 3, np.array([0.3, -0.7, 1.1])
    sheet = rectangle(1.0, 1.0, n=(n, n), structure="crisscross", comm=comm)
    scene = uo.Scene(sheet, uo.Material(1e4, 0.3, 0.05, rho=1.0), model=model)
    centre = np.array([0.5, 0.5, 0.0])
    scene.launch(uo.spin(omega, centre))
    moving, motion = launched(scene)
    m = motion.total_mass
    assert m == pytest.approx(0.05, rel=1e-13)
    assert motion.centre(moving.x) == pytest.approx(centre, abs=1e-13)
    tensor = m * (1 / 12 + (1 / (12 * n**2) if model == "ddg" else 0)) * np.array([1, 1, 2])
    assert motion.angular_momentum(moving.x, centre) == pytest.approx(tensor * omega, abs=1e-14)
    assert motion.angular_momentum(moving.x) == pytest.approx(tensor * omega, abs=1e-14)
    assert motion.momentum() == pytest.approx(np.zeros(3), abs=1e-14)
    assert motion.kinetic_energy() == pytest.approx(0.5 * omega @ (tensor * omega), rel=1e-12)


BODY, PLACE = 0.3, np.array([0.55, 0.45, 0.02])
SPREAD = np.array([[0.11, 0.008, 0.006], [0.008, 0.12, -0.004], [0.006, -0.004, 0.025]])
TENSOR = BODY * (np.trace(SPREAD) * np.eye(3) - SPREAD)


def crumpled(model, comm):
    """One panel whose nodes lie on no surface of second degree, as a general body needs."""
    n = 4
    u, v = (grid.ravel() / n for grid in np.meshgrid(range(n + 1), range(n + 1)))
    vertices = np.column_stack([u, v, 0.3 * np.sin(5 * u) * np.cos(4 * v)])
    corner = np.add.outer((n + 1) * np.arange(n), np.arange(n)).ravel()
    quads = corner[:, None] + [0, 1, n + 2, n + 1]
    triangles = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    none = np.zeros(len(triangles), dtype=int)
    sheet = uo.sheet_from_arrays(comm, vertices, triangles, panel=none, panel_names=["sheet"])
    return uo.Scene(sheet, uo.Material(1e4, 0.3, 0.05, rho=1.0), model=model)


@pytest.mark.mpi
@pytest.mark.parametrize("model", MODELS)
def test_rigid_inertia_adds_the_body_s_own(comm, model):
    """Mass, moments and inertia with the body less those without."""
    omega, about = np.array([0.4, -1.2, 0.9]), np.array([0.1, -0.2, 0.3])
    measured = {}
    for carries in (False, True):
        scene = crumpled(model, comm)
        if carries:
            scene.rigid_inertia("sheet", BODY, TENSOR, PLACE)
        scene.launch(uo.spin(omega, about))
        moving, motion = launched(scene)
        measured[carries] = np.concatenate(
            [
                [motion.total_mass, motion.kinetic_energy()],
                motion.total_mass * motion.centre(moving.x),
                motion.momentum(),
                motion.angular_momentum(moving.x, about),
            ]
        )
    arm = PLACE - about
    speed = np.cross(omega, arm)
    energy = 0.5 * BODY * speed @ speed + 0.5 * omega @ TENSOR @ omega
    spin = BODY * np.cross(arm, speed) + TENSOR @ omega
    own = np.concatenate([[BODY, energy], BODY * PLACE, BODY * speed, spin])
    assert measured[True] - measured[False] == pytest.approx(own, abs=1e-8 * BODY)


@pytest.mark.mpi
@pytest.mark.parametrize("model", MODELS)
def test_gravity_and_inertia_of_attached_bodies(comm, model):
    """Everything falls alike, with the weight of all masses; the book tells their height."""
    scene = free_square(model, comm)
    scene.gravity((0.0, 0.0, -2.0))
    scene.point_mass("x1y1", 0.2)
    scene.rigid_inertia("x0", 0.1, 0.1 * np.diag([0.08, 0.0, 0.08]), (0.0, 0.4, 0.0))
    history = uo.solve_dynamic(
        scene, [0.2], fixed(0.02), scheme="implicit_euler", newton=SHARP,
        record=uo.Record(fields="none", extra={
            "pull": lambda model: model.motion.momentum()[2],
            "mass": lambda model: model.motion.total_mass,
            "x": lambda model: model.motion.centre(model.x)[0],
        }),
    ).history  # fmt: skip
    time, total = history["time"], 0.05 + 0.2 + 0.1
    assert history["mass"] == pytest.approx(total, rel=1e-12)
    assert history["x"] == pytest.approx((0.05 * 0.5 + 0.2) / total, rel=1e-12)
    assert history["pull"] == pytest.approx(-2.0 * total * time, abs=1e-12)
    fallen = -2.0 * time * (time + 0.02) / 2
    assert history["position_x1y1_z"] == pytest.approx(fallen, abs=1e-12)
    assert history["position_x0y0_z"] == pytest.approx(fallen, abs=1e-12)
    assert history["energy_gravity"] == pytest.approx(2.0 * total * fallen, abs=1e-12)


@pytest.mark.parametrize(
    ("mass", "inertia", "centre", "message"),
    [
        (1.0, np.diag([0.1, 0.1, 0.1]), (0.5, 0.5, 0.0), "out of the plane or line"),
        (1.0, np.diag([0.1, 0.1, 0.2]), (0.5, 0.5, 0.1), "out of the plane or line"),
        (1.0, np.diag([0.1, 0.1, 0.2]), (1.5, 0.5, 0.0), "too wide for the nodes"),
        (1.0, np.diag([0.1, 0.1, 0.3]), (0.5, 0.5, 0.0), "no body has this inertia tensor"),
        (1.0, np.eye(3)[[0, 0, 2]], (0.5, 0.5, 0.0), r"expected a symmetric \(3, 3\)"),
        (1.0, np.diag([np.inf] * 3), (0.5, 0.5, 0.0), r"expected a symmetric \(3, 3\)"),
        (-1.0, np.diag([0.1, 0.1, 0.2]), (0.5, 0.5, 0.0), "rigid inertia 'sheet'"),
    ],
)
def test_refused_bodies(mass, inertia, centre, message):
    scene = free_square("ddg")
    with pytest.raises(uo.SceneError, match=message):
        scene.rigid_inertia("sheet", mass, inertia, centre)
        launched(scene)


def test_refused_point_masses():
    scene = free_square("ddg")
    with pytest.raises(uo.SceneError, match="point mass 'x0y0'"):
        scene.point_mass("x0y0", 0.0)
    with pytest.raises(ValueError, match="x0y9"):
        scene.point_mass("x0y9", 1.0)
