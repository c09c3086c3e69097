"""Sum of terms under constraints: potential energy, residual and tangent of one scene."""

from collections.abc import Mapping, Sequence
from functools import cached_property

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from ufl_origami.assembly import Tangent
from ufl_origami.configuration import Configuration, State
from ufl_origami.constraints import Constraints
from ufl_origami.terms.base import Rates, Term

Memories = list[dict[str, np.ndarray]]
"""What a rank's terms remember of a state beside its unknowns: values by name for each term."""


class Problem:
    """Owns the terms, the constraints and the matrix; knows no physics.

    Args:
        configuration: numbering of the unknowns.
        terms: contributions to the energy.
        constraints: prescribed unknowns.

    Attributes:
        time: load factor or time to which the terms are set.
        force_scale: largest norm of one term's forces at the last evaluation of `forces`.
    """

    def __init__(
        self, configuration: Configuration, terms: Sequence[Term], constraints: Constraints
    ):
        self.configuration = configuration
        self.terms = list(terms)
        self.constraints = constraints
        self.time = 0.0
        self.force_scale = 0.0
        self._part = configuration.create_vector()

    @cached_property
    def tangent(self) -> Tangent:
        """The matrix, made when it is first needed."""
        return Tangent(self.configuration, self.terms)

    @property
    def moment(self) -> float:
        """Load factor or time at which terms and prescribed unknowns are taken."""
        return self.time

    @property
    def bounded(self) -> bool:
        """Whether a term's energy ends somewhere."""
        return any(term.bounded for term in self.terms)

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is symmetric."""
        return all(term.symmetric for term in self.terms)

    @property
    def conservative(self) -> bool:
        """Whether all forces have an energy."""
        return all(term.conservative for term in self.terms)

    def set_time(self, time: float) -> None:
        """Set loads, rest angles and prescribed normals to a load factor or time."""
        self.time = time
        for term in self.terms:
            term.set_time(self.moment)

    def state(self, vector: PETSc.Vec) -> State:
        """Local view of a vector of unknowns at the current time."""
        return self.configuration.state(vector, self.moment)

    def energies(self, vector: PETSc.Vec) -> dict[str, float]:
        """Energy by kind, summed over ranks."""
        state = self.state(vector)
        return self._by_kind({term: term.energies(state) for term in self.terms})

    def slopes(self, vector: PETSc.Vec, step: PETSc.Vec) -> dict[str, float]:
        """Derivatives of the energies along a step, by kind; see `Term.slope`."""
        state, local = self.state(vector), self.configuration.to_local(step)
        terms = [term for term in self.terms if term.conservative]
        return self._by_kind({term: term.slope(state, local) for term in terms})

    def work(self, vector: PETSc.Vec, step: PETSc.Vec) -> float:
        """Work of the forces without energy, as they are at a vector of unknowns, over a step."""
        state, local = self.state(vector), self.configuration.to_local(step)
        parts = [term.slope(state, local).sum() for term in self.terms if not term.conservative]
        return -float(self.configuration.sum(sum(parts)))

    def _by_kind(self, values: Mapping[Term, np.ndarray]) -> dict[str, float]:
        """Values of terms, one for each of their kinds, summed by kind and over ranks."""
        local: dict[str, float] = {}
        for term, parts in values.items():
            for kind, value in zip(term.kinds, parts, strict=True):
                local[kind] = local.get(kind, 0.0) + value
        total = self.configuration.sum(list(local.values()))
        return dict(zip(local, map(float, total), strict=True))

    def potential(self, vector: PETSc.Vec) -> float:
        """Total potential energy, the loads' share included."""
        return sum(self.energies(vector).values())

    def forces(self, vector: PETSc.Vec, out: PETSc.Vec) -> None:
        """Gradient of the potential without constraints; at a support this is the reaction."""
        state = self.state(vector)
        out.set(0.0)
        norms = [0.0]
        for term in self.terms:
            local = np.zeros(self.configuration.num_local)
            term.add_residual(state, local)
            part = self._part
            part.set(0.0)
            self.configuration.add_to_global(local, part)
            norms.append(part.norm())
            out.axpy(1.0, part)
        self.force_scale = max(norms)

    def residual(self, vector: PETSc.Vec, out: PETSc.Vec) -> None:
        """Gradient of the potential; on prescribed unknowns the distance from their values."""
        self.forces(vector, out)
        dofs = self.constraints.dofs
        out.array_w[dofs] = vector.array_r[dofs] - self.constraints.values(self.moment)

    def linearise(self, previous: PETSc.Vec | None, current: PETSc.Vec) -> None:
        """Fix the stress of the next tangent (see Term.linearise)."""
        before = None if previous is None else self.state(previous)
        now = self.state(current)
        for term in self.terms:
            term.linearise(before, now)

    def stiffness(self, vector: PETSc.Vec) -> PETSc.Mat:
        """Tangent without constraints at a vector of unknowns."""
        return self.tangent.assemble(self.state(vector))

    def constrain(self, matrix: PETSc.Mat, known: PETSc.Vec | None, rhs: PETSc.Vec | None) -> None:
        """Turn the prescribed rows and columns of a tangent into identity.

        Args:
            matrix: the tangent, changed in place.
            known: increments of the prescribed unknowns, moved to the right-hand side.
            rhs: right-hand side, changed in place; both None for zero increments.
        """
        rows = (self.constraints.dofs + self.configuration.offset).astype(PETSc.IntType)
        matrix.zeroRowsColumns(rows, 1.0, known, rhs)

    def round_off(self, vector: PETSc.Vec) -> float:
        """Round-off of the residual, eps max K_ii max |x|, by the tangent without constraints."""
        diagonal = self.tangent.matrix.getDiagonal()
        rest = np.abs(self.configuration.sheet.rest).max(initial=0.0)
        size = self.configuration.comm.allreduce(rest, op=MPI.MAX)
        size += vector.norm(PETSc.NormType.INFINITY)
        return float(np.finfo(float).eps * diagonal.norm(PETSc.NormType.INFINITY) * size)

    def largest_turn(self, vector: PETSc.Vec, trial: PETSc.Vec) -> float:
        """Largest change (radians, to first order) of an unwrapped angle between two states."""
        state = self.state(vector)
        step = self.configuration.to_local(trial) - state.q
        largest = max((term.largest_turn(state, step) for term in self.terms), default=0.0)
        return self.configuration.comm.allreduce(largest, op=MPI.MAX)

    def begin_step(self, rates: Rates) -> None:
        """Hand the rates of a time step to the terms."""
        for term in self.terms:
            term.begin_step(rates)

    def longest_step(self, vector: PETSc.Vec, step: PETSc.Vec, since: float | None = None) -> float:
        """Largest part, at most 1, of a step on which all energies stay defined; collective.

        Args:
            vector: where the step starts.
            step: increments.
            since: time at its start, default the problem's: what moves in time moves as well.
        """
        state = self.configuration.state(vector, self.time if since is None else since)
        local = self.configuration.to_local(step)
        parts = [term.longest_step(state, local) for term in self.terms if term.bounded]
        return self.configuration.comm.allreduce(min(parts, default=1.0), op=MPI.MIN)

    def objection(self, vector: PETSc.Vec) -> str:
        """Why a term refuses a converged state, or an empty string; collective."""
        state = self.state(vector)
        return next(filter(None, [term.objection(state) for term in self.terms]), "")

    def suspicions(self, vector: PETSc.Vec) -> list[str]:
        """What may keep steps from an accepted state from converging; collective."""
        state = self.state(vector)
        return list(filter(None, [term.suspicion(state) for term in self.terms]))

    def accept(self, vector: PETSc.Vec) -> None:
        """Adopt a converged state (branches of the angles)."""
        state = self.state(vector)
        for term in self.terms:
            term.accept(state)

    def memories(self) -> Memories:
        """Copies of what this rank's terms remember of the accepted state, by term."""
        return [
            {name: share.values.copy() for name, share in term.history().items()}
            for term in self.terms
        ]

    def recall(self, memories: Memories) -> None:
        """Give the terms back what they remembered."""
        for term, values in zip(self.terms, memories, strict=True):
            term.restore({name: value.copy() for name, value in values.items()})
