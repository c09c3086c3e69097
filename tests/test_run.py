"""Runs: what the history holds, and that whatever stops a run loses no accepted step."""

import json
import math
import os
import signal
import subprocess
import sys
import warnings
from pathlib import Path

from mpi4py import MPI

import dolfinx
import h5py
import numpy as np
import pytest
from run_scenes import (
    PULL_STEPS,
    PULL_STOPS,
    AtStep,
    crush,
    interrupt,
    pull,
    roll,
    run_pull,
    squeeze,
)

import ufl_origami
from ufl_origami.discretise import build
from ufl_origami.errors import BranchWarning, InputError, SolveError
from ufl_origami.gallery import z_fold
from ufl_origami.history import STEP_COLUMNS, Record, read_history
from ufl_origami.material import Material
from ufl_origami.output import FieldWriter
from ufl_origami.run import solve_static
from ufl_origami.solvers.admissible import Admissible, Limits
from ufl_origami.solvers.static import StepSettings

pytestmark = pytest.mark.filterwarnings("ignore:sagitta/h:ufl_origami.errors.MeshWarning")

ROOT = Path(__file__).parents[1]


@pytest.fixture
def folder(comm, tmp_path):
    """One folder for all ranks."""
    return Path(comm.bcast(str(tmp_path), root=0))


@pytest.fixture(scope="module")
def whole():
    """The uninterrupted pull, run by each rank alone."""
    return run_pull(MPI.COMM_SELF, None)


def bits(history):
    """Rows without the one column that no two runs share."""
    return [{k: v for k, v in row.items() if k != "seconds"} for row in history.rows]


def assert_close(history, reference, rtol=1e-8):
    """Measured columns agree relative to the largest of their kind, steps exactly."""
    assert history.columns == reference.columns
    for column in ("step", "load_factor", "step_size", "stability"):
        assert list(history[column]) == list(reference[column])
    for kind in ("energy_", "reaction_", "fold_", "included_", "position_"):
        columns = [c for c in reference.columns if c.startswith(kind)]
        wanted = np.array([reference[c] for c in columns])
        found = np.array([history[c] for c in columns])
        if columns:
            np.testing.assert_allclose(found, wanted, rtol=0, atol=rtol * np.abs(wanted).max())


@pytest.mark.mpi
def test_history_holds_the_model_at_each_step(comm, folder):
    scene = pull(comm, load=-1.0)
    result = solve_static(scene, [0.2, 0.5], output=folder, steps=StepSettings(first=0.2))
    model, history = result.model, result.history
    energies = [f"energy_{kind}" for kind in ("membrane", "bending", "crease", "load", "total")]
    ends = [f"reaction_{name}_{a}" for name in ("left_edge", "right_edge") for a in "xyz"]
    folds = [f"{a}_{b}_crease" for a in ("fold", "included") for b in ("virtual", "mesh")]
    points = [f"position_{p}_{a}" for p in model.sheet.points for a in "xyz"]
    assert history.columns == (*STEP_COLUMNS, *energies, *ends, *folds, *points)
    last = history.rows[-1]
    assert list(history["load_factor"][[0, -1]]) == [0.2, 0.5]
    assert [row["newton_iterations"] for row in history.rows] == [
        s.iterations for s in result.steps
    ]
    for kind, value in model.energies().items():
        assert last[f"energy_{kind}"] == value
    assert last["energy_total"] == pytest.approx(model.problem.potential(model.x), rel=1e-14)
    assert last["reaction_right_edge_x"] == model.reaction("right_edge")[0]
    assert last["position_A_z"] == model.position("A")[2]
    assert last["fold_virtual_crease"] == pytest.approx(
        np.degrees(model.mean_fold_angle("crease")), rel=1e-14
    )
    assert last["included_virtual_crease"] == 180.0 - last["fold_virtual_crease"]
    angles = model.fold_angles("crease")
    low, high = (
        comm.allreduce(np.degrees(f(angles.mesh, initial=start)), op=op)
        for f, start, op in ((np.min, 9.0, MPI.MIN), (np.max, 0.0, MPI.MAX))
    )
    assert low <= last["fold_mesh_crease"] <= high
    # Both supports and the load are in balance.
    total = sum(
        np.array([last[f"reaction_{n}_{a}"] for a in "xyz"]) for n in ("left_edge", "right_edge")
    )
    np.testing.assert_allclose(total, [0.0, 0.0, 0.5], atol=1e-6)
    rows = comm.bcast(read_history(folder / "history.csv").rows if comm.rank == 0 else None)
    assert rows == history.rows


