"""Terms of a user's own enter the scene's energy, forces and tangent."""

import numpy as np
import pytest
import ufl
from scenes import build, disturb, follow, strip_scene
from test_terms import remainders

from ufl_origami.errors import SceneError
from ufl_origami.terms.base import StencilTerm
from ufl_origami.terms.form import FormTerm

pytestmark = pytest.mark.mpi


class GroundSpring(StencilTerm):
    """Springs k |u|^4 / 4 from given vertices to where they are at rest."""

    kinds = ("ground",)

    def __init__(self, vertices, stiffness):
        self.stiffness = stiffness
        self.dofs = (3 * vertices[:, None] + np.arange(3)).astype(np.int32)

    def stencils(self):
        return [self.dofs]

    def energies(self, state):
        u = state.q[self.dofs]
        return np.array([self.stiffness * ((u**2).sum(axis=1) ** 2).sum() / 4])

    def add_residual(self, state, out):
        u = state.q[self.dofs]
        np.add.at(out, self.dofs, self.stiffness * (u**2).sum(axis=1)[:, None] * u)

    def tangent(self, state, blocks):
        u = state.q[self.dofs]
        square = (u**2).sum(axis=1)[:, None, None]
        blocks[0][:] = self.stiffness * (square * np.eye(3) + 2 * u[:, :, None] * u[:, None, :])


def tip_spring(stiffness):
    """Maker of a spring at the named point "x1y0", on the rank that owns it."""

    def maker(configuration, functions):
        vertex = configuration.sheet.point_vertex("x1y0")
        owned = 0 <= vertex < configuration.nv_owned
        return GroundSpring(np.array([vertex] if owned else [], dtype=int), stiffness)

    return maker


def test_stencil_term_is_in_energy_forces_and_tangent():
    scene = strip_scene((6, 2))
    scene.add_term(tip_spring(1e4))
    model = disturb(build(scene), 0.05)
    u = model.position("x1y0") - [10.0, 0.0, 0.0]
    assert model.energies()["ground"] == pytest.approx(1e4 * (u @ u) ** 2 / 4, rel=1e-12)
    for order in (1, 2):
        steps, left = remainders(model, order)
        slope = np.polyfit(np.log(steps), np.log(left), 1)[0]
        assert slope == pytest.approx(order + 1, abs=0.1)


def test_spring_and_support_carry_the_load_together():
    scene = strip_scene((12, 2))
    scene.line_load("x1", (0.0, 0.0, 1.0))
    scene.add_term(tip_spring(5.0))
    model = build(scene)
    follow(model)
    u = model.position("x1y0") - [10.0, 0.0, 0.0]
    spring = 5.0 * (u @ u) * u
    assert spring[2] > 0.1
    load = np.array([0.0, 0.0, 1.0])
    assert model.reaction("x0") + load - spring == pytest.approx([0, 0, 0], abs=1e-6)


def test_form_force_without_energy_makes_the_tangent_unsymmetric():
    def follower(configuration, functions):
        v, turn = ufl.TestFunction(functions.sheet.V), ufl.as_vector([0.0, 0.0, 1.0])
        force = ufl.cross(turn, functions.u)
        return FormTerm("swirl", functions, force=-ufl.inner(force, v) * ufl.dx)

    scene = strip_scene((6, 2))
    assert build(scene).problem.symmetric
    scene.add_term(follower)
    problem = build(scene).problem
    assert not problem.symmetric
    assert not problem.conservative


def test_a_term_that_is_already_made_is_refused():
    scene = strip_scene((6, 2))
    term = GroundSpring(np.zeros(0, dtype=int), 1.0)
    with pytest.raises(SceneError, match="function that makes a term"):
        scene.add_term(term)
