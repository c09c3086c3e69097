"""Von Mises truss of two creased panels against its closed form: sway, branch, jump, landscape.

With half span a = 1, depth d of the crease below the hinges, d0 at rest and L the panels' length,
the load is P = E h b d (d0^2 - d^2) / L^3; the crease sways at d^2 = d0^2 - 2 a^2, and on the
branch that leaves there it moves on a circle of that radius about the middle of the span, with
P = 2 E h b a^2 d / L^3.
"""

from mpi4py import MPI

import numpy as np
import path_scenes as scenes
import pytest
from scipy.interpolate import CubicSpline

import ufl_origami as uo

HEIGHT = 4.0
STEEP = {"h": 1.4, "depth": 4.0}
RADIUS = np.sqrt(HEIGHT**2 - 2.0)
SWAY = scenes.bar_load(RADIUS, HEIGHT)
SHALLOW = {"h": 0.3, "depth": 0.5}
MODELS = ["ddg", "fem"]


def shallow(model="ddg", **mesh):
    return scenes.truss(0.2, n=2, model=model, **SHALLOW, **mesh)


def depth(model):
    """Depth of the crease below the hinges."""
    return -model.position("A")[2]


@pytest.fixture(scope="module", params=MODELS)
def steep(request):
    """Path of the steep truss beyond its sway, and what follows until the crease is on top."""
    scene = scenes.truss(HEIGHT, model=request.param, **STEEP)
    arc = uo.ArcSettings(first=0.1)
    path = uo.follow_path(scene, [0.38], arc=arc)
    stop, quick = uo.at_position("A", "z", 1.2 * HEIGHT), uo.ArcSettings(locate=False)
    return path, uo.follow_path(path.model, [stop], towards=path.end.tangent, arc=quick)


def test_steep_truss_sways_before_its_limit_point(steep):
    path, rest = steep
    (event,) = path.events
    assert event.kind == "bifurcation"
    assert event.load == pytest.approx(SWAY, rel=1e-5)
    assert (event.before, event.after) == (0, 1)
    history = rest.history
    load, pivots, d = (history[k] for k in ("load_factor", "negative_pivots", "position_A_z"))
    assert load == pytest.approx(scenes.bar_load(-d, HEIGHT), abs=1e-5)
    assert ((pivots > 0) == (np.abs(d) < RADIUS)).all()
    assert min(d) < -HEIGHT / np.sqrt(3.0)  # the limit point lies on the unstable part


def test_restored_bifurcation_is_the_equilibrium_of_then(steep):
    """Also after the fold angle has gone to the other side, by more than half a turn."""
    model, event = steep[0].model, steep[0].bifurcations[0]
    uo.restore(model, event)
    problem, residual = model.problem, model.x.duplicate()
    problem.residual(model.x, residual)
    assert residual.norm() < 1e-9 * problem.force_scale
    angle = 2 * np.degrees(np.arctan(RADIUS))
    assert model.mean_fold_angle("crease") == pytest.approx(np.radians(angle), rel=1e-6)
    assert depth(model) == pytest.approx(RADIUS, rel=1e-6)


@pytest.mark.parametrize("side", [1, -1])
def test_sway_branch_is_a_circle(steep, side):
    """From the bifurcation through the closed fold (180 degrees) to the opposite bifurcation."""
    model, event = steep[0].model, steep[0].bifurcations[0]
    places = []

    def observe(step, model):
        x, _, z = model.position("A")
        places.append((x, -z, step.time, np.degrees(model.mean_fold_angle("crease"))))

    stop = uo.at_position("A", "z", 0.5 * RADIUS)
    branch = uo.follow_branch(
        model, event, [stop], side=side, arc=uo.ArcSettings(first=0.05), on_accept=observe
    )
    assert branch.reason.startswith("A, z")
    x, d, load, angle = np.transpose(places)
    assert np.hypot(x, d) == pytest.approx(RADIUS, rel=1e-6)
    assert (x > 0).all() or (x < 0).all()
    assert load == pytest.approx(SWAY * d / RADIUS, abs=1e-5)
    inside = np.arctan2(d, x - 1) - np.arctan2(d, x + 1)
    assert angle == pytest.approx(180 - np.degrees(inside), abs=1e-4)
    assert angle[-1] > 180


def test_both_sides_of_a_bifurcation_mirror_each_other(steep):
    model, event = steep[0].model, steep[0].bifurcations[0]
    ends = []
    for side in (1, -1):
        uo.switch_branch(model, event, side=side, size=0.1)
        ends.append(model.position("A"))
    assert ends[0][0] == pytest.approx(-ends[1][0], rel=1e-6)
    assert abs(ends[0][0]) > 0.05
    assert ends[0][2] == pytest.approx(ends[1][2], rel=1e-6)


