"""Triangle meshes of crease patterns: panel by panel, with the same nodes on common edges.

The nodes of the edges come first, spread by the wanted sizes; then each face is filled on its own,
in its plane, by gmsh or as a mapped mesh. Panels may therefore coincide in space.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from ufl_origami import mesh_checks
from ufl_origami.errors import MeshError
from ufl_origami.gmsh_fill import Size, fill_polygon
from ufl_origami.mapped import mesh_mapped
from ufl_origami.pattern import CreasePattern
from ufl_origami.sheet import SheetMesh, known_name
from ufl_origami.sheet_arrays import SheetArrays, build_sheet
from ufl_origami.sizing import Refinement, Source, Spacing, edge_spacing, size_field, source
from ufl_origami.subdivision import MappedFace, mapped_face, match_counts

STRUCTURES = ("unstructured", "structured", "crisscross")
#: Edges whose segments are shorter than this part of the panel's size grade the panel's mesh.
GRADED = 0.9


@dataclass(frozen=True)
class MeshOptions:
    """What the mesh of a pattern shall be like; the arguments of :func:`mesh_pattern`."""

    size: float
    structure: str | Mapping[str, str] = "unstructured"
    panel_size: Mapping[str, float] | None = None
    edge_size: Mapping[str, float] | None = None
    refine: Sequence[Refinement] = ()
    min_altitude_ratio: float = 0.01


def mesh_pattern(
    pattern: CreasePattern,
    size: float,
    *,
    structure: str | Mapping[str, str] = "unstructured",
    panel_size: Mapping[str, float] | None = None,
    edge_size: Mapping[str, float] | None = None,
    refine: Sequence[Refinement] = (),
    min_altitude_ratio: float = 0.01,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> SheetMesh:
    """Mesh a pattern in its rest state; collective, the pattern of rank 0 counts.

    Creases, boundaries, lines, panels and points keep their names.

    Args:
        pattern: the crease pattern.
        size: length of the triangles' sides.
        structure: "unstructured" (gmsh, close to equilateral), "structured" (mapped, one diagonal;
            panels with four or three sides) or "crisscross" (each mapped quad cut in four), for
            all panels or by panel name (the others are unstructured).
        panel_size: size by panel name, instead of `size`. An edge between panels takes the
            smallest; the triangles grow away from it.
        edge_size: size by name of a crease, boundary or line, instead of its panels'.
        refine: smaller triangles near named parts; mapped panels follow along their edges.
        min_altitude_ratio: least smallest altitude / longest edge of a triangle.
        comm: communicator.

    Raises:
        MeshError: on all ranks: unknown name, size not positive, panel that cannot be mapped,
            triangle inverted or too thin; the message names the panel.
    """
    options = MeshOptions(size, structure, panel_size, edge_size, refine, min_altitude_ratio)
    return build_sheet(comm, lambda: pattern_arrays(pattern, options))


def pattern_arrays(pattern: CreasePattern, options: MeshOptions) -> SheetArrays:
    """Mesh a pattern into arrays: the serial part of :func:`mesh_pattern`."""
    plan = _plan(pattern, options)
    nodes, chains = _edge_nodes(pattern, plan)
    vertices, triangles, panel = [nodes], [], []
    used = len(nodes)
    for face in range(len(pattern.faces_vertices)):
        loop = _face_loop(pattern, chains, face)
        inner, cells = _fill_face(pattern, plan, face, nodes[loop])
        _check_face(pattern, face, np.concatenate([nodes[loop], inner]), cells, options)
        triangles.append(np.concatenate([loop, used + np.arange(len(inner))])[cells])
        panel.append(np.full(len(cells), pattern.face_panel[face]))
        vertices.append(inner)
        used += len(inner)
    named = {**pattern.creases, **pattern.boundaries, **pattern.lines}
    return SheetArrays(
        vertices=np.concatenate(vertices),
        triangles=np.concatenate(triangles),
        panel=np.concatenate(panel),
        panel_names=tuple(pattern.panels),
        edges={name: _pairs([chains[e] for e in edges]) for name, edges in named.items()},
        creases=tuple(pattern.creases),
        points=dict(pattern.points),
    )


@dataclass(frozen=True)
class _Plan:
    """Decisions made before any face is filled."""

    structure: list[str]
    face_size: np.ndarray
    edge_size: np.ndarray
    sources: list[Source]
    spacings: list[Spacing]
    counts: list[int]
    mapped: dict[int, MappedFace]


def _plan(pattern: CreasePattern, options: MeshOptions) -> _Plan:
    structure = _face_structures(pattern, options.structure)
    face_size = _face_sizes(pattern, options)
    edge_size = _edge_sizes(pattern, options, face_size)
    sources = [s for refinement in options.refine for s in _sources(pattern, refinement)]
    points = pattern.vertices_coords
    ends = points[pattern.edges_vertices]
    spacings = [
        edge_spacing(ends[e, 0], ends[e, 1], limit, sources) for e, limit in enumerate(edge_size)
    ]
    mapped = {
        f: mapped_face(
            _label(pattern, f),
            points[list(pattern.faces_vertices[f])],
            _edges_of_face(pattern, f),
            crisscross=style == "crisscross",
        )
        for f, style in enumerate(structure)
        if style != "unstructured"
    }
    wanted = [float(s.wanted[-1]) for s in spacings]
    counts = match_counts([s.count for s in spacings], wanted, list(mapped.values()))
    return _Plan(structure, face_size, edge_size, sources, spacings, counts, mapped)


def _face_structures(pattern: CreasePattern, structure: str | Mapping[str, str]) -> list[str]:
    names = list(pattern.panels)
    if isinstance(structure, str):
        by_panel = dict.fromkeys(names, structure)
    else:
        _check_names(structure, names, "panel", "structure")
        by_panel = {name: structure.get(name, "unstructured") for name in names}
    for name, style in by_panel.items():
        if style not in STRUCTURES:
            raise MeshError(f"panel {name!r}: structure {style!r} is none of {STRUCTURES}")
    return [by_panel[names[p]] for p in pattern.face_panel]


def _face_sizes(pattern: CreasePattern, options: MeshOptions) -> np.ndarray:
    names, sizes = list(pattern.panels), options.panel_size or {}
    _check_names(sizes, names, "panel", "panel_size")
    by_panel = [_positive(sizes.get(name, options.size), f"panel {name!r}") for name in names]
    return np.array(by_panel)[pattern.face_panel]


def _edge_sizes(pattern: CreasePattern, options: MeshOptions, face_size) -> np.ndarray:
    named = {**pattern.creases, **pattern.boundaries, **pattern.lines}
    sizes = np.full(len(pattern.edges_vertices), np.inf)
    np.minimum.at(sizes, pattern.incidence.edge, face_size[pattern.corners.face])
    _check_names(options.edge_size or {}, list(named), "edge", "edge_size")
    for name, size in (options.edge_size or {}).items():
        sizes[named[name]] = _positive(size, f"edge {name!r}")
    return sizes


def _sources(pattern: CreasePattern, refinement: Refinement) -> list[Source]:
    named = {**pattern.creases, **pattern.boundaries, **pattern.lines}
    _check_names([refinement.near], [*named, *pattern.points], "edge or point", "refine")
    size = _positive(refinement.size, f"refinement near {refinement.near!r}")
    if refinement.radius < 0.0 or refinement.growth < 0.0:
        raise MeshError(f"refinement near {refinement.near!r}: negative radius or growth")
    if refinement.near in named:
        pairs = pattern.edges_vertices[named[refinement.near]]
    else:
        pairs = np.array([2 * [pattern.points[refinement.near]]])
    return [
        source(ends, size, refinement.radius, refinement.growth)
        for ends in pattern.vertices_coords[pairs]
    ]


def _check_names(given, names: Sequence[str], kind: str, option: str) -> None:
    for name in given:
        known_name(name, names, f"{kind} of the pattern (option {option})", MeshError)


def _positive(size: float, what: str) -> float:
    if not (np.isfinite(size) and size > 0.0):
        raise MeshError(f"{what}: size {size} is not positive")
    return float(size)


def _label(pattern: CreasePattern, face: int) -> str:
    return f"panel {list(pattern.panels)[pattern.face_panel[face]]!r} (face {face})"


def _edges_of_face(pattern: CreasePattern, face: int) -> list[int]:
    """Edges of a face; each starts at the vertex of the loop with the same place."""
    start, end = pattern.corners.start[face : face + 2]
    return [int(e) for e in pattern.incidence.edge[start:end]]


def _edge_nodes(pattern: CreasePattern, plan: _Plan) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return coordinates of the pattern's vertices and edge nodes, and the nodes of each edge."""
    points = pattern.vertices_coords
    coordinates, chains, used = [points], [], len(points)
    for e, (spacing, count) in enumerate(zip(plan.spacings, plan.counts, strict=True)):
        a, b = (int(v) for v in pattern.edges_vertices[e, :])
        t = spacing.nodes(count)[1:-1, None]
        coordinates.append((1 - t) * points[a] + t * points[b])
        chains.append(np.concatenate([[a], used + np.arange(count - 1), [b]]))
        used += count - 1
    return np.concatenate(coordinates), chains


