"""Crease patterns from and to `.fold` files (FOLD 1.1 and 1.2; 1.0 is read and kept, too).

Specification: https://github.com/edemaine/fold, doc/spec.md. How its keys are taken:

- `edges_assignment` left out: B where an edge has one face, U elsewhere. Letters C and J (1.2)
  are understood in files of any version.
- `edges_foldAngle`: degrees; null is unknown. In a folded form (`frame_classes` foldedForm, or no
  class and turned faces) it must agree with the coordinates, in an unfolded one (creasePattern)
  it is the rest angle.
- `frame_attributes` selfTouching permits vertices at one place.
- Names and properties are custom keys as the specification wants them: `vertices_`, `edges_` and
  `faces_ufl_origami:name` hold a name or null for each vertex, edge, face;
  `edges_ufl_origami:KEY` and `faces_ufl_origami:KEY` hold the property KEY.
- All other keys are kept and written back as they were, further frames included.
"""

import json
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np

from ufl_origami import pattern_arrays as arrays
from ufl_origami.errors import PatternError
from ufl_origami.fold_infer import complete, entries
from ufl_origami.pattern import CreasePattern
from ufl_origami.pattern_names import PatternNames
from ufl_origami.pattern_topology import Corners, Floats, Ints, pair_index

VERSIONS = (1, 1.1, 1.2)
NAMESPACE = "ufl_origami:"


def read_fold(path: str | Path, frame: int = 0, *, tolerance: float = 1e-5) -> CreasePattern:
    """Read a pattern from a `.fold` file.

    Args:
        path: the file.
        frame: which frame: 0 is the key frame, i + 1 is `file_frames[i]`. A pattern from another
            frame than the key frame is complete in itself and is written as a key frame.
        tolerance: relative tolerance of the pattern's checks.

    Raises:
        PatternError: not a FOLD file, or not a valid pattern; the message begins with the path.
    """
    try:
        with open(path, encoding="utf-8-sig") as file:
            data = json.load(file, parse_constant=_no_constant)
        return pattern_from_fold(data, frame, tolerance=tolerance)
    except json.JSONDecodeError as error:
        raise PatternError(f"{path}: not JSON: {error}") from error
    except UnicodeDecodeError as error:
        raise PatternError(f"{path}: not UTF-8 text: {error}") from error
    except PatternError as error:
        raise PatternError(f"{path}: {error}") from error


def _no_constant(word: str) -> float:
    raise PatternError(f"{word} is not a number that JSON knows")


def write_fold(pattern: CreasePattern, path: str | Path) -> None:
    """Write a pattern to a `.fold` file; floats are written so that they read back exactly."""
    lines = []
    for key, value in pattern_to_fold(pattern).items():
        try:
            lines.append(f"  {json.dumps(key)}: {_dump(value)}")
        except (TypeError, ValueError) as error:
            raise PatternError(f"{key} cannot be written as JSON: {error}") from error
    Path(path).write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def _dump(value: Any) -> str:
    """JSON with one row of a table a line."""
    if isinstance(value, list) and any(isinstance(row, list | dict) for row in value):
        rows = ",\n".join(f"    {json.dumps(row, allow_nan=False)}" for row in value)
        return f"[\n{rows}\n  ]"
    return json.dumps(value, allow_nan=False)


def pattern_from_fold(
    data: Mapping[str, Any], frame: int = 0, *, tolerance: float = 1e-5
) -> CreasePattern:
    """Build a pattern from the dictionary of a FOLD file; see `read_fold`."""
    if not isinstance(data, Mapping):
        raise PatternError(f"a FOLD file holds an object, not {type(data).__name__}")
    if data.get("file_spec", VERSIONS[-1]) not in VERSIONS:
        known = ", ".join(map(str, VERSIONS))
        raise PatternError(f"file_spec is {data['file_spec']!r}; FOLD versions read are {known}")
    source = _frame(data, frame)
    points, edges, faces = complete(source)
    _check_edges_faces(source, edges, faces)
    return CreasePattern(
        points,
        edges,
        _assignment(source, edges, faces),
        faces,  # type: ignore[arg-type]
        _optional(source, _angle_key(source)),  # type: ignore[arg-type]
        PatternNames(*(_optional(source, _name_key(part)) or () for part in _PARTS)),
        _read_properties(source, "edges"),
        _read_properties(source, "faces"),
        source,
        tolerance,
    )


_PARTS = ("vertices", "edges", "faces")


def _name_key(part: str) -> str:
    return f"{part}_{NAMESPACE}name"


def _angle_key(source: Mapping[str, Any]) -> str:
    """Key of the fold angles; FOLD 1.0 had it in the plural."""
    plural = "edges_foldAngles" in source and "edges_foldAngle" not in source
    return "edges_foldAngles" if plural else "edges_foldAngle"


def _read_properties(source: Mapping[str, Any], part: str) -> dict[str, Any]:
    prefix = f"{part}_{NAMESPACE}"
    keys = [key for key in source if key.startswith(prefix) and key != _name_key(part)]
    return {key.removeprefix(prefix): entries(source, key) for key in keys}


