"""Jumps from the unstable state of a shallow truss, to either side, against its exact energy."""

import numpy as np
import pytest
from path_scenes import E, truss

import ufl_origami as uo

pytestmark = pytest.mark.mpi

HEIGHT, H, DEPTH = 0.2, 0.3, 0.5


def exact():
    """Potential energies of the three equilibria at half the limit load, from top to bottom."""
    length3 = (1.0 + HEIGHT**2) ** 1.5
    stiffness = E * H * DEPTH / length3
    load = 0.5 * stiffness * HEIGHT**3 * 2 / (3 * np.sqrt(3.0))
    heights = np.sort(np.roots([-stiffness, 0.0, stiffness * HEIGHT**2, -load]).real)[::-1]
    return 0.25 * stiffness * (heights**2 - HEIGHT**2) ** 2 - load * (HEIGHT - heights)


@pytest.fixture(scope="module", params=["ddg", "fem"])
def unstable(request):
    """Model in the unstable state at half the limit load."""
    scene = truss(HEIGHT, h=H, depth=DEPTH, model=request.param, n=2)
    quick = uo.ArcSettings(first=0.2, locate=False)
    first = uo.follow_path(scene, [0.9], arc=quick)
    turned = uo.follow_path(first.model, [0.8], towards=first.end.tangent, arc=quick)
    path = uo.follow_path(turned.model, [0.5], towards=turned.end.tangent, arc=quick)
    assert uo.stability(path.model) == 1
    return path.model, path.model.x.copy()


@pytest.mark.parametrize(("side", "state"), [("up", 0), ("down", 2)])
def test_jump_releases_the_exact_energy(unstable, side, state):
    model, start = unstable
    start.copy(model.x)
    model.problem.set_time(0.5)
    model.problem.accept(model.x)
    (mode,) = uo.modes(model)
    assert mode.value < 0
    heights = mode.vector.array_r[2 : 3 * model.configuration.nv_owned : 3]
    along = np.sign(model.configuration.sum(heights.sum()))  # the load and the crease point up
    sign = int(along if side == "down" else -along)
    found = uo.jump(model, side=sign)
    energies = exact()
    assert found.released == pytest.approx(energies[1] - energies[state], rel=2e-3)
    assert uo.stability(model) == 0
    assert found.energies[-1] < found.energies[0]
    assert found.kinetic[-1] == 0.0 < found.kinetic.max()
    assert (np.diff(found.times) >= 0).all()


def test_stable_states_and_wrong_sides_are_refused(unstable):
    model, _ = unstable
    with pytest.raises(uo.InputError, match="neither 1 nor -1"):
        uo.jump(model, side=0)


@pytest.mark.parametrize("model", ["ddg", "fem"])
def test_a_free_hinge_is_neutral_and_a_spring_stable(model):
    scene = uo.Scene(
        uo.mesh_pattern(uo.gallery.z_fold(1.0, 1.0, included_angle=90.0), 0.5),
        uo.Material(E, 0.3, 0.1),
        model=model,
    )
    scene.fix("left")
    scene.crease("crease", 0.0)
    assert uo.verdict(uo.build(scene)) == "neutral"
    scene.creases.clear()
    scene.crease("crease", 0.01)
    assert uo.verdict(uo.build(scene)) == "stable"


def test_the_middle_state_is_unstable(unstable):
    model, start = unstable
    start.copy(model.x)
    model.problem.set_time(0.5)
    model.problem.accept(model.x)
    assert uo.verdict(model) == "unstable"


@pytest.mark.parametrize("model", ["ddg", "fem"])
@pytest.mark.parametrize(("stiffness", "verdict"), [(0.0, "neutral"), (0.01, "stable")])
def test_a_path_tells_free_hinges_from_springs(model, stiffness, verdict):
    """A panel with a loose flap is stretched."""
    sheet = uo.mesh_pattern(uo.gallery.z_fold(1.0, 1.0, included_angle=90.0), 0.5)
    scene = uo.Scene(sheet, uo.Material(E, 0.3, 0.1), model=model)
    scene.crease("crease", stiffness)
    scene.fix("left_edge")
    scene.move("crease", x=lambda t: 0.02 * t, y=0.0, z=0.0)
    path = uo.follow_path(scene, [0.1], arc=uo.ArcSettings(first=0.1))
    assert set(path.history["stability"]) == {verdict}
