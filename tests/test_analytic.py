"""Exact references: elastica against its own equation, equilibrium, energy and limits."""

from math import cos, degrees, inf, pi, radians, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ufl_origami.analytic import (
    REST_ANGLE,
    ZFold,
    cantilever_end_moment,
    cantilever_end_shear,
    linear_beam_angle,
    rigid_force,
    ritz_angle,
)
from ufl_origami.analytic.elastica import arc_integrals, arc_parameter, arc_profile
from ufl_origami.analytic.reference_tables import read_table
from ufl_origami.errors import InputError

pytestmark = pytest.mark.serial

REFERENCE = Path(__file__).parent / "reference"
UNEQUAL = [
    ZFold((1.0, 2.0), (1.0, 1.0), 1.0),
    ZFold((1.0, 2.0), (1.0, 8.0), 12.0),
    ZFold((1.0, 1.0), (8.0, 1.0), 1e-5),
    ZFold((1.0, 2.0), (1.0, 8.0), 1e6),
]


def integrate_strip(pull, angle, length, stiffness=1.0):
    """EI psi'' = P sin(psi) from a moment-free end: psi, psi', axial, lateral, 2 energy / EI."""

    def rhs(_, y):
        return [y[1], pull / stiffness * sin(y[0]), cos(y[0]), sin(y[0]), y[1] ** 2]

    start = [angle, 0.0, 0.0, 0.0, 0.0]
    solution = solve_ivp(rhs, (0, length), start, method="DOP853", rtol=1e-13, atol=1e-14)
    return solution.y[:, -1]


# --- elastica


@pytest.mark.parametrize("end_angle", [0.3, pi / 2, 2.6])
@pytest.mark.parametrize("load", [1e-4, 0.7, 3.0, 9.0])
def test_arc_obeys_its_differential_equation(load, end_angle):
    tau = arc_parameter(load, end_angle)
    arc = arc_integrals(tau, end_angle)
    psi = arc_profile(tau, end_angle, 2)[0]
    end, slope, axial, lateral, energy = integrate_strip(load**2, psi[0], 1.0)
    assert arc.length == pytest.approx(load, rel=1e-14)
    assert end == pytest.approx(end_angle, abs=1e-9)
    assert arc.axial / load == pytest.approx(axial, abs=1e-9)
    assert arc.lateral / load == pytest.approx(lateral, abs=1e-9)
    assert load * arc.lateral == pytest.approx(slope, abs=1e-8)
    assert load * arc.bending == pytest.approx(energy / 2, abs=1e-8)


def test_long_arc_approaches_the_infinite_strip():
    """A strip far longer than 1/k is shortened by 2 (1 - cos(b/2)) / k, whatever its length."""
    for tau in (60.0, 700.0, 5000.0):
        arc = arc_integrals(tau, 1.0)
        assert arc.length - arc.axial == pytest.approx(2 * (1 - cos(0.5)), abs=1e-15 * tau)
        assert arc.lateral == pytest.approx(sqrt(2 * (1 - cos(1.0))), rel=1e-14)


def test_profile_is_a_curve_of_the_given_length():
    tau = arc_parameter(4.0, 2.0)
    psi, axial, lateral = arc_profile(tau, 2.0, 4001)
    arc = arc_integrals(tau, 2.0)
    assert (axial[-1], lateral[-1]) == pytest.approx((arc.axial / 4, arc.lateral / 4), abs=1e-13)
    assert np.sum(np.hypot(np.diff(axial), np.diff(lateral))) == pytest.approx(1.0, abs=1e-6)
    chord = np.arctan2(np.diff(lateral), np.diff(axial))
    assert np.max(np.abs(chord - (psi[1:] + psi[:-1]) / 2)) < 1e-6


@pytest.mark.parametrize("load", [1e-6, 0.1, 4.0, 20.0])
def test_cantilever_under_end_shear(load):
    """Integrated from the tip, where the angle is known, the strip arrives clamped."""
    tip = cantilever_end_shear(load, length=10.0)
    angle, _, axial, lateral, _ = integrate_strip(load / 100, pi / 2 - tip.angle, 10.0)
    assert angle == pytest.approx(pi / 2, abs=1e-9)
    assert tip.w == pytest.approx(axial, abs=1e-9)
    assert tip.u == pytest.approx(10 - lateral, abs=1e-9)


