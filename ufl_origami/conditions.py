"""What a scene's conditions, loads and materials come to in any discretisation."""

from collections.abc import Callable
from functools import partial

import numpy as np

from ufl_origami.collective import together
from ufl_origami.configuration import Configuration
from ufl_origami.constraints import Constraints
from ufl_origami.errors import SceneError
from ufl_origami.model import place_nodes, place_vertices
from ufl_origami.scene import Scene
from ufl_origami.scene_parts import ClampSpec, LoadFactor, displacement_function
from ufl_origami.sheet import SheetMesh
from ufl_origami.sides import EdgeSides, side_ends
from ufl_origami.terms import loads
from ufl_origami.terms.base import Term
from ufl_origami.terms.form import SheetFunctions
from ufl_origami.terms.panels import PanelData


def clamped_facets(scene: Scene, sides: EdgeSides) -> np.ndarray:
    """Local facets with a prescribed normal; every one must be a boundary."""
    facets = [scene.sheet.edge_facets(clamp.name) for clamp in scene.clamps]
    if not facets:
        return np.empty(0, dtype=np.int32)
    count = np.zeros(len(scene.sheet.edge_vertices()), dtype=int)
    count[sides.facet] = sides.count
    with together(scene.sheet.comm):
        for clamp, part in zip(scene.clamps, facets, strict=True):
            if (count[part] > 1).any():
                raise SceneError(f"clamp {clamp.name!r}: an edge of two triangles is no boundary")
        every, times = np.unique(np.concatenate(facets), return_counts=True)
        if (times > 1).any():
            names = [clamp.name for clamp in scene.clamps]
            raise SceneError(f"an edge is clamped more than once by {names}")
    return every


def panel_data(scene: Scene) -> PanelData:
    """Elastic data of each local cell."""
    sheet = scene.sheet
    materials = [scene.panel_material(name) for name in sheet.panel_names]
    values = np.array([(m.E, m.nu, m.h) for m in materials])[sheet.cell_panel]
    curvature = None
    if scene.curvatures:
        tensors = [scene.curvatures.get(n, np.zeros((3, 3))) for n in sheet.panel_names]
        curvature = np.array(tensors)[sheet.cell_panel]
    young, poisson, thickness = np.ascontiguousarray(values.T)
    return PanelData(young, poisson, thickness, curvature, scene.membrane == "kernel")


def outward_tangents(sheet: SheetMesh, sides: np.ndarray) -> np.ndarray:
    """Unit in-plane normals (n, 3) of boundary sides 3 * cell + e, pointing off the sheet."""
    ends = sheet.rest[side_ends(sheet, sides)]
    inward = sheet.rest[sheet.cells.ravel()[sides]] - ends[:, 0]
    along = ends[:, 1] - ends[:, 0]
    along /= np.linalg.norm(along, axis=1)[:, None]
    inward -= (inward * along).sum(axis=1)[:, None] * along
    return -inward / np.linalg.norm(inward, axis=1)[:, None]


def clamp_tangent(clamp: ClampSpec, rest: np.ndarray) -> Callable[[float], np.ndarray]:
    """Outward tangents (n, 3) of a clamp as a function of time."""
    tangent = clamp.tangent
    if tangent is None:
        return lambda time: rest
    return lambda time: np.broadcast_to(tangent(time, rest), rest.shape)


def make_constraints(scene: Scene, configuration: Configuration, factor: LoadFactor) -> Constraints:
    """Prescribed displacements."""
    constraints = Constraints(configuration)
    for spec in scene.motions:
        nodes = place_nodes(configuration, spec.name)
        for axis, value in enumerate(spec.components):
            if value is not None:
                label = f"move {spec.name!r} {'xyz'[axis]}"
                f = displacement_function(value, nodes.rest, label, factor)
                constraints.add(nodes.dofs[:, axis], f, label)
    return constraints


MomentMaker = Callable[[str, loads.Amplitude], Term]


def load_terms(
    scene: Scene,
    configuration: Configuration,
    functions: SheetFunctions,
    factor: LoadFactor,
    moment: MomentMaker,
) -> list[Term]:
    """One term a load; `moment` makes those of edge moments, which turn the model's own normals."""
    makers: dict[str, Callable[[str, Callable], Term]] = {
        "point": partial(point_load, configuration),
        "line": partial(line_load, configuration),
        "area": partial(area_load, functions),
        "pressure": partial(pressure_load, functions),
        "moment": moment,
    }
    return [makers[spec.kind](spec.name, spec.function(factor)) for spec in scene.loads]


def point_load(configuration: Configuration, name: str, force: loads.VectorFunction) -> Term:
    """Dead force on the rank that owns the point."""
    vertices = place_vertices(configuration.sheet, name)
    vertices = vertices[vertices < configuration.nv_owned]
    dofs = 3 * vertices[:, None] + np.arange(3)
    return loads.NodalLoad(dofs, np.ones(len(vertices)), force)


def line_load(configuration: Configuration, name: str, force: loads.VectorFunction) -> Term:
    """Dead force per rest length of each owned edge, on the nodes by their shape functions.

    That is half of it to either end, or a sixth to either end and the rest to the midpoint.
    """
    sheet = configuration.sheet
    facets = sheet.edge_facets(name)
    facets = facets[facets < sheet.num_owned_edges]
    ends = sheet.edge_vertices()[facets]
    length = np.linalg.norm(sheet.rest[ends[:, 1]] - sheet.rest[ends[:, 0]], axis=1)
    dofs, share = 3 * ends[:, :, None] + np.arange(3), np.array([0.5, 0.5])
    if configuration.has_midpoints:
        dofs = np.concatenate([dofs, configuration.middle_dofs(facets)[:, None]], axis=1)
        share = np.array([1, 1, 4]) / 6
    return loads.NodalLoad(dofs.reshape(-1, 3), np.outer(length, share).ravel(), force)


def _panel_indicator(sheet: SheetMesh, name: str) -> np.ndarray:
    indicator = np.zeros(len(sheet.cells))
    indicator[sheet.panel_cells(name)] = 1.0
    return indicator


def area_load(functions: SheetFunctions, name: str, force: loads.VectorFunction) -> Term:
    """Dead force per rest area."""
    return loads.area_load(functions, _panel_indicator(functions.sheet, name), force)


def pressure_load(functions: SheetFunctions, name: str, pressure: loads.Amplitude) -> Term:
    """Follower pressure."""
    return loads.follower_pressure(functions, _panel_indicator(functions.sheet, name), pressure)


def moment_sides(scene: Scene, sides: EdgeSides, name: str) -> np.ndarray:
    """Sides 3 * cell + e of owned triangles at a loaded boundary; collective.

    Raises:
        SceneError: the edge is no boundary, or clamped.
    """
    sheet = scene.sheet
    facets = sheet.edge_facets(name)
    owned = np.flatnonzero(np.isin(sides.facet[: 3 * sheet.num_owned_cells], facets))
    clamped = clamped_facets(scene, sides)
    with together(sheet.comm):
        if (sides.count[owned] > 1).any():
            raise SceneError(f"edge moment {name!r}: an edge of two triangles is no boundary")
        if np.isin(sides.facet[owned], clamped).any():
            raise SceneError(f"edge moment {name!r}: the edge is clamped")
    return owned
