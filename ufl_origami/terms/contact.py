"""Contact with a rigid obstacle: the barrier's energy at the nodes, by their share of rest area."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from mpi4py import MPI

import numpy as np
import ufl
from dolfinx import fem

from ufl_origami.barrier import Barrier, barrier_energy
from ufl_origami.collective import together
from ufl_origami.configuration import Configuration, State
from ufl_origami.errors import ContactWarning, SolveError
from ufl_origami.obstacles import Obstacle
from ufl_origami.terms.base import Keyed, StencilTerm
from ufl_origami.terms.form import NodalFormTerm, SheetFunctions
from ufl_origami.terms.gaps import Gaps
from ufl_origami.terms.nodes import SparseSum, sparse_sum

CLOSED = 1e-6
"""Gap over the barrier's reach below which a state is refused: the barrier gives way."""

NEARLY_CLOSED = 1e-2
"""Gap over the barrier's reach below which a warning is given."""

Motion = Callable[[float], np.ndarray]


@dataclass(frozen=True)
class Surface:
    """An obstacle as a scene has it.

    Attributes:
        name: its name.
        obstacle: the body.
        barrier: its barrier.
        motion: function of time: displacement (3,).
    """

    name: str
    obstacle: Obstacle
    barrier: Barrier
    motion: Motion

    @property
    def label(self) -> str:
        """How messages call it."""
        return f"obstacle {self.name!r}"


class Touch(NamedTuple):
    """What contact and friction share of one surface.

    Attributes:
        surface: the surface.
        gaps: distances of the nodes that can touch.
        sum: sum over these nodes.
        place: UFL constant, the obstacle's displacement.
    """

    surface: Surface
    gaps: Gaps
    sum: SparseSum
    place: fem.Constant


def touch(functions: SheetFunctions, surface: Surface, nodes: np.ndarray) -> Touch:
    """Distances and functions of a surface for the nodes (nd,) that can touch it; collective."""
    total = sparse_sum(functions, nodes)
    gaps = Gaps(functions, surface.obstacle, total)
    return Touch(surface, gaps, total, functions.number(surface.motion(0.0)))


