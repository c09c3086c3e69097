"""Meshes of the shapes of shell benchmarks: vertices on the exact surface, named edges and points.

Each shape is a rectangle of two surface coordinates. "structured" and "crisscross" are mapped
lattices; "unstructured" is meshed by gmsh in coordinates that keep angles, so that the triangles
are as close to equilateral and as equal in size on the surface as gmsh makes them in the plane.
The geometries are those of Sze, Liu & Lo 2004, doi:10.1016/j.finel.2003.11.001.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from ufl_origami.errors import MeshError
from ufl_origami.gmsh_fill import fill_polygon
from ufl_origami.mapped import mesh_mapped
from ufl_origami.meshing import STRUCTURES
from ufl_origami.sheet import SheetMesh
from ufl_origami.sheet_arrays import SheetArrays, build_sheet

Map = Callable[[np.ndarray], np.ndarray]
Count = int | tuple[int, int]


def _same(points: np.ndarray) -> np.ndarray:
    return points


@dataclass(frozen=True)
class _Shape:
    """A surface over the rectangle low..high of its coordinates (u, v); the normal is u x v.

    Attributes:
        low, high: corners of the rectangle.
        lengths: lengths in space of the sides v = low, u = high, v = high, u = low.
        counted: the lengths along u and v that the wanted numbers of segments divide.
        sides: names of these sides.
        points: name -> (side, place from 0 to 1 counterclockwise); left out where no vertex is.
        surface: (n, 2) coordinates to (n, 3) points.
        flatten: coordinates to a plane in which angles are those on the surface.
        unflatten: the inverse.
        scale: length on the surface over length in that plane, at a point of the plane.
    """

    low: tuple[float, float]
    high: tuple[float, float]
    lengths: tuple[float, float, float, float]
    counted: tuple[float, float]
    sides: tuple[str, str, str, str]
    points: dict[str, tuple[int, float]]
    surface: Map
    flatten: Map = _same
    unflatten: Map = _same
    scale: Callable[[float, float], float] | None = None


def rectangle(
    length: float,
    width: float,
    n: Count | None = None,
    *,
    size: float | None = None,
    structure: str = "structured",
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> SheetMesh:
    """Mesh the flat rectangle 0 <= x <= length, 0 <= y <= width, normal +z.

    Edges "x0", "x1", "y0", "y1"; points "x0y0", "x1y0", "x1y1", "x0y1" at the corners and "x0_mid",
    "x1_mid", "y0_mid", "y1_mid" in the middle of the sides, where a vertex is.

    Args:
        length: along x.
        width: along y.
        n: segments along x and y; one number counts along the shorter side.
        size: length of a segment, instead of n.
        structure: "structured" (one diagonal), "crisscross" or "unstructured".
        comm: communicator.

    Raises:
        MeshError: on all ranks: sizes not positive, both or none of n and size, unknown structure.
    """
    places = {"x0y0": (0, 0.0), "x1y0": (1, 0.0), "x1y1": (2, 0.0), "x0y1": (3, 0.0)}
    places |= {"y0_mid": (0, 0.5), "x1_mid": (1, 0.5), "y1_mid": (2, 0.5), "x0_mid": (3, 0.5)}

    def make() -> SheetArrays:
        _check_positive(length=length, width=width)
        shape = _Shape(
            (0.0, 0.0),
            (length, width),
            (length, width, length, width),
            (length, width),
            ("y0", "x1", "y1", "x0"),
            places,
            lambda uv: np.stack([uv[:, 0], uv[:, 1], 0.0 * uv[:, 0]], axis=1),
        )
        return _mesh(shape, _rectangle_counts(length, width, n, size), structure)

    return build_sheet(comm, make)


def slit_annulus(
    r_inner: float,
    r_outer: float,
    n: Count,
    *,
    structure: str = "structured",
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> SheetMesh:
    """Mesh a full flat annulus, slit along the positive x axis (vertices doubled), normal +z.

    Edges "slit_clamped" (angle 0), "slit_loaded" (angle 2 pi), "inner", "outer"; points "A" and
    "B", the inner and the outer end of the loaded edge.

    Args:
        r_inner: inner radius.
        r_outer: outer radius.
        n: segments along the radius and round; one number counts along the radius.
        structure: "structured" (one diagonal), "crisscross" or "unstructured".
        comm: communicator.

    Raises:
        MeshError: on all ranks: radii or n out of range, unknown structure.
    """

    def make() -> SheetArrays:
        _check_positive(r_inner=r_inner, width=r_outer - r_inner)
        width = r_outer - r_inner
        shape = _Shape(
            (r_inner, 0.0),
            (r_outer, 2.0 * math.pi),
            (width, 2.0 * math.pi * r_outer, width, 2.0 * math.pi * r_inner),
            (width, math.pi * (r_inner + r_outer)),
            ("slit_clamped", "outer", "slit_loaded", "inner"),
            {"A": (3, 0.0), "B": (2, 0.0)},
            lambda rt: np.stack(
                [rt[:, 0] * np.cos(rt[:, 1]), rt[:, 0] * np.sin(rt[:, 1]), 0.0 * rt[:, 0]], axis=1
            ),
            lambda rt: np.stack([np.log(rt[:, 0]), rt[:, 1]], axis=1),
            lambda flat: np.stack([np.exp(flat[:, 0]), flat[:, 1]], axis=1),
            lambda x, y: math.exp(x),
        )
        return _mesh(shape, n, structure)

    return build_sheet(comm, make)


def hemisphere_quarter(
    radius: float,
    n: Count,
    *,
    hole_angle_deg: float = 18.0,
    structure: str = "structured",
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> SheetMesh:
    """Mesh the quarter x >= 0, y >= 0 of a hemisphere z >= 0 with a hole, normal outwards.

    Edges "sym_x0", "sym_y0" (in the planes x = 0 and y = 0), "hole", "equator"; points "A" and "B"
    on the equator at the x and the y axis.

    Args:
        radius: radius.
        n: segments along the equator and along the meridian; one number counts on the equator.
        hole_angle_deg: angle between the pole's axis and the hole's edge, degrees.
        structure: "structured" (one diagonal), "crisscross" or "unstructured".
        comm: communicator.

    Raises:
        MeshError: on all ranks: radius, angle or n out of range, unknown structure.
    """
    hole = math.radians(hole_angle_deg)
    top = 0.5 * math.pi - hole

    def surface(angles: np.ndarray) -> np.ndarray:
        phi, latitude = angles.T
        ring = radius * np.cos(latitude)
        x, y = ring * np.cos(phi), ring * np.sin(phi)
        return np.stack([x, y, radius * np.sin(latitude)], axis=1)

    def make() -> SheetArrays:
        _check_positive(radius=radius, hole_angle_deg=hole_angle_deg, height=top)
        quarter = 0.5 * math.pi * radius
        shape = _Shape(
            (0.0, 0.0),
            (0.5 * math.pi, top),
            (quarter, radius * top, quarter * math.sin(hole), radius * top),
            (quarter, radius * top),
            ("equator", "sym_x0", "hole", "sym_y0"),
            {"A": (0, 0.0), "B": (1, 0.0)},
            surface,
            lambda uv: np.stack([uv[:, 0], np.arcsinh(np.tan(uv[:, 1]))], axis=1),
            lambda flat: np.stack([flat[:, 0], np.arctan(np.sinh(flat[:, 1]))], axis=1),
            lambda x, y: radius / math.cosh(y),
        )
        return _mesh(shape, n, structure)

    def onto(points: np.ndarray) -> np.ndarray:
        return radius * points / np.linalg.norm(points, axis=1)[:, None]

    return build_sheet(comm, make, onto)


def cylinder_octant(
    radius: float,
    length: float,
    n: Count,
    *,
    structure: str = "structured",
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> SheetMesh:
    """Mesh the octant x, y, z >= 0 of an open cylinder along y, |y| <= length / 2, normal outwards.

    Edges "sym_x0", "sym_y0", "sym_z0" (in the planes x = 0, y = 0, z = 0) and "free_end"
    (y = length / 2). Points of the pull-out test, whose load pulls along z: "A" = (0, 0, R) under
    the load, "B" = (R, 0, 0) at mid-length, "C" = (R, length / 2, 0) at the free end.

    Args:
        radius: radius R.
        length: length of the whole cylinder.
        n: segments round (a quarter turn) and along y; one number counts round.
        structure: "structured" (one diagonal), "crisscross" or "unstructured".
        comm: communicator.

    Raises:
        MeshError: on all ranks: sizes or n out of range, unknown structure.
    """
    sides = ("sym_y0", "sym_z0", "free_end", "sym_x0")
    points = {"A": (0, 0.0), "B": (1, 0.0), "C": (2, 0.0)}
    part = _CylinderPart(radius, length, 0.5 * math.pi, sides, points)
    return part.mesh(n, structure, comm)


def roof_quarter(
    radius: float,
    length: float,
    half_angle: float,
    n: Count,
    *,
    structure: str = "structured",
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> SheetMesh:
    """Mesh the quarter x, y >= 0 of a cylindrical roof along y, |y| <= length / 2, normal outwards.

    Its top is (0, 0, radius). Edges "sym_x0", "sym_y0" (in the planes x = 0, y = 0), "straight" (at
    the half angle) and "free_end" (y = length / 2). Points "A" = the top and "B" = the middle of
    the free end (0, length / 2, radius).

    Args:
        radius: radius.
        length: length of the whole roof.
        half_angle: half of its opening angle (radians).
        n: segments round (of the half angle) and along y; one number counts round.
        structure: "structured" (one diagonal), "crisscross" or "unstructured".
        comm: communicator.

    Raises:
        MeshError: on all ranks: sizes or n out of range, unknown structure.
    """
    sides, points = ("sym_y0", "straight", "free_end", "sym_x0"), {"A": (0, 0.0), "B": (3, 0.0)}
    return _CylinderPart(radius, length, half_angle, sides, points).mesh(n, structure, comm)


@dataclass(frozen=True)
class _CylinderPart:
    """Quarter of a part of a cylinder along y, from its top to an angle and from y = 0 on."""

    radius: float
    length: float
    angle: float
    sides: tuple[str, str, str, str]
    points: dict[str, tuple[int, float]]

    def mesh(self, n: Count, structure: str, comm: MPI.Comm) -> SheetMesh:
        return build_sheet(comm, lambda: _mesh(self._shape(), n, structure), self._onto)

    def _shape(self) -> _Shape:
        _check_positive(radius=self.radius, length=self.length, angle=self.angle)
        arc, half = self.angle * self.radius, 0.5 * self.length
        lengths, counted = (arc, half, arc, half), (arc, half)
        return _Shape(
            (0.0, 0.0), (arc, half), lengths, counted, self.sides, self.points, self._surface
        )

    def _surface(self, uv: np.ndarray) -> np.ndarray:
        angle, radius = uv[:, 0] / self.radius, self.radius
        return np.stack([radius * np.sin(angle), uv[:, 1], radius * np.cos(angle)], axis=1)

    def _onto(self, points: np.ndarray) -> np.ndarray:
        round_axis = points * np.array([1.0, 0.0, 1.0])
        away = self.radius / np.linalg.norm(round_axis, axis=1)[:, None] - 1.0
        return points + away * round_axis


def _check_positive(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0.0):
            raise MeshError(f"{name} = {value} is not positive")


def _rectangle_counts(length: float, width: float, n: Count | None, size: float | None):
    if (n is None) == (size is None):
        raise MeshError("rectangle: give either n or size")
    if size is not None:
        _check_positive(size=size)
        return tuple(max(1, math.ceil(side / size - 1e-6)) for side in (length, width))
    if isinstance(n, int) and width < length:
        return _counts(n, (width, length))[::-1]
    return n


def _counts(n: Count | None, lengths: tuple[float, float]) -> tuple[int, int]:
    """Return segments along two lengths; one number counts along the first."""
    if isinstance(n, int):
        pair = (n, max(1, round(n * lengths[1] / lengths[0])))
    else:
        pair = tuple(n or ())  # type: ignore[assignment]
    if len(pair) != 2 or min(pair) < 1 or any(int(k) != k for k in pair):
        raise MeshError(f"n = {n} is neither a positive number nor two")
    return pair


def _mesh(shape: _Shape, n: Count | None, structure: str) -> SheetArrays:
    if structure not in STRUCTURES:
        raise MeshError(f"structure {structure!r} is none of {STRUCTURES}")
    counts = _counts(n, shape.counted)
    free = structure == "unstructured"
    segments = _free_segments(shape, counts) if free else (*counts, *counts)
    loop, corners = _loop(shape, segments)
    if free:
        inner, triangles = _fill(shape, counts, loop)
    else:
        inner, triangles = mesh_mapped(loop, corners[:4], crisscross=structure == "crisscross")
    vertices = shape.surface(np.concatenate([loop, inner]))
    vertices[np.abs(vertices) < 1e-14 * np.abs(vertices).max()] = 0.0
    ring = np.append(np.arange(len(loop)), 0)
    pairs = np.stack([ring[:-1], ring[1:]], axis=1)
    edges = {name: pairs[corners[i] : corners[i + 1]] for i, name in enumerate(shape.sides)}
    panel = np.zeros(len(triangles), dtype=np.int32)
    points = _points(shape, segments, corners)
    return SheetArrays(vertices, triangles, panel, ("sheet",), edges, points=points)


def _free_segments(shape: _Shape, counts: tuple[int, int]) -> tuple[int, ...]:
    """Return segments of the four sides, of nearly one length on opposite sides."""
    size = _free_size(shape, counts)
    return tuple(max(1, round(length / size)) for length in shape.lengths)


def _free_size(shape: _Shape, counts: tuple[int, int]) -> float:
    """Return the geometric mean of the segments along the two directions."""
    return math.sqrt(math.prod(shape.counted) / math.prod(counts))


def _loop(shape: _Shape, segments: tuple[int, ...]) -> tuple[np.ndarray, list[int]]:
    """Return the boundary nodes (k, 2) counterclockwise, the place of each corner, and k."""
    (u0, v0), (u1, v1) = shape.low, shape.high
    ends = [(u0, v0), (u1, v0), (u1, v1), (u0, v1), (u0, v0)]
    sides = [
        np.linspace(ends[i], ends[i + 1], count, endpoint=False) for i, count in enumerate(segments)
    ]
    return np.concatenate(sides), [0, *np.cumsum(segments).tolist()]


def _fill(shape: _Shape, counts: tuple[int, int], loop: np.ndarray):
    size = _free_size(shape, counts)
    scale = shape.scale
    local = size if scale is None else lambda x, y: size / scale(x, y)
    inner, triangles = fill_polygon(shape.flatten(loop), local)
    return shape.unflatten(inner), triangles


def _points(shape: _Shape, segments: tuple[int, ...], corners: list[int]) -> dict[str, int]:
    places = {name: place * segments[side] for name, (side, place) in shape.points.items()}
    return {
        name: corners[shape.points[name][0]] + round(place)
        for name, place in places.items()
        if place == round(place)
    }
