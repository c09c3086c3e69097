"""Shapes of obstacles: signed distances, and steps that stop before their surfaces."""

from functools import cache

import numpy as np
import pytest
import ufl
from contact_scenes import plate
from scenes import build

from ufl_origami.barrier import Barrier
from ufl_origami.errors import SceneError
from ufl_origami.obstacles import Box, Cylinder, Plane, SignedDistance, Sphere
from ufl_origami.terms.gaps import LEFT, Gaps
from ufl_origami.terms.nodes import sparse_sum

rng_of = np.random.default_rng
FRAME = np.linalg.qr(rng_of(3).normal(size=(3, 3)))[0]
FRAME[2] = np.cross(FRAME[0], FRAME[1])
CENTRE, HALF = np.array([0.2, -0.1, 0.3]), np.array([0.5, 0.2, 0.35])
AXES = np.array([0.3, 0.5, 0.4])


@cache
def cloud():
    """A model of 100 nodes, which are put anywhere."""
    return build(plate((9, 9)))


def gaps_of(obstacle):
    functions = cloud().functions
    return Gaps(functions, obstacle, sparse_sum(functions, np.ones(100)))


def moved(points):
    return points - cloud().functions.V.tabulate_dof_coordinates()


def torus():
    """Of radii 0.6 and 0.2 about the z axis, as an expression in the sheet's own coordinates."""
    x = ufl.SpatialCoordinate(cloud().sheet.mesh)
    return ufl.sqrt((ufl.sqrt(x[0] ** 2 + x[1] ** 2) - 0.6) ** 2 + x[2] ** 2) - 0.2


def ellipsoid(x):
    """A lower bound of the distance from an ellipsoid."""
    return AXES.min() * (ufl.sqrt(sum(x[i] ** 2 / AXES[i] ** 2 for i in range(3))) - 1.0)


def plane_by_hand(x):
    normal = np.array([1.0, -2.0, 2.0]) / 3.0
    return (x - CENTRE) @ normal, np.tile(normal, (len(x), 1))


def sphere_by_hand(x):
    arm = x - CENTRE
    far = np.linalg.norm(arm, axis=1)
    return far - 0.4, arm / far[:, None]


def cylinder_by_hand(x):
    arm = (x - CENTRE) - np.outer((x - CENTRE) @ FRAME[0], FRAME[0])
    far = np.linalg.norm(arm, axis=1)
    return far - 0.4, arm / far[:, None]


def box_by_hand(x):
    """From the nearest point of the box, or from the nearest side where inside."""
    local = (x - CENTRE) @ FRAME.T
    off = local - np.clip(local, -HALF, HALF)
    outside = np.linalg.norm(off, axis=1)
    depth = HALF - abs(local)
    side = np.eye(3)[depth.argmin(axis=1)] * np.sign(local)
    inside = outside == 0
    slope = np.where(inside[:, None], side, off / np.where(inside, 1.0, outside)[:, None])
    return np.where(inside, -depth.min(axis=1), outside), slope @ FRAME


def torus_by_hand(x):
    ring = np.linalg.norm(x[:, :2], axis=1)
    arm = np.column_stack([x[:, :2] * (1 - 0.6 / ring)[:, None], x[:, 2]])
    far = np.linalg.norm(arm, axis=1)
    return far - 0.2, arm / far[:, None]


def ellipsoid_by_hand(x):
    far = np.linalg.norm(x / AXES, axis=1)
    return AXES.min() * (far - 1.0), AXES.min() * x / AXES**2 / far[:, None]


