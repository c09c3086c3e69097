"""Stops of paths, resumed and failing paths, contact on the way, and wrong input."""

import dataclasses

import numpy as np
import path_scenes as scenes
import pytest
from run_scenes import crush

import ufl_origami as uo

HEIGHT, CEILING, REACH = 0.2, 0.1, 0.02
MODELS = ["ddg", "fem"]
ARC = uo.ArcSettings(first=0.1)
QUICK = dataclasses.replace(ARC, locate=False)


def truss(model="ddg"):
    return scenes.truss(HEIGHT, h=0.3, depth=0.5, n=2, model=model)


def under_a_ceiling(model="ddg"):
    """The truss below a plane that its crease snaps against."""
    scene = truss(model)
    ceiling = uo.Plane((0.0, 0.0, CEILING), (0.0, 0.0, -1.0))
    scene.obstacle("ceiling", ceiling, uo.Barrier(3e3, REACH))
    return scene


def folder_of(comm, tmp_path_factory, name):
    return comm.bcast(tmp_path_factory.mktemp(name) if comm.rank == 0 else None, root=0)


@pytest.mark.parametrize("model", MODELS)
def test_stop_at_a_position(model):
    """Beyond the limit point, so that no load factor would name the state."""
    path = uo.follow_path(truss(model), [uo.at_position("A", "z", -0.05)], arc=QUICK)
    assert path.reason == "A, z = -0.05"
    assert path.model.position("A")[2] == pytest.approx(-0.05, abs=1e-12)
    assert path.end.load == pytest.approx(scenes.bar_load(0.05, HEIGHT), rel=1e-5)
    assert path.history["load_factor"][-1] == path.end.load == path.model.problem.time


@pytest.mark.parametrize("model", MODELS)
def test_stop_at_a_fold_angle(model):
    """The truss starts at a fold of 2 arctan(0.2), 22.6 degrees."""
    start = uo.build(truss(model))
    degrees = np.sign(start.mean_fold_angle("crease")) * 12.0
    path = uo.follow_path(start, [uo.at_fold_angle("crease", degrees)], arc=QUICK)
    assert path.reason == f"fold angle of 'crease' = {degrees:g}"
    assert np.degrees(path.model.mean_fold_angle("crease")) == pytest.approx(degrees, abs=1e-9)
    depth = np.tan(np.radians(6.0))
    assert path.end.load == pytest.approx(scenes.bar_load(depth, HEIGHT), rel=1e-5)


def test_stop_after_a_number_of_turns():
    path = uo.follow_path(truss(), [], turns=1, arc=ARC)
    assert path.reason == "1 limit points"
    assert len(path.limit_points) == 1
    both = uo.follow_path(truss(), [5.0], turns=2, arc=ARC)
    assert [e.load for e in both.limit_points] == pytest.approx([1.0, -1.0], abs=1e-6)


def test_the_first_of_several_stops_is_met():
    stops = [0.9, uo.at_position("A", "z", -0.19), uo.at_load(0.8)]
    path = uo.follow_path(truss(), stops, arc=QUICK)
    assert path.reason == "A, z = -0.19"
    assert path.end.load < 0.8


def test_a_path_may_start_on_a_stop_and_meets_it_again():
    first = uo.follow_path(truss(), [0.5], arc=QUICK)
    again = uo.follow_path(first.model, [0.5], towards=first.end.tangent, arc=QUICK)
    assert again.reason == "load factor = 0.5"
    assert again.end.load == pytest.approx(0.5, abs=1e-9)
    assert again.model.position("A")[2] > first.history["position_A_z"][-1] + 0.05


@pytest.mark.mpi
@pytest.mark.parametrize("model", MODELS)
def test_stop_at_a_gap(model):
    path = uo.follow_path(under_a_ceiling(model), [uo.at_gap("ceiling", 0.03)], arc=QUICK)
    assert path.reason == "gap to 'ceiling' = 0.03"
    assert path.model.position("A")[2] == pytest.approx(CEILING - 0.03, abs=1e-9)


@pytest.mark.parametrize("model", MODELS)
def test_contact_during_a_path(model):
    """The obstacle takes what the truss does not: the supports feel the truss alone."""
    path = uo.follow_path(under_a_ceiling(model), [1.5], arc=ARC)
    history = path.history
    load, height = history["load_factor"], history["position_A_z"]
    assert path.limit_points[0].load == pytest.approx(1.0, abs=1e-6)
    assert path.limit_points[1].load > -1.0  # stopped by the ceiling before the truss's own
    length = np.hypot(1.0, HEIGHT)
    unit = scenes.E * 0.3 * 0.5 * (HEIGHT / length) ** 3 * 2 / (3 * np.sqrt(3.0))
    held = history["reaction_left_edge_z"] + history["reaction_right_edge_z"]
    assert -held / unit == pytest.approx(scenes.bar_load(-height, HEIGHT), abs=5e-3)
    touching = height > CEILING - REACH
    assert (history["energy_contact"] > 0).tolist() == touching.tolist()
    assert touching[-1] and load[-1] == pytest.approx(1.5, abs=1e-9)
    assert 0 < path.model.contacts[0].smallest < REACH
    assert history["stability"][-1] == "stable"


