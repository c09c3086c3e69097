"""Other shells in plain UFL, on the manifold mesh of a flat sheet, of material with nu = 0.

* `hhj`: the Koiter shell of Neunteufel & Schoeberl 2019 (doi:10.1016/j.compstruc.2019.106543) with
  P2 displacements and moments of Hellan, Herrmann & Johnson, solved for together; the angles
  between triangles by interior facet integrals. Three quadrature points of the membrane strain are
  the cheap cure of its locking.
* `hhj_regge`: the same with the membrane strain projected in the L2 sense on Regge elements, by a
  third field. The cure of Neunteufel & Schoeberl 2021 (doi:10.1016/j.cma.2020.113524) interpolates
  instead, by functionals of single edges and elements, as the package's model does.
* `naghdi`: the shear-flexible shell after Hale, Brunetti, Bordas & Maurini 2018
  (doi:10.1016/j.compstruc.2018.08.001): P2 displacements with cubic bubbles, P2 angles of the
  director, partial selective reduced integration (Arnold & Brezzi 1997,
  doi:10.1090/S0025-5718-97-00785-0).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, mesh

from ufl_origami.gallery.shell_problems import ShellProblem
from ufl_origami.scene_parts import LoadFactor

JIT_OPTIONS = {"timeout": 300}
REDUCED, FULL = 2, 4
"""Quadrature degrees: three points a triangle; exact for products of strains at rest."""
SHEAR_FACTOR = 5 / 6
HELD, LOADED = 0, 1
"""Marks of the clamped and the loaded edge."""

VECTOR = basix.ufl.element("Lagrange", "triangle", 2, shape=(3,))
MOMENT = basix.ufl.element("HHJ", "triangle", 1)
STRAIN = basix.ufl.element("Regge", "triangle", 1)
ANGLES = basix.ufl.element("Lagrange", "triangle", 2, shape=(2,))
BUBBLED = basix.ufl.blocked_element(
    basix.ufl.enriched_element(
        [basix.ufl.element("Lagrange", "triangle", 2), basix.ufl.element("Bubble", "triangle", 3)]
    ),
    shape=(3,),
)


@dataclass(frozen=True)
class Strip:
    """A cantilever: clamped at the edge x0, a line load on x1, y0 and y1 free.

    Attributes:
        mesh: tdim 2, gdim 3, flat.
        edges: name of the edge -> facets.
        young, thickness: of the material.
        load: (3,) force per length.
        tip: rest position (3,) at which the displacement is measured.
    """

    mesh: mesh.Mesh
    edges: dict[str, np.ndarray]
    young: fem.Constant
    thickness: fem.Constant
    load: fem.Constant
    tip: np.ndarray

    @classmethod
    def of(cls, problem: ShellProblem) -> "Strip":
        """The strip of `cantilever_shear`, at load factor 1."""
        sheet, material = problem.scene.sheet, problem.scene.material
        (load,) = problem.scene.loads
        values = material.E, material.h, load.function(LoadFactor())(1.0)
        constants = (fem.Constant(sheet.mesh, value) for value in values)
        return cls(sheet.mesh, sheet.edges, *constants, sheet.rest[sheet.point_vertex("x1y0")])

    @cached_property
    def boundary(self) -> ufl.Measure:
        """Integral over the marked edges."""
        facets = np.concatenate([self.edges["x0"], self.edges["x1"]])
        marks = np.where(np.isin(facets, self.edges["x0"]), HELD, LOADED).astype(np.int32)
        order = np.argsort(facets)
        tags = mesh.meshtags(self.mesh, 1, facets[order], marks[order])
        rule = {"quadrature_degree": FULL}
        return ufl.Measure("ds", self.mesh, subdomain_data=tags, metadata=rule)

    def cells(self, degree: int) -> ufl.Measure:
        """Integral over the triangles with a rule of this degree."""
        return ufl.Measure("dx", self.mesh, metadata={"quadrature_degree": degree})

    def unknown(self, *elements) -> fem.Function:
        """Function with one part an element."""
        return fem.Function(fem.functionspace(self.mesh, basix.ufl.mixed_element(elements)))


@dataclass
class Shell:
    """Discrete equations: residual = 0 for the unknown at the load factor.

    Attributes:
        strip: what is solved.
        unknown: displacement and the form's own fields.
        factor: load factor.
        residual, tangent: compiled forms.
        conditions: essential conditions, all zero.
    """

    strip: Strip
    unknown: fem.Function
    factor: fem.Constant
    residual: fem.Form
    tangent: fem.Form
    conditions: list[fem.DirichletBC]

    @classmethod
    def stationary(cls, strip: Strip, unknown, energy, held: dict[int, tuple[str, ...]]) -> "Shell":
        """Equations of a functional without its load; held: part -> edges on which it is zero."""
        factor = fem.Constant(strip.mesh, 0.0)
        work = factor * ufl.dot(strip.load, ufl.split(unknown)[0]) * strip.boundary(LOADED)
        residual = ufl.derivative(energy - work, unknown)
        forms = residual, ufl.derivative(residual, unknown)
        compiled = (fem.form(form, jit_options=JIT_OPTIONS) for form in forms)
        conditions = [
            zero_on(unknown.function_space, part, np.concatenate([strip.edges[e] for e in edges]))
            for part, edges in held.items()
        ]
        return cls(strip, unknown, factor, *compiled, conditions)

    @cached_property
    def displacements(self) -> np.ndarray:
        """Unknowns that are displacements."""
        return np.array(self.unknown.function_space.sub(0).collapse()[1])

    def tip(self) -> np.ndarray:
        """Displacement (3,) of the strip's tip."""
        vertices = fem.functionspace(self.strip.mesh, VECTOR)
        at = np.linalg.norm(vertices.tabulate_dof_coordinates() - self.strip.tip, axis=1).argmin()
        part = fem.Function(vertices)
        part.interpolate(self.unknown.sub(0))
        return part.x.array.reshape(-1, 3)[at]


