"""What a scene's surroundings come to in any discretisation: their terms, and its masses."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from ufl_origami.attached import spread_body
from ufl_origami.collective import together
from ufl_origami.configuration import Configuration
from ufl_origami.errors import SceneError
from ufl_origami.model import Model, place_nodes, place_vertices
from ufl_origami.motion import Motion
from ufl_origami.scene import Scene
from ufl_origami.scene_parts import LoadFactor, vector_function
from ufl_origami.scene_surroundings import FrictionSpec, ObstacleSpec, field_varies
from ufl_origami.terms import loads
from ufl_origami.terms.base import Term
from ufl_origami.terms.contact import ContactTerm, Surface, touch
from ufl_origami.terms.damping import MassDamping, ViscousFold, ViscousShell
from ufl_origami.terms.form import SheetFunctions
from ufl_origami.terms.friction import friction_term
from ufl_origami.terms.inertia import Mass, mass_matrix
from ufl_origami.terms.magnetic import MagneticTerm


@dataclass(frozen=True)
class NodeMasses:
    """Masses on this rank's nodes, owned or ghost; contributions of all ranks add up.

    Attributes:
        dofs: (n, 3) local unknowns.
        masses: (n,).
    """

    dofs: np.ndarray
    masses: np.ndarray


def surface_density(scene: Scene) -> np.ndarray:
    """Mass per rest area (nc,) of the local cells.

    Raises:
        SceneError: a panel without density.
    """
    sheet = scene.sheet
    materials = [scene.panel_material(name) for name in sheet.panel_names]
    without = [n for n, m in zip(sheet.panel_names, materials, strict=True) if not m.rho]
    if without:
        raise SceneError(f"panels without density (Material(rho=...)): {without}")
    return np.array([m.rho * m.h for m in materials])[sheet.cell_panel]


def attached_masses(scene: Scene, configuration: Configuration) -> NodeMasses:
    """Masses of the bodies attached to points and places; collective.

    Raises:
        SceneError: a body that the nodes of its place cannot carry.
    """
    dofs, masses = [np.zeros((0, 3), dtype=int)], [np.zeros(0)]
    for spec in scene.masses:
        if spec.inertia is None:
            vertices = place_vertices(configuration.sheet, spec.name)
            vertices = vertices[vertices < configuration.nv_owned]
            dofs.append(3 * vertices[:, None] + np.arange(3))
            masses.append(np.full(len(vertices), spec.mass))
        else:
            nodes = place_nodes(configuration, spec.name)
            owned = configuration.owns(nodes.dofs[:, 0])
            dofs.append(nodes.dofs[owned])
            masses.append(spread_body(configuration.comm, nodes.rest[owned], spec))
    return NodeMasses(np.vstack(dofs), np.concatenate(masses))


def launch_velocity(scene: Scene, rest: np.ndarray) -> np.ndarray:
    """Velocities (n, 3) at the start of nodes with places (n, 3) at rest.

    Raises:
        SceneError: on this rank: a function that does not give finite velocities.
    """
    velocity = np.zeros_like(rest)
    for launch in scene.launches:
        part = np.asarray(launch(rest) if callable(launch) else launch, dtype=float)
        if part.shape not in ((3,), rest.shape):
            raise SceneError(f"launch: expected velocities {rest.shape}, got {part.shape}")
        if not np.isfinite(part).all():
            raise SceneError("launch: a velocity is not finite")
        velocity += part
    return velocity


def make_motion(scene: Scene, configuration: Configuration, functions: SheetFunctions) -> Motion:
    """Masses of a scene, with the velocities at its start; collective.

    Raises:
        SceneError: on all ranks, see `surface_density`, `attached_masses`, `launch_velocity`.
    """
    matrix = mass_matrix(configuration, functions, surface_density(scene))
    extra = attached_masses(scene, configuration)
    diagonal = np.zeros(configuration.num_local)
    np.add.at(diagonal, extra.dofs, extra.masses[:, None])
    motion = Motion(configuration, functions, Mass(matrix + sparse.diags(diagonal, format="csr")))
    with together(configuration.comm):
        velocity = launch_velocity(scene, functions.V.tabulate_dof_coordinates())
    owned = configuration.owns(functions.dofs)
    places = configuration.owned_dofs(functions.dofs[owned])
    motion.v.array_w[places] = velocity.ravel()[owned]
    return motion


def surrounding_terms(
    scene: Scene, configuration: Configuration, functions: SheetFunctions, factor: LoadFactor
) -> tuple[list[Term], list[Term]]:
    """Terms of gravity, obstacles and magnets, and those that act in time only; collective.

    Raises:
        SceneError: magnets without a field or a field without magnets, friction that acts nowhere.
    """
    terms: list[Term] = []
    for weight in scene.weights:
        terms += gravity_terms(
            scene, configuration, functions, vector_function(weight, "g", factor)
        )
    terms += magnetic_terms(scene, functions, factor)
    contacts = {spec.name: contact_term(spec, configuration, functions) for spec in scene.obstacles}
    frictions: list[Term] = [
        friction_term(contact, spec.law, rubbing(spec, contact), lagged=spec.lagged)
        for spec in scene.frictions
        for contact in [contacts[spec.obstacle]]
    ]
    return [*terms, *contacts.values()], frictions


def gravity_terms(
    scene: Scene, configuration: Configuration, functions: SheetFunctions, g: loads.VectorFunction
) -> list[Term]:
    """Weight of the panels, and of attached masses where there are any."""
    density = surface_density(scene)
    terms: list[Term] = [loads.area_load(functions, density, g, kind="gravity")]
    if scene.masses:
        extra = attached_masses(scene, configuration)
        terms.append(loads.NodalLoad(extra.dofs, extra.masses, g, kind="gravity"))
    return terms


def magnetic_terms(scene: Scene, functions: SheetFunctions, factor: LoadFactor) -> list[Term]:
    """Energy of the magnetised panels in the field.

    Raises:
        SceneError: magnets without a field, or a field without magnets.
    """
    if bool(scene.magnets) != bool(scene.magnetic_fields):
        missing = "magnetic field" if scene.magnets else "magnetised panel"
        raise SceneError(f"the scene has no {missing}")
    if not scene.magnets:
        return []
    sheet, (field,) = scene.sheet, scene.magnetic_fields
    remanence = np.array([scene.magnets.get(n, np.zeros(3)) for n in sheet.panel_names])
    thickness = np.array([scene.panel_material(n).h for n in sheet.panel_names])
    varies = field_varies(field)
    value: Any = field if varies else vector_function(field, "magnetic field", factor)
    cells = sheet.cell_panel
    return [MagneticTerm(functions, remanence[cells], thickness[cells], value, varies=varies)]


def contact_term(
    spec: ObstacleSpec, configuration: Configuration, functions: SheetFunctions
) -> ContactTerm:
    """Barrier of one obstacle."""
    motion = spec.motion or (lambda time: np.zeros(3))
    surface = Surface(spec.name, spec.body, spec.barrier, motion)
    at = touch(functions, surface, touching(configuration, functions, spec.on))
    return ContactTerm(configuration, functions, at)


def rubbing(spec: FrictionSpec, contact: ContactTerm) -> np.ndarray:
    """1 at the nodes (nd,) that have a friction, else 0; collective.

    Raises:
        SceneError: on all ranks; no place of the friction can touch the obstacle.
    """
    share = touching(contact.configuration, contact.functions, spec.on) * contact.at.sum.nodes
    if not contact.configuration.sum(share.sum()):
        raise SceneError(
            f"friction on {spec.obstacle!r}: none of {list(spec.on)} can touch the obstacle"
        )
    return share


def touching(
    configuration: Configuration, functions: SheetFunctions, places: Sequence[str]
) -> np.ndarray:
    """1 at the nodes (nd,) of the places, or at all where none is named, else 0; collective."""
    dofs = functions.dofs.reshape(-1, 3)
    if not places:
        return np.ones(len(dofs))
    node = np.full(configuration.num_local, -1)
    node[dofs[:, 0]] = np.arange(len(dofs))
    share = np.zeros(len(dofs))
    for place in places:
        share[node[place_nodes(configuration, place).dofs[:, 0]]] = 1.0
    return share


def damping_terms(model: Model, memory: int) -> list[Term]:
    """Damping of a model that is about to move.

    Args:
        model: the model in its state at the start, its motion made.
        memory: accepted states from which the scheme makes rates.

    Raises:
        SceneError: damping in proportion to the stiffness of a membrane that is a form.
    """
    terms: list[Term] = []
    for spec in model.scene.dampings:
        if spec.mass and model.motion:
            terms.append(MassDamping(model.motion.mass, spec.mass))
        if spec.stiffness:
            if model.scene.membrane == "ufl":
                raise SceneError("damping in proportion to the stiffness needs membrane='kernel'")
            copies = model.elastic()
            branches = model.shell.history()
            copies.shell.restore({name: share.values for name, share in branches.items()})
            terms.append(ViscousShell(copies.shell, spec.stiffness, memory, model.state))
            first = 3 * model.configuration.nv
            terms += [ViscousFold(fold, spec.stiffness, first) for fold in copies.folds]
    return terms
