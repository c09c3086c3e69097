"""The same answer on any number of ranks: each rank also solves the scene alone and compares."""

from mpi4py import MPI

import numpy as np
import pytest
from scenes import E, H, build, follow, tee

from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.meshing import mesh_pattern
from ufl_origami.scene import Scene
from ufl_origami.solvers.newton import NewtonSettings


def z_fold_model(comm, bending):
    structure = "unstructured" if bending == "director" else "structured"
    sheet = mesh_pattern(z_fold(), 0.15, structure=structure, comm=comm)
    materials = {"left": Material(E, 0.3, H), "right": Material(E, 0.2, 1.5 * H)}
    scene = Scene(sheet, materials, bending=bending)
    scene.crease("crease", 0.3 * E * H**3)
    scene.fix("left_edge")
    scene.move("right_edge", x=1.0, y=0.0, z=0.0)
    return build(scene)


def cantilever_model(comm):
    sheet = rectangle(10.0, 1.0, n=(20, 3), structure="unstructured", comm=comm)
    scene = Scene(sheet, Material(1.2e6, 0.3, 0.1), membrane="ufl")
    scene.fix("x0")
    scene.clamp("x0")
    scene.line_load("x1", (0.0, 1.0, 4.0))
    scene.edge_moment("x1", 20.0)
    return build(scene)


def tee_model(comm):
    scene = Scene(tee(comm), Material(E, 0.3, H))
    for pair in (("left", "right"), ("right", "upright")):
        scene.crease("spine", 0.05 * E * H**3, pair=pair)
    scene.fix("end0")
    scene.clamp("end0")
    scene.line_load("end1", (0.0, 0.0, 0.002 * E * H**3))
    scene.edge_moment("end2", 0.002 * E * H**3)
    return build(scene)


MODELS = {
    "z-fold director": lambda comm: z_fold_model(comm, "director"),
    "z-fold averaged": lambda comm: z_fold_model(comm, "averaged"),
    "cantilever with forms": cantilever_model,
    "three panels": tee_model,
}


def positions_by_input(model):
    """Current positions of this rank's vertices under their input numbers."""
    x = model.state.x
    return dict(zip(model.sheet.input_vertex.tolist(), x, strict=True))


@pytest.mark.mpi
@pytest.mark.parametrize("name", MODELS)
def test_ranks_together_and_one_rank_alone_give_the_same_answer(name):
    settings = NewtonSettings(rtol=1e-12)
    runs = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        model = MODELS[name](comm)
        path = follow(model, newton=settings, first=0.25)
        runs.append((model, path))
    (shared, path), (alone, path_alone) = runs
    assert shared.num_unknowns == alone.num_unknowns
    ours, reference = positions_by_input(shared), positions_by_input(alone)
    for vertex, position in ours.items():
        assert position == pytest.approx(reference[vertex], rel=1e-8, abs=1e-8)
    total = alone.energies()
    scale = max(abs(e) for e in total.values())
    for kind, energy in shared.energies().items():
        assert energy == pytest.approx(total[kind], rel=1e-8, abs=1e-9 * scale)
    counts = [[s.iterations for s in p.steps] for p in (path, path_alone)]
    assert len(counts[0]) == len(counts[1])
    assert np.abs(np.subtract(*counts)).max() <= 1
    assert [s.negative_pivots for s in path.steps] == [s.negative_pivots for s in path_alone.steps]
