"""The fem model is one energy: Taylor remainders, symmetry, rigid motions, Newton's order."""

import numpy as np
import pytest
from scenes import E, H, build, disturb, follow, strip_scene, tee, z_fold_scene
from test_model import rotation
from test_terms import direction, remainders, skew_part

from ufl_origami.crease_laws import MomentLaw
from ufl_origami.gallery.shell_problems import Form, cantilever_shear
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.scene import Scene
from ufl_origami.solvers.newton import NewtonSettings, NewtonSolver
from ufl_origami.solvers.static import StaticPath, StepSettings

PANEL = "sheet"


def free_sheet(comm):
    """Interior and free edges only."""
    sheet = rectangle(1.0, 0.8, n=(3, 2), structure="unstructured", comm=comm)
    return Scene(sheet, Material(E, 0.3, 0.1), model="fem")


def clamped_strip(comm):
    """Clamped, free and moment-loaded edges."""
    scene = strip_scene((6, 2), nu=0.3, model="fem", structure="unstructured")
    scene.edge_moment("x1", 20.0)
    return scene


def loaded_strip(comm):
    scene = clamped_strip(comm)
    scene.line_load("x1", (3.0, 1.0, 4.0))
    scene.point_load("x1y0", (0.5, -1.0, 2.0))
    scene.area_load(PANEL, (0.3, -0.2, 0.5))
    return scene


def curved_strip(comm):
    """Natural curvature, also across and along the diagonal."""
    scene = strip_scene((6, 2), nu=0.3, model="fem", structure="unstructured")
    scene.natural_curvature(PANEL, np.array([[0.1, 0.03, 0], [0.03, -0.05, 0], [0, 0, 0]]))
    return scene


def mirrored(comm):
    """Half of a Z-fold: mirror plane at one outer edge, whose faces meet it at an angle."""
    scene = z_fold_scene(0.5, 0.3, nu=0.3, model="fem")
    scene.motions.clear()
    scene.symmetry("left_edge", "x")
    return scene


def crease_of_two(comm):
    return z_fold_scene(0.5, 0.3, nu=0.3, model="fem")


def stiff_fold(comm):
    return z_fold_scene(0.5, np.inf, nu=0.3, model="fem")


def hinge(comm):
    return z_fold_scene(0.5, 0.0, nu=0.3, model="fem")


def nonlinear_crease(comm):
    scene = z_fold_scene(0.5, 0.3, model="fem")
    law = MomentLaw(
        lambda a: 3 * np.sin(a) + a**3, lambda a: 3 * np.cos(a) + 3 * a**2, rest_angle=2.0
    )
    scene.creases.clear()
    scene.crease("crease", law=law)
    return scene


def crease_of_three(comm):
    scene = Scene(tee(comm, 2), Material(E, 0.3, H), model="fem")
    scene.crease("spine", 20.0, pair=("left", "right"))
    scene.crease("spine", 10.0, rest_angle=0.3, pair=("right", "upright"))
    return scene


SCENES = {
    f.__name__: f
    for f in (
        free_sheet, clamped_strip, loaded_strip, curved_strip, mirrored, crease_of_two, stiff_fold,
        hinge, nonlinear_crease, crease_of_three,
    )
}  # fmt: skip


@pytest.mark.mpi
@pytest.mark.parametrize("name", SCENES)
def test_taylor_remainders_fall_with_orders_two_and_three(name, comm):
    model = disturb(build(SCENES[name](comm)), 0.05)
    model.problem.set_time(0.7)
    for order in (1, 2):
        steps, left = remainders(model, order)
        slope = np.polyfit(np.log(steps), np.log(left), 1)[0]
        assert abs(slope - (order + 1)) < 0.1, (name, order, slope)


@pytest.mark.parametrize("name", SCENES)
def test_tangent_is_symmetric(name, comm):
    model = disturb(build(SCENES[name](comm)), 0.05)
    model.problem.set_time(0.7)
    model.problem.linearise(None, model.x)
    matrix = model.problem.stiffness(model.x)
    assert model.problem.symmetric
    assert skew_part(matrix) < 1e-11 * matrix.norm()


