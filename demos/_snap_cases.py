"""Sheets whose load has limit points, with what is known of their paths.

The truss is that of two panels between hinges (Saint Venant-Kirchhoff bars): with half span 1,
depth d of the crease and d0 at rest, P / P_limit = 3 sqrt(3) / 2 (d / d0) (1 - (d / d0)^2). The
roofs are the hinged cylindrical ones of Sze, Liu & Lo
2004 (doi:10.1016/j.finel.2003.11.001); their numbers are those of a Kirchhoff-Love solution with
B-splines (degree 4, 18 x 18 elements), as the tests' reference tables have them.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import atan2, degrees, hypot, sqrt

from mpi4py import MPI

from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import roof_quarter
from ufl_origami.meshing import mesh_pattern
from ufl_origami.model import Model
from ufl_origami.scene import Scene

WIDE = 1.5  # load over the limit load at which a truss is inverted


@dataclass(frozen=True)
class Snap:
    """A case.

    Attributes:
        problem: "truss", "roof" or "thin roof".
        steps: equal steps of the solvers without cuts; first step of those with them.
    """

    problem: str = "truss"
    steps: int = 16


@dataclass(frozen=True)
class SnapCase:
    """What is solved and known.

    Attributes:
        make: scene under loads (True) or with the place prescribed instead (False).
        place: displacement of what is loaded, along the load, of a model.
        end: load factor and place of one state beyond all limit points, where the place leads.
        last: load factor at which only a state beyond all limit points is left, where it leads.
        limits: load factors of the limit points in their order.
        reaction: name of what is moved, and how many of its reactions make load factor 1.
    """

    make: Callable[[bool], Scene]
    place: Callable[[Model], float]
    end: tuple[float, float]
    last: float
    limits: tuple[float, ...]
    reaction: tuple[str, float]


@dataclass(frozen=True)
class Truss:
    """Two panels of unit half span, crease below; load factor 1 is the limit load."""

    height: float
    h: float
    depth: float
    n: int
    E: float = field(default=1e4)

    def case(self, model: str, comm: MPI.Comm) -> SnapCase:
        """The case in one discretisation."""
        length, height = hypot(1.0, self.height), self.height
        limit = self.E * self.h * self.depth * (height / length) ** 3 * 2 / (3 * sqrt(3.0))
        way = 2 * height + _beyond(height)

        def make(loaded: bool) -> Scene:
            pattern = z_fold(length, self.depth, 2 * degrees(atan2(1.0, height)))
            sheet = mesh_pattern(pattern, size=length / self.n, comm=comm)
            scene = Scene(sheet, Material(self.E, 0.0, self.h), model=model)
            scene.crease("crease", 0.0)
            scene.fix("left_edge")
            scene.fix("right_edge")
            if loaded:
                scene.line_load("crease", (0.0, 0.0, limit / self.depth))
            else:
                scene.move("crease", z=way)
            return scene

        def place(built: Model) -> float:
            return float(built.position("A")[2]) + height

        return SnapCase(make, place, (WIDE, way), WIDE, (1.0, -1.0), ("crease", limit))


def _beyond(height: float) -> float:
    """How far above its mirror image an inverted truss is under `WIDE`."""
    low, high = height, 3 * height
    for _ in range(100):
        middle = 0.5 * (low + high)
        load = 1.5 * sqrt(3.0) * middle / height * ((middle / height) ** 2 - 1)
        low, high = (middle, high) if load < WIDE else (low, middle)
    return low - height


@dataclass(frozen=True)
class Roof:
    """Quarter of a hinged roof under a central force; load factor 1 is a force of 1000."""

    h: float
    end: tuple[float, float]
    last: float
    limits: tuple[float, float]

    def case(self, model: str, comm: MPI.Comm) -> SnapCase:
        """The case in one discretisation."""
        n, structure = (6, "structured") if model == "fem" else (16, "unstructured")

        def make(loaded: bool) -> Scene:
            sheet = roof_quarter(2540.0, 508.0, 0.1, n, structure=structure, comm=comm)
            scene = Scene(sheet, Material(3102.75, 0.3, self.h), model=model)
            scene.symmetry("sym_x0", "x")
            scene.symmetry("sym_y0", "y")
            scene.fix("straight")
            if loaded:
                scene.point_load("A", (0.0, 0.0, -250.0))
            else:
                scene.move("A", z=-self.end[1])
            return scene

        def place(built: Model) -> float:
            return 2540.0 - float(built.position("A")[2])

        return SnapCase(make, place, self.end, self.last, self.limits, ("A", -250.0))


PROBLEMS = {
    "truss": Truss(0.2, 0.3, 0.5, 2),
    "roof": Roof(12.7, (2.6154924, 27.913591), 2.6154924, (2.225384, 0.510827)),
    "thin roof": Roof(6.35, (-0.16872187, 22.785228), 0.7, (0.584857, -0.386493)),
}
