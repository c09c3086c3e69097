"""Whether a mesh can represent the chosen form: figures, and a warning with each that is too large.

| figure | concerns | limit | above it |
|---|---|---|---|
| patch check (patch_check.py) | averaged normals | 2 % | bending energy wrong on any fine mesh |
| altitude ratio | all | below 0.01 | tangent ill-conditioned; averaged normals biased |
| long edges | directors | 2 % | panels too soft |
| area ratio | all, once loaded | below 0.577 | compressed triangles collapse |
| sagitta / h | all, once bent | 1, at crossings 0.3 | constant-strain membrane locks |

Long edges: with directors the error follows the longest edge, however fine the mesh is across it.
A cantilever plate under end shear, n segments along the length L and edges of length a across it,
is softer by k (a/L)^2 whatever n, width and aspect (2 to 32): k = 3/8 (one diagonal) and 0.19
(criss-cross) for nu = 0, 0.66 and 0.33 for nu = 0.3; nothing under constant curvature. The
figure is LONG_EDGE (a/l)^2 with l the panel's extent across the edge; only stretched triangles
count, a mesh that is coarse both ways being the user's choice.

Sagitta: kappa a^2 / (8 h), kappa the largest principal curvature and a the longest edge: the height
of the arc over an edge against the thickness. A wide cantilever plate under end shear (directors)
loses of its deflection, on unstructured meshes: 0.3 % at 1.3, 1 % at 3.9, 5 % at 11, 10 % at 39;
criss-cross meshes lock sooner: 2 % at 0.33, 6 % at 0.9, 14 % at 3.5. One-diagonal meshes whose
edges follow the rulings do not lock at all. Triangles at a crossing, a vertex where two straight
lines of edges meet, have a limit of their own therefore.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from ufl_origami.collective import reduced
from ufl_origami.crossings import crossed
from ufl_origami.errors import MeshWarning
from ufl_origami.mesh_checks import altitude_ratios
from ufl_origami.model import Model
from ufl_origami.patch_check import patch_errors
from ufl_origami.scene import Scene
from ufl_origami.sheet import SheetMesh
from ufl_origami.sides import EdgeSides, edge_sides
from ufl_origami.terms.shell import ShellTerm

#: Largest relative error of the bending energy in the patch check.
PATCH_LIMIT = 0.02
#: Least smallest altitude / longest edge of a triangle.
ALTITUDE_LIMIT = 0.01
#: Longest edge / smallest altitude of a triangle from which it is stretched (2 when cut from a
#: square, 4.25 from a rectangle 4 : 1).
STRETCHED = 4.0
#: Share of the longest edge from which another one is as long.
NEARLY = 0.9
#: Upper figure of the softness over (a/l)^2 of stretched triangles with directors.
LONG_EDGE = 2 / 3
#: Largest such softness.
LONG_EDGE_LIMIT = 0.02
#: Least ratio of a triangle's current to its rest area: the stretch 3^-1/2 at which the force of a
#: St. Venant-Kirchhoff bar, E (l^3 - l) / 2, is largest in compression.
AREA_LIMIT = 3**-0.5
#: Largest sagitta over thickness.
SAGITTA_LIMIT = 1.0
#: The same for triangles at a crossing.
CROSSED_LIMIT = 0.3


@dataclass(frozen=True)
class Finding:
    """One figure beyond its limit.

    Attributes:
        kind: "patch", "altitude", "long edges", "area" or "sagitta".
        figure: the worst value.
        limit: the limit that it passes.
        panel: name of the panel where it is worst, empty for "area".
        message: one line with the figure, the place and what it means.
    """

    kind: str
    figure: float
    limit: float
    panel: str
    message: str


@dataclass(frozen=True)
class Worst:
    """The triangle of largest figure in the whole sheet, or in one panel.

    Attributes:
        value: figure, -inf where there is no triangle.
        cell: its index in the input mesh, -1 where there is none.
        panel: its panel.
        place: its rest centroid (3,).
    """

    value: float
    cell: int
    panel: int
    place: np.ndarray


def check_mesh(scene: Scene, sides: EdgeSides | None = None) -> list[Finding]:
    """Figures of the rest mesh that are beyond their limits for the scene's form; collective.

    Args:
        scene: sheet, materials and bending form.
        sides: the sheet's triangle sides, where they are at hand.
    """
    sheet = scene.sheet
    findings = _altitude_findings(sheet)
    if scene.model == "fem":
        return findings
    if scene.bending == "averaged":
        return findings + _patch_findings(scene, sides or edge_sides(sheet))
    return findings + _long_edge_findings(sheet)


def check_model(model: Model) -> list[Finding]:
    """Figures of the model's current state that are beyond their limits; collective."""
    findings = _compression_findings(model)
    if isinstance(model.shell, ShellTerm):  # the FEM shell does not lock
        findings += _sagitta_findings(model)
    return findings


