"""Which model and mesh a scene needs for a tolerance, from measured points of work and precision.

The table (data/speed_accuracy.csv) is the one that `./run demo speed_accuracy` writes. A scene is
likened to one of its problems:

| scene | problem |
|---|---|
| has creases | z_fold |
| a curved panel | hemisphere |
| flat, longer than 4 times its width | cantilever |
| flat otherwise | slit_annulus |

at the thickness over panel length that is nearest among the problem's; the panel length is the root
of the area of the smallest panel. Errors depend on the size of the mesh over the panel length. It
is a rule for a start, not a bound: a sheet that is bent further than the problem's, or that
crumples, needs more.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, isfinite, log
from pathlib import Path
from typing import Any

import numpy as np

from ufl_origami.collective import binned
from ufl_origami.errors import InputError
from ufl_origami.scene import Scene
from ufl_origami.sheet import SheetMesh
from ufl_origami.work_precision import Point, assured, picked, place_of, read_points

TABLE = Path(__file__).parent / "data" / "speed_accuracy.csv"
SAFETY = 0.8
"""Share of the tolerance at which the recommended mesh aims."""
STRIP = 4.0
"""Length over width from which on a flat panel is a strip."""
CURVED = 0.99
"""Length of the mean of a panel's unit normals below which it is curved (an arc of 28 degrees)."""


@dataclass(frozen=True)
class Recommendation:
    """A set-up and what it is expected to give.

    Attributes:
        model: "ddg" or "fem".
        bending, measure: options of the "ddg" model, empty for "fem".
        structure: kind of mesh.
        size: length of the triangles' sides, as `mesh_pattern` takes it.
        error: expected largest relative error.
        triangles: expected number of triangles.
        seconds: processor seconds of a path like the problem's, on the machine of the table.
        problem: problem of the table that the scene was likened to.
        thickness: its thickness over panel length.
    """

    model: str
    bending: str
    measure: str
    structure: str
    size: float
    error: float
    triangles: int
    seconds: float
    problem: str
    thickness: float

    @property
    def options(self) -> dict[str, Any]:
        """Options of `Scene`."""
        given = {"model": self.model, "bending": self.bending, "measure": self.measure}
        return {key: value for key, value in given.items() if value}


def recommend(
    scene: Scene,
    tolerance: float,
    *,
    structures: Sequence[str] = ("unstructured",),
    table: str | Path = TABLE,
) -> Recommendation:
    """The cheapest set-up that met a relative tolerance on the most similar problem; collective.

    Args:
        scene: sheet and materials; its own model and mesh size do not matter.
        tolerance: largest relative error of angles, forces and displacements.
        structures: kinds of mesh to choose from.
        table: CSV file of measured points.

    Raises:
        InputError: the tolerance is not positive, or tighter than all that was measured; the
            table lacks the problem.
    """
    if not (isfinite(tolerance) and tolerance > 0):
        raise InputError(f"tolerance {tolerance} is not a positive number")
    points = _nearest(scene, read_points(table), structures)
    length, area = panel_length(scene.sheet), sheet_area(scene.sheet)
    kinds = dict.fromkeys((p.method, p.mesh) for p in points)
    curves = [picked(points, method=method, mesh=mesh) for method, mesh in kinds]
    made = [_set_up(curve, tolerance, length, area) for curve in curves]
    found = [one for one in made if one]
    if not found:
        best = min(curve[-1].error() for curve in curves) / SAFETY
        raise InputError(
            f"tolerance {tolerance:g} is tighter than all that was measured on "
            f"{points[0].problem!r} at thickness {points[0].thickness:g}: the best is {best:.2g}"
        )
    return min(found, key=lambda one: one.seconds)


def kind_of_scene(sheet: SheetMesh) -> str:
    """Problem of the table that a sheet is most similar to; collective."""
    if sheet.creases:
        return "z_fold"
    shapes = panel_shapes(sheet)
    if shapes.straightness.min() < CURVED:
        return "hemisphere"
    return "cantilever" if shapes.elongation.max() > STRIP else "slit_annulus"


@dataclass(frozen=True)
class PanelShapes:
    """Rest shapes of all panels.

    Attributes:
        area: (P,).
        straightness: (P,) length of the mean unit normal, 1 for a flat panel.
        elongation: (P,) ratio of the two largest principal radii of gyration.
    """

    area: np.ndarray
    straightness: np.ndarray
    elongation: np.ndarray


