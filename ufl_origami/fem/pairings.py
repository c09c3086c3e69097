"""The element's functionals and their derivatives by the positions, as arrays over the elements."""

import numpy as np
import ufl
from dolfinx import fem

from ufl_origami.fem import forms
from ufl_origami.fem.elements import FlatElements


class ClampPairings:
    """The pairing of the angle at sides with a prescribed normal, one element a side.

    Args:
        elements: flat triangles with the clamped side of kind FREE.
        cells: local cells of the sides (n,).

    Attributes:
        x: positions of the nodes.
        outward: prescribed outward tangents.
        moment: moments that `force` and `geometric` pair with.
    """

    def __init__(self, elements: FlatElements, cells: np.ndarray):
        P, S = elements.P, elements.S
        self.cells = cells
        self.x, self.outward, self.moment = map(fem.Function, (P, elements.V0, S))

        def pairing(moment):
            return forms.clamp_pairing(elements, self.x, self.outward, moment)

        du = ufl.TrialFunction(P)
        tested = pairing(ufl.TestFunction(S))
        force = ufl.derivative(pairing(self.moment), self.x, ufl.TestFunction(P))
        self._value, self._force = forms.compiled(tested), forms.compiled(force)
        self._rate = forms.ElementMatrix(ufl.derivative(tested, self.x, du), 9)
        self._stiffness = forms.ElementMatrix(ufl.derivative(force, self.x, du), 18)

    def value(self) -> np.ndarray:
        """Pairing (n, 9) at the current positions."""
        return fem.assemble_vector(self._value).array.reshape(-1, 9)

    def rate(self) -> np.ndarray:
        """Its derivative (n, 9, 18)."""
        return self._rate.blocks()

    def force(self) -> np.ndarray:
        """Derivative (n, 18) of the pairing with the moments that are set."""
        return fem.assemble_vector(self._force).array.reshape(-1, 18)

    def geometric(self) -> np.ndarray:
        """Second derivative (n, 18, 18) of the pairing with the moments that are set."""
        return self._stiffness.blocks()


class Pairings:
    """The functionals of forms.py with their derivatives, evaluated element by element.

    Args:
        elements: flat triangles.
        rest: (n, 6, 3) positions of the nodes at rest.
        clamps: the sides with a prescribed normal, None without any.
    """

    def __init__(self, elements: FlatElements, rest: np.ndarray, clamps: ClampPairings | None):
        self.elements, self.clamps = elements, clamps
        P, S, S0 = elements.P, elements.S, elements.S0
        self.at = forms.Positions(fem.Function(P), fem.Function(P), fem.Function(P))
        self.at.rest.x.array[:] = rest.ravel()
        self.base = rest
        self.place(rest)
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
            "bending": forms.ElementMatrix(ufl.derivative(bending, self.at.x, du), 9),
            "edge": forms.ElementMatrix(ufl.derivative(tested["edge"], self.at.x, du), 9),
            "cell": forms.ElementMatrix(ufl.derivative(tested["cell"], self.at.x, du), 3),
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
        self._stiffness = forms.ElementMatrix(ufl.derivative(force, self.at.x, du), 18)

    def place(self, positions: np.ndarray) -> None:
        """Set the current positions of the nodes (n, 6, 3)."""
        self.at.x.x.array[:] = positions.ravel()
        if self.clamps:
            self.clamps.x.x.array[:] = positions[self.clamps.cells].ravel()

    @property
    def base(self) -> np.ndarray:
        """Nodes (n, 6, 3) of the state whose normals the angles are measured from."""
        return self.at.base.x.array.reshape(-1, 6, 3)

    @base.setter
    def base(self, positions: np.ndarray) -> None:
        self.at.base.x.array[:] = positions.ravel()

    def value(self, name: str) -> np.ndarray:
        """Pairing "curvature", "angle", "edge" (n, 9) or "cell" (n, 3) at the current positions."""
        vector = fem.assemble_vector(self._values[name])
        values = vector.array.reshape(-1, 3 if name == "cell" else 9)
        if self.clamps and name == "angle":
            np.add.at(values, self.clamps.cells, self.clamps.value())
        return values

    def rate(self, name: str) -> np.ndarray:
        """Derivative of pairing "bending", "edge" (n, 9, 18) or "cell" (n, 3, 18)."""
        rates = self._rates[name].blocks()
        if self.clamps and name == "bending":
            np.add.at(rates, self.clamps.cells, self.clamps.rate())
        return rates

    def set_stresses(self, moment: np.ndarray, weights: np.ndarray) -> None:
        """Set the coefficients from moments (n, 9) and membrane weights (n, 12)."""
        self.stresses.moment.x.array[:] = moment.ravel()
        self.stresses.edge.x.array[:] = weights[:, :9].ravel()
        self.stresses.cell.x.array[:] = weights[:, 9:].ravel()
        if self.clamps:
            self.clamps.moment.x.array[:] = moment[self.clamps.cells].ravel()

    def force(self) -> np.ndarray:
        """Derivative (n, 18) of the pairings with the stresses that are set."""
        force = fem.assemble_vector(self._force).array.reshape(-1, 18)
        if self.clamps:
            np.add.at(force, self.clamps.cells, self.clamps.force())
        return force

    def geometric(self) -> np.ndarray:
        """Second derivative (n, 18, 18) of the pairings with the stresses that are set."""
        stiffness = self._stiffness.blocks()
        if self.clamps:
            np.add.at(stiffness, self.clamps.cells, self.clamps.geometric())
        return stiffness
