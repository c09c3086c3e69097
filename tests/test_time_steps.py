"""Sizes of time steps: bounds, tolerances, stops, what is refused; schemes of one's own."""

import numpy as np
import pytest
from time_scenes import (
    ALONE,
    LANDING,
    PLAIN,
    SHARP,
    derivative,
    fixed,
    free_square,
    landing,
    modes,
    strip,
)

import ufl_origami as uo
from ufl_origami.mesh_shapes import rectangle
from ufl_origami.solvers.schemes import Formula, Scheme, combination

SMALL = 1e-6
LOOSE = 1e9  # a tolerance that never binds


def swing_error(scheme, tolerance):
    """Error after one period of a strip let go from its first mode, and the run's history."""
    found = modes(strip("ddg"))
    omega, weights = found.omega[0], found.mass @ found.shapes[:, 0] / SMALL
    found.model.x.array_w[:] += found.shapes[:, 0] * SMALL
    time = uo.TimeSettings(0.1 / omega, tolerance=SMALL * tolerance, energy_tolerance=LOOSE)
    options = {"scheme": scheme, "record": PLAIN, "newton": SHARP}
    result = uo.solve_dynamic(found.model, [2 * np.pi / omega], time, **options)
    end = weights @ result.model.x.array_r, weights @ result.model.motion.v.array_r / omega
    return np.hypot(end[0] - 1, end[1]), result.history


@pytest.mark.parametrize(
    ("scheme", "order", "tolerances"),
    [("implicit_euler", 1, (0.1, 0.02, 0.004)), ("bdf2", 2, (0.02, 0.004, 0.0008))],
)
def test_error_falls_with_the_tolerance(scheme, order, tolerances):
    """Local errors of order p + 1 held at the tolerance add up to tol^(p / (p + 1))."""
    errors = []
    for tolerance in tolerances:
        error, history = swing_error(scheme, tolerance)
        local = history["local_error"] / SMALL
        assert local.max() <= 2 * tolerance
        assert np.median(local) > 0.1 * tolerance
        errors.append(error)
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert slope == pytest.approx(order / (order + 1), abs=0.15), errors


@pytest.mark.parametrize(
    ("scheme", "pull", "missed"),
    [
        ("implicit_euler", lambda time: (0.0, 0.0, -3.0), 3.0 * 0.1**2 / 2),
        ("bdf2", lambda time: (0.0, 0.0, -3.0 * time), 3.0 * 0.1**3 * 2 / 9),
    ],
)
def test_local_error_in_free_fall(scheme, pull, missed):
    """Euler misses dt^2 / 2 times the acceleration, BDF2 2/9 dt^3 times its rate."""
    scene = free_square("ddg")
    scene.gravity(pull)
    options = {"scheme": scheme, "record": PLAIN, "newton": SHARP}
    history = uo.solve_dynamic(scene, [2.0], fixed(0.1), **options).history
    # Over the diagonal of the sheet.
    expected = missed / np.sqrt(2)
    assert history["local_error"][-1] == pytest.approx(expected, rel=1e-7)


def test_energy_tolerance_bounds_what_the_integrator_loses():
    lost = []
    for tolerance in (1e-2, 2e-3):
        found = modes(strip("ddg"))
        half = np.pi / found.omega[0]
        found.model.x.array_w[:] += found.shapes[:, 0] * SMALL
        time = uo.TimeSettings(step=half / 50, tolerance=LOOSE, energy_tolerance=tolerance)
        history = uo.solve_dynamic(
            found.model, [half], time, scheme="implicit_euler", record=PLAIN
        ).history
        # The first step, which has nothing to compare with, is not held to it.
        scale = history["energy_total"][0]
        taken = np.abs(np.diff(history["lost_integrator"]))[1:] / scale
        assert taken.max() <= 2 * tolerance
        lost.append(history["lost_integrator"][-1] / scale)
    assert lost[1] < 0.6 * lost[0]


