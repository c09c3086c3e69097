"""Which triangles meet at an edge, and how they run along it: topology that all models share."""

from dataclasses import dataclass

import numpy as np

from ufl_origami.collective import together
from ufl_origami.configuration import cells_per_edge
from ufl_origami.errors import SceneError
from ufl_origami.sheet import SheetMesh


@dataclass(frozen=True)
class EdgeSides:
    """Triangle-edge pairs ("sides") of all local cells, flattened as 3 * cell + e.

    Attributes:
        facet: local facet of each side (3 nc,).
        rank: position among the sides of its facet, ordered by panel, then input cell.
        partner: side 0 of the facet, or side 1 seen from side 0 (-1: no other side).
        count: sides of the facet, as its owner counts them.
        consistent: +1 where the partner runs along the edge the other way, else -1.
    """

    facet: np.ndarray
    rank: np.ndarray
    partner: np.ndarray
    count: np.ndarray
    consistent: np.ndarray


def edge_sides(sheet: SheetMesh) -> EdgeSides:
    """Pair up the sides of all local facets, in an order that no partition changes."""
    facet = sheet.cell_edges.ravel()
    panel, cell = np.repeat(sheet.cell_panel, 3), np.repeat(sheet.input_cell, 3)
    order = np.lexsort((cell, panel, facet))
    local_count = np.bincount(facet)
    start = np.concatenate(([0], np.cumsum(local_count)))
    rank = np.empty_like(facet)
    rank[order] = np.arange(len(facet)) - start[facet[order]]
    has_partner = local_count[facet] > 1
    partner = np.full(len(facet), -1)
    seen = np.where(rank == 0, start[facet] + 1, start[facet])[has_partner]
    partner[has_partner] = order[seen]
    first = np.roll(sheet.cells, -1, axis=1).ravel()
    second = np.roll(sheet.cells, -2, axis=1).ravel()
    consistent = np.where(first == second[partner], 1, -1)
    return EdgeSides(facet, rank, partner, cells_per_edge(sheet)[facet], consistent)


def crease_facets(sheet: SheetMesh) -> np.ndarray:
    """Local facets (owned and ghosts) of all creases, sorted."""
    parts = [sheet.edges[name] for name in sheet.creases]
    return np.unique(np.concatenate(parts)) if parts else np.empty(0, dtype=np.int32)


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


def fold_combination(fan: EdgeFan, pair: tuple[int, int]) -> list[tuple[int, np.ndarray]]:
    """Virtual angles k (1 ..) and factors (n,) whose sum is the fold angle between two sides.

    It is that in the orientation of the first side's panel, up to full turns where neither side is
    the fan's first.
    """
    r, s = pair
    if s == 0:
        return [(r, fan.consistent[:, r])]
    if r == 0:
        return [(s, np.ones(len(fan.facets)))]
    return [(r, fan.consistent[:, r]), (s, -fan.consistent[:, r])]


def full_turns(angle: np.ndarray) -> np.ndarray:
    """Multiples of 2 pi, minus pi, that bring a difference of fold angles into (-pi, pi]."""
    return np.pi - 2 * np.pi * np.ceil(angle / (2 * np.pi))
