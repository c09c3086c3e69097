"""From a scene to its discrete model: exactly the unknowns and terms that it names."""

from collections.abc import Callable

import numpy as np

from ufl_origami import kernels
from ufl_origami.collective import together
from ufl_origami.configuration import Configuration, State
from ufl_origami.constraints import Constraints
from ufl_origami.creases import EdgeFan, edge_fan, mesh_angles, side_ends
from ufl_origami.errors import SceneError
from ufl_origami.model import Model, place_vertices
from ufl_origami.problem import Problem
from ufl_origami.quality import warn_mesh
from ufl_origami.scene import (
    ClampSpec,
    LoadSpec,
    Scene,
    displacement_function,
)
from ufl_origami.sheet import SheetMesh
from ufl_origami.springs import (
    crease_springs,
    first_springs,
    hold_stiff_folds,
    spring_terms,
)
from ufl_origami.stencils import (
    DIRECTOR,
    EdgeSides,
    ShellBatch,
    edge_sides,
    edge_unknowns,
    fold_angle_name,
    shell_batches,
)
from ufl_origami.terms import loads
from ufl_origami.terms.base import Term
from ufl_origami.terms.form import SheetFunctions
from ufl_origami.terms.membrane import MembraneForm
from ufl_origami.terms.panels import PanelData
from ufl_origami.terms.shell import Ghosts, ShellTerm


def build(scene: Scene) -> Model:
    """Make the discrete model of a scene, at rest.

    Raises:
        SceneError: a crease without spring, a clamp on an edge that is no boundary, conditions
            that contradict each other.

    Warns:
        MeshWarning: the mesh cannot represent the scene's bending form (see quality.py).
    """
    if scene.model == "fem":
        raise SceneError("the fem model is not there yet")
    sheet = scene.sheet
    sides = edge_sides(sheet)
    warn_mesh(scene, sides)
    clamped = clamped_facets(scene, sides)
    configuration = Configuration(sheet, edge_unknowns(sheet, scene.bending, clamped))
    fans = {name: edge_fan(sheet, sides, name) for name in sheet.creases}
    rest_angles = {name: rest_fold_angles(sheet, fan) for name, fan in fans.items()}
    x = rest_vector(configuration, fans, rest_angles)
    rest = configuration.state(x, 0.0)
    tables = shell_batches(sheet, configuration, clamped)
    shell = shell_term(scene, configuration, tables, rest)
    springs = crease_springs(scene, configuration, fans, rest_angles)
    functions = SheetFunctions.create(sheet)
    terms = [shell, *spring_terms(springs, configuration)]
    terms += load_terms(scene, configuration, sides, functions)
    if scene.membrane == "ufl":
        terms.append(MembraneForm(functions, panel_data(scene)))
    terms += [maker(configuration, functions) for maker in scene.terms]
    constraints = make_constraints(scene, configuration)
    hold_stiff_folds(springs, constraints)
    problem = Problem(configuration, terms, constraints)
    problem.set_time(0.0)
    creases = first_springs(springs)
    return Model(sheet, configuration, problem, shell, creases, x, scene)


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


def rest_fold_angles(sheet: SheetMesh, fan: EdgeFan) -> np.ndarray:
    """Fold angles (n, m - 1) of the rest shape between side 0 and each other side."""
    angles = [mesh_angles(sheet, fan, (0, k), sheet.rest) for k in range(1, len(fan.panels))]
    return np.stack(angles, axis=1)


def rest_vector(configuration: Configuration, fans, rest_angles):
    """Unknowns of the stress-free state: virtual angles of the rest shape, all else zero."""
    x = configuration.create_vector()
    for name, fan in fans.items():
        for k, angle in enumerate(rest_angles[name].T, start=1):
            slot = configuration.slot(fold_angle_name(k))[fan.facets]
            x.array_w[3 * configuration.nv_owned + slot] = angle
    x.assemble()
    return x


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


def shell_term(
    scene: Scene, configuration: Configuration, tables: list[ShellBatch], rest: State
) -> ShellTerm:
    """The panels' term with the ghosts of all clamps."""
    sheet = scene.sheet
    ghosts: list[list[Ghosts]] = [[] for _ in tables]
    for clamp in scene.clamps:
        facets = sheet.edge_facets(clamp.name)
        for table, found in zip(tables, ghosts, strict=True):
            rows, edges = np.nonzero(np.isin(sheet.cell_edges[table.cells], facets))
            if len(rows):
                tangents = outward_tangents(sheet, 3 * table.cells[rows] + edges)
                given = clamp_tangent(clamp, tangents)
                table.offset[rows, edges] = tangents if clamp.natural else given(0.0)
                found.append(Ghosts(rows, edges, given))
    batches = list(zip(tables, ghosts, strict=True))
    return ShellTerm(configuration, batches, panel_data(scene), rest, scene.measure or "tan")


