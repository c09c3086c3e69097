"""Kernels of the mid-edge shell and of the hinge: derivatives, invariances, known energies."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ufl_origami
from ufl_origami import kernels
from ufl_origami.kernels import MEASURES, Elastic, HingeStencil, Stencil

YOUNG, POISSON, THICKNESS = 2.0, 0.3, 0.1


def call(kernel, *args, shape):
    """Output array of the given shape that the kernel fills as its last argument."""
    out = np.full(shape, np.nan)
    kernel(*args, out)
    return out


def elastic_of(x_rest, verts, bbar=None):
    n = len(verts)
    abar = call(kernels.metrics, x_rest, verts, shape=(n, 3))
    stiffness = kernels.plane_stress_stiffness(
        abar, young=YOUNG, poisson=POISSON, thickness=THICKNESS
    )
    bbar = np.zeros((n, 3)) if bbar is None else bbar
    return Elastic(stiffness, abar, bbar, THICKNESS**2 / 3 * stiffness)


class Shell:
    """A batch of triangles with all that the kernels need."""

    def __init__(self, stencil, elastic, measure="tan", theta_ref=None):
        self.stencil, self.elastic, self.measure = stencil, elastic, MEASURES[measure]
        self.n, self.m = stencil.verts.shape[0], stencil.d.shape[2]
        self.theta_ref = np.zeros((self.n, 3)) if theta_ref is None else theta_ref

    def tilts(self, x, u):
        theta, t, s = (np.full((self.n, 3), np.nan) for _ in range(3))
        kernels.tilts(x, u, self.stencil, self.theta_ref, theta, t)
        s = call(self.measure, t, shape=(self.n, 3, 3))
        return theta, t, s

    def energy(self, x, u):
        s = self.tilts(x, u)[2]
        return call(kernels.shell_energy, x, self.stencil.verts, s, self.elastic, shape=(self.n, 2))

    def gradient(self, x, u):
        energy, g = np.empty((self.n, 2)), np.full((self.n, 18 + 3 * self.m), np.nan)
        kernels.shell_gradient(x, self.stencil, self.tilts(x, u)[2], self.elastic, energy, g)
        return energy, g

    def stress(self, x):
        return call(kernels.membrane_stress, x, self.stencil.verts, self.elastic, shape=(self.n, 3))

    def hessian(self, x, u, sigma=None):
        k = 18 + 3 * self.m
        energy, g, values = np.empty((self.n, 2)), np.empty((self.n, k)), np.full(self.n * k * k, 7)
        h = values.astype(float).reshape(self.n, k, k)
        sigma = self.stress(x) if sigma is None else sigma
        s = self.tilts(x, u)[2]
        kernels.shell_hessian(x, self.stencil, s, self.elastic, sigma, energy, g, h)
        return energy, g, h

    def local(self, dx, du):
        """Step (dx, du) in each triangle's degrees of freedom."""
        corners = dx[self.stencil.verts].reshape(self.n, 18)
        return np.hstack([corners, du[self.stencil.slot].reshape(self.n, 3 * self.m)])


