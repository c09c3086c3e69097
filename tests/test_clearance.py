"""Obstacles and supports that move by more than a body's thickness in one step do not pass it."""

import numpy as np
import pytest
from contact_scenes import QUIET, fixed, mean_velocity, plate

from ufl_origami.barrier import Barrier
from ufl_origami.discretise import build
from ufl_origami.dynamics import solve_dynamic
from ufl_origami.errors import ContactWarning, InputError, SolveError
from ufl_origami.gallery import z_fold
from ufl_origami.material import Material
from ufl_origami.meshing import mesh_pattern
from ufl_origami.obstacles import Box, Plane
from ufl_origami.scene import Scene
from ufl_origami.solvers.dynamics import TimeSettings
from ufl_origami.solvers.newton import NewtonSettings
from ufl_origami.suggestions import suggest_barrier

WALL = Box((0.0, 0.0, -0.011), (9.0, 9.0, 2e-3))  # its surface 0.01 below the sheet
HARD = Barrier(5e4, 0.01)
BLOCKED = "an obstacle or a support would close a gap"


def risen():
    """A plate at rest over a thin wall that rises."""
    scene = plate()
    scene.obstacle("wall", WALL, HARD, motion=lambda time: (0.0, 0.0, time))
    return scene


def lowered():
    """A plate whose supports lower it onto a thin wall."""
    scene = plate()
    scene.move("sheet", x=0.0, y=0.0, z=lambda time: -time)
    scene.obstacle("wall", WALL, HARD)
    return scene


@pytest.mark.parametrize("make", [risen, lowered])
def test_one_step_through_a_thin_wall_and_out_is_refused(make):
    made = build(make())
    with pytest.raises(SolveError, match=f"fixed step 0.1 failed: {BLOCKED}"):
        solve_dynamic(made, [0.1], fixed(0.1), record=QUIET)
    assert (made.x.array_r == 0).all()


def test_thin_wall_that_rises_fast_throws_the_plate_up():
    model = solve_dynamic(risen(), [0.1], TimeSettings(step=0.1), record=QUIET).model
    assert model.contacts[0].smallest > 0
    assert mean_velocity(model)[2] == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize(
    "settings",
    [
        {"method": "l2"},
        {"method": "cp"},
        {"options": {"snes_linesearch_type": "l2"}},
        {"options": {"snes_type": "newtontr"}},
    ],
)
def test_solvers_that_go_beyond_a_shortened_step_are_refused(settings):
    newton = NewtonSettings(**settings)
    with pytest.raises(InputError, match="may step through an obstacle"):
        solve_dynamic(risen(), [0.1], fixed(0.01), record=QUIET, newton=newton)


@pytest.mark.parametrize("method", ["newton", "bt"])
def test_methods_that_only_shorten_steps_do_not_pass_a_thin_wall(method):
    newton = NewtonSettings(method=method)
    sizes = TimeSettings(step=0.1)
    model = solve_dynamic(risen(), [0.1], sizes, record=QUIET, newton=newton).model
    assert mean_velocity(model)[2] == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize("kind", ["folded", "ddg", "fem"])
def test_barrier_too_weak_is_named_however_the_last_step_failed(kind):
    model = {"folded": "ddg"}.get(kind, kind)
    if kind == "folded":
        sheet = mesh_pattern(z_fold(), 0.5)
        scene = Scene(sheet, Material(1e7, 0.3, 0.01, 1000.0))
        scene.crease("crease", 5.0)
    else:
        scene = plate(side=0.5, model=model, E=1e9)
    scene.launch((0.0, 0.0, -100.0))
    scene.obstacle("wall", Plane((0.0, 0.0, -1.0)), suggest_barrier(scene, speed=1.0))
    made = build(scene)
    with (
        pytest.warns(ContactWarning),
        pytest.raises(SolveError, match=r"obstacle 'wall': its barrier .* too weak"),
    ):
        solve_dynamic(made, [0.02], TimeSettings(step=4e-4, largest=2e-3), record=QUIET)
    assert 0 < made.contacts[0].smallest < 1e-4
    assert np.isfinite(made.x.array_r).all()
