"""Runs in time: stopped and resumed, on several ranks, continued."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from time_scenes import ALONE, LANDING, PLAIN, SHARP, fixed, free_square, landing, momenta, strip

import ufl_origami as uo
from ufl_origami.history import CsvFile
from ufl_origami.solvers.schemes import ImplicitEuler

STOPS = (0.12, 0.25)


@pytest.fixture
def folder(comm, tmp_path):
    """One folder for all ranks."""
    return Path(comm.bcast(str(tmp_path), root=0))


def land(comm, output=None, model="ddg", **options):
    options = {"record": PLAIN, "newton": SHARP} | options
    return uo.solve_dynamic(landing(comm, model), STOPS, LANDING, output=output, **options)


@pytest.fixture(scope="module")
def whole():
    """The uninterrupted landing, run by each rank alone."""
    return land(ALONE)


def stop_at(number):
    """Ctrl-C while a step is accepted."""

    def stop(step, _):
        if step.number == number:
            raise KeyboardInterrupt

    return stop


def bits(history):
    """Rows without the one column that no two runs share."""
    return [{k: v for k, v in row.items() if k != "seconds"} for row in history.rows]


@pytest.mark.serial
@pytest.mark.parametrize("model", ["ddg", pytest.param("fem", marks=pytest.mark.slow)])
def test_resumed_run_equals_the_uninterrupted_one_bit_for_bit(folder, whole, model):
    """Stopped after its first step, when BDF2 has one state to go on from, and in contact."""
    whole = whole if model == "ddg" else land(ALONE, model=model)
    assert whole.history["energy_contact"][3] > 0
    for number in (1, 3):
        part = folder / str(number)
        with pytest.raises(KeyboardInterrupt):
            land(ALONE, part, model, on_accept=stop_at(number))
        assert len(uo.read_history(part / "history.csv")) == number + 1
        resumed = land(ALONE, part, model, resume=True)
        assert resumed.steps[0].number == number + 1
        assert bits(resumed.history) == bits(whole.history)
        assert bits(uo.read_history(part / "history.csv")) == bits(whole.history)
        for ours, reference in (
            (resumed.model.x, whole.model.x),
            (resumed.model.motion.v, whole.model.motion.v),
        ):
            assert (ours.array_r == reference.array_r).all()


class Patient(ImplicitEuler):
    """Implicit Euler that keeps many states and notes how many each step is handed."""

    name, memory = "patient", 12

    def __init__(self):
        self.handed = []

    def formula(self, time, past):
        self.handed.append(len(past))
        return super().formula(time, past)


@pytest.mark.serial
def test_a_scheme_with_a_long_memory_is_resumed_with_all_of_it(folder):
    options = {"record": PLAIN, "output": folder}
    uo.solve_dynamic(free_square("ddg"), [1.4], fixed(0.1), scheme=Patient(), **options)
    scheme = Patient()
    uo.solve_dynamic(free_square("ddg"), [1.5], fixed(0.1), scheme=scheme, resume=True, **options)
    assert scheme.handed == [12]


def lift(time):
    """Goes, rests and goes again."""
    return np.interp(time, [0.0, 0.2, 0.4, 0.6], [0.0, 0.05, 0.05, 0.1])


def lifted():
    """A loaded strip whose held end is lifted."""
    scene = strip("ddg")
    scene.motions.clear()
    scene.move("x0", x=0.0, y=0.0, z=lift)
    scene.line_load("x1", (0.0, 0.0, 0.02))
    return scene


@pytest.mark.serial
def test_a_motion_resumed_while_its_support_rests_does_the_same_work(folder):
    options = {"record": PLAIN, "output": folder}
    whole = uo.solve_dynamic(lifted(), [0.3, 0.6], fixed(0.05), record=PLAIN)
    uo.solve_dynamic(lifted(), [0.3], fixed(0.05), **options)
    resumed = uo.solve_dynamic(lifted(), [0.3, 0.6], fixed(0.05), resume=True, **options)
    assert bits(resumed.history) == bits(whole.history)
    assert np.ptp(whole.history["work"]) > 0


@pytest.mark.serial
def test_rare_checkpoints_hold_the_last_step_of_a_stopped_run(folder, whole):
    rare = dataclasses.replace(PLAIN, checkpoint=1e9)
    with pytest.raises(KeyboardInterrupt):
        land(ALONE, folder, on_accept=stop_at(3), record=rare)
    assert len(list((folder / "checkpoint").glob("*.npz"))) == 1
    resumed = land(ALONE, folder, resume=True, record=rare)
    assert resumed.steps[0].number == 4
    assert bits(resumed.history) == bits(whole.history)


@pytest.mark.mpi
def test_a_full_disk_is_told_to_all_ranks_and_leaves_a_run_to_be_resumed(comm, folder, monkeypatch):
    rare, written = dataclasses.replace(PLAIN, checkpoint=1e9), []
    write = CsvFile.write

    def fill_up(file, row):
        written.append(row)
        if len(written) == 4:
            raise OSError(28, "No space left on device")
        write(file, row)

    with monkeypatch.context() as patch:
        patch.setattr(CsvFile, "write", fill_up)
        with pytest.raises(OSError, match="No space left"):
            land(comm, folder, record=rare)
    whole = land(comm)
    resumed = land(comm, folder, resume=True, record=rare)
    assert_close(resumed.history, whole.history, 1e-7)


@pytest.mark.serial
def test_a_step_that_could_not_be_recorded_is_left_out_of_the_checkpoint(folder, whole):
    calls = []

    def fails_late(model):
        calls.append(model)
        if len(calls) == 4:
            raise uo.InputError("no figure")
        return 0.0

    rare = dataclasses.replace(PLAIN, checkpoint=1e9, extra={"figure": fails_late})
    with pytest.raises(uo.InputError, match="no figure"):
        land(ALONE, folder, record=rare)
    resumed = land(ALONE, folder, resume=True, record=rare)
    assert resumed.history["energy_total"] == pytest.approx(
        whole.history["energy_total"], rel=1e-12
    )


def assert_close(history, reference, tolerance):
    """Energies relative to the largest of them, positions to the sheet's size of 1."""
    assert history.columns == reference.columns
    assert len(history) == len(reference)
    for column in reference.columns:
        if column.startswith(("time", "position", "included")):
            assert history[column] == pytest.approx(reference[column], abs=tolerance), column
        if column.startswith(("energy", "work", "lost")):
            scale = reference["energy_kinetic"].max()
            assert history[column] == pytest.approx(reference[column], abs=tolerance * scale)


