"""Scenes of limit points and critical loads; load factor 1 is the exact one (but for the roof)."""

from math import pi

import numpy as np
from scipy.optimize import brentq

from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle, roof_quarter
from ufl_origami.meshing import mesh_pattern
from ufl_origami.paths import follow_path
from ufl_origami.scene import Scene
from ufl_origami.solvers.continuation import ArcSettings

E = 1e4

#: Load steps for a flat path to its first bifurcation near 1.
TO_CRITICAL = ArcSettings(first=0.5, load=0.6, tolerance=1e-4)


def first_bifurcation(scene, stop=1.1):
    """The first bifurcation of a path from rest, and the path."""
    path = follow_path(scene, [stop], arc=TO_CRITICAL, progress=False)
    return path.bifurcations[0], path


def truss(height, *, h, depth, model="ddg", n=1, **mesh):
    """Two panels over a span of 2 with hinges, their crease below; the load lifts the crease.

    Each panel is a bar of Saint Venant-Kirchhoff material in Green's strain; see `bar_load`.
    """
    length = np.hypot(1.0, height)
    pattern = z_fold(length, depth, 2 * np.degrees(np.arctan2(1.0, height)))
    sheet = mesh_pattern(pattern, size=length / n, **mesh)
    scene = Scene(sheet, Material(E, 0.0, h), model=model)
    scene.crease("crease", 0.0)
    scene.fix("left_edge")
    scene.fix("right_edge")
    limit = E * h * (height / length) ** 3 * 2 / (3 * np.sqrt(3.0))
    scene.line_load("crease", (0.0, 0.0, limit))
    return scene


def bar_load(depth, height):
    """Load factor of the symmetric truss with its crease at a depth below the hinges."""
    return 1.5 * np.sqrt(3.0) * depth * (height**2 - depth**2) / height**3


#: Critical load over EI / L^2, by ends.
EULER = {"cantilever": 0.25 * pi**2, "hinged": pi**2, "clamped": 4 * pi**2}


def column(ends, model="ddg", n=(24, 2), *, length=10.0, h=0.1, structure="unstructured"):
    """Euler's column, a strip of width 1 pressed along its length; nu = 0."""
    sheet = rectangle(length, 1.0, n=n, structure=structure)
    scene = Scene(sheet, Material(E, 0.0, h), model=model)
    scene.fix("x0")
    if ends != "hinged":
        scene.clamp("x0")
    if ends != "cantilever":
        scene.fix("x1", "yz")
    if ends == "clamped":
        scene.clamp("x1")
    critical = EULER[ends] * E * h**3 / (12 * length**2)
    scene.line_load("x1", (-critical, 0.0, 0.0))
    return scene


def crease_column(eta, model="ddg", size=0.125, *, h=0.01):
    """Two flat unit panels with a crease between, pressed together at their hinged outer edges."""
    sheet = mesh_pattern(z_fold(1.0, 0.5, 180.0), size)
    scene = Scene(sheet, Material(E, 0.0, h), model=model)
    scene.crease("crease", eta * E * h**3)
    scene.fix("left_edge")
    scene.fix("right_edge", "yz")
    k = brentq(lambda k: k * np.sin(k) - 24 * eta * np.cos(k), 0.0, 0.5 * pi)
    scene.line_load("right_edge", (-(k**2) * E * h**3 / 12, 0.0, 0.0))
    return scene


#: Critical load per length over pi^2 D / b^2, by load and edges.
PLATES = {
    ("pressed", "hinged"): 4.000,
    ("pressed", "clamped"): 10.07,
    ("sheared", "hinged"): 9.32,
    ("sheared", "clamped"): 14.64,
}


def plate(load, edges, model="ddg", n=8, *, h=0.01, nu=0.3):
    """Unit square held at its edges, under loads in its plane: pressed along x, or sheared."""
    sheet = rectangle(1.0, 1.0, n=n, structure="unstructured")
    scene = Scene(sheet, Material(E, nu, h), model=model)
    sides = ("x0", "x1", "y0", "y1")
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
    return scene


def blade(model="ddg", n=(80, 2), *, length=40.0, h=0.02):
    """Narrow cantilever of depth 1 under a force in its plane, which buckles sideways; nu = 0."""
    scene = Scene(rectangle(length, 1.0, n=n), Material(E, 0.0, h), model=model)
    scene.fix("x0")
    scene.clamp("x0")
    weak, torsion = E * h**3 / 12, 0.5 * E * h**3 / 3
    scene.line_load("x1", (0.0, 4.0126 * np.sqrt(weak * torsion) / length**2, 0.0))
    return scene


def roof(h, model="ddg", n=20):
    """Quarter of the hinged cylindrical roof under a central force, 1000 at load factor 1."""
    sheet = roof_quarter(2540.0, 508.0, 0.1, n)
    scene = Scene(sheet, Material(3102.75, 0.3, h), model=model)
    scene.symmetry("sym_x0", "x")
    scene.symmetry("sym_y0", "y")
    scene.fix("straight")
    scene.point_load("A", (0.0, 0.0, -250.0))
    return scene
