"""Springs of a scene's creases: between which panels, with which rest angle, or held stiff."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ufl_origami.configuration import Configuration, State
from ufl_origami.constraints import Constraints
from ufl_origami.crease_laws import LinearLaw
from ufl_origami.creases import mesh_angles, spring_edges
from ufl_origami.declared import declared_springs, held_angle
from ufl_origami.errors import SceneError
from ufl_origami.model import CreaseModel
from ufl_origami.scene import Scene
from ufl_origami.scene_parts import CreaseSpec
from ufl_origami.sheet import SheetMesh
from ufl_origami.sides import EdgeFan
from ufl_origami.terms.base import Term
from ufl_origami.terms.crease import CreaseEdges, CreaseTerm


@dataclass(frozen=True)
class DdgCrease:
    """Edges of a crease and the spring between two of its sides."""

    sheet: SheetMesh
    fan: EdgeFan
    spring: CreaseEdges
    sides: tuple[int, int]

    def virtual_angle(self, state: State) -> np.ndarray:
        """Virtual fold angle (n,) of each edge (radians)."""
        return self.spring.angle(state.scalars)

    def mesh_angle(self, state: State) -> np.ndarray:
        """Dihedral angle (n,) of the triangles at each edge, near the virtual one."""
        near = self.virtual_angle(state)
        return mesh_angles(self.sheet, self.fan, self.sides, state.x, near)


@dataclass(frozen=True)
class Spring:
    """One declared spring on this rank's owned edges.

    Attributes:
        spec: its declaration.
        crease: edges, angle and sides.
        rest: fold angles (n,) of the rest shape, radians.
    """

    spec: CreaseSpec
    crease: DdgCrease
    rest: np.ndarray


def crease_springs(
    scene: Scene,
    configuration: Configuration,
    fans: Mapping[str, EdgeFan],
    rest_angles: Mapping[str, np.ndarray],
) -> list[Spring]:
    """Springs of all creases, in the order of their declaration.

    Raises:
        SceneError: see `declared_springs`.
    """
    springs: list[Spring] = []
    for spec, fan, pair in declared_springs(scene, fans):
        edges = spring_edges(fan, configuration, pair, rest_angles[spec.name])
        shape = edges.constant.copy()
        for column, k in enumerate(k for k in pair if k):
            shape += edges.coefficient[:, column] * rest_angles[spec.name][:, k - 1]
        springs.append(Spring(spec, DdgCrease(scene.sheet, fan, edges, pair), shape))
    return springs


def spring_terms(springs: Sequence[Spring], configuration: Configuration) -> list[Term]:
    """Energy of each spring that is not held stiff."""
    terms: list[Term] = []
    for spring in springs:
        spec = spring.spec
        if not spring.spec.stiff:
            rest = spring.rest if spec.rest_angle is None else spec.rest_angle
            law = spec.law or LinearLaw(spec.stiffness, rest)
            terms.append(CreaseTerm(configuration, spring.crease.spring, law))
    return terms


def hold_stiff_folds(springs: Sequence[Spring], constraints: Constraints) -> None:
    """Hold the virtual angle of folds with infinite stiffness at their rest angle.

    Raises:
        SceneError: a stiff fold between two panels neither of which is the crease's first.
    """
    for spring in springs:
        if spring.spec.stiff:
            label = f"stiff fold {spring.spec.name!r}"
            if 0 not in spring.crease.sides:
                raise SceneError(f"{label}: it must join the crease's first panel and another")
            slot = spring.crease.spring.slot[:, 0]
            dofs = 3 * constraints.configuration.nv + slot
            sign = spring.crease.spring.coefficient[:, 0]
            constraints.add(dofs, held_angle(spring.spec, sign, spring.rest), label)


def first_springs(springs: Sequence[Spring]) -> dict[str, CreaseModel]:
    """The first declared spring of each crease, by which its fold angle is reported."""
    models: dict[str, CreaseModel] = {}
    for spring in springs:
        models.setdefault(spring.spec.name, spring.crease)
    return models