def rotation(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def flap(p, q, r, angle, across=0.7, along=0.4):
    """Vertex opposite r across the edge p -> q of the triangle (p, q, r) at the hinge angle."""
    e = (q - p) / np.linalg.norm(q - p)
    normal = np.cross(q - p, r - p)
    normal /= np.linalg.norm(normal)
    return p + along * (q - p) + across * rotation(e, -angle) @ np.cross(e, normal)


FOLDS = np.deg2rad([[170, -170, 100], [-170, 35, -120], [150, 170, -60], [-95, 20, 165.0]])


def folded_batch(m, c, measure, seed=0, folds=FOLDS):
    """Strongly deformed triangles, each with three neighbours at large fold angles."""
    rng = np.random.default_rng(seed)
    n = len(folds)
    x = np.empty((n, 6, 3))
    rest = np.empty((n, 6, 3))
    for i in range(n):
        rest[i, :3] = [[0, 0, 0], [1, 0.1, 0], [0.2, 0.9, 0]]
        x[i, :3] = rest[i, :3] + 0.25 * rng.standard_normal((3, 3))
        for e in range(3):
            p, q = x[i, (e + 1) % 3], x[i, (e + 2) % 3]
            x[i, 3 + e] = flap(p, q, x[i, e], folds[i, e])
    verts = np.arange(6 * n, dtype=np.int32).reshape(n, 6)
    d = rng.choice([-1.0, -0.5, 1.0], (n, 3, m))
    slot = np.arange(3 * n * m, dtype=np.int32).reshape(n, 3, m)
    stencil = Stencil(verts, np.zeros((n, 3, 3)), np.full((n, 3), c), d, slot)
    x, u = x.reshape(-1, 3), 0.2 * rng.standard_normal(max(1, 3 * n * m))
    bbar = 0.1 * rng.standard_normal((n, 3))
    elastic = elastic_of(rest.reshape(-1, 3), verts, bbar)
    return Shell(stencil, elastic, measure, theta_ref=np.array(folds)), x, u, rng


def remainder_slopes(remainder, steps):
    """Slopes of log |remainder| between consecutive steps, for each element of a batch."""
    values = np.log(np.abs([remainder(step) for step in steps]))
    return np.diff(values, axis=0) / np.diff(np.log(steps))[:, None]


def assert_slope(slopes, order):
    assert np.all(np.abs(np.median(slopes, axis=0) - order) < 0.1), slopes


@pytest.mark.parametrize("measure", ["tan", "sin"])
@pytest.mark.parametrize(("c", "m"), [(0.0, 1), (0.5, 0), (0.5, 1), (0.5, 2), (1.0, 0), (1.0, 2)])
def test_taylor_remainders_of_shell(c, m, measure):
    shell, x, u, rng = folded_batch(m, c, measure)
    dx, du = 0.02 * rng.standard_normal(x.shape), 0.02 * rng.standard_normal(u.shape)
    energy, g, h = shell.hessian(x, u)
    step = shell.local(dx, du)
    first = np.einsum("ni,ni->n", g, step)
    second = np.einsum("ni,nij,nj->n", step, h, step)

    def change(t):
        return (shell.energy(x + t * dx, u + t * du) - energy).sum(axis=1)

    steps = 0.1 / 2.0 ** np.arange(4)
    assert_slope(remainder_slopes(lambda t: change(t) - t * first, steps), 2)
    third = remainder_slopes(lambda t: change(t) - t * first - t * t / 2 * second, steps)
    assert_slope(third, 3)


@pytest.mark.parametrize("measure", ["tan", "sin"])
@pytest.mark.parametrize(("c", "m"), [(0.0, 1), (0.5, 0), (0.5, 2), (1.0, 1)])
def test_hessian_is_symmetric_and_derivative_of_gradient(c, m, measure):
    shell, x, u, rng = folded_batch(m, c, measure, seed=1)
    _, g, h = shell.hessian(x, u)
    assert np.abs(h - h.transpose(0, 2, 1)).max() <= 1e-14 * np.abs(h).max()
    dx, du = 0.02 * rng.standard_normal(x.shape), 0.02 * rng.standard_normal(u.shape)
    step = np.einsum("nij,nj->ni", h, shell.local(dx, du))
    steps = 0.1 / 2.0 ** np.arange(4)

    def remainder(t):
        return np.linalg.norm(shell.gradient(x + t * dx, u + t * du)[1] - g - t * step, axis=1)

    assert_slope(remainder_slopes(remainder, steps), 2)


def test_the_three_kernels_agree():
    shell, x, u, _ = folded_batch(1, 0.5, "tan")
    energy, g, _ = shell.hessian(x, u)
    np.testing.assert_allclose(shell.energy(x, u), energy, rtol=1e-13)
    np.testing.assert_allclose(shell.gradient(x, u)[1], g, rtol=0, atol=1e-15 * np.abs(g).max())
    assert np.all(energy > 0)


@pytest.mark.parametrize("measure", ["tan", "sin"])
def test_rigid_motions(measure):
    shell, x, u, _ = folded_batch(1, 0.5, measure)
    turn, shift = rotation([1, -2, 0.5], 2.1), np.array([3.0, -1.0, 2.0])
    energy, g = shell.gradient(x, u)
    moved = x @ turn.T + shift
    energy_moved, g_moved = shell.gradient(moved, u)
    np.testing.assert_allclose(energy_moved, energy, rtol=1e-11)
    forces, forces_moved = (v[:, :18].reshape(-1, 6, 3) for v in (g, g_moved))
    scale = np.abs(g).max()
    assert np.abs(forces_moved - forces @ turn.T).max() < 1e-11 * scale
    assert np.abs(forces.sum(axis=1)).max() < 1e-13 * scale
    moment = np.cross(x[shell.stencil.verts], forces).sum(axis=1)
    assert np.abs(moment).max() < 1e-13 * scale


def test_second_form_is_the_papers_tensor():
    """B_ab = 2 (n_a - n_i) . (v_b - v_i) for a, b in (j, k) with normalised mean normals."""
    shell, x, u, _ = folded_batch(0, 0.5, "sin", seed=2)
    b = call(kernels.second_form, x, shell.stencil.verts, shell.tilts(x, u)[2], shape=(shell.n, 3))
    for i, v in enumerate(x[shell.stencil.verts]):

        def unit_normal(p, q, r):
            normal = np.cross(q - p, r - p)
            return normal / np.linalg.norm(normal)

        mean = []
        for e in range(3):
            p, q = v[(e + 1) % 3], v[(e + 2) % 3]
            both = unit_normal(p, q, v[e]) + unit_normal(q, p, v[3 + e])
            mean.append(both / np.linalg.norm(both))
        along = np.array([v[1] - v[0], v[2] - v[0]])
        tensor = 2 * np.array([mean[1] - mean[0], mean[2] - mean[0]]) @ along.T
        np.testing.assert_allclose(tensor[0, 1], tensor[1, 0], atol=1e-13)
        np.testing.assert_allclose(b[i], tensor[[0, 0, 1], [0, 1, 1]], atol=1e-13)


def test_membrane_is_saint_venant_kirchhoff():
    shell, x, u, _ = folded_batch(0, 0.5, "tan", seed=3)
    energy = shell.energy(x, u)[:, 0]
    rest = np.array([[0, 0], [1, 0.1], [0.2, 0.9]])
    edges = np.column_stack([rest[1] - rest[0], rest[2] - rest[0]])
    lam, mu = YOUNG * POISSON / (1 - POISSON**2), YOUNG / (2 * (1 + POISSON))
    for i, v in enumerate(x[shell.stencil.verts]):
        f = np.column_stack([v[1] - v[0], v[2] - v[0]]) @ np.linalg.inv(edges)
        green = (f.T @ f - np.eye(2)) / 2
        density = lam / 2 * np.trace(green) ** 2 + mu * np.trace(green @ green)
        area = abs(np.linalg.det(edges)) / 2
        np.testing.assert_allclose(energy[i], THICKNESS * area * density, rtol=1e-12)


@pytest.mark.parametrize("curvatures", [(1.0, 0.0), (0.0, -1.0), (1.0, 1.0)])
@pytest.mark.parametrize("measure", ["tan", "sin"])
def test_bending_energy_of_cylinder_and_sphere(curvatures, measure):
    """1/2 D (k1^2 + k2^2 + 2 nu k1 k2) per area, on one triangle of a three-direction lattice."""
    flat = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [-1, 1], [1, -1.0]])
    flat = 0.01 * flat @ np.array([[1.0, 0.3], [0.2, 0.8]])
    rest = np.column_stack([flat, np.zeros(6)])
    k1, k2 = curvatures
    x = rest.copy()
    x[:, 2] = (k1 * flat[:, 0] ** 2 + k2 * flat[:, 1] ** 2) / 2
    verts = np.arange(6, dtype=np.int32)[None]
    stencil = Stencil(
        verts,
        np.zeros((1, 3, 3)),
        np.full((1, 3), 0.5),
        np.empty((1, 3, 0)),
        np.empty((1, 3, 0), np.int32),
    )
    shell = Shell(stencil, elastic_of(rest, verts), measure)
    rigidity = YOUNG * THICKNESS**3 / (12 * (1 - POISSON**2))
    area = call(kernels.areas, rest, verts, shape=1)[0]
    exact = 0.5 * rigidity * (k1**2 + k2**2 + 2 * POISSON * k1 * k2) * area
    slope = np.abs(x[:, 2]).max() / 0.01
    bending = shell.energy(x, np.zeros(1))[0, 1]
    assert abs(bending / exact - 1) < 4 * slope**2


