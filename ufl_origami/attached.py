"""Rigid bodies attached to a place of the sheet: masses on its nodes that move as the body does.

A set of point masses on nodes that move together as a rigid body moves as any other body of the
same mass, centre and second moments. Among all masses m_a > 0 with these moments the ones of
largest entropy relative to equal masses are taken,

    m_a = exp(sum_k y_k b_k(x_a)),    sum_a m_a b_k(x_a) = moments_k,

with b_k the monomials up to degree two in the nodes' own axes; y minimises a convex function.
"""

from mpi4py import MPI

import numpy as np
from scipy import optimize

from ufl_origami.collective import reduced
from ufl_origami.errors import SceneError
from ufl_origami.scene_surroundings import MassSpec

FLAT = 1e-9
"""Extent of the nodes, over their largest, below which an axis counts as none."""

LARGEST_EXPONENT = 100.0
"""Logarithm of a node's share beyond which the search has gone astray."""

EXACT = 1e-9
"""Relative error of the moments that is round-off."""

NEAR, POLISH = 1e-4, 3
"""Relative error below which Newton's steps end the search, and their number: the search itself
gives up where the round-off of the dual hides that it still falls."""


def spread_body(comm: MPI.Comm, rest: np.ndarray, spec: MassSpec) -> np.ndarray:
    """Masses (n,) of this rank's owned nodes (n, 3) of a place; collective.

    Raises:
        SceneError: on all ranks: no positive masses on the nodes have the body's moments.
    """
    label, count = f"rigid inertia {spec.name!r}", comm.allreduce(len(rest))
    middle = reduced(comm, rest.sum(axis=0)) / count
    arms = rest - middle
    extents, axes = np.linalg.eigh(reduced(comm, arms.T @ arms) / count)
    size = float(np.sqrt(max(extents[-1], 0.0))) or 1.0
    used = np.concatenate([[True], extents > (FLAT * size) ** 2])
    wanted = _moments(spec, middle, axes / size)
    kept = (used[:, None] & used)[np.triu_indices(4)]
    if (np.abs(wanted[~kept]) > EXACT).any():
        raise SceneError(f"{label}: the body reaches out of the plane or line of the nodes")
    masses = _entropic(comm, _monomials(arms @ axes / size)[:, kept], wanted[kept], count)
    if masses is None:
        raise SceneError(f"{label}: the body is too wide for the nodes that are to carry it")
    return spec.mass * masses


def _monomials(x: np.ndarray) -> np.ndarray:
    """1, x_i, x_i x_j (n, 10) of places (n, 3)."""
    first = np.column_stack([np.ones(len(x)), x])
    row, col = np.triu_indices(4)
    return first[:, row] * first[:, col]


def _moments(spec: MassSpec, middle: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """What the monomials sum to over the body, in axes (3, 3) about a point, over its mass."""
    tensor = np.asarray(spec.inertia) / spec.mass
    arm = np.asarray(spec.centre) - middle
    second = axes.T @ (0.5 * np.trace(tensor) * np.eye(3) - tensor + np.outer(arm, arm)) @ axes
    whole = np.block([[np.ones((1, 1)), (arm @ axes)[None]], [(arm @ axes)[:, None], second]])
    return whole[np.triu_indices(4)]


def _entropic(comm: MPI.Comm, basis: np.ndarray, wanted: np.ndarray, count: int):
    """Positive masses (n,) with the wanted moments, or None where there are none."""

    def masses(y: np.ndarray) -> np.ndarray:
        return np.exp(np.minimum(basis @ y, LARGEST_EXPONENT)) / count

    def dual(y: np.ndarray) -> float:
        return float(comm.allreduce(masses(y).sum()) - y @ wanted)

    def gradient(y: np.ndarray) -> np.ndarray:
        return reduced(comm, basis.T @ masses(y)) - wanted

    def hessian(y: np.ndarray) -> np.ndarray:
        return reduced(comm, basis.T @ (masses(y)[:, None] * basis))

    start = np.zeros(len(wanted))
    options = {"gtol": 1e-13, "maxiter": 500}
    found = optimize.minimize(
        dual, start, method="trust-exact", jac=gradient, hess=hessian, options=options
    )
    y = found.x
    for _ in range(POLISH if np.abs(gradient(y)).max() < NEAR else 0):
        y = y - np.linalg.lstsq(hessian(y), gradient(y), rcond=None)[0]
    return masses(y) if np.abs(gradient(y)).max() <= EXACT else None