def _compression_findings(model: Model) -> list[Finding]:
    sheet = model.sheet
    ratio = sheet.comm.allreduce(model.shell.smallest_area_ratio(model.state), op=MPI.MIN)
    if not ratio < AREA_LIMIT:
        return []
    message = (
        f"a triangle has shrunk to {ratio:.3g} of its area (limit {AREA_LIMIT:.3g}): such a "
        "compression softens the material and may collapse it, a shell does not hold there; look "
        "for triangles smaller than the thickness and loads that crush"
    )
    return [Finding("area", ratio, AREA_LIMIT, "", message)]


def _sagitta_findings(model: Model) -> list[Finding]:
    value, area = _sagittas(model)
    worst = worst_triangle(model.sheet, value)
    if not worst.value > CROSSED_LIMIT:
        return []
    limit, kind = SAGITTA_LIMIT, "edges"
    if not worst.value > limit:
        worst = worst_triangle(model.sheet, np.where(crossed(model.sheet), value, -np.inf))
        limit, kind = CROSSED_LIMIT, "criss-cross edges"
    if not worst.value > limit:
        return []
    share = _share_above(model.sheet, value, area, limit)
    panel = model.sheet.panel_names[worst.panel]
    message = (
        f"sagitta/h is {worst.value:.3g} in panel {panel!r} near {_text(worst.place)} and above "
        f"{limit:g} on {100 * share:.2g} % of the area: {kind} there are too long for the "
        "curvature and the membrane locks; refine the mesh"
    )
    return [Finding("sagitta", worst.value, limit, panel, message)]


def warn_mesh(scene: Scene, sides: EdgeSides | None = None) -> None:
    """Warn (MeshWarning, on all ranks) of each finding of `check_mesh`; collective."""
    _warn(check_mesh(scene, sides))


def warn_sagitta(model: Model) -> None:
    """Warn (MeshWarning, on all ranks) of each finding of `check_model`; collective.

    Meant for the end of a solve: one warning of a kind, with the worst figure.
    """
    _warn(check_model(model))


def sagitta(model: Model) -> tuple[Worst, float]:
    """Largest kappa a^2 / (8 h) of the current state, and the area's share above 1.

    Collective. The curvature is that of the shell's own second fundamental form: the largest
    eigenvalue in size of Abar^-1 B.
    """
    value, area = _sagittas(model)
    share = _share_above(model.sheet, value, area, SAGITTA_LIMIT)
    return worst_triangle(model.sheet, value), share


def _share_above(sheet: SheetMesh, value: np.ndarray, area: np.ndarray, limit: float) -> float:
    above, total = reduced(sheet.comm, np.array([area[value > limit].sum(), area.sum()]))
    return float(above / total)


