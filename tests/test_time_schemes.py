"""Time integrators against their formulas: free fall, vibrations, damping, orders of accuracy."""

import numpy as np
import pytest
from time_scenes import PLAIN, SHARP, derivative, fixed, flap, free_square, modes, strip, unbalanced

import ufl_origami as uo

MODELS = ("ddg", "fem")
SCHEMES = ("implicit_euler", "bdf2")
G = 9.81
SMALL = 1e-6  # amplitude of a mode: its square is the distance from a linear oscillator
HELD = {"strip": strip, "flap": flap}
STEPS_A_PERIOD = 20


def fall(times, scheme):
    """Heights that a scheme gives a body let go at times[0], by its difference quotients."""
    z, v = [0.0], [0.0]
    for n in range(1, len(times)):
        memory = 1 if scheme == "implicit_euler" or n == 1 else 2
        first, *others = derivative(times[n - memory : n + 1][::-1])
        past = slice(None, -memory - 1, -1)
        v.append((-G - np.dot(others, v[past])) / first)
        z.append((v[-1] - np.dot(others, z[past])) / first)
    return np.array(z)


def dropped(model):
    scene = free_square(model)
    scene.gravity((0.0, 0.0, -G))
    return scene


@pytest.mark.parametrize("model", MODELS)
def test_free_fall_of_implicit_euler(model):
    dt, n = 0.01, np.arange(31)
    options = {"scheme": "implicit_euler", "newton": SHARP, "record": PLAIN}
    history = uo.solve_dynamic(dropped(model), [0.3], fixed(dt), **options).history
    exact = -G * dt**2 * n * (n + 1) / 2
    for corner in ("x0y0", "x1y1"):
        assert history[f"position_{corner}_z"] == pytest.approx(exact, abs=1e-13)
        assert history[f"position_{corner}_x"] == pytest.approx(float(corner[1]), abs=1e-13)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_free_fall_with_steps_of_any_size(model, scheme):
    time = uo.TimeSettings(step=0.01, tolerance=10.0, energy_tolerance=10.0, largest=0.06)
    history = uo.solve_dynamic(
        dropped(model), [0.1, 0.5], time, scheme=scheme, newton=SHARP, record=PLAIN
    ).history
    sizes = history["step_size"][1:]
    assert len(np.unique(sizes.round(12))) > 4
    assert sizes.max() / sizes.min() > 3
    exact = fall(history["time"], scheme)
    assert history["position_x1y0_z"] == pytest.approx(exact, abs=1e-12)


def test_free_fall_of_bdf2_lags_behind_the_exact_one_by_its_start_only():
    """BDF2 is exact for a parabola; what the first step of Euler's does wrong stays as it is."""
    dt = 0.01
    history = uo.solve_dynamic(dropped("ddg"), [0.4], fixed(dt), newton=SHARP, record=PLAIN).history
    off = history["position_x0y0_z"] + G * history["time"] ** 2 / 2
    # The first step adds -g dt^2 / 2 to the height; of a jump BDF2 keeps 3/2 in the end.
    assert off[1] == pytest.approx(-G * dt**2 / 2, rel=1e-10)
    assert off[-1] == pytest.approx(-0.75 * G * dt**2, rel=1e-10)


def roots(z):
    """Factors a step of the coordinate q + i v / omega: principal and spurious root of BDF2."""
    return sorted(np.conj(np.roots([3 - 2j * z, -4.0, 1.0])), key=abs, reverse=True)


def swung(scheme, z, count):
    """Exact coordinates (count + 1,) of a linear oscillator let go from 1."""
    n = np.arange(count + 1)
    euler = (1 + z**2) ** (-n / 2) * np.exp(-1j * n * np.arctan(z))
    if scheme == "implicit_euler":
        return euler
    main, spurious = roots(z)
    share = (euler[1] - spurious) / (main - spurious)
    return share * main**n + (1 - share) * spurious**n


@pytest.mark.parametrize(
    ("scene", "model", "scheme"),
    [
        ("strip", "ddg", "implicit_euler"),
        ("strip", "fem", "bdf2"),
        ("flap", "ddg", "bdf2"),
        ("flap", "fem", "implicit_euler"),
    ],
)
def test_amplitude_and_phase_of_a_vibration(model, scene, scheme):
    found = modes(HELD[scene](model))
    z, n = 2 * np.pi / STEPS_A_PERIOD, 30
    result, seen = found.swing(SMALL, z / found.omega[0], n, scheme=scheme)
    assert seen == pytest.approx(swung(scheme, z, n), abs=1e-8)
    total = result.history["energy_total"]
    kept = total[n] / total[n - STEPS_A_PERIOD]
    factor = roots(z)[0] if scheme == "bdf2" else 1 / (1 + 1j * z)
    assert kept == pytest.approx(abs(factor) ** (2 * STEPS_A_PERIOD), rel=1e-5)
    assert kept == pytest.approx({"implicit_euler": 0.152, "bdf2": 0.925}[scheme], abs=1e-3)
    assert unbalanced(result.history) < 1e-8


