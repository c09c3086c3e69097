"""Terms written in UFL: any functional of the displacement over the sheet's mesh."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem
from ufl.domain import extract_unique_domain

from ufl_origami import compat
from ufl_origami.configuration import Configuration, State
from ufl_origami.sheet import SheetMesh
from ufl_origami.terms.base import MatrixTerm, StencilTerm, Term

JIT_OPTIONS = {"timeout": 300}

MIDPOINT_WEIGHTS = 3 * [1 / 24] + 3 * [3 / 24]
"""Weights of corners and midpoints on the reference triangle: the corner rule on its four parts."""


@dataclass(frozen=True)
class SheetFunctions:
    """What the forms of a scene share.

    Attributes:
        sheet: the meshed sheet (rest state).
        u: displacement, vector function: P1, or P2 where the edges' midpoints move on their own.
        time: load factor or time, a constant.
        dofs: local unknown of each degree of freedom of u.
        lgmap: global unknowns of them, None where they are the first local unknowns.
    """

    sheet: SheetMesh
    u: fem.Function
    time: fem.Constant
    dofs: np.ndarray
    lgmap: PETSc.LGMap | None = None

    @classmethod
    def create(cls, configuration: Configuration) -> "SheetFunctions":
        """Fresh displacement and time for a numbering of the unknowns."""
        sheet = configuration.sheet
        time = fem.Constant(sheet.mesh, np.float64(0.0))
        if not configuration.has_midpoints:
            return cls(sheet, fem.Function(sheet.V), time, np.arange(3 * configuration.nv))
        u = fem.Function(fem.functionspace(sheet.mesh, ("Lagrange", 2, (3,))))
        nodes = u.function_space.dofmap.list
        dofs = np.empty((len(u.x.array) // 3, 3), dtype=np.int64)
        dofs[nodes[:, :3]] = 3 * sheet.cells[:, :, None] + np.arange(3)
        dofs[nodes[:, 3:]] = configuration.middle_dofs(sheet.cell_edges)
        ids = configuration.global_ids[dofs.ravel()]
        return cls(sheet, u, time, dofs.ravel(), PETSc.LGMap().create(ids, comm=sheet.comm))

    @property
    def V(self) -> fem.FunctionSpace:
        """Space of the displacement."""
        return self.u.function_space

    def set(self, state: State) -> None:
        """Copy a state into the functions."""
        self.u.x.array[:] = state.q[self.dofs]
        self.time.value = state.time

    def piecewise(self, values: np.ndarray) -> fem.Function:
        """Function that is constant on each triangle, from local values (nc,) or (nc, 3)."""
        values = np.asarray(values, dtype=float)
        function = fem.Function(fem.functionspace(self.sheet.mesh, ("DG", 0, values.shape[1:])))
        function.x.array[:] = values.ravel()
        return function

    def number(self, value: float | Sequence[float] | np.ndarray) -> fem.Constant:
        """Constant number or vector that no form is compiled anew for."""
        return fem.Constant(self.sheet.mesh, np.asarray(value, dtype=float))

    @property
    def second_order(self) -> bool:
        """Whether the edges' midpoints move on their own."""
        return self.V.element.basix_element.degree > 1

    def field(self) -> fem.Function:
        """Fresh function in the displacement's space."""
        return fem.Function(self.V)

    def nodal(self) -> ufl.Measure:
        """Integral over the rest area by its values at the nodes that move.

        Those are the corners of the triangles, or of the four parts into which midpoints cut each.
        """
        if not self.second_order:
            return ufl.dx(metadata={"quadrature_rule": "vertex", "quadrature_degree": 1})
        points, weights = self.node_points().tolist(), list(MIDPOINT_WEIGHTS)
        rule = {"quadrature_points": points, "quadrature_weights": weights}
        return ufl.dx(metadata={"quadrature_rule": "custom", "quadrature_degree": 1, **rule})

    def node_points(self) -> np.ndarray:
        """Nodes (k, 2) of the reference triangle: corners, then midpoints where they move."""
        return self.V.element.basix_element.points


def deformed_jacobian(u: fem.Function) -> tuple:
    """Reference and current covariant bases as columns, (3, 2) each: J and J + grad(u) J."""
    jacobian = ufl.Jacobian(extract_unique_domain(u))
    return jacobian, jacobian + ufl.dot(ufl.grad(u), jacobian)


def pushed_forward(u: fem.Function, vector):
    """Vector of the rest state in the triangles' planes, carried along by the deformation.

    F v with F = j (J^T J)^-1 J^T; what of v is normal to a triangle is lost.
    """
    jacobian, current = deformed_jacobian(u)
    metric = ufl.dot(jacobian.T, jacobian)
    return ufl.dot(current, ufl.dot(ufl.inv(metric), ufl.dot(jacobian.T, vector)))


