"""The triangles of one rank, each laid flat into its own plane, as a mesh that joins none of them.

Positions are P2 on each element (three corners, then the midpoints of the edges opposite to them),
moments and weights are tensors on each element: nothing is continuous here. What elements share,
they share by the numbering of the unknowns (unknowns.py).
"""

from dataclasses import dataclass

from mpi4py import MPI

import basix.ufl
import numpy as np
from dolfinx import fem, mesh

GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
"""Points of the two-point rule along an edge of unit length."""


FREE, HELD = 0, 1
"""Kinds of sides."""


@dataclass(frozen=True)
class FlatElements:
    """Broken mesh and spaces of n triangles; element c has the nodes 6 c .. 6 c + 5.

    Attributes:
        corners: (n, 3, 2) corners in the plane of each triangle.
        frame: (n, 2, 3) the plane's unit vectors in space.
        area: (n,).
        mesh: broken mesh.
        P: positions, P2 vectors.
        S: symmetric tensors, P1: components 11, 12, 22 at the corners.
        S0: symmetric tensors, constant.
        V0: vectors in space, constant.
        sides: sides by kind as UFL takes them, (kind, flat pairs of element and local edge).
    """

    corners: np.ndarray
    frame: np.ndarray
    area: np.ndarray
    mesh: mesh.Mesh
    P: fem.FunctionSpace
    S: fem.FunctionSpace
    S0: fem.FunctionSpace
    V0: fem.FunctionSpace
    sides: list[tuple[int, np.ndarray]]

    @property
    def edge_vectors(self) -> np.ndarray:
        """Edges opposite to the corners, counter-clockwise, in the planes (n, 3, 2)."""
        return np.roll(self.corners, -2, axis=1) - np.roll(self.corners, -1, axis=1)


def flat_elements(positions: np.ndarray, free: np.ndarray) -> FlatElements:
    """Lay triangles flat.

    Args:
        positions: corners in space (n, 3, 3).
        free: (n, 3) whether a side is of kind FREE, else it is HELD.
    """
    corners, frame = laid_flat(positions)
    n = len(corners)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    element = basix.ufl.element("Lagrange", "triangle", 1, shape=(2,))
    cells = np.arange(3 * n, dtype=np.int64).reshape(-1, 3)
    broken = mesh.create_mesh(MPI.COMM_SELF, cells, corners.reshape(-1, 2).copy(), element)
    kept = np.asarray(broken.topology.original_cell_index)
    if not (kept == np.arange(n)).all():
        raise RuntimeError("dolfinx reordered the elements of a broken mesh")
    linear, constant = (
        basix.ufl.element("DG", "triangle", degree, shape=(2, 2), symmetry=True)
        for degree in (1, 0)
    )
    sides = [
        (kind, np.argwhere(where).astype(np.int32).ravel())
        for kind, where in ((FREE, free), (HELD, ~free))
    ]
    return FlatElements(
        corners,
        frame,
        area,
        broken,
        fem.functionspace(broken, ("DG", 2, (3,))),
        fem.functionspace(broken, linear),
        fem.functionspace(broken, constant),
        fem.functionspace(broken, ("DG", 0, (3,))),
        sides,
    )


def side_elements(positions: np.ndarray, edges: np.ndarray) -> FlatElements:
    """Lay triangles (n, 3, 3) flat of which one side, local edge (n,), is of kind FREE each."""
    free = np.zeros((len(edges), 3), dtype=bool)
    free[np.arange(len(edges)), edges] = True
    return flat_elements(positions, free)


def laid_flat(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Plane coordinates (n, 3, 2) and unit vectors (n, 2, 3) of triangles (n, 3, 3) in space."""
    u, v = positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0]
    first = u / np.linalg.norm(u, axis=1)[:, None]
    second = v - (v * first).sum(axis=1)[:, None] * first
    second /= np.linalg.norm(second, axis=1)[:, None]
    frame = np.stack([first, second], axis=1)
    corners = np.zeros((len(positions), 3, 2))
    corners[:, 1] = np.einsum("ni,nai->na", u, frame)
    corners[:, 2] = np.einsum("ni,nai->na", v, frame)
    return corners, frame
