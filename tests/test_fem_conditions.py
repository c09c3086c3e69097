"""Conditions and loads mean the same in both models: closed forms, and each other's answers."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from scenes import E, H, build, follow, strip_scene
from test_model import LENGTH, STRIP_EI, rotation, tip_deflection

from ufl_origami.errors import SceneError
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import cylinder_octant, rectangle
from ufl_origami.scene import Scene
from ufl_origami.terms.form import FormTerm

PANEL = "sheet"


def fem_strip(n=(10, 1), **options):
    return strip_scene(n, model="fem", **options)


@pytest.mark.parametrize(
    ("load", "expected"),
    [
        (lambda s: s.point_load("x1y0", (0.0, 0.0, 0.2)), None),
        (lambda s: s.line_load("x1", (0.0, 0.0, 0.4)), 0.4 * LENGTH**3 / 3),
        (lambda s: s.area_load(PANEL, (0.0, 0.0, 0.04)), 0.04 * LENGTH**4 / 8),
        (lambda s: s.edge_moment("x1", 2.0), 2.0 * LENGTH**2 / 2),
        (lambda s: s.pressure(PANEL, 0.04), 0.04 * LENGTH**4 / 8),
    ],
    ids=["point", "line", "area", "moment", "pressure"],
)
def test_loads_bend_a_cantilever_as_beam_theory_says(load, expected):
    if expected is None:  # one at either corner: the same as a line load
        expected = 0.4 * LENGTH**3 / 3
    scene = fem_strip()
    load(scene)
    if scene.loads[0].kind == "point":
        scene.point_load("x1y1", (0.0, 0.0, 0.2))
    assert tip_deflection(scene) == pytest.approx(expected / STRIP_EI, rel=2e-3)
    assert build(scene).problem.symmetric == (scene.loads[0].kind != "pressure")


@pytest.mark.mpi
def test_reactions_balance_the_loads():
    scene = fem_strip((8, 2), nu=0.3)
    scene.line_load("x1", (1.0, 0.5, 4.0))
    scene.area_load(PANEL, (0.0, 0.0, -0.1))
    scene.point_load("x1y0", (0.0, 0.0, 0.3))
    model = build(scene)
    follow(model)
    load = np.array([1.0, 0.5, 4.0 + 0.3 - 0.1 * LENGTH])
    assert model.reaction("x0") == pytest.approx(-load, abs=1e-6)


@pytest.mark.mpi
def test_follower_pressure_pushes_along_the_current_normal(comm):
    scene = fem_strip((6, 2), structure="unstructured")
    scene.pressure(PANEL, 2.0)
    model = build(scene)
    model.problem.set_time(1.0)
    reaction = model.reaction(PANEL)
    assert reaction == pytest.approx([0, 0, -2.0 * LENGTH], abs=1e-9)


@pytest.mark.mpi
def test_a_turned_clamp_carries_a_free_strip_round_rigidly():
    scene = fem_strip((6, 2))
    scene.clamps.clear()
    angle = 1.2
    scene.clamp("x0", lambda time, rest: rest @ rotation([0, 1, 0], angle * time).T)
    model = build(scene)
    follow(model)
    turned = model.sheet.rest @ rotation([0, 1, 0], angle).T
    assert model.state.x == pytest.approx(turned, abs=1e-7)
    assert sum(model.energies().values()) < 1e-12 * STRIP_EI


@pytest.mark.parametrize("structure", ["structured", "unstructured"])
def test_natural_curvature_bends_a_strip_into_an_arc_without_moment(structure):
    curvature = 0.15
    sheet = rectangle(LENGTH, 1.0, n=(20, 2), structure=structure)
    scene = Scene(sheet, Material(1.2e6, 0.0, 0.1), model="fem")
    scene.natural_curvature(PANEL, np.diag([curvature, 0.0, 0.0]))
    scene.fix("x0")
    scene.clamp("x0")
    model = build(scene)
    flat = model.energies()["bending"]
    assert flat == pytest.approx(0.5 * STRIP_EI * curvature**2 * LENGTH, rel=1e-8)
    follow(model)
    assert sum(model.energies().values()) < 1e-3 * flat
    end = np.unique(model.sheet.edge_vertices()[model.sheet.edge_facets("x1")])
    arc = LENGTH * curvature
    tip = np.array([np.sin(arc), 0.0, 1 - np.cos(arc)]) / curvature
    for x in model.state.x[end]:
        assert x[[0, 2]] == pytest.approx(tip[[0, 2]], rel=2e-3)


@pytest.mark.mpi
@pytest.mark.convergence
def test_a_form_of_ones_own_acts_on_the_midpoints_too():
    """Lifted strip on Winkler's foundation: k w_0 / lambda, lambda^4 = k / (4 EI) (Hetenyi)."""
    stiffness, lift = 4 * STRIP_EI, 0.01

    def foundation(configuration, functions):
        k = fem.Constant(functions.sheet.mesh, stiffness)
        return FormTerm("foundation", functions, energy=0.5 * k * functions.u[2] ** 2 * ufl.dx)

    errors = []
    for n in (16, 32):
        sheet = rectangle(LENGTH, 1.0, n=(n, n // 8))
        scene = Scene(sheet, Material(1.2e6, 0.0, 0.1), model="fem")
        scene.move("x0", x=0.0, y=0.0, z=lift)
        scene.clamp("x0")
        scene.add_term(foundation)
        model = build(scene)
        follow(model)
        errors.append(1 - model.reaction("x0")[2] / (stiffness * lift))
    assert 0 < errors[1] < 5e-4
    assert np.log2(errors[0] / errors[1]) > 3, errors


COUNTS = {"ddg": (12, 24), "fem": (8,)}
"""Segments along one unit of length: two meshes of ddg, one of fem."""


def square(model, n):
    """Square plate of h / L = 1 / 50."""
    sheet = rectangle(1.0, 1.0, n=(n, n))
    return Scene(sheet, Material(E, 0.3, 2 * H), model=model)


def strip_of(model, n, width):
    sheet = rectangle(1.0, width, n=(n, round(n * width)))
    scene = Scene(sheet, Material(E, 0.3, H), model=model)
    scene.fix("x0")
    scene.clamp("x0")
    return scene


def pressed(model, n):
    """Clamped all round, deflected by two thicknesses: bending and membrane share the load."""
    scene = square(model, n)
    for name in ("x0", "x1", "y0", "y1"):
        scene.fix(name)
        scene.clamp(name)
    scene.pressure(PANEL, 8000.0 * E * H**4)
    return scene


def quarter(model, n):
    """Quarter of a supported plate under dead load, two mirror planes."""
    scene = square(model, n)
    scene.fix("x0")
    scene.fix("y0")
    scene.symmetry("x1", "x")
    scene.symmetry("y1", "y")
    scene.area_load(PANEL, (0.0, 0.0, 100.0 * E * H**4))
    return scene


def turned_end(model, n):
    """Strip whose ends are clamped and brought together, one of them turned."""
    scene = strip_of(model, n, 0.25)
    scene.move("x1", x=-0.05, y=0.0, z=0.0)
    scene.clamp("x1", lambda time, rest: rest @ rotation([0, 1, 0], 0.9 * time).T)
    return scene


def curved(model, n):
    """Natural curvature in all directions of a wide strip under a line load."""
    scene = strip_of(model, n, 0.5)
    scene.natural_curvature(PANEL, 0.4 * np.array([[1.0, 0.5, 0], [0.5, -0.3, 0], [0, 0, 0]]))
    scene.line_load("x1", (0.0, 0.0, 2.0 * E * H**3))
    return scene


def corner(model, n):
    """Force at the free corner of a plate clamped at one side, edge moment at another."""
    scene = square(model, n)
    scene.fix("x0")
    scene.clamp("x0")
    scene.point_load("x1y1", (0.0, 0.0, 0.1 * E * (2 * H) ** 3))
    scene.edge_moment("y0", 0.05 * E * (2 * H) ** 3)
    return scene


def results(make, point, model, n):
    """Elastic energy, reactions at the held side, place of a point; collective."""
    built = build(make(model, n))
    follow(built)
    energies = built.energies()
    energy = sum(value for kind, value in energies.items() if kind != "load")
    return np.array([energy, *built.reaction("x0"), *built.position(point)])


CASES = [(pressed, "x1y1"), (quarter, "x1y1"), (turned_end, "y0_mid"), (curved, "x1y0"),
         (corner, "x1y1")]  # fmt: skip


@pytest.mark.filterwarnings("ignore::ufl_origami.errors.BranchWarning")  # the strip buckles
@pytest.mark.parametrize(("make", "point"), CASES, ids=lambda case: getattr(case, "__name__", ""))
def test_both_models_agree_to_discretisation_accuracy(make, point):
    """fem differs from ddg by no more than ddg from ddg on a mesh half as fine."""
    coarse, fine, other = (
        results(make, point, model, n) for model, counts in COUNTS.items() for n in counts
    )
    scale = np.abs(fine)
    scale[1:4], scale[4:] = scale[1:4].max(), 1.0
    refined, apart = np.abs(fine - coarse) / scale, np.abs(fine - other) / scale
    assert (apart <= np.maximum(refined, 0.002)).all(), (refined, apart)
    assert apart.max() < 0.1, apart


@pytest.mark.parametrize("name", ["sym_x0", "free_end"])
@pytest.mark.parametrize("kind", ["clamp", "symmetry"])
def test_held_edges_of_a_curved_shell_are_stress_free_at_rest(name, kind):
    """The faces at the edge lean against the flat triangles' own tangents: that is no strain."""
    scene = Scene(cylinder_octant(1.0, 2.0, 4), Material(E, 0.3, H), model="fem")
    if kind == "clamp":
        scene.clamp(name)
    else:
        scene.symmetry(name, {"sym_x0": "x", "free_end": "y"}[name])
    model = build(scene)
    forces = model.x.duplicate()
    model.problem.forces(model.x, forces)
    assert forces.norm() < 1e-12 * E * H**3


@pytest.mark.parametrize(
    "choice", [{"bending": "averaged"}, {"measure": "sin"}, {"membrane": "ufl"}]
)
def test_choices_of_the_other_model_are_refused(choice):
    with pytest.raises(SceneError, match="choice of the ddg model"):
        Scene(rectangle(1.0, 1.0, n=(1, 1)), Material(E, 0.3, H), model="fem", **choice)


def test_one_word_gives_the_same_scene_with_the_other_model():
    scene = strip_scene((10, 1), bending="averaged")
    scene.edge_moment("x1", 2.0)
    twin = scene.with_model("fem")
    scene.fix("x1", "y")  # the copy has its own lists
    assert (twin.model, twin.bending, len(twin.motions)) == ("fem", "director", 1)
    assert tip_deflection(twin) == pytest.approx(2.0 * LENGTH**2 / 2 / STRIP_EI, rel=2e-3)
