"""Creases of the fem model against exact solutions: moments, elastica, hinges, stiff folds."""

import numpy as np
import pytest
from scenes import E, H, build, follow, tee, z_fold_scene
from test_conditions import PAIRS, PANELS, rest_angle, two_panels
from test_crease import EI, REST, flat_strip, included, lift_about_y
from test_crease import elastica as exact_fold

from ufl_origami.analytic import ZFold
from ufl_origami.crease_laws import MomentLaw
from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.meshing import mesh_pattern
from ufl_origami.scene import Scene

OPENINGS = (0.5, 1.0, 1.2)


def strip(structure="unstructured", *, nu=0.0, size=0.4):
    """Two square panels in a plane, the end of the first one clamped."""
    sheet = mesh_pattern(flat_strip(), size, structure=structure)
    scene = Scene(sheet, Material(E, nu, H), model="fem")
    scene.fix("held")
    scene.clamp("held")
    return scene


@pytest.mark.mpi
@pytest.mark.parametrize("structure", ["structured", "unstructured"])
def test_an_end_moment_turns_the_crease_by_moment_over_stiffness(structure):
    moment, stiffness = 0.3 * EI, 0.25 * EI
    scene = strip(structure)
    scene.crease("crease", stiffness)
    scene.edge_moment("end", moment)
    model = build(scene)
    follow(model)
    angles = model.fold_angles("crease")
    assert angles.virtual == pytest.approx(moment / stiffness, rel=1e-5)
    assert model.mean_fold_angle("crease") == pytest.approx(moment / stiffness, rel=1e-7)
    assert model.energies()["crease"] == pytest.approx(0.5 * moment**2 / stiffness, rel=1e-6)


def test_a_nonlinear_crease_turns_until_its_moment_is_the_applied_one():
    angle, k = 0.8, 0.2 * EI
    scene = strip()
    law = MomentLaw(lambda a: k * (a + 4 * a**3), lambda a: k * (1 + 12 * a**2), rest_angle=0.0)
    scene.crease("crease", law=law)
    scene.edge_moment("end", lambda time: law.moment(angle * time))
    model = build(scene)
    follow(model)
    assert model.mean_fold_angle("crease") == pytest.approx(angle, rel=1e-6)


def test_a_stiffness_that_grows_in_time_is_followed():
    scene = strip("structured")
    scene.crease("crease", lambda time: EI * (1 + time))
    scene.edge_moment("end", lambda time: 0.3 * EI)
    model = build(scene)
    turned = []
    follow(
        model,
        (0.5, 1.0),
        on_accept=lambda s, x: turned.append((s.time, model.mean_fold_angle("crease"))),
    )
    for time, angle in turned:
        assert angle == pytest.approx(0.3 / (1 + time), rel=1e-7)


@pytest.mark.mpi
@pytest.mark.parametrize("stiffness", [0.0, EI])
def test_a_panel_carried_round_its_crease_stays_free_of_stress(stiffness):
    """A hinge costs nothing, a spring 1/2 K_r angle^2, and neither bends the panels."""
    turn = 2.0
    sheet = mesh_pattern(flat_strip(), 0.4)
    scene = Scene(sheet, Material(E, 0.3, H), model="fem")
    scene.crease("crease", stiffness, rest_angle=lambda time: turn * time)
    scene.fix("left")
    scene.move(
        "end",
        x=lambda time: np.cos(turn * time) - 1.0,
        y=0.0,
        z=lambda time: np.sin(turn * time),
    )
    model = build(scene)
    follow(model)
    assert model.mean_fold_angle("crease") == pytest.approx(turn, abs=1e-8)
    assert all(abs(energy) < 1e-12 * EI for energy in model.energies().values())


@pytest.mark.parametrize("angle", [2.0, -2.0, 3.1, 3.6])
def test_a_moving_rest_angle_folds_a_free_sheet_without_stress(angle):
    """To either side, nearly closed, and beyond half a turn."""
    sheet = mesh_pattern(flat_strip(), 0.4)
    scene = Scene(sheet, Material(E, 0.3, H), model="fem")
    scene.crease("crease", EI, rest_angle=lambda time: angle * time)
    scene.fix("left")
    model = build(scene)
    follow(model)
    angles = model.fold_angles("crease")
    assert angles.virtual == pytest.approx(np.full(len(angles.virtual), angle), abs=1e-8)
    assert angles.mesh == pytest.approx(np.full(len(angles.mesh), angle), abs=1e-7)
    assert sum(model.energies().values()) < 1e-12 * EI
    assert height_of_the_end(model) == pytest.approx(np.sin(angle), abs=1e-7)