SHAPES = {
    "plane": (lambda: Plane(CENTRE, (1.0, -2.0, 2.0)), plane_by_hand),
    "sphere": (lambda: Sphere(CENTRE, 0.4), sphere_by_hand),
    "cylinder": (lambda: Cylinder(CENTRE, 7.0 * FRAME[0], 0.4), cylinder_by_hand),
    "box": (lambda: Box(CENTRE, 2 * HALF, (3 * FRAME[0], FRAME[1])), box_by_hand),
    "expression": (lambda: SignedDistance(torus()), torus_by_hand),
    "function": (lambda: SignedDistance(ellipsoid), ellipsoid_by_hand),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_distances_and_gradients_are_those_of_the_shape(shape):
    obstacle, by_hand = SHAPES[shape][0](), SHAPES[shape][1]
    gaps, points = gaps_of(obstacle), CENTRE + rng_of(1).uniform(-0.8, 0.8, (100, 3))
    if shape == "box":
        beyond = (abs((points - CENTRE) @ FRAME.T) > HALF).sum(axis=1)
        assert (np.bincount(beyond, minlength=4) > 3).all()  # inside, faces, edges, corners
    distance, slope = by_hand(points)
    assert (distance > 0).any() and (distance < 0).any()
    assert gaps.at(moved(points)) == pytest.approx(distance, rel=1e-12, abs=1e-14)
    assert gaps.slopes(moved(points)) == pytest.approx(slope, rel=1e-12, abs=1e-13)


def test_distance_vanishes_on_faces_edges_and_corners_of_a_box():
    local = rng_of(2).uniform(-1, 1, (100, 3))
    for axis, count in enumerate((100, 66, 33)):
        local[:count, axis] = np.sign(local[:count, axis])
    points = CENTRE + (local * HALF) @ FRAME
    assert gaps_of(SHAPES["box"][0]()).at(moved(points)) == pytest.approx(0.0, abs=1e-14)


REFUSED = {
    "plane: normal: the vector is zero": lambda: Plane(normal=(0.0, 0.0, 0.0)),
    "plane: point: expected 3 finite numbers": lambda: Plane((0.0, np.nan, 0.0)),
    "sphere: radius: 0.0 must be positive": lambda: Sphere((0.0, 0.0, 0.0), 0.0),
    "sphere: radius: -1.0 must be positive": lambda: Sphere((0.0, 0.0, 0.0), -1.0),
    "sphere: centre: expected 3 finite numbers": lambda: Sphere((0.0, 0.0), 1.0),
    "cylinder: axis: the vector is zero": lambda: Cylinder((0.0,) * 3, (0.0,) * 3, 1.0),
    "cylinder: radius: -2.0 must": lambda: Cylinder((0.0,) * 3, (0.0, 0.0, 1.0), -2.0),
    "box: size: 0.0 must be positive": lambda: Box((0.0,) * 3, (1.0, 0.0, 1.0)),
    "box: axes .* not at right angles": lambda: Box((0.0,) * 3, (1.0,) * 3, ((1, 0, 0), (1, 1, 0))),
    "barrier: stiffness: -1.0 must": lambda: Barrier(-1.0, 0.1),
    "barrier: distance: 0.0 must": lambda: Barrier(1.0, 0.0),
    "no scalar UFL expression": lambda: gaps_of(SignedDistance(lambda x: 2 * x)),
    "3.0 is no scalar UFL expression": lambda: gaps_of(SignedDistance(lambda x: 3.0)),
}


def test_shapes_that_are_none_are_refused():
    for message, make in REFUSED.items():
        with pytest.raises(SceneError, match=message):
            make()


def outside(by_hand, rng):
    """100 random places out of a body."""
    points = rng.uniform(-1.2, 1.2, (2000, 3))
    return points[by_hand(points)[0] > 0][:100]


@pytest.mark.parametrize("shape", SHAPES)
def test_steps_leave_a_tenth_of_every_gap_all_the_way(shape):
    obstacle, by_hand = SHAPES[shape][0](), SHAPES[shape][1]
    gaps, rng, stopped = gaps_of(obstacle), rng_of(7), 0
    for length in (0.1, 1.0, 10.0, 100.0):
        start = outside(by_hand, rng)
        way = length * rng.normal(size=(100, 3)) * rng.uniform(size=(100, 1)) ** 2
        part = gaps.free_part(moved(start), moved(start + way))
        assert 0 < part <= 1
        floor = LEFT * by_hand(start)[0] * (1 - 1e-9)
        for s in np.linspace(0.0, part, 400):
            assert (by_hand(start + s * way)[0] >= floor).all()
        if part < 1:
            stopped += 1
            left = by_hand(start + part * way)[0] / by_hand(start)[0]
            if obstacle.convex:  # and no more is lost than has to be
                assert left.min() < 1.05 * LEFT
    assert stopped >= 3


def test_way_to_a_plane_is_followed_to_nine_tenths():
    gaps, start = gaps_of(Plane()), np.tile([0.1, 0.2, 0.5], (100, 1))
    start[:, 2] += np.arange(100)
    part = gaps.free_part(moved(start), moved(start - [0.3, 0.0, 2.0]))
    assert part == pytest.approx(0.9 * 0.5 / 2.0, rel=1e-12)


def test_way_from_one_side_of_a_hole_to_the_other_is_stopped_there():
    gaps, start = gaps_of(SignedDistance(torus())), np.tile([-0.3, 0.0, 0.0], (100, 1))
    end = start + np.array([5.0, 0.0, 0.0])  # at first the gap grows
    part = gaps.free_part(moved(start), moved(end))
    assert 0.6 < 5.0 * part <= 0.7 - LEFT * 0.1 + 1e-12


GRAZING = {
    "plane": (Plane(), (-5.0, 0.0, 1e-9), (10.0, 0.0, 0.0)),
    "sphere": (Sphere((0.0, 0.0, 0.0), 1.0), (-0.1, 0.0, 1.0 + 1e-3), (0.2, 0.0, 0.0)),
    "box": (Box((0.0,) * 3, (2.0, 2.0, 2.0)), (-0.9, 0.0, 1.0 + 1e-9), (1.8, 0.0, 0.0)),
}


@pytest.mark.parametrize("shape", GRAZING)
def test_grazing_steps_are_not_shortened(shape):
    body, start, way = GRAZING[shape]
    start = np.tile(start, (100, 1))
    assert gaps_of(body).free_part(moved(start), moved(start + way)) == 1.0


THIN = {
    "sphere": Sphere((0.0, 0.0, 0.0), 1e-3),
    "box": Box((0.0, 0.0, 0.0), (4.0, 4.0, 2e-3)),
    "cylinder": Cylinder((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 1e-3),
    "function": SignedDistance(lambda x: ufl.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2) - 1e-3),
}


@pytest.mark.parametrize("shape", THIN)
def test_steps_through_a_thin_body_and_out_are_stopped_before_it(shape):
    start = np.tile([5.0, 0.0, 1.0], (100, 1))
    start[37, 0] = 0.0  # one node hits, far from where the step ends
    gap = 1.0 - 1e-3
    part = gaps_of(THIN[shape]).free_part(moved(start), moved(start - [0.0, 0.0, 100.0]))
    assert 0.89 * gap / 100.0 < part < 0.9001 * gap / 100.0