def test_stops_are_hit_and_bounds_honoured():
    stops = [0.0123, 0.05, 0.33, 0.3301, 0.9]
    scene = free_square("ddg")
    scene.gravity((0.0, 0.0, -1.0))
    time = uo.TimeSettings(step=0.01, growth=1.3, smallest=1e-4, largest=0.04, tolerance=LOOSE)
    history = uo.solve_dynamic(scene, stops, time, record=PLAIN).history
    times, sizes = history["time"], history["step_size"][1:]
    assert set(stops) <= set(times)
    assert np.diff(times) == pytest.approx(sizes, rel=1e-12)
    assert sizes.max() <= 0.04 * (1 + 1e-6)
    assert sizes.max() > 0.039
    assert (sizes[1:] / sizes[:-1]).max() <= 1.3 * (1 + 1e-6)
    # No tiny step before a stop: what is left below two steps is halved.
    before = [np.flatnonzero(times == stop)[0] for stop in stops if stop != 0.3301]
    assert all(times[k] - times[k - 1] > 0.45 * (times[k - 1] - times[k - 2]) for k in before)


def test_fixed_steps_are_equal():
    scene = free_square("ddg")
    history = uo.solve_dynamic(scene, [0.3, 0.7], fixed(0.1), record=PLAIN).history
    assert history["time"] == pytest.approx(0.1 * np.arange(8), rel=1e-12)
    assert {0.3, 0.7} <= set(history["time"])
    assert history["step_size"][1:] == pytest.approx(0.1, rel=1e-12)


@pytest.mark.parametrize(
    ("stops", "message"),
    [
        ([0.2, 0.25], r"stop 0.25 is 2.5 fixed steps of 0.1 after 0: give a multiple"),
        ([50.00002], r"stop 50 is 500.0002 fixed steps of 0.1 after 0"),
        ([0.2, 0.2], r"stops \[0.2, 0.2\] do not increase"),
        ([0.2, float("nan")], r"stops \[0.2, nan\] are not finite"),
        ([-0.1, 0.2], r"stops \[-0.1, 0.2\] are not after 0, where the model is"),
        ([0.0], r"stops \[0.0\] are not after 0"),
    ],
)
def test_refused_stops(stops, message):
    with pytest.raises(uo.InputError, match=message):
        uo.solve_dynamic(free_square("ddg"), stops, fixed(0.1), record=PLAIN)


@pytest.mark.parametrize("stops", [[float("nan")], [0.0], [0.5, 0.5]])
def test_refused_load_factors(stops):
    with pytest.raises(uo.InputError, match="stops"):
        uo.solve_static(strip("ddg"), stops, record=PLAIN)


def test_hard_steps_do_not_grow():
    """Beyond `easy` Newton iterations a step may not grow, beyond twice as many it shrinks."""
    for easy, factor in ((1, 1 / 1.5), (2, 1.0), (50, 1.5)):
        time = uo.TimeSettings(
            step=0.02, smallest=0.008, tolerance=LOOSE, energy_tolerance=LOOSE, easy=easy
        )
        history = uo.solve_dynamic(landing(), [0.12], time, record=PLAIN, newton=SHARP).history
        assert history["newton_iterations"][1] == 3
        assert history["step_size"][2] == pytest.approx(factor * 0.02, rel=1e-12)


def test_warning_of_a_step_made_an_error_comes_after_the_step_is_taken():
    scene, seen = free_square("ddg"), []
    scene.gravity((0.0, 0.0, -1.0))
    model = uo.build(scene)
    time = uo.TimeSettings(step=0.01, smallest=0.005, tolerance=1e-12)
    note = {"on_accept": lambda step, _: seen.append(step.time)}
    with pytest.raises(uo.AccuracyWarning, match="at the smallest step"):
        uo.solve_dynamic(model, [0.02], time, scheme="implicit_euler", record=PLAIN, **note)
    assert seen == [model.problem.time] == [0.005]


