"""Every term is one energy: Taylor remainders of the whole scene, and equal membranes."""

from petsc4py import PETSc

import numpy as np
import pytest
from scenes import E, H, build, disturb, strip_scene, tee, z_fold_scene

from ufl_origami.crease_laws import MomentLaw
from ufl_origami.material import Material
from ufl_origami.scene import Scene

pytestmark = pytest.mark.mpi


STRUCTURE = {"director": "unstructured", "averaged": "structured"}


def z_fold(**kind):
    bending = kind.get("bending", "director")
    scene = z_fold_scene(0.4, 0.3, nu=0.3, bending=bending, structure=STRUCTURE[bending])
    scene.membrane = kind.get("membrane", "kernel")
    return scene


def loaded_strip(bending="director"):
    scene = strip_scene((6, 2), nu=0.3, bending=bending, structure=STRUCTURE[bending])
    scene.line_load("x1", (3.0, 1.0, 4.0))
    scene.area_load(scene.sheet.panel_names[0], (0.3, -0.2, 0.5))
    scene.edge_moment("x1", 20.0)
    scene.natural_curvature(scene.sheet.panel_names[0], np.diag([0.1, -0.05, 0.0]))
    return scene


def three_panels(comm):
    scene = Scene(tee(comm, 2), Material(E, 0.3, H))
    scene.crease("spine", 20.0, pair=("left", "right"))
    scene.crease("spine", 10.0, rest_angle=0.3, pair=("right", "upright"))
    return scene


def nonlinear_crease(comm):
    scene = z_fold_scene(0.4, 0.3)
    law = MomentLaw(
        lambda a: 3 * np.sin(a) + a**3, lambda a: 3 * np.cos(a) + 3 * a**2, rest_angle=2.0
    )
    scene.creases.clear()
    scene.crease("crease", law=law)
    return scene


SCENES = {
    "director": lambda comm: z_fold(),
    "averaged": lambda comm: z_fold(bending="averaged"),
    "ufl membrane": lambda comm: z_fold(membrane="ufl"),
    "loads": lambda comm: loaded_strip(),
    "loads averaged": lambda comm: loaded_strip("averaged"),
    "three panels": three_panels,
    "moment law": nonlinear_crease,
}


def direction(model):
    """A fixed direction in the unknowns, the same on any number of ranks."""
    start = model.x.copy()
    disturb(model, 0.1, seed=5)
    d = model.x.copy()
    d.axpy(-1.0, start)
    start.copy(model.x)
    return d


def skew_part(matrix):
    """Frobenius norm of K - K^T."""
    transposed = PETSc.Mat().createTranspose(matrix).convert("aij")
    transposed.axpy(-1.0, matrix)
    return transposed.norm()


def remainders(model, order):
    """Taylor remainders of the potential with `order` derivatives, and their step sizes."""
    problem, x = model.problem, model.x
    d, force, product = direction(model), x.duplicate(), x.duplicate()
    problem.forces(x, force)
    problem.linearise(None, x)
    problem.stiffness(x).mult(d, product)
    energy, slope, curvature = problem.potential(x), force.dot(d), product.dot(d)
    steps = 0.003 * 0.5 ** np.arange(5)
    left = []
    for t in steps:
        y = x.copy()
        y.axpy(t, d)
        model_value = energy + t * slope + (0.5 * t**2 * curvature if order == 2 else 0)
        left.append(abs(problem.potential(y) - model_value))
    return steps, np.array(left)


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
    assert skew_part(matrix) < 1e-12 * matrix.norm()


def test_ufl_membrane_equals_the_kernels_to_rounding(comm):
    models = [disturb(build(z_fold(membrane=kind)), 0.05) for kind in ("kernel", "ufl")]
    energies = [m.energies()["membrane"] for m in models]
    assert energies[0] > 0
    assert energies[1] == pytest.approx(energies[0], rel=1e-12)
    forces, matrices = [], []
    for m in models:
        f = m.x.duplicate()
        m.problem.forces(m.x, f)
        m.problem.linearise(None, m.x)
        forces.append(f)
        matrices.append(m.problem.stiffness(m.x))
    for a, b in (forces, matrices):
        scale = a.norm()
        b.axpy(-1.0, a)
        assert b.norm() < 1e-12 * scale


def test_extrapolated_stress_is_the_same_in_both_membranes(comm):
    matrices = []
    for kind in ("kernel", "ufl"):
        model = disturb(build(z_fold(membrane=kind)), 0.02)
        before = model.x.copy()
        disturb(model, 0.05, seed=3)
        model.problem.linearise(before, model.x)
        matrices.append(model.problem.stiffness(model.x).copy())
        model.problem.linearise(None, model.x)
        exact = model.problem.stiffness(model.x)
        exact.axpy(-1.0, matrices[-1])
        assert exact.norm() > 1e-3 * matrices[-1].norm()
    scale = matrices[0].norm()
    matrices[1].axpy(-1.0, matrices[0])
    assert matrices[1].norm() < 1e-12 * scale


def test_follower_pressure_pushes_along_the_current_normal(comm):
    scene = strip_scene((6, 2), structure="unstructured")
    scene.pressure(scene.sheet.panel_names[0], 2.0)
    model = build(scene)
    model.problem.set_time(1.0)
    force = model.x.duplicate()
    model.problem.forces(model.x, force)
    nodal = force.array_r[: 3 * model.configuration.nv_owned].reshape(-1, 3).sum(axis=0)
    assert model.configuration.sum(nodal) == pytest.approx([0, 0, -2.0 * 10.0], abs=1e-9)


def test_follower_pressure_has_an_exact_unsymmetric_tangent(comm):
    scene = strip_scene((6, 2), structure="unstructured")
    scene.pressure(scene.sheet.panel_names[0], 2e3)
    model = disturb(build(scene), 0.1)
    problem = model.problem
    problem.set_time(1.0)
    problem.linearise(None, model.x)
    d, f0, product = direction(model), model.x.duplicate(), model.x.duplicate()
    problem.forces(model.x, f0)
    problem.stiffness(model.x).mult(d, product)
    steps, left = 0.02 * 0.5 ** np.arange(5), []
    for t in steps:
        y, f = model.x.copy(), f0.duplicate()
        y.axpy(t, d)
        problem.forces(y, f)
        f.axpy(-1.0, f0)
        f.axpy(-t, product)
        left.append(f.norm())
    assert np.polyfit(np.log(steps), np.log(left), 1)[0] == pytest.approx(2.0, abs=0.1)
    matrix = problem.stiffness(model.x)
    assert skew_part(matrix) > 1e-6 * matrix.norm()
