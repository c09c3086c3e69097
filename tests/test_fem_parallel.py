"""The fem model gives the same answer on any number of ranks."""

from mpi4py import MPI

import numpy as np
import pytest
from scenes import E, H, build, follow, tee
from test_parallel import positions_by_input

from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.meshing import mesh_pattern
from ufl_origami.scene import Scene
from ufl_origami.sheet import sheet_from_arrays
from ufl_origami.solvers.newton import NewtonSettings


def z_fold_model(comm):
    sheet = mesh_pattern(z_fold(), 0.25, comm=comm)
    materials = {"left": Material(E, 0.3, H), "right": Material(E, 0.2, 1.5 * H)}
    scene = Scene(sheet, materials, model="fem")
    scene.crease("crease", 0.3 * E * H**3)
    scene.fix("left_edge")
    scene.move("right_edge", x=1.0, y=0.0, z=0.0)
    return build(scene)


def cantilever_model(comm):
    sheet = rectangle(10.0, 1.0, n=(10, 2), structure="unstructured", comm=comm)
    scene = Scene(sheet, Material(1.2e6, 0.3, 0.1), model="fem")
    scene.natural_curvature("sheet", np.diag([0.05, -0.1, 0.0]))
    scene.fix("x0")
    scene.clamp("x0")
    scene.line_load("x1", (0.0, 1.0, 4.0))
    scene.edge_moment("x1", 20.0)
    scene.area_load("sheet", (0.0, 0.0, 0.1))
    return build(scene)


def tee_model(comm):
    scene = Scene(tee(comm), Material(E, 0.3, H), model="fem")
    for pair in (("left", "right"), ("right", "upright")):
        scene.crease("spine", 0.05 * E * H**3, pair=pair)
    scene.fix("end0")
    scene.clamp("end0")
    scene.line_load("end1", (0.0, 0.0, 0.002 * E * H**3))
    scene.edge_moment("end2", 0.002 * E * H**3)
    return build(scene)


MODELS = {"z-fold": z_fold_model, "cantilever": cantilever_model, "three panels": tee_model}


@pytest.mark.mpi
@pytest.mark.parametrize("name", MODELS)
def test_ranks_together_and_one_rank_alone_give_the_same_answer(name):
    settings = NewtonSettings(rtol=1e-12)
    runs = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        model = MODELS[name](comm)
        runs.append((model, follow(model, newton=settings, first=0.25)))
    (shared, path), (alone, path_alone) = runs
    assert shared.num_unknowns == alone.num_unknowns
    ours, reference = positions_by_input(shared), positions_by_input(alone)
    for vertex, position in ours.items():
        assert position == pytest.approx(reference[vertex], rel=1e-8, abs=1e-8)
    total = alone.energies()
    scale = max(abs(e) for e in total.values())
    for kind, energy in shared.energies().items():
        assert energy == pytest.approx(total[kind], rel=1e-8, abs=1e-9 * scale)
    for crease in shared.sheet.creases:
        angles = shared.mean_fold_angle(crease), alone.mean_fold_angle(crease)
        assert angles[0] == pytest.approx(angles[1], rel=1e-8)
    counts = [[s.iterations for s in p.steps] for p in (path, path_alone)]
    assert len(counts[0]) == len(counts[1])
    assert np.abs(np.subtract(*counts)).max() <= 1
    assert [s.negative_pivots for s in path.steps] == [s.negative_pivots for s in path_alone.steps]


@pytest.mark.mpi
def test_a_rank_without_triangles_is_no_obstacle(comm):
    """A single triangle with a natural curvature: nothing hinders it from taking that shape."""
    vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    edges = {"held": [(0, 1)]}
    sheet = sheet_from_arrays(comm, vertices, np.array([[0, 1, 2]]), edges=edges, points={"tip": 2})
    scene = Scene(sheet, Material(1e6, 0.0, 0.001), model="fem")
    scene.fix("held")
    scene.clamp("held")
    curvature = 0.1
    scene.natural_curvature("panel0", np.diag([0.0, curvature, 0.0]))
    model = build(scene)
    follow(model)
    circle = [0.0, np.sin(curvature) / curvature, (1 - np.cos(curvature)) / curvature]
    np.testing.assert_allclose(model.position("tip"), circle, atol=1e-4)
