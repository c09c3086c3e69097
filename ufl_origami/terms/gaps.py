"""Distances of the nodes from a moving obstacle, and how far a step may go before it closes them.

Along a step the nodes move on straight lines in the obstacle's frame. There the distance d from a
convex body is a convex function of the way, so that its tangent bounds it from below; for any
other body the gradient's length of at most one does. Going from bound to bound never crosses the
surface, however fast the step.
"""

import numpy as np
import ufl
from dolfinx import fem

from ufl_origami.errors import SceneError
from ufl_origami.obstacles import Obstacle
from ufl_origami.terms.form import JIT_OPTIONS, SheetFunctions
from ufl_origami.terms.nodes import SparseSum

LEFT = 0.1
"""Share of each gap that a step must leave."""

ADVANCES = 60
"""Bounds that are taken one after the other; the step then ends where the last one was."""

NEGLIGIBLE = 1e-3
"""Bound that is not worth taking, over the way so far."""

STEEP = 1e-6
"""Excess of the gradient's length over 1 that round-off may make."""


class Gaps:
    """Measures the gaps of some nodes.

    Args:
        functions: the scene's shared functions.
        obstacle: the body, described at displacement zero.
        total: sum over the nodes that can touch it, of which each rank measures its own.
    """

    def __init__(self, functions: SheetFunctions, obstacle: Obstacle, total: SparseSum):
        self.functions, self.obstacle = functions, obstacle
        mesh, self._place = functions.sheet.mesh, functions.field()
        x = ufl.variable(ufl.SpatialCoordinate(mesh) + self._place)
        distance = obstacle.distance(x, functions.number)
        slope = ufl.diff(distance, x)
        points = functions.node_points()
        self._distance = fem.Expression(distance, points, jit_options=JIT_OPTIONS)
        self._slope = fem.Expression(slope, points, jit_options=JIT_OPTIONS)
        self._nodes = np.flatnonzero(total.here)
        self._cells, self._corner = total.cells, total.corners
        self._all = self._grouped(slice(None))

    def __len__(self) -> int:
        """Number of this rank's nodes that can touch."""
        return len(self._nodes)

    def at(self, nodes: np.ndarray, some: np.ndarray | None = None) -> np.ndarray:
        """Distances (n,) at displacements (nd, 3) of all nodes in the obstacle's frame.

        Args:
            nodes: displacements less the obstacle's.
            some: rows to be measured, default all.
        """
        return self._evaluate(self._distance, nodes, some, ())

    def slopes(self, nodes: np.ndarray, some: np.ndarray | None = None) -> np.ndarray:
        """Gradients (n, 3) of the distances."""
        return self._evaluate(self._slope, nodes, some, (3,))

    def _grouped(self, some) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cells of some rows, and of each row its cell's position and its corner."""
        cells, row = np.unique(self._cells[some], return_inverse=True)
        return cells.astype(np.int32), row, self._corner[some]

    def _evaluate(self, expression, nodes, some, shape) -> np.ndarray:
        cells, row, corner = self._all if some is None else self._grouped(some)
        if not len(cells):
            return np.zeros((0, *shape))
        self._place.x.array[:] = nodes.ravel()
        values = expression.eval(self.functions.sheet.mesh, cells)
        return values.reshape(len(cells), -1, *shape)[row, corner]

    def check(self, nodes: np.ndarray, shift: np.ndarray, label: str) -> None:
        """Refuse a start inside the obstacle, or a function that is no distance.

        Args:
            nodes: displacements (nd, 3) in the obstacle's frame.
            shift: (3,) displacement of the obstacle.
            label: how the message calls it.

        Raises:
            SceneError: on this rank; the message tells where.
        """
        distance, slope = self.at(nodes), np.linalg.norm(self.slopes(nodes), axis=1)
        if not (np.isfinite(distance).all() and np.isfinite(slope).all()):
            raise SceneError(f"{label}: its distance is not finite at the sheet")
        if (slope > 1 + STEEP).any():
            steep = slope.max()
            raise SceneError(f"{label}: gradient of length {steep:.4g} is that of no distance")
        if (distance <= 0).any():
            deepest = self._nodes[distance.argmin()]
            rest = self.functions.V.tabulate_dof_coordinates()[deepest]
            place = rest + nodes[deepest] + shift
            where = ", ".join(f"{value:.4g}" for value in place)
            raise SceneError(
                f"{label}: the sheet starts {-distance.min():.3g} inside, at ({where})"
            )

    def free_part(self, start: np.ndarray, end: np.ndarray) -> float:
        """Part, at most 1, of a step that leaves a tenth of every gap all the way.

        Args:
            start: displacements (nd, 3) in the obstacle's frame.
            end: those after the whole step.

        Returns:
            The part; 0 where a gap is closed at the start, or the step is not finite.
        """
        gap, way = self.at(start), (end - start)[self._nodes]
        if not ((gap > 0).all() and np.isfinite(way).all()):
            return 0.0
        steepest = (1 + STEEP) * np.linalg.norm(way, axis=1)
        floor, part = LEFT * gap, np.where(steepest <= (1 - LEFT) * gap, 1.0, 0.0)
        going = np.flatnonzero(part < 1.0)
        for _ in range(ADVANCES):
            if not len(going):
                break
            place = start.copy()
            place[self._nodes] += part[:, None] * way
            spare = self.at(place, going) - floor[going]
            fall = steepest[going]
            if self.obstacle.convex:
                fall = -(self.slopes(place, going) * way[going]).sum(axis=1)
            ahead = np.divide(spare, fall, out=np.full(len(going), np.inf), where=fall > 0)
            part[going] = np.minimum(part[going] + np.maximum(ahead, 0.0), 1.0)
            going = going[(part[going] < 1.0) & (ahead > NEGLIGIBLE * part[going])]
        return float(part.min(initial=1.0))
