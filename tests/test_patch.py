"""Patch test: directors represent constant curvature exactly on any mesh, averaged normals do not.

With a quadratic surface z = a x.K.x / 2 of small height, the unknowns of the director form are
those of Morley's plate element: vertex positions and rotations of the edges' normals at their
midpoints. Its moments are constant, and it passes the patch test: with the boundary's vertices and
edge normals prescribed, the quadratic surface is the equilibrium, with its exact energy, on every
mesh (Morley 1968, doi:10.1017/S0001925900004546). All errors are of order a^2.
"""

from mpi4py import MPI

import numpy as np
import pytest

from ufl_origami.discretise import build
from ufl_origami.material import Material
from ufl_origami.scene import Scene
from ufl_origami.sheet import sheet_from_arrays
from ufl_origami.solvers.newton import NewtonSettings, NewtonSolver
from ufl_origami.solvers.static import StaticPath, StepSettings

pytestmark = [
    pytest.mark.serial,
    pytest.mark.filterwarnings("ignore::ufl_origami.errors.MeshWarning"),
]

SMALL = 1e-5
MATERIAL = Material(E=1.0, nu=0.3, h=0.2)
CURVATURES = {
    "cylinder": [[1.0, 0.0], [0.0, 0.0]],
    "oblique cylinder": [[0.36, 0.48], [0.48, 0.64]],
    "sphere": [[1.0, 0.0], [0.0, 1.0]],
    "saddle": [[1.0, 0.0], [0.0, -1.0]],
    "twist": [[0.0, 1.0], [1.0, 0.0]],
}
MESHES = ("diagonal", "union-jack", "crisscross", "perturbed", "stretched")


def square(kind, n=4):
    """Vertices (nv, 2) and triangles of the unit square, n x n cells cut in the named way."""
    t = np.linspace(0.0, 1.0, n + 1)
    points = np.stack(np.meshgrid(t, t, indexing="ij"), axis=2).reshape(-1, 2)
    triangles, centres = [], []
    for i in range(n):
        for j in range(n):
            a, b, c, d = (i * (n + 1) + j + k for k in (0, n + 1, n + 2, 1))
            if kind == "crisscross":
                m = len(points) + len(centres)
                centres.append(points[[a, b, c, d]].mean(axis=0))
                triangles += [(a, b, m), (b, c, m), (c, d, m), (d, a, m)]
            elif kind == "union-jack" and (i + j) % 2:
                triangles += [(a, b, d), (b, c, d)]
            else:
                triangles += [(a, b, c), (a, c, d)]
    points = np.vstack([points, *centres]) if centres else points
    if kind == "perturbed":
        inside = ((points > 0) & (points < 1)).all(axis=1)
        rng = np.random.default_rng(0)
        points[inside] += rng.uniform(-0.25, 0.25, (inside.sum(), 2)) / n
    if kind == "stretched":
        points[:, 0] = 0.1 * points[:, 0] + 0.9 * points[:, 0] ** 3
    return points, np.array(triangles)


def boundary_edges(triangles):
    """Edges (k, 2) of one triangle only, in its orientation."""
    directed = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    edges = {tuple(e) for e in directed.tolist()}
    return np.array(sorted(e for e in edges if e[::-1] not in edges))


def patch(kind, curvature, bending="director", held="edge"):
    """Square with vertices and edge normals of its boundary (or all vertices) on the surface.

    Each boundary edge is an edge set of its own: its clamp prescribes the surface's tangent at its
    midpoint, which an edge of a quadratic surface is parallel to.
    """
    points, triangles = square(kind)
    curvature = np.array(CURVATURES[curvature])
    boundary = boundary_edges(triangles)
    names = {f"edge {i}": edge[None] for i, edge in enumerate(boundary)}
    vertices = np.column_stack([points, np.zeros(len(points))])
    sheet = sheet_from_arrays(MPI.COMM_SELF, vertices, triangles, edges=names | {"edge": boundary})
    scene = Scene(sheet, MATERIAL, bending=bending)

    def height(time, rest):
        return 0.5 * SMALL * time * np.einsum("ni,ij,nj->n", rest[:, :2], curvature, rest[:, :2])

    scene.move(held if held == "edge" else sheet.panel_names[0], x=0.0, y=0.0, z=height)
    for name, ((start, end),) in names.items():
        along = points[end] - points[start]
        outward = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        slope = SMALL * outward @ curvature @ points[[start, end]].mean(axis=0)
        scene.clamp(
            name, lambda time, rest, out=outward, slope=slope: np.array([*out, time * slope])
        )
    return build(scene), height


def solved(model):
    """The model in equilibrium at load factor 1."""
    solver = NewtonSolver(model.problem, NewtonSettings(rtol=1e-13))
    StaticPath(model.problem, solver, StepSettings(first=1.0)).run(model.x, 0.0, [1.0])
    return model


def exact_energy(curvature):
    """Bending energy of the unit square of constant curvature (Kirchhoff plate)."""
    k, m = SMALL * np.array(CURVATURES[curvature]), MATERIAL
    rigidity = m.E * m.h**3 / (12 * (1 - m.nu**2))
    return 0.5 * rigidity * (np.trace(k) ** 2 - 2 * (1 - m.nu) * np.linalg.det(k))


def energy_error(model, curvature):
    return model.energies()["bending"] / exact_energy(curvature) - 1.0


@pytest.mark.parametrize("curvature", CURVATURES)
@pytest.mark.parametrize("kind", MESHES)
def test_directors_hold_the_exact_energy_of_a_quadratic_surface(kind, curvature):
    """All vertices on the surface, only the inner directors free."""
    model, _ = patch(kind, curvature, held="sheet")
    assert abs(energy_error(solved(model), curvature)) < 1e-7


@pytest.mark.parametrize("curvature", CURVATURES)
@pytest.mark.parametrize("kind", MESHES)
def test_a_quadratic_surface_is_the_equilibrium_of_its_boundary(kind, curvature):
    """Inner vertices and directors find their places."""
    model, height = patch(kind, curvature)
    solved(model)
    rest, z = model.sheet.rest, model.state.x[:, 2]
    assert np.abs(z - height(1.0, rest)).max() < 1e-7 * SMALL
    assert abs(energy_error(model, curvature)) < 1e-7


@pytest.mark.parametrize(
    ("kind", "curvature", "error"), [("crisscross", "saddle", 0.5), ("perturbed", "cylinder", 0.05)]
)
def test_averaged_normals_fail_the_patch_test(kind, curvature, error):
    model, _ = patch(kind, curvature, bending="averaged", held="sheet")
    assert energy_error(solved(model), curvature) > error