def test_cantilever_values_and_small_load_limit():
    tip = cantilever_end_shear(4.0, length=10.0)
    assert tip.w == pytest.approx(6.69964, abs=5e-6)
    assert tip.u == pytest.approx(3.2894, abs=5e-5)
    small = cantilever_end_shear(1e-5)
    assert small.w == pytest.approx(1e-5 / 3, rel=1e-9)
    assert small.angle == pytest.approx(1e-5 / 2, rel=1e-9)
    assert small.u == pytest.approx(1e-10 / 15, rel=1e-4)


def test_end_moment_rolls_the_strip_into_a_circle():
    full = cantilever_end_moment(2 * pi, length=12.0)
    assert (full.u, full.w) == pytest.approx((12.0, 0.0), abs=1e-14)
    half = cantilever_end_moment(pi, length=12.0)
    assert (half.u, half.w) == pytest.approx((12.0, 24 / pi))


@pytest.mark.parametrize("load", [-1.0, inf, float("nan")])
def test_cantilever_refuses_bad_loads(load):
    for solution in (cantilever_end_shear, cantilever_end_moment):
        with pytest.raises(InputError, match="load"):
            solution(load)


# --- Z-fold


def integrated_panels(state):
    """Both panels of a state by the differential equation, from their outer edges."""
    fold = state.fold
    for i in range(2):
        outer = arc_profile(state.arc_parameters[i], state.slopes[i], 2)[0][0]
        yield integrate_strip(state.force, outer, fold.widths[i], fold.bending_stiffness[i])


@pytest.mark.parametrize("fold", [ZFold.from_eta(0.1), *UNEQUAL])
@pytest.mark.parametrize("part", [0.01, 0.3, 0.7, 0.95])
def test_panels_meet_and_the_crease_is_in_balance(fold, part):
    opening = part * fold.taut_opening
    state = fold.solve(opening)
    (slope1, _, x1, z1, e1), (slope2, _, x2, z2, e2) = integrated_panels(state)
    assert (slope1, slope2) == pytest.approx(state.slopes, abs=1e-7)
    assert z1 == pytest.approx(z2, abs=1e-7)
    assert x1 + x2 == pytest.approx(fold.rest_distance + opening, abs=1e-7)
    moment = state.force * z1
    turned = state.included_angle - fold.rest_angle
    assert turned == pytest.approx(moment / fold.crease_stiffness, rel=1e-6, abs=1e-10)
    bending = (fold.bending_stiffness[0] * e1 + fold.bending_stiffness[1] * e2) / 2
    assert state.bending_energy == pytest.approx(bending, rel=1e-6)
    assert state.crease_energy == pytest.approx(moment * turned / 2, rel=1e-6, abs=1e-10)


@pytest.mark.parametrize("fold", [ZFold.from_eta(e) for e in (1e-6, 1e-2, 1, 1e6)] + UNEQUAL)
@pytest.mark.parametrize("part", [0.1, 0.9])
def test_force_is_the_derivative_of_the_energy(fold, part):
    """Fourth-order central difference of the energy against the reaction."""
    opening, step = part * fold.taut_opening, 1e-3 * (1 - part) * fold.taut_opening
    energy = [fold.solve(opening + k * step).energy for k in (-2, -1, 1, 2)]
    slope = (energy[0] - 8 * energy[1] + 8 * energy[2] - energy[3]) / (12 * step)
    assert fold.solve(opening).force == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize(
    ("eta", "angle", "force"),
    [
        (0.01, 102.131, 0.2354),
        (0.1, 77.366, 1.5064),
        (0.5, 52.432, None),
        (1, 45.373, 3.7699),
        (10, 36.754, 4.5718),
    ],
)
def test_known_values_at_unit_opening(eta, angle, force):
    """Values of an independent solution of the same boundary value problem."""
    state = ZFold.from_eta(eta).solve(1.0)
    assert state.included_angle_deg == pytest.approx(angle, abs=6e-4)
    assert force is None or state.force == pytest.approx(force, abs=6e-5)


