"""Paths by arc length: limit points, sway, stops and resumed runs of a truss of two panels.

Each panel is a bar between hinges, of Saint Venant-Kirchhoff material in Green's strain. With half
span a, height w0 and length L the load at the height w is P = E h b w (w0^2 - w^2) / L^3, and the
apex sways at w^2 = w0^2 - 2 a^2.
"""

import numpy as np
import pytest
from path_scenes import truss

import ufl_origami as uo

pytestmark = pytest.mark.mpi


@pytest.mark.parametrize("model", ["ddg", "fem"])
def test_limit_points_of_the_shallow_truss(model):
    scene = truss(0.2, h=0.3, depth=0.5, model=model, n=2)
    path = uo.follow_path(scene, [1.5, -1.5], arc=uo.ArcSettings(first=0.1))
    assert path.reason == "load factor = 1.5"
    assert [event.load for event in path.limit_points] == pytest.approx([1.0, -1.0], abs=1e-6)
    assert [(e.before, e.after) for e in path.events] == [(0, 1), (1, 0)]
    history = path.history
    assert history["load_factor"][-1] == pytest.approx(1.5, abs=1e-9)
    verdicts = set(zip(history["stability"], history["negative_pivots"], strict=True))
    assert verdicts == {("stable", 0), ("unstable", 1)}
    assert (np.diff(history["arc_length"]) > 0).all()


def test_a_resumed_path_is_the_uninterrupted_one(comm, tmp_path_factory):
    folder = comm.bcast(tmp_path_factory.mktemp("path") if comm.rank == 0 else None, root=0)
    arc = uo.ArcSettings(first=0.1)

    def make():
        return truss(0.2, h=0.3, depth=0.5, n=2)

    whole = uo.follow_path(make(), [1.5], arc=arc)

    def stop(step, model):
        if step.number == 7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        uo.follow_path(make(), [1.5], arc=arc, output=folder, on_accept=stop)
    again = uo.follow_path(make(), [1.5], arc=arc, output=folder, resume=True)
    for column in ("step", "load_factor", "arc_length", "energy_total", "limit_points"):
        if comm.size == 1:
            assert (again.history[column] == whole.history[column]).all()
        else:
            assert again.history[column] == pytest.approx(whole.history[column], rel=1e-6)
    assert [e.load for e in again.events] == pytest.approx([e.load for e in whole.events])
    finished = uo.follow_path(make(), [1.5], arc=arc, output=folder, resume=True)
    assert len(finished.steps) == len(whole.steps)


@pytest.mark.parametrize(
    ("stops", "options", "message"),
    [
        ([], {}, "needs a stop"),
        ([float("nan")], {}, "not finite"),
        (["up"], {}, "neither a load factor nor"),
        ([uo.at_fold_angle("creese", 10.0)], {}, "did you mean 'crease'"),
        ([1.0], {"resume": True}, "name the output folder"),
    ],
)
def test_wrong_input_is_refused(stops, options, message):
    with pytest.raises(uo.InputError, match=message):
        uo.follow_path(truss(0.2, h=0.3, depth=0.5, n=2), stops, **options)


def test_wrong_settings_are_refused():
    with pytest.raises(uo.InputError, match="first"):
        uo.ArcSettings(first=-1.0)