def _pairs(chains: list[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.stack([chain[:-1], chain[1:]], axis=1) for chain in chains])


def _face_loop(pattern: CreasePattern, chains: list[np.ndarray], face: int) -> np.ndarray:
    """Return the nodes round a face, starting at the first vertex of its loop."""
    start, end = pattern.corners.start[face : face + 2]
    nodes = []
    for corner in range(start, end):
        chain = chains[pattern.incidence.edge[corner]]
        nodes.append((chain if pattern.incidence.forward[corner] else chain[::-1])[:-1])
    return np.concatenate(nodes)


def _fill_face(pattern: CreasePattern, plan: _Plan, face: int, loop: np.ndarray):
    """Return inner nodes (m, 3) and triangles over [loop (k, 3), inner nodes]."""
    try:
        if face in plan.mapped:
            return _fill_mapped(pattern, plan, face, loop)
        frame = _plane_frame(loop, pattern.face_normals[face])
        origin = loop.mean(axis=0)
        size = _face_size_field(pattern, plan, face, origin, frame)
        inner, cells = fill_polygon((loop - origin) @ frame.T, size)
    except MeshError as error:
        raise MeshError(f"{_label(pattern, face)}: {error}") from error
    return origin + inner @ frame, cells


def _fill_mapped(pattern: CreasePattern, plan: _Plan, face: int, loop: np.ndarray):
    corners = plan.mapped[face].corners
    edges = _edges_of_face(pattern, face)
    place = np.concatenate([[0], np.cumsum([plan.counts[e] for e in edges])])[list(corners)]
    turned = np.roll(loop, -place[0], axis=0)
    crisscross = plan.structure[face] == "crisscross"
    inner, cells = mesh_mapped(turned, (place - place[0]).tolist(), crisscross=crisscross)
    return inner, np.where(cells < len(loop), (cells + place[0]) % len(loop), cells)