def test_scales_with_stiffness_and_width():
    one = ZFold.from_eta(0.3).solve(0.8)
    two = ZFold.from_eta(0.3, stiffness=5.0, width=2.0).solve(1.6)
    assert two.included_angle == pytest.approx(one.included_angle, rel=1e-12)
    assert two.force == pytest.approx(one.force * 5 / 4, rel=1e-11)
    assert two.energy == pytest.approx(one.energy * 5 / 2, rel=1e-11)


def test_swapped_panels_give_the_mirror_image():
    one = ZFold((1.0, 2.0), (1.0, 8.0), 3.0).solve(0.9)
    two = ZFold((2.0, 1.0), (8.0, 1.0), 3.0).solve(0.9)
    assert two.force == pytest.approx(one.force, rel=1e-11)
    distance = one.fold.rest_distance + 0.9
    for panel, mirrored in zip(one.profile(), two.profile()[::-1], strict=True):
        assert np.allclose(panel, [distance, 0] + mirrored * [-1, 1], atol=1e-11)


@pytest.mark.parametrize("opening", [1e-6, 0.5, 1.2, 1.38])
def test_soft_crease_is_rigid_folding(opening):
    fold = ZFold.from_eta(1e-6)
    state = fold.solve(opening)
    assert state.included_angle == pytest.approx(fold.rigid_angle(opening), abs=2e-5)
    assert state.force == pytest.approx(rigid_force(fold, opening), rel=1e-3)
    free = ZFold.from_eta(0.0).solve(opening)
    assert free.included_angle == pytest.approx(fold.rigid_angle(opening), abs=1e-14)
    assert (free.force, free.energy) == (0, 0)


@pytest.mark.parametrize("opening", [1e-6, 0.5, 1.2, 1.38])
def test_stiff_crease_keeps_its_rest_angle(opening):
    stiff, fixed = ZFold.from_eta(1e6).solve(opening), ZFold.from_eta(inf).solve(opening)
    assert stiff.included_angle == pytest.approx(REST_ANGLE, abs=1e-5)
    assert fixed.included_angle == pytest.approx(REST_ANGLE, abs=1e-12)
    assert stiff.force == pytest.approx(fixed.force, rel=1e-4)
    assert fixed.crease_energy == 0


def test_rest_state_is_free_of_force():
    for fold in (ZFold.from_eta(1.0), *UNEQUAL):
        state = fold.solve(0.0)
        assert state.included_angle == pytest.approx(fold.rest_angle, abs=1e-14)
        assert (state.force, state.energy) == (0, 0)
        first, second = state.profile(5)
        assert first[-1] == pytest.approx(second[-1], abs=1e-15)


def test_rigid_angle_of_the_paper():
    fold = ZFold.from_eta(1.0)
    assert fold.rest_distance == pytest.approx(2 * sin(radians(17.8)), rel=1e-15)
    assert fold.taut_opening == pytest.approx(1.38861, abs=5e-6)
    angles = [degrees(fold.rigid_angle(d)) for d in (0.5, 1.0, 1.2)]
    assert angles == pytest.approx([67.517, 107.355, 129.834], abs=5e-4)


def test_linear_beam_angle_is_the_limit_of_the_elastica():
    """For small openings the two differ by a second-order term; the Ritz line does not."""
    eta = 0.4
    fold = ZFold.from_eta(eta)
    errors, ritz = [], []
    for opening in (4e-3, 2e-3):
        angle, rigid = fold.solve(opening).included_angle, fold.rigid_angle(opening)
        errors.append(abs(linear_beam_angle(eta, rigid) - angle))
        ritz.append(abs(ritz_angle(eta, rigid) - angle) / (rigid - REST_ANGLE))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.05)
    assert ritz[1] == pytest.approx(1 / (1 + 2 * eta) - 1 / (1 + 8 * eta), rel=1e-2)


def test_linear_beam_angle_with_poisson_ratio_and_limits():
    assert linear_beam_angle(0.3, 2.0, nu=0.5) == pytest.approx(linear_beam_angle(0.225, 2.0))
    for line in (ritz_angle, linear_beam_angle):
        angles = line(np.array([0.0, 1e9]), 2.0)
        assert angles == pytest.approx([2.0, REST_ANGLE], abs=1e-8)


