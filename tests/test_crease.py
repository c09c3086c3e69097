"""The crease element against exact solutions: moments, elastica, limits, many panels."""

import numpy as np
import pytest
from scenes import E, H, build, follow, tee, z_fold_scene

from ufl_origami.analytic import ZFold
from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.meshing import mesh_pattern
from ufl_origami.pattern import CreasePattern
from ufl_origami.pattern_edit import named
from ufl_origami.scene import Scene

pytestmark = pytest.mark.mpi

EI = E * H**3 / 12
REST = 35.6


def included(model):
    return 180.0 - abs(np.degrees(model.mean_fold_angle("crease")))


def flat_strip():
    """Two square panels in a plane with a crease along y at x = 1."""
    vertices = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (0, 1, 0)]
    pattern = CreasePattern.from_arrays(
        np.array(vertices, dtype=float),
        [(0, 1, 4, 5), (1, 2, 3, 4)],
        assignment={(1, 4): "V"},
        fold_angle={(1, 4): 0.0},
    )
    return named(
        pattern,
        panels={"left": 0, "right": 1},
        edges={"crease": [(1, 4)], "held": [(0, 5)], "end": [(2, 3)]},
    )


@pytest.mark.parametrize("bending", ["director", "averaged"])
def test_an_end_moment_turns_the_crease_by_moment_over_stiffness(bending):
    sheet = mesh_pattern(flat_strip(), 0.2, structure="structured")
    moment, stiffness = 0.3 * EI, 0.25 * EI
    scene = Scene(sheet, Material(E, 0.0, H), bending=bending)
    scene.crease("crease", stiffness)
    scene.fix("held")
    scene.clamp("held")
    scene.edge_moment("end", moment)
    model = build(scene)
    follow(model)
    rel = {"director": 1e-7, "averaged": 1e-4}[bending]  # the averaged crease line bends a little
    assert model.mean_fold_angle("crease") == pytest.approx(moment / stiffness, rel=rel)


def elastica(eta, d1=1.0):
    return ZFold.from_eta(eta, stiffness=EI).solve(d1)


@pytest.mark.parametrize("eta", [1e-6, 1e-3, 1e-2, 0.1, 0.5, 1.0, 10.0, 1e2, 1e6])
def test_z_fold_agrees_with_the_elastica(eta):
    model = build(z_fold_scene(0.06, eta))
    path = follow(model)
    exact = elastica(eta)
    assert model.sheet.num_cells_global < 3000
    assert included(model) == pytest.approx(exact.included_angle_deg, abs=0.1)
    force = model.reaction("right_edge")[0]
    assert force == pytest.approx(exact.force, rel=0.01)
    energies = model.energies()
    assert energies["bending"] + energies["membrane"] == pytest.approx(
        exact.bending_energy, rel=0.02, abs=1e-9 * EI
    )
    assert energies["crease"] == pytest.approx(exact.crease_energy, rel=0.02)
    assert sum(step.iterations for step in path.steps) <= 45
    assert all(step.negative_pivots == 0 for step in path.steps)


PULL = 0.3  # moderate curvature: the membrane's own error (sagitta / h) stays out of the order


def errors_of(sizes, eta, mesh):
    """Absolute angle and relative force errors against the elastica, a row a mesh size."""
    exact, errors = elastica(eta, PULL), []
    for size in sizes:
        model = build(z_fold_scene(size, eta, d1=PULL, **mesh(size)))
        follow(model)
        force = model.reaction("right_edge")[0]
        errors.append(
            (abs(included(model) - exact.included_angle_deg), abs(force / exact.force - 1))
        )
    return np.array(errors)


MESHES = {
    "structured": (lambda size: {"structure": "structured"}, (0.25, 0.125, 0.0625)),
    "unstructured": (lambda size: {}, (0.25, 0.125, 0.0625)),
    "4:1": (lambda size: {"panel_size": {"left": size / 4}}, (0.125, 0.0625)),
}


