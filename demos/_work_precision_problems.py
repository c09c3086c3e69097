"""Problems of the speed-accuracy study: scenes, what is measured on them, mesh sizes."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from math import pi
from pathlib import Path

from mpi4py import MPI

import numpy as np

from ufl_origami.analytic import ZFold, ZFoldState
from ufl_origami.analytic.reference_tables import read_table
from ufl_origami.gallery import shell_problems as shells
from ufl_origami.gallery import z_fold
from ufl_origami.gather import gather_profile
from ufl_origami.history import Record
from ufl_origami.material import Material
from ufl_origami.meshing import mesh_pattern
from ufl_origami.model import Model
from ufl_origami.run import StaticResult
from ufl_origami.scene import Scene

TABLES = Path(__file__).parents[1] / "tests" / "reference"
ETA = 0.5  # crease stiffness of the Z-fold, K_r W / (E h^3)
OPENING = 1.0  # of the Z-fold, over W
NO_RECORD = Record(energies=False, reactions=(), creases=(), points=(), fields="none")


@dataclass(frozen=True)
class Method:
    """A discretisation.

    Attributes:
        name, title: name among the options, name in charts and texts.
        model, bending: options of the scene.
        measures: tilt measures to choose from; empty: the method has none.
    """

    name: str
    title: str
    model: str
    bending: str
    measures: tuple[str, ...]


METHODS: tuple[Method, ...] = (
    Method("averaged", "DDG averaged", "ddg", "averaged", ("sin", "tan")),
    Method("director", "DDG director", "ddg", "director", ("tan",)),
    Method("fem", "FEM twin", "fem", "director", ()),
)


@dataclass(frozen=True)
class Setting:
    """A mesh, a method and a thickness.

    Attributes:
        n: segments, as the problem counts them.
        mesh: "structured" or "unstructured".
        method: the discretisation.
        measure: tilt measure, or None.
        thickness: thickness over the problem's length.
        comm: communicator.
    """

    n: int
    mesh: str
    method: Method
    measure: str | None
    thickness: float
    comm: MPI.Comm

    @property
    def form(self) -> shells.Form:
        """Mesh and method as the shell benchmarks take them."""
        return shells.Form(self.mesh, self.method.bending, self.method.model, self.comm)


@dataclass(frozen=True)
class Case:
    """A scene that is solved up to load factor 1.

    Attributes:
        scene: the scene.
        size: length of a segment.
        record: what the run has to record.
        errors: result -> relative errors by name; collective.
    """

    scene: Scene
    size: float
    record: Record
    errors: Callable[[StaticResult], dict[str, float]]


@dataclass(frozen=True)
class Problem:
    """A problem of the study.

    Attributes:
        name, title: name among the options, name in charts and texts.
        thicknesses: thickness ratios.
        ratio: what the ratio is called.
        counts: model -> segments of its meshes.
        quick: model -> those of a taste.
        middle: model -> segments of the meshes on which settings are chosen.
        reference: what errors are measured against.
        make: setting -> case; collective.
        table: name of the table, empty where the reference is exact.
    """

    name: str
    title: str
    thicknesses: tuple[float, ...]
    ratio: str
    counts: Mapping[str, tuple[int, ...]]
    quick: Mapping[str, tuple[int, ...]]
    middle: Mapping[str, tuple[int, ...]]
    reference: str
    make: Callable[[Setting], Case]
    table: str = ""

    @property
    def middle_thickness(self) -> float:
        """Thickness ratio at which settings are chosen."""
        return self.thicknesses[len(self.thicknesses) // 2]


def z_fold_case(setting: Setting) -> Case:
    """Z-fold of unit panels pulled apart, EI = 1 and eta = 0.5 at any thickness, nu = 0."""
    h, size = setting.thickness, 1.0 / setting.n
    sheet = mesh_pattern(z_fold(), size, structure=setting.mesh, comm=setting.comm)
    method, young = setting.method, 12.0 / setting.thickness**3
    scene = Scene(
        sheet, Material(young, 0.0, h), method.bending, measure=setting.measure, model=method.model
    )
    scene.crease("crease", ETA * young * h**3)
    scene.fix("left_edge")
    scene.move("right_edge", x=OPENING, y=0.0, z=0.0)
    return Case(scene, size, NO_RECORD, lambda result: z_fold_errors(result.model))


def z_fold_errors(model: Model) -> dict[str, float]:
    """Included angle and pull relative to the elastica, profile relative to W; collective."""
    exact, line = elastica()
    included = pi - abs(model.mean_fold_angle("crease"))
    pull = float(model.reaction("right_edge")[0])
    profile = gather_profile(model, "front")
    distance = None if profile is None else profile_distance(*profile, line)
    return {
        "angle": included / exact.included_angle - 1.0,
        "force": pull / exact.force - 1.0,
        "profile": model.sheet.comm.bcast(distance),
    }


@cache
def elastica() -> tuple[ZFoldState, np.ndarray]:
    """Exact state of the Z-fold, and places (n, 2) along both panels: x and depth."""
    exact = ZFold.from_eta(ETA).solve(OPENING)
    left, right = exact.profile(20001)
    return exact, np.concatenate([left, right[-2::-1]])


def profile_distance(rest: np.ndarray, now: np.ndarray, line: np.ndarray) -> float:
    """Largest distance of vertices from the places of the same material points on the elastica.

    Args:
        rest: rest positions (n, 3) along one edge of the sheet, the left outer edge first.
        now: current positions (n, 3).
        line: places (m, 2) along the elastica.
    """
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rest, axis=0), axis=1))])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    along *= arc[-1] / along[-1]  # chords are shorter than arcs by 1e-9
    x, depth = (np.interp(arc, along, line[:, i]) for i in (0, 1))
    off = np.stack([now[:, 0] - now[0, 0] - x, now[:, 2] - now[0, 2] + depth], axis=1)
    return float(np.linalg.norm(off, axis=1).max())


def shell_case(problem: shells.ShellProblem, setting: Setting, size: float) -> Case:
    """A shell benchmark, against its exact solution or the Kirchhoff-Love table."""
    problem.scene.measure = setting.measure or problem.scene.measure

    def errors(result: StaticResult) -> dict[str, float]:
        if problem.exact:
            found = problem.exact_errors(result.history, (1.0,))
        else:
            found = problem.table_errors(result.history, table(problem.name), (1.0,))
        return {"deflection": max((float(e[0]) for e in found.values()), key=abs)}

    return Case(problem.scene, size, replace(problem.record(), energies=False), errors)


def table(name: str):
    """Kirchhoff-Love table of a shell benchmark."""
    return read_table(TABLES / f"kirchhoff_love_{name}.csv")


def own_check(problem: "Problem") -> float:
    """Relative distance of a problem's table from a coarser computation that its head quotes."""
    found = table(problem.table)
    coarse = [float(text) for text in re.findall(r"\d+\.\d+", found.head["own_check"])]
    fine = [column[-1] for column in found.columns.values()][1:]
    return max(abs(a / b - 1.0) for a, b in zip(coarse, fine, strict=True))


