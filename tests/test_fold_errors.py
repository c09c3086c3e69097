"""FOLD files that cannot be read: the message tells the file, the key and the entry."""

import pytest
from fold_samples import FLAT, flat

from ufl_origami.errors import PatternError
from ufl_origami.fold_io import pattern_from_fold, read_fold, write_fold

pytestmark = pytest.mark.serial


@pytest.mark.parametrize(
    "frame, frames, message",
    [
        (3, FLAT["file_frames"], "vertices_coords is missing"),
        (4, FLAT["file_frames"], "there is no frame 4: the file has frames 0 to 3"),
        (-1, [], "there is no frame -1"),
        (1, [{"frame_inherit": True}], "a parent of frame 1 is missing: frame_inherit is true"),
        (1, [{"frame_inherit": True, "frame_parent": 1}], "frame 1 inherits from frame 1 in a c"),
        (1, [{"frame_inherit": True, "frame_parent": 9}], "there is no frame 9"),
    ],
)
def test_frame_errors(frame, frames, message):
    with pytest.raises(PatternError, match=message):
        pattern_from_fold(flat(file_frames=frames), frame)


@pytest.mark.parametrize(
    "keys, message",
    [
        (dict(vertices_coords=...), "vertices_coords is missing: a pattern needs"),
        (
            dict(edges_vertices=..., faces_edges=...),
            "edges_vertices is missing, so that nothing tells which edges edges_assignment is",
        ),
        (
            dict(
                edges_vertices=...,
                faces_vertices=...,
                faces_edges=...,
                edges_assignment=...,
                edges_foldAngle=...,
                edges_faces=...,
            ),
            "edges_vertices and faces_vertices are both missing",
        ),
        (
            dict(
                faces_vertices=...,
                faces_edges=...,
                vertices_coords=[[*row, row[0] ** 2] for row in FLAT["vertices_coords"]],
            ),
            "faces_vertices is missing and cannot be inferred: the coordinates are not plane",
        ),
        (
            dict(
                faces_vertices=...,
                faces_edges=...,
                edges_vertices=[[0, 1], [1, 3], [3, 0], [2, 4], [4, 5], [5, 2]],
            ),
            "cannot be inferred: the edges form 2 separate pieces",
        ),
        (
            dict(
                faces_vertices=...,
                faces_edges=...,
                edges_vertices=[[0, 1], [1, 4], [4, 3], [3, 0], [0, 4], [1, 3], [1, 2], [2, 5]],
            ),
            "cannot be inferred: edges 4 and 5 cross without a vertex",
        ),
        (
            dict(
                faces_vertices=...,
                faces_edges=...,
                edges_vertices=[[0, 2], [2, 5], [5, 3], [3, 0], [1, 5]],
                vertices_coords=[[0, 0], [1, 0], [2, 0], [0, 1], [5, 5], [2, 1]],
            ),
            "cannot be inferred: vertex 1 lies on edge 0",
        ),
        (
            dict(faces_vertices=..., faces_edges=[[0, 1, 2, 3], [4, 5, 9, 1]]),
            r"faces_edges\[1\] is \[4, 5, 9, 1\]: edges go to 6",
        ),
        (
            dict(faces_vertices=..., faces_edges=[[0, 1, 2, 3], [4, 6, 5, 1]]),
            "face 1 is not closed: its edges 4 and 6 do not meet in one vertex",
        ),
        (
            dict(edges_vertices=..., faces_edges=[[0, 1, 2, 3], [4, 5, 6, 3]]),
            r"gives edge 3 to vertices \[4, 1\] of face 1, but also to vertices \[3, 0\]",
        ),
        (
            dict(edges_vertices=..., faces_edges=[[0, 1, 2, 3], [4, 5, 6]]),
            "faces_edges and faces_vertices have loops of different lengths",
        ),
        (
            dict(edges_vertices=..., faces_edges=[[0, 1, 2, 3], [4, 5, 7, 1]]),
            "faces_edges names no edge 6",
        ),
        (
            dict(edges_faces=[[0], [0], [0], [0], [1], [1], [1]]),
            r"edges_faces gives faces \[0\] to edge 1, but the faces with this side are \[0, 1\]",
        ),
        (dict(edges_faces=[[0, 1]] * 7), r"edges_faces gives faces \[0, 1\] to edge 0"),
        (dict(edges_faces=[[0]]), "edges_faces has 1 values, but there are 7 edges"),
        (dict(file_spec=2), "file_spec is 2; FOLD versions read are 1, 1.1, 1.2"),
        (dict(file_spec="1.1"), "file_spec is '1.1'"),
        (dict(edges_assignment="BVBBBBB"), "edges_assignment must be an array, not 'BVBBBBB'"),
        (dict(faces_vertices={"0": []}), "faces_vertices must be an array, not {'0'"),
        (dict(edges_assignment=["B", "V", "B", "B", "B", "B", "Q"]), "edge 6 .* assignment 'Q'"),
        ({"edges_ufl_origami:k": [1, 2]}, "edge property 'k' has 2 values, but there are 7 edges"),
        ({"faces_ufl_origami:name": ["a", 3]}, "entry 1 of the names of faces is 3: not a name"),
    ],
)
def test_content_errors(keys, message):
    with pytest.raises(PatternError, match=message):
        pattern_from_fold(flat(**keys))


@pytest.mark.parametrize(
    "text, message",
    [
        (b'{"file_spec": 1.1,', r"bad\.fold: not JSON: .*line 1 column"),
        (b'{"vertices_coords": [[NaN, 0]]}', r"bad\.fold: NaN is not a number that JSON knows"),
        (b"[1, 2]", r"bad\.fold: a FOLD file holds an object, not list"),
        (b'{"file_title": "\xff"}', r"bad\.fold: not UTF-8 text"),
        (b"{}", r"bad\.fold: vertices_coords is missing"),
    ],
)
def test_file_errors_name_the_file(tmp_path, text, message):
    (tmp_path / "bad.fold").write_bytes(text)
    with pytest.raises(PatternError, match=message):
        read_fold(tmp_path / "bad.fold")


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_fold(tmp_path / "none.fold")


def test_what_json_cannot_say_is_not_written(tmp_path):
    pattern = pattern_from_fold(flat(**{"x:limit": float("inf")}))
    with pytest.raises(PatternError, match="x:limit cannot be written as JSON"):
        write_fold(pattern, tmp_path / "p.fold")
    assert not (tmp_path / "p.fold").exists()
