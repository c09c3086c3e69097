"""Mapped meshes of panels with four or three sides, and their triangles by index.

A panel with four sides is a lattice of (n1 + 1) x (n2 + 1) nodes, each cell cut by one diagonal or,
criss-cross, into four; one with three sides is a triangular lattice.
"""

import itertools
from collections.abc import Sequence

import numpy as np

from ufl_origami.errors import MeshError


def lattice_triangles(n1: int, n2: int, *, crisscross: bool = False) -> np.ndarray:
    """Return the triangles of a lattice whose node (i, j) has the index i * (n2 + 1) + j.

    Axis 2 turns counterclockwise from axis 1. One diagonal runs from (i, j) to (i + 1, j + 1);
    criss-cross takes the centre of cell (i, j) as node (n1 + 1) * (n2 + 1) + i * n2 + j.
    """
    corner = (np.arange(n1)[:, None] * (n2 + 1) + np.arange(n2)).ravel()
    a, b, c, d = corner, corner + n2 + 1, corner + n2 + 2, corner + 1
    if not crisscross:
        return np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)
    m = (n1 + 1) * (n2 + 1) + np.arange(n1 * n2)
    return np.stack([a, b, m, b, c, m, c, d, m, d, a, m], axis=1).reshape(-1, 3)


def cell_centres(lattice: np.ndarray) -> np.ndarray:
    """Return the mean of the corners of each cell of a lattice (n1 + 1, n2 + 1, dim), flat."""
    mean = lattice[:-1, :-1] + lattice[1:, :-1] + lattice[1:, 1:] + lattice[:-1, 1:]
    return 0.25 * mean.reshape(-1, lattice.shape[-1])


def coons_lattice(sides: Sequence[np.ndarray]) -> np.ndarray:
    """Return nodes (n1 + 1, n2 + 1, dim) inside four sides by transfinite interpolation.

    Gordon & Hall 1973, doi:10.1002/nme.1620070405.

    Args:
        sides: nodes of the four sides (n1 + 1, dim), (n2 + 1, dim), (n1 + 1, dim), (n2 + 1, dim)
            going round counterclockwise, each from its first corner to its last.
    """
    low, right, high, left = sides[0], sides[1], sides[2][::-1], sides[3][::-1]
    u = np.linspace(0.0, 1.0, len(low))[:, None, None]
    v = np.linspace(0.0, 1.0, len(right))[None, :, None]
    ruled = (1 - v) * low[:, None] + v * high[:, None] + (1 - u) * left + u * right
    corners = (1 - u) * ((1 - v) * low[0] + v * high[0]) + u * ((1 - v) * low[-1] + v * high[-1])
    nodes = ruled - corners
    nodes[:, 0], nodes[-1], nodes[:, -1], nodes[0] = low, right, high, left
    return nodes


def mesh_quad(sides: Sequence[np.ndarray], *, crisscross: bool) -> tuple[np.ndarray, np.ndarray]:
    """Mesh four sides: inner nodes (m, dim) and triangles over [boundary loop, inner nodes].

    The single diagonal is the one that is shorter over all cells, at a tie the one from the first
    corner.
    """
    n1, n2 = len(sides[0]) - 1, len(sides[1]) - 1
    nodes = coons_lattice(sides)
    first = np.linalg.norm(nodes[1:, 1:] - nodes[:-1, :-1], axis=2).sum()
    second = np.linalg.norm(nodes[1:, :-1] - nodes[:-1, 1:], axis=2).sum()
    index = np.empty((n1 + 1, n2 + 1), dtype=np.int64)
    around = 2 * (n1 + n2)
    index[:-1, 0] = np.arange(n1)
    index[-1, :-1] = n1 + np.arange(n2)
    index[:0:-1, -1] = n1 + n2 + np.arange(n1)
    index[0, :0:-1] = 2 * n1 + n2 + np.arange(n2)
    index[1:-1, 1:-1] = around + np.arange((n1 - 1) * (n2 - 1)).reshape(n1 - 1, n2 - 1)
    inner = nodes[1:-1, 1:-1].reshape(-1, nodes.shape[-1])
    if crisscross:
        centres = around + len(inner) + np.arange(n1 * n2)
        label = np.concatenate([index.ravel(), centres])
        return np.concatenate([inner, cell_centres(nodes)]), label[
            lattice_triangles(n1, n2, crisscross=True)
        ]
    if second < first * (1 - 1e-9):
        turned = lattice_triangles(n2, n1)
        return inner, np.rot90(index).ravel()[turned]
    return inner, index.ravel()[lattice_triangles(n1, n2)]


def mesh_triangle(sides: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Mesh three sides of n segments each by n * n triangles: inner nodes and triangles.

    Rows run parallel to the first side; its uneven spacing fades out towards the third corner.
    """
    base, right, left = sides[0], sides[1], sides[2][::-1]
    n = len(base) - 1
    straight = base[0] + np.linspace(0.0, 1.0, n + 1)[:, None] * (base[-1] - base[0])
    rows: list[np.ndarray] = []
    labels: list[np.ndarray] = [np.arange(n + 1)]
    used = 3 * n
    for k in range(1, n):
        s = np.linspace(0.0, 1.0, n - k + 1)[1:-1]
        bend = np.stack([np.interp(s, np.linspace(0, 1, n + 1), c) for c in (base - straight).T], 1)
        rows.append(left[k] + s[:, None] * (right[k] - left[k]) + (1 - k / n) * bend)
        labels.append(np.concatenate([[3 * n - k], used + np.arange(len(s)), [n + k]]))
        used += len(s)
    labels.append(np.array([2 * n]))
    up = [np.stack([a[:-1], a[1:], b], 1) for a, b in itertools.pairwise(labels)]
    down = [np.stack([a[1:-1], b[1:], b[:-1]], 1) for a, b in itertools.pairwise(labels)]
    inner = np.concatenate(rows) if rows else np.empty((0, base.shape[1]))
    return inner, np.concatenate(up + down)


def split_sides(corners: Sequence[int], loop: np.ndarray) -> list[np.ndarray]:
    """Return the nodes of each side of a closed loop (k, dim); corners are indices, ascending."""
    closed = np.concatenate([loop, loop])
    ends = [*corners[1:], corners[0] + len(loop)]
    return [closed[a : b + 1] for a, b in zip(corners, ends, strict=True)]


def mesh_mapped(
    loop: np.ndarray, corners: Sequence[int], *, crisscross: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Mesh a closed loop of nodes (k, dim) whose first corner is node 0.

    Raises:
        MeshError: when the number of corners or of segments on the sides does not allow it.
    """
    sides = split_sides(corners, loop)
    counts = [len(side) - 1 for side in sides]
    if len(sides) == 4 and counts[:2] == counts[2:]:
        return mesh_quad(sides, crisscross=crisscross)
    if len(sides) == 3 and len(set(counts)) == 1 and not crisscross:
        return mesh_triangle(sides)
    kind = "criss-cross" if crisscross else "structured"
    raise MeshError(f"no {kind} mesh of {len(sides)} sides with {counts} segments")
