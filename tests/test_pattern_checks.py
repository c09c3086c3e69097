"""Every check of a crease pattern raises, and tells what is wrong and where."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pattern_samples import SQUARE, folded, random_rotation, t_junction, two_squares

from ufl_origami.errors import InputError, PatternError
from ufl_origami.pattern import CreasePattern
from ufl_origami.pattern_edit import named, with_edge_property

pytestmark = pytest.mark.serial


def changed(**fields):
    """The two squares with raw fields replaced."""
    return replace(two_squares(assignment={(1, 4): "V"}), **fields)


def letters(text):
    return tuple(text)


@pytest.mark.parametrize(
    "fields, message",
    [
        (
            dict(vertices_coords=[*SQUARE[:3], (math.nan, 1), *SQUARE[4:]]),
            r"vertex 3 has coordinates \[nan, 1.0, 0.0\]: they must be finite",
        ),
        (
            dict(vertices_coords=[*SQUARE[:5], (1, math.inf)]),
            r"vertex 5 has coordinates \[1.0, inf, 0.0\]",
        ),
        (dict(vertices_coords=[*SQUARE[:5], (1, 2, 3, 4)]), "vertex 5 has 4 coordinates"),
        (dict(vertices_coords=[*SQUARE[:5], ("a", "b")]), "vertex 5 .* not numbers"),
        (dict(vertices_coords=[*SQUARE, (5, 5)]), "vertex 6 belongs to no face"),
        (
            dict(vertices_coords=[*SQUARE[:5], (2, 1e-7)]),
            r"duplicate vertices: 2 and 5 are both at \[2.0, 0.0, 0.0\]",
        ),
        (
            dict(edges_assignment=letters("BVBBBXB")),
            r"edge 5 \(vertices 2-5\) has the unknown assignment 'X'; FOLD knows B",
        ),
        (dict(edges_assignment=letters("BvBBBBB")), "edge 1 .* unknown assignment 'v'"),
        (dict(edges_assignment=letters("BVB")), "edges_assignment has 3 values, but there are 7"),
        (
            dict(edges_assignment=letters("BBBBBBB")),
            r"edge 1 \(vertices 1-4, B\) is a boundary edge with 2 faces: it must have one$",
        ),
        (
            dict(edges_assignment=letters("BCBBBBB")),
            r"edge 1 .* is a cut edge with 2 faces: .*give the two sides of a cut their own",
        ),
        (
            dict(edges_assignment=letters("MVBBBBB")),
            r"dangling crease: edge 0 \(vertices 0-1, M\) has 1 face, at least two",
        ),
        (dict(edges_assignment=letters("BVUBBFB")), r"dangling crease: edge 2 .*U.*1 more like it"),
        (
            dict(edges_vertices=[(0, 1), (1, 4), (4, 3), (3, 0), (1, 2), (2, 9), (5, 4)]),
            r"edge 5 has vertices \[2, 9\], but vertices go from 0 to 5",
        ),
        (
            dict(edges_vertices=[(0, 1), (1, 4), (4, 3), (3, 0), (1, 2), (2, -1), (5, 4)]),
            r"edge 5 has vertices \[2, -1\]",
        ),
        (
            dict(edges_vertices=[(0, 1), (1, 4), (4, 3), (3, 0), (1, 2), (2, 2), (5, 4)]),
            "edge 5 joins vertex 2 to itself",
        ),
        (
            dict(edges_vertices=[(0, 1), (1, 4), (4, 3), (3, 0), (1, 2), (4, 1), (5, 4)]),
            r"edge 5 joins the same vertices \[4, 1\] as edge 1",
        ),
        (
            dict(edges_vertices=[(0, 1), (1, 4), (4, 3), (3, 0), (1, 2), (2, 4), (5, 4)]),
            "face 1 is not closed: no edge joins its neighbouring vertices 2 and 5",
        ),
        (dict(edges_vertices=[(0, 1.5)]), "edges_vertices must be whole numbers"),
        (dict(edges_vertices=[(0, 1, 2)]), r"edges_vertices must be .* of shape \(any x 2\)"),
        (dict(faces_vertices=()), "the pattern has no faces"),
        (dict(faces_vertices=((0, 1, 4, 3), (1, 2))), r"face 1 is not closed: its loop \[1, 2\]"),
        (dict(faces_vertices=((0, 1, 4, 3), ())), r"face 1 is not closed: its loop \[\] has 0"),
        (dict(faces_vertices=((0, 1, 4, 3), (1, 2, 6, 4))), "face 1 has vertex 6, but"),
        (
            dict(faces_vertices=((0, 1, 4, 3, 0), (1, 2, 5, 4))),
            "face 0 passes vertex 0 more than once",
        ),
        (dict(faces_vertices=((0, 1, 4, 3), (1, 2, 5.5, 4))), "face 1 must be whole numbers"),
        (
            dict(faces_vertices=((0, 1, 4, 3), (1, 4, 5, 2))),
            r"inconsistent orientation: faces 0 and 1 run the same way along edge 1 \(vertices 1-4",
        ),
        (
            dict(edges_foldAngle=[0, -5, 0, 0, 0, 0, 0]),
            r"edge 1 \(vertices 1-4, V\) has fold angle -5 deg, which contradicts",
        ),
        (
            dict(edges_foldAngle=[0, 181, 0, 0, 0, 0, 0]),
            r"fold angle 181 deg, outside \[-180, 180\]",
        ),
        (dict(edges_foldAngle=[7, 5, 0, 0, 0, 0, 0]), "edge 0 .*fold angle 7 deg: a boundary edge"),
        (dict(edges_foldAngle=[0, 5]), "edges_foldAngle has 2 values, but there are 7 edges"),
        (dict(edges_foldAngle=["a"] * 7), "edges_foldAngle must hold numbers or null"),
        (
            dict(source={"frame_classes": ["foldedForm", "creasePattern"]}),
            "frame_classes holds both creasePattern and foldedForm",
        ),
    ],
)
def test_errors_name_what_and_where(fields, message):
    with pytest.raises(PatternError, match=message):
        changed(**fields)
    assert issubclass(PatternError, InputError)


def polygon(points):
    return CreasePattern.from_arrays(points, [range(len(points))])


@pytest.mark.parametrize(
    "points, message",
    [
        (
            [(0, 0), (1, 1), (1, 0), (0, 1)],
            "face 0 crosses or touches itself: its sides 0-1 and 2-3 meet",
        ),
        (
            [(0, 0), (2, 0), (2, 2), (1, 0), (0, 2)],
            "face 0 crosses or touches itself: its sides 0-1 and 2-3",
        ),
        ([(0, 0), (4, 0), (4, 4), (1, -1), (0, 4)], "crosses or touches itself"),
        (
            [(0, 0), (1, 0), (2, 0)],
            r"face 0 has no area \(.* at a perimeter of 4\)",
        ),
    ],
)
def test_face_shape_errors_in_any_position(points, message):
    rng = np.random.default_rng(0)
    flat = np.pad(np.array(points, float), ((0, 0), (0, 1)))
    for _ in range(5):
        with pytest.raises(PatternError, match=message):
            polygon(flat @ random_rotation(rng).T + rng.normal(size=3))
    with pytest.raises(PatternError, match=message):
        polygon(points)


def test_random_star_shaped_polygons_are_no_errors_and_reordered_ones_are():
    rng = np.random.default_rng(5)
    for n in (4, 5, 8, 13):
        angle = 2 * np.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
        radius = rng.uniform(0.3, 1.0, n)
        star = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
        assert len(polygon(star).panels) == 1
        convex = star / np.linalg.norm(star, axis=1, keepdims=True)
        convex[[0, 1]] = convex[[1, 0]]
        with pytest.raises(PatternError, match="face 0 crosses or touches itself"):
            polygon(convex)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_panels_must_be_plane_relative_to_their_size(size):
    bent = size * np.array([(0, 0, 0), (1, 0, 0), (1, 1, 1e-3), (0, 1, 0)])
    with pytest.raises(
        PatternError, match=r"panel 'panel0' \(faces \[0\]\) is not plane at rest: "
    ):
        polygon(bent)
    assert len(CreasePattern.from_arrays(bent, [range(4)], tolerance=1e-3).panels) == 1
    bent[2, 2] *= 1e-3
    assert len(polygon(bent).panels) == 1


def test_panel_of_several_faces_must_be_plane():
    points, faces = folded(math.radians(0.05))
    with pytest.raises(PatternError, match=r"panel 'panel0' \(faces \[0, 1\]\) is not plane"):
        CreasePattern.from_arrays(points, faces, assignment={(0, 1): "F"})
    points, faces = folded(math.radians(30))
    with pytest.raises(PatternError, match=r"panel 'panel0' \(faces \[0, 1\]\) is not plane"):
        CreasePattern.from_arrays(points, faces, assignment={(0, 1): "J"})


def test_closed_box_of_join_edges_is_not_plane():
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    box = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    edges = CreasePattern.from_arrays(corners, box).edges_vertices
    joined = {tuple(pair): "J" for pair in edges}
    with pytest.raises(PatternError, match=r"not plane at rest: .* is inf of the panel's size"):
        CreasePattern.from_arrays(corners, box, assignment=joined)


def test_folded_form_must_agree_with_its_geometry():
    points, faces = folded(math.radians(40))
    agree = CreasePattern.from_arrays(
        points, faces, assignment={(0, 1): "V"}, fold_angle={(0, 1): 40.05}
    )
    assert agree.rest_angles[agree.is_crease] == pytest.approx([math.radians(40)])
    for letter, angle, message in (
        ("V", 41.0, r"has edges_foldAngle 41 deg, but its faces are turned by 40 deg in this"),
        ("M", None, r"a geometric fold angle of 40 deg, which contradicts its assignment"),
    ):
        given = {} if angle is None else {(0, 1): angle}
        with pytest.raises(PatternError, match=message):
            CreasePattern.from_arrays(points, faces, assignment={(0, 1): letter}, fold_angle=given)
    zero = CreasePattern.from_arrays(points, faces, fold_angle={(0, 1): 0.0})
    assert zero.rest_angles[zero.is_crease] == pytest.approx([math.radians(40)])  # U: unknown
    flat = with_edge_property(named(agree, edges={"c": [(0, 1)]}), "crease", {"c": True})
    with pytest.raises(PatternError, match="is a flat edge, but its faces are turned by 40 deg"):
        replace(flat, edges_assignment=letters("FBBBBBB"), edges_foldAngle=None)
    with pytest.raises(PatternError, match=r"creasePattern \(unfolded\), but the faces at edge 0"):
        replace(agree, source={"frame_classes": ["creasePattern"]})


def test_folded_flat_frame_rests_flat_whatever_its_target():
    pattern = two_squares(assignment={(1, 4): "V"}, fold_angle={(1, 4): 90.0})
    with pytest.raises(PatternError, match="edges_foldAngle 90 deg, but its faces are turned by 0"):
        replace(pattern, source={"frame_classes": ["foldedForm"]})


def test_missing_fold_angle_is_told_when_it_is_needed():
    pattern = two_squares(assignment={(1, 4): "V"})
    with pytest.raises(PatternError, match=r"edge 1 \(vertices 1-4, V\) has no fold angle"):
        _ = pattern.rest_angles


def test_edges_of_three_faces_take_no_assignment_and_no_angle():
    pattern = t_junction()
    (edge,) = np.flatnonzero(pattern.is_crease)
    for letter in "MVFJ":
        kinds = tuple(letter if e == edge else k for e, k in enumerate(pattern.edges_assignment))
        with pytest.raises(PatternError, match="has 3 faces: with more than two faces"):
            replace(pattern, edges_assignment=kinds)
    angle = np.where(pattern.is_crease, 90.0, np.nan)
    with pytest.raises(PatternError, match="fold angle 90 deg, but 3 faces"):
        replace(pattern, edges_foldAngle=angle)


def test_ends_of_cuts_may_touch():
    points = [(0, 0), (1, 0), (1, 1), (0, 1), (1, 0), (2, 0), (2, 1), (1, 1)]
    faces = [(0, 1, 2, 3), (4, 5, 6, 7)]
    with pytest.raises(PatternError, match=r"duplicate vertices: 1 and 4 .*\(and 1 more like it\)"):
        CreasePattern.from_arrays(points, faces)
    cut = CreasePattern.from_arrays(points, faces, assignment={(1, 2): "C", (7, 4): "C"})
    assert cut.is_boundary.all()
    with pytest.raises(PatternError, match="duplicate vertices: 1 and 4"):
        CreasePattern.from_arrays(points, faces, assignment={(1, 2): "C"})
