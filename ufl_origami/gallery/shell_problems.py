"""Benchmark problems of geometrically nonlinear shells, each a scene with its table's columns.

Sze, Liu & Lo 2004, doi:10.1016/j.finel.2003.11.001. Loads grow in proportion to the load factor
and are the tables' largest at 1.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import pi

from mpi4py import MPI

import numpy as np

from ufl_origami.analytic.elastica import TipState, cantilever_end_moment, cantilever_end_shear
from ufl_origami.analytic.reference_tables import ReferenceTable
from ufl_origami.errors import InputError
from ufl_origami.history import History, Record
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import (
    Count,
    cylinder_octant,
    hemisphere_quarter,
    rectangle,
    slit_annulus,
)
from ufl_origami.model import Model
from ufl_origami.run import StaticResult, solve_static
from ufl_origami.scene import Scene
from ufl_origami.solvers.static import StepSettings

Measures = Mapping[str, tuple[str, tuple[float, float, float]]]


@dataclass(frozen=True)
class Form:
    """Mesh and bending form, which the problems leave open.

    Attributes:
        structure: "structured" (one diagonal), "crisscross" or "unstructured".
        bending: "director" or "averaged".
        model: "ddg" or "fem".
        comm: communicator.
    """

    structure: str = "structured"
    bending: str = "director"
    model: str = "ddg"
    comm: MPI.Comm = field(default_factory=lambda: MPI.COMM_WORLD)


FORM = Form()


@dataclass(frozen=True)
class ShellProblem:
    """A scene and what is measured on it.

    Attributes:
        name: name of the problem, as in the tables' file names.
        scene: sheet, supports, loads.
        measures: column of the tables -> (named point, direction (3,)); the measured value is the
            point's displacement along the direction.
        exact: load factor -> exact values of the columns, None where none are known.
        scale: length to which errors are relative, None: the value itself.
    """

    name: str
    scene: Scene
    measures: Measures
    exact: Callable[[float], dict[str, float]] | None = None
    scale: float | None = None

    def exact_errors(self, history: History, stops: Sequence[float]) -> dict[str, np.ndarray]:
        """Relative errors (n,) of the measured columns at n load factors.

        Raises:
            InputError: no exact solution is known, or the history lacks a load factor.
        """
        if self.exact is None:
            raise InputError(f"{self.name}: no exact solution")
        rows = _rows(history["load_factor"], stops)
        exact = [self.exact(load) for load in stops]
        values = {name: np.array([row[name] for row in exact]) for name in self.measures}
        return {
            name: (history[name][rows] - value) / (self.scale or np.abs(value))
            for name, value in values.items()
        }

    def table_errors(
        self, history: History, table: ReferenceTable, stops: Sequence[float]
    ) -> dict[str, np.ndarray]:
        """Relative errors (n,) of the measured columns at n load factors.

        Args:
            history: rows of a run.
            table: load factor, then columns in the order of the measures (names may differ).
            stops: load factors that both have.

        Raises:
            InputError: another number of columns, or a load factor is missing.
        """
        load, *columns = table.columns.values()
        if len(columns) != len(self.measures):
            raise InputError(f"{self.name}: the table has {len(columns)} columns of results")
        rows, entries = _rows(history["load_factor"], stops), _rows(load, stops)
        return {
            name: history[name][rows] / column[entries] - 1.0
            for name, column in zip(self.measures, columns, strict=True)
        }

    def record(self) -> Record:
        """Measured displacements as columns of a history."""
        extra = {
            column: lambda model, point=point, direction=direction: float(
                displacement(model, point) @ np.array(direction)
            )
            for column, (point, direction) in self.measures.items()
        }
        return Record(energies=True, reactions=(), points=(), extra=extra, fields="none")

    def solve(
        self, stops: Sequence[float] = (1.0,), steps: StepSettings | None = None
    ) -> StaticResult:
        """Follow the path from rest through the load factors `stops` (collective).

        Raises:
            SolveError: a step below the smallest size failed.
        """
        return solve_static(self.scene, stops, record=self.record(), steps=steps, progress=False)


def _rows(load: np.ndarray, stops: Sequence[float]) -> np.ndarray:
    """Rows of a load column that hold the load factors `stops`."""
    distance = np.abs(load[:, None] - np.asarray(stops))
    if (distance.min(axis=0) > 1e-9).any():
        raise InputError(f"load factors {list(stops)} are not all among {load.tolist()}")
    return distance.argmin(axis=0)


def displacement(model: Model, point: str) -> np.ndarray:
    """Displacement (3,) of a named point (collective)."""
    vertex = model.sheet.point_vertex(point)
    mine = 0 <= vertex < model.configuration.nv_owned
    positions = model.state.x
    moved = positions[vertex] - model.sheet.rest[vertex] if mine else np.zeros(3)
    return model.configuration.sum(moved)


def cantilever_shear(n: Count, form: Form = FORM, *, slenderness: float = 1e-2) -> ShellProblem:
    """Cantilever under a dead transverse force at its end, P L^2 / EI = 4 at load factor 1.

    Args:
        n: segments along and across; one number counts across.
        form: mesh and bending form.
        slenderness: h / L; EI is that of the table whatever the thickness.
    """
    length, stiffness, load = 10.0, 100.0, 4.0
    scene = _cantilever(n, form, (length, slenderness * length, stiffness))
    scene.line_load("x1", (0.0, 0.0, load))

    def exact(factor: float) -> dict[str, float]:
        return _tip(cantilever_end_shear(factor * load * length**2 / stiffness, length=length))

    return ShellProblem("cantilever_end_shear", scene, _TIP, exact)


def cantilever_moment(n: Count, form: Form = FORM, *, slenderness: float = 1 / 120) -> ShellProblem:
    """Cantilever under an end moment, M L / EI = 2 pi (a full circle) at load factor 1.

    One long side is held in its plane: under this conservative moment (conjugate to the rotation
    about the end edge) the thin strip with GJ = 2 EI buckles sideways at load factor 0.932.

    Args:
        n: segments along and across; one number counts across.
        form: mesh and bending form.
        slenderness: h / L; EI is that of the table whatever the thickness.
    """
    length, stiffness = 12.0, 100.0
    scene = _cantilever(n, form, (length, slenderness * length, stiffness))
    scene.fix("y0", "y")
    scene.edge_moment("x1", 2.0 * pi * stiffness / length)

    def exact(factor: float) -> dict[str, float]:
        return _tip(cantilever_end_moment(2.0 * pi * factor, length=length))

    return ShellProblem("cantilever_end_moment", scene, _TIP, exact, scale=length)


_TIP: Measures = {
    "minus_Ux_tip": ("x1y0", (-1.0, 0.0, 0.0)),
    "Uz_tip": ("x1y0", (0.0, 0.0, 1.0)),
}


def _tip(state: TipState) -> dict[str, float]:
    return {"minus_Ux_tip": state.u, "Uz_tip": state.w}


def _cantilever(n: Count, form: Form, size: tuple[float, float, float]) -> Scene:
    """Strip of unit width with nu = 0, clamped at x = 0; size is length, thickness, EI."""
    length, thickness, stiffness = size
    sheet = rectangle(length, 1.0, n, structure=form.structure, comm=form.comm)
    material = Material(E=12.0 * stiffness / thickness**3, nu=0.0, h=thickness)
    scene = Scene(sheet, material, bending=form.bending, model=form.model)
    scene.fix("x0")
    scene.clamp("x0")
    return scene


def slit_annular_plate(n: Count, form: Form = FORM) -> ShellProblem:
    """Slit annulus, one side of the slit clamped, the other under a dead line force 0.8.

    Args:
        n: segments along the radius and round; one number counts along the radius.
        form: mesh and bending form.
    """
    sheet = slit_annulus(6.0, 10.0, n, structure=form.structure, comm=form.comm)
    scene = Scene(sheet, Material(E=21e6, nu=0.0, h=0.03), bending=form.bending, model=form.model)
    scene.fix("slit_clamped")
    scene.clamp("slit_clamped")
    scene.line_load("slit_loaded", (0.0, 0.0, 0.8))
    up = (0.0, 0.0, 1.0)
    return ShellProblem(
        "slit_annular_plate", scene, {"W_A_inner": ("A", up), "W_B_outer": ("B", up)}
    )


def pinched_hemisphere(n: Count, form: Form = FORM) -> ShellProblem:
    """Quarter of a hemisphere with a hole under alternating radial forces 400 on the equator.

    The loaded points lie in one symmetry plane each: the quarter carries half of each force.

    Args:
        n: segments along the equator and the meridian; one number counts on the equator.
        form: mesh and bending form.
    """
    sheet = hemisphere_quarter(10.0, n, structure=form.structure, comm=form.comm)
    scene = Scene(
        sheet, Material(E=6.825e7, nu=0.3, h=0.04), bending=form.bending, model=form.model
    )
    scene.symmetry("sym_x0", "x")
    scene.symmetry("sym_y0", "y")
    scene.fix("A", "z")
    scene.point_load("A", (200.0, 0.0, 0.0))
    scene.point_load("B", (0.0, -200.0, 0.0))
    measures: Measures = {
        "outward": ("A", (1.0, 0.0, 0.0)),
        "inward": ("B", (0.0, -1.0, 0.0)),
    }
    return ShellProblem("hemisphere_18deg_hole", scene, measures)


def cylinder_pullout(n: Count, form: Form = FORM) -> ShellProblem:
    """Octant of an open cylinder pulled by two opposite forces 40e3 at mid-length.

    A loaded point lies in two symmetry planes: the octant carries a quarter of its force.

    Args:
        n: segments round (a quarter turn) and along; one number counts round.
        form: mesh and bending form.
    """
    sheet = cylinder_octant(4.953, 10.35, n, structure=form.structure, comm=form.comm)
    scene = Scene(
        sheet, Material(E=10.5e6, nu=0.3125, h=0.094), bending=form.bending, model=form.model
    )
    for axis in "xyz":
        scene.symmetry(f"sym_{axis}0", axis)
    scene.point_load("A", (0.0, 0.0, 10e3))
    measures: Measures = {
        "W_A": ("A", (0.0, 0.0, 1.0)),
        "minus_U_B": ("B", (-1.0, 0.0, 0.0)),
        "minus_U_C": ("C", (-1.0, 0.0, 0.0)),
    }
    return ShellProblem("cylinder_open_end_pullout", scene, measures)
