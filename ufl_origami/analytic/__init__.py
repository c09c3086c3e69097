"""Exact reference solutions: planar elastica, Z-fold in tension, tables of shell problems."""

from ufl_origami.analytic.elastica import TipState, cantilever_end_moment, cantilever_end_shear
from ufl_origami.analytic.z_fold import (
    REST_ANGLE,
    ZFold,
    ZFoldState,
    linear_beam_angle,
    rigid_force,
    ritz_angle,
)

__all__ = [
    "REST_ANGLE",
    "TipState",
    "ZFold",
    "ZFoldState",
    "cantilever_end_moment",
    "cantilever_end_shear",
    "linear_beam_angle",
    "rigid_force",
    "ritz_angle",
]
