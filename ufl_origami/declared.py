"""Declared springs of a scene's creases: which panels each of them joins, checked."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from ufl_origami.collective import together
from ufl_origami.errors import SceneError
from ufl_origami.scene import Scene
from ufl_origami.scene_parts import CreaseSpec
from ufl_origami.sheet import SheetMesh
from ufl_origami.sides import EdgeFan


def declared_springs(
    scene: Scene, fans: Mapping[str, EdgeFan]
) -> Iterator[tuple[CreaseSpec, EdgeFan, tuple[int, int]]]:
    """Springs in the order of their declaration, each with its crease and two sides; collective.

    Raises:
        SceneError: a crease without spring, two springs between the same panels, or a pair of
            panels that is not at the crease.
    """
    missing = set(scene.sheet.creases) - {spec.name for spec in scene.creases}
    if missing:
        raise SceneError(f"creases without stiffness: {sorted(missing)}")
    refuse_shared_edges(scene.sheet, fans)
    seen: set[tuple[str, frozenset[int]]] = set()
    for spec in scene.creases:
        fan = fans[spec.name]
        pair = spring_sides(scene.sheet, fan, spec)
        if (spec.name, frozenset(pair)) in seen:
            raise SceneError(f"crease {spec.name!r}: a second spring between the same panels")
        seen.add((spec.name, frozenset(pair)))
        yield spec, fan, pair


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


def held_angle(
    spec: CreaseSpec, sign: np.ndarray, shape: np.ndarray
) -> Callable[[float], np.ndarray]:
    """Virtual angles (n,) of a stiff fold as a function of time.

    Args:
        spec: its declaration.
        sign: factors (n,) of the fold angle in the virtual ones.
        shape: fold angles (n,) of the rest shape, held where no rest angle is declared (radians).
    """
    rest = spec.rest_angle
    if rest is None:
        return lambda time: sign * shape
    if callable(rest):
        function: Callable[[float], float] = rest
        return lambda time: sign * function(time)
    number = rest
    return lambda time: sign * number
