"""Numbers of segments of a pattern's edges, equal on opposite sides of mapped faces."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ufl_origami.errors import MeshError

#: A vertex of a face at which the sides turn by more than this (radians) is a corner.
CORNER_ANGLE = 1e-4
#: More segments than this many times the wanted number are a contradiction, not a mesh.
EXCESS = 20.0


@dataclass(frozen=True)
class MappedFace:
    """A face that is to be mapped.

    Attributes:
        label: how errors name it.
        corners: places in the face's loop where it turns, ascending.
        sides: edges of each side, from each corner to the next.
    """

    label: str
    corners: tuple[int, ...]
    sides: tuple[tuple[int, ...], ...]

    def equal_sides(self) -> list[list[tuple[int, ...]]]:
        """Return the groups of sides that need the same number of segments."""
        if len(self.sides) == 3:
            return [list(self.sides)]
        return [list(self.sides[::2]), list(self.sides[1::2])]


def mapped_face(
    label: str, loop: np.ndarray, edges: Sequence[int], *, crisscross: bool
) -> MappedFace:
    """Return the sides of a face from its vertices (k, 3) and the edges that start there.

    Raises:
        MeshError: when the number of sides allows no mapped mesh.
    """
    corners = find_corners(loop)
    if len(corners) != 4 and (crisscross or len(corners) != 3):
        wanted = "four sides" if crisscross else "three or four sides"
        raise MeshError(f"{label} has {len(corners)} sides, a mapped mesh needs {wanted}")
    ends = [*corners[1:], corners[0] + len(loop)]
    twice = [*edges, *edges]
    sides = tuple(tuple(twice[a:b]) for a, b in zip(corners, ends, strict=True))
    return MappedFace(label, tuple(corners), sides)


def find_corners(loop: np.ndarray) -> list[int]:
    """Return the vertices of a closed polygon (k, 3) at which it turns."""
    step = np.roll(loop, -1, axis=0) - loop
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    before = np.roll(step, 1, axis=0)
    sine = np.linalg.norm(np.cross(before, step), axis=1)
    angle = np.arctan2(sine, (before * step).sum(axis=1))
    return [int(i) for i in np.flatnonzero(angle > CORNER_ANGLE)]


def match_counts(
    counts: Sequence[int], wanted: Sequence[float], faces: Sequence[MappedFace]
) -> list[int]:
    """Return numbers of segments, raised until opposite sides of all mapped faces agree.

    Args:
        counts: least number of segments of each edge.
        wanted: length of each edge over its wanted size.
        faces: the mapped faces.

    Raises:
        MeshError: when the faces contradict each other, so that the numbers grow without end.
    """
    result = list(counts)
    limit = EXCESS * (sum(counts) + 10)
    changed = True
    while changed:
        changed = False
        for face in faces:
            changed |= any([_level(result, wanted, group) for group in face.equal_sides()])
            if sum(result) > limit:
                raise MeshError(f"{face.label}: opposite sides cannot have equally many segments")
    return result


def _level(counts: list[int], wanted: Sequence[float], sides: list[tuple[int, ...]]) -> bool:
    """Raise the sides with fewer segments to the largest number; tell whether any was raised."""
    most = max(sum(counts[e] for e in side) for side in sides)
    raised = False
    for side in sides:
        for _ in range(most - sum(counts[e] for e in side)):
            counts[max(side, key=lambda e: wanted[e] / counts[e])] += 1
            raised = True
    return raised
