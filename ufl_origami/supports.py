"""Whether the conditions of a static model hold every piece of the sheet against rigid motion.

A piece is a set of triangles joined by vertices. Its six infinitesimal rigid motions (t, r), u = t
+ r x (x - c), must each violate a prescribed displacement or turn a clamped edge about itself;
those that do not leave the tangent of the rest state singular. A free translation is never held by
dead loads either, so it is an error; a free turn is held once loads pull, so it is a warning.
Creases without stiffness and contact are not looked at.
"""

import warnings
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from ufl_origami.collective import binned, reduced
from ufl_origami.configuration import spread
from ufl_origami.errors import SceneError, SupportWarning
from ufl_origami.model import Model
from ufl_origami.sheet import SheetMesh
from ufl_origami.sides import side_ends

#: Rigid motions that the conditions resist less than this, of the largest, are free.
FREE = 1e-10


@dataclass(frozen=True)
class Piece:
    """One connected piece and the rigid motions that nothing holds.

    Attributes:
        panels: names of its panels.
        conditions: number of prescribed displacement components and clamped edges on it.
        motions: (k, 6) free motions (t, r) about its centre, lengths over its size.
    """

    panels: tuple[str, ...]
    conditions: int
    motions: np.ndarray

    @property
    def translation(self) -> np.ndarray | None:
        """Unit direction (3,) of a free translation, None where there is none."""
        return _null_direction(self.motions[:, 3:], self.motions[:, :3])

    @property
    def turn(self) -> np.ndarray | None:
        """Unit axis (3,) of a free turn or screw motion, None where there is none."""
        axes = self.motions[:, 3:]
        if not len(axes) or np.linalg.norm(axes) < np.sqrt(FREE):
            return None
        return _pointed(np.linalg.svd(axes)[2][0])


def check_supports(model: Model) -> None:
    """Refuse a static model with a piece that can move freely; collective.

    Warns:
        SupportWarning: a piece can turn as a rigid body where no load pulls.

    Raises:
        SceneError: on all ranks: nothing holds a piece, or not in one direction.
    """
    for piece in pieces(model):
        where = f"panels {', '.join(map(repr, piece.panels))}"
        if not piece.conditions:
            raise SceneError(
                f"{where}: no condition holds them; fix or move a point, edge or panel"
            )
        direction = piece.translation
        if direction is not None:
            raise SceneError(f"{where}: no condition holds them along {_text(direction)}")
        axis = piece.turn
        if axis is not None:
            warnings.warn(
                f"{where}: no condition keeps them from turning about {_text(axis)} as a rigid "
                "body; only loads can (clamp an edge, or fix more vertices)",
                SupportWarning,
                stacklevel=2,
            )


def pieces(model: Model) -> list[Piece]:
    """Connected pieces with their free rigid motions, the same on all ranks; collective."""
    sheet = model.sheet
    piece, count = piece_of_vertices(sheet)
    centre, size = _frames(sheet, piece, count)
    vertices, rows = _displacement_rows(model)
    ends, turns = _clamp_rows(model)
    at = np.concatenate([piece[vertices], piece[ends]])
    place = (sheet.rest[vertices] - centre[piece[vertices]]) / size[piece[vertices]][:, None]
    held = np.vstack(
        [np.hstack([rows, np.cross(place, rows)]), np.hstack([np.zeros_like(turns), turns])]
    )
    gram = binned(sheet.comm, at, held[:, :, None] * held[:, None, :], count)
    conditions = reduced(sheet.comm, np.bincount(at, minlength=count))
    names = _panels_of_pieces(sheet, piece, count)
    return [
        Piece(name, int(n), _null_space(g))
        for name, n, g in zip(names, conditions, gram, strict=True)
    ]


def piece_of_vertices(sheet: SheetMesh) -> tuple[np.ndarray, int]:
    """Piece (nv,) of each local vertex, numbered alike on all ranks, and their number; collective.

    Each rank labels its own cells; labels of one vertex on two ranks are then joined.
    """
    nv, cells = len(sheet.rest), sheet.cells
    rows, cols = cells.ravel(), np.roll(cells, 1, axis=1).ravel()
    graph = sparse.coo_array((np.ones(len(rows), dtype=np.int8), (rows, cols)), shape=(nv, nv))
    count, label = csgraph.connected_components(graph, directed=False)
    counts = sheet.comm.allgather(count)
    mine = label.astype(np.int64) + sum(counts[: sheet.comm.rank])
    owners = spread(sheet.V.dofmap.index_map, mine[: sheet.num_owned_vertices])
    links = np.vstack(sheet.comm.allgather(np.unique(np.column_stack([mine, owners]), axis=0)))
    shape = (sum(counts), sum(counts))
    joined = sparse.coo_array((np.ones(len(links)), tuple(links.T)), shape=shape)
    number, of_label = csgraph.connected_components(joined, directed=False)
    return of_label[mine], int(number)


def _frames(sheet: SheetMesh, piece: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Centre (count, 3) and size (count,) of the pieces' bounding boxes."""
    corners = np.full((2, count, 3), -np.inf)
    np.maximum.at(corners[0], piece, sheet.rest)
    np.maximum.at(corners[1], piece, -sheet.rest)
    high, low = reduced(sheet.comm, corners, MPI.MAX) * np.array([1, -1])[:, None, None]
    return 0.5 * (high + low), np.linalg.norm(high - low, axis=1)


def _displacement_rows(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Owned vertices and unit vectors (n, 3) of the prescribed displacement components."""
    dofs = model.problem.constraints.dofs
    dofs = dofs[dofs < 3 * model.configuration.nv_owned]
    return dofs // 3, np.eye(3)[dofs % 3]


def _clamp_rows(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """One vertex and the unit tangent (n, 3) of each clamped edge of owned cells."""
    ends = side_ends(model.sheet, model.shell.clamped_sides())
    edge = model.sheet.rest[ends[:, 1]] - model.sheet.rest[ends[:, 0]]
    return ends[:, 0], edge / np.linalg.norm(edge, axis=1)[:, None]


def _panels_of_pieces(sheet: SheetMesh, piece: np.ndarray, count: int) -> list[tuple[str, ...]]:
    mask = np.zeros((count, len(sheet.panel_names)), dtype=bool)
    mask[piece[sheet.cells[:, 0]], sheet.cell_panel] = True
    mask = reduced(sheet.comm, mask, MPI.LOR)
    return [tuple(np.array(sheet.panel_names)[row].tolist()) for row in mask]


def _null_space(gram: np.ndarray) -> np.ndarray:
    """Orthonormal rows (k, 6) that a symmetric matrix maps to nearly zero."""
    values, vectors = np.linalg.eigh(gram)
    return vectors[:, values <= FREE * max(values[-1], 1.0)].T


def _null_direction(part: np.ndarray, other: np.ndarray) -> np.ndarray | None:
    """Unit `other` half of a combination of rows whose `part` half vanishes, or None."""
    if not len(part):
        return None
    left, values, _ = np.linalg.svd(part)
    values = np.pad(values, (0, len(left) - len(values)))
    free = left[:, values < np.sqrt(FREE)]
    return _pointed(free[:, 0] @ other) if free.shape[1] else None


def _pointed(direction: np.ndarray) -> np.ndarray:
    """Direction with its largest component positive."""
    direction = direction / np.linalg.norm(direction)
    return direction * np.sign(direction[np.abs(direction).argmax()])


def _text(vector: np.ndarray) -> str:
    return "(" + ", ".join(f"{v:.3g}" for v in np.round(vector, 6) + 0.0) + ")"
