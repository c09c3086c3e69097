"""The discrete DDG model of a scene: unknowns, terms, constraints, and what it can measure."""

from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np

from ufl_origami.configuration import Configuration, State, gather_marks
from ufl_origami.creases import EdgeFan, mesh_angles
from ufl_origami.problem import Problem
from ufl_origami.scene import Scene
from ufl_origami.sheet import SheetMesh
from ufl_origami.terms.crease import CreaseEdges
from ufl_origami.terms.shell import ShellTerm


@dataclass(frozen=True)
class CreaseModel:
    """Edges of a crease and the spring between its first declared pair of panels."""

    fan: EdgeFan
    spring: CreaseEdges
    sides: tuple[int, int]


@dataclass
class Model:
    """What `build` makes of a scene.

    Attributes:
        sheet: the meshed sheet.
        configuration: numbering of the unknowns.
        problem: sum of the terms under the constraints.
        shell: the panels' term.
        creases: name -> edges and spring.
        x: current unknowns (global vector), at rest to begin with.
        scene: what the model was built from.
    """

    sheet: SheetMesh
    configuration: Configuration
    problem: Problem
    shell: ShellTerm
    creases: dict[str, CreaseModel]
    x: PETSc.Vec
    scene: Scene

    @property
    def state(self) -> State:
        """Local view of the current unknowns."""
        return self.problem.state(self.x)

    @property
    def num_unknowns(self) -> int:
        """Global number of unknowns, prescribed ones included."""
        return self.configuration.size_global

    def energies(self) -> dict[str, float]:
        """Energy by kind: membrane, bending, crease, load."""
        return self.problem.energies(self.x)

    def reaction(self, name: str) -> np.ndarray:
        """Sum (3,) over a named edge set's vertices of the forces that the supports exert."""
        forces = self.x.duplicate()
        self.problem.forces(self.x, forces)
        vertices = place_vertices(self.sheet, name)
        vertices = vertices[vertices < self.configuration.nv_owned]
        local = forces.array_r[: 3 * self.configuration.nv_owned].reshape(-1, 3)
        return self.configuration.sum(local[vertices].sum(axis=0))

    def position(self, point: str) -> np.ndarray:
        """Current position (3,) of a named point."""
        vertex = self.sheet.point_vertex(point)
        mine = 0 <= vertex < self.configuration.nv_owned
        positions = self.state.x
        return self.configuration.sum(positions[vertex] if mine else np.zeros(3))

    def fold_angles(self, name: str) -> "FoldAngles":
        """Virtual and mesh fold angles along this rank's share of a crease.

        They are those between the panels of the crease's first declared spring.
        """
        crease = self.creases[name]
        state, fan = self.state, crease.fan
        ends = self.sheet.edge_vertices()[fan.facets]
        virtual = crease.spring.angle(state.scalars)
        mesh = mesh_angles(self.sheet, fan, crease.sides, state.x, virtual)
        middle = self.sheet.rest[ends].mean(axis=1)
        return FoldAngles(middle, fan.length, virtual, mesh)

    def mean_fold_angle(self, name: str) -> float:
        """Length-weighted mean of the virtual fold angle of a crease (radians)."""
        angles = self.fold_angles(name)
        total, length = self.configuration.sum(
            [(angles.length * angles.virtual).sum(), angles.length.sum()]
        )
        return float(total / length)


@dataclass(frozen=True)
class FoldAngles:
    """Fold angles (radians, valley positive) of one rank's edges of a crease.

    Attributes:
        middle: rest coordinates of the edges' midpoints (n, 3).
        length: rest lengths (n,).
        virtual: virtual fold angle (n,).
        mesh: dihedral angle of the triangles (n,).
    """

    middle: np.ndarray
    length: np.ndarray
    virtual: np.ndarray
    mesh: np.ndarray


def place_vertices(sheet: SheetMesh, name: str) -> np.ndarray:
    """Local vertices, ghosts included, of a named point, edge set or panel; collective."""
    if name in sheet.points:
        vertex = sheet.points[name]
        return np.array([vertex] if vertex >= 0 else [], dtype=np.int64)
    if name in sheet.panel_names:
        here = sheet.cells[sheet.panel_cells(name)]
    else:
        here = sheet.edge_vertices()[sheet.edge_facets(name)]
    return gather_marks(sheet.V.dofmap.index_map, np.unique(here))
