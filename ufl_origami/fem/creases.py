"""Creases of the FEM model: springs on the virtual fold angles at the edges' Gauss points."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ufl_origami.configuration import Configuration, State
from ufl_origami.constraints import Constraints
from ufl_origami.crease_laws import CreaseLaw, LinearLaw
from ufl_origami.declared import declared_springs, held_angle
from ufl_origami.errors import SceneError
from ufl_origami.fem.unknowns import fold_angle_names
from ufl_origami.scene import Scene
from ufl_origami.scene_parts import CreaseSpec
from ufl_origami.sheet import SheetMesh
from ufl_origami.sides import EdgeFan, fold_combination, full_turns
from ufl_origami.terms.base import StencilTerm


def turn_about(axis: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Angle (n,) about axes (n, 3) from one direction to another."""
    axis = axis / np.linalg.norm(axis, axis=1)[:, None]
    sine = (axis * np.cross(start, end)).sum(axis=1)
    cosine = (start * end).sum(axis=1) - (start * axis).sum(axis=1) * (end * axis).sum(axis=1)
    return np.arctan2(sine, cosine)


def side_normals(nodes: np.ndarray, sides: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tangents and normals (n, 3) at the midpoints of sides 3 * cell + e, not normalised.

    Args:
        nodes: (nc, 6, 3) corners and opposite midpoints of P2 triangles.
        sides: (n,).
    """
    cell, e = np.divmod(sides, 3)
    f, g = (e + 1) % 3, (e + 2) % 3
    corner = [nodes[cell, k] for k in (e, f, g)]
    middle = [nodes[cell, 3 + k] for k in (e, f, g)]
    along = corner[2] - corner[1]
    inward = 2 * (middle[1] + middle[2] - middle[0]) - corner[0] - 0.5 * (corner[1] + corner[2])
    return along, np.cross(along, inward)


def side_angle(nodes: np.ndarray, fan: EdgeFan, pair: tuple[int, int]) -> np.ndarray:
    """Fold angles (n,) at the midpoints of a crease's edges, within half a turn, valley positive.

    The orientation is that of the first side's panel.
    """
    r, s = pair
    along, first = side_normals(nodes, fan.sides[:, r])
    _, second = side_normals(nodes, fan.sides[:, s])
    opposed = fan.consistent[:, r] * fan.consistent[:, s]
    if r and s:
        opposed = -opposed
    return turn_about(along, opposed[:, None] * second, first)


@dataclass(frozen=True)
class FemCrease:
    """Edges of a crease and the spring between two of its sides.

    Attributes:
        fan: edges.
        sides: positions of the two sides.
        slot: (n, 2, 2) local scalar indices by Gauss point and virtual angle, -1 where unused.
        coefficient: (n, 2) factors of the virtual angles.
        constant: (n,) radians.
        nodes: function of a state giving the nodes (nc, 6, 3) of the local triangles.
    """

    fan: EdgeFan
    sides: tuple[int, int]
    slot: np.ndarray
    coefficient: np.ndarray
    constant: np.ndarray
    nodes: Callable[[State], np.ndarray]

    def angles(self, scalars: np.ndarray) -> np.ndarray:
        """Virtual fold angles (n, 2) at the Gauss points (radians)."""
        if not len(self.slot):
            return np.zeros((0, 2))
        used = np.where(self.slot >= 0, scalars[np.maximum(self.slot, 0)], 0.0)
        return self.constant[:, None] + (self.coefficient[:, None] * used).sum(axis=2)

    def virtual_angle(self, state: State) -> np.ndarray:
        """Mean virtual fold angle (n,) of each edge (radians)."""
        return self.angles(state.scalars).mean(axis=1)

    def mesh_angle(self, state: State) -> np.ndarray:
        """Dihedral angle (n,) of the triangles at each edge's middle, near the virtual one."""
        angle, near = side_angle(self.nodes(state), self.fan, self.sides), self.virtual_angle(state)
        return angle + 2 * np.pi * np.round((near - angle) / (2 * np.pi))


@dataclass(frozen=True)
class FemSpring:
    """One declared spring.

    Attributes:
        spec: its declaration.
        crease: edges and angles.
        rest: fold angles (n,) of the rest shape (radians).
    """

    spec: CreaseSpec
    crease: FemCrease
    rest: np.ndarray

    def law(self) -> CreaseLaw:
        """Its law on the angles (n,) at one Gauss point of each edge."""
        rest = self.rest if self.spec.rest_angle is None else self.spec.rest_angle
        return self.spec.law or LinearLaw(self.spec.stiffness, rest)


def rest_fold_angles(sheet: SheetMesh, fan: EdgeFan, nodes: np.ndarray) -> np.ndarray:
    """Fold angles (n, m - 1) of the rest shape between side 0 and each other side."""
    angles = [side_angle(nodes, fan, (0, k)) for k in range(1, len(fan.panels))]
    return np.stack(angles, axis=1)


def fem_springs(
    scene: Scene,
    configuration: Configuration,
    fans: Mapping[str, EdgeFan],
    rest_angles: Mapping[str, np.ndarray],
    nodes: Callable[[State], np.ndarray],
) -> list[FemSpring]:
    """Springs of all creases, in the order of their declaration.

    Raises:
        SceneError: see `declared_springs`.
    """
    springs = []
    for spec, fan, pair in declared_springs(scene, fans):
        rest, n = rest_angles[spec.name], len(fan.facets)
        slot, coefficient = np.full((n, 2, 2), -1, dtype=np.int32), np.zeros((n, 2))
        shape, constant = np.zeros(n), np.zeros(n)
        for column, (k, sign) in enumerate(fold_combination(fan, pair)):
            for q, name in enumerate(fold_angle_names(k)):
                slot[:, q, column] = configuration.slot(name)[fan.facets]
            coefficient[:, column] = sign
            shape += sign * rest[:, k - 1]
        if all(pair):
            constant = full_turns(shape)
        crease = FemCrease(fan, pair, slot, coefficient, constant, nodes)
        springs.append(FemSpring(spec, crease, shape + constant))
    return springs


class FoldTerm(StencilTerm):
    """Energy of one spring: int w(phi) along the crease, by two Gauss points an edge.

    Args:
        configuration: numbering of the unknowns.
        spring: the spring.
    """

    kinds = ("crease",)

    def __init__(self, configuration: Configuration, spring: FemSpring):
        crease = spring.crease
        self.crease, self._given, self._time = crease, spring.law(), 0.0
        self._laws = [self._given, self._given]
        dofs = np.where(crease.slot >= 0, 3 * configuration.nv + crease.slot, -1)
        self._dofs = dofs.reshape(-1, 2).astype(np.int32)
        self._rate = np.repeat(crease.coefficient, 2, axis=0)
        self._share = np.repeat(0.5 * crease.fan.length, 2)

    def set_time(self, time: float) -> None:
        """Time at which the law is taken."""
        self._time = time

    def stencils(self) -> list[np.ndarray]:
        """Virtual angles at each Gauss point."""
        return [self._dofs]

    def _law(self, state: State) -> list[np.ndarray]:
        """Energy, moment and stiffness (2 n,) of the points, times their lengths."""
        angles = self.crease.angles(state.scalars).T
        points = [law(a, self._time) for law, a in zip(self._laws, angles, strict=True)]
        kinds = zip(*points, strict=True)
        return [self._share * np.stack(kind, axis=1).ravel() for kind in kinds]

    def energies(self, state: State) -> np.ndarray:
        """Energy of this rank's edges."""
        return np.array([self._law(state)[0].sum()])

    def add_residual(self, state: State, out: np.ndarray) -> None:
        """Add the moments to the virtual angles."""
        moment = self._law(state)[1][:, None] * self._rate
        used = self._dofs >= 0
        np.add.at(out, self._dofs[used], moment[used])

    def tangent(self, state: State, blocks: list[np.ndarray]) -> None:
        """Write the rotational stiffness at each Gauss point."""
        k = self._rate
        blocks[0][:] = self._law(state)[2][:, None, None] * k[:, :, None] * k[:, None, :]

    def refer(self, scalars: np.ndarray, factor: float) -> None:
        """Take edge unknowns (ns,) as stress-free, and the law's stiffness there times a factor.

        Where the law's moment falls there is none.
        """
        angles = self.crease.angles(scalars).T
        stiffness = [np.maximum(self._given(a, self._time)[2], 0.0) for a in angles]
        pairs = zip(stiffness, angles, strict=True)
        self._laws = [LinearLaw(factor * k, angle) for k, angle in pairs]

    def largest_turn(self, state: State, step: np.ndarray) -> float:
        """Largest change (radians) of the virtual fold angles over a step."""
        change = np.where(self._dofs >= 0, step[self._dofs], 0.0) * self._rate
        return float(np.abs(change.sum(axis=1)).max(initial=0.0))


def hold_stiff_folds(springs: list[FemSpring], constraints: Constraints) -> None:
    """Hold the virtual angles of folds with infinite stiffness at their rest angle.

    Raises:
        SceneError: a stiff fold between two panels neither of which is the crease's first.
    """
    for spring in springs:
        if not spring.spec.stiff:
            continue
        label = f"stiff fold {spring.spec.name!r}"
        if 0 not in spring.crease.sides:
            raise SceneError(f"{label}: it must join the crease's first panel and another")
        dofs = 3 * constraints.configuration.nv + spring.crease.slot[:, :, 0]
        sign, rest = np.repeat([spring.crease.coefficient[:, 0], spring.rest], 2, axis=1)
        constraints.add(dofs.ravel(), held_angle(spring.spec, sign, rest), label)
