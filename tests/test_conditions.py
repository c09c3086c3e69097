"""Conditions and loads mean what they say, wherever a rank boundary runs; mistakes are refused."""

from petsc4py import PETSc

import numpy as np
import pytest
from dolfinx import cpp
from scenes import E, H, build, follow, strip_scene, tee, z_fold_scene

from ufl_origami.crease_laws import LinearLaw
from ufl_origami.errors import InputError, SceneError
from ufl_origami.material import Material
from ufl_origami.model import place_vertices
from ufl_origami.scene import Scene
from ufl_origami.sheet import sheet_from_arrays
from ufl_origami.solvers.weights import shift_weights

pytestmark = pytest.mark.mpi

EI = E * H**3 / 12
PANELS = ("left", "right", "upright")


def two_panels(comm, n=3, *, turned=False, partitioner=None):
    """Two square panels with a crease between; the second may be oriented against the first."""
    row = 2 * n + 1
    triangles, panel = [], []
    for j in range(n):
        for i in range(2 * n):
            a = j * row + i
            quad = [(a, a + 1, a + row + 1), (a, a + row + 1, a + row)]
            triangles += [t[::-1] for t in quad] if turned and i >= n else quad
            panel += 2 * [int(i >= n)]
    columns = {"held": 0, "crease": n, "end": 2 * n}
    return sheet_from_arrays(
        comm,
        np.array([(i / n, j / n, 0.0) for j in range(n + 1) for i in range(row)]),
        np.array(triangles),
        panel=np.array(panel),
        panel_names=["left", "right"],
        edges={k: [(j * row + i, (j + 1) * row + i) for j in range(n)] for k, i in columns.items()},
        creases=["crease"],
        partitioner=partitioner,
    )


@pytest.mark.parametrize("bending", ["director", "averaged"])
def test_a_panel_oriented_against_the_other_changes_nothing(comm, bending):
    found = []
    for turned in (False, True):
        scene = Scene(two_panels(comm, turned=turned), Material(E, 0.3, H), bending=bending)
        scene.crease("crease", EI)
        scene.fix("held")
        scene.clamp("held")
        scene.line_load("end", (0.0, 0.0, 0.2 * EI))
        model = build(scene)
        follow(model)
        found.append([model.mean_fold_angle("crease"), *model.energies().values()])
    assert found[0][0] > 0.1
    assert found[1] == pytest.approx(found[0], rel=1e-7, abs=1e-9 * EI)


@pytest.mark.parametrize("seed", range(6))
def test_every_vertex_of_a_place_is_found_on_its_owner(comm, seed):
    def scattered(_, parts, graph, ghosting):
        owner = np.random.default_rng(seed).integers(0, parts, graph.num_nodes)
        offsets = np.arange(graph.num_nodes + 1)
        return cpp.graph.AdjacencyList_int32(owner.astype(np.int32), offsets.astype(np.int32))

    n = 4
    sheet = two_panels(comm, n, partitioner=scattered)
    expected = {"held": n + 1, "crease": n + 1, "left": (n + 1) ** 2, "right": (n + 1) ** 2}
    for name, count in expected.items():
        vertices = place_vertices(sheet, name)
        owned = np.count_nonzero(vertices < sheet.num_owned_vertices)
        assert sum(comm.allgather(int(owned))) == count


def test_a_clamp_turned_against_the_rest_face_turns_the_sheet():
    angle = 0.3
    scene = strip_scene((6, 2))
    scene.clamps.clear()
    scene.clamp("x0", lambda time, rest: np.array([-np.cos(angle), 0.0, -np.sin(angle)]))
    model = build(scene)
    follow(model)
    lift = scene.sheet.rest[:, 0] * np.sin(angle)
    assert model.state.x[:, 2] == pytest.approx(lift, abs=1e-7)
    assert sum(model.energies().values()) < 1e-10


def test_a_face_that_meets_its_mirror_plane_at_an_angle_is_free_of_stress():
    scene = z_fold_scene(0.3, 0.3)
    scene.motions.clear()
    scene.symmetry("left_edge", "x")
    model = build(scene)
    force = model.x.duplicate()
    model.problem.forces(model.x, force)
    assert force.norm() < 1e-12 * E * H


def test_a_shift_leaves_prescribed_unknowns_alone():
    problem = build(z_fold_scene(0.4, 0.3)).problem
    weights, dofs = shift_weights(problem).array_r, problem.constraints.dofs
    assert (weights[dofs] == 0).all()
    assert (np.delete(weights, dofs) > 0).all()


def test_steps_drop_their_vectors_on_all_ranks(comm, capfd):
    model = build(z_fold_scene(0.4, 0.3, d1=0.2))
    follow(model, (0.1, 0.2, 0.3))
    capfd.readouterr()
    PETSc.garbage_view(model.x.comm)
    listed = [line for line in capfd.readouterr().out.splitlines() if "| Vec " in line]
    assert len(listed) <= 4