@pytest.mark.convergence
def test_energy_drift_of_bdf2_has_order_three():
    """From half a period on: what the first step did wrong is gone by then."""
    steps, lost = np.array([40, 80]), []
    for count in steps:
        found = modes(strip("ddg"))
        result, _ = found.swing(SMALL, 2 * np.pi / found.omega[0] / count, count)
        total = result.history["energy_total"]
        lost.append(1 - total[-1] / total[count // 2])
        assert np.diff(total[count // 2 :]).max() < 0
    assert np.log2(lost[0] / lost[1]) == pytest.approx(3.0, abs=0.1)


def damped(scheme, omega, rate, dt, count):
    """Coordinates (count + 1, 2) q and v of q'' + rate q' + omega^2 q = 0, let go from 1."""
    system = np.array([[0.0, 1.0], [-(omega**2), -rate]])
    y = [np.array([1.0, 0.0])]
    for n in range(count):
        first, *others = derivative(
            dt * -np.arange(2 if scheme == "implicit_euler" or n == 0 else 3)
        )
        past = sum(w * before for w, before in zip(others, reversed(y), strict=False))
        y.append(np.linalg.solve(first * np.eye(2) - system, -past))
    return np.array(y)


@pytest.mark.parametrize(
    ("scene", "model", "scheme"),
    [
        ("strip", "ddg", "bdf2"),
        ("strip", "fem", "implicit_euler"),
        ("flap", "ddg", "implicit_euler"),
        ("flap", "fem", "bdf2"),
    ],
)
@pytest.mark.parametrize("kind", ["mass", "stiffness"])
def test_damping_of_a_vibration(scene, model, scheme, kind):
    """Rate alpha + beta omega^2 of a mode, in panels and crease; the loss is that of its force."""
    found = modes(HELD[scene](model))
    omega = found.omega[0]
    factor = {"mass": 0.3 * omega, "stiffness": 0.3 / omega}[kind]
    found.model.scene.damping(**{kind: factor})
    dt, count = 2 * np.pi / omega / STEPS_A_PERIOD, 20
    result, seen = found.swing(SMALL, dt, count, scheme=scheme)
    exact = damped(scheme, omega, 0.3 * omega, dt, count)
    assert seen == pytest.approx(exact @ [1.0, 1j / omega], abs=1e-8)
    lost = result.history["lost_damping"]
    force = 0.3 * omega * exact[1:, 1]
    assert lost[1:] / SMALL**2 == pytest.approx(
        np.cumsum(force * np.diff(exact[:, 0])), abs=1e-6 * omega**2
    )
    assert lost[-1] > 0.1 * result.history["energy_total"][0]
    assert unbalanced(result.history) < 1e-8


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_loss_of_the_integrator_by_its_formula(model, scheme):
    """Implicit Euler: |v1 - v0|^2_M / 2 + |q1 - q0|^2_K / 2; BDF2: with its acceleration."""
    found = modes(strip(model), count=2)
    shape = found.shapes @ [1.0, 0.5]
    x0, states = found.model.x.array_r.copy(), []
    found.model.x.array_w[:] += SMALL * shape
    states.append((found.model.x.array_r - x0, 0.0 * x0))
    dt = 0.05 * 2 * np.pi / found.omega[0]
    history = uo.solve_dynamic(
        found.model,
        [20 * dt],
        fixed(dt),
        scheme=scheme,
        newton=SHARP,
        record=PLAIN,
        on_accept=lambda _, m: states.append((m.x.array_r - x0, m.motion.v.array_r.copy())),
    ).history
    q, v = (np.array(part) for part in zip(*states, strict=True))
    dq, dv = np.diff(q, axis=0), np.diff(v, axis=0)
    slope = dv / dt
    if scheme == "bdf2":
        slope[1:] = (1.5 * dv[1:] - 0.5 * dv[:-1]) / dt
    way = np.einsum("ni,ni->n", dq, slope @ found.mass)
    kinetic = 0.5 * np.einsum("ni,ni->n", v, v @ found.mass)
    inertial = way - np.diff(kinetic)
    if scheme == "implicit_euler":
        own = 0.5 * np.einsum("ni,ni->n", dv, dv @ found.mass)
        assert inertial == pytest.approx(own, abs=1e-9 * kinetic.max())
    elastic = 0.5 * np.einsum("ni,ni->n", dq, dq @ found.stiffness)
    scale = history["energy_total"][0]
    expected = np.cumsum(inertial + elastic)
    assert history["lost_integrator"][1:] == pytest.approx(expected, abs=1e-6 * scale)
    assert expected[-1] > 0.01 * scale


def swinging(model):
    """Flap that a weight coming and going turns by more than a right angle."""
    scene = flap(model, size=0.5 if model == "ddg" else 1.0)
    scene.gravity(lambda time: (0.0, 0.0, -2.0 * np.sin(np.pi * time / 1.6) ** 2))
    return scene


@pytest.mark.convergence
@pytest.mark.parametrize("model", ["ddg", pytest.param("fem", marks=pytest.mark.slow)])
@pytest.mark.parametrize(("scheme", "order"), [("implicit_euler", 1), ("bdf2", 2)])
def test_order_in_a_large_swing(model, scheme, order):
    steps, ends = 0.08 * 0.5 ** np.arange(3), []
    for dt in steps:
        result = uo.solve_dynamic(
            swinging(model),
            [1.6],
            fixed(dt),
            scheme=scheme,
            record=uo.Record(fields="none", energies=False),
        )
        ends.append(result.model.mean_fold_angle("crease"))
    assert abs(ends[-1]) > 1.0
    change = np.abs(np.diff(ends))
    assert np.log2(change[0] / change[1]) == pytest.approx(order, abs=0.2), ends
