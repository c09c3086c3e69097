"""Which converged states a path may accept.

A converged state can still be wrong: past a tilt of 90 degrees the tilt measure has no meaning, a
triangle may have collapsed, and angles that turn by half a turn or more in one step lose their
branch. Such a state is refused and the step is cut.
"""

from dataclasses import dataclass, field

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from ufl_origami.model import Model
from ufl_origami.stencils import FOLD_ANGLE


@dataclass(frozen=True)
class Limits:
    """Bounds of admissible states.

    Attributes:
        tilt: largest |tilt| of an edge (radians).
        area_ratio: smallest ratio of a triangle's current to its rest area.
        turn: largest change of a virtual fold angle in one step (radians), excluded itself.
    """

    tilt: float = 0.5 * np.pi
    area_ratio: float = 0.1
    turn: float = np.pi


@dataclass(frozen=True)
class Admissible:
    """Check of a trial state against the model's current, last accepted one.

    Attributes:
        model: the model whose `x` the path advances.
        limits: bounds.
    """

    model: Model
    limits: Limits = field(default_factory=Limits)

    def __call__(self, trial: PETSc.Vec) -> str:
        """Why the trial is inadmissible, or an empty string; collective."""
        state = self.model.problem.state(trial)
        shell, comm = self.model.shell, self.model.sheet.comm
        tilt = comm.allreduce(shell.largest_tilt(state), op=MPI.MAX)
        area = comm.allreduce(shell.smallest_area_ratio(state), op=MPI.MIN)
        turn = comm.allreduce(largest_turn(self.model, trial), op=MPI.MAX)
        if not tilt <= self.limits.tilt:
            return f"tilt of {np.degrees(tilt):.1f} deg"
        if not area >= self.limits.area_ratio:
            return f"a triangle shrank to {area:.3g} of its area"
        if not turn < self.limits.turn:
            return f"a fold angle turned by {np.degrees(turn):.1f} deg in one step"
        return self.model.problem.objection(trial)


def largest_turn(model: Model, trial: PETSc.Vec) -> float:
    """Largest change (radians) of this rank's virtual fold angles from the model's state."""
    configuration = model.configuration
    change = np.abs(trial.array_r - model.x.array_r)[3 * configuration.nv_owned :]
    largest = 0.0
    for name in configuration.edge_unknowns:
        if name.startswith(FOLD_ANGLE):
            slot = configuration.slot(name)
            owned = slot[(slot >= 0) & (slot < configuration.ns_owned)]
            largest = max(largest, float(change[owned].max(initial=0.0)))
    return largest