def height_of_the_end(model):
    """Mean height of the moving end; a valley lifts it."""
    facets = model.sheet.edge_facets("end")
    return model.state.x[model.sheet.edge_vertices()[facets], 2].mean()


def test_a_panel_oriented_against_the_other_changes_nothing(comm):
    found = []
    for turned in (False, True):
        scene = Scene(two_panels(comm, turned=turned), Material(E, 0.3, H), model="fem")
        scene.crease("crease", EI)
        scene.fix("held")
        scene.clamp("held")
        scene.line_load("end", (0.0, 0.0, 0.2 * EI))
        model = build(scene)
        follow(model)
        found.append([model.mean_fold_angle("crease"), *model.energies().values()])
    assert found[0][0] > 0.1
    assert found[1] == pytest.approx(found[0], rel=1e-6, abs=1e-9 * EI)


@pytest.mark.mpi
@pytest.mark.parametrize("pair", PAIRS)
def test_a_rest_angle_counts_in_the_orientation_of_the_first_panel(comm, pair):
    """Three panels at an edge: the pair's angle at rest, and where its spring takes it."""
    scene = Scene(tee(comm, 2), Material(E, 0.3, H), model="fem")
    third = next(panel for panel in PANELS if panel not in pair)
    start = rest_angle(scene, pair)
    scene.crease("spine", EI, pair=pair, rest_angle=lambda time: start + 0.4 * time)
    scene.crease("spine", EI, pair=(pair[0], third))
    scene.fix(pair[0])
    model = build(scene)
    at_rest = model.fold_angles("spine")
    assert at_rest.virtual == pytest.approx(start, abs=1e-12)
    assert at_rest.mesh == pytest.approx(start, abs=1e-12)
    follow(model)
    assert model.fold_angles("spine").mesh == pytest.approx(start + 0.4, abs=1e-7)
    assert sum(model.energies().values()) < 1e-12 * EI


def test_rigid_limit_is_kinematic_and_stiff_limit_keeps_the_rest_angle():
    angles = {}
    for eta in (0.0, 1e-9, np.inf, 1e6):
        model = build(z_fold_scene(0.4, eta, model="fem"))
        follow(model)
        angles[eta] = included(model)
    kinematic = 2 * np.degrees(np.arcsin(np.sin(np.radians(REST / 2)) + 0.5))
    assert angles[0.0] == pytest.approx(kinematic, abs=1e-3)
    assert angles[1e-9] == pytest.approx(angles[0.0], abs=1e-4)
    assert angles[np.inf] == pytest.approx(REST, abs=1e-8)
    assert angles[1e6] == pytest.approx(REST, abs=1e-4)


@pytest.mark.mpi
def test_a_stiff_fold_bends_its_panels_as_the_elastica_does():
    model = build(z_fold_scene(0.25, np.inf, model="fem"))
    follow(model)
    exact = exact_fold(np.inf)
    assert model.reaction("right_edge")[0] == pytest.approx(exact.force, rel=0.01)
    energies = model.energies()
    assert sum(energies.values()) == pytest.approx(exact.energy, rel=0.01)


@pytest.mark.parametrize("eta", [1e-3, 1e-2, 0.1, 0.5, 1.0, 10.0, 1e2])
def test_z_fold_agrees_with_the_elastica(eta):
    """Within 0.1 degrees and 1 % of the pull at all openings, in one run."""
    model = build(z_fold_scene(0.25, eta, model="fem"))
    found = []

    def on_accept(step, x):
        if min(abs(step.time - d1) for d1 in OPENINGS) < 1e-9:
            found.append((included(model), model.reaction("right_edge")[0], model.energies()))

    path = follow(model, OPENINGS, on_accept=on_accept)
    for d1, (angle, force, energies) in zip(OPENINGS, found, strict=True):
        exact = exact_fold(eta, d1)
        assert angle == pytest.approx(exact.included_angle_deg, abs=0.1)
        assert force == pytest.approx(exact.force, rel=0.01)
        assert energies["crease"] == pytest.approx(exact.crease_energy, rel=0.01)
        bending = energies["bending"] + energies["membrane"]
        assert bending == pytest.approx(exact.bending_energy, rel=0.01, abs=1e-9 * EI)
    assert all(step.negative_pivots == 0 for step in path.steps)
    assert all(step.cuts == 0 for step in path.steps)


