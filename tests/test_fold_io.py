"""FOLD files: exact round trips, what may be left out, and errors that name the file."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fold_samples import FLAT, flat

from ufl_origami.errors import PatternError
from ufl_origami.fold_io import pattern_from_fold, pattern_to_fold, read_fold, write_fold
from ufl_origami.gallery import z_fold
from ufl_origami.pattern_edit import (
    named,
    scaled,
    with_edge_property,
    with_fold_angles,
    with_panel_property,
)

pytestmark = pytest.mark.serial

MESHES = Path(__file__).parents[1] / "meshes"


def random_pattern(rng):
    """The Z-fold in random numbers, with names and properties."""
    pattern = z_fold(*rng.uniform(0.1, 3.0, 2), rng.uniform(1, 179), widths=rng.uniform(0.1, 3, 2))
    pattern = scaled(pattern, rng.lognormal(sigma=5))
    pattern = with_edge_property(pattern, "stiffness", {"crease": rng.lognormal()})
    pattern = with_edge_property(pattern, "watched", {"front": True})
    pattern = with_panel_property(pattern, "thickness", {"left": rng.lognormal()})
    return with_panel_property(pattern, "material", {"right": "paper"})


def same(a, b):
    """Whether two patterns agree to the last bit."""
    assert a.vertices_coords.tobytes() == b.vertices_coords.tobytes()
    assert np.array_equal(a.edges_vertices, b.edges_vertices)
    assert np.array_equal(a.edges_foldAngle, b.edges_foldAngle, equal_nan=True)
    assert (a.edges_assignment, a.faces_vertices) == (b.edges_assignment, b.faces_vertices)
    assert a.names == b.names
    for mine, other in (
        (a.edge_properties, b.edge_properties),
        (a.face_properties, b.face_properties),
    ):
        assert set(mine) == set(other)
        for key in mine:
            assert mine[key].dtype == other[key].dtype
            assert str(mine[key].tolist()) == str(other[key].tolist())
    return True


# ---- round trips


@pytest.mark.parametrize("version", [..., 1, 1.1, 1.2])
def test_round_trip_is_exact(tmp_path, version):
    data = flat(file_spec=version)
    if version == 1:
        data["edges_foldAngles"] = data.pop("edges_foldAngle")
    (tmp_path / "in.fold").write_text(json.dumps(data), encoding="utf-8")
    pattern = read_fold(tmp_path / "in.fold")
    write_fold(pattern, tmp_path / "out.fold")
    text = (tmp_path / "out.fold").read_text(encoding="utf-8")
    written = json.loads(text)
    # as text, so that 1 and 1.0, 0.0 and -0.0 differ
    assert json.dumps(written, sort_keys=True) == json.dumps(data, sort_keys=True)
    assert list(written) == list(data)
    assert pattern.rest_angles[1] == pytest.approx(np.pi / 2)


def test_random_patterns_survive_to_the_last_bit(tmp_path):
    rng = np.random.default_rng(11)
    for _ in range(25):
        pattern = random_pattern(rng)
        write_fold(pattern, tmp_path / "p.fold")
        again = read_fold(tmp_path / "p.fold")
        assert same(pattern, again)
        assert pattern_to_fold(again) == pattern_to_fold(pattern)


def test_names_and_properties_are_custom_keys():
    data = pattern_to_fold(random_pattern(np.random.default_rng(0)))
    custom = {key for key in data if "ufl_origami:" in key}
    assert custom == {
        "vertices_ufl_origami:name",
        "edges_ufl_origami:name",
        "faces_ufl_origami:name",
        "edges_ufl_origami:stiffness",
        "edges_ufl_origami:watched",
        "faces_ufl_origami:thickness",
        "faces_ufl_origami:material",
    }
    assert data["vertices_ufl_origami:name"] == [None, "A", None, None, "B", None]
    assert data["faces_ufl_origami:material"] == [None, "paper"]
    assert data["edges_ufl_origami:watched"] == [False, False, False, True, True, False, False]
    assert data["file_spec"] == 1.2


def test_changes_are_written_and_the_rest_is_kept():
    pattern = with_fold_angles(pattern_from_fold(FLAT), {"crease1": 60.0})
    data = pattern_to_fold(named(pattern, points={"P": 2}))
    assert data["edges_foldAngle"] == [0, 60.0, 0, 0, 0, 0, 0]
    assert data["vertices_ufl_origami:name"][2] == "P"
    changed = ("edges_foldAngle", "vertices_ufl_origami:name")
    assert {k: v for k, v in data.items() if k not in changed} == flat(edges_foldAngle=...)


def test_scaling_drops_what_no_longer_holds():
    data = pattern_to_fold(scaled(pattern_from_fold(flat(edges_length=[1] * 7)), 2.0))
    assert data["vertices_coords"][5] == [4.0, 2.0]  # still plane
    assert "file_frames" not in data and "edges_length" not in data
    assert data["editor:settings"] == FLAT["editor:settings"]


def test_a_plane_pattern_bent_up_is_written_with_its_heights():
    plane = pattern_from_fold(flat(frame_classes=..., edges_foldAngle=...))
    bent = replace(plane, vertices_coords=FLAT["file_frames"][0]["vertices_coords"])
    assert pattern_to_fold(bent)["vertices_coords"][2] == [1.0, 0.0, 1.0]
    assert same(pattern_from_fold(pattern_to_fold(bent)), bent)


def test_patterns_share_nothing_with_the_dictionary_they_came_from():
    data = flat()
    pattern = pattern_from_fold(data)
    data["editor:settings"]["grid"] = 7
    pattern_to_fold(pattern)["editor:settings"]["grid"] = 8
    assert pattern_to_fold(pattern)["editor:settings"]["grid"] == 0.1


def test_files_of_the_repository():
    assert same(read_fold(MESHES / "z_fold.fold"), z_fold())
    t = read_fold(MESHES / "t_junction.fold")
    assert list(t.panels) == ["right", "left", "up"] and list(t.creases) == ["crease"]
    (edge,) = t.creases["crease"]
    assert t.edge_faces(edge).tolist() == [0, 1, 2]
    assert t.edge_lengths == pytest.approx(np.ones(10))
    angles = [np.degrees(t.angle_between(edge, a, b)) for a, b in ((0, 1), (0, 2), (1, 2))]
    assert angles == pytest.approx([0, 90, 90])


@pytest.mark.parametrize("name", ["z_fold", "t_junction"])
def test_files_of_the_repository_are_written_as_they_are(tmp_path, name):
    write_fold(read_fold(MESHES / f"{name}.fold"), tmp_path / "again.fold")
    assert (tmp_path / "again.fold").read_bytes() == (MESHES / f"{name}.fold").read_bytes()


# ---- frames


def test_frames_inherit():
    (
        key,
        half,
        free,
    ) = (pattern_from_fold(FLAT, frame) for frame in range(3))
    assert not key.is_folded and half.is_folded and free.is_folded
    for pattern in (half, free):
        assert pattern.rest_angles[1] == pytest.approx(np.pi / 2)
    assert np.isnan(free.edges_foldAngle).all()
    data = pattern_to_fold(half)
    assert data["frame_title"] == "half open" and data["file_creator"] == "some editor"
    assert not {"file_frames", "frame_parent", "frame_inherit"} & set(data)
    assert same(pattern_from_fold(data), half)


# ---- what may be left out


def test_assignment_left_out_is_boundary_or_unassigned():
    pattern = pattern_from_fold(flat(edges_assignment=..., edges_foldAngle=...))
    assert "".join(pattern.edges_assignment) == "BUBBBBB"


def test_edges_left_out():
    bare = flat(edges_vertices=..., edges_assignment=..., edges_foldAngle=..., edges_faces=...)
    numbered = pattern_from_fold(bare)
    assert np.sort(numbered.edges_vertices).tolist() == np.sort(FLAT["edges_vertices"]).tolist()
    del bare["faces_edges"]
    pattern = pattern_from_fold(bare)
    sides = {tuple(sorted(pair)) for pair in pattern.edges_vertices.tolist()}
    assert sides == {tuple(sorted(pair)) for pair in FLAT["edges_vertices"]}
    assert sum(pattern.is_crease) == 1


def test_edges_in_the_order_of_faces_edges():
    order = [6, 5, 4, 3, 2, 1, 0]
    data = flat(edges_vertices=..., edges_faces=...)
    data["faces_edges"] = [[order[e] for e in loop] for loop in FLAT["faces_edges"]]
    for key in ("edges_assignment", "edges_foldAngle"):
        data[key] = FLAT[key][::-1]
    pattern = pattern_from_fold(data)
    assert pattern.edges_assignment[5] == "V" and set(pattern.edges_vertices[5]) == {1, 4}


def test_faces_left_out():
    by_edges = pattern_from_fold(flat(faces_vertices=...))
    assert by_edges.faces_vertices == ((0, 1, 4, 3), (1, 2, 5, 4))
    by_regions = pattern_from_fold(flat(faces_vertices=..., faces_edges=..., edges_faces=...))
    assert sorted(sorted(f) for f in by_regions.faces_vertices) == [[0, 1, 3, 4], [1, 2, 4, 5]]
    assert (by_regions.face_normals == [0, 0, 1]).all()
    graph = {"vertices_coords": FLAT["vertices_coords"]}
    graph["vertices_vertices"] = [[1, 3], [2, 4, 0], [1, 5], [0, 4], [3, 1, 5], [4, 2]]
    assert len(pattern_from_fold(graph).panels) == 2


def test_regions_of_random_plane_graphs():
    """Delaunay triangles of random points, some sides removed, against areas and Euler."""
    from scipy.spatial import Delaunay

    rng = np.random.default_rng(4)
    for _ in range(10):
        points = rng.uniform(size=(25, 2))
        triangles = Delaunay(points).simplices
        sides = np.unique(
            np.sort(
                np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
            ),
            axis=0,
        )
        pattern = pattern_from_fold(
            {"vertices_coords": points.tolist(), "edges_vertices": sides.tolist()}
        )
        assert {frozenset(f) for f in pattern.faces_vertices} == {frozenset(t) for t in triangles}
        inner = rng.choice(np.flatnonzero(pattern.is_crease))
        fewer = np.delete(sides, inner, axis=0)
        merged = pattern_from_fold(
            {"vertices_coords": points.tolist(), "edges_vertices": fewer.tolist()}
        )
        assert len(merged.panels) == len(triangles) - 1
        assert max(map(len, merged.faces_vertices)) == 4


def test_self_touching_frames_may_have_vertices_at_one_place():
    folded = flat(
        frame_classes=["foldedForm"],
        edges_foldAngle=[0, 180, 0, 0, 0, 0, 0],
        vertices_coords=[[0, 0], [1, 0], [0, 0], [0, 1], [1, 1], [0, 1]],
    )
    with pytest.raises(PatternError, match=r"duplicate vertices: 0 and 2 .*selfTouching"):
        pattern_from_fold(folded)
    pattern = pattern_from_fold({**folded, "frame_attributes": ["2D", "selfTouching"]})
    assert pattern.rest_angles[1] == pytest.approx(np.pi)