@pytest.mark.convergence
@pytest.mark.serial
@pytest.mark.parametrize(
    ("mesh", "eta"),
    [
        ("structured", 0.1),
        ("structured", 0.5),
        ("unstructured", 0.1),
        ("unstructured", 0.5),
        ("4:1", 0.1),
    ],
)
def test_z_fold_converges_with_order_two(mesh, eta):
    options, sizes = MESHES[mesh]
    errors = errors_of(sizes, eta, options)
    for error in errors.T:
        order = np.polyfit(np.log(sizes), np.log(error), 1)[0]
        assert order == pytest.approx(2.0, abs=0.2), errors
    assert (errors[-1] < (0.1, 0.01)).all()


def test_rigid_limit_is_kinematic_and_stiff_limit_keeps_the_rest_angle():
    angles = {}
    for eta in (0.0, 1e-9, np.inf, 1e7):
        model = build(z_fold_scene(0.2, eta))
        follow(model)
        angles[eta] = included(model)
    width_over_two = np.sin(np.radians(REST / 2)) + 0.5
    kinematic = 2 * np.degrees(np.arcsin(width_over_two))
    assert angles[0.0] == pytest.approx(kinematic, abs=1e-3)
    assert angles[1e-9] == pytest.approx(angles[0.0], abs=1e-4)
    assert angles[np.inf] == pytest.approx(REST, abs=1e-9)
    assert angles[1e7] == pytest.approx(REST, abs=1e-4)


@pytest.mark.parametrize("kind", ["thickness", "length"])
def test_unequal_panels_agree_with_the_elastica(kind):
    thick, widths = (2 * H, (1.0, 1.0)) if kind == "thickness" else (H, (1.0, 2.0))
    sheet = mesh_pattern(z_fold(widths=widths), 0.06)
    scene = Scene(sheet, {"left": Material(E, 0.0, H), "right": Material(E, 0.0, thick)})
    stiffness = 3.0 * EI
    scene.crease("crease", stiffness)
    scene.fix("left_edge")
    scene.move("right_edge", x=0.6, y=0.0, z=0.0)
    model = build(scene)
    follow(model)
    exact = ZFold(
        widths=widths,
        bending_stiffness=(EI, E * thick**3 / 12),
        crease_stiffness=stiffness,
    ).solve(0.6)
    assert included(model) == pytest.approx(exact.included_angle_deg, abs=0.1)
    assert model.reaction("right_edge")[0] == pytest.approx(exact.force, rel=0.01)


def test_rest_state_of_a_folded_pattern_is_an_exact_equilibrium():
    for bending in ("director", "averaged"):
        scene = z_fold_scene(0.2, 1.0, nu=0.3, bending=bending, structure="structured")
        model = build(scene)
        force = model.x.duplicate()
        model.problem.forces(model.x, force)
        assert force.norm() < 1e-12 * E * H
        assert all(abs(e) < 1e-25 * E * H for e in model.energies().values())


def test_a_moving_rest_angle_folds_a_free_sheet_without_stress():
    sheet = mesh_pattern(flat_strip(), 0.25)
    scene = Scene(sheet, Material(E, 0.3, H))
    scene.crease("crease", EI, rest_angle=lambda time: 2.0 * time)
    scene.fix("left")
    model = build(scene)
    follow(model)
    assert model.mean_fold_angle("crease") == pytest.approx(2.0, abs=1e-9)
    assert sum(model.energies().values()) < 1e-12 * EI
    angles = model.fold_angles("crease")
    assert angles.mesh == pytest.approx(np.full(len(angles.mesh), 2.0), abs=1e-7)


