"""Energy book: it closes for every kind of energy and work, and does not for a wrong force."""

import numpy as np
import pytest
from time_scenes import (
    ALONE,
    PLAIN,
    SHARP,
    fixed,
    flap,
    free_square,
    largest_energy,
    strip,
    unbalanced,
)

import ufl_origami as uo
from ufl_origami.crease_laws import MomentLaw
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.terms.base import StencilTerm
from ufl_origami.terms.crease import CreaseTerm
from ufl_origami.terms.form import FormTerm
from ufl_origami.terms.inertia import InertiaTerm
from ufl_origami.terms.shell import ShellTerm

MODELS = ("ddg", "fem")
STEP, STEPS = 0.05, 24
CLOSED = 1e-8


def sway(time):
    """A smooth motion from rest."""
    return 0.1 * np.sin(3 * time) ** 2


def loaded(model, comm=ALONE):
    scene = strip(model, comm)
    scene.line_load("x1", (0.0, 0.01, 0.05))
    return scene


def shaken(model, comm=ALONE):
    scene = strip(model, comm)
    scene.line_load("x1", lambda time: (0.0, 0.0, 0.1 * np.sin(7 * time)))
    scene.area_load("sheet", lambda time: (0.0, 0.0, 0.1 * np.cos(5 * time)))
    return scene


def pausing(time):
    """A motion that rests, goes, rests and goes again."""
    return np.interp(time, [0.2, 0.4, 0.8, 1.2], [0.0, 0.1, 0.1, 0.0])


def carried(model, comm=ALONE, way=sway):
    sheet = rectangle(1.0, 0.25, n=(4, 1), comm=comm)
    scene = uo.Scene(sheet, uo.Material(1e4, 0.3, 0.05, rho=1.0), model=model)
    scene.move("x0", x=0.0, y=0.0, z=way)
    scene.clamp("x0")
    return scene


def driven(model, comm=ALONE):
    scene = flap(model, comm, size=1.0)
    scene.creases.clear()
    scene.crease("crease", 0.02, rest_angle=lambda time: 1.5 * np.sin(time))
    return scene


def blown(model, comm=ALONE):
    scene = strip(model, comm)
    scene.pressure("sheet", lambda time: 0.2 * np.sin(4 * time))
    scene.damping(mass=0.2, stiffness=0.01)
    return scene


SCENES = {scene.__name__: scene for scene in (loaded, shaken, carried, driven, blown)}


def moved(scene, **options):
    options = {"record": PLAIN, "newton": SHARP} | options
    return uo.solve_dynamic(scene, [STEP * STEPS], fixed(STEP), **options)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", SCENES)
def test_book_closes(name, model):
    history = moved(SCENES[name](model)).history
    assert unbalanced(history) < CLOSED
    parts = [history["energy_total"], -history["work"]]
    parts += [history[f"lost_{way}"] for way in ("integrator", "damping", "friction")]
    sums = np.sum(parts, axis=0)
    np.testing.assert_allclose(history["imbalance"], sums - sums[0], atol=1e-13)
    worked = np.abs(history["work"]).max() > 0.1 * largest_energy(history)
    assert worked == (name != "loaded")  # a constant load has an energy and works without a book


@pytest.mark.mpi
def test_book_of_a_sheet_on_all_ranks(comm):
    ours, alone = (
        uo.solve_dynamic(
            blown("ddg", ranks), [0.5], fixed(STEP), record=PLAIN, newton=SHARP
        ).history
        for ranks in (comm, ALONE)
    )
    assert unbalanced(ours) < CLOSED
    for column in ("work", "lost_damping", "lost_integrator", "energy_kinetic"):
        assert ours[column] == pytest.approx(alone[column], abs=1e-8 * largest_energy(alone))


@pytest.mark.parametrize("motion", [sway, pausing])
@pytest.mark.parametrize("model", MODELS)
def test_work_of_a_moving_support_is_that_of_its_mean_reaction(model, motion):
    scene = carried(model, way=motion)
    scene.line_load("x1", (0.0, 0.0, 0.02))
    history = moved(scene).history
    way, reaction = np.diff(motion(history["time"])), history["reaction_x0_z"][1:]
    mean = np.concatenate([reaction[:1], 0.5 * (reaction[:-1] + reaction[1:])])
    work = np.cumsum(mean * way)
    assert history["work"][1:] == pytest.approx(work, rel=1e-12, abs=1e-15)


def test_work_of_actuation_is_what_turning_the_rest_angle_takes():
    """At a fold angle phi the spring's energy K/2 (phi - rest)^2 changes with its rest angle."""
    angles = uo.Record(fields="none", extra={"phi": lambda m: m.mean_fold_angle("crease")})
    history = moved(driven("ddg"), record=angles).history
    rest, phi = 1.5 * np.sin(history["time"]), history["phi"]
    ends = [(at - rest[1:]) ** 2 - (at - rest[:-1]) ** 2 for at in (phi[:-1], phi[1:])]
    turned = 0.5 * 0.02 * np.mean(ends, axis=0)
    # One edge along the crease: its angle is the mean one.
    assert history["work"][1:] == pytest.approx(np.cumsum(turned), abs=1e-10)


def test_work_of_pressure():
    """A free flat square is blown along its normal as a rigid body: p A along the way."""
    scene = free_square("ddg")
    scene.pressure("sheet", 0.3)
    scene.launch((0.0, 0.5, 2.0))
    history = moved(scene, scheme="implicit_euler").history
    time = history["time"]
    climbed = 2.0 * time + 0.3 / 0.05 * time * (time + STEP) / 2
    assert history["position_x1y0_z"] == pytest.approx(climbed, rel=1e-11)
    assert history["work"] == pytest.approx(0.3 * climbed, rel=1e-11)


