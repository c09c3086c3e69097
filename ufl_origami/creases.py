"""Creases as tables: the panels at each crease edge, their rest fold angles, springs between them.

The sides of an edge are ordered by panel. The virtual angle k of an edge is the fold angle between
side 0 and side k; the fold angle between any two sides follows from those linearly.
"""

from dataclasses import dataclass

import numpy as np

from ufl_origami import kernels
from ufl_origami.collective import together
from ufl_origami.configuration import Configuration
from ufl_origami.errors import SceneError
from ufl_origami.sheet import SheetMesh
from ufl_origami.stencils import EdgeSides, fold_angle_name
from ufl_origami.terms.crease import CreaseEdges


@dataclass(frozen=True)
class EdgeFan:
    """Owned edges of one crease, all with the same number m of panels.

    Attributes:
        facets: local facets (n,), owned.
        sides: triangle sides 3 * cell + e of each edge (n, m), ordered by panel.
        panels: panel of each side (m,).
        length: rest length of the edges (n,).
        consistent: (n, m) +1 where a side runs along the edge against side 0 (1 for side 0).
    """

    facets: np.ndarray
    sides: np.ndarray
    panels: np.ndarray
    length: np.ndarray
    consistent: np.ndarray


def edge_fan(sheet: SheetMesh, sides: EdgeSides, name: str) -> EdgeFan:
    """Panels round the owned edges of a named crease.

    Raises:
        SceneError: the crease joins different panels along its length.
    """
    facets = sheet.edge_facets(name)
    facets = facets[facets < sheet.num_owned_edges]
    at = np.flatnonzero(np.isin(sides.facet, facets))
    at = at[np.lexsort((sides.rank[at], sides.facet[at]))]
    counts = np.bincount(sides.facet[at])[facets] if len(facets) else np.zeros(0, int)
    shapes = sheet.comm.allgather(
        {tuple(sheet.cell_panel[at[sides.facet[at] == f] // 3]) for f in facets[:1]}
    )
    panels = np.array(next((p for s in shapes for p in s), (0, 0)), dtype=int)
    with together(sheet.comm):
        if not (counts == len(panels)).all():
            raise SceneError(f"crease {name!r} has {counts} panels along its length: split it")
        table = at.reshape(-1, len(panels))
        if (sheet.cell_panel[table // 3] != panels).any():
            raise SceneError(f"crease {name!r} joins different panels along its length: split it")
    ends = side_ends(sheet, table)
    length = np.linalg.norm(sheet.rest[ends[:, 0, 1]] - sheet.rest[ends[:, 0, 0]], axis=1)
    consistent = np.where(ends[:, :, 0] == ends[:, :1, 1], 1, -1)
    consistent[:, 0] = 1
    return EdgeFan(facets, table, panels, length, consistent)


def side_ends(sheet: SheetMesh, sides: np.ndarray) -> np.ndarray:
    """First and second vertex of sides (...,) in their triangle's orientation: (..., 2)."""
    cell, e = np.divmod(sides, 3)
    return np.stack([sheet.cells[cell, (e + 1) % 3], sheet.cells[cell, (e + 2) % 3]], axis=-1)


def mesh_angles(
    sheet: SheetMesh,
    fan: EdgeFan,
    pair: tuple[int, int],
    x: np.ndarray,
    near: np.ndarray | None = None,
) -> np.ndarray:
    """Dihedral fold angles of the triangles on two sides of a crease's edges.

    Args:
        sheet: the meshed sheet.
        fan: edges of the crease.
        pair: positions of the two sides; the first one's orientation counts.
        x: positions (nv, 3).
        near: angles (n,) by which the branch is chosen (radians), None: within half a turn.

    Returns:
        Angles (n,) in radians, valley positive.
    """
    opposite = sheet.cells.ravel()
    first, second = (fan.sides[:, side] for side in pair)
    verts = np.column_stack([side_ends(sheet, first), opposite[first], opposite[second]])
    n = len(verts)
    angle, near = np.zeros(n), np.zeros(n) if near is None else near
    verts = np.ascontiguousarray(verts, dtype=np.int32)
    kernels.hinge_angles(x, verts, np.zeros((n, 3)), near, angle)
    return angle


def spring_edges(
    fan: EdgeFan, configuration: Configuration, pair: tuple[int, int], rest: np.ndarray
) -> CreaseEdges:
    """Spring between two sides of a fan, its angle in the orientation of the first one's panel.

    Args:
        fan: edges of the crease.
        configuration: numbering of the unknowns.
        pair: positions r, s of the two sides.
        rest: virtual angles (n, m - 1) of the rest state, by which the branch is chosen.
    """
    r, s = pair
    n = len(fan.facets)
    slot, coefficient = np.full((n, 2), -1, dtype=np.int32), np.zeros((n, 2))
    if s == 0:
        signs = [(r, fan.consistent[:, r])]
    elif r == 0:
        signs = [(s, np.ones(n))]
    else:
        signs = [(r, fan.consistent[:, r]), (s, -fan.consistent[:, r])]
    for column, (k, sign) in enumerate(signs):
        slot[:, column] = configuration.slot(fold_angle_name(k))[fan.facets]
        coefficient[:, column] = sign
    constant = np.zeros(n)
    if r and s:
        angle = sum(sign * rest[:, k - 1] for k, sign in signs)
        constant = np.pi - 2 * np.pi * np.ceil(angle / (2 * np.pi))
    return CreaseEdges(fan.length, slot, coefficient, constant)