def cantilever_case(setting: Setting) -> Case:
    """Strip 10 x 1 bent by a dead force at its end; n segments along it."""
    counts = setting.n, max(1, round(setting.n / 10))
    problem = shells.cantilever_shear(counts, setting.form, slenderness=setting.thickness)
    return shell_case(problem, setting, 10.0 / setting.n)


def annulus_case(setting: Setting) -> Case:
    """Slit annulus of radii 6 and 10 under a line force on one side of the slit."""
    problem = shells.slit_annular_plate(setting.n, setting.form)
    return shell_case(rescaled(problem, 10.0 * setting.thickness), setting, 4.0 / setting.n)


def hemisphere_case(setting: Setting) -> Case:
    """Quarter of a hemisphere with a hole under alternating radial forces."""
    problem = shells.pinched_hemisphere(setting.n, setting.form)
    return shell_case(rescaled(problem, 10.0 * setting.thickness), setting, 5.0 * pi / setting.n)


def rescaled(problem: shells.ShellProblem, h: float) -> shells.ShellProblem:
    """The problem with another thickness and the same bending stiffness."""
    given = problem.scene.panel_material(problem.scene.sheet.panel_names[0])
    problem.scene.material = Material(given.E * (given.h / h) ** 3, given.nu, h)
    return problem


PROBLEMS = (
    Problem(
        "z_fold",
        "Z-fold",
        (1e-2, 1e-3, 1e-4),
        "h/W",
        {"ddg": (2, 3, 4, 6, 8, 12, 16, 32, 64), "fem": (1, 2, 3, 4, 6, 8, 16)},
        {"ddg": (4, 8, 16), "fem": (1, 2, 4)},
        {"ddg": (16,), "fem": (4,)},
        "the exact elastica",
        z_fold_case,
    ),
    Problem(
        "cantilever",
        "cantilever",
        (1e-2, 1e-3, 1e-4),
        "h/L",
        {"ddg": (3, 5, 10, 20, 40, 80, 160), "fem": (2, 3, 5, 10, 20, 40)},
        {"ddg": (10, 20, 40), "fem": (5, 10)},
        {"ddg": (40,), "fem": (10,)},
        "the exact elastica",
        cantilever_case,
    ),
    Problem(
        "slit_annulus",
        "slit annulus",
        (3e-3,),
        "h/R",
        {"ddg": (3, 4, 6, 8, 12, 16, 24, 32), "fem": (2, 3, 4, 6, 8)},
        {"ddg": (4, 8), "fem": (2, 4)},
        {"ddg": (4, 8), "fem": (2, 4)},
        "a Kirchhoff-Love table",
        annulus_case,
        "slit_annular_plate",
    ),
    Problem(
        "hemisphere",
        "pinched hemisphere",
        (4e-3,),
        "h/R",
        {"ddg": (8, 12, 16, 24, 32, 48, 64, 96), "fem": (3, 4, 6, 8, 12, 16, 24)},
        {"ddg": (8, 16), "fem": (4, 8)},
        {"ddg": (16, 32), "fem": (8,)},
        "a Kirchhoff-Love table",
        hemisphere_case,
        "hemisphere_18deg_hole",
    ),
)
