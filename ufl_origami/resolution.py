"""Whether the forces of a state stand out from the round-off of its residual.

The residual is known to eps max K_ii max |x| only, K_ii being set by the sheet's stretching. The
moment of a crease, eta E h^3 / W per radian and length, is smaller than the stretching stiffness
E h by eta (h/W)^2: for eta = 1e-6 and h/W = 1e-4 it is lost, and so is the force by which a fold
that is nearly a mechanism resists, while the shape is right. Pulls of a Z-fold (eta from 1e-6, h/W
from 1e-5) are off by up to 1 % where the tolerance is 0.04 of the largest norm of one term's
forces, and by a third or more where it is 1.

A state without forces is no case of this: its creases are stiff enough for the tolerance to be a
small turn of them.
"""

import warnings
from dataclasses import dataclass

import numpy as np

from ufl_origami.errors import RoundOffWarning
from ufl_origami.model import Model
from ufl_origami.scene_parts import CreaseSpec
from ufl_origami.solvers.newton import NewtonSettings

#: Tolerance of the residual over the forces above which these are lost.
SHARE_LIMIT = 0.1
#: Turn of a crease (radians) that the tolerance allows, above which its moment is lost.
TURN_LIMIT = 0.01


@dataclass(frozen=True)
class LostCrease:
    """The softest crease of a state whose forces are lost.

    Attributes:
        name: the crease.
        turn: turn (radians) of one of its edges that the tolerance allows.
        share: tolerance over the largest norm of one term's forces.
    """

    name: str
    turn: float
    share: float


def lost_crease(model: Model) -> LostCrease | None:
    """The crease whose moment is lost in a state whose forces all are; None elsewhere; collective.

    The model's tangent is assembled afresh.
    """
    stiffness = {spec.name: _edge_stiffness(model, spec) for spec in model.scene.creases}
    elastic = {name: value for name, value in stiffness.items() if 0 < value < np.inf}
    if not elastic:
        return None
    problem, forces = model.problem, model.x.duplicate()
    problem.linearise(None, model.x)
    problem.stiffness(model.x)
    tolerance = NewtonSettings().floor * problem.round_off(model.x)
    problem.forces(model.x, forces)
    name = min(elastic, key=lambda crease: elastic[crease])
    turn = tolerance / elastic[name]
    share = tolerance / max(problem.force_scale, np.finfo(float).tiny)
    lost = share > SHARE_LIMIT and turn > TURN_LIMIT
    return LostCrease(name, turn, share) if lost else None


def warn_round_off(model: Model) -> None:
    """Warn (RoundOffWarning, on all ranks) where the state's forces are lost; collective."""
    lost = lost_crease(model)
    if lost is not None:
        text = (
            f"the forces are lost in round-off: the tolerance of the residual is {lost.share:.2g} "
            f"of the largest and lets crease {lost.name!r} turn by {lost.turn:.2g} rad; shape and "
            "fold angles may be right, forces are not (a crease that is so soft beside the "
            "stretching of its panels is a hinge: stiffness 0)"
        )
        warnings.warn(text, RoundOffWarning, stacklevel=3)


def _edge_stiffness(model: Model, spec: CreaseSpec) -> float:
    """Moment per radian of an edge of mean length; collective."""
    time, fan = model.problem.time, model.creases[spec.name].fan
    length, count = model.configuration.sum([fan.length.sum(), len(fan.length)])
    if spec.law is not None:
        angle = np.array([model.mean_fold_angle(spec.name)])
        return float(spec.law(angle, time)[2][0] * length / count)
    value = spec.stiffness(time) if callable(spec.stiffness) else spec.stiffness
    return float(value * length / count)