def test_rest_state_with_natural_curvature_is_free():
    shell, x, u, _ = folded_batch(1, 0.5, "tan", seed=4)
    s = shell.tilts(x, u)[2]
    bbar = call(kernels.second_form, x, shell.stencil.verts, s, shape=(shell.n, 3))
    rest = Shell(shell.stencil, elastic_of(x, shell.stencil.verts, bbar), "tan", shell.theta_ref)
    energy, g = rest.gradient(x, u)
    stiff = np.abs(rest.hessian(x, u)[2]).max()
    assert energy.max() < 1e-28 * stiff
    assert np.abs(g).max() < 1e-14 * stiff


def test_extrapolated_stress_misses_only_the_quadratic_part():
    shell, x, _, rng = folded_batch(1, 0.5, "tan")
    dx = 0.3 * rng.standard_normal(x.shape)
    verts, elastic = shell.stencil.verts, shell.elastic
    sigma = call(kernels.extrapolated_stress, x, dx, verts, elastic, shape=(shell.n, 3))
    quadratic = call(kernels.metrics, dx, verts, shape=(shell.n, 3))
    missed = np.einsum("nij,nj->ni", elastic.C, quadratic)
    exact = shell.stress(x + dx)
    np.testing.assert_allclose(sigma, exact - missed, atol=1e-14 * np.abs(exact).max())