def test_record_chooses_the_columns(comm):
    record = Record(
        energies=False,
        reactions=["A"],
        creases=(),
        points=["B"],
        extra={"unknowns": lambda model: model.num_unknowns},
        fields="none",
    )
    result = solve_static(pull(comm), [0.1], record=record)
    wanted = [f"{what}_{a}" for what in ("reaction_A", "position_B") for a in "xyz"]
    assert result.history.columns == (*STEP_COLUMNS, *wanted, "unknowns")
    assert result.history["unknowns"] == [result.model.num_unknowns]
    np.testing.assert_allclose(result.model.reaction("A"), 0.0, atol=1e-6)


@pytest.mark.parametrize("part", ["reactions", "creases", "points"])
def test_record_of_an_unknown_name(comm, part):
    with pytest.raises(InputError, match="creas"):
        solve_static(pull(comm), [0.1], record=Record(**{part: ["creas"]}))


@pytest.mark.parametrize("time", ["every", "checkpoint"])
@pytest.mark.parametrize("value", [-1.0, math.nan])
def test_times_of_writing_that_are_none_are_refused(time, value):
    with pytest.raises(InputError, match=f"record: {time} = {value} is negative or no number"):
        Record(**{time: value})


@pytest.mark.mpi
def test_ctrl_c_on_one_rank_stops_all_after_an_accepted_step(comm, folder, whole):
    last = comm.size - 1
    measure = AtStep(3, interrupt if comm.rank == last else lambda: None)
    with pytest.raises(KeyboardInterrupt, match="after the step to"):
        run_pull(comm, folder, measure)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if comm.rank == 0:
        assert list(read_history(folder / "history.csv")["step"]) == [1, 2, 3]
    comm.Barrier()
    result = run_pull(comm, folder, resume=True)
    assert result.steps[0].number == 1
    assert_close(result.history, whole.history)


@pytest.mark.serial
def test_second_ctrl_c_stops_at_once(folder):
    def twice():
        interrupt()
        interrupt()
        raise AssertionError("the second SIGINT did not interrupt")

    with pytest.raises(KeyboardInterrupt):
        run_pull(MPI.COMM_SELF, folder, AtStep(3, twice))
    assert len(read_history(folder / "history.csv")) == 2


