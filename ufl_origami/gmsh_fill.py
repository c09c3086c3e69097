"""Triangles inside a plane polygon whose boundary nodes are given, by gmsh (4.10 or later).

Geuzaine & Remacle 2009, doi:10.1002/nme.2579; the Frontal-Delaunay algorithm gives triangles that
are close to equilateral, the same ones for the same input.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import gmsh
import numpy as np

from ufl_origami.errors import MeshError

Size = float | Callable[[float, float], float]

OPTIONS = {
    "General.Terminal": 0,
    "General.NumThreads": 1,
    "Mesh.Algorithm": 6,
    "Mesh.ElementOrder": 1,
    "Mesh.RecombineAll": 0,
    "Mesh.SubdivisionAlgorithm": 0,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.MeshSizeMin": 0,
    "Mesh.MeshSizeMax": 1e22,
    "Mesh.MeshSizeFactor": 1,
    "Mesh.Smoothing": 3,
    "Mesh.RandomSeed": 1,
}


@contextmanager
def gmsh_model() -> Iterator[None]:
    """Open an empty gmsh model with the options above and leave gmsh as it was found."""
    mine = not gmsh.isInitialized()
    if mine:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
    before = {name: gmsh.option.getNumber(name) for name in OPTIONS}
    current, taken = gmsh.model.getCurrent(), gmsh.model.list()
    for name, value in OPTIONS.items():
        gmsh.option.setNumber(name, value)
    gmsh.model.add(next(n for i in range(1 + len(taken)) if (n := f"panel_{i}") not in taken))
    try:
        yield
    finally:
        _close(mine, current, before)


def _close(mine: bool, current: str, before: dict[str, float]) -> None:
    if mine:
        gmsh.finalize()
        return
    gmsh.model.remove()
    gmsh.model.setCurrent(current)
    for name, value in before.items():
        gmsh.option.setNumber(name, value)


def fill_polygon(loop: np.ndarray, size: Size) -> tuple[np.ndarray, np.ndarray]:
    """Return inner nodes and triangles of a plane polygon; its sides are not divided.

    Args:
        loop: (k, 2) nodes of the boundary, counterclockwise.
        size: length of the triangles' sides, a number or a function of the two coordinates.

    Returns:
        nodes (m, 2) inside, triangles (t, 3) counterclockwise: indices below k are the loop's.

    Raises:
        MeshError: when gmsh fails; the message holds what gmsh says.
    """
    with gmsh_model():
        try:
            surface = _polygon(loop)
            _set_size(size)
            gmsh.model.mesh.generate(2)
        except Exception as error:  # gmsh raises nothing more special
            raise MeshError(f"gmsh found no mesh: {error}") from error
        finally:
            gmsh.model.mesh.removeSizeCallback()
        return _read(len(loop), surface)


def _polygon(loop: np.ndarray) -> int:
    geo = gmsh.model.geo
    points = [geo.addPoint(float(x[0]), float(x[1]), 0.0) for x in loop]
    lines = [geo.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    for line in lines:
        geo.mesh.setTransfiniteCurve(line, 2)
    surface = geo.addPlaneSurface([geo.addCurveLoop(lines)])
    geo.synchronize()
    return surface


def _set_size(size: Size) -> None:
    if callable(size):
        gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: size(x, y))
    else:
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)


def _read(k: int, surface: int) -> tuple[np.ndarray, np.ndarray]:
    mesh = gmsh.model.mesh
    outer = mesh.getNodes(0)[0]
    inner, coordinates, _ = mesh.getNodes(2, surface)
    extra = len(mesh.getNodes(1)[0])
    if len(outer) != k or extra:
        raise MeshError(f"gmsh divided the boundary: {len(outer) + extra} nodes instead of {k}")
    tags = np.concatenate([outer, inner]).astype(np.int64)
    number = np.full(tags.max() + 1, -1)
    number[tags] = np.arange(len(tags))
    corners = number[mesh.getElementsByType(2, surface)[1].astype(np.int64)].reshape(-1, 3)
    if len(corners) == 0:
        raise MeshError("gmsh made no triangle")
    return coordinates.reshape(-1, 3)[:, :2].copy(), corners
