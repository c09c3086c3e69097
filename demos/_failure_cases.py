"""Problems of the failure map, each with its exact answer.

* cantilever: a plate 10 x 4, nu = 0, clamped at x = 0, dead transverse force at x = 10,
  P L^2 / EI = 4; the tip's displacement is that of the inextensible elastica.
* z-fold: two panels pulled apart by d1 = 1, nu = 0; fold angle and pull are those of the elastica.
* closing folds: two flat panels, the left one clamped, nu = 0, whose crease turns by a given angle.
  Turned by the crease's rest angle, both panels stay flat; by a moment M = K_r angle at the outer
  edge, both are arcs of the curvature M / EI; by the outer edge, led along the circle about a
  crease without stiffness, both stay flat. Nothing stops the panels at 180 degrees.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from math import radians

from mpi4py import MPI

import numpy as np
from _failure_meshes import plate

from ufl_origami.analytic import ZFold, ZFoldState, cantilever_end_shear
from ufl_origami.gallery import z_fold
from ufl_origami.gallery.shell_problems import displacement
from ufl_origami.material import Material
from ufl_origami.meshing import mesh_pattern
from ufl_origami.model import Model
from ufl_origami.pattern import CreasePattern
from ufl_origami.scene import Scene
from ufl_origami.sheet import SheetMesh

# %% Parameters
LENGTH, WIDTH, STIFFNESS, LOAD = 10.0, 4.0, 100.0, 4.0  # cantilever: EI and force per width
E, OPENING = 1e7, 1.0  # folds, whose panels are of unit width
MOMENT_ETA = 0.01  # crease that is turned by a moment: the panels bend by 0.12 of its angle


@dataclass(frozen=True)
class Method:
    """A discretisation with the meshes that suit it.

    Attributes:
        name: name in tables and maps.
        model: model of the scene.
        bending: bending form of the ddg model.
        plate: segments along and across the cantilever.
        pulled: segments over a panel of the z-fold.
        closed: segments over a panel of closing folds.
    """

    name: str
    model: str
    bending: str = "director"
    plate: tuple[int, int] = (20, 8)
    pulled: int = 16
    closed: int = 8


@dataclass(frozen=True)
class Setting:
    """What is solved; each attribute is one difficulty.

    Attributes:
        problem: name out of `PROBLEMS`.
        mesh: kind of the cantilever's mesh; folds have one diagonal.
        h: thickness over the cantilever's length or the panels' width.
        eta: crease stiffness K_r W / (E h^3) of z-folds.
        steps: number of equal load steps.
        angle: angle of closing folds (degrees).
    """

    problem: str = "cantilever"
    mesh: str = "one-diagonal"
    h: float = 1e-2
    eta: float = 1.0
    steps: int = 4
    angle: float = 175.0


@dataclass(frozen=True)
class Task:
    """A scene and the distance of its model from the exact answer at load factor 1."""

    scene: Scene
    error: Callable[[Model], float]


@dataclass
class Sheets:
    """Meshes by kind and fineness, each made once; collective.

    Attributes:
        comm: communicator.
        coarser: how much longer all edges are.
    """

    comm: MPI.Comm
    coarser: int = 1
    _made: dict[tuple[str, int], SheetMesh] = field(default_factory=dict)

    def plate(self, kind: str, method: Method) -> SheetMesh:
        """The cantilever's mesh."""
        n = (method.plate[0] // self.coarser, method.plate[1] // self.coarser)
        return self._get(kind, n[0], lambda: plate(kind, (LENGTH, WIDTH), n, self.comm))

    def fold(self, pattern: CreasePattern, segments: int) -> SheetMesh:
        """A pattern with so many segments over a unit width."""
        count = segments // self.coarser
        return self._get(
            pattern.source["frame_title"],
            count,
            lambda: mesh_pattern(pattern, 1 / count, structure="structured", comm=self.comm),
        )

    def _get(self, kind: str, fineness: int, make: Callable[[], SheetMesh]) -> SheetMesh:
        key = (kind, fineness)
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]


def task(setting: Setting, method: Method, sheets: Sheets) -> Task:
    """Scene and error of a setting; collective."""
    return PROBLEMS[setting.problem](setting, method, sheets)


def _scene(sheet: SheetMesh, young: float, thickness: float, method: Method) -> Scene:
    material = Material(young, 0.0, thickness)
    return Scene(sheet, material, bending=method.bending, model=method.model)