@pytest.mark.parametrize("opening", [-0.1, 1.39, inf, float("nan")])
def test_opening_out_of_range_is_refused(opening):
    with pytest.raises(InputError, match="opening"):
        ZFold.from_eta(1.0).solve(opening)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (((0.0, 1.0), (1.0, 1.0), 1.0), "widths"),
        (((1.0, 1.0), (1.0, -1.0), 1.0), "bending_stiffness"),
        (((1.0, 1.0), (1.0, 1.0), float("nan")), "crease stiffness"),
        (((1.0, 1.0), (1.0, 1.0), 1.0, pi), "rest angle"),
    ],
)
def test_impossible_folds_are_refused(arguments, named):
    with pytest.raises(InputError, match=named):
        ZFold(*arguments)


# --- tables


def test_sze_table_of_the_end_shear_is_the_elastica():
    """Within 0.04 % of the length: the table's shells strain, the elastica does not."""
    table = read_table(REFERENCE / "sze2004_cantilever_end_shear.csv")
    tips = [cantilever_end_shear(4 * p, length=10.0) for p in table["P_over_Pmax"]]
    for name, values in (("Uz_tip", [t.w for t in tips]), ("minus_Ux_tip", [t.u for t in tips])):
        assert np.max(np.abs(values - table[name])) < 4e-4 * 10.0


def test_sze_table_of_the_end_moment_is_the_circle():
    table = read_table(REFERENCE / "sze2004_cantilever_end_moment.csv")
    tips = [cantilever_end_moment(2 * pi * m, length=12.0) for m in table["M_over_Mmax"]]
    assert np.max(np.abs([t.w for t in tips] - table["Uz_tip"])) < 6e-4
    assert np.max(np.abs([t.u for t in tips] - table["minus_Ux_tip"])) < 6e-4


@pytest.mark.parametrize(
    ("problem", "columns", "tolerance"),
    [
        ("slit_annular_plate", ("W_inner_A(r=6)", "W_A_inner"), 4e-3),
        ("slit_annular_plate", ("W_outer_B(r=10)", "W_B_outer"), 4e-3),
        ("hemisphere_18deg_hole", ("inward_displacement_at_pushed_point", "inward"), 1e-2),
        ("cylinder_open_end_pullout", ("W_A", "W_A"), 2e-2),
    ],
)
def test_two_references_of_a_problem_agree(problem, columns, tolerance):
    """Reissner-Mindlin (Sze) and Kirchhoff-Love end values: softer by the shear at most."""
    sze = read_table(REFERENCE / f"sze2004_{problem}.csv")
    kl = read_table(REFERENCE / f"kirchhoff_love_{problem}.csv")
    assert kl.head["problem"] == f"as in sze2004_{problem}.csv"
    at = np.isin(sze["P_over_Pmax"], kl["P_over_Pmax"])
    assert np.count_nonzero(at) >= 20
    thick, thin = sze[columns[0]][-1], kl[columns[1]][-1]
    assert 0 < thick / thin - 1 < tolerance


def test_every_table_names_its_source():
    files = sorted(REFERENCE.glob("*.csv"))
    assert len(files) == 10
    for file in files:
        table = read_table(file)
        assert {"source", "problem"} <= set(table.head)
        load = next(iter(table.columns.values()))
        rises = np.all(np.diff(load) > 0)
        assert not rises if "roof" in file.name else rises and load[-1] == 1


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("# nothing\na,b\n1,2\n", "without a key"),
        ("a,b\n1\n", "row 1 has 1 cells"),
        ("a,b\n1,2\n1,x\n", "row 2"),
        ("a,b\n1,nan\n", "not finite"),
        ("a,b\n", "no rows"),
        ("", "no rows"),
    ],
)
def test_bad_tables_are_refused(tmp_path, text, named):
    (tmp_path / "table.csv").write_text(text)
    with pytest.raises(InputError, match=named):
        read_table(tmp_path / "table.csv")


def test_unknown_column_is_named():
    table = read_table(REFERENCE / "sze2004_cantilever_end_moment.csv")
    with pytest.raises(InputError, match="Uy"):
        table["Uy"]