@pytest.mark.mpi
@pytest.mark.parametrize("serial_first", [True, False])
def test_resume_on_another_number_of_ranks(comm, folder, whole, serial_first):
    first, second = (ALONE, comm) if serial_first else (comm, ALONE)
    mine = folder if comm.rank == 0 or first is comm else folder / "unused"
    with pytest.raises(KeyboardInterrupt):
        land(first, mine, on_accept=stop_at(4))
    comm.Barrier()
    if second is comm or comm.rank == 0:
        result = land(second, folder, resume=True)
        assert result.steps[0].number == 5
        assert_close(result.history, whole.history, 1e-7)
    comm.Barrier()


@pytest.mark.serial
def test_refused_stops_leave_an_earlier_run_on_disk(folder):
    options = {"record": PLAIN, "output": folder}
    uo.solve_dynamic(strip("ddg"), [0.2], fixed(0.1), **options)
    for stops in ([0.25], [0.1, 0.1], [float("nan")]):
        with pytest.raises(uo.InputError, match="stop"):
            uo.solve_dynamic(strip("ddg"), stops, fixed(0.1), **options)
    resumed = uo.solve_dynamic(strip("ddg"), [0.2, 0.4], fixed(0.1), resume=True, **options)
    assert resumed.history["time"] == pytest.approx(0.1 * np.arange(5))


@pytest.mark.serial
def test_runs_of_the_other_solver_are_not_resumed(folder):
    static, moving = ({"record": PLAIN, "output": folder / name} for name in ("static", "moving"))
    uo.solve_static(strip("ddg"), [1.0], **static)
    uo.solve_dynamic(strip("ddg"), [0.1], fixed(0.1), **moving)
    with pytest.raises(uo.InputError, match="run of solve_dynamic, not solve_static"):
        uo.solve_static(strip("ddg"), [2.0], resume=True, **moving)
    with pytest.raises(uo.InputError, match="run of solve_static, not solve_dynamic"):
        uo.solve_dynamic(strip("ddg"), [0.2], fixed(0.1), resume=True, **static)


@pytest.mark.mpi
def test_smallest_gap_outlives_a_restart(comm, folder):
    """A square that flies off a floor is nearest to it at the start."""

    def scene(ranks):
        scene = free_square("ddg", ranks)
        scene.obstacle("floor", uo.Plane((0.0, 0.0, -0.5)), uo.Barrier(1.0, 0.1))
        scene.launch((0.0, 0.0, 1.0))
        return scene

    mine = folder if comm.rank == 0 else folder / "unused"
    first = uo.solve_dynamic(scene(ALONE), [0.1], fixed(0.1), record=PLAIN, output=mine)
    comm.Barrier()
    options = {"record": PLAIN, "output": folder, "resume": True}
    model = uo.solve_dynamic(scene(comm), [0.1, 0.4], fixed(0.1), **options).model
    assert first.model.contacts[0].smallest == pytest.approx(0.6)
    assert model.contacts[0].smallest == first.model.contacts[0].smallest


@pytest.mark.serial
def test_step_of_a_resumed_run_is_within_its_own_bounds(folder):
    options = {"record": PLAIN, "output": folder}
    scene = free_square("ddg")
    uo.solve_dynamic(scene, [1.0], uo.TimeSettings(step=0.2), **options)
    short = uo.TimeSettings(step=0.05, largest=0.1)
    resumed = uo.solve_dynamic(free_square("ddg"), [2.0], short, resume=True, **options)
    assert max(step.size for step in resumed.steps) <= 0.1 * (1 + 1e-6)