class FormSum(Term):
    """Energy and force of a UFL functional of the displacement; how it is linearised is left open.

    Args:
        kind: name under which the energy is booked.
        functions: the scene's shared functions.
        energy: UFL functional of functions.u, or None for a force without energy.
        force: UFL linear form in TestFunction(V) (minus the force); derived from the energy
            where that is given.

    Raises:
        ValueError: neither or both of energy and force are given.
    """

    def __init__(self, kind: str, functions: SheetFunctions, energy=None, force=None):
        if (energy is None) == (force is None):
            raise ValueError(f"term {kind!r}: give an energy or a force, and only one of them")
        self.kinds = (kind,)
        self.conservative = self.symmetric = energy is not None
        self.functions = functions
        self.linear_form = force if energy is None else ufl.derivative(energy, functions.u)
        self._given = energy, force
        self._energy = None if energy is None else compiled(energy)
        self._residual = compiled(self.linear_form)

    def energies(self, state: State) -> np.ndarray:
        """This rank's share of the functional; zero for a force without energy."""
        if self._energy is None:
            return np.zeros(1)
        self.functions.set(state)
        return np.array([compat.assemble_scalar(self._energy)])

    @cached_property
    def _along(self) -> tuple[fem.Function, fem.Form]:
        """A direction, and the functional of the energy's derivative (or minus the work) in it."""
        energy, force = self._given
        direction = self.functions.field()
        if energy is None:
            return direction, compiled(ufl.action(force, direction))
        return direction, compiled(ufl.derivative(energy, self.functions.u, direction))

    def slope(self, state: State, step: np.ndarray) -> np.ndarray:
        """Derivative of the energy along a step (minus the force's work) by a form of its own."""
        direction, form = self._along
        self.functions.set(state)
        direction.x.array[:] = step[self.functions.dofs]
        return np.array([compat.assemble_scalar(form)])

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the assembled linear form to the displacement part of the local values."""
        self.functions.set(state)
        out[self.functions.dofs] += assembled(self._residual, len(self.functions.dofs))


def compiled(form) -> fem.Form:
    """A form, compiled with the time that it needs."""
    return fem.form(form, jit_options=JIT_OPTIONS)


def assembled(form: fem.Form, size: int) -> np.ndarray:
    """This rank's share (size,) of a linear form."""
    out = np.zeros(size)
    compat.add_vector(form, out)
    return out


class DeadForce:
    """Linear form that no displacement changes: assembled where its other data have changed.

    Args:
        term: whose linear form it is.
    """

    def __init__(self, term: FormSum):
        self._form, self._size = term._residual, len(term.functions.dofs)
        functions = [f for f in term.linear_form.coefficients() if f is not term.functions.u]
        self._data = [*functions, *term.linear_form.constants()]
        self._seen: list[np.ndarray] | None = None
        self._values = np.zeros(self._size)

    def values(self) -> np.ndarray:
        """This rank's share (size,)."""
        data = [d.value if isinstance(d, fem.Constant) else d.x.array for d in self._data]
        if self._seen is None or not all(map(np.array_equal, data, self._seen)):
            self._values = assembled(self._form, self._size)
            self._seen = [np.copy(values) for values in data]
        return self._values


class FormTerm(FormSum, MatrixTerm):
    """A UFL energy or force on the displacement; see `FormSum` for the arguments."""

    def __init__(self, kind: str, functions: SheetFunctions, energy=None, force=None):
        super().__init__(kind, functions, energy, force)
        derivative = ufl.derivative(self.linear_form, functions.u)
        tangent = ufl.algorithms.expand_derivatives(derivative)
        self._tangent = None if tangent.empty() else compiled(tangent)
        self._dead = DeadForce(self) if tangent.empty() else None

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the linear form, assembled anew where it may have changed."""
        if self._dead is None:
            super().add_residual(state, out)
            return
        self.functions.time.value = state.time
        out[self.functions.dofs] += self._dead.values()

    def add_tangent(self, state: State, matrix) -> None:
        """Add the assembled derivative of the linear form; nothing for a linear energy."""
        if self._tangent is None:
            return
        self.functions.set(state)
        usual = matrix.getLGMap()
        if self.functions.lgmap is not None:
            matrix.setLGMap(self.functions.lgmap, self.functions.lgmap)
        compat.add_matrix(self._tangent, matrix)
        matrix.setLGMap(*usual)


class NodalFormTerm(FormSum, StencilTerm):
    """A UFL energy or force that is a sum over nodes, each felt by one node alone.

    Its form is integrated by `SheetFunctions.nodal`. The tangent is then a block for each node,
    whose columns are the derivatives in three directions: one vector of all blocks is assembled,
    which is far cheaper than a matrix.

    Args:
        nodes: (nd,) whether each node of the displacement's space takes part.
        kind, functions, energy, force: see `FormSum`.
    """

    def __init__(
        self, nodes: np.ndarray, kind: str, functions: SheetFunctions, energy=None, force=None
    ):
        super().__init__(kind, functions, energy, force)
        self._nodes = functions.dofs.reshape(-1, 3)[nodes.astype(bool)]
        self._places = np.flatnonzero(nodes)
        self._blocks = compiled(self._columns())

    def _columns(self):
        """Linear form whose test functions are the columns (3, 3) of the nodes' derivatives."""
        mesh, element = self.functions.sheet.mesh, self.functions.V.element.basix_element
        space = fem.functionspace(mesh, (element.family.name, element.degree, (3, 3)))
        test, (own,) = ufl.TestFunction(space), self.linear_form.arguments()
        form = 0
        for axis in range(3):
            direction = self.functions.field()
            direction.x.array[axis::3] = 1.0
            column = ufl.derivative(self.linear_form, self.functions.u, direction)
            column = ufl.algorithms.expand_derivatives(column)
            form = form + ufl.replace(column, {own: test[:, axis]})
        return form

    def stencils(self) -> list[np.ndarray]:
        """The nodes' displacements."""
        return [self._nodes.astype(np.int32)]

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the derivative of each node's force."""
        self.functions.set(state)
        values = assembled(self._blocks, 3 * len(self.functions.dofs))
        blocks[0][:] = values.reshape(-1, 3, 3)[self._places]