@pytest.mark.mpi
@pytest.mark.parametrize("model", MODELS)
def test_load_control_jumps_and_says_so(model):
    scene = shallow(model)
    with pytest.warns(uo.BranchWarning, match="found far from|far off"):
        result = uo.solve_static(scene, [0.95, 1.05])
    d = depth(result.model)
    assert d < -0.2
    assert scenes.bar_load(d, 0.2) == pytest.approx(1.05, rel=1e-5)
    assert result.history["stability"][-1] == "stable"


@pytest.mark.mpi
@pytest.mark.parametrize("model", MODELS)
def test_path_is_the_same_alone_and_among_ranks(model):
    paths = [
        uo.follow_path(shallow(model, comm=comm), [1.5], arc=uo.ArcSettings(first=0.1))
        for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
    ]
    one, other = (path.history for path in paths)
    assert len(one) == len(other)
    for name in ("load_factor", "arc_length", "negative_pivots", "energy_total"):
        assert one[name] == pytest.approx(other[name], rel=1e-7, abs=1e-9)
    loads = [[event.load for event in path.events] for path in paths]
    assert loads[0] == pytest.approx(loads[1], rel=1e-9)


def potential(d, load=0.0):
    """Energy of the shallow truss at a depth of its crease, for a load factor."""
    h, b = SHALLOW["h"], SHALLOW["depth"]
    stiffness = scenes.E * h * b / 1.04**1.5
    force = load * stiffness / 1.5 / np.sqrt(3.0) * 0.2**3
    return 0.25 * stiffness * (d**2 - 0.2**2) ** 2 - force * (0.2 - d)


def stable_states(model, load):
    """Unknowns of the two stable equilibria at a load factor, and the model."""
    model = uo.build(shallow(model))
    arc = uo.ArcSettings(first=0.1, locate=False)
    ends = []
    for stop in (load, uo.at_position("A", "z", 0.3), load):
        back = -1.0 if len(ends) == 1 and stop == load else 1.0
        path = uo.follow_path(model, [stop], towards=back, arc=arc)
        if stop == load:
            ends.append(path.model.x.copy())
    return model, ends


@pytest.mark.parametrize("load", [0.05, 0.5])
@pytest.mark.parametrize("model", MODELS)
def test_landscape_between_the_two_states(model, load):
    model, (start, end) = stable_states(model, load)
    cubic = [1.0, 0.0, -(0.2**2), load * 0.2**3 / 1.5 / np.sqrt(3.0)]
    low, middle, high = np.sort(np.roots(cubic).real)
    depths = []
    found = uo.landscape(model, start, end, 41, on_state=lambda _, m: depths.append(depth(m)))
    assert depths[0] == pytest.approx(high, rel=1e-6)
    assert depths[-1] == pytest.approx(low, rel=1e-6)
    force = CubicSpline(found.places, found.forces)
    (saddle,) = [place for place in force.roots(extrapolate=False) if 0.1 < place < 0.9]
    assert saddle == pytest.approx((high - middle) / (high - low), abs=1e-5)
    energy = CubicSpline(found.places, found.energies)
    barrier = potential(middle, load) - potential(high, load)
    assert energy(saddle) - energy(0.0) == pytest.approx(barrier, rel=1e-4)
    assert barrier * 0.99 < found.barrier < barrier * (1 + 1e-6)
    difference = potential(low, load) - potential(high, load)
    assert found.energies[-1] - found.energies[0] == pytest.approx(difference, rel=1e-5)


@pytest.mark.parametrize("model", MODELS)
def test_force_of_a_landscape_is_the_slope_of_its_energy(model):
    model, (start, end) = stable_states(model, 0.3)
    found = uo.landscape(model, start, end, 41)
    step = found.places[1]
    slope = (found.energies[2:] - found.energies[:-2]) / (2 * step)
    scale = np.abs(found.forces).max()
    assert found.forces[1:-1] == pytest.approx(slope, abs=2 * step**2 * 12 * scale)
    assert found.forces[[0, -1]] == pytest.approx(0.0, abs=1e-6 * scale)


@pytest.mark.filterwarnings("ignore::ufl_origami.errors.MeshWarning")  # shrinks by half
def test_limit_point_and_bifurcations_of_one_step_are_told_apart():
    """Thick panels of the steep truss buckle twice just behind the limit point."""
    scene = scenes.truss(HEIGHT, **STEEP)
    before = uo.follow_path(scene, [0.99], arc=uo.ArcSettings(first=0.1, locate=False))
    way = before.end.tangent
    path = uo.follow_path(before.model, [0.92], towards=way, arc=uo.ArcSettings(first=1.0))
    assert [event.kind for event in path.events] == ["limit point", "bifurcation", "bifurcation"]
    count = before.history["negative_pivots"][-1]
    for event in path.events:
        assert (event.before, event.after) == (count, count + 1)
        count = event.after
    assert path.history["negative_pivots"][-1] == count
