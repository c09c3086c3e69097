"""From a scene to its discrete model: exactly the unknowns and terms that it names."""

from functools import partial

import numpy as np

from ufl_origami import kernels
from ufl_origami.conditions import (
    clamp_tangent,
    clamped_facets,
    load_terms,
    make_constraints,
    moment_sides,
    outward_tangents,
    panel_data,
)
from ufl_origami.configuration import Configuration, State
from ufl_origami.creases import mesh_angles
from ufl_origami.fem.build import build_fem
from ufl_origami.model import Model
from ufl_origami.problem import Problem
from ufl_origami.quality import warn_mesh
from ufl_origami.scene import Scene
from ufl_origami.scene_parts import LoadFactor
from ufl_origami.sheet import SheetMesh
from ufl_origami.sides import EdgeFan, EdgeSides, edge_fan, edge_sides, side_ends
from ufl_origami.springs import (
    crease_springs,
    first_springs,
    hold_stiff_folds,
    spring_terms,
)
from ufl_origami.stencils import (
    DIRECTOR,
    ShellBatch,
    edge_unknowns,
    fold_angle_name,
    shell_batches,
)
from ufl_origami.surroundings import surrounding_terms
from ufl_origami.terms import loads
from ufl_origami.terms.base import Term
from ufl_origami.terms.damping import ElasticTerms
from ufl_origami.terms.form import SheetFunctions
from ufl_origami.terms.membrane import MembraneForm
from ufl_origami.terms.shell import Ghosts, ShellTerm


def build(scene: Scene) -> Model:
    """Make the discrete model of a scene, at rest.

    Raises:
        SceneError: a crease without spring, a clamp on an edge that is no boundary, conditions
            that contradict each other.

    Warns:
        MeshWarning: the mesh cannot represent the scene's bending form (see quality.py).
    """
    return build_fem(scene) if scene.model == "fem" else build_ddg(scene)


def build_ddg(scene: Scene) -> Model:
    """Make the model of mid-edge shells and creases with virtual fold angles."""
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
    functions = SheetFunctions.create(configuration)
    terms = [shell, *spring_terms(springs, configuration)]
    factor = LoadFactor()
    moment = partial(edge_moment, scene, configuration, sides)
    terms += load_terms(scene, configuration, functions, factor, moment)
    if scene.membrane == "ufl":
        terms.append(MembraneForm(functions, panel_data(scene)))
    around, in_time = surrounding_terms(scene, configuration, functions, factor)
    terms += around + [maker(configuration, functions) for maker in scene.terms]
    constraints = make_constraints(scene, configuration, factor)
    hold_stiff_folds(springs, constraints)
    problem = Problem(configuration, terms, constraints)
    problem.set_time(0.0)
    creases = first_springs(springs)

    def elastic() -> ElasticTerms:
        return ElasticTerms(
            shell_term(scene, configuration, tables, rest), spring_terms(springs, configuration)
        )

    return Model(
        sheet,
        configuration,
        problem,
        shell,
        creases,
        x,
        scene,
        load_factor=factor,
        functions=functions,
        in_time=in_time,
        elastic=elastic,
    )


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


def edge_moment(
    scene: Scene, configuration: Configuration, sides: EdgeSides, name: str, moment: loads.Amplitude
) -> Term:
    """Moment on the owned triangles' sides of a boundary."""
    sheet = scene.sheet
    owned = moment_sides(scene, sides, name)
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
    return loads.EdgeMoment(configuration, hinge, dofs, length, moment)
