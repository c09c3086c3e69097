"""What surrounds a scene's sheet: weight, obstacles, friction, magnets, masses, damping, launch.

Part of `Scene`; it only declares. A scene has the terms of what it names, and no others.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ufl_origami.barrier import Barrier
from ufl_origami.errors import SceneError
from ufl_origami.friction_laws import FrictionLaw
from ufl_origami.obstacles import Obstacle, finite, positive
from ufl_origami.scene_parts import LoadFactor, Vector, required_arguments, vector_function

if TYPE_CHECKING:
    from ufl_origami.sheet import SheetMesh

Field = Vector | Callable
Rest = Callable[[np.ndarray], np.ndarray]
Velocity = Sequence[float] | Rest


@dataclass(frozen=True)
class ObstacleSpec:
    """A rigid obstacle; `on` are the places of the sheet that can touch it, none: all of it."""

    name: str
    body: Obstacle
    barrier: Barrier
    on: tuple[str, ...]
    motion: Callable[[float], np.ndarray] | None


@dataclass(frozen=True)
class FrictionSpec:
    """Friction of places of the sheet on an obstacle."""

    obstacle: str
    law: FrictionLaw
    on: tuple[str, ...]
    lagged: bool


@dataclass(frozen=True)
class MassSpec:
    """A rigid body attached to a place: mass, centre (3,), inertia (3, 3) about the centre."""

    name: str
    mass: float
    centre: np.ndarray | None = None
    inertia: np.ndarray | None = None


@dataclass(frozen=True)
class DampingSpec:
    """Rayleigh damping: factors of the mass (1 / time) and of the stiffness (time)."""

    mass: float
    stiffness: float


@dataclass(kw_only=True)
class Surroundings:
    """Declarations of what surrounds the sheet, the second half of `Scene`.

    Attributes:
        sheet: meshed sheet with its names.
        weights: accelerations of gravity, at most one.
        obstacles: rigid obstacles.
        frictions: friction on them.
        magnets: panel -> remanent flux density (3,).
        magnetic_fields: magnetic fields, at most one.
        masses: attached bodies.
        dampings: damping, at most one.
        launches: velocities at the start.
    """

    sheet: "SheetMesh"
    weights: list[Vector] = field(default_factory=list)
    obstacles: list[ObstacleSpec] = field(default_factory=list)
    frictions: list[FrictionSpec] = field(default_factory=list)
    magnets: dict[str, np.ndarray] = field(default_factory=dict)
    magnetic_fields: list[Field] = field(default_factory=list)
    masses: list[MassSpec] = field(default_factory=list)
    dampings: list[DampingSpec] = field(default_factory=list)
    launches: list[Velocity] = field(default_factory=list)

    def gravity(self, acceleration: Vector) -> None:
        """Weight of the panels (by their density) and of attached masses.

        Args:
            acceleration: (3,), for example (0, 0, -9.81); times the load factor, or a function of
                time.

        Raises:
            SceneError: gravity is declared already; a panel has no density.
        """
        if self.weights:
            raise SceneError("gravity is declared twice")
        vector_function(acceleration, "gravity", LoadFactor())
        self.weights.append(acceleration)

    def obstacle(
        self,
        name: str,
        body: Obstacle,
        barrier: Barrier,
        *,
        on: Sequence[str] = (),
        motion: Callable[[float], np.ndarray] | None = None,
    ) -> None:
        """Put a rigid obstacle beside the sheet, which its nodes cannot enter.

        Args:
            name: its name.
            body: a shape of obstacles.py.
            barrier: strength and reach; `suggest_barrier` proposes one.
            on: points, edge sets or panels that can touch it; default the whole sheet.
            motion: function of time: displacement (3,) of the obstacle, zero at time 0 or not.

        Raises:
            SceneError: the name is taken, or body or barrier are none.
            InputError: a place that the sheet does not have.
        """
        if name in [spec.name for spec in self.obstacles]:
            raise SceneError(f"obstacle {name!r} is declared twice")
        if not isinstance(body, Obstacle):
            raise SceneError(f"obstacle {name!r}: {body!r} is no obstacle")
        if not isinstance(barrier, Barrier):
            raise SceneError(f"obstacle {name!r}: {barrier!r} is no barrier")
        for place in on:
            self._require_place(place)
        if motion is not None:
            motion = vector_function(motion, f"obstacle {name!r}: motion", LoadFactor())
        self.obstacles.append(ObstacleSpec(name, body, barrier, tuple(on), motion))

    def friction(
        self, obstacle: str, law: FrictionLaw, *, on: Sequence[str] = (), lagged: bool = False
    ) -> None:
        """Let the sheet rub on an obstacle; acts in time only.

        Args:
            obstacle: name of an obstacle declared before.
            law: a law of friction_laws.py.
            on: points, edge sets or panels that rub; default all that can touch the obstacle. Laws
                of several declarations add up.
            lagged: pressure and normal of the last time step: a symmetric tangent, at an error of
                first order in the step.

        Raises:
            SceneError: no such obstacle, or no law.
            InputError: a place that the sheet does not have.
        """
        names = [spec.name for spec in self.obstacles]
        if obstacle not in names:
            raise SceneError(f"friction: no obstacle is named {obstacle!r}; there are {names}")
        if not isinstance(law, FrictionLaw):
            raise SceneError(f"friction on {obstacle!r}: {law!r} is no friction law")
        for place in on:
            self._require_place(place)
        self.frictions.append(FrictionSpec(obstacle, law, tuple(on), lagged))

    def magnetise(self, name: str, remanence: Sequence[float]) -> None:
        """Give a panel a remanent flux density B_r (3,), in tesla, carried along with it.

        With a field in tesla, lengths in metre and forces in newton are meant.
        """
        self.sheet.panel_cells(name)
        if name in self.magnets:
            raise SceneError(f"magnetise {name!r}: the panel is magnetised already")
        self.magnets[name] = finite(f"magnetise {name!r}", remanence, (3,))

    def magnetic_field(self, field: Field) -> None:
        """Apply a magnetic field (flux density, tesla) to the magnetised panels.

        Args:
            field: uniform: (3,), times the load factor, or a function of time; varying: a function
                of position and time, both of UFL, that gives a UFL vector (3,).

        Raises:
            SceneError: a field is declared already.
        """
        if self.magnetic_fields:
            raise SceneError("a magnetic field is declared already")
        if not field_varies(field):
            vector_function(field, "magnetic field", LoadFactor())
        self.magnetic_fields.append(field)

    def point_mass(self, name: str, mass: float) -> None:
        """Attach a mass to a named point, beside the panels' own."""
        self.sheet.point_vertex(name)
        positive(f"point mass {name!r}", mass)
        self.masses.append(MassSpec(name, float(mass)))

    def rigid_inertia(
        self, name: str, mass: float, inertia: Sequence[Sequence[float]], centre: Sequence[float]
    ) -> None:
        """Attach a rigid body to a panel, edge set or point: its mass is spread over the nodes.

        The masses on the nodes have the body's mass, centre and inertia tensor, so that the place,
        as long as it moves as a rigid body, moves as with the body attached.

        Args:
            name: place.
            mass: mass of the body.
            inertia: (3, 3) inertia tensor about its centre, at rest.
            centre: (3,) its centre of mass, at rest.

        Raises:
            SceneError: no inertia tensor of a body; `build` refuses what the nodes cannot carry
                (nodes in one plane carry bodies in that plane).
        """
        self._require_place(name)
        label = f"rigid inertia {name!r}"
        positive(label, mass)
        tensor = np.asarray(inertia, dtype=float)
        square = tensor.shape == (3, 3) and np.isfinite(tensor).all()
        if not (square and np.allclose(tensor, tensor.T)):
            raise SceneError(f"{label}: expected a symmetric (3, 3) inertia tensor")
        spread = 0.5 * np.trace(tensor) * np.eye(3) - tensor
        if np.linalg.eigvalsh(spread)[0] < -1e-9 * np.trace(tensor):
            raise SceneError(f"{label}: no body has this inertia tensor")
        place = finite(f"{label}: centre", centre, (3,))
        self.masses.append(MassSpec(name, float(mass), place, tensor))

    def damping(self, *, mass: float = 0.0, stiffness: float = 0.0) -> None:
        """Damp all motion in proportion to mass and stiffness (Rayleigh).

        Args:
            mass: alpha (1 / time): force -alpha M v.
            stiffness: beta (time): stresses, moments and crease moments beta times the stiffness
                and the rates of strain, curvature and fold angle; rigid motion is not damped, nor
                is a crease where its law's moment falls.

        Raises:
            SceneError: a negative factor, or damping that is declared already.
        """
        for label, value in (("mass", mass), ("stiffness", stiffness)):
            if not float(finite(f"damping: {label}", value, ())) >= 0:
                raise SceneError(f"damping: {label} {value} must not be negative")
        if self.dampings:
            raise SceneError("damping is declared twice")
        self.dampings.append(DampingSpec(float(mass), float(stiffness)))

    def launch(self, velocity: Velocity) -> None:
        """Give the sheet a velocity at the start; several add up.

        Args:
            velocity: (3,), or a function of the nodes' places at rest (n, 3) that gives (n, 3);
                `spin` makes one.
        """
        if not callable(velocity):
            finite("launch: velocity", velocity, (3,))
        self.launches.append(velocity)

    def _require_place(self, name: str) -> None:
        sheet = self.sheet
        kinds: Mapping[str, object] = {
            "point": sheet.points, "panel": sheet.panel_names, "edge set": sheet.edges,
        }  # fmt: skip
        found = [kind for kind, names in kinds.items() if name in names]  # type: ignore[operator]
        if len(found) > 1:
            raise SceneError(
                f"{name!r} names several places ({', '.join(found)}): rename all but one"
            )
        if name not in sheet.points and name not in sheet.panel_names:
            sheet.edge_facets(name)


def field_varies(field: Field) -> bool:
    """Whether a magnetic field is a function of position and time."""
    return callable(field) and required_arguments(field) > 1


def spin(rate: Sequence[float], centre: Sequence[float] = (0.0, 0.0, 0.0)) -> Rest:
    """Velocity of a rigid rotation, for `Scene.launch`.

    Args:
        rate: angular velocity (3,), radians per time.
        centre: a point that stays.
    """
    omega, place = finite("spin: rate", rate, (3,)), finite("spin: centre", centre, (3,))
    return lambda rest: np.cross(omega, rest - place)
