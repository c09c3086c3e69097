"""Paths by arc length: limit points, sway, stops and resumed runs of a truss of two panels.

Each panel is a bar between hinges, of Saint Venant-Kirchhoff material in Green's strain. With half
span a, height w0 and length L the load at the height w is P = E h b w (w0^2 - w^2) / L^3, and the
apex sways at w^2 = w0^2 - 2 a^2.
"""

import numpy as np
import pytest

import ufl_origami as uo

pytestmark = pytest.mark.mpi

E = 1e4


def truss(height, *, h, depth, model="ddg", n=1):
    """Two panels over a span of 2 with hinges, whose limit load is that of factor 1."""
    length = np.hypot(1.0, height)
    pattern = uo.gallery.z_fold(length, depth, 2 * np.degrees(np.arctan2(1.0, height)))
    scene = uo.Scene(uo.mesh_pattern(pattern, size=length / n), uo.Material(E, 0.0, h), model=model)
    scene.crease("crease", 0.0)
    scene.fix("left_edge")
    scene.fix("right_edge")
    limit = E * h * (height / length) ** 3 * 2 / (3 * np.sqrt(3.0))
    scene.line_load("crease", (0.0, 0.0, limit))
    return scene


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