def zero_on(space: fem.FunctionSpace, part: int, facets: np.ndarray) -> fem.DirichletBC:
    """Zero values of one part of a mixed space on facets."""
    collapsed, _ = space.sub(part).collapse()
    dofs = fem.locate_dofs_topological((space.sub(part), collapsed), 1, facets)
    return fem.dirichletbc(fem.Function(collapsed), dofs, space.sub(part))


@dataclass(frozen=True)
class Surface:
    """The deformed sheet.

    Attributes:
        gradient: deformation gradient (3, 3), zero along the normal at rest.
        strain: Green strain (3, 3).
        normal: unit normal.
    """

    gradient: ufl.core.expr.Expr
    strain: ufl.core.expr.Expr
    normal: ufl.core.expr.Expr

    @classmethod
    def of(cls, strip: Strip, u) -> "Surface":
        """The surface displaced by u."""
        n = ufl.CellNormal(strip.mesh)
        metric = ufl.Identity(3) - ufl.outer(n, n)
        gradient = metric + ufl.grad(u)
        sides = ufl.dot(gradient, ufl.Jacobian(strip.mesh))
        strain = 0.5 * (ufl.dot(gradient.T, gradient) - metric)
        return cls(gradient, strain, unit(ufl.cross(sides[:, 0], sides[:, 1])))


def unit(v):
    """Vector over its length."""
    return v / ufl.sqrt(ufl.dot(v, v))


def turned(t, start, end):
    """Angle about the unit tangent t from one vector to another, both normal to it."""
    return ufl.atan2(ufl.dot(t, ufl.cross(start, end)), ufl.dot(start, end))


def hhj(strip: Strip) -> Shell:
    """Mixed Koiter shell, membrane energy by three points."""
    unknown = strip.unknown(VECTOR, MOMENT)
    u, m = ufl.split(unknown)
    strain = Surface.of(strip, u).strain
    density = 0.5 * strip.young * strip.thickness * ufl.inner(strain, strain)
    return mixed_koiter(strip, unknown, m, density * strip.cells(REDUCED))


def hhj_regge(strip: Strip) -> Shell:
    """Mixed Koiter shell, membrane energy of the strain's projection on Regge elements."""
    unknown = strip.unknown(VECTOR, MOMENT, STRAIN)
    u, m, e = ufl.split(unknown)
    density = strip.young * strip.thickness * ufl.inner(e, Surface.of(strip, u).strain - 0.5 * e)
    return mixed_koiter(strip, unknown, m, density * strip.cells(FULL))


def mixed_koiter(strip: Strip, unknown, m, membrane) -> Shell:
    """Koiter shell of displacements and moments m, given its membrane energy.

    The moments' normal components vanish on free edges; the clamp is an angle on its edge.
    """
    u = ufl.split(unknown)[0]
    surface, rest = Surface.of(strip, u), ufl.CellNormal(strip.mesh)
    across = ufl.FacetNormal(strip.mesh)
    t = unit(ufl.dot(surface.gradient, ufl.cross(rest, across)))
    i, j, k = ufl.indices(3)
    second = ufl.as_tensor(ufl.grad(ufl.grad(u))[k, i, j] * surface.normal[k], (i, j))
    m_nn = ufl.dot(across, ufl.dot(m, across))
    fold = turned(t("+"), surface.normal("-"), surface.normal("+"))
    inside = ufl.Measure("dS", strip.mesh, metadata={"quadrature_degree": FULL})
    compliance = 12 / (strip.young * strip.thickness**3)
    energy = (
        membrane
        + (ufl.inner(m, second) - 0.5 * compliance * ufl.inner(m, m)) * strip.cells(FULL)
        + fold * m_nn("+") * inside
        + turned(t, rest, surface.normal) * m_nn * strip.boundary(HELD)
    )
    return Shell.stationary(strip, unknown, energy, {0: ("x0",), 1: ("x1", "y0", "y1")})


def naghdi(strip: Strip) -> Shell:
    """Shear-flexible shell; its director turns about y, then about x.

    The share h^2 / (h^2 + size^2) of membrane and shear energy is integrated in full, the rest
    with three points.
    """
    unknown = strip.unknown(BUBBLED, ANGLES)
    u, a = ufl.split(unknown)
    surface = Surface.of(strip, u)
    director = ufl.as_vector(
        (ufl.sin(a[0]) * ufl.cos(a[1]), -ufl.sin(a[1]), ufl.cos(a[0]) * ufl.cos(a[1]))
    )
    shear = ufl.dot(surface.gradient.T, director)
    bend = ufl.sym(ufl.dot(surface.gradient.T, ufl.grad(director)))
    h, size = strip.thickness, ufl.Circumradius(strip.mesh)
    share = h**2 / (h**2 + size**2)
    stretch = ufl.inner(surface.strain, surface.strain)
    stiff = 0.5 * strip.young * h * (stretch + 0.5 * SHEAR_FACTOR * ufl.dot(shear, shear))
    energy = (
        share * stiff * strip.cells(FULL)
        + (1 - share) * stiff * strip.cells(REDUCED)
        + strip.young * h**3 / 24 * ufl.inner(bend, bend) * strip.cells(FULL)
    )
    return Shell.stationary(strip, unknown, energy, {0: ("x0",), 1: ("x0",)})


SHELLS: dict[str, Callable[[Strip], Shell]] = {"hhj": hhj, "hhj_regge": hhj_regge, "naghdi": naghdi}
