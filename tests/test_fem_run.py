"""Runs of the fem model: history, fields, checkpoint, resuming."""

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from run_scenes import PULL_STEPS
from scenes import E, H
from test_run import assert_close, bits

from ufl_origami.errors import InputError, SolveError
from ufl_origami.gallery import z_fold
from ufl_origami.history import Record, read_history
from ufl_origami.material import Material
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.meshing import mesh_pattern
from ufl_origami.run import solve_static
from ufl_origami.scene import Scene
from ufl_origami.solvers.static import StepSettings

OPTIONS = {"steps": PULL_STEPS, "record": Record(fields="none")}


@pytest.fixture
def folder(comm, tmp_path):
    """One folder for all ranks."""
    return Path(comm.bcast(str(tmp_path), root=0))


def pull(comm, model="fem"):
    """Z-fold pulled open, with a line load on the crease."""
    sheet = mesh_pattern(z_fold(), 0.4, comm=comm)
    scene = Scene(sheet, Material(E, 0.3, H), model=model)
    scene.crease("crease", 10.0)
    scene.fix("left_edge")
    scene.move("right_edge", x=1.0, y=0.0, z=0.0)
    scene.line_load("crease", (0.0, 0.0, -1.0))
    return scene


def roll(comm):
    """Cantilever rolled up in its plane to a full circle by an end moment."""
    sheet = rectangle(10.0, 1.0, n=(12, 1), comm=comm)
    scene = Scene(sheet, Material(1.2e6, 0.0, 0.1), model="fem")
    scene.fix("sheet", "y")
    scene.fix("x0")
    scene.clamp("x0")
    scene.edge_moment("x1", 20.0 * np.pi)
    return scene


@pytest.mark.mpi
def test_history_and_fields_are_those_of_the_model(comm, folder):
    result = solve_static(pull(comm), [0.2, 0.5], output=folder, steps=StepSettings(first=0.2))
    model, last = result.model, result.history.rows[-1]
    for kind, value in model.energies().items():
        assert last[f"energy_{kind}"] == value
    assert last["energy_total"] == pytest.approx(model.problem.potential(model.x), rel=1e-12)
    assert last["reaction_right_edge_x"] == model.reaction("right_edge")[0]
    assert last["fold_virtual_crease"] == pytest.approx(
        np.degrees(model.mean_fold_angle("crease")), rel=1e-14
    )
    total = [
        sum(last[f"reaction_{name}_{axis}"] for name in ("left_edge", "right_edge"))
        for axis in "xyz"
    ]
    np.testing.assert_allclose(total, [0.0, 0.0, 0.5], atol=1e-6)
    assert [step.stability for step in result.steps] == ["stable"] * len(result.steps)
    if comm.rank == 0:
        assert read_history(folder / "history.csv").rows == result.history.rows
        assert any(folder.glob("fields.*"))


@pytest.mark.serial
@pytest.mark.parametrize("make", [pull, roll])
def test_a_resumed_run_equals_an_uninterrupted_one_to_the_bit(folder, make):
    whole = solve_static(make(MPI.COMM_SELF), [0.6, 1.0], **OPTIONS)
    solve_static(make(MPI.COMM_SELF), [0.6], output=folder, **OPTIONS)
    resumed = solve_static(make(MPI.COMM_SELF), [0.6, 1.0], output=folder, resume=True, **OPTIONS)
    assert bits(resumed.history) == bits(whole.history)
    assert (resumed.model.x.array_r == whole.model.x.array_r).all()


@pytest.mark.mpi
def test_rotation_beyond_half_a_turn_survives_a_restart(comm, folder):
    """Work of the end moment M over a full turn: load energy - 2 pi M, M = 2 pi EI / L."""
    options = {"steps": StepSettings(first=0.25, largest=0.25), "record": Record(fields="none")}
    solve_static(roll(comm), [0.75], output=folder, **options)
    result = solve_static(roll(comm), [0.75, 1.0], output=folder, resume=True, **options)
    moment = 20.0 * np.pi
    assert result.history["energy_load"][-1] == pytest.approx(-2 * np.pi * moment, rel=5e-3)


@pytest.mark.mpi
@pytest.mark.parametrize("serial_first", [True, False])
def test_restart_on_another_number_of_ranks(comm, folder, serial_first):
    first, second = (MPI.COMM_SELF, comm) if serial_first else (comm, MPI.COMM_SELF)
    reference = solve_static(roll(MPI.COMM_SELF), [0.6, 1.0], **OPTIONS)
    mine = folder if comm.rank == 0 or first is comm else folder / "unused"
    solve_static(roll(first), [0.6], output=mine, **OPTIONS)
    comm.Barrier()
    if second is comm or comm.rank == 0:
        result = solve_static(roll(second), [0.6, 1.0], output=folder, resume=True, **OPTIONS)
        assert_close(result.history, reference.history, rtol=1e-7)


@pytest.mark.mpi
def test_a_crushed_sheet_is_refused_and_leaves_what_was_accepted(comm):
    """Triangles below a tenth of their area are not accepted: area ratio 1 - 0.95 load factor."""
    sheet = rectangle(1.0, 1.0, n=(2, 2), comm=comm)
    scene = Scene(sheet, Material(1.0, 0.0, 0.1), model="fem")
    scene.move("sheet", x=lambda time, rest: -0.95 * time * rest[:, 0], y=0.0, z=0.0)
    with pytest.raises(SolveError, match=r"shrank to 0\.0") as caught:
        solve_static(scene, [1.0], steps=StepSettings(first=0.5, smallest=0.01))
    assert 0.9 / 0.95 - 0.02 < caught.value.load_factor <= 0.9 / 0.95


@pytest.mark.mpi
def test_a_checkpoint_of_the_other_model_is_refused(comm, folder):
    solve_static(pull(comm, "ddg"), [0.2], output=folder, **OPTIONS)
    with pytest.raises(InputError):
        solve_static(pull(comm), [0.2, 0.5], output=folder, resume=True, **OPTIONS)