@pytest.mark.convergence
@pytest.mark.serial
@pytest.mark.parametrize(("structure", "eta"), [("structured", 10.0), ("unstructured", 0.5)])
def test_z_fold_converges_with_order_three(structure, eta):
    """So thin that the extension, which the elastica lacks, stays below the errors."""
    thin, sizes, errors = 1e-3, (0.5, 0.25, 0.125), []
    exact = ZFold.from_eta(eta, stiffness=E * thin**3 / 12).solve(1.0)
    for size in sizes:
        sheet = mesh_pattern(z_fold(), size, structure=structure)
        scene = Scene(sheet, Material(E, 0.0, thin), model="fem")
        scene.crease("crease", eta * E * thin**3)
        scene.fix("left_edge")
        scene.move("right_edge", x=1.0, y=0.0, z=0.0)
        model = build(scene)
        follow(model)
        force = model.reaction("right_edge")[0] / exact.force - 1
        errors.append((abs(included(model) - exact.included_angle_deg), abs(force)))
    for error in np.array(errors).T:
        assert np.polyfit(np.log(sizes), np.log(error), 1)[0] > 2.7, errors
    assert (np.array(errors[-1]) < (2e-3, 3e-4)).all()


@pytest.mark.parametrize("kind", ["thickness", "length"])
def test_unequal_panels_agree_with_the_elastica(kind):
    thick, widths = (2 * H, (1.0, 1.0)) if kind == "thickness" else (H, (1.0, 2.0))
    sheet = mesh_pattern(z_fold(widths=widths), 0.2)
    materials = {"left": Material(E, 0.0, H), "right": Material(E, 0.0, thick)}
    scene = Scene(sheet, materials, model="fem")
    stiffness = 3.0 * EI
    scene.crease("crease", stiffness)
    scene.fix("left_edge")
    scene.move("right_edge", x=0.6, y=0.0, z=0.0)
    model = build(scene)
    follow(model)
    bending = (EI, E * thick**3 / 12)
    exact = ZFold(widths=widths, bending_stiffness=bending, crease_stiffness=stiffness).solve(0.6)
    assert included(model) == pytest.approx(exact.included_angle_deg, abs=0.1)
    assert model.reaction("right_edge")[0] == pytest.approx(exact.force, rel=0.01)


@pytest.mark.mpi
def test_three_panels_share_moments_as_a_network_of_springs(comm):
    """Stiff panels: the angles that the springs turn by solve a linear system."""
    k_lr, k_ru, k_lu = 2.0 * EI, 1.0 * EI, 0.5 * EI
    pairs = {("left", "right"): k_lr, ("right", "upright"): k_ru, ("left", "upright"): k_lu}
    scene = Scene(tee(comm, 2), Material(1e5 * E, 0.0, H), model="fem")
    for pair, stiffness in pairs.items():
        scene.crease("spine", stiffness, pair=pair)
    scene.fix("end0")
    scene.clamp("end0")
    scene.edge_moment("end1", 0.2 * EI)
    scene.edge_moment("end2", 0.1 * EI)
    model = build(scene)
    follow(model)
    stiffness = np.array([[k_lr + k_ru, -k_ru], [-k_ru, k_lu + k_ru]])
    signs = np.array([lift_about_y(model.sheet, p, d) for p, d in ((1, (1, 0, 0)), (2, (0, 0, 1)))])
    right, upright = np.linalg.solve(stiffness, signs * [0.2 * EI, 0.1 * EI])
    turned = turn_about_y(model, "end1", (1, 0, 0)), turn_about_y(model, "end2", (0, 0, 1))
    assert turned == pytest.approx((right, upright), rel=1e-4)


def turn_about_y(model, edge, rest):
    """Angle about +y by which the mean of an edge's vertices is turned from its rest direction."""
    sheet = model.sheet
    facets = sheet.edge_facets(edge)
    ends = sheet.edge_vertices()[facets[facets < sheet.num_owned_edges]].ravel()
    total = model.configuration.sum(model.state.x[ends].sum(axis=0))
    before = np.arctan2(rest[0], rest[2])
    return np.arctan2(total[0], total[2]) - before


@pytest.mark.mpi
def test_rest_state_of_a_folded_pattern_is_an_exact_equilibrium():
    model = build(z_fold_scene(0.3, 1.0, nu=0.3, model="fem"))
    force = model.x.duplicate()
    model.problem.forces(model.x, force)
    assert force.norm() < 1e-11 * E * H
    assert all(abs(e) < 1e-22 * E * H for e in model.energies().values())