@pytest.mark.mpi
@pytest.mark.parametrize("model", MODELS)
def test_resumed_beyond_a_limit_point_bit_for_bit(comm, tmp_path_factory, model):
    """History, unknowns and direction of the path, in serial; to round-off among ranks."""
    folder = folder_of(comm, tmp_path_factory, f"resume_{model}")
    stops = [uo.at_position("A", "z", 0.15)]
    whole = uo.follow_path(truss(model), stops, arc=ARC)
    middle = len(whole.steps) - 2

    def stop(step, _):
        if step.number == middle:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        uo.follow_path(truss(model), stops, arc=ARC, output=folder, on_accept=stop)
    again = uo.follow_path(truss(model), stops, arc=ARC, output=folder, resume=True)
    assert again.reason == whole.reason
    assert len(again.steps) == len(whole.steps)
    tolerance = 0.0 if comm.size == 1 else 1e-6
    pairs = [(again.model.x, whole.model.x), (again.end.tangent, whole.end.tangent)]
    for one, other in pairs:
        size = other.norm()
        one.axpy(-1.0, other)
        assert one.norm() <= tolerance * size
    for name in whole.history.columns:
        if name not in ("seconds", "stability"):
            one, other = again.history[name], whole.history[name]
            assert one == pytest.approx(other, rel=tolerance, abs=tolerance), name
    with pytest.raises(uo.InputError, match="was not kept"):
        uo.restore(again.model, again.events[0])


@pytest.mark.mpi
def test_a_path_that_cannot_go_on_tells_why_and_keeps_its_steps(comm, tmp_path_factory):
    """The sheet is crushed to a tenth of its area at load factor 0.9 / 0.95."""
    folder, accepted = folder_of(comm, tmp_path_factory, "crush"), []
    model = uo.build(crush(comm))

    def follow(**options):
        with pytest.raises(uo.SolveError, match=r"shortest length: a triangle shrank to 0\.1 of"):
            uo.follow_path(model, [1.0], output=folder, **options)

    follow(on_accept=lambda step, _: accepted.append(step.time))
    assert accepted[-1] == pytest.approx(0.9 / 0.95, rel=1e-4)
    assert model.problem.time == accepted[-1]
    history = uo.read_history(folder / "history.csv")
    assert history["load_factor"].tolist() == pytest.approx([0.0, *accepted], rel=1e-15)
    model = uo.build(crush(comm))
    follow(resume=True)
    assert model.problem.time == accepted[-1]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: uo.at_position("A", "up", 0.0), "axis 'up' is none of"),
        (lambda: uo.at_position("A", "xy", 0.0), "axis 'xy' is none of"),
        (lambda: uo.at_position("A", "", 0.0), "axis '' is none of"),
        (lambda: uo.at_position("A", "z", float("nan")), "not finite"),
        (lambda: uo.at_load(float("inf")), "not finite"),
        (lambda: uo.at_gap("ceiling", float("nan")), "not finite"),
    ],
)
def test_wrong_stops_are_refused_where_they_are_made(make, message):
    with pytest.raises(uo.InputError, match=message):
        make()


@pytest.mark.parametrize(
    ("stop", "message"),
    [
        (uo.at_position("a", "z", 0.0), "did you mean 'A'"),
        (uo.at_gap("cieling", 0.01), "did you mean 'ceiling'"),
        (uo.at_fold_angle("left_edge", 0.0), "no crease is named 'left_edge'"),
    ],
)
def test_wrong_names_are_refused_on_use(stop, message):
    with pytest.raises(uo.InputError, match=message):
        uo.follow_path(under_a_ceiling(), [stop])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"turns": 0}, "turns"),
        ({"turns": -1}, "turns"),
        ({"towards": 0.0}, "towards"),
        ({"towards": float("nan")}, "towards"),
    ],
)
def test_wrong_ways_are_refused(options, message):
    with pytest.raises(uo.InputError, match=message):
        uo.follow_path(truss(), [1.0], **options)


def test_branches_are_refused_without_mode_or_side():
    path = uo.follow_path(truss(), [], turns=1, arc=ARC)
    (event,) = path.limit_points
    with pytest.raises(uo.InputError, match="limit point at 1 has no eigenvector"):
        uo.switch_branch(path.model, event)
    other = dataclasses.replace(event, mode=path.end.tangent)
    for side in (0, 2, 0.5):
        with pytest.raises(uo.InputError, match=f"side {side} is neither 1 nor -1"):
            uo.switch_branch(path.model, other, side=side)
    with pytest.raises(uo.InputError, match="size"):
        uo.switch_branch(path.model, other, size=0.0)


def test_landscapes_of_one_state_are_refused():
    model = uo.build(truss())
    for count, end in ((21, model.x.copy()), (1, model.x.duplicate())):
        with pytest.raises(uo.InputError, match="two places and two different states"):
            uo.landscape(model, model.x.copy(), end, count)


def test_a_scene_that_no_load_moves_has_no_path():
    scene = truss()
    scene.loads.clear()
    with pytest.raises(uo.SolveError, match="nothing moves with the load factor"):
        uo.follow_path(scene, [1.0])
