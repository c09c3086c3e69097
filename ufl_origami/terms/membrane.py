"""Membrane energy of the panels as a UFL form (St. Venant-Kirchhoff, plane stress).

W = int h E / (8 (1 - nu^2)) [nu tr(eps)^2 + (1 - nu) tr(eps^2)] dA, eps = Abar^-1 (A - Abar) with
the rest and current metrics Abar, A in the triangle's covariant basis; on P1 triangles it equals
the kernels' membrane energy to rounding.
"""

import numpy as np
import ufl
from dolfinx import fem

from ufl_origami import compat, kernels
from ufl_origami.configuration import State
from ufl_origami.terms.base import MatrixTerm
from ufl_origami.terms.form import JIT_OPTIONS, SheetFunctions, deformed_jacobian
from ufl_origami.terms.panels import PanelData


def metrics(u):
    """Rest and current metric (2, 2) of a displacement."""
    rest, current = deformed_jacobian(u)
    return rest.T * rest, current.T * current


def stress(u, young, poisson, thickness):
    """Derivative S of the energy density by the metric A, per rest area: dW = S : dA."""
    abar, a = metrics(u)
    inverse = ufl.inv(abar)
    strain = inverse * (a - abar)
    factor = thickness * young / (4 * (1 - poisson**2))
    spherical = poisson * ufl.tr(strain) * ufl.Identity(2)
    return factor * (spherical + (1 - poisson) * strain) * inverse


def metric_change(u, v):
    """First variation (2, 2) of the current metric in a direction v."""
    jacobian, current = deformed_jacobian(u)
    change = current.T * (ufl.grad(v) * jacobian)
    return change + change.T


class MembraneForm(MatrixTerm):
    """Membrane energy by forms, with the stress of the geometric stiffness as a coefficient.

    Args:
        functions: the scene's shared functions.
        panels: elastic data of the cells.
    """

    kinds = ("membrane",)

    def __init__(self, functions: SheetFunctions, panels: PanelData):
        self.functions = functions
        u, space = functions.u, functions.sheet.V
        data = [functions.piecewise(a) for a in (panels.young, panels.poisson, panels.thickness)]
        abar, a = metrics(u)
        s = stress(u, *data)
        v, du = ufl.TestFunction(space), ufl.TrialFunction(space)
        self._sigma = fem.Function(fem.functionspace(functions.sheet.mesh, ("DG", 0, (3,))))
        frozen = ufl.as_matrix(
            [[self._sigma[0], self._sigma[1] / 2], [self._sigma[1] / 2, self._sigma[2]]]
        )
        jacobian, _ = deformed_jacobian(u)
        second = ufl.sym((ufl.grad(du) * jacobian).T * (ufl.grad(v) * jacobian))
        material = ufl.inner(ufl.derivative(s, u, du), metric_change(u, v))
        self._forms = [
            fem.form(form, jit_options=JIT_OPTIONS)
            for form in (
                0.5 * ufl.inner(s, a - abar) * ufl.dx,
                ufl.inner(s, metric_change(u, v)) * ufl.dx,
                (material + 2 * ufl.inner(frozen, second)) * ufl.dx,
            )
        ]
        self._set_elastic(panels)

    def _set_elastic(self, panels: PanelData) -> None:
        """Stiffness of the kernels' stress, per rest area."""
        sheet = self.functions.sheet
        self._cells = np.ascontiguousarray(sheet.cells, dtype=np.int32)
        n = len(self._cells)
        abar, area = np.zeros((n, 3)), np.zeros(n)
        kernels.metrics(sheet.rest, self._cells, abar)
        kernels.areas(sheet.rest, self._cells, area)
        stiffness = kernels.plane_stress_stiffness(
            abar, young=panels.young, poisson=panels.poisson, thickness=panels.thickness
        )
        per_area = stiffness / area[:, None, None]
        self._elastic = kernels.Elastic(per_area, abar, np.zeros((n, 3)), 0 * per_area)

    def energies(self, state: State) -> np.ndarray:
        """This rank's share of the membrane energy."""
        self.functions.set(state)
        return np.array([compat.assemble_scalar(self._forms[0])])

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the energy's gradient."""
        self.functions.set(state)
        compat.add_vector(self._forms[1], out[: 3 * len(state.x)])

    def linearise(self, previous: State | None, current: State) -> None:
        """Stress of the next tangent, exact or extrapolated from the iterate before."""
        sigma = np.zeros((len(self._cells), 3))
        if previous is None:
            kernels.membrane_stress(current.x, self._cells, self._elastic, sigma)
        else:
            step = current.x - previous.x
            kernels.extrapolated_stress(previous.x, step, self._cells, self._elastic, sigma)
        self._sigma.x.array[:] = sigma.ravel()

    def add_tangent(self, state: State, matrix) -> None:
        """Add the material stiffness and the geometric one of the fixed stress."""
        self.functions.set(state)
        compat.add_matrix(self._forms[2], matrix)
