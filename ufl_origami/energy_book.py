"""Energy book of a motion: where energy is, what came in, what was lost, and what does not add up.

Between the states 0 and 1 of a step, with dq = q1 - q0, r the forces that no energy has (follower
loads), R those of the supports, means being those of the values at both ends,

    T1 - T0 + Pi1 - Pi0 = work - losses + imbalance

    work        what moves in time: the mean of Pi(q, t1) - Pi(q, t0) over q0 and q1 (loads, fields,
                rest angles); mean push . way of obstacles; mean r . dq; mean R . dq; what moving
                obstacles give through friction
    damping     mass: force . dq; stiffness: viscous stress . change of strain
    friction    friction force . (dq - the obstacle's way)
    integrator  dq . M a1 - (T1 - T0)
                + Pi0 + work in time - Pi1 + dPi(q1, t1) . dq
                + (mean r - r1) . dq + (mean R - R1) . dq
                + viscous stress . (strain of the chord dq - change of strain)

The integrator's share follows from its own formula: the kinetic part from positions and rates
alone (for implicit Euler it is |v1 - v0|^2_M / 2), the potential part from energies alone, dPi
along the step included (`Term.slope`); without loads that change it is theirs of a step with
constant ones. No elastic force enters it. So the imbalance is the residual of the equations of
motion along the step, with forces taken from the energies: it vanishes to the solver's tolerance,
and does not where a force is not the gradient of its energy.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

import numpy as np

from ufl_origami.errors import InputError
from ufl_origami.history import History
from ufl_origami.motion import Motion
from ufl_origami.problem import Problem
from ufl_origami.solvers.schemes import Formula, Instant, combination

LOSSES = ("integrator", "damping", "friction")
"""Ways in which energy is lost."""


@dataclass
class Account:
    """State of the book.

    Attributes:
        energies: potential energy by kind.
        kinetic: kinetic energy.
        start: total at the start.
        work: work done since then.
        losses: energy lost since then, by the ways of `LOSSES`.
    """

    energies: dict[str, float]
    kinetic: float
    start: float
    work: float = 0.0
    losses: dict[str, float] = field(default_factory=lambda: dict.fromkeys(LOSSES, 0.0))

    @property
    def total(self) -> float:
        """Kinetic and potential energy."""
        return self.kinetic + sum(self.energies.values())

    @property
    def imbalance(self) -> float:
        """What the total differs from the start by, beyond work and losses."""
        return self.total - self.start - self.work + sum(self.losses.values())

    def columns(self) -> dict[str, float]:
        """Columns of the history."""
        return {
            "energy_kinetic": self.kinetic,
            **{f"energy_{kind}": value for kind, value in self.energies.items()},
            "energy_total": self.total,
            "work": self.work,
            **{f"lost_{way}": value for way, value in self.losses.items()},
            "imbalance": self.imbalance,
        }


class EnergyBook:
    """Keeps the account of one motion.

    Args:
        physical: problem of the terms that have an energy or a force in statics, too.
        whole: the problem of the time steps, inertia, damping and friction included.
        motion: masses and rates.
        at: state at the start.

    Attributes:
        account: after the last accepted step.
        scale: largest energy so far, see `reach`.
        reactions: forces of the supports at the end of the last step.
    """

    def __init__(self, physical: Problem, whole: Problem, motion: Motion, at: Instant):
        self.physical, self.whole, self.motion = physical, whole, motion
        self.configuration = physical.configuration
        self._free, self._barriers = (
            Problem(
                physical.configuration,
                [term for term in physical.terms if term.bounded == bounded],
                physical.constraints,
            )
            for bounded in (False, True)
        )
        self._supported = bool(self.configuration.sum(len(whole.constraints.dofs)))
        energies, kinetic = physical.energies(at.q), motion.kinetic_energy(at.v)
        self.account = Account(energies, kinetic, kinetic + sum(energies.values()))
        self.reactions, self._drafted = at.q.duplicate(), at.q.duplicate()
        self._first, self._reacted = energies, False
        self.scale = kinetic

    def memory(self) -> dict:
        """The account and what it refers to, for a checkpoint."""
        return {
            "account": asdict(self.account),
            "first": self._first,
            "scale": self.scale,
            "reacted": self._reacted,
        }

    def recall(self, memory: Mapping) -> None:
        """Go on from the account of an earlier run."""
        self.account = Account(**memory["account"])
        self._first, self.scale = memory["first"], memory["scale"]
        self._reacted = memory["reacted"]

    def draft(self, old: Instant, new: Instant, formula: Formula) -> Account:
        """The account after a step, while the terms stand at its end; collective."""
        account, way = self.account, combination((1.0, new.q), (-1.0, old.q))
        kinetic = self.motion.kinetic_energy(new.v)
        pull = combination((formula.inertia, new.q), (-formula.inertia, formula.target))
        lost = self.motion.product(way, pull) - (kinetic - account.kinetic)
        energies, work, share = self._potentials(old, new, way)
        lost += share
        for mean, last in (self._follower_work(old, new, way), self._support_work(new, way)):
            work, lost = work + mean, lost + mean - last
        losses = {**account.losses, "integrator": account.losses["integrator"] + lost}
        for kind in ("damping", "friction"):
            taken, given, chord = self._dissipated(kind, new, way, old.time)
            losses[kind] += taken
            losses["integrator"] += chord
            work += given
        return Account(energies, kinetic, account.start, account.work + work, losses)

    def _potentials(self, old: Instant, new: Instant, way) -> tuple[dict[str, float], float, float]:
        """Energies at the end of a step, work in time, the integrator's part of the potential."""
        free, barriers, before = self._free, self._barriers, self.account.energies
        for part in (free, barriers):
            part.set_time(old.time)
        touched, behind = barriers.energies(old.q), free.energies(new.q)
        free.set_time(new.time)
        ahead, last = free.energies(old.q), free.energies(new.q)
        first = {kind: before[kind] - touched.get(kind, 0.0) for kind in last}
        work = 0.5 * sum(ahead[k] - first[k] + last[k] - behind[k] for k in last)
        work += self._carried(old, new)
        barriers.set_time(new.time)
        touch = barriers.energies(new.q)
        energies = {kind: last.get(kind, 0.0) + touch.get(kind, 0.0) for kind in before}
        slopes = [*free.slopes(new.q, way).values(), *barriers.slopes(new.q, way).values()]
        share = sum(before[kind] - energies[kind] for kind in before) + sum(slopes)
        return energies, work, work + share

    def _carried(self, old: Instant, new: Instant) -> float:
        """Work that moving bodies do on the terms with bounds over a step."""
        start, end = (self.configuration.state(at.q, at.time) for at in (old, new))
        shares = [term.carried(start, end) for term in self._barriers.terms]
        return float(self.configuration.sum(sum(shares)))

    def _follower_work(self, old: Instant, new: Instant, way) -> tuple[float, float]:
        """Work of forces without energy over a step: their mean, and those at its end."""
        if all(term.conservative for term in self._free.terms):
            return 0.0, 0.0
        last = self._free.work(new.q, way)
        self._free.set_time(old.time)
        first = self._free.work(old.q, way)
        self._free.set_time(new.time)
        return 0.5 * (first + last), last

    def _support_work(self, new: Instant, way) -> tuple[float, float]:
        """Work of the supports over a step: the mean of their forces, and those at its end."""
        if not self._supported:
            return 0.0, 0.0
        dofs = self.whole.constraints.dofs
        moved = way.array_r[dofs]
        self.whole.forces(new.q, self._drafted)
        last = self._drafted.array_r[dofs] @ moved
        first = self.reactions.array_r[dofs] @ moved if self._reacted else last
        first, last = map(float, self.configuration.sum([first, last]))
        return 0.5 * (first + last), last

    def post(self, account: Account) -> None:
        """Adopt the account of an accepted step."""
        self.account = account
        self._drafted.copy(self.reactions)
        self._reacted = True
        self.scale = max(self.scale, self.reach(account))

    def reach(self, account: Account) -> float:
        """Largest energy of an account, potential ones counted from the start.

        A hundredth of those themselves counts, too: a start from rest has no other scale.
        """
        kinds = account.energies.items()
        moved = max((abs(value - self._first[kind]) for kind, value in kinds), default=0.0)
        whole = max((abs(value) for _, value in kinds), default=0.0)
        return max(account.kinetic, moved, 0.01 * whole)

    def loss(self, account: Account) -> float:
        """What the integrator took or gave in the step to an account, over the largest energy."""
        taken = abs(account.losses["integrator"] - self.account.losses["integrator"])
        scale = max(self.scale, self.reach(account))
        return taken / scale if taken > 0 else 0.0

    def _dissipated(self, kind: str, new: Instant, way, since: float) -> tuple[float, ...]:
        """Heat of the terms of one kind over a step, what moving bodies gave, and the chord's."""
        state, configuration = self.whole.state(new.q), self.configuration
        step, lost, given, chord = configuration.to_local(way), 0.0, 0.0, 0.0
        for term in self.whole.terms:
            if term.kinds == (kind,):
                heat, drive = term.heat(state, step), term.drive(state, since)
                lost, given = lost + heat + drive, given + drive
                chord += float(term.slope(state, step).sum()) - heat
        return tuple(map(float, configuration.sum([lost, given, chord])))


def energy_changes(history: History) -> dict[str, np.ndarray]:
    """Energies (n,) by kind, potential ones counted from the start as `EnergyBook.reach` does.

    Raises:
        InputError: the history has no energy book.
    """
    if "imbalance" not in history.columns:
        raise InputError("the history has no energy book: record a motion with energies")
    kinds = [c.removeprefix("energy_") for c in history.columns if c.startswith("energy_")]
    changes = {kind: history[f"energy_{kind}"] for kind in kinds if kind != "total"}
    return {k: v if k == "kinetic" else v - v[0] for k, v in changes.items()}


def balance_error(history: History) -> float:
    """Largest imbalance of a motion over its largest energy; 0 where there is no energy.

    Raises:
        InputError: the history has no energy book.
    """
    scale = max(float(np.abs(values).max()) for values in energy_changes(history).values())
    worst = float(np.abs(history["imbalance"]).max())
    return worst / scale if worst > 0 else 0.0
