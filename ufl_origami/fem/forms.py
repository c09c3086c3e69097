"""UFL functionals of the shell element, written once; everything else is derived from them.

Each triangle is laid flat into its own plane (see elements.py), so that a form knows two
coordinates and the positions x of the triangle's six nodes in space. A functional pairs a
kinematic quantity with a stress-like coefficient:

* bending: moments m (P1 symmetric tensors) with the second derivatives of x along the normal nu
  inside, int m : (nu . grad grad x), and with the angle a by which nu has turned about the edge
  on the boundary, oint a m_nn. This is the hybridised form of the Hellan-Herrmann-Johnson Koiter
  shell of Neunteufel & Schoeberl 2019 (arXiv:1904.04714);
* membrane: edge weights n (P1) with the tangential Green strain, oint E_tt n_tt, and cell weights
  p (constant) with its mean, int E : p: the moments of the Regge interpolation that cures membrane
  locking (Neunteufel & Schoeberl 2021, arXiv:1907.06232).

The angle a is measured from the normal of a base state x0, carried along by the smallest rotation
that takes the edge's tangent there to the current one: it needs no branch below half a turn of the
edge, and differences between the panels at an edge do not depend on x0.
"""

from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem

from ufl_origami import compat
from ufl_origami.fem.elements import FREE, HELD, FlatElements

JIT_OPTIONS = {"timeout": 300}
EDGE_DEGREE, CELL_DEGREE = 3, 2
"""Quadrature degrees: two Gauss points an edge; three points a triangle."""


def normal(x) -> ufl.core.expr.Expr:
    """Vector normal to the deformed element, not normalised."""
    gradient = ufl.grad(x)
    return ufl.cross(gradient[:, 0], gradient[:, 1])


def unit(v) -> ufl.core.expr.Expr:
    """Vector over its length."""
    return v / ufl.sqrt(ufl.dot(v, v))


def edge_tangent(x) -> ufl.core.expr.Expr:
    """Unit tangent of the deformed boundary, counter-clockwise round the element."""
    n = ufl.FacetNormal(x.function_space.mesh)
    return unit(ufl.dot(ufl.grad(x), ufl.as_vector((-n[1], n[0]))))


def turned(t, start, end) -> ufl.core.expr.Expr:
    """Angle about the unit tangent t from one vector to another, both normal to it."""
    return ufl.atan2(ufl.dot(t, ufl.cross(start, end)), ufl.dot(start, end))


def carried(x, base) -> ufl.core.expr.Expr:
    """Normal of the base state, carried by the smallest rotation between the edge's tangents."""
    t, t0, g = edge_tangent(x), edge_tangent(base), normal(base)
    return g - ufl.dot(g, t) / (1 + ufl.dot(t0, t)) * (t0 + t)


def curvature(x, moment) -> ufl.core.expr.Expr:
    """Moment : second derivatives of the position along the unit normal."""
    second, nu = ufl.grad(ufl.grad(x)), unit(normal(x))
    return sum(moment[i, j] * ufl.dot(second[:, i, j], nu) for i in range(2) for j in range(2))


def green_strain(x, rest) -> ufl.core.expr.Expr:
    """Green strain between two positions of the element, (2, 2)."""
    now, before = ufl.grad(x), ufl.grad(rest)
    return 0.5 * (ufl.dot(now.T, now) - ufl.dot(before.T, before))


@dataclass(frozen=True)
class Stresses:
    """Coefficients that the functionals pair with the kinematics: moments m, weights n and p."""

    moment: ufl.core.expr.Expr
    edge: ufl.core.expr.Expr
    cell: ufl.core.expr.Expr


@dataclass(frozen=True)
class Positions:
    """Positions of the nodes: current, at rest, in the base state of the angles.

    Attributes:
        x, rest, base: P2 vector functions.
    """

    x: fem.Function
    rest: fem.Function
    base: fem.Function


def cells(elements: FlatElements) -> ufl.Measure:
    """Integral over the triangles."""
    return ufl.Measure("dx", domain=elements.mesh, metadata={"quadrature_degree": CELL_DEGREE})


def edges(elements: FlatElements, *kinds: int) -> ufl.Measure:
    """Integral over sides of the triangles, by their kind: see `FlatElements.sides`."""
    measure = ufl.Measure(
        "ds", domain=elements.mesh, subdomain_data=elements.sides,
        metadata={"quadrature_degree": EDGE_DEGREE},
    )  # fmt: skip
    return measure(kinds)


def normal_part(elements: FlatElements, moment):
    """Normal component of a moment on the sides."""
    n = ufl.FacetNormal(elements.mesh)
    return ufl.dot(n, ufl.dot(moment, n))


def angle_pairing(elements: FlatElements, at: Positions, moment):
    """Integral over free sides of the angle times the moment's normal component."""
    angle = turned(edge_tangent(at.x), carried(at.x, at.base), normal(at.x))
    return angle * normal_part(elements, moment) * edges(elements, FREE)


def clamp_pairing(elements: FlatElements, x, outward, moment):
    """The same for sides on which the angle is measured from a prescribed normal, outward x t."""
    t = edge_tangent(x)
    angle = turned(t, ufl.cross(outward, t), normal(x))
    return angle * normal_part(elements, moment) * edges(elements, FREE)


def curvature_pairing(elements: FlatElements, at: Positions, moment):
    """Integral of the curvature inside the elements times the moment."""
    return curvature(at.x, moment) * cells(elements)


def edge_strain_pairing(elements: FlatElements, at: Positions, weight):
    """Integral along the edges of the tangential strain times the weight's."""
    n = ufl.FacetNormal(elements.mesh)
    t = ufl.as_vector((-n[1], n[0]))
    strain = green_strain(at.x, at.rest)
    every = edges(elements, FREE, HELD)
    return ufl.dot(t, ufl.dot(strain, t)) * ufl.dot(t, ufl.dot(weight, t)) * every


def cell_strain_pairing(elements: FlatElements, at: Positions, weight):
    """Integral of the strain times a constant weight."""
    return ufl.inner(green_strain(at.x, at.rest), weight) * cells(elements)


def frame_angle(elements: FlatElements, x, base, outward):
    """Angle about the edge from the normal at a fixed outward tangent to the carried one."""
    t = edge_tangent(x)
    return turned(t, ufl.cross(outward, t), carried(x, base))


def compiled(form) -> fem.Form:
    """Form ready to be assembled."""
    return fem.form(form, jit_options=JIT_OPTIONS)


class ElementMatrix:
    """A bilinear form on spaces that join no elements, assembled to dense blocks.

    Args:
        form: test space of blocks of 3, trial space of P2 positions.
        rows: degrees of freedom of the test space on an element.
    """

    def __init__(self, form, rows: int):
        self._rows = rows
        self._form = compiled(form)
        self._matrix = fem.create_matrix(self._form)

    def blocks(self) -> np.ndarray:
        """Derivatives (n, rows, 18), one block an element."""
        compat.assemble_into(self._matrix, self._form)
        blocks = self._matrix.data.reshape(-1, self._rows // 3, 6, 3, 3)
        return blocks.transpose(0, 1, 3, 2, 4).reshape(-1, self._rows, 18)
