"""Crease patterns: panels, creases, their names and properties, in the terms of the FOLD format.

A pattern holds the panels in their 3D rest state. What its words mean:

- *face*: one loop of vertices, counterclockwise seen from the tip of its normal.
- *panel*: a plane piece of sheet: one face, or several faces joined through edges F (flat) or
  J (join). Such an edge is no crease: the sheet runs smoothly through it. An F edge becomes a
  crease when its edge property `crease` is true.
- *crease*: an edge M, V, U, or F with property `crease`; *boundary*: an edge B or C (a cut: like
  B, and its end vertices may lie on those of the cut's other side); *line*: a named edge F or J
  that is no crease.
- *name*: every edge has at most one; edges with the same name are one crease, boundary or line.

Fold angles are in degrees in `edges_foldAngle`, as in FOLD, and in radians everywhere else;
valleys are positive.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from ufl_origami import pattern_arrays as arrays
from ufl_origami import pattern_checks as checks
from ufl_origami import pattern_names, pattern_text
from ufl_origami import pattern_shape as shape
from ufl_origami.errors import PatternError
from ufl_origami.pattern_names import PatternNames
from ufl_origami.pattern_topology import (
    Corners,
    Floats,
    Incidence,
    Ints,
    area_vectors,
    corner_angles,
    edge_angles,
    edges_of,
    join_faces,
)

Pair = tuple[int, int]


@dataclass(frozen=True, eq=False, repr=False)
class CreasePattern:
    """Panels that meet at creases, in their rest state; valid once it exists.

    Attributes:
        vertices_coords: (n, 3) rest coordinates; (n, 2) input gets z = 0.
        edges_vertices: (m, 2) vertices of each edge.
        edges_assignment: (m,) letters B, M, V, F, U, C, J.
        faces_vertices: loops of vertices, counterclockwise round the face's normal.
        edges_foldAngle: (m,) fold angle in degrees, valley positive, NaN where unknown.
        names: names of vertices, edges and faces.
        edge_properties: (m,) array per name, for example `stiffness`; NaN, False or None: unset.
        face_properties: (f,) array per name, for example `thickness`; NaN, False or None: unset.
        source: FOLD dictionary that the pattern came from: its keys that mean nothing here are
            written back unchanged; `frame_classes`, `frame_attributes` are read from it.
        tolerance: relative tolerance of the checks of planarity and coinciding vertices.

    Raises:
        PatternError: whatever is wrong, naming vertex, edge or face and the value.
    """

    vertices_coords: Floats
    edges_vertices: Ints
    edges_assignment: tuple[str, ...]
    faces_vertices: tuple[tuple[int, ...], ...]
    edges_foldAngle: Floats = None  # type: ignore[assignment]
    names: PatternNames = field(default_factory=PatternNames)
    edge_properties: Mapping[str, npt.NDArray[Any]] = MappingProxyType({})
    face_properties: Mapping[str, npt.NDArray[Any]] = MappingProxyType({})
    source: Mapping[str, Any] = MappingProxyType({})
    tolerance: float = 1e-5

    def __post_init__(self) -> None:
        """Turn the input into read-only arrays of the documented shapes, then check it."""
        points = arrays.coordinates(self.vertices_coords)
        edges = arrays.integers(self.edges_vertices, (-1, 2), "edges_vertices")
        faces = arrays.loops(self.faces_vertices)
        values = {
            "vertices_coords": points,
            "edges_vertices": edges,
            "edges_assignment": tuple(self.edges_assignment),
            "faces_vertices": faces,
            "edges_foldAngle": arrays.degrees(self.edges_foldAngle, len(edges)),
            "names": self.names.filled(len(points), len(edges), len(faces)),
            "edge_properties": arrays.properties(self.edge_properties),
            "face_properties": arrays.properties(self.face_properties),
            "source": MappingProxyType(dict(self.source)),
        }
        for key, value in values.items():
            object.__setattr__(self, key, value)
        self._check_topology()
        self._check_shape()
        self._check_meaning()

    @classmethod
    def from_arrays(
        cls,
        vertices: npt.ArrayLike,
        faces: Sequence[Sequence[int]],
        *,
        assignment: Mapping[Pair, str] | None = None,
        fold_angle: Mapping[Pair, float] | None = None,
        tolerance: float = 1e-5,
    ) -> "CreasePattern":
        """Build a pattern from vertices and faces; its edges are the sides of the faces.

        Args:
            vertices: (n, 2) or (n, 3) rest coordinates.
            faces: loops of vertices.
            assignment: letter by vertex pair; other edges are B with one face, U with more.
            fold_angle: fold angle in degrees by vertex pair; elsewhere unknown, 0 with one face.
            tolerance: see the class.

        Raises:
            PatternError: also when a vertex pair is no side of a face.
        """
        loops = arrays.loops(faces)
        corners = Corners.from_loops(loops)
        edges = edges_of(corners)
        count = Incidence.build(corners, edges).num_faces
        letters = np.where(count == 1, "B", "U").astype(object)
        angles = np.where((count == 1) & bool(fold_angle), 0.0, np.nan)
        for values, given in ((letters, assignment or {}), (angles, fold_angle or {})):
            values[checks.find_edges(list(given), edges)] = list(given.values())
        points = np.asarray(vertices, dtype=float)
        return cls(points, edges, tuple(letters), loops, angles, tolerance=tolerance)

    # ---- checks

    def _check_topology(self) -> None:
        edges, letters = self.edges_vertices, self.edges_assignment
        number = len(self.vertices_coords)
        num_faces = len(self.faces_vertices)
        arrays.check_length("edges_assignment", letters, len(edges), "edges")
        arrays.check_length("edges_foldAngle", self.edges_foldAngle, len(edges), "edges")
        for name, values in self.edge_properties.items():
            arrays.check_length(f"edge property {name!r}", values, len(edges), "edges")
        for name, values in self.face_properties.items():
            arrays.check_length(f"face property {name!r}", values, num_faces, "faces")
        checks.check_coordinates(self.vertices_coords)
        checks.check_loops(self.corners, number)
        checks.check_edges(edges, number)
        checks.check_assignments(letters, edges)
        checks.check_closed(self.corners, edges)
        checks.check_sides(self.incidence, edges, letters)
        checks.check_unused(self.corners, number)
        checks.check_orientation(self.corners, self.incidence, edges)

    def _check_shape(self) -> None:
        points, corners = self.vertices_coords, self.corners
        cut = np.zeros(len(points), dtype=bool)
        cut[self.edges_vertices[self._letters == "C"]] = True
        touching = "selfTouching" in self.source.get("frame_attributes", ())
        shape.check_duplicates(points, self.tolerance, cut | touching)
        shape.check_crossing(points, corners, self.tolerance)
        shape.check_areas(points, corners)
        names = list(self.panels)
        shape.check_planarity(points, corners, self.face_panel, names, self.tolerance)

    def _check_meaning(self) -> None:
        angle, edges, letters = self.edges_foldAngle, self.edges_vertices, self.edges_assignment
        checks.check_crease_flags(self._crease_flags, edges, letters)
        checks.check_fold_angles(angle, edges, letters)
        checks.check_several_faces(angle, self.incidence, edges)
        turned = np.degrees(self.geometric_angles)
        if self.is_folded:
            checks.check_folded(angle, turned, edges, letters)
        else:
            checks.check_unfolded(turned, edges)
        kinds = np.where(self.is_crease, "crease", np.where(self.is_boundary, "boundary", "line"))
        pattern_names.check_kinds(self.names.edges, list(kinds))
        for parts in ("creases", "boundaries", "lines", "points"):
            getattr(self, parts)  # building them checks the names

    # ---- topology

    @cached_property
    def corners(self) -> Corners:
        """The face loops as flat arrays."""
        return Corners.from_loops(self.faces_vertices)

    @cached_property
    def incidence(self) -> Incidence:
        """The faces round each edge."""
        return Incidence.build(self.corners, self.edges_vertices)

    @cached_property
    def _letters(self) -> npt.NDArray[np.str_]:
        return np.array(self.edges_assignment, dtype="<U1")

    @cached_property
    def _crease_flags(self) -> npt.NDArray[np.bool_]:
        flags = self.edge_properties.get("crease", np.zeros(len(self.edges_vertices), dtype=bool))
        return np.array([flag == 1 for flag in flags], dtype=bool)

    @cached_property
    def is_crease(self) -> npt.NDArray[np.bool_]:
        """(m,) whether each edge is a crease: M, V, U, or F with the property `crease`."""
        return np.isin(self._letters, ["M", "V", "U"]) | (
            (self._letters == "F") & self._crease_flags
        )

    @cached_property
    def is_boundary(self) -> npt.NDArray[np.bool_]:
        """(m,) whether each edge is a boundary: B or C."""
        return np.isin(self._letters, ["B", "C"])

    @cached_property
    def face_panel(self) -> Ints:
        """(f,) panel of each face; panels are numbered by their lowest face."""
        edges, first, second = self.incidence.two_sided()
        links = np.stack([self.corners.face[first], self.corners.face[second]], axis=1)
        joined = links[~self.is_crease[edges]]
        return arrays.read_only(join_faces(len(self.faces_vertices), joined))

    def edge_faces(self, edge: int) -> Ints:
        """Faces that meet at an edge, ascending."""
        return self.corners.face[self.incidence.corners_of(edge)]

    # ---- named parts

    @cached_property
    def panels(self) -> Mapping[str, Ints]:
        """Faces of each panel by name, in the order of the panels' numbers.

        A panel without a name is `panel<number>`.
        """
        return pattern_names.name_panels(self.face_panel, self.names.faces)

    @cached_property
    def creases(self) -> Mapping[str, Ints]:
        """Edges of each crease by name; one without a name is `crease<edge number>`."""
        return pattern_names.name_edges(self.names.edges, self.is_crease, lambda e: f"crease{e}")

    @cached_property
    def boundaries(self) -> Mapping[str, Ints]:
        """Edges of each boundary by name; those without a name are together `boundary`."""
        return pattern_names.name_edges(self.names.edges, self.is_boundary, lambda e: "boundary")

    @cached_property
    def lines(self) -> Mapping[str, Ints]:
        """Edges of each named line inside a panel (F or J edges that are no crease)."""
        inside = ~self.is_crease & ~self.is_boundary
        return pattern_names.name_edges(self.names.edges, inside, lambda e: None)

    @cached_property
    def points(self) -> Mapping[str, int]:
        """Vertex of each named point."""
        return pattern_names.name_points(self.names.vertices)

    # ---- geometry

    @cached_property
    def face_normals(self) -> Floats:
        """(f, 3) unit normal of each face in the rest state."""
        areas = area_vectors(self.vertices_coords, self.corners)
        return arrays.read_only(areas / np.linalg.norm(areas, axis=1, keepdims=True))

    @cached_property
    def geometric_angles(self) -> Floats:
        """(m,) fold angle of the rest geometry in radians; NaN where not two faces meet.

        theta = atan2((n2 x n1) . e, n1 . n2), see `hinge_angle`. At a flat-folded edge (pi either
        way) the sign is that of the given fold angle or, without one, of the assignment.
        """
        angles = edge_angles(self.vertices_coords, self.corners, self.incidence)
        closed = np.abs(np.abs(angles) - np.pi) <= np.radians(checks.ANGLE_TOLERANCE)
        downward = np.where(
            np.isnan(self.edges_foldAngle), self._letters == "M", self.edges_foldAngle < 0.0
        )
        sign = np.where(downward, -1.0, 1.0)
        return arrays.read_only(np.where(closed, sign * np.abs(angles), angles))

    def angle_between(self, edge: int, face1: int, face2: int) -> float:
        """Fold angle in radians between two of the faces that meet at an edge, seen from face 1.

        Valley positive with respect to the normal of face 1; face 2 is taken in the orientation
        that continues face 1 across the edge. For edges of more than two faces.

        Raises:
            PatternError: a face that does not meet the edge.
        """
        corner = {int(self.corners.face[c]): c for c in self.incidence.corners_of(edge)}
        for face in (face1, face2):
            if face not in corner:
                raise PatternError(f"face {face} does not meet edge {edge} ({sorted(corner)} do)")
        both = np.array([[corner[face1]], [corner[face2]]])
        return float(corner_angles(self.vertices_coords, self.corners, self.incidence, *both)[0])

    @cached_property
    def is_folded(self) -> bool:
        """Whether the coordinates are a folded form, so that rest angles are the geometry's.

        `frame_classes` of the source decides (foldedForm or creasePattern); without either, a
        pattern is unfolded if no two faces are turned against each other.
        """
        classes = self.source.get("frame_classes", ())
        folded, flat = "foldedForm" in classes, "creasePattern" in classes
        if folded and flat:
            raise PatternError("frame_classes holds both creasePattern and foldedForm")
        angles = np.degrees(self.geometric_angles)
        turned = bool((np.abs(angles) > checks.ANGLE_TOLERANCE).any())
        several = bool((self.incidence.num_faces > 2).any())
        return folded or (not flat and (turned or several))

    @cached_property
    def rest_angles(self) -> Floats:
        """(m,) rest angle of each crease in radians; NaN off creases and at more than two faces.

        A folded form rests as its geometry is (the file's fold angles have been checked against
        it); an unfolded pattern rests at `edges_foldAngle`, unassigned and flat creases without
        one at 0.

        Raises:
            PatternError: a mountain or valley of an unfolded pattern without a fold angle.
        """
        if self.is_folded:
            angles = self.geometric_angles
        else:
            given = self.edges_foldAngle
            checks.check_known_angles(given, self.edges_vertices, self.edges_assignment)
            angles = np.where(np.isnan(given), 0.0, np.radians(given))
        usable = self.is_crease & (self.incidence.num_faces == 2)
        return arrays.read_only(np.where(usable, angles, np.nan))

    @cached_property
    def edge_lengths(self) -> Floats:
        """(m,) length of each edge in the rest state."""
        ends = self.vertices_coords[self.edges_vertices]
        return arrays.read_only(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))

    # ---- text

    def __reduce__(self) -> tuple[Any, ...]:
        values = [getattr(self, entry.name) for entry in fields(self)]
        return type(self), tuple(dict(v) if isinstance(v, MappingProxyType) else v for v in values)

    def __repr__(self) -> str:
        return f"<{pattern_text.title(self)}>"

    def summary(self) -> str:
        """Describe panels, creases (length, geometric fold angle), boundaries and points."""
        return pattern_text.summary(self)