def corrupt(monkeypatch, kind, picked=lambda term: True):
    """Make the force of a kind of term 1 % too large; its energy stays."""
    right = kind.add_residual

    def wrong(term, state, out):
        before = out.copy()
        right(term, state, out)
        if picked(term):
            out += 0.01 * (out - before)

    monkeypatch.setattr(kind, "add_residual", wrong)


class Cushion(StencilTerm):
    """A bounded energy of one's own: -k ln(height) of each vertex over a floor."""

    bounded = True

    def __init__(self, configuration, kind, k=5e-5, floor=-0.1):
        self.kinds, self.k, self.floor = (kind,), k, floor
        self.dofs = 3 * np.arange(configuration.nv_owned, dtype=np.int32)[:, None] + 2

    def heights(self, state):
        return state.x[: len(self.dofs), 2] - self.floor

    def stencils(self):
        return [self.dofs]

    def energies(self, state):
        return np.array([-self.k * np.log(self.heights(state)).sum()])

    def add_residual(self, state, out):
        out[self.dofs[:, 0]] -= self.k / self.heights(state)

    def tangent(self, state, blocks):
        blocks[0][:, 0, 0] = self.k / self.heights(state) ** 2

    def longest_step(self, state, step):
        falls = -step[self.dofs[:, 0]] / self.heights(state)
        return min(1.0, 0.9 / max(falls.max(), 1e-9))


def cushioned(kind):
    """A square that falls on a cushion, above a floor of the scene's."""
    scene = free_square("ddg")
    scene.add_term(lambda configuration, functions: Cushion(configuration, kind))
    scene.obstacle("floor", uo.Plane((0.0, 0.0, -0.14)), uo.Barrier(20.0, 0.06))
    scene.area_load("sheet", lambda time: (0.0, 0.0, -0.1 * np.sin(3 * time)))
    scene.launch((0.0, 0.0, -1.9))
    return scene


@pytest.mark.parametrize("kind", ["cushion", "contact", "load"])
def test_a_bounded_term_of_ones_own_is_booked_by_its_kind(kind):
    """Under a name of its own, or under one that another term, with bounds or without, has too."""
    heights = {}

    def note(step, model):
        heights[step.number] = model.state.x[:, 2] + 0.1

    history = moved(cushioned(kind), on_accept=note).history
    gap = np.array([heights[k] for k in range(1, len(history))])
    assert gap[1].max() < 3 / 32 * (gap[0] - gap[1]).min()  # a tenth of the step on it is closed
    assert unbalanced(history) < CLOSED
    if kind == "cushion":
        assert history["energy_cushion"][1:] == pytest.approx(-5e-5 * np.log(gap).sum(axis=1))
        assert history["energy_contact"].max() > 0.01 * largest_energy(history)


def test_a_wrong_force_of_a_bounded_term_shows(monkeypatch):
    corrupt(monkeypatch, Cushion)
    assert unbalanced(moved(cushioned("cushion")).history) > 1e-3


def everything():
    """A falling flap: gravity, shell, crease, damping."""
    scene = flap("ddg", size=0.5, spring=0.05)
    scene.gravity((0.0, 0.0, -1.0))
    scene.damping(stiffness=0.05)
    return scene


WRONG = {
    "none": (),
    "gravity": (FormTerm, lambda term: term.kinds == ("gravity",)),
    "shell": (ShellTerm, lambda term: True),
    "crease": (CreaseTerm, lambda term: True),
    "inertia": (InertiaTerm, lambda term: True),
}


@pytest.mark.parametrize("force", WRONG)
def test_a_wrong_force_shows(monkeypatch, force):
    if force != "none":
        corrupt(monkeypatch, *WRONG[force])
    history = moved(everything()).history
    if force == "none":
        assert unbalanced(history) < CLOSED
    else:
        assert unbalanced(history) > 1e-3


def snapping(model):
    """A flap whose crease is bistable, sent off from between its two stable angles."""
    scene = flap(model, size=1.0, E=1e7)
    scene.creases.clear()
    law = MomentLaw(lambda a: 0.2 * (a**3 - a), lambda a: 0.2 * (3 * a**2 - 1), rest_angle=0.0)
    scene.crease("crease", law=law)
    scene.damping(stiffness=0.5)
    scene.launch(lambda rest: np.maximum(rest[:, :1], 0.0) * [0.0, 0.0, 0.3])
    return scene


@pytest.mark.parametrize("model", MODELS)
def test_a_fold_that_snaps_is_not_driven_by_its_damping(model):
    history = moved(snapping(model), scheme="implicit_euler").history
    fold = np.radians(np.abs(history["fold_virtual_crease"]))
    falling = fold[:-1] < 3**-0.5  # where the moment falls with the angle
    taken = np.diff(history["lost_damping"])
    start = history["energy_kinetic"][0]
    assert falling[:5].all() and not falling[-5:].any()
    assert np.abs(taken[falling]).max() < 5e-3 * start  # the panels bend a little
    assert taken.min() > -1e-9 * start
    assert taken[~falling].sum() > start
    assert unbalanced(history) < CLOSED


def test_losses_are_losses():
    """Damping and implicit Euler take energy, step by step as far as they have a potential."""
    scene = strip("ddg")
    scene.damping(mass=0.5)
    scene.launch(lambda rest: rest[:, :1] ** 2 * [0.0, 0.0, 0.3])
    history = moved(scene, scheme="implicit_euler").history
    for way in ("integrator", "damping"):
        assert np.diff(history[f"lost_{way}"]).min() > 0
    assert np.diff(history["energy_total"]).max() < 0
    assert unbalanced(history) < CLOSED
