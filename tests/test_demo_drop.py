"""The drop demo as a user runs it: its claims, files and figures, on one and two ranks."""

import json
import resource
from math import cos, radians, sin, sqrt, tan

import numpy as np
import pytest
from demo_runs import run_demo
from matplotlib.image import imread
from PIL import Image

from ufl_origami.energy_book import balance_error, energy_changes
from ufl_origami.history import read_history

pytestmark = pytest.mark.serial  # each test starts its own processes

KEYS = (
    "model scheme dt steps cuts smallest_step triangles dofs seconds newton_iterations "
    "energy_balance_error energy_gain integrator_gain lost_integrator lost_damping lost_friction "
    "min_gap bounces creep_speed predicted_creep_speed creep_error"
).split()
SLOPE, MU, EPS, REACH = radians(12.0), 0.4, 0.1, 5e-4
CREEP = EPS * (1 - sqrt(1 - tan(SLOPE) / MU))
G, MASS = 9.81, 800.0 * 3e-4 * 2 * 0.08 * 0.10


def demo(folder, *words, ranks=1):
    return run_demo("drop", folder, *words, ranks=ranks, timeout=900)


def only_run(done, folder):
    assert done.returncode == 0, done.stderr
    (run,) = json.loads((folder / "summary.json").read_text())["runs"]
    return run


def assert_claims(run, history):
    """What the demo promises, from its history: none of it is taken from its own judgement."""
    scale = max(np.abs(values).max() for values in energy_changes(history).values())
    assert run["energy_balance_error"] == balance_error(history) <= 1e-6
    assert np.all(history["energy_total"] <= history["energy_total"][0] + 1e-6 * scale)
    assert run["min_gap"] == history["gap"].min() and 0 < run["min_gap"] < REACH
    assert run["predicted_creep_speed"] == pytest.approx(CREEP, rel=1e-12)
    assert run["creep_speed"] == pytest.approx(CREEP, rel=0.02)
    assert history["speed"][-1] == pytest.approx(CREEP, rel=0.02)


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """Folder, summary and history of the quick demo."""
    folder = tmp_path_factory.mktemp("drop")
    run = only_run(demo(folder, "--quick"), folder)
    return folder, run, read_history(folder / "history.csv")


def test_quick_run_holds_all_claims(quick):
    _, run, history = quick
    assert list(run) == KEYS
    assert (run["model"], run["scheme"], run["dt"]) == ("ddg", "bdf2", None)
    assert run["steps"] == len(history) - 1
    assert run["newton_iterations"] == history["newton_iterations"].sum()
    assert_claims(run, history)


def test_the_sheet_falls_freely_to_the_first_touch(quick):
    """Constant acceleration: both schemes have the velocities exactly."""
    history = quick[2]
    time, falling = history["time"], np.cumsum(history["gap"] < REACH) == 0
    assert time[falling][-1] == pytest.approx(sqrt(2 * 0.0095 / (G * cos(SLOPE))), abs=4e-3)
    assert history["speed"][falling] == pytest.approx(0.1 + G * sin(SLOPE) * time[falling], 1e-6)


def test_the_sheet_bounces_and_comes_to_stand_with_bent_crease(quick):
    """After the first touch it leaves the incline; at the end neither height nor angle changes."""
    _, run, history = quick
    touched = np.cumsum(history["gap"] < REACH) > 0
    assert run["bounces"] >= 1 and history["gap"][touched].max() > 2 * REACH
    assert history["height"][touched].max() > history["height"][-1] + 1e-3
    late = history["time"] > history["time"][-1] - 0.05
    assert np.ptp(history["height"][late]) < 1e-5
    fold = history["fold_virtual_crease"]
    assert fold[0] == pytest.approx(130.0, abs=1e-6)
    assert np.ptp(fold[late]) < 0.1 and 0.1 < fold[0] - fold[-1] < 2.0  # it sags


def test_friction_takes_what_gravity_gives_to_the_creep(quick):
    """m g sin(alpha) v of power."""
    history = quick[2]
    late = history["time"] > history["time"][-1] - 0.05
    taken, time = history["lost_friction"][late], history["time"][late]
    power = (taken[-1] - taken[0]) / (time[-1] - time[0])
    assert power == pytest.approx(MASS * G * sin(SLOPE) * CREEP, rel=0.02)


def is_drawn(file):
    """Whether there is ink in all quarters of a picture with a white margin."""
    image = imread(file)[..., :3]
    ink = (image < 0.95).any(axis=2)
    middle = [n // 2 for n in ink.shape]
    quarters = [q for half in np.split(ink, middle[:1]) for q in np.split(half, middle[1:], 1)]
    return all(q.mean() > 0.002 for q in quarters) and ink.mean() < 0.6


def test_film_charts_fields_and_checkpoint_are_there(quick):
    folder = quick[0]
    names = ["energy_book.png", "motion.png", "speed.png"]
    assert sorted(f.name for f in folder.glob("*.png")) == names
    assert all(is_drawn(folder / name) for name in names)
    assert list(folder.glob("fields.*")) and (folder / "checkpoint").is_dir()
    with Image.open(folder / "drop.gif") as film:
        assert film.n_frames == 11  # every 40 ms
        first, last = (frame(film, n) for n in (0, 10))
    assert np.mean(np.abs(first - last)) > 2


def frame(film, number):
    film.seek(number)
    return np.asarray(film.convert("L"), float)


@pytest.mark.slow
def test_implicit_euler_on_two_ranks_loses_in_every_step(tmp_path):
    done = demo(tmp_path, "--quick", "--scheme", "implicit_euler", ranks=2)
    run, history = only_run(done, tmp_path), read_history(tmp_path / "history.csv")
    assert list(run) == KEYS and run["scheme"] == "implicit_euler"
    assert_claims(run, history)
    scale = max(np.abs(values).max() for values in energy_changes(history).values())
    assert np.diff(history["energy_total"]).max() < 1e-6 * scale
    assert np.diff(history["lost_integrator"]).min() > -1e-6 * scale
    assert done.stdout.count("summary.json") == 1


@pytest.mark.slow
@pytest.mark.parametrize("words", [("--model", "fem"), ("--dt", "1e-3")], ids=" ".join)
def test_the_claims_hold_for_the_other_model_and_for_fixed_steps(tmp_path, words):
    run = only_run(demo(tmp_path, "--quick", *words), tmp_path)
    history = read_history(tmp_path / "history.csv")
    assert_claims(run, history)
    assert run[words[0][2:]] == (float(words[1]) if words[0] == "--dt" else words[1])
    if run["dt"]:
        assert history["step_size"][1:] == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.slow
def test_the_whole_demo_holds_its_claims_in_time(tmp_path):
    """Processor time: the machine may have other work."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = only_run(demo(tmp_path), tmp_path)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    history = read_history(tmp_path / "history.csv")
    assert_claims(run, history)
    assert history["speed"][-1] == pytest.approx(CREEP, rel=1e-4)
    assert run["bounces"] >= 2
    assert after.ru_utime - before.ru_utime < 180
