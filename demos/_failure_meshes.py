"""Good and bad meshes of one rectangle, for the failure map.

All of them keep the same vertices on the boundary, but for the unstructured one, and are made on
rank 0 from one seed: they do not depend on the number of ranks.
"""

from collections.abc import Callable

from mpi4py import MPI

import numpy as np
from scipy.spatial import Delaunay

from ufl_origami.mapped import lattice_triangles
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.sheet import SheetMesh
from ufl_origami.sheet_arrays import SheetArrays, build_sheet

SEED = 7
PERTURBED = 0.25  # largest move of a vertex along each axis, over the spacing
APART = 0.6  # least distance of random points from each other, over the spacing
SLOPE = 1.0  # x over y of the lattice lines of the skewed mesh, at the middle of its length
SLIVERS = 8  # one triangle in so many gets a sliver
FLAT = 1e-9  # of the plate's area or length: none
REGULAR = {
    "one-diagonal": "structured",
    "criss-cross": "crisscross",
    "unstructured": "unstructured",
}

Count = tuple[int, int]
Plane = tuple[np.ndarray, np.ndarray]


def mesh_kinds(angles: tuple[int, ...] = ()) -> tuple[str, ...]:
    """Names of all kinds, with slivers of some smallest angles (degrees)."""
    return (*REGULAR, *_IRREGULAR, *(f"slivers {angle} deg" for angle in angles))


def plate(kind: str, size: tuple[float, float], n: Count, comm: MPI.Comm) -> SheetMesh:
    """Flat rectangle with edges x0, x1, y0, y1 and the corner x1y0 as a point; collective.

    Args:
        kind: one of `mesh_kinds`.
        size: lengths along x and y.
        n: segments along x and y, at least 2.
        comm: communicator.
    """
    if kind in REGULAR:
        return rectangle(*size, n=n, structure=REGULAR[kind], comm=comm)
    return build_sheet(comm, lambda: _named(*_irregular(kind, size, n), size))


def smallest_angle(sheet: SheetMesh) -> float:
    """Smallest angle of all triangles at rest (degrees); collective."""
    corners = sheet.rest[sheet.cells[: sheet.num_owned_cells]]
    return float(np.degrees(sheet.comm.allreduce(_angles(corners).min(), op=MPI.MIN)))


def _angles(corners: np.ndarray) -> np.ndarray:
    """Angles (n, 3) of triangles (n, 3, dim)."""
    a = np.roll(corners, -1, axis=1) - corners
    b = np.roll(corners, 1, axis=1) - corners
    cosine = (a * b).sum(axis=2) / (np.linalg.norm(a, axis=2) * np.linalg.norm(b, axis=2))
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _irregular(kind: str, size: tuple[float, float], n: Count) -> Plane:
    if kind in _IRREGULAR:
        return _IRREGULAR[kind](size, n)
    return _slivers(size, n, np.radians(float(kind.split()[1])))


def _lattice(size: tuple[float, float], n: Count) -> np.ndarray:
    """Nodes (n1 + 1, n2 + 1, 2)."""
    return np.stack(np.meshgrid(*(np.linspace(0, s, k + 1) for s, k in zip(size, n, strict=True)),
                                indexing="ij"), axis=-1)  # fmt: skip


def _inside(nodes: np.ndarray) -> np.ndarray:
    """Which nodes (n1 + 1, n2 + 1) of a lattice are not on its boundary."""
    inside = np.zeros(nodes.shape[:2], dtype=bool)
    inside[1:-1, 1:-1] = True
    return inside


def _perturbed(size: tuple[float, float], n: Count) -> Plane:
    """One diagonal, inner vertices moved at random."""
    nodes, spacing = _lattice(size, n), np.divide(size, n)
    moves = np.random.default_rng(SEED).uniform(-PERTURBED, PERTURBED, nodes.shape) * spacing
    nodes[_inside(nodes)] += moves[_inside(nodes)]
    return nodes.reshape(-1, 2), lattice_triangles(*n)


def _skewed(size: tuple[float, float], n: Count) -> Plane:
    """One diagonal, lattice lines across the length slanted but for the ends."""
    nodes = _lattice(size, n)
    x, y = nodes[..., 0], nodes[..., 1]
    nodes[..., 0] += SLOPE * (y - 0.5 * size[1]) * np.sin(np.pi * x / size[0])
    return nodes.reshape(-1, 2), lattice_triangles(*n)


def _delaunay(size: tuple[float, float], n: Count) -> Plane:
    """Random points inside, with a least distance, and the regular ones on the boundary."""
    nodes = _lattice(size, n)
    points = list(nodes[~_inside(nodes)])
    spacing = np.divide(size, n)
    random = np.random.default_rng(SEED)
    wanted, tries = (n[0] + 1) * (n[1] + 1), 100 * n[0] * n[1]
    for point in random.uniform(0.5 * spacing, size - 0.5 * spacing, (tries, 2)):
        gap = np.linalg.norm((np.array(points) - point) / spacing, axis=1).min()
        if gap > APART and len(points) < wanted:
            points.append(point)
    return np.array(points), Delaunay(np.array(points)).simplices


def _slivers(size: tuple[float, float], n: Count, angle: float) -> Plane:
    """One diagonal; some triangles are split in three at a point close to their longest edge."""
    nodes, triangles = _lattice(size, n).reshape(-1, 2), lattice_triangles(*n)
    some = np.random.default_rng(SEED).permutation(len(triangles))[: len(triangles) // SLIVERS]
    corners = nodes[triangles[some]]
    opposite = np.linalg.norm(np.roll(corners, -1, 1) - np.roll(corners, 1, 1), axis=2).argmax(1)
    row = np.arange(len(some))
    r, p, q = (triangles[some][row, (opposite + k) % 3] for k in range(3))
    along = nodes[q] - nodes[p]
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1)  # triangles are counterclockwise
    added = 0.5 * (nodes[p] + nodes[q] + np.tan(angle) * inward)
    m = len(nodes) + row
    split = [np.stack(three, axis=1) for three in ((p, q, m), (q, r, m), (r, p, m))]
    kept = np.delete(triangles, some, axis=0)
    return np.concatenate([nodes, added]), np.concatenate([kept, *split])


def _named(nodes: np.ndarray, triangles: np.ndarray, size: tuple[float, float]) -> SheetArrays:
    """Sheet of plane nodes and triangles, oriented upwards, with the names of the sides."""
    corners = nodes[triangles]
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    double = ax * by - ay * bx
    triangles = np.where((double < 0)[:, None], triangles[:, ::-1], triangles)
    triangles = triangles[np.abs(double) > FLAT * size[0] * size[1]]
    edges = {}
    for axis, name in enumerate("xy"):
        for end, place in enumerate((0.0, size[axis])):
            side = np.flatnonzero(np.abs(nodes[:, axis] - place) < FLAT * size[axis])
            side = side[np.argsort(nodes[side, 1 - axis])]
            edges[f"{name}{end}"] = np.stack([side[:-1], side[1:]], axis=1)
    return SheetArrays(
        np.column_stack([nodes, np.zeros(len(nodes))]),
        triangles,
        np.zeros(len(triangles), dtype=np.int32),
        ("sheet",),
        edges,
        points={"x1y0": int(edges["x1"][0, 0])},
    )


_IRREGULAR: dict[str, Callable[[tuple[float, float], Count], Plane]] = {
    "perturbed": _perturbed,
    "Delaunay": _delaunay,
    "skewed": _skewed,
}
