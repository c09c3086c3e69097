"""CreasePattern: what panels, creases and angles mean, and an error for everything wrong."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from pattern_samples import folded, grid, random_rotation, t_junction, two_squares

from ufl_origami.errors import PatternError
from ufl_origami.gallery import z_fold
from ufl_origami.pattern import CreasePattern
from ufl_origami.pattern_edit import (
    named,
    scaled,
    with_edge_property,
    with_fold_angles,
    with_panel_property,
)
from ufl_origami.pattern_names import PatternNames
from ufl_origami.pattern_topology import hinge_angle, join_faces, pair_index

pytestmark = pytest.mark.serial

# ---- angles


@pytest.mark.parametrize("degrees", [-170, -90, -10, 0, 25, 90, 144.4, 179])
def test_fold_angle_survives_rigid_motions_scaling_and_relabelling(degrees):
    rng = np.random.default_rng(abs(round(10 * degrees)))
    theta = math.radians(degrees)
    for _ in range(20):
        points, faces = folded(theta, rng)
        moved = rng.uniform(0.01, 100) * points @ random_rotation(rng).T + rng.normal(size=3)
        order = rng.permutation(6)
        back = np.argsort(order)
        loops = [np.roll(back[list(loop)], rng.integers(4)) for loop in faces]
        if rng.random() < 0.5:
            loops.reverse()
        pattern = CreasePattern.from_arrays(moved[order], loops)
        crease = np.flatnonzero(pattern.is_crease)
        assert len(crease) == 1
        assert pattern.geometric_angles[crease] == pytest.approx([theta], abs=1e-12)
        assert np.isnan(np.delete(pattern.geometric_angles, crease)).all()


def test_reversed_orientation_turns_valleys_into_mountains():
    points, faces = folded(0.7)
    valley = CreasePattern.from_arrays(points, faces)
    mountain = CreasePattern.from_arrays(points, [loop[::-1] for loop in faces])
    assert np.nansum(valley.geometric_angles) == pytest.approx(0.7)
    assert np.nansum(mountain.geometric_angles) == pytest.approx(-0.7)


def test_hinge_angle_is_the_formula_of_two_triangles():
    rng = np.random.default_rng(3)
    for _ in range(100):
        x0, x1, x2, x3 = rng.normal(size=(4, 3))
        n1, n2 = np.cross(x1 - x0, x2 - x0), np.cross(x0 - x1, x3 - x1)
        # independent: dihedral between the half-planes, measured in the plane across the edge
        e = (x1 - x0) / np.linalg.norm(x1 - x0)
        a, b = (v - (v @ e) * e for v in (x2 - x0, x3 - x0))
        included = math.acos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
        sign = 1.0 if b @ n1 > 0 else -1.0
        expected = sign * (math.pi - included)
        assert hinge_angle(n1[None], n2[None], (x1 - x0)[None])[0] == pytest.approx(expected)


def test_unfolded_pattern_rests_at_its_fold_angles():
    pattern = two_squares(assignment={(1, 4): "M"}, fold_angle={(4, 1): -60.0})
    assert not pattern.is_folded
    assert pattern.geometric_angles[pattern.creases["crease1"]] == 0.0
    assert pattern.rest_angles[1] == pytest.approx(-math.pi / 3)
    assert np.isnan(np.delete(pattern.rest_angles, 1)).all()
    free = two_squares(assignment={(1, 4): "U"})
    assert free.rest_angles[1] == 0.0


def test_folded_form_rests_at_its_geometry():
    points, faces = folded(-1.0)
    pattern = CreasePattern.from_arrays(points, faces, assignment={(0, 1): "M"})
    assert pattern.is_folded
    assert pattern.rest_angles[pattern.is_crease] == pytest.approx([-1.0], abs=1e-14)


def test_flat_folded_crease_takes_its_sign_from_the_file():
    points, faces = folded(math.pi)
    points[4:] += (0.1, 0, 0)  # turned over, not one upon the other
    for letter, sign in (("M", -1), ("V", 1)):
        pattern = CreasePattern.from_arrays(points, faces, assignment={(0, 1): letter})
        assert np.nansum(pattern.geometric_angles) == pytest.approx(sign * math.pi)


def test_three_panels_at_one_edge():
    pattern = t_junction()
    (edge,) = np.flatnonzero(pattern.is_crease)
    assert pattern.edge_faces(edge).tolist() == [0, 1, 2]
    assert np.isnan(pattern.rest_angles).all()
    assert pattern.is_folded
    assert pattern.angle_between(edge, 0, 1) == pytest.approx(0.0)
    up = pattern.angle_between(edge, 0, 2)
    assert up == pytest.approx(math.pi / 2)  # the upright panel rises on the side of the normal
    assert pattern.angle_between(edge, 1, 2) == pytest.approx(math.pi / 2)
    with pytest.raises(PatternError, match=r"face 7 does not meet edge 3 \(\[0, 1, 2\] do\)"):
        pattern.angle_between(edge, 0, 7)


def test_angle_between_is_the_crease_angle_for_two_faces():
    points, faces = folded(1.1, np.random.default_rng(1))
    pattern = CreasePattern.from_arrays(points, faces)
    (edge,) = np.flatnonzero(pattern.is_crease)
    assert pattern.angle_between(edge, 0, 1) == pytest.approx(1.1)
    assert pattern.angle_between(edge, 1, 0) == pytest.approx(1.1)


# ---- parts and names


def test_flat_and_join_edges_merge_faces_into_panels():
    points, faces = grid(3)
    plain = CreasePattern.from_arrays(points, faces)
    assert len(plain.panels) == 9 and len(plain.creases) == 12
    flat = {tuple(plain.edges_vertices[e]): "FJ"[e % 2] for (e,) in plain.creases.values()}
    merged = CreasePattern.from_arrays(points, faces, assignment=flat)
    assert {k: v.tolist() for k, v in merged.panels.items()} == {"panel0": list(range(9))}
    assert not merged.creases and list(merged.boundaries) == ["boundary"]
    assert len(merged.boundaries["boundary"]) == 12
    some = {pair: "F" for pair in flat if set(pair) <= {4, 5, 6, 7}}  # the line x = 1
    pattern = CreasePattern.from_arrays(points, faces, assignment=some)
    assert len(some) == 3 and len(pattern.panels) == 6
    assert pattern.panels["panel1"].tolist() == [1, 4]


def test_flat_edge_becomes_a_crease_by_its_property():
    pattern = named(two_squares(assignment={(1, 4): "F"}), edges={"fold": [(4, 1)]})
    assert list(pattern.lines) == ["fold"] and len(pattern.panels) == 1
    crease = with_edge_property(pattern, "crease", {"fold": True})
    assert list(crease.creases) == ["fold"] and not crease.lines
    assert list(crease.panels) == ["panel0", "panel1"]
    assert crease.rest_angles[1] == 0.0
    with pytest.raises(PatternError, match=r"edge 0 \(vertices 0-1, B\) has the property crease"):
        with_edge_property(two_squares(), "crease", {"boundary": True})


def test_names_of_the_z_fold():
    pattern = z_fold()
    assert {k: v.tolist() for k, v in pattern.panels.items()} == {"left": [0], "right": [1]}
    assert list(pattern.creases) == ["crease"] and not pattern.lines
    y = {
        k: pattern.vertices_coords[pattern.edges_vertices[v], 1]
        for k, v in pattern.boundaries.items()
    }
    assert (y["front"] == 0).all() and (y["back"] == 1).all()
    assert y["front"].shape == (2, 2)
    assert set(y) == {"left_edge", "right_edge", "front", "back"}
    ends = {tuple(pattern.vertices_coords[pattern.points[name], :2]) for name in "AB"}
    assert ends == {(0.0, 0.0), (0.0, 1.0)}


def test_naming_replaces_names_and_keeps_the_rest():
    pattern = named(z_fold(), panels={"wing": 1}, edges={"hinge": [(4, 1)]}, points={"C": 0})
    assert list(pattern.panels) == ["left", "wing"]
    assert list(pattern.creases) == ["hinge"]
    assert dict(pattern.points) == {"C": 0, "A": 1, "B": 4}


def test_one_crease_of_several_edges():
    points, faces = grid(2)
    pattern = CreasePattern.from_arrays(points, faces)
    pattern = named(pattern, edges={"middle": [(3, 4), (4, 5)]})
    assert len(pattern.creases["middle"]) == 2
    assert pattern.edge_lengths[pattern.creases["middle"]].sum() == 2.0
    others = set(pattern.creases) - {"middle"}
    assert others == {f"crease{e}" for e in np.flatnonzero(pattern.is_crease)} - {
        f"crease{e}" for e in pattern.creases["middle"]
    }


@pytest.mark.parametrize(
    "change, message",
    [
        (dict(panels={"a": 0, "b": 2}), "panel 'b': there is no face 2"),
        (dict(points={"a": 6}), "point 'a': there is no vertex 6"),
        (dict(edges={"a": [(0, 5)]}), r"no edge joins the vertices \(0, 5\)"),
        (
            dict(edges={"a": [(1, 4), (0, 1)]}),
            "edges 0 and 1 have the same name 'a', but one is a boundary and the other a crease",
        ),
        (dict(panels={"a": 0}, edges={"crease1": [(0, 1)]}), "default name of edge 1"),
        (dict(panels={"a": 1}, edges={" ": [(0, 1)]}), "' ': not a name"),
        (dict(panels={"panel1": 0}), r"two panels have the name 'panel1': faces \[0\] and \[1\]"),
    ],
)
def test_name_errors(change, message):
    with pytest.raises(PatternError, match=message):
        named(two_squares(), **change)


def test_more_name_errors():
    with pytest.raises(PatternError, match="vertices 1 and 3 have the same name 'A'"):
        replace(two_squares(), names=PatternNames(vertices=(None, "A", None, "A", None, None)))
    flat = two_squares(assignment={(1, 4): "J"})
    with pytest.raises(PatternError, match=r"faces \[0, 1\] are one panel .* 'a', 'b'"):
        replace(flat, names=PatternNames(faces=("a", "b")))
    with pytest.raises(PatternError, match="3 names are given for 2 faces"):
        replace(flat, names=PatternNames(faces=("a", "b", "c")))


def test_properties_by_name():
    pattern = with_edge_property(z_fold(), "stiffness", {"crease": 2.5})
    assert pattern.edge_properties["stiffness"][pattern.creases["crease"]] == [2.5]
    assert np.isnan(pattern.edge_properties["stiffness"][1:]).all()
    pattern = with_panel_property(pattern, "thickness", {"left": 0.01})
    pattern = with_panel_property(pattern, "thickness", {"right": 0.02})
    assert pattern.face_properties["thickness"].tolist() == [0.01, 0.02]
    pattern = with_panel_property(pattern, "material", {"left": "paper"})
    assert pattern.face_properties["material"].tolist() == ["paper", None]
    with pytest.raises(PatternError, match="no panel has the name 'rihgt'; did you mean 'right'"):
        with_panel_property(pattern, "thickness", {"rihgt": 1.0})
    with pytest.raises(PatternError, match="edge property 'k' has 2 values, but there are 7"):
        replace(pattern, edge_properties={"k": [1.0, 2.0]})
    with pytest.raises(PatternError, match="cannot be called 'name'"):
        replace(pattern, face_properties={"name": ["a", "b"]})


def test_patterns_cannot_be_changed_in_place():
    pattern = z_fold()
    for array in (pattern.vertices_coords, pattern.edges_vertices, pattern.creases["crease"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(AttributeError):
        pattern.tolerance = 1.0
    with pytest.raises(TypeError):
        pattern.panels["new"] = np.array([0])


def test_patterns_can_be_sent_to_other_processes():
    pattern = with_edge_property(z_fold(), "stiffness", {"crease": 2.5})
    again = pickle.loads(pickle.dumps(pattern))
    assert again.summary() == pattern.summary()
    assert again.vertices_coords.tobytes() == pattern.vertices_coords.tobytes()
    assert again.edge_properties["stiffness"][0] == 2.5 and again.source == pattern.source


def test_text_tells_the_parts():
    pattern = z_fold()
    assert repr(pattern) == (
        "<CreasePattern: 6 vertices, 7 edges (6 B, 1 V), 2 panels, folded form>"
    )
    text = pattern.summary()
    for part in ("panel left: faces [0]", "boundary back: length 2", "point A:"):
        assert part in text
    assert "crease crease: length 1, V, geometric fold angle 144.4 deg, given 144.4 deg" in text


# ---- changes


def test_scaling_keeps_angles_and_scales_lengths():
    pattern = scaled(z_fold(), 3.5)
    assert pattern.edge_lengths == pytest.approx(3.5 * z_fold().edge_lengths)
    assert pattern.rest_angles[0] == pytest.approx(math.radians(144.4), abs=1e-14)
    for factor in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(PatternError, match="cannot be scaled by"):
            scaled(pattern, factor)


def test_fold_angles_by_name():
    pattern = two_squares(assignment={(1, 4): "V"})
    pattern = with_fold_angles(pattern, {"crease1": 30.0})
    assert pattern.rest_angles[1] == pytest.approx(math.pi / 6)
    with pytest.raises(PatternError, match="has no fold angle"):
        _ = with_fold_angles(pattern, {"crease1": None}).rest_angles
    with pytest.raises(PatternError, match="no crease has the name 'crease'; did you mean"):
        with_fold_angles(pattern, {"crease": 1.0})
    with pytest.raises(PatternError, match="contradicts"):
        with_fold_angles(pattern, {"crease1": -1.0})


# ---- the Z-fold


@pytest.mark.parametrize("widths", [(1.0, 1.0), (1.0, 2.0), (2.0, 0.3), (1.0, 1.01)])
@pytest.mark.parametrize("included", [1.0, 35.6, 90.0, 150.0, 180.0])
def test_z_fold_geometry(widths, included):
    pattern = z_fold(length=0.7, included_angle=included, widths=widths)
    x = pattern.vertices_coords
    edge = pattern.creases["crease"]
    theta = math.radians(180 - included)
    assert pattern.geometric_angles[edge] == pytest.approx([theta], abs=1e-13)
    assert pattern.edges_foldAngle[edge] == [180 - included]
    assert (x[[0, 2, 3, 5], 2] == 0.0).all()
    assert (x[[1, 4], 0] == 0.0).all()
    assert np.linalg.norm(x[0] - x[1]) == pytest.approx(widths[0])
    assert np.linalg.norm(x[2] - x[1]) == pytest.approx(widths[1])
    assert pattern.edge_lengths[edge] == pytest.approx([0.7])


def test_z_fold_of_the_paper():
    x = z_fold().vertices_coords
    assert x[2, 0] - x[0, 0] == pytest.approx(2 * math.sin(math.radians(17.8)), abs=1e-15)
    assert x[0, 0] == pytest.approx(-math.sin(math.radians(17.8)), abs=1e-15)
    assert x[1, 2] == pytest.approx(-math.cos(math.radians(17.8)), abs=1e-15)
    assert (z_fold().face_normals[:, 2] > 0).all()


@pytest.mark.parametrize(
    "options, message",
    [
        (dict(width=0.0), r"widths 0.0, 0.0 and length 1.0 must be positive"),
        (dict(length=-1.0), "must be positive"),
        (dict(widths=(1.0, math.nan)), "must be positive"),
        (dict(included_angle=0.0), r"included angle 0.0 deg is not in \(0, 180\]"),
        (dict(included_angle=181.0), "is not in"),
    ],
)
def test_z_fold_errors(options, message):
    with pytest.raises(PatternError, match=message):
        z_fold(**options)


# ---- building blocks


def test_pairs_of_unknown_edges():
    with pytest.raises(PatternError, match=r"no edge joins the vertices \(0, 4\)"):
        two_squares(assignment={(0, 4): "V"})
    assert pair_index([(4, 1), (0, 5)], [(0, 1), (1, 4)]).tolist() == [1, -1]
    assert pair_index(np.empty((0, 2)), [(0, 1)]).tolist() == []


def test_groups_of_faces_against_a_plain_search():
    rng = np.random.default_rng(2)
    for _ in range(20):
        links = rng.integers(0, 30, size=(rng.integers(0, 40), 2))
        label = list(range(30))
        for a, b in links:
            old, new = max(label[a], label[b]), min(label[a], label[b])
            label = [new if entry == old else entry for entry in label]
        numbers = {low: k for k, low in enumerate(sorted(set(label)))}
        assert join_faces(30, links).tolist() == [numbers[low] for low in label]


def test_ten_thousand_faces():
    points, faces = grid(100)
    pattern = CreasePattern.from_arrays(points, faces)
    assert len(pattern.panels) == 10_000
    assert len(pattern.creases) == 2 * 100 * 99
    assert np.array_equal(pattern.face_panel, np.arange(10_000))