def _plane_frame(loop: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return two unit vectors (2, 3) in the plane, counterclockwise round the normal."""
    step = np.roll(loop, -1, axis=0) - loop
    along = step[np.argmax(np.linalg.norm(step, axis=1))]
    along = along - (along @ normal) * normal
    along /= np.linalg.norm(along)
    return np.stack([along, np.cross(normal, along)])


def _face_size_field(pattern: CreasePattern, plan: _Plan, face: int, origin, frame) -> Size:
    """Return the size inside a face: its own, less near finer edges and refinements."""
    limit = float(plan.face_size[face])
    sources = list(plan.sources)
    for e in _edges_of_face(pattern, face):
        segment = plan.edge_size[e] * plan.spacings[e].wanted[-1] / plan.counts[e]
        if segment < GRADED * limit:
            ends = pattern.vertices_coords[pattern.edges_vertices[e]]
            sources.append(source(ends, float(segment)))
    if not sources:
        return limit
    field = size_field(limit, sources)
    affine = [tuple(map(float, row)) for row in np.stack([origin, *frame], axis=1)]
    return lambda x, y: field([o + x * a + y * b for o, a, b in affine])


def _check_face(pattern: CreasePattern, face: int, points, cells, options: MeshOptions) -> None:
    """Check that no triangle of a face is inverted or too thin."""
    upward = mesh_checks.triangle_normals(points, cells) @ pattern.face_normals[face]
    if upward.min() <= 0.0:
        corner = points[cells[np.argmin(upward)]].mean(axis=0)
        raise MeshError(f"{_label(pattern, face)}: inverted triangle at {corner}")
    ratio = mesh_checks.altitude_ratios(points, cells)
    if ratio.min() < options.min_altitude_ratio:
        corner = points[cells[np.argmin(ratio)]].mean(axis=0)
        raise MeshError(
            f"{_label(pattern, face)}: smallest altitude / longest edge {ratio.min():.2e} at"
            f" {corner}, below {options.min_altitude_ratio:g}; take smaller or more equal sizes"
        )
