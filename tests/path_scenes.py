"""Scenes with limit points: the truss of two panels, and the hinged cylindrical roof."""

import numpy as np

from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import roof_quarter
from ufl_origami.meshing import mesh_pattern
from ufl_origami.scene import Scene

E = 1e4


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


def roof(h, model="ddg", n=20):
    """Quarter of the hinged cylindrical roof under a central force, 1000 at load factor 1."""
    sheet = roof_quarter(2540.0, 508.0, 0.1, n)
    scene = Scene(sheet, Material(3102.75, 0.3, h), model=model)
    scene.symmetry("sym_x0", "x")
    scene.symmetry("sym_y0", "y")
    scene.fix("straight")
    scene.point_load("A", (0.0, 0.0, -250.0))
    return scene