def test_an_argument_with_a_default_is_not_the_rest_coordinates():
    angles = []
    for distance in (lambda time, d=0.2: d * time, 0.2):
        scene = z_fold_scene(0.4, 0.3)
        scene.motions.clear()
        scene.fix("left_edge")
        scene.move("right_edge", x=distance, y=0.0, z=0.0)
        model = build(scene)
        follow(model)
        angles.append(model.mean_fold_angle("crease"))
    assert angles[0] == pytest.approx(angles[1], rel=1e-9)


def test_a_force_function_without_three_components_is_refused():
    scene = strip_scene((4, 1))
    scene.line_load("x1", lambda time: 0.1 * time)
    with pytest.raises(SceneError, match=r"line load 'x1': expected three finite numbers, got"):
        follow(build(scene))


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"law": LinearLaw(1.0, 0.5), "rest_angle": 2.0}, "a law has its own rest angle"),
        ({"stiffness": 1.0, "rest_angle": 144.4}, "no angle in radians"),
        ({"stiffness": 1.0, "rest_angle": np.nan}, "no angle in radians"),
    ],
)
def test_a_crease_with_a_doubtful_rest_angle_is_refused(given, match):
    scene = z_fold_scene(0.4, 0.3)
    with pytest.raises(SceneError, match=match):
        scene.crease("crease", **given)


def test_stops_that_do_not_increase_are_refused():
    with pytest.raises(InputError, match="do not increase"):
        follow(build(z_fold_scene(0.4, 0.3)), (1.0, 0.5))


def test_a_condition_with_values_for_other_vertices_is_refused():
    scene = strip_scene((4, 1))
    scene.move("x1", z=lambda time: time * np.arange(50))
    with pytest.raises(SceneError, match=r"values of shape \(50,\)"):
        follow(build(scene))


@pytest.mark.parametrize("bending", ["director", "averaged"])
def test_contradictory_conditions_on_an_edge_are_refused(bending):
    scene = strip_scene((4, 1), bending=bending)
    scene.edge_moment("x0", 1.0)
    with pytest.raises(SceneError, match="edge moment 'x0': the edge is clamped"):
        build(scene)
    scene = strip_scene((4, 1), bending=bending)
    scene.clamp("boundary")
    with pytest.raises(SceneError, match="clamped more than once"):
        build(scene)


PAIRS = [(a, b) for a in PANELS for b in PANELS if a != b]


@pytest.mark.parametrize("pair", PAIRS)
def test_fold_angles_are_those_of_the_declared_pair(comm, pair):
    scene = Scene(tee(comm), Material(E, 0.0, H))
    scene.crease("spine", 1.0, pair=pair)
    model = build(scene)
    angles = model.fold_angles("spine")
    flat = set(pair) == {"left", "right"}
    assert np.abs(angles.mesh) == pytest.approx(0.0 if flat else 0.5 * np.pi, abs=1e-12)
    assert angles.virtual == pytest.approx(angles.mesh, abs=1e-12)


def test_a_spring_between_a_panel_and_itself_is_refused(comm):
    scene = Scene(tee(comm), Material(E, 0.0, H))
    with pytest.raises(SceneError, match="no two panels"):
        scene.crease("spine", 1.0, pair=("left", "left"))


@pytest.mark.parametrize("pair", PAIRS)
def test_a_rest_angle_counts_in_the_orientation_of_the_first_panel(comm, pair):
    scene = Scene(tee(comm, 2), Material(E, 0.0, H))
    third = next(panel for panel in PANELS if panel not in pair)
    scene.crease("spine", EI, pair=pair, rest_angle=lambda time: start[pair] + 0.4 * time)
    scene.crease("spine", EI, pair=(pair[0], third))
    scene.fix(pair[0])
    start = {pair: rest_angle(scene, pair)}
    model = build(scene)
    follow(model)
    angles = model.fold_angles("spine")
    assert angles.mesh == pytest.approx(start[pair] + 0.4, abs=1e-7)
    assert sum(model.energies().values()) < 1e-12 * EI


def rest_angle(scene, pair):
    """Fold angle of two panels of a tee from their directions and the first one's normal."""
    sheet, directions = (
        scene.sheet,
        dict(zip(PANELS, ([-1, 0, 0], [1, 0, 0], [0, 0, 1]), strict=True)),
    )
    cells = np.flatnonzero(sheet.cell_panel[: sheet.num_owned_cells] == PANELS.index(pair[0]))
    normal = np.zeros(3)
    if len(cells):
        a, b, c = sheet.rest[sheet.cells[cells[0]]]
        normal = np.cross(b - a, c - a)
    normal = np.sign(sum(sheet.comm.allgather(normal)))
    first, second = (np.array(directions[panel]) for panel in pair)
    return float(np.arctan2(second @ normal, -(second @ first)))


def test_a_name_of_two_places_is_refused(comm):
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], dtype=float)
    sheet = sheet_from_arrays(
        comm, vertices, np.array([(0, 1, 2)]), panel_names=["left"], edges={"left": [(0, 2)]}
    )
    with pytest.raises(SceneError, match="'left' names several places"):
        Scene(sheet, Material(E, 0.3, H)).fix("left")
