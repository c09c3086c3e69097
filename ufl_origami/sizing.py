"""Triangle sizes in space, and the nodes that they ask for along the edges of a pattern."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

#: Slope with which sizes grow away from a finer edge or a refinement: size per distance.
GROWTH = 0.3
#: Sizes along an edge are sampled at this many places to spread its nodes.
SAMPLES = 513


@dataclass(frozen=True)
class Refinement:
    """Smaller triangles near a named part of a pattern.

    The size is `size` up to the distance `radius` from the part, measured straight through space,
    and grows by `growth` per distance from there on.

    Attributes:
        near: name of a point, a crease, a boundary or a line of the pattern.
        size: length of the triangles' sides there.
        radius: distance up to which they keep this size.
        growth: slope of the size beyond.
    """

    near: str
    size: float
    radius: float = 0.0
    growth: float = GROWTH


@dataclass(frozen=True)
class Source:
    """Size round one segment (a point when its ends coincide)."""

    start: Sequence[float]
    end: Sequence[float]
    size: float
    radius: float = 0.0
    growth: float = GROWTH

    def at(self, point: Sequence[float]) -> float:
        """Return the size at a point (3 coordinates)."""
        (ax, ay, az), (bx, by, bz) = self.start, self.end
        ex, ey, ez = bx - ax, by - ay, bz - az
        px, py, pz = point[0] - ax, point[1] - ay, point[2] - az
        squared = ex * ex + ey * ey + ez * ez
        t = (px * ex + py * ey + pz * ez) / squared if squared > 0.0 else 0.0
        t = min(max(t, 0.0), 1.0)
        gap = math.sqrt((px - t * ex) ** 2 + (py - t * ey) ** 2 + (pz - t * ez) ** 2)
        return self.size + self.growth * max(0.0, gap - self.radius)


def source(ends: np.ndarray, size: float, radius: float = 0.0, growth: float = GROWTH) -> Source:
    """Return the source round a segment with the ends (2, 3)."""
    start, end = ([float(c) for c in x] for x in ends)
    return Source(start, end, size, radius, growth)


def size_field(limit: float, sources: Sequence[Source]) -> Callable[[Sequence[float]], float]:
    """Return the size at a point: the least of the limit and of what the sources ask for."""
    return lambda point: min([limit, *(s.at(point) for s in sources)])


@dataclass(frozen=True)
class Spacing:
    """How many nodes an edge wants, and where.

    Attributes:
        place: (s,) places along the edge, 0 to 1.
        wanted: (s,) number of segments wanted from the start to each place.
    """

    place: np.ndarray
    wanted: np.ndarray

    @property
    def count(self) -> int:
        """Least number of segments none of which is longer than wanted (but for rounding)."""
        return max(1, math.ceil(self.wanted[-1] - 1e-6))

    def nodes(self, count: int) -> np.ndarray:
        """Return (count + 1,) places along the edge, 0 to 1, that share the wanted sizes evenly."""
        return np.interp(np.linspace(0.0, self.wanted[-1], count + 1), self.wanted, self.place)


def edge_spacing(
    start: np.ndarray, end: np.ndarray, limit: float, sources: Sequence[Source]
) -> Spacing:
    """Return the spacing of nodes on a straight edge; limit is its largest size."""
    length = float(np.linalg.norm(end - start))
    if not sources:
        return Spacing(np.array([0.0, 1.0]), np.array([0.0, length / limit]))
    place = np.linspace(0.0, 1.0, SAMPLES)
    size = size_field(limit, sources)
    density = np.array([length / size(start + t * (end - start)) for t in place])
    steps = 0.5 * (density[1:] + density[:-1]) / (SAMPLES - 1)
    return Spacing(place, np.concatenate([[0.0], np.cumsum(steps)]))
