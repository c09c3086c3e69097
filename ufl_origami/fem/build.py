"""From a scene to its FEM model: exactly the unknowns and terms that it names."""

import numpy as np

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
from ufl_origami.fem.creases import FoldTerm, fem_springs, hold_stiff_folds, rest_fold_angles
from ufl_origami.fem.elements import flat_elements
from ufl_origami.fem.moment import FemEdgeMoment
from ufl_origami.fem.shell import ClampedSides, FemShellTerm, rest_nodes
from ufl_origami.fem.unknowns import edge_unknowns, fold_angle_names, node_dofs, tilt_table
from ufl_origami.model import CreaseModel, Model
from ufl_origami.problem import Problem
from ufl_origami.quality import warn_mesh
from ufl_origami.scene import Scene
from ufl_origami.scene_parts import LoadFactor
from ufl_origami.sides import edge_fan, edge_sides
from ufl_origami.surroundings import surrounding_terms
from ufl_origami.terms.base import Term
from ufl_origami.terms.damping import ElasticTerms
from ufl_origami.terms.form import SheetFunctions
from ufl_origami.terms.loads import Amplitude


def build_fem(scene: Scene) -> Model:
    """Make the FEM model of a scene, at rest.

    Raises:
        SceneError: a crease without spring, a clamp on an edge that is no boundary, conditions
            that contradict each other.
    """
    sheet = scene.sheet
    sides = edge_sides(sheet)
    warn_mesh(scene, sides)
    clamped = clamped_facets(scene, sides)
    configuration = Configuration(sheet, edge_unknowns(sheet, clamped))
    fans = {name: edge_fan(sheet, sides, name) for name in sheet.creases}
    rest, dofs = rest_nodes(configuration), node_dofs(configuration)
    angles = {name: rest_fold_angles(sheet, fan, rest) for name, fan in fans.items()}
    x = rest_vector(configuration, fans, angles)
    n = sheet.num_owned_cells
    elements = flat_elements(rest[:n, :3], ~np.isin(sheet.cell_edges[:n], clamped))
    start = x.copy()

    def panels() -> FemShellTerm:
        return FemShellTerm(
            configuration,
            elements,
            tilt_table(configuration, sides),
            panel_data(scene),
            clamped_sides(scene),
            configuration.state(start, 0.0),
        )

    shell = panels()

    def nodes(state: State) -> np.ndarray:
        return rest + state.q[dofs]

    def moment(name: str, value: Amplitude) -> Term:
        loaded = moment_sides(scene, sides, name)
        return FemEdgeMoment(configuration, shell, loaded, value)

    functions, factor = SheetFunctions.create(configuration), LoadFactor()
    springs = fem_springs(scene, configuration, fans, angles, nodes)

    def folds() -> list[FoldTerm]:
        return [FoldTerm(configuration, spring) for spring in springs if not spring.spec.stiff]

    terms: list[Term] = [shell, *folds()]
    terms += load_terms(scene, configuration, functions, factor, moment)
    around, in_time = surrounding_terms(scene, configuration, functions, factor)
    terms += around + [maker(configuration, functions) for maker in scene.terms]
    constraints = make_constraints(scene, configuration, factor)
    hold_stiff_folds(springs, constraints)
    problem = Problem(configuration, terms, constraints)
    problem.set_time(0.0)
    creases: dict[str, CreaseModel] = {s.spec.name: s.crease for s in reversed(springs)}
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
        elastic=lambda: ElasticTerms(panels(), folds()),
    )


def rest_vector(configuration: Configuration, fans, rest_angles):
    """Unknowns of the stress-free state: virtual angles of the rest shape, all else zero."""
    x = configuration.create_vector()
    for name, fan in fans.items():
        for k, angle in enumerate(rest_angles[name].T, start=1):
            for unknown in fold_angle_names(k):
                slot = configuration.slot(unknown)[fan.facets]
                x.array_w[3 * configuration.nv_owned + slot] = angle
    x.assemble()
    return x


def clamped_sides(scene: Scene) -> list[ClampedSides]:
    """Sides of owned triangles at the scene's clamps."""
    sheet, found = scene.sheet, []
    for clamp in scene.clamps:
        facets = sheet.edge_facets(clamp.name)
        cells, edges = np.nonzero(np.isin(sheet.cell_edges[: sheet.num_owned_cells], facets))
        tangents = outward_tangents(sheet, 3 * cells + edges)
        given = clamp_tangent(clamp, tangents)
        stress_free = tangents if clamp.natural else given(0.0)
        found.append(ClampedSides(cells, edges, given, stress_free))
    return found
