"""The discrete model of a scene: unknowns, terms, constraints, and what it can measure."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from petsc4py import PETSc

import numpy as np

from ufl_origami.configuration import Configuration, State, gather_marks
from ufl_origami.motion import Motion
from ufl_origami.problem import Problem
from ufl_origami.scene import Scene
from ufl_origami.scene_parts import LoadFactor
from ufl_origami.sheet import SheetMesh
from ufl_origami.sides import EdgeFan
from ufl_origami.terms.base import Keyed, Term
from ufl_origami.terms.contact import ContactTerm
from ufl_origami.terms.damping import ElasticTerms
from ufl_origami.terms.form import SheetFunctions


class CreaseModel(Protocol):
    """Edges of a crease and the spring between its first declared pair of panels."""

    @property
    def fan(self) -> EdgeFan:
        """Edges of the crease on this rank."""

    def virtual_angle(self, state: State) -> np.ndarray:
        """Mean virtual fold angle (n,) of each edge (radians)."""

    def mesh_angle(self, state: State) -> np.ndarray:
        """Dihedral angle (n,) of the triangles at each edge's middle, near the virtual one."""


class PanelTerm(Protocol):
    """What a model asks of the term of its panels, whatever the discretisation."""

    def history(self) -> dict[str, Keyed]:
        """Branches of angles, see `Term.history`."""

    def element_energies(self, state: State) -> dict[str, np.ndarray]:
        """Energy of each owned triangle (num_owned_cells,), by kind."""

    def clamped_sides(self) -> np.ndarray:
        """Sides 3 * cell + e of owned triangles at which the normal is prescribed."""

    def largest_tilt(self, state: State) -> float:
        """Largest |tilt| (radians) of this rank's triangles."""

    def smallest_area_ratio(self, state: State) -> float:
        """Smallest ratio of current to rest area of this rank's triangles."""


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
        load_factor: factor of the numbers that the scene declares.
        functions: what the scene's forms share.
        in_time: terms that act in time only: friction.
        elastic: makes copies of the elastic terms.
        motion: masses and rates, once the model moves.
        balance: problem whose residual is zero at the current state: with inertia in a time step.
    """

    sheet: SheetMesh
    configuration: Configuration
    problem: Problem
    shell: PanelTerm
    creases: dict[str, CreaseModel]
    x: PETSc.Vec
    scene: Scene
    load_factor: LoadFactor
    functions: SheetFunctions
    in_time: list[Term]
    elastic: Callable[[], ElasticTerms]
    motion: Motion | None = None
    balance: Problem | None = None

    @property
    def contacts(self) -> list[ContactTerm]:
        """Contacts with obstacles."""
        return [term for term in self.problem.terms if isinstance(term, ContactTerm)]

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
        (self.balance or self.problem).forces(self.x, forces)
        dofs = place_nodes(self.configuration, name).dofs
        owned = [self.configuration.owned_dofs(column) for column in dofs.T]
        return self.configuration.sum([forces.array_r[part].sum() for part in owned])

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
        virtual, mesh = crease.virtual_angle(state), crease.mesh_angle(state)
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


@contextmanager
def unchanged_where_refused(model: Model) -> Iterator[None]:
    """Give a model its time, load factor and motion back where the block raises."""
    time, factor = model.problem.time, model.load_factor.held
    motion, balance = model.motion, model.balance
    rates = motion.v.copy() if motion else None
    try:
        yield
    except BaseException:
        model.load_factor.held, model.motion, model.balance = factor, motion, balance
        if motion and rates:
            rates.copy(motion.v)
        model.problem.set_time(time)
        raise


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


@dataclass(frozen=True)
class Nodes:
    """Nodes of a named place on this rank, ghosts included.

    Attributes:
        dofs: (n, 3) local unknowns of their displacements.
        rest: (n, 3) rest positions.
    """

    dofs: np.ndarray
    rest: np.ndarray


def place_nodes(configuration: Configuration, name: str) -> Nodes:
    """Vertices and, where they move on their own, midpoints of a named place; collective."""
    sheet = configuration.sheet
    vertices = place_vertices(sheet, name)
    dofs, rest = 3 * vertices[:, None] + np.arange(3), sheet.rest[vertices]
    if configuration.has_midpoints:
        facets = place_facets(sheet, name)
        middle = sheet.edge_middles()[facets]
        dofs = np.vstack([dofs, configuration.middle_dofs(facets)])
        rest = np.vstack([rest, middle])
    return Nodes(dofs, rest)


def place_facets(sheet: SheetMesh, name: str) -> np.ndarray:
    """Local edges, ghosts included, of a named edge set or panel, none of a point; collective."""
    if name in sheet.points:
        return np.empty(0, dtype=np.int64)
    if name not in sheet.panel_names:
        return sheet.edge_facets(name)
    here = np.unique(sheet.cell_edges[sheet.panel_cells(name)])
    return gather_marks(sheet.mesh.topology.index_map(1), here)