def test_smallest_step_warns_and_goes_on():
    scene = free_square("ddg")
    scene.gravity((0.0, 0.0, -1.0))
    time = uo.TimeSettings(step=0.01, smallest=0.005, tolerance=1e-12)
    with pytest.warns(uo.AccuracyWarning, match=r"times the tolerance at the smallest step 0.005"):
        history = uo.solve_dynamic(
            scene, [0.02], time, scheme="implicit_euler", record=PLAIN
        ).history
    assert history["step_size"][1:] == pytest.approx(0.005, rel=1e-12)
    assert history["cuts"][1] == 1


@pytest.mark.parametrize(
    ("settings", "what"),
    [
        ({"fixed": True}, "fixed step 0.01"),
        ({"smallest": 0.009}, "step of the smallest size 0.009"),
    ],
)
def test_failed_step_leaves_the_last_state(settings, what):
    """Two Newton iterations bring the sheet through the air, not into contact."""
    model, newton = uo.build(landing()), uo.NewtonSettings(iterations=2, cycles=1)
    time = uo.TimeSettings(step=0.01, tolerance=LOOSE, energy_tolerance=LOOSE, **settings)
    last = []
    with pytest.raises(uo.SolveError, match=rf"{what} failed: DIVERGED_MAX_IT") as caught:
        uo.solve_dynamic(
            model,
            [0.4],
            time,
            newton=newton,
            record=PLAIN,
            on_accept=lambda step, m: last.append((step.time, m.x.array_r.copy())),
        )
    assert last
    assert caught.value.load_factor == model.problem.time == last[-1][0]
    assert (model.x.array_r == last[-1][1]).all()


def shaken(error):
    """Damped sheet between a clamped and a moved end, which something stops after time 0.25."""
    sheet = rectangle(1.0, 0.25, n=(4, 1), comm=ALONE)
    scene = uo.Scene(sheet, uo.Material(1e4, 0.3, 0.05, rho=1.0))
    scene.clamp("x0")
    scene.fix("x0")
    scene.damping(mass=0.5, stiffness=0.01)
    scene.obstacle("belt", uo.Plane((0.0, 0.0, -0.05)), uo.Barrier(1.0, 0.1), motion=drift)
    scene.friction("belt", uo.Coulomb(0.3, eps=0.05))

    def load(time):
        if time > 0.25 and error is not uo.SolveError:
            raise error("no load")
        return 0.0, 0.0, 0.1 * time

    def way(time):
        return 0.01 * np.sin(5 * time) ** 2 if time < 0.25 else 0.5

    scene.line_load("x1", load)
    scene.move("x1", x=0.0, y=0.0, z=way)
    return scene


def drift(time):
    return 0.1 * time, 0.0, 0.0


def forces_at_the_ends(model):
    return np.concatenate([model.reaction(name) for name in ("x0", "x1")])


@pytest.mark.parametrize("error", [uo.SolveError, uo.InputError, KeyboardInterrupt])
def test_what_a_step_raises_leaves_time_forces_and_energies_of_the_last_state(error):
    model, last = uo.build(shaken(error)), {}

    def note(step, model):
        last.update(time=step.time, forces=forces_at_the_ends(model), energies=model.energies())

    newton = uo.NewtonSettings(iterations=6, cycles=1)
    with pytest.raises(error):
        uo.solve_dynamic(model, [0.4], fixed(0.1), record=PLAIN, newton=newton, on_accept=note)
    assert model.problem.time == last["time"] == pytest.approx(0.2)
    assert model.energies() == last["energies"]
    assert (forces_at_the_ends(model) == last["forces"]).all()
    with pytest.raises(error):  # of a second motion the first step fails
        uo.solve_dynamic(model, [0.4], fixed(0.1), record=PLAIN, newton=newton)
    assert (forces_at_the_ends(model) == last["forces"]).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"step": 0.0}, "step = 0.0 is no positive number"),
        ({"step": float("nan")}, "step = nan is no positive number"),
        ({"step": 1.0, "tolerance": -1.0}, "tolerance = -1.0"),
        ({"step": 1.0, "energy_tolerance": 0.0}, "energy_tolerance = 0.0"),
        ({"step": 1.0, "largest": 0.5}, r"step 1.0 is not in \[smallest, largest\]"),
        ({"step": 1.0, "smallest": 2.0}, r"step 1.0 is not in \[smallest, largest\]"),
        ({"step": 1.0, "growth": 0.9}, "growth 0.9 is below 1"),
        ({"step": 1.0, "easy": 0}, "easy 0 is below 1"),
        ({"step": 1.0, "easy": float("nan")}, "easy nan is below 1"),
    ],
)
def test_refused_settings(settings, message):
    with pytest.raises(uo.InputError, match=message):
        uo.TimeSettings(**settings)