def test_stress_enters_only_the_membranes_geometric_stiffness():
    """H(sigma) - H(sigma') is the constant Hessian of (sigma - sigma') . a."""
    shell, x, u, rng = folded_batch(1, 0.5, "tan")
    other = rng.standard_normal((shell.n, 3))
    difference = shell.hessian(x, u, sigma=other)[2] - shell.hessian(x, u)[2]
    weight = other - shell.stress(x)
    step = rng.standard_normal(x.shape)
    local = shell.local(step, np.zeros_like(u))
    a = call(kernels.metrics, step, shell.stencil.verts, shape=(shell.n, 3))
    expected = 2 * np.einsum("ni,ni->n", weight, a)
    np.testing.assert_allclose(np.einsum("ni,nij,nj->n", local, difference, local), expected)


def test_hinge_is_followed_beyond_half_a_turn():
    tri = np.array([[0, 0, 0], [1, 0, 0], [0.2, 0.9, 0]])
    reference = np.zeros(1)
    angles = np.deg2rad(np.arange(0, 301, 20))
    stencil = Stencil(
        np.array([[0, 1, 2, 3, 4, 5]], np.int32),
        np.zeros((1, 3, 3)),
        np.array([[0, 0, 0.5]]),
        np.empty((1, 3, 0)),
        np.empty((1, 3, 0), np.int32),
    )
    theta_ref = np.zeros((1, 3))
    for angle in angles:
        x = np.vstack([tri, np.zeros((2, 3)), flap(tri[0], tri[1], tri[2], angle)])
        verts = np.array([[0, 1, 2, 5]], np.int32)
        theta = call(kernels.hinge_angles, x, verts, np.zeros((1, 3)), reference, shape=1)
        np.testing.assert_allclose(theta[0], angle, atol=1e-14)
        reference = theta
        shell = Shell(stencil, elastic_of(tri, stencil.verts[:, :3]), "sin", theta_ref)
        theta_ref, t, s = shell.tilts(x, np.zeros(1))
        np.testing.assert_allclose(t[0], [0, 0, angle / 2], atol=1e-14)
        b = call(kernels.second_form, x, stencil.verts, s, shape=(1, 3))
        np.testing.assert_allclose(b[0], [0, 0, 2 * 0.9 * np.sin(angle / 2)], atol=1e-14)
    restarted = call(kernels.hinge_angles, x, verts, np.zeros((1, 3)), np.zeros(1), shape=1)
    np.testing.assert_allclose(restarted[0], angles[-1] - 2 * np.pi)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("distance", [0.0, 1e-9, 1e-6, 1e-3])
def test_hinge_angle_near_fold_over_and_flat(sign, distance):
    p, q, r = np.array([[0.0, 0, 0], [1, 0, 0], [0.2, 0.9, 0]])
    for angle in (sign * (np.pi - distance), sign * distance):
        x = np.array([p, q, r, flap(p, q, r, angle)])
        verts = np.arange(4, dtype=np.int32)[None]
        theta = call(kernels.hinge_angles, x, verts, np.zeros((1, 3)), np.array([angle]), shape=1)
        np.testing.assert_allclose(theta[0], angle, atol=1e-15, rtol=4e-16)