def panel_shapes(sheet: SheetMesh) -> PanelShapes:
    """Areas, mean normals and second moments of the panels; collective."""
    count, owned = len(sheet.panel_names), sheet.num_owned_cells
    corners = sheet.rest[sheet.cells[:owned]]
    vector = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(vector, axis=1)
    every = np.concatenate([corners, corners.sum(axis=1, keepdims=True)], axis=1)
    second = area[:, None, None] / 12 * np.einsum("nki,nkj->nij", every, every)
    first = area[:, None] * corners.mean(axis=1)
    columns = [area[:, None], vector, first, second.reshape(owned, 9)]
    sums = binned(sheet.comm, sheet.cell_panel[:owned], np.hstack(columns), count)
    total = sums[:, 0]
    centre = sums[:, 4:7] / total[:, None]
    spread = sums[:, 7:].reshape(count, 3, 3) / total[:, None, None]
    spread -= centre[:, :, None] * centre[:, None, :]
    radii = np.linalg.eigvalsh(spread)
    return PanelShapes(
        total, np.linalg.norm(sums[:, 1:4], axis=1) / total, np.sqrt(radii[:, 2] / radii[:, 1])
    )


def panel_length(sheet: SheetMesh) -> float:
    """Root of the area of the smallest panel; collective."""
    return float(np.sqrt(panel_shapes(sheet).area.min()))


def sheet_area(sheet: SheetMesh) -> float:
    """Area of all panels; collective."""
    return float(panel_shapes(sheet).area.sum())


def _nearest(scene: Scene, points: Sequence[Point], structures: Sequence[str]) -> list[Point]:
    """Points of the most similar problem at the nearest thickness.

    Raises:
        InputError: the table has none.
    """
    sheet, kind = scene.sheet, kind_of_scene(scene.sheet)
    usable = [p for p in points if p.problem == kind and p.mesh in structures]
    if not usable:
        raise InputError(f"the table has no points of {kind!r} on meshes {list(structures)}")
    lengths = np.sqrt(panel_shapes(sheet).area)
    thickness = [scene.panel_material(name).h for name in sheet.panel_names]
    ratio = float((np.array(thickness) / lengths).min())
    off = [abs(log(p.h / p.panel_length / ratio)) for p in usable]
    return [p for p, distance in zip(usable, off, strict=True) if distance < min(off) + 1e-3]


def _set_up(
    curve: Sequence[Point], tolerance: float, length: float, area: float
) -> Recommendation | None:
    """The coarsest mesh of one method that meets a tolerance, for panels of a length and area.

    Its size divides the panel length into whole segments.
    """
    sizes = [p.size / p.panel_length for p in curve]
    errors = [p.error() for p in curve]
    place = place_of(errors, SAFETY * tolerance)
    if place is None:
        return None
    wanted = float(np.exp(np.interp(place, np.arange(len(sizes)), np.log(sizes))))
    ratio = 1 / ceil(1 / wanted - 1e-9)  # whole segments
    density = [p.triangles * p.size**2 / p.sheet_area for p in curve]
    size, some = ratio * length, curve[0]
    triangles = float(np.interp(-ratio, -np.array(sizes), density)) * area / size**2
    done = [p for p in curve if not p.failure]
    seconds = _on_chart(triangles, [p.triangles for p in done], [p.seconds for p in done])
    return Recommendation(
        model=some.model,
        bending=some.bending,
        measure=some.measure,
        structure=some.mesh,
        size=size,
        error=float(assured(errors)[0]) if place == 0 else SAFETY * tolerance,
        triangles=round(triangles),
        seconds=seconds,
        problem=some.problem,
        thickness=some.h / some.panel_length,
    )


def _on_chart(x: float, xs: Sequence[float], ys: Sequence[float]) -> float:
    """Value at x on the logarithmic chart of a curve, continued beyond its ends."""
    if len(xs) == 1:
        return float(ys[0] * x / xs[0])
    logs, values = np.log(xs), np.log(ys)
    at = min(max(int(np.searchsorted(logs, log(x))) - 1, 0), len(xs) - 2)
    slope = (values[at + 1] - values[at]) / (logs[at + 1] - logs[at])
    return float(np.exp(values[at] + slope * (log(x) - logs[at])))