class ContactTerm(StencilTerm):
    """Barrier between the sheet and one obstacle.

    Args:
        configuration: numbering of the unknowns.
        functions: the scene's shared functions.
        at: surface, nodes, gaps.

    Attributes:
        at: surface, nodes, gaps.
        smallest: smallest accepted gap so far.
    """

    kinds = ("contact",)
    bounded = True

    def __init__(self, configuration: Configuration, functions: SheetFunctions, at: Touch):
        self.configuration, self.functions, self.at = configuration, functions, at
        number, barrier = functions.number, at.surface.barrier
        x = ufl.SpatialCoordinate(functions.sheet.mesh) + functions.u - at.place
        reach = number(barrier.distance)
        gap = at.sum.only_here(at.surface.obstacle.distance(x, number), reach)
        energy = at.sum.of(barrier_energy(gap, number(barrier.stiffness), reach))
        self._form = NodalFormTerm(at.sum.here, "contact", functions, energy=energy)
        self.smallest = self._gap = self._warned = np.inf
        self._place = np.asarray(at.surface.motion(0.0), dtype=float)
        self._seen: tuple[np.ndarray, float] | None = None

    def check(self, state: State) -> None:
        """Refuse a start inside the obstacle; collective.

        Raises:
            SceneError: on all ranks.
        """
        with together(self.configuration.comm):
            here = self._relative(state.q, self._place)
            self.at.gaps.check(here, self._place, self.at.surface.label)

    def set_time(self, time: float) -> None:
        """Move the obstacle to its place at a time."""
        self._place = np.asarray(self.at.surface.motion(time), dtype=float)
        self.at.place.value[:] = self._place

    def _relative(self, q: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Displacements (nd, 3) of the nodes in the obstacle's frame."""
        return q[self.functions.dofs].reshape(-1, 3) - place

    def gap(self, state: State) -> float:
        """Smallest distance of this rank's nodes, inf without any."""
        here = self._relative(state.q, self._place)
        if self._seen is None or not np.array_equal(here, self._seen[0]):
            self._seen = here, float(self.at.gaps.at(here).min(initial=np.inf))
        return self._seen[1]

    def near(self, state: State) -> bool:
        """Whether a node of this rank is within the barrier's reach, or may be.

        A distance changes by no more than its node moves: as long as no node has come far enough
        since they were last measured, they are not measured again.
        """
        reach = self.at.surface.barrier.distance
        if self._seen is not None:
            here = self._relative(state.q, self._place)
            moved = np.linalg.norm(here - self._seen[0], axis=1).max(initial=0.0)
            if self._seen[1] - moved > reach:
                return False
        return self.gap(state) <= reach

    def energies(self, state: State) -> np.ndarray:
        """Energy of this rank's nodes."""
        return self._form.energies(state) if self.near(state) else np.zeros(1)

    def slope(self, state: State, step: np.ndarray) -> np.ndarray:
        """Derivative of the energy along a step; collective where it is compiled."""
        return self._form.slope(state, step)

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Subtract the forces."""
        if self.near(state):
            self._form.add_residual(state, out)

    def add_forecast(self, state: State, since: float, out: np.ndarray) -> None:
        """Subtract the forces to first order in the obstacle's way, which may lead into the sheet.

        They depend on where nodes are in its frame: its way is that of the nodes turned round.
        """
        now = state.time
        way = np.asarray(self.at.surface.motion(now)) - self.at.surface.motion(since)
        self.set_time(since)
        self.add_residual(state, out)
        if way.any():
            (dofs,) = self.stencils()
            blocks = [np.empty((*dofs.shape, 3))]
            self.tangent(state, blocks)
            np.add.at(out, dofs, -blocks[0] @ way)
        self.set_time(now)

    def stencils(self) -> list[np.ndarray]:
        """The nodes that can touch."""
        return self._form.stencils()

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the barrier's stiffness."""
        blocks[0][:] = 0.0
        if self.near(state):
            self._form.tangent(state, blocks)

    def longest_step(self, state: State, step: np.ndarray) -> float:
        """Part of a step that leaves a tenth of every gap.

        The state's own time says where the obstacle is at its start.
        """
        start = self._relative(state.q, np.asarray(self.at.surface.motion(state.time)))
        return self.at.gaps.free_part(start, self._relative(state.q + step, self._place))

    def carried(self, old: State, new: State) -> float:
        """Work that the moving obstacle does over a step on this rank's nodes.

        By the mean of its forces at both ends; at the end the obstacle stands where it was before.
        """
        way = np.asarray(self.at.surface.motion(new.time)) - self.at.surface.motion(old.time)
        if not way.any():
            return 0.0
        return float(0.5 * (self._push(old) + self._push(new)) @ way)

    def _push(self, state: State) -> np.ndarray:
        """Force (3,) on this rank's nodes, the obstacle at the state's time."""
        self.set_time(state.time)
        out = np.zeros(len(state.q))
        self.add_residual(state, out)
        return -out[self.functions.dofs].reshape(-1, 3).sum(axis=0)

    def objection(self, state: State) -> str:
        """Refuse a gap that has closed.

        Raises:
            SolveError: always then, since a shorter step does not make the barrier stronger.
        """
        if weak := self._weakness(state, CLOSED):
            raise SolveError(weak)
        return ""

    def suspicion(self, state: State) -> str:
        """That a gap has nearly closed: the barrier is then too steep for Newton."""
        return self._weakness(state, NEARLY_CLOSED)

    def _weakness(self, state: State, least: float) -> str:
        """What is wrong with a barrier whose gap is no more than a share of its reach."""
        gap = self.configuration.comm.allreduce(self.gap(state), op=MPI.MIN)
        surface, reach = self.at.surface, self.at.surface.barrier.distance
        if gap > least * reach:
            return ""
        return (
            f"{surface.label}: its barrier (stiffness {surface.barrier.stiffness:.4g}, distance "
            f"{reach:.4g}) is too weak for this impact: the gap closed to {gap / reach:.1e} of the "
            "distance; suggest a barrier for the speed of the impact"
        )

    def accept(self, state: State) -> None:
        """Remember the smallest gap."""
        self._gap = self.configuration.comm.allreduce(self.gap(state), op=MPI.MIN)
        self.smallest = min(self.smallest, self._gap)

    def warn(self) -> None:
        """Warn where the last accepted gap is less than half of the last one warned of.

        Warns:
            ContactWarning: the gap is below a hundredth of the barrier's reach.
        """
        reach = self.at.surface.barrier.distance
        if self._gap > min(NEARLY_CLOSED * reach, 0.5 * self._warned):
            return
        self._warned = self._gap
        share = f"{100 * self._gap / reach:.2g} % of the barrier's distance"
        text = f"{self.at.surface.label}: the gap closed to {share}: a stiffer one is due"
        warnings.warn(text, ContactWarning, stacklevel=2)

    def history(self) -> dict[str, Keyed]:
        """Smallest gap, and the last one warned of; the same on all ranks."""
        return {
            "gaps": Keyed(np.zeros(1, dtype=np.int64), np.array([[self.smallest, self._warned]]))
        }

    def restore(self, values: dict[str, np.ndarray]) -> None:
        """Go on from the gaps of an earlier run."""
        self.smallest, self._warned = map(float, values["gaps"][0])
