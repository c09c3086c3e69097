"""Cylinder-patch check of averaged mid-edge normals: what a mesh makes of a constant curvature.

The shell's bending energy of an interpolated surface of constant curvature K is compared with the
exact one. With averaged normals the tilts of an edge are half its fold angle, and to first order
the second fundamental form of a triangle is

    B = sum_e theta_e / eta_e  n_e (x) n_e

(eta_e altitude onto edge e, n_e in-plane normal of the edge, inwards), with theta_e that of the
interpolant of w = x.K x / 2 over the triangle and its neighbour unfolded into its plane. So B is a
linear map of K, known from the mesh alone, and the energy of a panel's interior is a quadratic form
in K: its largest and smallest ratio to the exact form cover cylinders of all directions, saddles
and twists at once. Directors pass this check on any mesh: they make the element the nonlinear
Morley element (Grinspun, Gingold, Reisman & Zorin 2006, doi:10.1111/j.1467-8659.2006.00974.x).
"""

from dataclasses import dataclass

import numpy as np

from ufl_origami.collective import binned
from ufl_origami.mesh_checks import triangle_normals
from ufl_origami.sheet import SheetMesh
from ufl_origami.sides import EdgeSides, crease_facets

#: Directions of the cylinders tried, over half a turn.
DIRECTIONS = 72
#: Axes whose share in a panel's normals differs by less than this are alike.
SAME_AXIS = 1e-6


@dataclass(frozen=True)
class PatchErrors:
    """Relative errors of the bending energy of surfaces of constant curvature, panel by panel.

    Attributes:
        worst: (P,) error of largest size over all curvatures, NaN in a panel without a triangle
            whose three edges are inside it.
        cylinder: (P,) error of largest size over cylinders of all directions, NaN likewise.
    """

    worst: np.ndarray
    cylinder: np.ndarray


def patch_errors(sheet: SheetMesh, sides: EdgeSides, poisson: np.ndarray) -> PatchErrors:
    """Errors of averaged normals in the interior of each panel; collective.

    Args:
        sheet: the meshed sheet in its rest state.
        sides: its triangle sides.
        poisson: (P,) Poisson's ratio of each panel.
    """
    cells = interior_cells(sheet, sides)
    area = np.linalg.norm(triangle_normals(sheet.rest, sheet.cells[cells]), axis=1) / 2
    maps = curvature_maps(sheet, sides, cells)
    panel = sheet.cell_panel[cells]
    law = _energy_law(poisson)
    energy = np.einsum("n,nai,nab,nbj->nij", area, maps, law[panel], maps, optimize=True)
    total = binned(sheet.comm, panel, energy, len(sheet.panel_names))
    areas = binned(sheet.comm, panel, area, len(sheet.panel_names))
    with np.errstate(invalid="ignore"):
        mean = total / areas[:, None, None]
    return _errors(mean, law)


def interior_cells(sheet: SheetMesh, sides: EdgeSides) -> np.ndarray:
    """Owned cells whose three edges have a neighbour in the same panel."""
    n = 3 * sheet.num_owned_cells
    inside = (sides.count[:n] == 2) & ~np.isin(sides.facet[:n], crease_facets(sheet))
    return np.flatnonzero(inside.reshape(-1, 3).all(axis=1))


def curvature_maps(sheet: SheetMesh, sides: EdgeSides, cells: np.ndarray) -> np.ndarray:
    """Matrices (n, 3, 3) that give a cell's B from K, both as (11, 12, 22).

    The components are those in the tangent frame of `tangent_frames`.
    """
    frames = tangent_frames(sheet)[cells]
    side = 3 * cells[:, None] + np.arange(3)
    across = sheet.cells.ravel()[sides.partner[side]]
    result = np.zeros((len(cells), 3, 3))
    for e in range(3):
        p, q, a = (sheet.rest[sheet.cells[cells, (e + k) % 3]] for k in (1, 2, 0))
        length, (foot, altitude), (foot_b, altitude_b) = _hinge_in_plane(
            p, q, a, sheet.rest[across[:, e]]
        )
        along = (q - p) / length[:, None]
        inward = a - p - foot[:, None] * along
        t = np.einsum("nij,nj->ni", frames, along)
        n = np.einsum("nij,nj->ni", frames, inward / altitude[:, None])
        ss = foot * (foot - length) / altitude + foot_b * (foot_b - length) / altitude_b
        theta = (
            0.5 * ss[:, None] * _components(t, t) * [1, 2, 1]
            + (foot - foot_b)[:, None] * _components(t, n) * [1, 2, 1]
            + 0.5 * (altitude + altitude_b)[:, None] * _components(n, n) * [1, 2, 1]
        )
        result += (_components(n, n) / altitude[:, None])[:, :, None] * theta[:, None, :]
    return result


