"""Chart of the energy book, and the error of the balance that it shows."""

import re

import numpy as np
import pytest
from PIL import Image

from ufl_origami.energy_book import balance_error, energy_changes
from ufl_origami.errors import InputError
from ufl_origami.history import History
from ufl_origami.plotting import Series, energy_book_chart, stacked_chart

TIME = np.linspace(0.0, 2.0, 9)


def book(**columns):
    """History of a fall from height 7 at g m = 1: it gains what it loses, but for what is given."""
    fall = TIME**2 / 2
    table = {
        "energy_kinetic": fall,
        "energy_membrane": 1e-16 * TIME,
        "energy_gravity": 7.0 - fall,
        "work": 0.0 * TIME,
        "lost_integrator": 0.0 * TIME,
        "lost_damping": 0.0 * TIME,
        "lost_friction": 0.0 * TIME,
        "imbalance": 0.0 * TIME,
    } | columns
    energies = [values for name, values in table.items() if name.startswith("energy_")]
    table["energy_total"] = np.sum(energies, axis=0)
    rows = zip(*table.values(), strict=True)
    steps = [{"step": float(k), "time": time} for k, time in enumerate(map(float, TIME))]
    rows = [dict(zip(table, map(float, row), strict=True)) for row in rows]
    return History([step | row for step, row in zip(steps, rows, strict=True)])


def curves(history, folder, **options):
    """Texts of the chart, and colour -> heights (points, upwards) of its uppermost curves' ends."""
    text = energy_book_chart(history, folder / "book.svg", **options).read_text()
    ends = {}
    for path, colour in re.findall(r'<path d="M ([^"]*)" clip[^>]*stroke: (#\w+)', text):
        points = np.array([pair.split() for pair in re.split("[ML]", path)], float)
        ends.setdefault(colour, -points[[0, -1], 1])
    return re.findall(r">([^<>\n]+)</text>", text), ends


def test_error_of_the_balance_counts_potential_energies_from_the_start():
    """The largest energy is the kinetic one at the end, 2; the height at the start is no energy."""
    assert balance_error(book()) == 0.0
    crooked = book(imbalance=np.where(TIME == 1.0, -3e-3, 1e-3))
    assert balance_error(crooked) == pytest.approx(3e-3 / 2.0, rel=1e-12)
    assert energy_changes(crooked)["gravity"] == pytest.approx(-(TIME**2) / 2, abs=1e-14)
    deep = book(energy_kinetic=0.0 * TIME, imbalance=1e-3 + 0.0 * TIME)
    assert balance_error(deep) == pytest.approx(1e-3 / 2.0, rel=1e-12)


def test_chart_shows_what_there_is_and_leaves_out_round_off(tmp_path):
    texts, _ = curves(book(lost_friction=TIME), tmp_path, title="A fall")
    for shown in ("kinetic", "gravity", "total", "lost: friction", "A fall", "time (s)", "none"):
        assert texts.count(shown) == 1, shown
    for left_out in ("membrane", "work", "lost: integrator", "lost: damping"):
        assert left_out not in texts


def test_chart_names_the_largest_imbalance_and_units_as_asked(tmp_path):
    history = book(imbalance=np.linspace(0.0, 5e-4, len(TIME)))
    texts, _ = curves(history, tmp_path, time_unit="", energy_unit="kN m")
    assert "largest 2.5e-04" in texts and "time" in texts
    assert "energy (kN m)," in texts and "work and losses (kN m)" in texts
    assert not any("J" in text for text in texts)


def test_total_is_the_sum_of_the_curves_beside_it(tmp_path):
    """Of the 2 that gravity gave, 0.5 is lost."""
    lost = 0.25 * TIME
    history = book(energy_kinetic=TIME**2 / 2 - lost, lost_friction=lost)
    ends = curves(history, tmp_path)[1]
    kinetic, gravity, total = (np.diff(ends[c]) for c in ("#0072b2", "#d55e00", "#000000"))
    assert gravity < -20  # points
    assert total / gravity == pytest.approx(0.25, abs=1e-4)
    assert kinetic / gravity == pytest.approx(-0.75, abs=1e-4)


@pytest.mark.parametrize(("factor", "power"), [(1.5e-5, -6), (1.5e6, 6)])
def test_very_small_and_large_energies_are_shown_in_powers_of_a_thousand(tmp_path, factor, power):
    columns = {f"energy_{kind}": book()[f"energy_{kind}"] for kind in ("kinetic", "gravity")}
    history = book(**{name: factor * values for name, values in columns.items()})
    texts, _ = curves(history, tmp_path)
    assert f"energy ($10^{{{power}}}$ J)," in (tmp_path / "book.svg").read_text()
    top = 2 * factor / 10.0**power  # of the kinetic energy
    shown = [float(text) for text in texts if re.fullmatch(r"[0-9.]+", text)]
    assert min(abs(top - value) for value in shown) < 1e-9 * top


def test_kinds_of_terms_of_ones_own_are_drawn_too(tmp_path):
    texts, _ = curves(book(energy_foundation=TIME, energy_load=-TIME), tmp_path)
    assert "foundation" in texts and "load" in texts


def test_chart_is_a_picture_of_its_size(tmp_path):
    image = Image.open(energy_book_chart(book(), tmp_path / "folder" / "book.png"))
    assert image.size[0] > 1200 and image.size[1] > 1000
    ink = np.mean(np.any(np.asarray(image.convert("RGB")) < 200, axis=2))
    assert 0.005 < ink < 0.3


def test_stacked_charts_share_abscissa_colours_and_legend(tmp_path):
    angle, speed = Series(TIME, TIME, "flap"), Series(TIME, 0 * TIME, "flap", "dashed")
    rows = {"angle (deg)": [angle, Series(TIME, -TIME, "rigid")], "speed (1/s)": [speed]}
    text = stacked_chart(rows, tmp_path / "rows.svg", abscissa="time (s)").read_text()
    assert [text.count(f">{label}<") for label in ("flap", "rigid", "time (s)")] == [1, 1, 1]
    assert text.count("stroke: #0072b2") == 3 and text.count("stroke: #d55e00") == 2
    with pytest.raises(InputError, match="nothing to draw"):
        stacked_chart({}, tmp_path / "rows.svg", abscissa="time (s)")


@pytest.mark.parametrize(
    ("history", "named"),
    [
        (History([{"step": 1, "time": 0.0, "load": 1.0}] * 2), "no energy book"),
        (History(book().rows[:1]), "a history of 1 rows has no steps"),
        (book(energy_kinetic=0 * TIME, energy_gravity=0 * TIME, energy_membrane=0 * TIME), "no en"),
    ],
)
def test_a_history_that_has_nothing_to_draw_is_refused(history, named, tmp_path):
    with pytest.raises(InputError, match=named):
        energy_book_chart(history, tmp_path / "book.png")