def make_constraints(scene: Scene, configuration: Configuration) -> Constraints:
    """Prescribed displacements."""
    constraints = Constraints(configuration)
    for spec in scene.motions:
        vertices = place_vertices(scene.sheet, spec.name)
        for axis, value in enumerate(spec.components):
            if value is not None:
                label = f"move {spec.name!r} {'xyz'[axis]}"
                f = displacement_function(value, scene.sheet.rest[vertices], label)
                constraints.add(3 * vertices + axis, f, label)
    return constraints


def load_terms(
    scene: Scene, configuration: Configuration, sides: EdgeSides, functions: SheetFunctions
) -> list[Term]:
    """One term a load."""
    makers = {
        "point": point_load,
        "line": line_load,
        "area": area_load,
        "pressure": pressure_load,
    }
    return [
        edge_moment(scene, configuration, sides, spec)
        if spec.kind == "moment"
        else makers[spec.kind](configuration, functions, spec)
        for spec in scene.loads
    ]


def point_load(configuration: Configuration, functions: SheetFunctions, spec: LoadSpec) -> Term:
    """Dead force on the rank that owns the point."""
    vertices = place_vertices(configuration.sheet, spec.name)
    vertices = vertices[vertices < configuration.nv_owned]
    return loads.NodalLoad(vertices, np.ones(len(vertices)), spec.value)


def line_load(configuration: Configuration, functions: SheetFunctions, spec: LoadSpec) -> Term:
    """Dead force per rest length, half of each owned edge's to either end."""
    sheet = configuration.sheet
    facets = sheet.edge_facets(spec.name)
    ends = sheet.edge_vertices()[facets[facets < sheet.num_owned_edges]]
    length = np.linalg.norm(sheet.rest[ends[:, 1]] - sheet.rest[ends[:, 0]], axis=1)
    return loads.NodalLoad(ends.ravel(), np.repeat(0.5 * length, 2), spec.value)


def _panel_indicator(sheet: SheetMesh, name: str) -> np.ndarray:
    indicator = np.zeros(len(sheet.cells))
    indicator[sheet.panel_cells(name)] = 1.0
    return indicator


def area_load(configuration: Configuration, functions: SheetFunctions, spec: LoadSpec) -> Term:
    """Dead force per rest area."""
    density = _panel_indicator(configuration.sheet, spec.name)
    return loads.area_load(functions, density, spec.value)


def pressure_load(configuration: Configuration, functions: SheetFunctions, spec: LoadSpec) -> Term:
    """Follower pressure."""
    density = _panel_indicator(configuration.sheet, spec.name)
    return loads.follower_pressure(functions, density, spec.value)


def edge_moment(
    scene: Scene, configuration: Configuration, sides: EdgeSides, spec: LoadSpec
) -> Term:
    """Moment on the owned triangles' sides of a boundary."""
    sheet = scene.sheet
    facets = sheet.edge_facets(spec.name)
    owned = np.flatnonzero(np.isin(sides.facet[: 3 * sheet.num_owned_cells], facets))
    clamped = clamped_facets(scene, sides)
    with together(sheet.comm):
        if (sides.count[owned] > 1).any():
            raise SceneError(f"edge moment {spec.name!r}: an edge of two triangles is no boundary")
        if np.isin(sides.facet[owned], clamped).any():
            raise SceneError(f"edge moment {spec.name!r}: the edge is clamped")
    ends = side_ends(sheet, owned)
    verts = np.column_stack([ends, sheet.cells.ravel()[owned], ends[:, 0]]).astype(np.int32)
    slots = np.zeros((len(owned), 0), dtype=np.int32)
    if scene.bending == "director":
        slots = configuration.slot(DIRECTOR)[sides.facet[owned]][:, None]
    n = len(owned)
    hinge = kernels.HingeStencil(
        verts,
        outward_tangents(sheet, owned),
        np.full(n, -1.0),
        np.ones(slots.shape),
        np.ascontiguousarray(slots),
    )
    position = (3 * verts[:, :, None] + np.arange(3)).reshape(n, 12)
    dofs = np.hstack([position, 3 * configuration.nv + slots]).astype(np.int32)
    length = np.linalg.norm(sheet.rest[ends[:, 1]] - sheet.rest[ends[:, 0]], axis=1)
    return loads.EdgeMoment(configuration, hinge, dofs, length, spec.value)
