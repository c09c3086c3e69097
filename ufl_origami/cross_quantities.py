"""What two models of one scene are compared in, each with the largest difference allowed.

A quantity takes a sample of a model's state (collective, the same on all ranks) and tells how far
two samples are apart. Samples do not depend on the mesh: a profile is a line of material points.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from ufl_origami.errors import InputError
from ufl_origami.model import Model


class Quantity(ABC):
    """Something that two models of a scene must agree in.

    Attributes:
        tolerance: largest difference allowed.
    """

    tolerance: float

    @property
    @abstractmethod
    def name(self) -> str:
        """Name in tables, with the unit of the difference."""

    @abstractmethod
    def sample(self, model: Model) -> Any:
        """What a model's current state gives, the same on all ranks; collective."""

    @abstractmethod
    def difference(self, first: Any, second: Any) -> float:
        """How far two samples are apart, not negative."""

    def number(self, sample: Any) -> float | None:
        """The sample as tables show it, None where it is not one number."""
        return float(sample)


@dataclass(frozen=True)
class FoldAngle(Quantity):
    """Mean fold angle of a crease.

    Attributes:
        crease: name of the crease.
        tolerance: degrees.
    """

    crease: str
    tolerance: float = 0.1

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"fold angle {self.crease} (deg)"

    def sample(self, model: Model) -> float:
        """Length-weighted mean (degrees), valley positive."""
        return float(np.degrees(model.mean_fold_angle(self.crease)))

    def difference(self, first: float, second: float) -> float:
        """Degrees."""
        return abs(first - second)


@dataclass(frozen=True)
class Reaction(Quantity):
    """Component of the force by which the supports hold a named place.

    Attributes:
        place: named point, edge set or panel.
        axis: "x", "y" or "z".
        tolerance: relative to the larger of the two forces.
    """

    place: str
    axis: str
    tolerance: float = 0.01

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"force {self.place} {self.axis} (rel)"

    def sample(self, model: Model) -> float:
        """Force along the axis."""
        return float(model.reaction(self.place)["xyz".index(self.axis)])

    def difference(self, first: float, second: float) -> float:
        """Relative to the larger one, 0 between two zeros."""
        scale = max(abs(first), abs(second))
        return abs(first - second) / scale if scale else 0.0


@dataclass(frozen=True)
class Displacement(Quantity):
    """Component of the displacement of a named point.

    Attributes:
        point: named point.
        axis: "x", "y" or "z".
        length: length to which the difference is relative.
        tolerance: of the difference over the length.
    """

    point: str
    axis: str
    length: float
    tolerance: float = 2e-3

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"displacement {self.point} {self.axis} (/ L)"

    def sample(self, model: Model) -> float:
        """Displacement along the axis."""
        sheet, axis = model.sheet, "xyz".index(self.axis)
        vertex = sheet.point_vertex(self.point)
        rest = sheet.rest[vertex, axis] if 0 <= vertex < sheet.num_owned_vertices else 0.0
        return float(model.position(self.point)[axis] - model.configuration.sum(rest))

    def difference(self, first: float, second: float) -> float:
        """Over the length."""
        return abs(first - second) / self.length


@dataclass(frozen=True)
class Energy(Quantity):
    """Elastic energy of one kind, or of all kinds but that of the loads.

    Attributes:
        kind: "membrane", "bending", "crease", or "total"; a kind that the scene lacks is zero.
        tolerance: relative to the larger of the two totals.
    """

    kind: str
    tolerance: float = 0.01

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"energy {self.kind} (/ total)"

    def sample(self, model: Model) -> tuple[float, float]:
        """Energy of the kind, total."""
        energies = {kind: e for kind, e in model.energies().items() if kind != "load"}
        total = sum(energies.values())
        return (total if self.kind == "total" else energies.get(self.kind, 0.0)), total

    def difference(self, first: tuple[float, float], second: tuple[float, float]) -> float:
        """Relative to the larger total, 0 between sheets without energy."""
        scale = max(abs(first[1]), abs(second[1]))
        return abs(first[0] - second[0]) / scale if scale else 0.0

    def number(self, sample: tuple[float, float]) -> float:
        """Energy of the kind."""
        return sample[0]


@dataclass(frozen=True)
class Line:
    """Current positions of a line of material points.

    Attributes:
        place: rest arc length over the whole one, from 0 to 1 (n,).
        points: current positions (n, 3).
    """

    place: np.ndarray
    points: np.ndarray


@dataclass(frozen=True)
class Profile(Quantity):
    """Shape of a line of edges: largest distance of its material points, over a width.

    Attributes:
        edges: name of an edge set that is one open line.
        width: length to which the distance is relative: that of a panel.
        tolerance: of the distance over the width.
        plane: axes of the figure.
    """

    edges: str
    width: float = 1.0
    tolerance: float = 2e-3
    plane: tuple[str, str] = ("x", "z")

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"profile {self.edges} (/ W)"

    def sample(self, model: Model) -> Line:
        """The line's vertices."""
        return material_line(model, self.edges)

    def difference(self, first: Line, second: Line) -> float:
        """Maximum over the vertices of the coarser line of their distance from the finer one.

        The finer line is interpolated at the same places of the material: its chords, not those
        of the coarser one, stand for the curve in between.
        """
        coarse, fine = sorted((first, second), key=lambda line: len(line.place))
        there = [np.interp(coarse.place, fine.place, x) for x in fine.points.T]
        distance = np.linalg.norm(coarse.points - np.column_stack(there), axis=1)
        return float(distance.max()) / self.width

    def number(self, sample: Line) -> None:
        """A shape is not one number."""


def material_line(model: Model, edges: str) -> Line:
    """Vertices of an edge set in their order along it, on all ranks; collective.

    The line begins at that end whose rest coordinates come first (x, then y, then z).

    Raises:
        InputError: the edges are not one open line.
    """
    sheet, positions = model.sheet, model.state.x
    facets = sheet.edge_facets(edges)
    ends = sheet.edge_vertices()[facets[facets < sheet.num_owned_edges]]
    parts = sheet.comm.allgather((sheet.input_vertex[ends], sheet.rest[ends], positions[ends]))
    pairs, rest, now = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    names, first = np.unique(pairs, return_index=True)
    order = _open_line(np.searchsorted(names, pairs), edges)
    rest, now = (values.reshape(-1, 3)[first[order]] for values in (rest, now))
    if tuple(rest[0]) > tuple(rest[-1]):
        rest, now = rest[::-1], now[::-1]
    length = np.append(0.0, np.linalg.norm(np.diff(rest, axis=0), axis=1).cumsum())
    return Line(length / length[-1], now)


def _open_line(pairs: np.ndarray, name: str) -> list[int]:
    """Vertices 0..n-1 of edges (n - 1, 2) in their order along an open line."""
    neighbours: list[list[int]] = [[] for _ in range(int(pairs.max(initial=0)) + 1)]
    for start, end in pairs:
        neighbours[start].append(int(end))
        neighbours[end].append(int(start))
    ends = [vertex for vertex, others in enumerate(neighbours) if len(others) == 1]
    line = ends[:1]
    while line:
        onward = [vertex for vertex in neighbours[line[-1]] if vertex not in line[-2:]]
        if len(onward) != 1:
            break
        line += onward
    if len(ends) != 2 or len(line) != len(neighbours):
        raise InputError(f"edge set {name!r} is not one open line")
    return line