def _sagittas(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Sagitta over thickness and rest area (up to a factor) of the owned triangles."""
    if not isinstance(model.shell, ShellTerm):
        raise TypeError("sagitta: the model is not made of mid-edge shells")
    value = np.zeros(model.sheet.num_owned_cells)
    area = np.zeros(len(value))
    thickness = model.shell.panels.thickness
    for cells, abar, b in model.shell.second_forms(model.state):
        det = abar[:, 0] * abar[:, 2] - abar[:, 1] ** 2
        half = abar[:, 2] * b[:, 0] - 2 * abar[:, 1] * b[:, 1] + abar[:, 0] * b[:, 2]
        half /= 2 * det
        gauss = (b[:, 0] * b[:, 2] - b[:, 1] ** 2) / det
        kappa = np.abs(half) + np.sqrt(np.maximum(half**2 - gauss, 0.0))
        third = abar[:, 0] - 2 * abar[:, 1] + abar[:, 2]
        longest = np.maximum(np.maximum(abar[:, 0], abar[:, 2]), third)
        value[cells] = kappa * longest / (8 * thickness[cells])
        area[cells] = np.sqrt(det)
    return value, area


def worst_triangle(sheet: SheetMesh, value: np.ndarray) -> Worst:
    """Owned triangle of largest value (n_owned,) on all ranks, the first of equal ones; collective.

    Values that differ by rounding are equal, so that the answer does not depend on the ranks.
    """
    top = sheet.comm.allreduce(float(value.max(initial=-np.inf)), op=MPI.MAX)
    at = np.flatnonzero(np.isfinite(value) & (value >= top - 1e-9 * abs(top)))
    mine = Worst(-np.inf, -1, 0, np.zeros(3))
    if len(at):
        cell = at[np.argmin(sheet.input_cell[at])]
        place = sheet.rest[sheet.cells[cell]].mean(axis=0)
        mine = Worst(top, int(sheet.input_cell[cell]), int(sheet.cell_panel[cell]), place)
    found = [worst for worst in sheet.comm.allgather(mine) if worst.cell >= 0]
    return min(found, key=lambda worst: worst.cell, default=mine)


def _patch_findings(scene: Scene, sides: EdgeSides) -> list[Finding]:
    names = scene.sheet.panel_names
    poisson = np.array([scene.panel_material(name).nu for name in names])
    errors = patch_errors(scene.sheet, sides, poisson)
    size = np.nan_to_num(np.abs(errors.worst))
    at = int(size.argmax())
    if not size[at] > PATCH_LIMIT:
        return []
    message = (
        f"averaged normals fail the patch check in panel {names[at]!r}: bending energy of constant "
        f"curvature off by up to {_percent(errors.worst[at])}, of cylinders by up to "
        f"{_percent(errors.cylinder[at])} (limit {100 * PATCH_LIMIT:g} %, exceeded in "
        f"{(size > PATCH_LIMIT).sum()} of {len(names)} panels); refining does not help on most "
        'meshes: use bending="director" or a mesh of one diagonal'
    )
    return [Finding("patch", float(errors.worst[at]), PATCH_LIMIT, names[at], message)]


def _altitude_findings(sheet: SheetMesh) -> list[Finding]:
    ratio = altitude_ratios(sheet.rest, sheet.cells[: sheet.num_owned_cells])
    worst = worst_triangle(sheet, -ratio)
    if not -worst.value < ALTITUDE_LIMIT:
        return []
    count = sheet.comm.allreduce(int((ratio < ALTITUDE_LIMIT).sum()), op=MPI.SUM)
    panel = sheet.panel_names[worst.panel]
    message = (
        f"{count} triangles are slivers: smallest altitude / longest edge is down to "
        f"{-worst.value:.2g} (limit {ALTITUDE_LIMIT:g}) at triangle {worst.cell} of panel "
        f"{panel!r} near {_text(worst.place)}"
    )
    return [Finding("altitude", -worst.value, ALTITUDE_LIMIT, panel, message)]


def _long_edge_findings(sheet: SheetMesh) -> list[Finding]:
    """Stretched triangles with long edges, judged at the longest one of each panel."""
    cells = sheet.cells[: sheet.num_owned_cells]
    stretch = 1 / altitude_ratios(sheet.rest, cells)
    anywhere = sheet.comm.allreduce(bool((stretch > STRETCHED).any()), op=MPI.LOR)
    if not anywhere:
        return []
    edge, across = _longest_edges(sheet.rest[cells])
    panel = sheet.cell_panel[: len(cells)]
    found = _longest_of_panels(sheet, np.where(stretch > STRETCHED, edge, -np.inf), across)
    length = found[:, 0]
    extent = np.minimum(_extents(sheet, found[:, 2:5]), _extents(sheet, found[:, 5:]))
    softness = LONG_EDGE * np.where(length > 0, (length / extent) ** 2, 0.0)
    at = int(softness.argmax())
    if not softness[at] > LONG_EDGE_LIMIT:
        return []
    aspect = sheet.comm.allreduce(
        float(stretch[(panel == at) & (stretch > STRETCHED)].max(initial=0.0)), op=MPI.MAX
    )
    message = (
        f"triangles of panel {sheet.panel_names[at]!r} are stretched (longest edge / altitude up "
        f"to {aspect:.3g}) and {length[at]:.3g} long, {length[at] / extent[at]:.2g} of the panel's "
        f"extent across them: with directors the panel is up to {_percent(softness[at])} too soft "
        f"(limit {100 * LONG_EDGE_LIMIT:g} %), however fine the mesh is across the long edges; "
        "use nearly equilateral triangles"
    )
    return [
        Finding("long edges", float(softness[at]), LONG_EDGE_LIMIT, sheet.panel_names[at], message)
    ]


def _longest_edges(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Length (n,) of the longest edge of triangles (n, 3, 3), and two unit vectors (n, 6) across.

    The first is normal to the longest edge; the second to the next one where it is nearly as long
    (the leg of a right triangle shows a lattice's direction, its hypotenuse does not).
    """
    edges = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    length = np.linalg.norm(edges, axis=2)
    row, order = np.arange(len(corners)), length.argsort(axis=1)
    longest, middle = length[row, order[:, 2]], length[row, order[:, 1]]
    second = np.where(middle > NEARLY * longest, order[:, 1], order[:, 2])
    normal = np.cross(edges[:, 0], edges[:, 1])
    across = [np.cross(normal, edges[row, e]) for e in (order[:, 2], second)]
    return longest, np.hstack([v / np.linalg.norm(v, axis=1)[:, None] for v in across])


def _longest_of_panels(sheet: SheetMesh, length: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Rows (P, 8) of length, input cell and directions of the largest length of each panel.

    Of lengths equal but for rounding, the first in the input counts. Length 0: no triangle.
    """
    count = len(sheet.panel_names)
    panel = sheet.cell_panel[: len(length)]
    top = np.full(count, -np.inf)
    np.maximum.at(top, panel, length)
    top = reduced(sheet.comm, top, MPI.MAX)
    near = np.flatnonzero(np.isfinite(length) & (length >= (1 - 1e-9) * top[panel]))
    near = near[np.argsort(sheet.input_cell[near])]
    some, first = np.unique(panel[near], return_index=True)
    near = near[first]
    mine = np.zeros((count, 8))
    mine[:, 1] = np.inf
    mine[some] = np.column_stack([length[near], sheet.input_cell[near], across[near]])
    ranks = np.array(sheet.comm.allgather(mine))
    return ranks[ranks[:, :, 1].argmin(axis=0), np.arange(count)]


def _extents(sheet: SheetMesh, direction: np.ndarray) -> np.ndarray:
    """Extent (P,) of each panel along its direction (P, 3)."""
    panel = sheet.cell_panel[: sheet.num_owned_cells]
    place = sheet.rest[sheet.cells[: len(panel)]]
    along = np.einsum("nki,ni->nk", place, direction[panel])
    span = np.full((2, len(direction)), -np.inf)
    np.maximum.at(span[0], panel, along.max(axis=1, initial=-np.inf))
    np.maximum.at(span[1], panel, -along.min(axis=1, initial=np.inf))
    return reduced(sheet.comm, span, MPI.MAX).sum(axis=0)


def _warn(findings: Sequence[Finding]) -> None:
    for finding in findings:
        warnings.warn(finding.message, MeshWarning, stacklevel=4)


def _percent(value: float) -> str:
    return f"{100 * value:+.1f} %"


def _text(place: np.ndarray) -> str:
    return "(" + ", ".join(f"{v + 0.0:.3g}" for v in place) + ")"
