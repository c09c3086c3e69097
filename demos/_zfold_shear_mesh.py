"""A mesh of the Z-fold that the half-turn about z maps onto itself: it prefers no branch."""

from mpi4py import MPI

import numpy as np

from ufl_origami.gallery import z_fold
from ufl_origami.meshing import MeshOptions, pattern_arrays
from ufl_origami.sheet import SheetMesh
from ufl_origami.sheet_arrays import SheetArrays, build_sheet

IMAGE = {"left_edge": "right_edge", "front": "back", "back": "front"}
"""Edges of the left panel -> what their images are called."""


def half_turn_mesh(width: float, length: float, size: float, comm: MPI.Comm) -> SheetMesh:
    """Nearly equilateral triangles on the left panel, their images on the right; collective."""

    def make() -> SheetArrays:
        arrays = pattern_arrays(z_fold(width, length), MeshOptions(size))
        return doubled(arrays, np.array([0.0, length, 0.0]))

    return build_sheet(comm, make)


def doubled(arrays: SheetArrays, sums: np.ndarray) -> SheetArrays:
    """The left panel and its image x -> sums - x, y -> sums - y, z -> z."""
    left = arrays.panel_names.index("left")
    triangles = arrays.triangles[arrays.panel == left]
    used = np.unique(triangles)
    new = np.full(len(arrays.vertices), -1)
    new[used] = np.arange(len(used))
    x = arrays.vertices[used]
    turned = sums + x * [-1.0, -1.0, 1.0]
    shared = np.unique(new[arrays.edges["crease"]])
    image = len(x) + np.cumsum(~np.isin(np.arange(len(x)), shared)) - 1
    image[shared] = [nearest(x, shared, place) for place in turned[shared]]
    edges = {"crease": new[arrays.edges["crease"]], "front": [], "back": []}
    for name, other in IMAGE.items():
        pairs = new[arrays.edges[name]]
        mine = pairs[(pairs >= 0).all(axis=1)]
        edges[name] = [*edges.get(name, []), *mine]
        edges[other] = [*edges.get(other, []), *image[mine]]
    own = ~np.isin(np.arange(len(x)), shared)
    return SheetArrays(
        vertices=np.concatenate([x, turned[own]]),
        triangles=np.concatenate([new[triangles], image[new[triangles]]]),
        panel=np.repeat([0, 1], len(triangles)),
        panel_names=("left", "right"),
        edges={name: np.array(pairs) for name, pairs in edges.items()},
        creases=("crease",),
        points={name: int(new[vertex]) for name, vertex in arrays.points.items()},
    )


def nearest(x: np.ndarray, some: np.ndarray, place: np.ndarray) -> int:
    """The one of some vertices that lies at a place.

    Raises:
        ValueError: there is none: the crease is not divided symmetrically.
    """
    distance = np.linalg.norm(x[some] - place, axis=1)
    if distance.min() > 1e-9:
        raise ValueError(f"no vertex of the crease lies at {place}")
    return int(some[distance.argmin()])