def cantilever(setting: Setting, method: Method, sheets: Sheets) -> Task:
    """Distance of the tip from its exact place over its exact displacement."""
    thickness = setting.h * LENGTH
    sheet = sheets.plate(setting.mesh, method)
    scene = _scene(sheet, 12 * STIFFNESS / thickness**3, thickness, method)
    scene.fix("x0")
    scene.clamp("x0")
    scene.line_load("x1", (0.0, 0.0, LOAD))
    tip = cantilever_end_shear(LOAD * LENGTH**2 / STIFFNESS, length=LENGTH)
    exact = np.array([-tip.u, 0.0, tip.w])

    def error(model: Model) -> float:
        return float(np.linalg.norm(displacement(model, "x1y0") - exact) / np.linalg.norm(exact))

    return Task(scene, error)


def pulled_fold(setting: Setting, method: Method, sheets: Sheets) -> Task:
    """Larger of the relative error of the pull and that of the angle over rigid panels' opening."""
    scene = _scene(sheets.fold(z_fold(), method.pulled), E, setting.h, method)
    scene.crease("crease", setting.eta * E * setting.h**3)
    scene.fix("left_edge")
    scene.move("right_edge", x=OPENING, y=0.0, z=0.0)
    exact, opened = opened_fold(setting.eta, setting.h)

    def error(model: Model) -> float:
        pull = model.reaction("right_edge")[0] / exact.force - 1.0
        angle = np.pi - model.mean_fold_angle("crease") - radians(exact.included_angle_deg)
        return float(max(abs(pull), abs(angle) / opened))

    return Task(scene, error)


@cache
def opened_fold(eta: float, h: float) -> tuple[ZFoldState, float]:
    """Exact state of the pulled z-fold, and the angle by which rigid panels would open."""
    fold = ZFold.from_eta(eta, stiffness=E * h**3 / 12)
    return fold.solve(OPENING), fold.rigid_angle(OPENING) - fold.rest_angle


def flat_fold() -> CreasePattern:
    """Two flat unit panels with the crease's end A and the corner "tip" as points."""
    pattern = z_fold(included_angle=180.0)
    names = replace(pattern.names, vertices=(None, "A", "tip", None, None, None))
    return replace(pattern, names=names, source={**pattern.source, "frame_title": "flat fold"})


def _closing(setting: Setting, method: Method, sheets: Sheets) -> Scene:
    scene = _scene(sheets.fold(flat_fold(), method.closed), E, setting.h, method)
    scene.fix("left_edge")
    scene.clamp("left_edge")
    return scene


def _closed_error(angle: float, bend: float) -> Callable[[Model], float]:
    """Error of a closed fold: the largest of those of its angle, of its crease and of its tip.

    Args:
        angle: exact fold angle (radians).
        bend: angle by which each panel turns from end to end.
    """
    crease, slope = _arc(-1.0 + 0.0j, 0.0, bend)
    tip, _ = _arc(crease, slope + angle, bend)

    def error(model: Model) -> float:
        places = [complex(*model.position(name)[[0, 2]]) for name in ("A", "tip")]
        off = np.abs(np.array(places) - [crease, tip])
        return float(max(abs(model.mean_fold_angle("crease") / angle - 1.0), off.max()))

    return error


def _arc(start: complex, slope: float, bend: float) -> tuple[complex, float]:
    """End x + iz and slope of an arc of unit length that turns by `bend`."""
    chord = np.sinc(0.5 * bend / np.pi) * np.exp(1j * (slope + 0.5 * bend))
    return complex(start + chord), slope + bend


def closed_by_rest_angle(setting: Setting, method: Method, sheets: Sheets) -> Task:
    """A crease of eta = 1 whose rest angle grows."""
    scene, angle = _closing(setting, method, sheets), radians(setting.angle)
    scene.crease("crease", E * setting.h**3, rest_angle=lambda time: angle * time)
    return Task(scene, _closed_error(angle, 0.0))


def closed_by_moment(setting: Setting, method: Method, sheets: Sheets) -> Task:
    """A soft crease that a moment turns."""
    scene, angle = _closing(setting, method, sheets), radians(setting.angle)
    stiffness = MOMENT_ETA * E * setting.h**3
    scene.crease("crease", stiffness)
    scene.edge_moment("right_edge", stiffness * angle)
    return Task(scene, _closed_error(angle, 12 * MOMENT_ETA * angle))


def closed_by_edge(setting: Setting, method: Method, sheets: Sheets) -> Task:
    """A hinge turned by its outer edge."""
    scene, angle = _closing(setting, method, sheets), radians(setting.angle)
    scene.crease("crease", 0.0)
    scene.move(
        "right_edge",
        x=lambda time: np.cos(angle * time) - 1.0,
        y=0.0,
        z=lambda time: np.sin(angle * time),
    )
    return Task(scene, _closed_error(angle, 0.0))


PROBLEMS: dict[str, Callable[[Setting, Method, Sheets], Task]] = {
    "cantilever": cantilever,
    "z-fold": pulled_fold,
    "closed by rest angle": closed_by_rest_angle,
    "closed by moment": closed_by_moment,
    "closed by edge": closed_by_edge,
}