def test_ghost_vertex_acts_as_a_vertex_held_there():
    shell, x, u, _ = folded_batch(1, 1.0, "tan")
    verts, offset = shell.stencil.verts.copy(), np.zeros((shell.n, 3, 3))
    for e in range(3):
        verts[:, 3 + e] = verts[:, (e + 1) % 3]
        offset[:, e] = x[shell.stencil.verts[:, 3 + e]] - x[verts[:, 3 + e]]
    ghost = Shell(
        shell.stencil._replace(verts=verts, offset=offset),
        shell.elastic,
        "tan",
        shell.theta_ref,
    )
    for real, ridden in zip(shell.hessian(x, u), ghost.hessian(x, u), strict=True):
        np.testing.assert_allclose(ridden, real, rtol=1e-10, atol=1e-12 * np.abs(real).max())


def test_unused_hinges_are_not_evaluated():
    """With c = 0 the opposite vertex may be anything: no NaN enters, no force reaches it."""
    shell, x, u, _ = folded_batch(1, 0.5, "tan")
    x = np.vstack([x, np.full(3, np.nan)])
    c, verts = shell.stencil.c.copy(), shell.stencil.verts.copy()
    c[:, 1], verts[:, 4] = 0.0, len(x) - 1
    partly = Shell(shell.stencil._replace(c=c, verts=verts), shell.elastic, "tan", shell.theta_ref)
    theta, t, _ = partly.tilts(x, u)
    np.testing.assert_array_equal(theta[:, 1], 0)
    slots = shell.stencil.slot[:, 1, 0]
    np.testing.assert_allclose(t[:, 1], shell.stencil.d[:, 1, 0] * u[slots])
    energy, g, h = partly.hessian(x, u)
    assert all(np.isfinite(v).all() for v in (energy, g, h))
    assert np.all(g[:, 12:15] == 0)
    assert np.all(h[:, 12:15] == 0)


@pytest.mark.parametrize("c", [0.0, 0.5])
def test_degenerate_triangle_gives_nan_energy(c):
    shell, x, u, _ = folded_batch(1, c, "tan")
    x[:3] = np.round(8 * x[:3]) / 8
    x[2] = (x[0] + x[1]) / 2
    energy, g, h = shell.hessian(x, u)
    assert not np.isfinite(energy[0].sum())
    assert all(np.isfinite(v[1:]).all() for v in (energy, g, h))
    assert np.isfinite(shell.energy(x, u).sum(axis=1)).tolist() == [False, True, True, True]


def test_neighbour_without_area_gives_nan_energy():
    shell, x, u, _ = folded_batch(1, 0.5, "tan")
    x[5] = x[0]
    assert np.isnan(shell.energy(x, u)[0, 1])


def hinges(m, seed=5):
    rng = np.random.default_rng(seed)
    angles = np.deg2rad([170, -170, 90, 5.0, 181, 300])
    x = np.empty((len(angles), 4, 3))
    for i, angle in enumerate(angles):
        x[i, :3] = np.array([[0, 0, 0], [1, 0.1, 0], [0.2, 0.9, 0]]) + 0.2 * rng.random((3, 3))
        x[i, 3] = flap(x[i, 0], x[i, 1], x[i, 2], angle)
    n = len(angles)
    offset = 0.3 * rng.standard_normal((n, 3))
    x[:, 3] -= offset
    hinge = HingeStencil(
        np.arange(4 * n, dtype=np.int32).reshape(n, 4),
        offset,
        rng.choice([0.5, 1.0], n),
        rng.choice([-1.0, 1.0], (n, m)),
        np.arange(n * m, dtype=np.int32).reshape(n, m),
    )
    u = rng.standard_normal(max(1, n * m))
    return hinge, x.reshape(-1, 3), u, angles, rng.standard_normal(n), rng


def hinge_energy(hinge, x, u, reference, work):
    n = len(work)
    theta = call(kernels.hinge_angles, x, hinge.verts, hinge.offset, reference, shape=n)
    return theta, call(kernels.hinge_work_energy, u, hinge, theta, work, shape=n)


