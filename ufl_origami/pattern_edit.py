"""Changed copies of crease patterns: scaled, with names, fold angles or properties replaced."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

from ufl_origami import pattern_names
from ufl_origami.errors import PatternError
from ufl_origami.pattern import CreasePattern
from ufl_origami.pattern_arrays import property_array
from ufl_origami.pattern_checks import find_edges
from ufl_origami.pattern_names import PatternNames
from ufl_origami.pattern_topology import Ints

#: Keys of a FOLD source that no longer hold when the coordinates change.
TIED_TO_COORDINATES = ("file_frames", "edges_length", "edges_lengths")


def scaled(pattern: CreasePattern, factor: float) -> CreasePattern:
    """Return the pattern with all coordinates multiplied by a positive factor.

    Properties (thickness, stiffness) stay as they are. Further frames and edge lengths of the
    FOLD source, which describe the unscaled pattern, are left out.
    """
    if not (factor > 0.0 and np.isfinite(factor)):
        raise PatternError(f"a pattern cannot be scaled by {factor}: the factor must be positive")
    source = {key: v for key, v in pattern.source.items() if key not in TIED_TO_COORDINATES}
    return replace(pattern, vertices_coords=factor * pattern.vertices_coords, source=source)


def with_fold_angles(pattern: CreasePattern, angles: Mapping[str, float | None]) -> CreasePattern:
    """Return the pattern with other fold angles on some creases.

    Args:
        pattern: the pattern.
        angles: degrees, valley positive, by name of crease; None makes an angle unknown.

    Raises:
        PatternError: unknown crease, or an angle that contradicts assignment or folded geometry.
    """
    values = np.where(pattern.is_boundary, 0.0, pattern.edges_foldAngle)
    for name, angle in angles.items():
        if name not in pattern.creases:
            pattern_names.unknown("crease", name, list(pattern.creases))
        values[pattern.creases[name]] = np.nan if angle is None else angle
    return replace(pattern, edges_foldAngle=values)


def named(
    pattern: CreasePattern,
    *,
    panels: Mapping[str, int] | None = None,
    edges: Mapping[str, Sequence[tuple[int, int]]] | None = None,
    points: Mapping[str, int] | None = None,
) -> CreasePattern:
    """Return the pattern with names added or replaced.

    Args:
        pattern: the pattern.
        panels: for each name one face of the panel.
        edges: for each name the vertex pairs of the edges (crease, boundary or line).
        points: for each name a vertex.

    Raises:
        PatternError: a face, pair or vertex that does not exist, or names that contradict.
    """
    old = pattern.names
    vertex_names, edge_names, face_names = map(list, (old.vertices, old.edges, old.faces))
    for name, face in (panels or {}).items():
        if not 0 <= face < len(face_names):
            raise PatternError(f"panel {name!r}: there is no face {face}")
        for other in np.flatnonzero(pattern.face_panel == pattern.face_panel[face]):
            face_names[other] = name
    for name, pairs in (edges or {}).items():
        for edge in find_edges(pairs, pattern.edges_vertices):
            edge_names[edge] = name
    for name, vertex in (points or {}).items():
        if not 0 <= vertex < len(vertex_names):
            raise PatternError(f"point {name!r}: there is no vertex {vertex}")
        vertex_names[vertex] = name
    names = PatternNames(tuple(vertex_names), tuple(edge_names), tuple(face_names))
    return replace(pattern, names=names)


def with_edge_property(
    pattern: CreasePattern, key: str, values: Mapping[str, Any]
) -> CreasePattern:
    """Return the pattern with a property set on edges, by name of crease, boundary or line.

    With the key `crease` and the value True, a named flat line becomes a crease.
    """
    parts = dict(chain(pattern.creases.items(), pattern.boundaries.items(), pattern.lines.items()))
    size = len(pattern.edges_vertices)
    array = _changed(pattern.edge_properties.get(key), size, parts, values, "edge")
    return replace(pattern, edge_properties={**pattern.edge_properties, key: array})


def with_panel_property(
    pattern: CreasePattern, key: str, values: Mapping[str, Any]
) -> CreasePattern:
    """Return the pattern with a property set on all faces of panels, by name of panel."""
    size = len(pattern.faces_vertices)
    array = _changed(pattern.face_properties.get(key), size, pattern.panels, values, "panel")
    return replace(pattern, face_properties={**pattern.face_properties, key: array})


def _changed(
    old: Any, size: int, parts: Mapping[str, Ints], values: Mapping[str, Any], kind: str
) -> npt.NDArray[Any]:
    """Return a property with those of the named parts replaced; None where unset."""
    entries = [None] * size if old is None else [v if v == v else None for v in old.tolist()]
    for name, value in values.items():
        if name not in parts:
            pattern_names.unknown(kind, name, list(parts))
        for k in parts[name]:
            entries[k] = value
    return property_array(entries)
