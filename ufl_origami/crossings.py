"""Crossings of a mesh: vertices where two straight lines of edges meet, as in criss-cross meshes.

A membrane of constant strain locks there sooner than elsewhere (quality.py).
"""

import numpy as np

from ufl_origami.collective import binned
from ufl_origami.sheet import SheetMesh

#: Length of the sum of two unit vectors that are nearly opposite.
STRAIGHT = 0.05


def crossed(sheet: SheetMesh) -> np.ndarray:
    """Mask (n_owned,) of triangles at a crossing of two nearly straight lines; collective.

    Four triangles meet at such a vertex, and the unit vectors along its four edges cancel, which
    only two pairs of opposite ones can.
    """
    cells = sheet.cells[: sheet.num_owned_cells]
    corners = sheet.rest[cells]
    forward, backward = np.roll(corners, -1, 1) - corners, np.roll(corners, 1, 1) - corners
    along = [v / np.linalg.norm(v, axis=2, keepdims=True) for v in (forward, backward)]
    rows = np.concatenate([along[0] + along[1], np.ones((*cells.shape, 1))], axis=2)
    vertex = sheet.input_vertex[cells]
    found = binned(sheet.comm, vertex.ravel(), rows.reshape(-1, 4), sheet.num_vertices_global)
    straight = np.linalg.norm(found[:, :3], axis=1) < 4 * STRAIGHT  # each edge in two triangles
    return (straight & (found[:, 3] == 4))[vertex].any(axis=1)