@pytest.mark.parametrize("m", [0, 1, 2])
def test_taylor_remainders_of_edge_moment(m):
    hinge, x, u, angles, work, rng = hinges(m)
    n, k = len(work), 12 + m
    theta, energy = hinge_energy(hinge, x, u, angles, work)
    np.testing.assert_allclose(theta, angles, atol=1e-13)
    g = call(kernels.hinge_work_gradient, x, hinge, work, shape=(n, k))
    h = call(kernels.hinge_work_hessian, x, hinge, work, shape=(n, k, k))
    assert np.abs(h - h.transpose(0, 2, 1)).max() <= 1e-14 * np.abs(h).max()
    dx, du = 0.1 * rng.standard_normal(x.shape), 0.1 * rng.standard_normal(u.shape)
    step = np.hstack([dx[hinge.verts].reshape(n, 12), du[hinge.slot].reshape(n, m)])
    first, second = (g * step).sum(axis=1), np.einsum("ni,nij,nj->n", step, h, step)

    def remainder(t, order):
        moved = hinge_energy(hinge, x + t * dx, u + t * du, angles, work)[1]
        return moved - energy - t * first - (t * t / 2 * second if order == 3 else 0)

    steps = 0.1 / 2.0 ** np.arange(5)
    for order in (2, 3):
        assert_slope(remainder_slopes(lambda t, o=order: remainder(t, o), steps), order)


def test_edge_moment_does_moment_times_rotation():
    """Turning the flap from 100 to 260 degrees past the branch cut: work = M L times the turn."""
    p, q, r = np.array([[0.0, 0, 0], [1, 0, 0], [0.2, 0.9, 0]])
    verts, none = np.arange(4, dtype=np.int32)[None], np.empty((1, 0))
    hinge = HingeStencil(verts, np.zeros((1, 3)), np.ones(1), none, none.astype(np.int32))
    work, reference, energies = np.array([0.7]), np.array([np.deg2rad(100)]), []
    for angle in np.deg2rad([100, 180, 260]):
        x = np.array([p, q, r, flap(p, q, r, angle)])
        reference, energy = hinge_energy(hinge, x, np.zeros(1), reference, work)
        energies.append(energy[0])
    np.testing.assert_allclose(np.diff(energies), -0.7 * np.deg2rad(80))


def test_areas_and_altitudes():
    x = np.array([[0, 0, 1], [4, 0, 1], [0, 3, 1.0]])
    verts = np.array([[0, 1, 2]], np.int32)
    assert call(kernels.areas, x, verts, shape=1) == pytest.approx(6)
    np.testing.assert_allclose(call(kernels.altitudes, x, verts, shape=(1, 3)), [[12 / 5, 4, 3]])


def test_add_at_sums_repeated_dofs():
    rng = np.random.default_rng(0)
    dofs = rng.integers(0, 10, (30, 4)).astype(np.int32)
    values, out = rng.standard_normal((30, 4)), np.ones(10)
    kernels.add_at(values, dofs, out)
    expected = np.ones(10)
    np.add.at(expected, dofs, values)
    np.testing.assert_allclose(out, expected)


CACHE_PROBE = """
import numpy as np
from ufl_origami.kernels import areas
out = np.empty(1)
areas(np.eye(3), np.array([[0, 1, 2]], np.int32), out)
print(sum(areas.stats.cache_hits.values()), out[0])
"""


@pytest.mark.serial
def test_compiled_code_survives_the_process_but_not_an_edit(tmp_path):
    source = Path(ufl_origami.__file__).parent / "kernels"
    package = tmp_path / "ufl_origami"
    (package / "kernels").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    for path in source.glob("*.py"):
        (package / "kernels" / path.name).write_text(path.read_text())

    def probe():
        env = os.environ | {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "c")}
        done = subprocess.run(
            [sys.executable, "-c", CACHE_PROBE],
            cwd=tmp_path,
            env=env,
            capture_output=True,
            text=True,
            check=True,
        )
        hits, area = done.stdout.split()
        return int(hits), float(area)

    exact = np.sqrt(3) / 2
    assert probe() == (0, pytest.approx(exact))
    assert probe() == (1, pytest.approx(exact))
    vectors = package / "kernels" / "vectors.py"
    vectors.write_text(vectors.read_text().replace("sqrt(dot(a, a))", "2.0 * sqrt(dot(a, a))"))
    assert probe() == (0, pytest.approx(2 * exact))
