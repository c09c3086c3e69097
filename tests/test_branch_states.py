"""States that a path keeps: back in one of them, the model is in equilibrium as it was."""

import numpy as np
import pytest

import ufl_origami as uo

pytestmark = pytest.mark.mpi


def sheared(model, size):
    """Z-fold that is opened up to load factor 1 and sheared along its crease beyond."""
    sheet = uo.mesh_pattern(uo.gallery.z_fold(), size, structure="crisscross")
    scene = uo.Scene(sheet, uo.Material(E=1e7, nu=0.3, h=0.01), model=model)
    scene.crease("crease", 5.0)
    scene.fix("left_edge")
    scene.move("right_edge", x=lambda t: min(t, 1.0), y=lambda t: max(t - 1.0, 0.0), z=0.0)
    return scene


def imbalance(model):
    """Largest force that is not in equilibrium."""
    out = model.x.duplicate()
    model.problem.residual(model.x, out)
    return out.norm(3)


@pytest.mark.filterwarnings("ignore::ufl_origami.errors.MeshWarning")
@pytest.mark.parametrize(("model", "size"), [("ddg", 0.25), ("fem", 0.5)])
def test_a_bifurcation_is_an_equilibrium_when_restored_from_afar(model, size):
    scene = sheared(model, size)
    start = uo.solve_static(scene, [1.001])
    path = uo.follow_path(start.model, [1.15], arc=uo.ArcSettings(first=0.04, largest=0.06))
    event = path.bifurcations[0]
    scale = np.linalg.norm(path.model.reaction("right_edge"))
    uo.restore(path.model, event)
    assert imbalance(path.model) < 1e-7 * scale
