"""Parameters of contact for a scene, from its thickness, its weight and the speed of impacts."""

from mpi4py import MPI

import numpy as np

from ufl_origami.barrier import Barrier
from ufl_origami.errors import SceneError
from ufl_origami.obstacles import positive
from ufl_origami.scene import Scene
from ufl_origami.scene_parts import LoadFactor, vector_function
from ufl_origami.surroundings import surface_density


def concentration(scene: Scene) -> float:
    """How many times its own mass a row of nodes carries when the sheet stands on its edge.

    The side of a square as large as the sheet over the distance of the nodes; collective.
    """
    triangles = scene.sheet.num_cells_global
    nodes = 4 * triangles if scene.model == "fem" else triangles
    return max(1.0, float(np.sqrt(0.5 * nodes)))


def largest_weight(scene: Scene, time: float | None) -> float:
    """Largest acceleration of gravity, that of a time where it is a function of time.

    Raises:
        SceneError: a function of time and no time.
    """
    if time is None and any(map(callable, scene.weights)):
        raise SceneError(
            "suggest_barrier: gravity is a function of time: give the time at which it is largest"
        )
    held = LoadFactor(held=1.0)
    weights = [vector_function(weight, "gravity", held)(time or 0.0) for weight in scene.weights]
    return sum(float(np.linalg.norm(g)) for g in weights)


def suggest_barrier(
    scene: Scene, speed: float, *, distance: float | None = None, time: float | None = None
) -> Barrier:
    """Barrier that stops the sheet at a speed, and carries its weight, with a gap left; collective.

    The barrier's energy k d_hat^2 per area is the kinetic energy 2 (rho h v^2 / 2) per area of the
    densest panel, times the `concentration` of an impact on an edge, so that the gap stays open
    there; and its pressure k d_hat / 2 bears the weight of the sheet standing on its edge. Declare
    gravity before.

    Args:
        scene: the scene, with densities.
        speed: largest normal speed of an impact.
        distance: reach d_hat; default the smallest thickness.
        time: time at which gravity that is a function of time is largest.

    Raises:
        SceneError: a speed or distance that is not positive, a panel without density, gravity that
            is a function of time without such a time.
    """
    positive("suggest_barrier: speed", speed)
    heights = [scene.panel_material(name).h for name in scene.sheet.panel_names]
    reach = min(heights) if distance is None else distance
    positive("suggest_barrier: distance", reach)
    density = float(surface_density(scene).max(initial=0.0))
    density = scene.sheet.comm.allreduce(density, op=MPI.MAX)
    weight = largest_weight(scene, time)
    share = density * concentration(scene)
    return Barrier(share * max(speed**2 / reach**2, 2.0 * weight / reach), reach)
