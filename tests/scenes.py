"""Small scenes that several tests share."""

import numpy as np

from ufl_origami.discretise import build
from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.meshing import mesh_pattern
from ufl_origami.scene import Scene
from ufl_origami.sheet import sheet_from_arrays
from ufl_origami.solvers.admissible import Admissible
from ufl_origami.solvers.newton import NewtonSettings, NewtonSolver
from ufl_origami.solvers.static import StaticPath, StepSettings

E, H = 1e7, 0.01


def follow(model, stops=(1.0,), *, first=0.125, newton=None, on_accept=None, **steps):
    """Accepted steps of a static path from rest."""
    newton = newton or NewtonSettings()
    solver = NewtonSolver(model.problem, newton)
    path = StaticPath(model.problem, solver, StepSettings(first=first, **steps), Admissible(model))
    path.run(model.x, 0.0, stops, on_accept)
    return path


def z_fold_scene(size, eta, *, nu=0.0, d1=1.0, bending="director", model="ddg", **mesh):
    """The paper's Z-fold pulled apart by d1 at load factor 1."""
    sheet = mesh_pattern(z_fold(), size, **mesh)
    scene = Scene(sheet, Material(E, nu, H), bending=bending, model=model)
    scene.crease("crease", eta * E * H**3)
    scene.fix("left_edge")
    scene.move("right_edge", x=d1, y=0.0, z=0.0)
    return scene


def strip_scene(
    n=(16, 2), *, h=0.1, nu=0.0, structure="structured", bending="director", model="ddg"
):
    """Cantilever of Sze, Liu & Lo (2004): L = 10, b = 1, EI = 100, clamped at x = 0."""
    sheet = rectangle(10.0, 1.0, n=n, structure=structure)
    material = Material(1.2e6 * (0.1 / h) ** 3, nu, h)
    scene = Scene(sheet, material, bending=bending, model=model)
    scene.fix("x0")
    scene.clamp("x0")
    return scene


def tee(comm, n=3):
    """Three unit panels at one edge along y: flat left and right ones, an upright third."""
    directions = [(-1.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
    y = np.linspace(0, 1, n + 1)
    spine = [(0.0, v, 0.0) for v in y]
    vertices, triangles, panel = list(spine), [], []
    edges = {"spine": [(j, j + 1) for j in range(n)]}
    for p, (dx, dz) in enumerate(directions):
        base = len(vertices)
        vertices += [(dx * i / n, v, dz * i / n) for i in range(1, n + 1) for v in y]

        def at(i, j, base=base):
            return j if i == 0 else base + (i - 1) * (n + 1) + j

        for i in range(n):
            for j in range(n):
                quad = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]
                pairs = [(quad[0], quad[1], quad[2]), (quad[0], quad[2], quad[3])]
                triangles += [t[::-1] for t in pairs] if p == 0 else pairs
                panel += [p, p]
        edges[f"end{p}"] = [(at(n, j), at(n, j + 1)) for j in range(n)]
    return sheet_from_arrays(
        comm,
        np.array(vertices),
        np.array(triangles),
        panel=np.array(panel),
        panel_names=["left", "right", "upright"],
        edges={k: np.array(v) for k, v in edges.items()},
        creases=["spine"],
    )


def disturb(model, amount, seed=0):
    """Random state that no partition changes: displacements and scalars by a hash of place."""
    configuration = model.configuration
    sheet = model.sheet
    rest = sheet.rest[: configuration.nv_owned]
    phase = np.array([[12.9, 78.2, 37.7], [39.3, 11.1, 83.1], [73.1, 52.2, 9.1]])
    shift = np.sin(7.3 * (seed + 1) + np.arange(3))
    u = amount * np.sin(rest @ phase + shift * 40)
    q = model.x.array_w
    q[: u.size] += u.ravel()
    for name in configuration.edge_unknowns:
        slot = configuration.slot(name)[: sheet.num_owned_edges]
        middle = sheet.rest[sheet.edge_vertices()[: sheet.num_owned_edges]].mean(axis=1)
        value = amount * np.sin(middle @ phase[0] + 3 * len(name) + seed)
        q[3 * configuration.nv_owned + slot[slot >= 0]] += value[slot >= 0]
    model.x.assemble()
    return model


__all__ = ["build", "disturb", "follow", "strip_scene", "tee", "z_fold_scene"]
