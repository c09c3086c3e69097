"""A scene pays only for what it names: forms, unknowns and terms of plain and of full scenes."""

import numpy as np
import pytest
from dolfinx import fem
from scenes import E, H

import ufl_origami as uo
from ufl_origami.discretise import build
from ufl_origami.gallery import z_fold
from ufl_origami.meshing import mesh_pattern

RECORD = uo.Record(fields="none")
TIME = uo.TimeSettings(step=1e-3, fixed=True)


def plain_scene(model="ddg"):
    """A free folded sheet with its crease, and nothing around it."""
    scene = uo.Scene(mesh_pattern(z_fold(), 0.5), uo.Material(E, 0.3, H, 1e3), model=model)
    scene.crease("crease", 10.0)
    return scene


def full_scene(model="ddg"):
    """The same sheet with everything that can surround it."""
    scene = plain_scene(model)
    scene.gravity((0.0, 0.0, -9.81))
    scene.obstacle("floor", uo.Plane((0.0, 0.0, -2.0)), uo.suggest_barrier(scene, 1.0))
    scene.friction("floor", uo.Coulomb(0.3, 0.01))
    scene.magnetise("left", (0.1, 0.0, 0.0))
    scene.magnetic_field((0.0, 0.0, 1e-3))
    scene.damping(mass=0.1, stiffness=1e-4)
    scene.point_mass("A", 0.1)
    return scene


@pytest.fixture
def forms(monkeypatch):
    """Forms compiled so far."""
    made = []
    compiled = fem.form
    monkeypatch.setattr(fem, "form", lambda *a, **k: made.append(a) or compiled(*a, **k))
    return made


def names(terms):
    return sorted(type(term).__name__ for term in terms)


def test_a_plain_scene_has_its_panels_and_creases_and_no_form(forms):
    model = build(plain_scene())
    assert names(model.problem.terms) == ["CreaseTerm", "ShellTerm"]
    assert model.in_time == [] and model.motion is None
    assert len(forms) == 0
    assert not model.problem.bounded


def test_motion_adds_one_term_and_the_form_of_the_mass(forms):
    result = uo.solve_dynamic(plain_scene(), [1e-3], TIME, record=RECORD)
    assert names(result.model.balance.terms) == ["CreaseTerm", "InertiaTerm", "ShellTerm"]
    assert len(forms) == 1
    result = uo.solve_static(held(plain_scene()), [1.0], record=RECORD)
    assert names(result.model.problem.terms) == ["CreaseTerm", "ShellTerm"]


def held(scene):
    scene.fix("left_edge")
    scene.move("right_edge", x=0.1, y=0.0, z=0.0)
    return scene


@pytest.mark.parametrize("model", ["ddg", "fem"])
def test_surroundings_add_a_term_each_and_no_unknown(model, forms):
    plain, count = build(plain_scene(model)), len(forms)
    full = uo.solve_dynamic(full_scene(model), [1e-3], TIME, record=RECORD).model
    own = names(plain.problem.terms)
    around = ["ContactTerm", "MagneticTerm", "NodalLoad", "_TimedForm"]  # two weights
    in_time = ["InertiaTerm", "MassDamping", "NodalFriction", "ViscousFold", "ViscousShell"]
    assert names(full.problem.terms) == sorted([*own, *around])
    assert names(full.balance.terms) == sorted([*own, *around, *in_time])
    assert full.num_unknowns == plain.num_unknowns
    assert len(forms) > count + 10


def test_each_piece_of_the_surroundings_is_made_when_it_is_named(forms):
    scene = plain_scene()
    scene.gravity((0.0, 0.0, -9.81))
    build(scene)
    weight = len(forms)
    assert weight == 2  # energy and force: a linear energy has no tangent
    scene.magnetic_field((0.0, 0.0, 1e-3))
    scene.magnetise("left", (0.0, 0.1, 0.0))
    model = build(scene)
    assert len(forms) == 2 * weight + 2  # linear, too: the remanence lies in the panel
    scene.magnets["left"] = np.array([0.1, 0.0, 0.0])
    build(scene)
    assert len(forms) == 3 * weight + 2 + 3  # the part along the normal has a tangent
    assert names(model.problem.terms) == ["CreaseTerm", "MagneticTerm", "ShellTerm", "_TimedForm"]


def test_contact_far_away_assembles_nothing(monkeypatch):
    scene = full_scene()
    model = build(scene)
    (contact,) = model.contacts
    calls = []
    monkeypatch.setattr(contact._form, "add_residual", lambda *a: calls.append(a))
    monkeypatch.setattr(contact.at.gaps, "at", counted(contact.at.gaps.at, calls))
    force = model.x.duplicate()
    for _ in range(5):
        model.problem.forces(model.x, force)
    assert len(calls) == 1  # the distances are measured once, and no force


def counted(function, calls):
    def call(*arguments):
        calls.append(arguments)
        return function(*arguments)

    return call


def test_full_scene_feels_all_its_forces():
    model = build(full_scene())
    model.load_factor.held = 1.0
    model.problem.set_time(0.0)
    for term in model.problem.terms:
        out = np.zeros(model.configuration.num_local)
        term.add_residual(model.state, out)
        acts = type(term).__name__ in ("MagneticTerm", "NodalLoad", "_TimedForm")
        assert (np.abs(out).max() > 1e-6) == acts, type(term).__name__