@pytest.mark.mpi
def test_follower_pressure_has_an_exact_unsymmetric_tangent(comm):
    scene = strip_scene((6, 2), structure="unstructured", model="fem")
    scene.pressure(PANEL, 2e3)
    model = disturb(build(scene), 0.1)
    problem = model.problem
    problem.set_time(1.0)
    problem.linearise(None, model.x)
    d, f0, product = direction(model), model.x.duplicate(), model.x.duplicate()
    problem.forces(model.x, f0)
    matrix = problem.stiffness(model.x)
    matrix.mult(d, product)
    steps, left = 0.02 * 0.5 ** np.arange(5), []
    for t in steps:
        y, f = model.x.copy(), f0.duplicate()
        y.axpy(t, d)
        problem.forces(y, f)
        f.axpy(-1.0, f0)
        f.axpy(-t, product)
        left.append(f.norm())
    assert np.polyfit(np.log(steps), np.log(left), 1)[0] == pytest.approx(2.0, abs=0.1)
    assert not problem.symmetric
    assert skew_part(matrix) > 1e-6 * matrix.norm()


AXIS, SHIFT = (1.0, -2.0, 0.5), np.array([3.0, -1.0, 2.0])


def carried(angle):
    """Displacement components that turn a place about an oblique axis as the load grows."""

    def component(axis):
        def displacement(time, rest):
            turned = rest @ rotation(AXIS, angle * time).T + time * SHIFT
            return (turned - rest)[:, axis]

        return displacement

    return {name: component(axis) for axis, name in enumerate("xyz")}


@pytest.mark.parametrize("angle", [0.3, 2.0, 6.0])
def test_a_folded_sheet_carried_round_rigidly_stays_free_of_stress(angle):
    """Its panels' nodes are prescribed, its directors and fold angles follow."""
    scene = z_fold_scene(0.4, 1.0, nu=0.3, model="fem")
    scene.motions.clear()
    for panel in ("left", "right"):
        scene.move(panel, **carried(angle))
    model = build(scene)
    follow(model)
    assert all(abs(energy) < 1e-20 * E * H for energy in model.energies().values())
    assert model.mean_fold_angle("crease") == pytest.approx(np.radians(180 - 35.6), abs=1e-10)


@pytest.mark.mpi
@pytest.mark.parametrize("angle", [2.0])
def test_a_bent_sheet_carried_round_rigidly_keeps_its_energies(angle):
    """Pulled open until the load factor is 1, then turned as a whole with its supports."""
    scene = z_fold_scene(0.4, 1.0, nu=0.3, model="fem")
    scene.motions.clear()
    for edge, opening in (("left_edge", 0.0), ("right_edge", 0.9)):

        def component(axis, opening=opening):
            def displacement(time, rest):
                pulled = rest + np.array([opening * min(time, 1.0), 0.0, 0.0])
                late = max(time - 1.0, 0.0)
                turned = pulled @ rotation(AXIS, angle * late).T + late * SHIFT
                return (turned - rest)[:, axis]

            return displacement

        scene.move(edge, **{name: component(axis) for axis, name in enumerate("xyz")})
    model = build(scene)
    found = []
    path = follow(
        model,
        (1.0, 2.0),
        on_accept=lambda step, x: found.append(
            (step.time, *model.energies().values(), model.mean_fold_angle("crease"))
        ),
        newton=NewtonSettings(rtol=1e-12),
    )
    assert all(step.negative_pivots == 0 for step in path.steps)
    held = [row[1:] for row in found if row[0] >= 1.0]
    assert len(held) > 1 and held[0][1] > 1e-3 * E * H**3
    for row in held[1:]:
        assert row == pytest.approx(held[0], rel=1e-7)


def residuals(load):
    """Residual norms of plain Newton for a share of the cantilever's load in one step."""
    problem = cantilever_shear(2, Form("structured", model="fem"), slenderness=0.1)
    model = build(problem.scene)
    solver = NewtonSolver(model.problem, NewtonSettings(method="newton", rtol=0.0))
    reports, solve = [], solver.solve
    solver.solve = lambda *args, **kw: reports.append(solve(*args, **kw)) or reports[-1]
    StaticPath(model.problem, solver, StepSettings(first=load)).run(model.x, 0.0, [load])
    return np.array(reports[0].residuals)


def test_plain_newton_converges_quadratically():
    """The last residuals above round-off are C times the square of the one before."""
    r = residuals(0.05)
    r = r[r > 1e-8]
    assert r[-1] < 1e-5 and r[-3] > 0.1, r
    factor = r[-2:] / r[-3:-1] ** 2
    assert 0.25 < factor[1] / factor[0] < 4.0, r
