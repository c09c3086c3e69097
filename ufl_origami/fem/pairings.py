"""The element's functionals and their derivatives by the positions, as arrays over the elements."""

import numpy as np
import ufl
from dolfinx import fem

from ufl_origami.fem import forms
from ufl_origami.fem.elements import FlatElements


class Pairings:
    """The functionals of forms.py with their derivatives, evaluated element by element.

    Args:
        elements: flat triangles.
        rest: (n, 6, 3) positions of the nodes at rest.
    """

    def __init__(self, elements: FlatElements, rest: np.ndarray):
        self.elements = elements
        outward = tuple(fem.Function(elements.V0) for _ in range(3))
        P, S, S0 = elements.P, elements.S, elements.S0
        self.at = forms.Positions(fem.Function(P), fem.Function(P), fem.Function(P), outward)
        for function in (self.at.x, self.at.rest, self.at.base):
            self.place(function, rest)
        self.stresses = forms.Stresses(fem.Function(S), fem.Function(S), fem.Function(S0))
        makers = {
            "curvature": (forms.curvature_pairing, S),
            "angle": (forms.angle_pairing, S),
            "edge": (forms.edge_strain_pairing, S),
            "cell": (forms.cell_strain_pairing, S0),
        }
        tested = {k: f(elements, self.at, ufl.TestFunction(V)) for k, (f, V) in makers.items()}
        du = ufl.TrialFunction(P)
        self._values = {k: forms.compiled(form) for k, form in tested.items()}
        bending = tested["curvature"] + tested["angle"]
        self._rates = {
            "bending": forms.ElementMatrix(ufl.derivative(bending, self.at.x, du)),
            "edge": forms.ElementMatrix(ufl.derivative(tested["edge"], self.at.x, du)),
            "cell": forms.ElementMatrix(ufl.derivative(tested["cell"], self.at.x, du)),
        }
        s = self.stresses
        work = (
            forms.curvature_pairing(elements, self.at, s.moment)
            + forms.angle_pairing(elements, self.at, s.moment)
            + forms.edge_strain_pairing(elements, self.at, s.edge)
            + forms.cell_strain_pairing(elements, self.at, s.cell)
        )
        force = ufl.derivative(work, self.at.x, ufl.TestFunction(P))
        self._force = forms.compiled(force)
        self._stiffness = forms.ElementMatrix(ufl.derivative(force, self.at.x, du))

    @staticmethod
    def place(function: fem.Function, positions: np.ndarray) -> None:
        """Set a position function from (n, 6, 3) nodes."""
        function.x.array[:] = positions.ravel()

    def value(self, name: str) -> np.ndarray:
        """Pairing "curvature", "angle", "edge" (n, 9) or "cell" (n, 3) at the current positions."""
        vector = fem.assemble_vector(self._values[name])
        return vector.array.reshape(len(self.elements.area), -1)

    def rate(self, name: str) -> np.ndarray:
        """Derivative of pairing "bending", "edge" (n, 9, 18) or "cell" (n, 3, 18)."""
        return self._rates[name].blocks()

    def set_stresses(self, moment: np.ndarray, weights: np.ndarray) -> None:
        """Set the coefficients from moments (n, 9) and membrane weights (n, 12)."""
        self.stresses.moment.x.array[:] = moment.ravel()
        self.stresses.edge.x.array[:] = weights[:, :9].ravel()
        self.stresses.cell.x.array[:] = weights[:, 9:].ravel()

    def force(self) -> np.ndarray:
        """Derivative (n, 18) of the pairings with the stresses that are set."""
        return fem.assemble_vector(self._force).array.reshape(-1, 18)

    def geometric(self) -> np.ndarray:
        """Second derivative (n, 18, 18) of the pairings with the stresses that are set."""
        return self._stiffness.blocks()
