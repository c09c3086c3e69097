"""The magnetic flap as a user runs it: its summary, files, film, and what its motion obeys."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from demo_runs import run_demo
from matplotlib.image import imread
from PIL import Image
from scipy.constants import mu_0

from ufl_origami.history import read_history

REPO = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(REPO / "demos"))

from _flap_theory import RigidFlap  # noqa: E402

pytestmark = pytest.mark.serial  # each test starts its own processes

KEYS = (
    "model scheme dt steps triangles dofs seconds newton_iterations energy_balance_error min_gap "
    "largest_angle_deg smallest_angle_deg snap_time rigid_snap_time lost_damping lost_integrator"
).split()
RATIO, RATE, START = 1.3, 3.0, 0.1  # torque over stiffness; turns a second, from when on
VOLUME, LENGTH = 0.01 * 0.006 * 5e-4, 0.006  # of the flap, of the crease
LARGEST_TORQUE = VOLUME * 0.1 * 0.01 / mu_0


def demo(folder, *words, ranks=1):
    done = run_demo("magnetic_flap", folder, *words, ranks=ranks, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout, json.loads((folder / "summary.json").read_text())["runs"]


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """Folder, console and runs of the quick demo."""
    folder = tmp_path_factory.mktemp("flap")
    return folder, *demo(folder, "--quick")


@pytest.fixture(scope="module")
def histories(quick):
    return {model: read_history(quick[0] / f"history_{model}.csv") for model in ("ddg", "fem")}


def field_angle(times):
    """Turned by a rate that grows over the start, then is constant."""
    turned = np.where(times < START, times**2 / (2 * START), times - START / 2)
    return 2 * np.pi * RATE * turned


def fold_angle(history):
    return np.radians(history["fold_virtual_crease"])


def test_summary_has_a_run_of_each_model_with_all_keys(quick, histories):
    runs = quick[2]
    assert [run["model"] for run in runs] == ["ddg", "fem"]
    for run in runs:
        history = histories[run["model"]]
        assert list(run) == KEYS
        assert run["scheme"] == "bdf2" and run["min_gap"] is None
        assert run["steps"] == len(history) - 1
        assert history["time"][-1] == pytest.approx(run["dt"] * run["steps"])
        assert run["newton_iterations"] == history["newton_iterations"].sum()
        assert run["lost_damping"] == history["lost_damping"][-1]
        assert run["largest_angle_deg"] == history["fold_virtual_crease"].max()


def test_charts_and_film_are_written(quick):
    folder = quick[0]
    for name in ("angle", "energy_book_ddg", "energy_book_fem"):
        image = imread(folder / f"{name}.png")
        assert image.shape[1] > 1200
        assert 0.005 < np.mean(image[..., :3].min(axis=2) < 0.8) < 0.4
    with Image.open(folder / "film.gif") as film:
        assert film.n_frames >= 6 and film.size[0] > 400
        frames = []
        for k in range(film.n_frames):
            film.seek(k)
            frames.append(np.asarray(film.convert("RGB"), float))
    assert np.mean(np.abs(frames[0] - frames[len(frames) // 2]).max(axis=2) > 40) > 0.01


def test_flap_follows_the_field_where_its_crease_holds_the_torque(histories):
    """K_r L phi = V B_r B / mu_0 sin(field - phi) but for inertia, which is small before the snap.

    The energies of crease and magnet are those of a rigid flap with that angle.
    """
    for history in histories.values():
        phi, alpha = fold_angle(history), field_angle(history["time"])
        following = (alpha > np.radians(30)) & (alpha < np.radians(150))
        off = phi - RATIO * np.sin(alpha - phi)
        assert np.abs(off[following]).max() < 0.05  # of up to 1.3
        stored = LARGEST_TORQUE / RATIO * phi**2 / 2
        assert history["energy_crease"][1:] == pytest.approx(stored[1:], rel=1e-2, abs=1e-9)
        magnetic = -LARGEST_TORQUE * np.cos(alpha - phi)
        assert history["energy_magnetic"] == pytest.approx(magnetic, abs=5e-3 * LARGEST_TORQUE)


def test_flap_snaps_to_the_other_side_when_the_rigid_one_does(quick):
    period = 2 * np.pi * np.sqrt(2000.0 * 0.01**2 / 3 / (0.1 * 0.01 / mu_0) / (1 + 1 / RATIO))
    for run in quick[2]:
        assert run["snap_time"] == pytest.approx(run["rigid_snap_time"], abs=0.03 * period)
        assert run["largest_angle_deg"] == pytest.approx(np.degrees(RATIO), abs=3.0)
        assert run["smallest_angle_deg"] < -np.degrees(RATIO)  # it overshoots


def test_models_agree_and_their_energy_books_close(quick, histories):
    ddg, fem = (np.degrees(fold_angle(histories[model])) for model in ("ddg", "fem"))
    assert np.abs(ddg - fem).max() < 4.0
    calm = histories["ddg"]["time"] < 0.22
    assert np.abs(ddg - fem)[calm].max() < 0.2
    for run in quick[2]:
        history = histories[run["model"]]
        kinds = [c for c in history.columns if c.startswith("energy_") and "total" not in c]
        moved = [history[c] - (c != "energy_kinetic") * history[c][0] for c in kinds]
        error = np.abs(history["imbalance"]).max() / np.abs(moved).max()
        assert run["energy_balance_error"] == pytest.approx(error, rel=1e-12)
        assert 0 < run["energy_balance_error"] < 1e-5
        assert run["lost_damping"] > run["lost_integrator"] > 0


def test_claims_are_printed_with_their_bounds(quick):
    claims = [line for line in quick[1].splitlines() if "(at most" in line]
    assert len(claims) == 4
    for line in claims:
        value, bound = line.rsplit(": ", 1)[1].rstrip(")").split(" (at most ")
        assert 0 < float(value) < float(bound)


@pytest.mark.slow
def test_two_ranks_make_the_same_motion(quick, histories, tmp_path):
    out, (run,) = demo(tmp_path, "--quick", "--model", "ddg", "--turns", "0.1", ranks=2)
    assert out.count("ddg: ") == 1
    assert run["model"] == "ddg" and run["snap_time"] is run["rigid_snap_time"] is None
    history = read_history(tmp_path / "history_ddg.csv")
    assert len(history) == 35
    same = histories["ddg"]["fold_virtual_crease"][: len(history)]
    assert history["fold_virtual_crease"] == pytest.approx(same, abs=1e-6)
    assert same[-1] > 10.0
    assert {path.name for path in tmp_path.iterdir()} >= {"film.gif", "angle.png"}


# --- the rigid flap


def test_rigid_flap_at_rest_is_in_balance_and_jumps_where_its_branch_ends():
    """The branch ends where 1 + r cos(field - angle) = 0 at the angle sqrt(r^2 - 1)."""
    flap = RigidFlap(stiffness=2.0, torque=2.6, inertia=1.0, damping=0.0)
    end = np.sqrt(RATIO**2 - 1) + np.arccos(-1 / RATIO)
    field = np.linspace(0.0, 2 * np.pi, 2001)
    angles = flap.at_rest(field)
    assert angles == pytest.approx(RATIO * np.sin(field - angles), abs=1e-9)
    assert (1 + RATIO * np.cos(field - angles) > 0).all()
    (jump,) = np.flatnonzero(np.abs(np.diff(angles)) > 0.5)
    assert field[jump] < end < field[jump + 1]
    assert angles.max() == pytest.approx(RATIO, rel=1e-5)


def test_rigid_flap_in_time_vibrates_with_its_period():
    """In a field turned by a small angle at once: about K a = T (f - a), by the law of a spring."""
    flap = RigidFlap(stiffness=2.0, torque=2.6, inertia=0.3, damping=0.0)
    times, turned = np.linspace(0.0, 2 * flap.period, 41), 1e-3
    angles = flap.in_time(times, lambda time: turned)
    rest = turned * 2.6 / 4.6
    exact = rest * (1 - np.cos(times * np.sqrt(4.6 / 0.3)))
    assert angles == pytest.approx(exact, abs=1e-5 * rest)