def _components(v: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Components (11, 12, 22) of the symmetric part of v (x) w, plane vectors (n, 2)."""
    mixed = 0.5 * (v[:, 0] * w[:, 1] + v[:, 1] * w[:, 0])
    return np.stack([v[:, 0] * w[:, 0], mixed, v[:, 1] * w[:, 1]], axis=1)


def _hinge_in_plane(p, q, a, b):
    """Length of p -> q, and place of the foot and altitude of a and of b over it."""
    edge = q - p
    length = np.linalg.norm(edge, axis=1)

    def over(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        foot = ((point - p) * edge).sum(axis=1) / length
        altitude = np.linalg.norm(np.cross(edge, point - p), axis=1) / length
        return foot, altitude

    return length, over(a), over(b)


def tangent_frames(sheet: SheetMesh) -> np.ndarray:
    """Orthonormal tangents (nc, 2, 3) of the local cells, constant over a plane panel; collective.

    The first one is the projection of the coordinate axis that is closest to the panel's plane.
    """
    normal = triangle_normals(sheet.rest, sheet.cells)
    size = np.linalg.norm(normal, axis=1)
    unit = normal / size[:, None]
    owned = slice(sheet.num_owned_cells)
    weight = size[owned, None] * unit[owned] ** 2
    share = binned(sheet.comm, sheet.cell_panel[owned], weight, len(sheet.panel_names))
    share /= np.maximum(share.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    alike = share < share.min(axis=1, keepdims=True) + SAME_AXIS
    axis = np.argmax(alike, axis=1)[sheet.cell_panel]
    first = np.eye(3)[axis] - unit[np.arange(len(unit)), axis][:, None] * unit
    steep = np.linalg.norm(first, axis=1) < SAME_AXIS
    first[steep] = np.cross(unit[steep], np.roll(np.eye(3)[axis[steep]], 1, axis=1))
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(unit, first)], axis=1)


def _energy_law(poisson: np.ndarray) -> np.ndarray:
    """Matrices (P, 3, 3) of nu tr(K)^2 + (1 - nu) tr(K^2) on (K11, K12, K22)."""
    trace = np.outer([1.0, 0.0, 1.0], [1.0, 0.0, 1.0])
    nu = np.asarray(poisson, dtype=float)[:, None, None]
    return nu * trace + (1 - nu) * np.diag([1.0, 2.0, 1.0])


def _errors(mean: np.ndarray, law: np.ndarray) -> PatchErrors:
    """Extreme ratios of two quadratic forms (P, 3, 3), less one."""
    worst, cylinder = np.full(len(mean), np.nan), np.full(len(mean), np.nan)
    known = np.isfinite(mean).all(axis=(1, 2))
    if known.any():
        root = np.linalg.inv(np.linalg.cholesky(law[known]))
        ratios = np.linalg.eigvalsh(root @ mean[known] @ root.transpose(0, 2, 1))
        worst[known] = _largest(ratios - 1)
        angle = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
        c, s = np.cos(angle), np.sin(angle)
        k = np.stack([c * c, c * s, s * s], axis=1)
        top, bottom = (np.einsum("ni,pij,nj->pn", k, m[known], k) for m in (mean, law))
        cylinder[known] = _largest(top / bottom - 1)
    return PatchErrors(worst, cylinder)


def _largest(values: np.ndarray) -> np.ndarray:
    """Entry of largest size in each row of values (P, n)."""
    at = np.abs(values).argmax(axis=1)
    return values[np.arange(len(values)), at]
