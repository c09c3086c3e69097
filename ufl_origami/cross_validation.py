"""Scenes in which the two models must agree, and their comparison.

A registered scene says how it is made for either model, at which load factors and on which meshes
the models are compared ("matching accuracy": the meshes on which both are about equally close to
the solution), in what, and how far the answers may be apart. The scenes of the package are in
`cross_scenes`; CONTRIBUTING.md shows how to add one.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from mpi4py import MPI

import numpy as np

from ufl_origami.cross_quantities import Quantity
from ufl_origami.errors import InputError, SolveError
from ufl_origami.history import Record
from ufl_origami.model import Model
from ufl_origami.run import solve_static
from ufl_origami.scene import MODELS, Scene
from ufl_origami.sheet import known_name
from ufl_origami.solvers.static import Step

SceneMaker = Callable[[str, float, MPI.Comm], Scene]


@dataclass(frozen=True)
class CrossScene:
    """One scene and what the two models must agree in.

    Attributes:
        name: name in tables and on the command line.
        make: the scene from model, mesh size and communicator.
        sizes: model -> mesh size, in whatever measure `make` takes it.
        stops: load factors at which the models are compared.
        quantities: what is compared.
        quick: whether the scene is one of those that `--quick` runs.
    """

    name: str
    make: SceneMaker
    sizes: Mapping[str, float]
    stops: tuple[float, ...]
    quantities: tuple[Quantity, ...]
    quick: bool = False

    def __post_init__(self) -> None:
        """Refuse a comparison of nothing, and a model without mesh."""
        if not (self.stops and self.quantities):
            raise InputError(f"cross-validation {self.name!r}: no load factor or no quantity")
        if set(self.sizes) != set(MODELS):
            raise InputError(
                f"cross-validation {self.name!r}: mesh sizes of {list(self.sizes)}, not of "
                f"{list(MODELS)}"
            )


_REGISTRY: dict[str, CrossScene] = {}


def register(scene: CrossScene) -> CrossScene:
    """Add a scene to those that the command compares.

    Raises:
        InputError: another scene has the name.
    """
    if scene.name in _REGISTRY:
        raise InputError(f"cross-validation {scene.name!r}: the name is taken")
    _REGISTRY[scene.name] = scene
    return scene


def registered() -> tuple[CrossScene, ...]:
    """All registered scenes, in the order of their registration."""
    return tuple(_REGISTRY.values())


def registered_scene(name: str) -> CrossScene:
    """A registered scene.

    Raises:
        InputError: unknown name, with close ones.
    """
    return _REGISTRY[known_name(name, _REGISTRY, "scene")]


@dataclass(frozen=True)
class Effort:
    """What one model took for all load factors of a scene.

    Attributes:
        triangles, dofs: size of the model.
        steps, iterations: accepted steps and their Newton iterations.
        seconds: wall-clock time of the steps; meshing and compiling come before.
    """

    triangles: int
    dofs: int
    steps: int
    iterations: int
    seconds: float


@dataclass
class ModelRun:
    """One model of a scene, followed through the load factors.

    Attributes:
        samples: the quantities' samples at each load factor that was reached.
        effort: None where the path was not finished.
        failure: why it was not, or an empty string.
    """

    samples: list[list[Any]] = field(default_factory=list)
    effort: Effort | None = None
    failure: str = ""


@dataclass(frozen=True)
class Comparison:
    """One row of the table.

    Attributes:
        scene: name of the scene.
        load: load factor.
        quantity: name of the quantity.
        values: model -> value where the quantity is one number.
        difference: as the quantity defines it; None where a model did not get there.
        tolerance: largest difference allowed.
    """

    scene: str
    load: float
    quantity: str
    values: Mapping[str, float | None]
    difference: float | None
    tolerance: float

    @property
    def ok(self) -> bool:
        """Whether the models agree."""
        return self.difference is not None and bool(self.difference <= self.tolerance)


@dataclass(frozen=True)
class CrossResult:
    """Both models of a scene side by side.

    Attributes:
        scene: the scene.
        runs: model -> what it gave.
        rows: one comparison each load factor and quantity.
    """

    scene: CrossScene
    runs: Mapping[str, ModelRun]
    rows: list[Comparison]

    @property
    def ok(self) -> bool:
        """Whether the models agree in everything."""
        return all(row.ok for row in self.rows)

    def summary(self) -> dict[str, Any]:
        """The result as an object for a JSON file."""
        models = {
            model: {"size": self.scene.sizes[model], "failure": run.failure}
            | (asdict(run.effort) if run.effort else {})
            for model, run in self.runs.items()
        }
        rows = [asdict(row) | {"ok": row.ok} for row in self.rows]
        return {"scene": self.scene.name, "ok": self.ok, "models": models, "comparisons": rows}


def cross_validate(
    scene: CrossScene, comm: MPI.Comm = MPI.COMM_WORLD, *, tighten: float = 1.0
) -> CrossResult:
    """Follow a scene with both models and compare them; collective.

    Args:
        scene: what to compare.
        comm: communicator.
        tighten: number by which all tolerances are divided.
    """
    runs = {model: run_model(scene, model, comm) for model in MODELS}
    return CrossResult(scene, runs, comm.bcast(list(_compare(scene, runs, tighten))))


def run_model(scene: CrossScene, model: str, comm: MPI.Comm = MPI.COMM_WORLD) -> ModelRun:
    """Follow a scene with one model through its load factors; collective.

    A path that cannot be followed to its end is no error here: the run says why.
    """
    run, made = ModelRun(), scene.make(model, scene.sizes[model], comm)

    def on_accept(step: Step, model: Model) -> None:
        if np.isclose(step.time, scene.stops[len(run.samples)], rtol=1e-12):
            run.samples.append([quantity.sample(model) for quantity in scene.quantities])

    try:
        result = solve_static(
            made, scene.stops, record=_NOTHING, progress=False, on_accept=on_accept
        )
    except SolveError as error:
        run.failure = str(error)
        return run
    run.effort = Effort(
        result.model.sheet.num_cells_global,
        result.model.num_unknowns,
        len(result.steps),
        sum(step.iterations for step in result.steps),
        sum(step.seconds for step in result.steps),
    )
    return run


_NOTHING = Record(energies=False, reactions=(), creases=(), points=(), fields="none")


def _compare(
    scene: CrossScene, runs: Mapping[str, ModelRun], tighten: float
) -> Iterable[Comparison]:
    for i, load in enumerate(scene.stops):
        for j, quantity in enumerate(scene.quantities):
            samples = {m: run.samples[i][j] for m, run in runs.items() if i < len(run.samples)}
            values = {model: quantity.number(sample) for model, sample in samples.items()}
            both = len(samples) == len(runs)
            difference = quantity.difference(*samples.values()) if both else None
            tolerance = quantity.tolerance / tighten
            yield Comparison(scene.name, load, quantity.name, values, difference, tolerance)
