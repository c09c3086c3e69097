"""Springs of a scene's creases: between which panels, with which rest angle, or held stiff."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ufl_origami.collective import together
from ufl_origami.configuration import Configuration
from ufl_origami.constraints import Constraints
from ufl_origami.creases import EdgeFan, spring_edges
from ufl_origami.errors import SceneError
from ufl_origami.model import CreaseModel
from ufl_origami.scene import CreaseSpec, Scene
from ufl_origami.sheet import SheetMesh
from ufl_origami.terms.base import Term
from ufl_origami.terms.crease import CreaseTerm, LinearLaw


@dataclass(frozen=True)
class Spring:
    """One declared spring on this rank's owned edges.

    Attributes:
        spec: its declaration.
        crease: edges, angle and sides.
        rest: fold angles (n,) of the rest shape, radians.
    """

    spec: CreaseSpec
    crease: CreaseModel
    rest: np.ndarray

    @property
    def stiff(self) -> bool:
        """Whether the fold is held (infinite stiffness) instead of sprung."""
        stiffness = self.spec.stiffness
        return self.spec.law is None and not callable(stiffness) and bool(np.isinf(stiffness))


def crease_springs(
    scene: Scene,
    configuration: Configuration,
    fans: Mapping[str, EdgeFan],
    rest_angles: Mapping[str, np.ndarray],
) -> list[Spring]:
    """Springs of all creases, in the order of their declaration.

    Raises:
        SceneError: a crease without spring, two springs between the same panels, or a pair of
            panels that is not at the crease.
    """
    missing = set(scene.sheet.creases) - {spec.name for spec in scene.creases}
    if missing:
        raise SceneError(f"creases without stiffness: {sorted(missing)}")
    refuse_shared_edges(scene.sheet, fans)
    springs: list[Spring] = []
    seen: set[tuple[str, frozenset[int]]] = set()
    for spec in scene.creases:
        fan = fans[spec.name]
        pair = spring_sides(scene.sheet, fan, spec)
        if (spec.name, frozenset(pair)) in seen:
            raise SceneError(f"crease {spec.name!r}: a second spring between the same panels")
        seen.add((spec.name, frozenset(pair)))
        edges = spring_edges(fan, configuration, pair, rest_angles[spec.name])
        shape = edges.constant.copy()
        for column, k in enumerate(k for k in pair if k):
            shape += edges.coefficient[:, column] * rest_angles[spec.name][:, k - 1]
        springs.append(Spring(spec, CreaseModel(fan, edges, pair), shape))
    return springs


def refuse_shared_edges(sheet: SheetMesh, fans: Mapping[str, EdgeFan]) -> None:
    """Refuse creases that share an edge, which would have the springs of both; collective.

    Raises:
        SceneError: naming two such creases.
    """
    owner: dict[int, str] = {}
    with together(sheet.comm):
        for name, fan in fans.items():
            for facet in map(int, fan.facets):
                if owner.setdefault(facet, name) != name:
                    raise SceneError(f"creases {owner[facet]!r} and {name!r} share an edge")


def spring_sides(sheet: SheetMesh, fan: EdgeFan, spec: CreaseSpec) -> tuple[int, int]:
    """Positions in the fan of the two panels that a spring joins.

    Raises:
        SceneError: no pair where there are more than two panels, or a panel not at the crease.
    """
    if spec.pair is None:
        if len(fan.panels) != 2:
            names = [sheet.panel_names[p] for p in fan.panels]
            raise SceneError(f"crease {spec.name!r} joins {names}: name the pair of each spring")
        return 0, 1
    found = []
    for panel in spec.pair:
        at = np.flatnonzero(fan.panels == sheet.panel_names.index(panel))
        if len(at) != 1:
            raise SceneError(f"crease {spec.name!r}: panel {panel!r} is not at it exactly once")
        found.append(int(at[0]))
    return found[0], found[1]


def spring_terms(springs: Sequence[Spring], configuration: Configuration) -> list[Term]:
    """Energy of each spring that is not held stiff."""
    terms: list[Term] = []
    for spring in springs:
        spec = spring.spec
        if not spring.stiff:
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
        if spring.stiff:
            label = f"stiff fold {spring.spec.name!r}"
            if 0 not in spring.crease.sides:
                raise SceneError(f"{label}: it must join the crease's first panel and another")
            slot = spring.crease.spring.slot[:, 0]
            dofs = 3 * constraints.configuration.nv + slot
            constraints.add(dofs, held_angle(spring), label)


def held_angle(spring: Spring) -> Callable[[float], np.ndarray]:
    """Function of time giving the virtual angles (n,) of a stiff fold."""
    sign, rest = spring.crease.spring.coefficient[:, 0], spring.spec.rest_angle
    if rest is None:
        shape = sign * spring.rest
        return lambda time: shape
    if callable(rest):
        function: Callable[[float], float] = rest
        return lambda time: sign * function(time)
    number = rest
    return lambda time: sign * number


def first_springs(springs: Sequence[Spring]) -> dict[str, CreaseModel]:
    """The first declared spring of each crease, by which its fold angle is reported."""
    models: dict[str, CreaseModel] = {}
    for spring in springs:
        models.setdefault(spring.spec.name, spring.crease)
    return models
