"""Problems of classical critical loads, each a scene whose exact critical load factor is 1.

Columns and a column with a crease (Euler), plates and a narrow cantilever under loads in their
plane (Timoshenko & Gere, Theory of Elastic Stability, 1961). All are flat until they buckle.
"""

from dataclasses import dataclass, field
from math import pi

from mpi4py import MPI

import numpy as np
from scipy.optimize import brentq

from ufl_origami.errors import InputError, SolveError
from ufl_origami.gallery.z_fold import z_fold
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.meshing import mesh_pattern
from ufl_origami.paths import PathResult, follow_path
from ufl_origami.scene import Scene
from ufl_origami.solvers.arc import ArcSettings, Event

E = 1e4

EULER = {"cantilever": 0.25 * pi**2, "hinged": pi**2, "clamped": 4 * pi**2}
"""Critical force of a column over EI / L^2, by its ends."""

PLATES = {
    ("pressed", "hinged"): 4.000,
    ("pressed", "clamped"): 10.07,
    ("sheared", "hinged"): 9.32,
    ("sheared", "clamped"): 14.64,
}
"""Critical force per length of a square plate over pi^2 D / b^2, by load and edges."""

BLADE = 4.0126
"""Critical force at the end of a narrow cantilever over sqrt(EI GJ) / L^2."""

TO_CRITICAL = ArcSettings(first=0.5, load=0.6, tolerance=1e-4)
"""Load steps for a flat path to its first bifurcation near 1."""


@dataclass(frozen=True)
class Choice:
    """What the problems leave open.

    Attributes:
        model: "ddg" or "fem".
        n: segments along the shorter side, or along the width of a panel.
        structure: "structured", "crisscross" or "unstructured".
        comm: communicator.
    """

    model: str
    n: int
    structure: str = "unstructured"
    comm: MPI.Comm = field(default_factory=lambda: MPI.COMM_WORLD)

    def rectangle(self, length: float, width: float, stretch: int = 1):
        """Mesh of a rectangle, its segments longer than wide by a factor."""
        count = max(1, round(self.n * length / width / stretch))
        return rectangle(length, width, n=(count, self.n), structure=self.structure, comm=self.comm)


@dataclass(frozen=True)
class CriticalProblem:
    """A scene that buckles.

    Attributes:
        name: name of the problem.
        scene: sheet, supports, loads; the exact critical load factor is 1.
        exact: critical load as a number of the problem.
    """

    name: str
    scene: Scene
    exact: float

    def solve(self, stop: float = 1.1) -> tuple[Event, PathResult]:
        """First bifurcation of the path from rest, and the path (collective).

        Raises:
            SolveError: none up to the load factor `stop`, or a step failed.
        """
        path = follow_path(self.scene, [stop], arc=TO_CRITICAL, progress=False)
        if not path.bifurcations:
            raise SolveError(f"{self.name}: no bifurcation", path.end.load)
        return path.bifurcations[0], path


def column(ends: str, choice: Choice, *, h: float = 0.1) -> CriticalProblem:
    """Strip 10 x 1 pressed along its length; nu = 0.

    Args:
        ends: "cantilever", "hinged" or "clamped".
        choice: model and mesh; segments of the fem model are longer than wide.
        h: thickness.
    """
    _require(ends, EULER)
    length = 10.0
    sheet = choice.rectangle(length, 1.0, stretch=2 if choice.model == "fem" else 1)
    scene = Scene(sheet, Material(E, 0.0, h), model=choice.model)
    scene.fix("x0")
    if ends != "hinged":
        scene.clamp("x0")
    if ends != "cantilever":
        scene.fix("x1", "yz")
    if ends == "clamped":
        scene.clamp("x1")
    scene.line_load("x1", (-EULER[ends] * E * h**3 / (12 * length**2), 0.0, 0.0))
    return CriticalProblem(f"column, {ends}", scene, EULER[ends])


def crease_column(eta: float, choice: Choice, *, h: float = 0.01) -> CriticalProblem:
    """Two flat unit panels with a crease between, pressed together at their hinged outer edges.

    N = EI k^2 with k W tan(k W) = 24 eta, eta = K_r W / (E h^3); nu = 0.

    Args:
        eta: stiffness of the crease.
        choice: model and mesh.
        h: thickness.
    """
    structure, comm = choice.structure, choice.comm
    sheet = mesh_pattern(z_fold(1.0, 0.5, 180.0), 1.0 / choice.n, structure=structure, comm=comm)
    scene = Scene(sheet, Material(E, 0.0, h), model=choice.model)
    scene.crease("crease", eta * E * h**3)
    scene.fix("left_edge")
    scene.fix("right_edge", "yz")
    k = brentq(lambda k: k * np.sin(k) - 24 * eta * np.cos(k), 0.0, 0.5 * pi)
    scene.line_load("right_edge", (-(k**2) * E * h**3 / 12, 0.0, 0.0))
    return CriticalProblem(f"crease column, eta = {eta:g}", scene, k**2)


def plate(load: str, edges: str, choice: Choice, *, h: float = 0.002) -> CriticalProblem:
    """Unit square held at its edges, under loads in its plane; nu = 0.3.

    Args:
        load: "pressed" along x, or "sheared".
        edges: "hinged" or "clamped".
        choice: model and mesh.
        h: thickness; at 0.01 the strain before buckling lowers the loads by up to 0.3 %.
    """
    _require((load, edges), PLATES)
    nu, sides = 0.3, ("x0", "x1", "y0", "y1")
    scene = Scene(choice.rectangle(1.0, 1.0), Material(E, nu, h), model=choice.model)
    for side in sides:
        scene.fix(side, "z")
        if edges == "clamped":
            scene.clamp(side)
    scene.fix("x0y0", "xy")
    scene.fix("x1y0", "y")
    critical = PLATES[load, edges] * pi**2 * E * h**3 / (12 * (1 - nu**2))
    forces = {"pressed": [(1, 0), (-1, 0)], "sheared": [(0, -1), (0, 1), (-1, 0), (1, 0)]}[load]
    for side, force in zip(sides, forces, strict=False):
        scene.line_load(side, (critical * force[0], critical * force[1], 0.0))
    return CriticalProblem(f"plate, {load}, {edges}", scene, PLATES[load, edges])


def blade(choice: Choice, *, h: float = 0.02) -> CriticalProblem:
    """Cantilever of length 80 and depth 1 under a force in its plane, buckling sideways; nu = 0.

    The clamp holds the warping of the end, by which Vlasov's beam has 0.5 % more.

    Args:
        choice: model and mesh; segments of the fem model are longer than wide.
        h: thickness.
    """
    length = 80.0
    sheet = choice.rectangle(length, 1.0, stretch=2 if choice.model == "fem" else 1)
    scene = Scene(sheet, Material(E, 0.0, h), model=choice.model)
    scene.fix("x0")
    scene.clamp("x0")
    weak, torsion = E * h**3 / 12, 0.5 * E * h**3 / 3
    scene.line_load("x1", (0.0, BLADE * np.sqrt(weak * torsion) / length**2, 0.0))
    return CriticalProblem("blade", scene, BLADE)


def _require(name, known) -> None:
    if name not in known:
        raise InputError(f"{name!r} is none of {list(known)}")
