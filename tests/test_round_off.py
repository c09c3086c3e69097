"""Forces near round-off: warned of where they are lost, and factored where pivots are extreme."""

import numpy as np
import pytest
from scenes import E, build, follow

from ufl_origami.analytic import ZFold
from ufl_origami.errors import RoundOffWarning, SolveError
from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.meshing import mesh_pattern
from ufl_origami.resolution import SHARE_LIMIT, lost_crease, warn_round_off
from ufl_origami.scene import Scene
from ufl_origami.solvers.linear import Factorisation

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.filterwarnings("ignore::ufl_origami.errors.MeshWarning"),
]


def pulled(comm, h, eta, *, bending="director"):
    """Z-fold pulled by 1 in four steps, and its pull over the elastica's, less 1."""
    sheet = mesh_pattern(z_fold(), 0.125, structure="structured", comm=comm)
    scene = Scene(sheet, Material(E, 0.0, h), bending=bending)
    scene.crease("crease", eta * E * h**3)
    scene.fix("left_edge")
    scene.move("right_edge", x=1.0, y=0.0, z=0.0)
    model = build(scene)
    follow(model, first=0.25)
    exact = ZFold.from_eta(eta, stiffness=E * h**3 / 12).solve(1.0)
    angle = 180 - np.degrees(model.mean_fold_angle("crease"))
    assert angle == pytest.approx(exact.included_angle_deg, abs=0.3)
    return model, model.reaction("right_edge")[0] / exact.force - 1


@pytest.mark.parametrize("bending", ["director", "averaged"])
def test_lost_pull_is_announced(comm, bending):
    """The fold angle is right, the pull is not."""
    model, off = pulled(comm, 1e-5, 1e-7, bending=bending)
    assert abs(off) > 0.1
    lost = lost_crease(model)
    assert lost.name == "crease" and lost.share > 2 * SHARE_LIMIT and lost.turn > 1.0
    with pytest.warns(RoundOffWarning, match=r"of the largest and lets crease 'crease' turn by"):
        warn_round_off(model)


@pytest.mark.parametrize(("h", "eta"), [(1e-2, 1e-6), (1e-3, 1e-5), (1e-4, 1e-4), (1e-4, 1.0)])
def test_pull_that_is_not_lost_is_right_and_not_announced(comm, h, eta):
    model, off = pulled(comm, h, eta)
    assert abs(off) < 0.03
    assert lost_crease(model) is None


def test_state_without_forces_is_not_announced(comm):
    """Panels that follow a crease's rest angle are free of stress in the end."""
    sheet = mesh_pattern(z_fold(included_angle=180.0), 0.5, structure="structured", comm=comm)
    scene = Scene(sheet, Material(E, 0.0, 0.01))
    scene.crease("crease", 1e-3 * E * 0.01**3, rest_angle=lambda time: 0.5 * time)
    scene.fix("left_edge")
    scene.clamp("left_edge")
    model = build(scene)
    assert lost_crease(model) is None
    follow(model)
    assert sum(model.energies().values()) < 1e-12 * E * 0.01**3
    assert lost_crease(model) is None


def test_hinges_and_stiff_folds_have_no_moment_to_lose(comm):
    for stiffness in (0.0, np.inf):
        sheet = mesh_pattern(z_fold(), 0.5, structure="structured", comm=comm)
        scene = Scene(sheet, Material(E, 0.0, 1e-5))
        scene.crease("crease", stiffness)
        scene.fix("left_edge")
        assert lost_crease(build(scene)) is None


def test_short_workspace_of_the_factorisation_is_enlarged(comm):
    """Diagonal entries over eleven orders: delayed pivots need more than MUMPS had estimated."""
    model, _ = pulled(comm, 1e-5, 1e-6, bending="averaged")
    assert model.problem.time == 1.0


def test_error_inside_the_jacobian_is_a_solve_error(comm, monkeypatch):
    factor, calls = Factorisation.factor, []

    def fail(self):
        calls.append(1)
        if len(calls) == 3:
            raise SolveError("the factorisation failed")
        return factor(self)

    monkeypatch.setattr(Factorisation, "factor", fail)
    with pytest.raises(SolveError, match=r"^the factorisation failed"):
        pulled(comm, 1e-2, 1.0)