@pytest.mark.serial
@pytest.mark.parametrize("place", ["before its row", "before its checkpoint"])
def test_killed_run_resumes_to_the_same_bits(folder, whole, place):
    script = [sys.executable, "tests/run_scenes.py", str(folder), place]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(script, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert len(read_history(folder / "history.csv")) == (2 if place == "before its row" else 3)
    result = run_pull(MPI.COMM_SELF, folder, resume=True)
    assert bits(result.history) == bits(whole.history)
    assert bits(read_history(folder / "history.csv")) == bits(whole.history)
    assert (result.model.x.array_r == whole.model.x.array_r).all()
    assert len(list((folder / "checkpoint").iterdir())) == 2


def failing(error=None):
    """The pull with a load that cannot be had beyond half the load factor."""
    scene = pull(MPI.COMM_SELF)

    def load(time):
        if error and time > 0.5:
            raise error("no load")
        return 0.0, 0.0, -time

    scene.line_load("crease", load)
    return scene


@pytest.mark.serial
@pytest.mark.parametrize("error", [InputError, KeyboardInterrupt])
def test_what_a_step_raises_leaves_the_last_state_in_memory_and_on_disk(folder, error):
    model, last = build(failing(error)), {}
    options = {"output": folder, "record": Record(fields="none", checkpoint=1e9)}
    options |= {"steps": PULL_STEPS}

    def note(step, model):
        last.update(time=step.time, energies=model.energies())

    with pytest.raises(error, match="no load"):
        solve_static(model, PULL_STOPS, on_accept=note, **options)
    assert model.problem.time == last["time"] > 0
    assert model.energies() == last["energies"]
    resumed = solve_static(failing(), PULL_STOPS, resume=True, **options)
    assert bits(resumed.history) == bits(
        solve_static(failing(), PULL_STOPS, record=Record(fields="none"), steps=PULL_STEPS).history
    )


@pytest.mark.serial
def test_a_warning_made_an_error_comes_after_its_state_is_recorded(folder):
    options = {"record": Record(fields="none"), "steps": StepSettings(first=0.25)}
    with pytest.raises(BranchWarning) as caught:
        solve_static(squeeze(MPI.COMM_SELF), [1.0], output=folder, **options)
    history = read_history(folder / "history.csv")
    assert f"state at {history['load_factor'][-1]:g} was found far" in str(caught.value)
    with pytest.warns(BranchWarning):
        whole = solve_static(squeeze(MPI.COMM_SELF), [1.0], **options)
    assert bits(history) == bits(whole.history)[: len(history)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BranchWarning)
        resumed = solve_static(squeeze(MPI.COMM_SELF), [1.0], output=folder, resume=True, **options)
    assert bits(resumed.history) == bits(whole.history)


@pytest.mark.filterwarnings("ignore::ufl_origami.errors.BranchWarning")
@pytest.mark.serial
def test_resume_keeps_the_memory_of_the_guard(folder):
    """A strip that buckled needed a shift; what follows starts from it, to the same bits."""
    options = {"record": Record(fields="none"), "steps": StepSettings(first=0.25)}
    whole = solve_static(squeeze(MPI.COMM_SELF), [0.25, 1.0], **options)
    solve_static(squeeze(MPI.COMM_SELF), [0.25], output=folder, **options)
    stored = json.loads((folder / "checkpoint" / "manifest.json").read_text())
    assert stored["shift"] > 0
    resumed = solve_static(
        squeeze(MPI.COMM_SELF), [0.25, 1.0], output=folder, resume=True, **options
    )
    assert len(whole.steps) > 2
    assert bits(resumed.history) == bits(whole.history)


@pytest.mark.mpi
@pytest.mark.parametrize("scene", [pull, roll])
@pytest.mark.parametrize("serial_first", [True, False])
def test_restart_on_another_number_of_ranks(comm, folder, scene, serial_first):
    """A checkpoint of one rank continues on all, and the other way round."""
    first, second = (MPI.COMM_SELF, comm) if serial_first else (comm, MPI.COMM_SELF)
    options = {"steps": PULL_STEPS, "record": Record(fields="none")}
    reference = solve_static(scene(MPI.COMM_SELF), [0.6, 1.0], **options)
    mine = folder if comm.rank == 0 or first is comm else folder / "unused"
    solve_static(scene(first), [0.6], output=mine, **options)
    comm.Barrier()
    if second is comm or comm.rank == 0:
        result = solve_static(scene(second), [0.6, 1.0], output=folder, resume=True, **options)
        assert_close(result.history, reference.history)


@pytest.mark.mpi
def test_rotation_beyond_half_a_turn_survives_a_restart(comm, folder):
    options = {"steps": StepSettings(first=0.25, largest=0.25), "record": Record(fields="none")}
    solve_static(roll(comm), [0.75], output=folder, **options)
    result = solve_static(roll(comm), [0.75, 1.0], output=folder, resume=True, **options)
    # Work of the end moment M over a full turn, M = 2 pi E I / L: load energy - 2 pi M.
    moment = 2 * np.pi * 1.2e6 * 0.1**3 / 12 / 10.0
    assert result.history["energy_load"][-1] == pytest.approx(-2 * np.pi * moment, rel=0.05)


@pytest.mark.mpi
def test_failed_solve_leaves_what_was_accepted(comm, folder):
    """Triangles crushed below a tenth of their area are refused: beyond 0.9 / 0.95."""
    steps, limit = StepSettings(first=0.5, smallest=0.01), 0.9 / 0.95
    model = build(crush(comm))
    with pytest.raises(SolveError, match=r"shrank to 0\.0") as caught:
        solve_static(model, [1.0], output=folder, steps=steps)
    reached = caught.value.load_factor
    assert limit - 0.02 < reached <= limit
    assert model.problem.time == reached
    assert model.position("x1y0")[0] == pytest.approx(1 - 0.95 * reached, rel=1e-12)
    if comm.rank == 0:
        history = read_history(folder / "history.csv")
        assert history["load_factor"][-1] == reached
        assert history["position_x1y0_x"][-1] == pytest.approx(1 - 0.95 * reached, rel=1e-12)
    with pytest.raises(SolveError) as again:
        solve_static(crush(comm), [1.0], output=folder, steps=steps, resume=True)
    assert reached <= again.value.load_factor <= limit


@pytest.mark.mpi
def test_inadmissible_states_are_named(comm):
    model = build(pull(comm))
    check, n = Admissible(model), 3 * model.configuration.nv_owned
    assert check(model.x) == ""
    trial = model.x.copy()
    trial.array_w[:n].reshape(-1, 3)[:] = -0.95 * model.sheet.rest[: n // 3]
    trial.assemble()
    assert "shrank to 0.0025" in check(trial)
    slot = model.configuration.slot("director")
    trial = model.x.copy()
    if comm.rank == comm.size - 1:
        trial.array_w[n + slot[slot >= 0][0]] = 1.6
    trial.assemble()
    assert check(trial) == "tilt of 91.7 deg"
    slot = model.configuration.slot("fold_angle")
    trial = model.x.copy()
    trial.array_w[n + slot[(slot >= 0) & (slot < model.configuration.ns_owned)]] -= 3.2
    trial.assemble()
    wide = Admissible(model, Limits(tilt=np.inf))
    assert wide(trial) == "a fold angle turned by 183.3 deg in one step"


def test_run_cuts_steps_to_admissible_ones(comm, monkeypatch):
    """A bound on the turn of the crease in one step is kept by every accepted step."""
    bound, angles = 0.05, []
    monkeypatch.setattr(
        "ufl_origami.run.Admissible", lambda model: Admissible(model, Limits(turn=bound))
    )
    record = Record(extra={"phi": lambda model: model.mean_fold_angle("crease")})
    result = solve_static(pull(comm), [1.0], record=record, steps=StepSettings(first=1.0))
    angles = np.concatenate([[np.radians(180 - 35.6)], result.history["phi"]])
    assert np.abs(np.diff(angles)).max() < bound
    assert result.history["cuts"].sum() > 0


@pytest.mark.mpi
def test_resume_refuses_another_scene(comm, folder):
    options = {"output": folder, "record": Record(fields="none")}
    with pytest.raises(InputError, match="name the output folder"):
        solve_static(pull(comm), [0.1], resume=True)
    with pytest.raises(InputError, match="holds no checkpoint"):
        solve_static(pull(comm), [0.1], resume=True, **options)
    solve_static(pull(comm), [0.1], **options)
    for other, what in (
        (pull(comm, material=Material(1e7, 0.3, 0.02)), "material"),
        (pull(comm, size=0.3), "sheet"),
        (pull(comm, load=1.0), "load energy"),
    ):
        with pytest.raises(InputError, match=f"another scene: its {what} was"):
            solve_static(other, [0.1], resume=True, **options)
    with pytest.raises(InputError, match="position_A_x"):
        options["record"] = Record(points=["B"], fields="none")
        solve_static(pull(comm), [0.1], resume=True, **options)


@pytest.mark.serial
def test_refused_stops_leave_an_earlier_run_and_its_bounds_hold_when_resumed(folder):
    options = {"output": folder, "record": Record(fields="none")}
    solve_static(pull(MPI.COMM_SELF), [0.3], steps=StepSettings(first=0.15), **options)
    for stops in ([0.5, 0.5], [0.0], [np.nan]):
        with pytest.raises(InputError, match="stops"):
            solve_static(pull(MPI.COMM_SELF), stops, **options)
    short = StepSettings(largest=0.1)
    resumed = solve_static(pull(MPI.COMM_SELF), [0.3, 0.6], resume=True, steps=short, **options)
    assert resumed.history["load_factor"][-1] == 0.6
    assert max(resumed.history["step_size"][2:]) <= 0.1001


@pytest.mark.serial
def test_incomplete_checkpoint_is_named(folder):
    options = {"output": folder, "record": Record(fields="none")}
    solve_static(pull(MPI.COMM_SELF), [0.1], **options)
    (part,) = (folder / "checkpoint").glob("*.npz")
    with np.load(part) as archive:
        arrays = dict(archive)
    for name in ("displacement.keys", "displacement.values"):
        arrays[name] = arrays[name][1:]
    np.savez(part, **arrays)
    with pytest.raises(InputError, match="lacks 1 values of 'displacement'"):
        solve_static(pull(MPI.COMM_SELF), [0.1], resume=True, **options)


@pytest.mark.mpi
def test_xdmf_holds_the_deformed_shape(comm, folder):
    result = solve_static(pull(comm), [0.2], output=folder, record=Record(fields="xdmf"))
    tip, names = result.model.position("A"), result.model.sheet.panel_names
    energies = result.model.energies()
    comm.Barrier()
    with h5py.File(folder / "fields.h5") as file:
        rest, cells = file["Mesh/mesh/geometry"][:], file["Mesh/mesh/topology"][:]
        fields = {name: group for name, group in file["Function"].items()}
        assert {len(group) for group in fields.values()} == {len(result.steps) + 1}
        last = {name: np.array(group[sorted(group)[-1]]) for name, group in fields.items()}
    current = rest + last["displacement"]
    assert np.abs(current - tip).sum(axis=1).min() < 1e-12
    corners = rest[cells]
    area = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    for kind in ("membrane", "bending"):
        total = (area * last[f"energy_{kind}"].ravel()).sum()
        assert total == pytest.approx(energies[kind], rel=1e-10)
    left = corners[:, :, 0].mean(axis=1) < 0
    np.testing.assert_array_equal(last["panel"].ravel(), np.where(left, names.index("left"), 1))


@pytest.mark.mpi
@pytest.mark.skipif(not dolfinx.has_adios2, reason="dolfinx without ADIOS2")
def test_vtx_holds_the_deformed_shape(comm, folder):
    result = solve_static(pull(comm), [0.2], output=folder, record=Record(fields="vtx"))
    # Little-endian doubles at any offset of the data: the crease's end is among them.
    (depth,) = z_fold().vertices_coords[1, 2:]
    drop = result.model.position("A")[2] - depth
    comm.Barrier()
    data = b"".join(path.read_bytes() for path in (folder / "fields.bp").glob("data.*"))
    shifted = [data[k : k + (len(data) - k) // 8 * 8] for k in range(8)]
    values = np.concatenate([np.frombuffer(part, dtype="<f8") for part in shifted])
    assert np.abs(values[np.isfinite(values)] - drop).min() < 1e-13
    for file, names in (
        ("fields", ["displacement"]),
        ("fields_cells", ["panel", "energy_bending"]),
    ):
        text = (folder / f"{file}.bp" / "mmd.0").read_bytes()
        assert all(name.encode() in text for name in names)


def test_resumed_run_keeps_the_fields_of_the_first(comm, folder):
    options = {"output": folder, "record": Record(fields="xdmf")}
    solve_static(pull(comm), [0.2], **options)
    solve_static(pull(comm), [0.2, 0.4], resume=True, **options)
    comm.Barrier()
    assert {p.name for p in folder.glob("*.xdmf")} == {"fields.xdmf", "fields_from_2.xdmf"}


def test_unknown_field_format(comm, folder):
    with pytest.raises(InputError, match="'vtk' is none of"):
        FieldWriter(build(pull(comm)), folder / "fields", "vtk")


@pytest.mark.serial
def test_model_is_continued_from_its_state(comm):
    """Two calls on one model follow the path of one call."""
    model = build(pull(comm))
    solve_static(model, [0.4], steps=PULL_STEPS)
    assert model.problem.time == 0.4
    second = solve_static(model, [1.0], steps=PULL_STEPS)
    whole = solve_static(pull(comm), [1.0], steps=PULL_STEPS)
    assert second.history["load_factor"][0] == pytest.approx(0.5)
    assert second.model.energies()["bending"] == pytest.approx(
        whole.model.energies()["bending"], rel=1e-8
    )


def test_progress_is_shown_when_asked(comm, capsys):
    solve_static(pull(comm), [0.2], progress=True)
    shown = capsys.readouterr().err
    assert ("step=2" in shown and "newton=" in shown) == (comm.rank == 0)
    solve_static(pull(comm), [0.2])
    assert capsys.readouterr().err == ""


def test_package_imports_lightly():
    code = (
        "import sys, ufl_origami as u; assert not {'dolfinx', 'numpy'} & set(sys.modules);"
        "assert all(hasattr(u, n) for n in u.__all__); assert 'dolfinx' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
    with pytest.raises(AttributeError, match="no attribute 'solve'"):
        _ = ufl_origami.solve
