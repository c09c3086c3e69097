"""Scenes, nodes and exact solutions that the tests of contact and friction share."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from ufl_origami.barrier import Barrier
from ufl_origami.history import Record
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.obstacles import Box, Cylinder, Plane
from ufl_origami.scene import Scene
from ufl_origami.solvers.dynamics import TimeSettings

QUIET = Record(fields="none")
G, H, RHO = 9.81, 0.01, 1000.0
LOAD = RHO * H * G
"""Weight per area."""


def plate(n=(1, 1), *, side=0.1, model="ddg", E=1e8):
    """Square sheet of mass 10 per area, flat at z = 0."""
    return Scene(rectangle(side, side, n=n), Material(E, 0.3, H, RHO), model=model)


def fixed(step):
    return TimeSettings(step=step, fixed=True)


def bearing(load, reach=0.01, share=0.5):
    """Barrier that bears a load per area at a gap of a share of its reach."""
    return Barrier(load / Barrier(1.0, reach).pressure(share * reach), reach)


def resting_gap(barrier, load):
    """Gap at which a barrier bears a load per area."""
    reach = barrier.distance
    return brentq(lambda gap: barrier.pressure(gap) - load, 1e-9 * reach, reach, xtol=1e-16)


def resting(scene, slope=0.0, share=0.5):
    """Let a plate lie at its resting gap on an incline down along x, in the incline's frame."""
    barrier = bearing(LOAD * np.cos(slope), share=share)
    scene.gravity((G * np.sin(slope), 0.0, -G * np.cos(slope)))
    scene.obstacle("floor", Plane((0.0, 0.0, -share * barrier.distance)), barrier)
    return scene


def flight(barrier, state, time, g=0.0):
    """Heights and speeds (2, n) of the plates' mass per area over a barrier at height zero.

    Args:
        barrier: of a plane at height zero.
        state: height and upward speed at time zero.
        time: (n,) increasing times.
        g: gravity.
    """

    def rates(_, y):
        return [y[1], barrier.pressure(y[0]) / (RHO * H) - g]

    options = {"rtol": 1e-10, "atol": 1e-13, "method": "DOP853", "max_step": time[-1] / 200}
    return solve_ivp(rates, (0.0, time[-1]), state, t_eval=time, **options).y


def nodes(model):
    """Places (nd, 3) of a model's nodes, on one rank."""
    functions, q = model.functions, model.configuration.to_local(model.x)
    return functions.V.tabulate_dof_coordinates() + q[functions.dofs].reshape(-1, 3)


def areas(model):
    """Rest area (nd,) that belongs to each node, on one rank."""
    sheet, table = model.sheet, model.functions.V.dofmap.list
    corners = sheet.rest[sheet.cells]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    part = [1 / 3] * 3 if table.shape[1] == 3 else [1 / 12] * 3 + [1 / 4] * 3
    share, area = np.zeros(table.max() + 1), 0.5 * np.linalg.norm(normal, axis=1)
    np.add.at(share, table, area[:, None] * part)
    return share


def forces(term, model):
    """Forces (nd, 3) of a term on the nodes, on one rank."""
    out = np.zeros(model.configuration.num_local)
    term.add_residual(model.state, out)
    return -out[model.functions.dofs].reshape(-1, 3)


def mean_velocity(model):
    """Velocity (3,) of the centre of mass."""
    return model.motion.momentum() / model.motion.total_mass


def distance(body, x):
    """Signed distances (n,) of places (n, 3) from a plane, ball, cylinder or box."""
    if isinstance(body, Plane):
        return (x - body.point) @ body.normal / np.linalg.norm(body.normal)
    arm = x - np.asarray(body.centre if hasattr(body, "centre") else body.point)
    if isinstance(body, Box):
        first, second = (np.array(axis) / np.linalg.norm(axis) for axis in body.axes)
        over = abs(arm @ np.array([first, second, np.cross(first, second)]).T)
        over -= 0.5 * np.asarray(body.sizes)
        return np.linalg.norm(np.maximum(over, 0), axis=1) + np.minimum(over.max(axis=1), 0)
    if isinstance(body, Cylinder):
        axis = np.array(body.axis) / np.linalg.norm(body.axis)
        arm = arm - np.outer(arm @ axis, axis)
    return np.linalg.norm(arm, axis=1) - body.radius
