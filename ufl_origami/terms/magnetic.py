"""Magnetised panels in a field: -(h / mu_0) int B_r . B_ext dA over the rest area.

B_r is the remanent flux density, carried by the panel: its in-plane part is pushed forward by the
deformation gradient, its normal part follows the unit normal (Zhao et al. 2019,
doi:10.1016/j.jmps.2018.10.008). B_ext is taken at the current position, so that a field that varies
in space pulls as well as turns. Vertices and midpoints only: angles feel nothing.
"""

from collections.abc import Callable
from typing import Any

from mpi4py import MPI

import numpy as np
import ufl
from scipy.constants import mu_0
from ufl.core.expr import Expr

from ufl_origami.collective import reduced
from ufl_origami.errors import SceneError
from ufl_origami.terms.form import FormTerm, SheetFunctions, deformed_jacobian, pushed_forward

IN_PLANE = 1e-12
"""Normal part over the largest remanence that round-off may make."""


def unit_normal(basis: Expr) -> Expr:
    """Unit vector normal to the two columns (3, 2) of a basis."""
    normal = ufl.cross(basis[:, 0], basis[:, 1])
    return normal / ufl.sqrt(ufl.inner(normal, normal))


def leaves_its_panel(functions: SheetFunctions, remanence: np.ndarray) -> bool:
    """Whether any of the vectors (nc, 3) has a part normal to its triangle; collective."""
    sheet = functions.sheet
    corners = sheet.rest[sheet.cells]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    part = np.abs((remanence * normals).sum(axis=1)).max(initial=0.0)
    largest = np.abs(remanence).max(initial=0.0)
    part, largest = reduced(sheet.comm, np.array([part, largest]), MPI.MAX)
    return bool(part > IN_PLANE * largest)


def current_remanence(functions: SheetFunctions, remanence: np.ndarray) -> Expr:
    """Remanent flux density of the panels, (nc, 3) at rest, as the deformation carries it."""
    given = functions.piecewise(remanence)
    carried = pushed_forward(functions.u, given)
    if not leaves_its_panel(functions, remanence):
        return carried
    rest, current = deformed_jacobian(functions.u)
    return carried + ufl.inner(given, unit_normal(rest)) * unit_normal(current)


class MagneticTerm(FormTerm):
    """Energy of all magnetised panels in the scene's field.

    Args:
        functions: the scene's shared functions.
        remanence: (nc, 3) remanent flux density of the local cells (tesla).
        thickness: (nc,) thickness (metre).
        field: flux density (tesla): function of time, giving (3,), or of position and time, a UFL
            vector (3,) of both.
        varies: whether it is the latter.

    Raises:
        SceneError: a field of position that is no UFL vector (3,).
    """

    def __init__(
        self,
        functions: SheetFunctions,
        remanence: np.ndarray,
        thickness: np.ndarray,
        field: Callable[..., Any],
        *,
        varies: bool,
    ):
        self._field = None if varies else field
        self._value = functions.number(np.zeros(3))
        outer: Expr = self._value
        if varies:
            place = ufl.SpatialCoordinate(functions.sheet.mesh) + functions.u
            outer = field(place, functions.time)
            if not isinstance(outer, Expr) or outer.ufl_shape != (3,):
                raise SceneError(f"magnetic field: {outer!r} is no UFL vector of three components")
        density = functions.piecewise(thickness / mu_0)
        moment = current_remanence(functions, remanence)
        degree = (4 if functions.second_order else 2) if varies or functions.second_order else 0
        dx = ufl.dx(metadata={"quadrature_degree": degree})
        super().__init__("magnetic", functions, energy=-density * ufl.inner(moment, outer) * dx)

    def set_time(self, time: float) -> None:
        """Set a uniform field to its value at a time."""
        if self._field is not None:
            self._value.value[:] = self._field(time)
