"""Loads, natural curvature, rigid motions and queries of a model against closed forms."""

import numpy as np
import pytest
from scenes import E, H, build, follow, strip_scene, z_fold_scene

from ufl_origami.errors import SceneError
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.scene import Scene

pytestmark = pytest.mark.mpi
PANEL = "sheet"
STRIP_EI, LENGTH = 100.0, 10.0


def rotation(axis, angle):
    k = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@pytest.mark.parametrize("bending", ["director", "averaged"])
@pytest.mark.parametrize("angle", [0.3, 2.0, 3.1])
def test_rigid_motions_of_a_folded_sheet_cost_nothing(bending, angle):
    model = build(z_fold_scene(0.3, 1.0, nu=0.3, bending=bending, structure="structured"))
    rest = model.sheet.rest[: model.configuration.nv_owned]
    moved = rest @ rotation([1, -2, 0.5], angle).T + [3.0, -1.0, 2.0]
    model.x.array_w[: rest.size] = (moved - rest).ravel()
    model.x.assemble()
    force = model.x.duplicate()
    model.problem.forces(model.x, force)
    assert force.norm() < 1e-11 * E * H
    assert all(abs(energy) < 1e-22 * E * H for energy in model.energies().values())


def tip_deflection(scene):
    model = build(scene)
    follow(model, (1e-3,), first=1e-3)
    u = model.state.x - model.sheet.rest
    end = model.sheet.edge_vertices()[model.sheet.edge_facets("x1")]
    local = u[np.unique(end), 2]
    largest = max(model.sheet.comm.allgather(float(np.abs(local).max(initial=0.0))))
    return 1e3 * largest


def test_line_load_bends_a_cantilever_as_beam_theory_says():
    scene = strip_scene((40, 4))
    scene.line_load("x1", (0.0, 0.0, 0.4))
    assert tip_deflection(scene) == pytest.approx(0.4 * LENGTH**3 / (3 * STRIP_EI), rel=2e-3)


def test_area_load_bends_a_cantilever_as_beam_theory_says():
    scene = strip_scene((40, 4))
    scene.area_load(PANEL, (0.0, 0.0, 0.04))
    assert tip_deflection(scene) == pytest.approx(0.04 * LENGTH**4 / (8 * STRIP_EI), rel=2e-3)


def test_edge_moment_bends_a_cantilever_as_beam_theory_says():
    scene = strip_scene((40, 4))
    scene.edge_moment("x1", 2.0)
    assert tip_deflection(scene) == pytest.approx(2.0 * LENGTH**2 / (2 * STRIP_EI), rel=2e-3)


def test_follower_pressure_bends_a_cantilever_as_beam_theory_says():
    scene = strip_scene((40, 4))
    scene.pressure(PANEL, 0.04)
    model = build(scene)
    assert not model.problem.symmetric
    assert tip_deflection(scene) == pytest.approx(0.04 * LENGTH**4 / (8 * STRIP_EI), rel=2e-3)


def test_turned_clamp_carries_a_free_strip_round_rigidly():
    scene = strip_scene((12, 2))
    scene.clamps.clear()
    angle = 1.2

    def tangent(time, rest):
        return rest @ rotation([0, 1, 0], angle * time).T

    scene.clamp("x0", tangent)
    model = build(scene)
    follow(model)
    turned = model.sheet.rest @ rotation([0, 1, 0], angle).T
    assert model.state.x == pytest.approx(turned, abs=1e-8)
    assert sum(model.energies().values()) < 1e-12 * STRIP_EI


@pytest.mark.parametrize("structure", ["structured", "unstructured"])
def test_natural_curvature_bends_a_strip_into_an_arc_without_moment(structure):
    curvature = 0.15
    sheet = rectangle(LENGTH, 1.0, n=(60, 6), structure=structure)
    scene = Scene(sheet, Material(1.2e6, 0.0, 0.1))
    scene.natural_curvature(PANEL, np.diag([curvature, 0.0, 0.0]))
    scene.fix("x0")
    scene.clamp("x0")
    model = build(scene)
    flat = model.energies()["bending"]
    assert flat == pytest.approx(0.5 * STRIP_EI * curvature**2 * LENGTH, rel=1e-10)
    follow(model)
    assert sum(model.energies().values()) < 1e-3 * flat
    end = np.unique(model.sheet.edge_vertices()[model.sheet.edge_facets("x1")])
    arc = LENGTH * curvature
    tip = np.array([np.sin(arc), 0.0, 1 - np.cos(arc)]) / curvature
    for x in model.state.x[end]:
        assert x[[0, 2]] == pytest.approx(tip[[0, 2]], rel=2e-3)


def test_reactions_balance_the_loads():
    scene = strip_scene((20, 2), nu=0.3)
    scene.line_load("x1", (1.0, 0.5, 4.0))
    scene.area_load(PANEL, (0.0, 0.0, -0.1))
    model = build(scene)
    follow(model)
    load = np.array([1.0, 0.5, 4.0 - 0.1 * LENGTH])
    assert model.reaction("x0") == pytest.approx(-load, abs=1e-7)


def test_scenes_with_unknown_or_contradicting_things_are_refused():
    scene = z_fold_scene(0.4, 1.0)
    with pytest.raises(ValueError, match="rihgt"):
        scene.fix("rihgt_edge")
    with pytest.raises(SceneError, match="no crease"):
        scene.crease("left_edge", 1.0)
    with pytest.raises(SceneError, match="must not be negative"):
        scene.crease("crease", -1.0)
    with pytest.raises(SceneError, match="not finite"):
        scene.pressure("left", np.nan)
    with pytest.raises(SceneError, match="three finite numbers"):
        scene.line_load("right_edge", (1.0, 2.0))
    with pytest.raises(SceneError, match="'xyz'"):
        scene.fix("left_edge", "xq")
    with pytest.raises(SceneError, match="averaged"):
        Scene(scene.sheet, scene.material, bending="average")
    with pytest.raises(SceneError, match="right"):
        Scene(scene.sheet, {"left": Material(E, 0.3, H)})
    with pytest.raises(SceneError, match="thickness"):
        Material(E, 0.3, 0.0)


def test_creases_and_clamps_are_checked_when_the_model_is_built():
    scene = z_fold_scene(0.4, 1.0)
    scene.creases.clear()
    with pytest.raises(SceneError, match="without stiffness"):
        build(scene)
    scene = z_fold_scene(0.4, 1.0)
    scene.clamp("crease")
    with pytest.raises(SceneError, match="no boundary"):
        build(scene)
    scene = z_fold_scene(0.4, 1.0)
    scene.fix("right_edge", "x")
    model = build(scene)
    with pytest.raises(SceneError, match="contradicts"):
        follow(model)
