"""A scene: a sheet, its materials and creases, and the named things done to it.

A scene only declares. `build` (discretise.py) makes exactly the terms and unknowns that it names.

Values that follow the load factor or time are read as scene_parts.py says.
"""

from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields
from typing import Any

import numpy as np

from ufl_origami.configuration import Configuration
from ufl_origami.crease_laws import CreaseLaw
from ufl_origami.errors import SceneError
from ufl_origami.material import Material
from ufl_origami.scene_parts import (
    ClampSpec,
    CreaseSpec,
    Displacement,
    LoadFactor,
    LoadSpec,
    MotionSpec,
    Pair,
    Scalar,
    Vector,
)
from ufl_origami.scene_surroundings import Surroundings
from ufl_origami.sheet import SheetMesh
from ufl_origami.stencils import BENDING_FORMS
from ufl_origami.terms.base import Term
from ufl_origami.terms.form import SheetFunctions

MODELS = ("ddg", "fem")
"""Discretisations of the panels and creases."""

IN_PLANE = 1e-6
"""Sine of the angle to a mirror plane below which a triangle lies in it."""

TermMaker = Callable[[Configuration, SheetFunctions], Term]


@dataclass
class Scene(Surroundings):
    """Declaration of a simulation.

    Args:
        sheet: meshed sheet with its names.
        material: one for all panels, or panel name -> material.
        bending: "director" (default; tilt measure tan) or "averaged" (the paper's; sin).
        measure: tilt measure "tan" or "sin", to override the form's own.
        membrane: "kernel" (default, fused with bending) or "ufl" (the same energy as a form).
        model: "ddg" (default) or "fem", an independent shell element of second order; `bending`,
            `measure` and `membrane` are choices of the ddg model.

    Raises:
        SceneError: unknown model, bending form, measure, panel; panel without material.
    """

    sheet: SheetMesh
    material: Material | Mapping[str, Material]
    bending: str = "director"
    measure: str | None = None
    membrane: str = "kernel"
    model: str = "ddg"
    creases: list[CreaseSpec] = field(default_factory=list)
    motions: list[MotionSpec] = field(default_factory=list)
    clamps: list[ClampSpec] = field(default_factory=list)
    loads: list[LoadSpec] = field(default_factory=list)
    curvatures: dict[str, np.ndarray] = field(default_factory=dict)
    terms: list[TermMaker] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Check names and fill in the form's own tilt measure."""
        if self.model not in MODELS:
            raise SceneError(f"model {self.model!r} is none of {MODELS}")
        if self.model == "fem":
            self._refuse_ddg_choices()
        if self.bending not in BENDING_FORMS:
            raise SceneError(f"bending {self.bending!r} is none of {BENDING_FORMS}")
        if self.membrane not in ("kernel", "ufl"):
            raise SceneError(f"membrane {self.membrane!r} is neither 'kernel' nor 'ufl'")
        self.measure = self.measure or {"director": "tan", "averaged": "sin"}[self.bending]
        if self.measure not in ("tan", "sin"):
            raise SceneError(f"tilt measure {self.measure!r} is neither 'tan' nor 'sin'")
        if isinstance(self.material, Mapping):
            for name in self.material:
                self.sheet.panel_cells(name)
            missing = set(self.sheet.panel_names) - set(self.material)
            if missing:
                raise SceneError(f"panels without material: {sorted(missing)}")

    def _refuse_ddg_choices(self) -> None:
        choices = {
            "bending": (self.bending, "director"),
            "measure": (self.measure or "tan", "tan"),
            "membrane": (self.membrane, "kernel"),
        }
        for name, (given, default) in choices.items():
            if given != default:
                raise SceneError(f"{name} {given!r} is a choice of the ddg model, not of fem")

    def with_model(self, model: str) -> "Scene":
        """Return the same scene for another model, with that model's default choices."""
        copies = {p.name: list(getattr(self, p.name)) for p in fields(self) if _is_list(p)}
        kept: dict[str, Any] = {"sheet": self.sheet, "material": self.material, **copies}
        kept |= {"curvatures": dict(self.curvatures), "magnets": dict(self.magnets)}
        return Scene(model=model, **kept)

    def panel_material(self, panel: str) -> Material:
        """Material of a panel."""
        if isinstance(self.material, Mapping):
            return self.material[panel]
        return self.material

    def crease(
        self,
        name: str,
        stiffness: Scalar | None = None,
        *,
        rest_angle: Scalar | None = None,
        law: CreaseLaw | None = None,
        pair: Pair | None = None,
    ) -> None:
        """Give a crease its spring.

        Args:
            name: crease.
            stiffness: K_r per unit length (moment per length and radian); a constant in time, or
                a function of time; 0 is a free hinge, inf a stiff fold (a huge number instead
                would raise the round-off floor of the tolerance).
            rest_angle: fold angle (radians, valley positive) without moment, a constant in time or
                a function of time; default that of the rest state.
            law: instead of stiffness and rest_angle, energy, moment and stiffness as functions.
            pair: the two panels that the spring joins, for creases of more than two.

        Raises:
            SceneError: unknown crease, neither or both of stiffness and law, law with a rest angle,
                negative stiffness, rest angle beyond a full turn (degrees?).
        """
        self.sheet.edge_facets(name)
        if name not in self.sheet.creases:
            raise SceneError(f"{name!r} is no crease; creases are {self.sheet.creases}")
        if (stiffness is None) == (law is None):
            raise SceneError(f"crease {name!r}: give a stiffness or a law, and only one of them")
        if stiffness is not None and not callable(stiffness) and not stiffness >= 0:
            raise SceneError(f"crease {name!r}: stiffness {stiffness} must not be negative")
        if law is not None and rest_angle is not None:
            raise SceneError(f"crease {name!r}: a law has its own rest angle")
        if rest_angle is not None and not callable(rest_angle) and not abs(rest_angle) < 2 * np.pi:
            raise SceneError(f"crease {name!r}: rest angle {rest_angle} is no angle in radians")
        for panel in pair or ():
            self.sheet.panel_cells(panel)
        if pair is not None and len(set(pair)) != 2:
            raise SceneError(f"crease {name!r}: {pair} are no two panels")
        self.creases.append(
            CreaseSpec(name, law, 0.0 if stiffness is None else stiffness, rest_angle, pair)
        )

    def move(
        self,
        name: str,
        x: Displacement | None = None,
        y: Displacement | None = None,
        z: Displacement | None = None,
    ) -> None:
        """Prescribe displacement components of a named point, edge set or panel.

        Args:
            name: point, edge set or panel.
            x: displacement in x (see the module on values); None leaves it free.
            y: displacement in y.
            z: displacement in z.
        """
        self._require_place(name)
        self.motions.append(MotionSpec(name, (x, y, z)))

    def fix(self, name: str, components: str = "xyz") -> None:
        """Hold displacement components of a named point, edge set or panel at zero."""
        if not components or set(components) - set("xyz"):
            raise SceneError(f"fix {name!r}: components {components!r} are not out of 'xyz'")
        self.move(name, **{c: 0.0 for c in components})

    def clamp(
        self, name: str, tangent: Callable[[float, np.ndarray], np.ndarray] | None = None
    ) -> None:
        """Prescribe the direction in which the sheet leaves a boundary (its edge normal).

        Args:
            name: boundary edge set.
            tangent: function of time and the rest outward tangents (n, 3), giving (n, 3) or (3,)
                outward tangents; default: held as at rest.
        """
        self.sheet.edge_facets(name)
        self.clamps.append(ClampSpec(name, tangent))

    def symmetry(self, name: str, axis: str) -> None:
        """Make a boundary the trace of a mirror plane normal to an axis ("x", "y" or "z")."""
        if axis not in ("x", "y", "z"):
            raise SceneError(f"symmetry {name!r}: axis {axis!r} is none of 'x', 'y', 'z'")
        self.fix(name, axis)
        normal = np.eye(3)["xyz".index(axis)]

        def outward(time: float, rest: np.ndarray) -> np.ndarray:
            across = rest @ normal
            if (np.abs(across) < IN_PLANE).any():
                raise SceneError(f"symmetry {name!r}: the sheet lies in the mirror plane itself")
            return np.where(across > 0, 1.0, -1.0)[:, None] * normal

        self.clamps.append(ClampSpec(name, outward, natural=False))

    def point_load(self, name: str, force: Vector) -> None:
        """Dead force (3,) on a named point."""
        self.sheet.point_vertex(name)
        self._load("point", name, force)

    def line_load(self, name: str, force: Vector) -> None:
        """Dead force per rest length (3,) on a named edge set."""
        self.sheet.edge_facets(name)
        self._load("line", name, force)

    def area_load(self, name: str, force: Vector) -> None:
        """Dead force per rest area (3,) on a named panel."""
        self.sheet.panel_cells(name)
        self._load("area", name, force)

    def pressure(self, name: str, pressure: Scalar) -> None:
        """Follower pressure on a named panel, positive along its normal."""
        self.sheet.panel_cells(name)
        self._load("pressure", name, pressure)

    def edge_moment(self, name: str, moment: Scalar) -> None:
        """Moment per rest length on a boundary, lifting its outward tangent to the normal."""
        self.sheet.edge_facets(name)
        self._load("moment", name, moment)

    def natural_curvature(self, name: str, tensor: np.ndarray) -> None:
        """Stress-free curvature of a panel, added to its rest shape.

        Args:
            name: panel.
            tensor: symmetric (3, 3); t.K t is the normal curvature along a unit tangent t (1 /
                length), positive where the sheet bends towards its normal.
        """
        self.sheet.panel_cells(name)
        if name in self.curvatures:
            raise SceneError(f"natural curvature {name!r}: the panel has one already")
        tensor = np.asarray(tensor, dtype=float)
        if tensor.shape != (3, 3) or not np.allclose(tensor, tensor.T):
            raise SceneError(f"natural curvature {name!r}: expected a symmetric (3, 3) tensor")
        self.curvatures[name] = tensor

    def add_term(self, maker: TermMaker) -> None:
        """Add an energy or force of one's own (CONTRIBUTING.md has a complete example).

        Args:
            maker: called once by `build`, on all ranks, with the numbering of the unknowns and the
                functions that the scene's forms share; returns a FormTerm, a StencilTerm, or a
                Term without tangent (a dead force).

        Raises:
            SceneError: not a function, for example a term that is already made.
        """
        if not callable(maker):
            raise SceneError(f"add_term: expected a function that makes a term, got {maker!r}")
        self.terms.append(maker)

    def _load(self, kind: str, name: str, value: Scalar | Vector) -> None:
        spec = LoadSpec(kind, name, value)
        spec.function(LoadFactor())  # refuse a wrong value where it is declared
        self.loads.append(spec)


def _is_list(part: Field) -> bool:
    return part.default_factory is list
