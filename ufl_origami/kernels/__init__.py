"""Batch kernels of the mid-edge shell: closed forms over plain arrays, no mesh and no PETSc.

Three steps, so that the tilt measure is data and no kernel switches its physics:

    tilts(x, u, stencil, theta_ref, theta, t) MEASURES["tan"](t, s) shell_hessian(x, stencil, s,
    elastic, sigma, energy, g, h)      # or shell_gradient, shell_energy

Outputs are filled in place and may be views, e.g. `values[a:b].reshape(n, k, k)`. Arrays are
C-contiguous float64 and int32: other types compile once more. Lengths, moduli and energies in the
user's consistent units, angles in radians.
"""

from .hinge import (
    HingeStencil,
    hinge_angles,
    hinge_work_energy,
    hinge_work_gradient,
    hinge_work_hessian,
)
from .metric import (
    Elastic,
    altitudes,
    areas,
    extrapolated_stress,
    membrane_stress,
    metrics,
    plane_stress_stiffness,
)
from .scatter import add_at
from .shell import second_form, shell_energy, shell_gradient, shell_hessian
from .tilt import MEASURES, Stencil, sin_measure, tan_measure, tilts

__all__ = [
    "MEASURES",
    "Elastic",
    "HingeStencil",
    "Stencil",
    "add_at",
    "altitudes",
    "areas",
    "extrapolated_stress",
    "hinge_angles",
    "hinge_work_energy",
    "hinge_work_gradient",
    "hinge_work_hessian",
    "membrane_stress",
    "metrics",
    "plane_stress_stiffness",
    "second_form",
    "shell_energy",
    "shell_gradient",
    "shell_hessian",
    "sin_measure",
    "tan_measure",
    "tilts",
]