def jumping(start, side=1.0):
    sheet = rectangle(side, side, n=(1, 1), comm=ALONE)
    scene = uo.Scene(sheet, uo.Material(1e4, 0.3, 0.05 * side, rho=1.0))
    scene.move("x0", x=0.0, y=0.0, z=start)
    return scene


def test_refused_scenes():
    massless = uo.Scene(rectangle(1.0, 1.0, n=(1, 1), comm=ALONE), uo.Material(1e4, 0.3, 0.05))
    with pytest.raises(uo.SceneError, match=r"panels without density .*: \['sheet'\]"):
        uo.solve_dynamic(massless, [0.1], fixed(0.1))
    for start in (0.2, lambda time: 0.2 + time):
        with pytest.raises(uo.SceneError, match=r"prescribed motion jumps by 0.2 at time 0"):
            uo.solve_dynamic(jumping(start), [0.1], fixed(0.1))
    with pytest.raises(uo.InputError, match=r"'rk4' is none of \('implicit_euler', 'bdf2'\)"):
        uo.solve_dynamic(free_square("ddg"), [0.1], fixed(0.1), scheme="rk4")


@pytest.mark.parametrize("side", [1e-6, 1e6])
def test_a_jump_is_measured_by_the_sheet(side):
    uo.solve_dynamic(jumping(lambda time: 1e-10 * side, side), [], fixed(0.1), record=PLAIN)
    with pytest.raises(uo.SceneError, match="prescribed motion jumps by"):
        uo.solve_dynamic(jumping(lambda time: 1e-5 * side, side), [], fixed(0.1), record=PLAIN)


@pytest.mark.parametrize(
    ("velocity", "message"),
    [
        (lambda rest: rest[:, :1], r"launch: expected velocities \(9, 3\), got \(9, 1\)"),
        (lambda rest: rest[:4], r"launch: expected velocities \(9, 3\), got \(4, 3\)"),
        (lambda rest: rest * np.nan, "launch: a velocity is not finite"),
    ],
)
def test_refused_launches(velocity, message):
    scene = free_square("ddg")
    scene.launch(velocity)
    with pytest.raises(uo.SceneError, match=message):
        uo.solve_dynamic(scene, [0.1], fixed(0.1))


@pytest.mark.mpi
def test_launch_refused_on_one_rank_is_refused_on_all(comm):
    def velocity(rest):
        if comm.rank == comm.size - 1:
            raise uo.InputError("no wind here")
        return rest

    scene = free_square("ddg", comm)
    scene.launch(velocity)
    with pytest.raises(uo.InputError, match="no wind here"):
        uo.solve_dynamic(scene, [0.1], fixed(0.1))


def clock(model):
    return model.problem.time, model.load_factor.held, model.motion, model.energies()


@pytest.mark.parametrize("what", ["launch", "stops", "record"])
def test_refused_start_changes_nothing(what):
    scene = strip("ddg")
    scene.line_load("x1", (0.0, 0.0, 0.02))
    if what == "launch":
        scene.launch(lambda rest: rest[:1])
    model = uo.solve_static(scene, [0.6], record=PLAIN).model
    before = clock(model)
    options = {"stops": [0.1], "record": PLAIN} | {
        "launch": {},
        "stops": {"stops": [-0.1]},
        "record": {"record": uo.Record(points=["nowhere"])},
    }[what]
    with pytest.raises(uo.InputError):
        uo.solve_dynamic(model, time=fixed(0.1), **options)
    assert clock(model) == before