def test_another_scheme_or_scene_is_not_resumed(comm, folder):
    options = {"record": PLAIN, "output": folder}
    uo.solve_dynamic(strip("ddg", comm), [0.1], fixed(0.1), **options)
    with pytest.raises(uo.InputError, match="has scheme 'bdf2', not 'implicit_euler'"):
        uo.solve_dynamic(
            strip("ddg", comm), [0.2], fixed(0.1), scheme="implicit_euler", resume=True, **options
        )
    heavier = strip("ddg", comm)
    heavier.point_mass("x1y0", 0.1)
    with pytest.raises(uo.InputError, match="another scene"):
        uo.solve_dynamic(heavier, [0.2], fixed(0.1), resume=True, **options)
    with pytest.raises(uo.InputError, match="name the output folder"):
        uo.solve_dynamic(strip("ddg", comm), [0.2], fixed(0.1), resume=True)


@pytest.mark.mpi
@pytest.mark.parametrize("model", ["ddg", "fem"])
def test_ranks_together_and_one_rank_alone_move_alike(comm, whole, model):
    shared = land(comm, model=model)
    alone = whole if model == "ddg" else land(ALONE, model=model)
    assert_close(shared.history, alone.history, 1e-7)
    assert momenta(shared.model) == pytest.approx(momenta(alone.model), abs=1e-9)
    sheet = alone.model.sheet
    reference = dict(zip(sheet.input_vertex.tolist(), alone.model.state.x, strict=True))
    for vertex, place in zip(
        shared.model.sheet.input_vertex.tolist(), shared.model.state.x, strict=True
    ):
        assert place == pytest.approx(reference[vertex], abs=1e-7)


def bent():
    scene = strip("ddg")
    scene.line_load("x1", (0.0, 0.0, 0.02))
    scene.area_load("sheet", lambda time: (0.0, 0.0, -0.04))
    return uo.build(scene)


def test_a_static_result_goes_on_at_its_load_factor():
    """In balance at a factor of 0.6, where a load that is a function acts in full, it stays."""
    model = bent()
    uo.solve_static(model, [0.6])
    start = model.x.array_r.copy()
    history = uo.solve_dynamic(model, [1.0], fixed(0.1), record=PLAIN).history
    assert np.abs(start).max() > 0.01
    assert model.x.array_r == pytest.approx(start, abs=1e-9)
    assert history["energy_kinetic"].max() < 1e-12 * np.abs(history["energy_load"]).max()
    assert history["time"][0] == 0.0
    assert np.ptp(history["energy_load"]) < 1e-12
    assert unlike_full_load() > 0.01


def unlike_full_load():
    """How far the strip moves where numbers act in full: the factor of 0.6 matters."""
    model = bent()
    uo.solve_dynamic(model, [1.0], fixed(0.1), record=PLAIN)
    return np.abs(model.x.array_r).max()


def test_release_of_a_pulled_strip():
    """The load of a static path is gone when time starts anew: what was stored swings."""
    scene = strip("ddg")
    scene.line_load("x1", lambda time: (0.0, 0.0, 0.01 if time > 0.9 else 0.0))
    model = uo.build(scene)
    uo.solve_static(model, [1.0])
    pulled = model.position("x1y0")[2]
    history = uo.solve_dynamic(model, [0.8], fixed(0.02), record=PLAIN).history
    stored = history["energy_membrane"][0] + history["energy_bending"][0]
    assert stored == pytest.approx(0.5 * 0.25 * 0.01 * pulled, rel=1e-3)
    assert history["energy_load"] == pytest.approx(np.zeros(41), abs=1e-15)
    assert history["energy_kinetic"][0] == history["work"].max() == 0.0
    # A load at the end has 97 % of its energy in the first mode (1.03 of the tip's deflection).
    assert history["energy_kinetic"].max() == pytest.approx(stored, rel=0.05)
    assert history["position_x1y0_z"].min() == pytest.approx(-pulled, rel=0.1)


def test_motion_goes_on_in_a_second_call():
    """Implicit Euler needs one state only: two calls go where one goes."""
    options = {"scheme": "implicit_euler", "record": PLAIN}

    def scene():
        scene = free_square("ddg")
        scene.gravity(lambda time: (0.0, 0.0, -np.cos(5 * time)))
        scene.launch(uo.spin((0.0, 1.0, 0.0)))
        return scene

    whole = uo.solve_dynamic(scene(), [0.2, 0.5], fixed(0.05), **options)
    first = uo.solve_dynamic(scene(), [0.2], fixed(0.05), **options)
    second = uo.solve_dynamic(first.model, [0.5], fixed(0.05), **options)
    assert second.history["time"] == pytest.approx(0.2 + 0.05 * np.arange(7), rel=1e-12)
    for name in ("time", "energy_kinetic", "position_x1y0_x", "position_x1y0_z"):
        assert second.history[name] == pytest.approx(whole.history[name][4:], rel=1e-11), name