@pytest.mark.filterwarnings("ignore::ufl_origami.errors.BranchWarning")
def test_a_stiffness_that_grows_in_time_is_followed():
    sheet = mesh_pattern(flat_strip(), 0.25, structure="structured")
    scene = Scene(sheet, Material(E, 0.0, H))
    scene.crease("crease", lambda time: EI * (1 + time))
    scene.fix("held")
    scene.clamp("held")
    scene.edge_moment("end", lambda time: 0.3 * EI)
    model = build(scene)
    turned = []
    follow(model, (0.5, 1.0), on_accept=lambda s, x: turned.append((s.time, angle_of(model))))
    for time, angle in turned:
        assert angle == pytest.approx(0.3 / (1 + time), rel=1e-7)


def angle_of(model):
    return model.mean_fold_angle("crease")


def tee_scene(comm, springs):
    scene = Scene(tee(comm), Material(1e3 * E, 0.0, H))
    for pair, stiffness in springs.items():
        scene.crease("spine", stiffness, pair=pair)
    scene.fix("end0")
    scene.clamp("end0")
    return scene


def test_three_panels_share_moments_as_a_network_of_springs(comm):
    k_lr, k_ru, k_lu = 2.0 * EI, 1.0 * EI, 0.5 * EI
    scene = tee_scene(
        comm, {("left", "right"): k_lr, ("right", "upright"): k_ru, ("left", "upright"): k_lu}
    )
    scene.edge_moment("end1", 0.2 * EI)
    scene.edge_moment("end2", 0.1 * EI)
    model = build(scene)
    follow(model)
    turns = turns_about_y(model)
    stiffness = np.array([[k_lr + k_ru, -k_ru], [-k_ru, k_lu + k_ru]])
    signs = np.array([lift_about_y(model.sheet, p, d) for p, d in ((1, (1, 0, 0)), (2, (0, 0, 1)))])
    expected = np.linalg.solve(stiffness, signs * [0.2 * EI, 0.1 * EI])
    assert turns == pytest.approx(expected, rel=1e-6)


def lift_about_y(sheet, panel, outward):
    """+1 where a turn about +y lifts the outward tangent of a panel towards its normal."""
    cells = np.flatnonzero(sheet.cell_panel[: sheet.num_owned_cells] == panel)
    normal = np.zeros(3)
    if len(cells):
        a, b, c = sheet.rest[sheet.cells[cells[0]]]
        normal = np.cross(b - a, c - a)
    normal = sum(sheet.comm.allgather(normal))
    return np.sign(np.cross(outward, normal)[1])


def turns_about_y(model):
    """Mean change of the virtual angles of panels 1, 2 against panel 0, as turns about +y."""
    crease = model.creases["spine"]
    sheet, scalars, fan = model.sheet, model.state.scalars, crease.fan
    totals = np.zeros(3)
    for k, name in enumerate(("fold_angle", "fold_angle_2")):
        slot = model.configuration.slot(name)[fan.facets]
        change = scalars[slot] - [0.0, np.pi / 2][k] * np.ones(len(slot))
        direction = along_y(sheet, fan)
        totals[k] = (-change * direction * fan.length).sum()
    totals[2] = fan.length.sum()
    totals = model.configuration.sum(totals)
    return totals[:2] / totals[2]


def along_y(sheet, fan):
    ends = sheet.edge_vertices()[fan.facets]
    return np.sign(sheet.rest[ends[:, 1], 1] - sheet.rest[ends[:, 0], 1])


def test_an_unloaded_third_panel_leaves_the_other_two_as_they_are(comm):
    spring = 0.7 * EI
    three = tee_scene(comm, {("left", "right"): spring, ("left", "upright"): 5 * EI})
    three.edge_moment("end1", 0.4 * EI)
    model = build(three)
    follow(model)
    sheet = mesh_pattern(flat_strip(), 1 / 3, structure="structured")
    two = Scene(sheet, Material(1e3 * E, 0.0, H))
    two.crease("crease", spring)
    two.fix("held")
    two.clamp("held")
    two.edge_moment("end", 0.4 * EI)
    plain = build(two)
    follow(plain)
    assert abs(model.mean_fold_angle("spine")) == pytest.approx(
        abs(plain.mean_fold_angle("crease")), rel=1e-8
    )
