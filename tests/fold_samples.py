"""A FOLD dictionary with everything in it that several test files use."""

from copy import deepcopy

FLAT = {
    "file_spec": 1.1,
    "file_creator": "some editor",
    "frame_classes": ["creasePattern"],
    "vertices_coords": [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]],
    "edges_vertices": [[0, 1], [1, 4], [4, 3], [3, 0], [1, 2], [2, 5], [5, 4]],
    "edges_assignment": ["B", "V", "B", "B", "B", "B", "B"],
    "edges_foldAngle": [0, 90, 0, 0, 0, 0, 0],
    "faces_vertices": [[0, 1, 4, 3], [1, 2, 5, 4]],
    "faces_edges": [[0, 1, 2, 3], [4, 5, 6, 1]],
    "edges_faces": [[0, None], [0, 1], [0], [0], [1], [1], [None, 1]],
    "vertices_editor:colour": ["red", None, {"r": 0.1}, [1e-300, 1.7976931348623157e308], 5, -0.0],
    "editor:settings": {"grid": 0.1, "nested": [[], {}, None, True]},
    "file_frames": [
        {
            "frame_title": "half open",
            "frame_classes": ["foldedForm"],
            "frame_parent": 0,
            "frame_inherit": True,
            "vertices_coords": [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 1, 0], [1, 1, 0], [1, 1, 1]],
        },
        {"frame_parent": 1, "frame_inherit": True, "edges_foldAngle": [None] * 7},
        {"frame_parent": 2, "frame_title": "alone"},
    ],
}


def flat(**keys):
    """The flat pattern with keys replaced; a value of `...` removes the key."""
    data = {**deepcopy(FLAT), **keys}
    return {key: value for key, value in data.items() if value is not ...}