def test_refused_static_path_leaves_the_motion():
    model = uo.solve_dynamic(strip("ddg"), [0.2], fixed(0.1), record=PLAIN).model
    before = clock(model)
    for refused in ({"stops": [0.5]}, {"stops": [2.0], "record": uo.Record(points=["nowhere"])}):
        with pytest.raises(uo.InputError):
            uo.solve_static(model, **refused)
        assert clock(model) == before


def test_static_path_after_a_motion_goes_on_at_the_load_factor_held():
    scene = strip("ddg")
    scene.line_load("x1", (0.0, 0.0, 0.02))
    model = uo.solve_static(scene, [0.6], record=PLAIN).model
    uo.solve_dynamic(model, [0.3], fixed(0.1), record=PLAIN)
    result = uo.solve_static(model, [0.7], record=PLAIN)
    assert result.steps[0].size == pytest.approx(0.1)
    alone = strip("ddg")
    alone.line_load("x1", (0.0, 0.0, 0.02))
    reference = uo.solve_static(alone, [0.7], record=PLAIN).model
    assert model.x.array_r == pytest.approx(reference.x.array_r, abs=1e-8)


def test_supports_start_at_the_rate_of_their_motion():
    """Carried along at a steady speed from the start, nothing is strained."""
    scene = jumping(lambda time: 0.5 * time)
    scene.launch((0.0, 0.0, 0.5))
    history = uo.solve_dynamic(scene, [0.4], fixed(0.1), record=PLAIN, newton=SHARP).history
    assert history["energy_kinetic"] == pytest.approx(0.5 * 0.05 * 0.5**2, rel=1e-6)
    assert np.abs(history["work"]).max() < 1e-6 * history["energy_kinetic"][0]


class Bdf3(Scheme):
    """Backward differences of order three, with the lower orders to begin with."""

    name, order, memory, largest_ratio = "bdf3", 3, 3, 1.5

    def formula(self, time, past):
        rate, *others = derivative([time, *(state.time for state in past)])
        weights = tuple(-w / rate for w in others)
        base = combination(*zip(weights, [state.q for state in past], strict=True))
        velocity = combination(*zip(weights, [state.v for state in past], strict=True))
        return Formula(rate, rate**2, weights, base, combination((1.0, base), (1 / rate, velocity)))

    def error(self, new, past):
        return combination((0.0, new.q))


def test_a_scheme_of_ones_own():
    """A damped oscillator by the third backward difference follows that difference's recurrence."""
    found = modes(strip("ddg"))
    omega, count = found.omega[0], 20
    dt, rate = 0.2 / omega, 0.2 * omega
    found.model.scene.damping(stiffness=rate / omega**2)
    result, seen = found.swing(SMALL, dt, count, scheme=Bdf3())
    system, y = np.array([[0.0, 1.0], [-(omega**2), -rate]]), [np.array([1.0, 0.0])]
    for n in range(1, count + 1):
        first, *others = derivative(-dt * np.arange(min(n, 3) + 1))
        past = sum(w * before for w, before in zip(others, reversed(y), strict=False))
        y.append(np.linalg.solve(first * np.eye(2) - system, -past))
    assert seen == pytest.approx(np.array(y) @ [1.0, 1j / omega], abs=1e-8)
    assert np.abs(result.history["imbalance"]).max() < 1e-8 * result.history["energy_total"][0]


def test_landing_needs_cuts_and_changing_sizes():
    """The scene of the runs exercises what it is meant to."""
    history = uo.solve_dynamic(landing(), [0.3], LANDING, record=PLAIN).history
    assert history["cuts"].sum() > 0
    assert np.ptp(history["step_size"][2:]) > 0.01
    for column in ("energy_contact", "energy_magnetic", "lost_friction", "lost_damping"):
        assert np.abs(history[column]).max() > 1e-3 * history["energy_kinetic"].max()
