"""Sums over nodes as UFL integrals: contact and friction, by the nodes' shares of rest area.

A node's share can be integrated by parts in all triangles around it, or whole in one of them. What
depends on the node's place alone is the same either way, and the latter needs a fraction of the
triangles: each serves up to three nodes, six where midpoints move.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem, la
from ufl.core.expr import Expr

from ufl_origami.collective import together
from ufl_origami.terms.form import MIDPOINT_WEIGHTS, SheetFunctions

VERTEX_WEIGHTS = 3 * [1 / 6]
"""Weights of the corners on the reference triangle."""


@dataclass(frozen=True)
class NodalSum:
    """Sum over some nodes, each with its share of rest area.

    Attributes:
        nodes: (nd,) 1 at the local nodes that take part, else 0.
        here: (nd,) whether this rank's integral has contributions of a node.
        weight: factor of the integrand.
        measure: where it is integrated.
    """

    nodes: np.ndarray
    here: np.ndarray
    weight: Expr
    measure: ufl.Measure

    def of(self, density: Expr) -> ufl.Form:
        """The sum of a density per rest area (or of its pairing with a test function)."""
        return self.weight * density * self.measure

    def only_here(self, value: Expr, elsewhere: Expr) -> Expr:
        """A value at the nodes that take part (their weights are at least 1), else another one.

        Zero weights do not silence what is not defined at the other nodes of their triangles.
        """
        return ufl.conditional(ufl.gt(self.weight, 0.5), value, elsewhere)


@dataclass(frozen=True)
class SparseSum(NodalSum):
    """Sum whose nodes are taken in one triangle each.

    Attributes:
        cells: (n,) triangle of each node of `here`, in their order.
        corners: (n,) position of the node in it.
    """

    cells: np.ndarray
    corners: np.ndarray


def full_sum(functions: SheetFunctions, nodes: np.ndarray) -> NodalSum:
    """Sum over nodes (nd,), by parts in all triangles around each."""
    degree = 2 if functions.second_order else 1
    weight = fem.Function(fem.functionspace(functions.sheet.mesh, ("Lagrange", degree)))
    weight.x.array[:] = nodes
    return NodalSum(np.asarray(nodes), nodes.astype(bool), weight, functions.nodal())


def sparse_sum(functions: SheetFunctions, nodes: np.ndarray) -> SparseSum:
    """Sum over nodes (nd,), each in one triangle of the rank that owns the node; collective."""
    sheet, degree = functions.sheet, 2 if functions.second_order else 1
    table = functions.V.dofmap.list[: sheet.num_owned_cells]
    owned = np.arange(len(nodes)) < functions.V.dofmap.index_map.size_local
    wanted = np.asarray(nodes, dtype=bool) & owned
    chosen, cells, corners = covering(table, wanted)
    with together(sheet.comm):
        if len(chosen) != wanted.sum():
            raise RuntimeError("a node has no triangle on the rank that owns it")
    reference = np.array(MIDPOINT_WEIGHTS if functions.second_order else VERTEX_WEIGHTS)
    parts = 2 * reference[corners] * cell_areas(functions, cells)
    weight = fem.Function(fem.functionspace(sheet.mesh, ("DG", degree)))
    places = weight.function_space.dofmap.list[cells, corners]
    weight.x.array[places] = node_areas(functions)[chosen] / parts
    here = np.zeros(len(nodes), dtype=bool)
    here[chosen] = True
    subdomain = [(1, np.unique(cells).astype(np.int32))]
    measure = functions.nodal()(domain=sheet.mesh, subdomain_data=subdomain, subdomain_id=1)
    return SparseSum(np.asarray(nodes), here, weight, measure, cells, corners)


def covering(table: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Few cells that have all wanted nodes, by taking those with most new ones first.

    Args:
        table: (nc, k) nodes of the cells.
        wanted: (nd,) whether a node is looked for.

    Returns:
        The nodes found in ascending order, the cell of each and its position in the cell.
    """
    missing = wanted.copy()
    found: list[tuple[int, int]] = []
    for least in range(table.shape[1], 0, -1):
        candidates = np.flatnonzero(missing[table].sum(axis=1) >= least)
        found += _taken(table, missing, candidates, least)
    if not found:
        return (np.zeros(0, dtype=np.int64),) * 3
    cells, corners = np.array(found).T
    nodes = table[cells, corners]
    order = np.argsort(nodes)
    return nodes[order], cells[order], corners[order]


def _taken(
    table: np.ndarray, missing: np.ndarray, candidates: np.ndarray, least: int
) -> Iterator[tuple[int, int]]:
    """Cell and position of the nodes of cells that still have enough missing ones."""
    for cell in candidates:
        new = np.flatnonzero(missing[table[cell]])
        if len(new) >= least:
            missing[table[cell, new]] = False
            yield from ((cell, position) for position in new)


def cell_areas(functions: SheetFunctions, cells: np.ndarray) -> np.ndarray:
    """Rest areas (n,) of some local cells."""
    corners = functions.sheet.rest[functions.sheet.cells[cells]]
    sides = corners[:, 1:] - corners[:, :1]
    return 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)


def node_areas(functions: SheetFunctions) -> np.ndarray:
    """Rest area (nd,) of each local node; collective."""
    sheet, degree = functions.sheet, 2 if functions.second_order else 1
    areas = fem.Function(fem.functionspace(sheet.mesh, ("Lagrange", degree)))
    table = functions.V.dofmap.list[: sheet.num_owned_cells]
    reference = np.array(MIDPOINT_WEIGHTS if functions.second_order else VERTEX_WEIGHTS)
    parts = 2 * cell_areas(functions, np.arange(len(table)))[:, None] * reference
    np.add.at(areas.x.array, table, parts)
    areas.x.scatter_reverse(la.InsertMode.add)
    areas.x.scatter_forward()
    return areas.x.array