def _optional(source: Mapping[str, Any], key: str) -> tuple[Any, ...] | None:
    return tuple(entries(source, key)) if key in source else None


def _assignment(source: Mapping[str, Any], edges: Ints, faces: Any) -> tuple[str, ...]:
    """Assignments of the file, or B where an edge has one face and U elsewhere."""
    if "edges_assignment" in source:
        return tuple(entries(source, "edges_assignment"))
    edge = pair_index(Corners.from_loops(arrays.loops(faces)).pairs, edges)
    count = np.bincount(edge[edge >= 0], minlength=len(edges))
    return tuple("B" if number == 1 else "U" for number in count)


def _check_edges_faces(source: Mapping[str, Any], edges: Ints, faces: Any) -> None:
    """`edges_faces`, where given, must name the faces whose loops run through the edge."""
    if "edges_faces" not in source:
        return
    corners = Corners.from_loops(arrays.loops(faces))
    real: list[set[int]] = [set() for _ in edges]
    for edge, face in zip(pair_index(corners.pairs, edges), corners.face, strict=True):
        if edge >= 0:
            real[edge].add(int(face))
    listed = entries(source, "edges_faces")
    if len(listed) != len(edges):
        raise PatternError(
            f"edges_faces has {len(listed)} values, but there are {len(edges)} edges"
        )
    for e, given in enumerate(listed):
        if {face for face in given if face is not None} != real[e]:
            raise PatternError(
                f"edges_faces gives faces {given} to edge {e}, but the faces with this side are "
                f"{sorted(real[e])}"
            )


def _frame(data: Mapping[str, Any], frame: int) -> dict[str, Any]:
    """Dictionary of one frame, with what it inherits; other frames only in the key frame's."""
    if frame == 0:
        return deepcopy(dict(data))
    own: dict[str, Any] = {}
    inherited, seen = True, {frame}
    current = _frame_at(data, frame)
    while inherited:
        own = {**current, **own}
        inherited = bool(current.get("frame_inherit", False))
        if inherited:
            if "frame_parent" not in current:
                raise PatternError(f"a parent of frame {frame} is missing: frame_inherit is true")
            parent = current["frame_parent"]
            current = _frame_at(data, parent)
            if parent in seen:
                raise PatternError(f"frame {frame} inherits from frame {parent} in a circle")
            seen.add(parent)
    about_file = {k: v for k, v in data.items() if k.startswith("file_") and k != "file_frames"}
    own = {k: v for k, v in own.items() if k not in ("frame_parent", "frame_inherit")}
    own = {k: v for k, v in own.items() if not k.startswith("file_")}
    return deepcopy({**about_file, **own})


def _frame_at(data: Mapping[str, Any], frame: int) -> Mapping[str, Any]:
    frames = data.get("file_frames", [])
    if not (isinstance(frame, int) and 0 <= frame <= len(frames)):
        raise PatternError(f"there is no frame {frame!r}: the file has frames 0 to {len(frames)}")
    return frames[frame - 1] if frame else data


def pattern_to_fold(pattern: CreasePattern) -> dict[str, Any]:
    """Return the FOLD dictionary of a pattern.

    Keys of the pattern's source stay as they are unless the pattern says something else than
    they do; the version stays that of the source (1.2 for a pattern without a source).
    """
    start = {"file_spec": VERSIONS[-1], "file_creator": "ufl_origami"}
    out = deepcopy(dict(pattern.source)) or start
    _put_coordinates(out, pattern.vertices_coords)
    _put(out, "edges_vertices", pattern.edges_vertices.tolist())
    _put(out, "edges_assignment", list(pattern.edges_assignment))
    _put(out, "faces_vertices", [list(loop) for loop in pattern.faces_vertices])
    _put_optional(out, _angle_key(out), pattern.edges_foldAngle.tolist())
    for part in _PARTS:
        _put_optional(out, _name_key(part), getattr(pattern.names, part))
    for part, values in (("edges", pattern.edge_properties), ("faces", pattern.face_properties)):
        for key in set(_read_properties(out, part)) - set(values):
            del out[f"{part}_{NAMESPACE}{key}"]
        for key, array in values.items():
            _put_optional(out, f"{part}_{NAMESPACE}{key}", array.tolist())
    return out


def _put_coordinates(out: dict[str, Any], points: Floats) -> None:
    """Set coordinates; two numbers a vertex where the source had two and z is 0."""
    old = out.get("vertices_coords", [])
    if len(old) != len(points) or (arrays.coordinates(old) != points).any():
        flat = len(old) > 0 and all(len(row) == 2 for row in old) and not points[:, 2].any()
        out["vertices_coords"] = (points[:, :2] if flat else points).tolist()


def _put(out: dict[str, Any], key: str, value: Any) -> None:
    """Set a key unless it holds equal numbers (1 and 1.0 are equal)."""
    if out.get(key) != value:
        out[key] = value


def _put_optional(out: dict[str, Any], key: str, values: Any) -> None:
    """Set a list in which NaN and None mean "unset"; leave the key out where all are unset."""
    value = [None if v is None or v != v else v for v in values]
    if key in out or any(v is not None for v in value):
        _put(out, key, value)
