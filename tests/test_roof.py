"""Whole paths of the hinged cylindrical roof, with snap-through and snap-back, against tables.

The tables are Kirchhoff-Love solutions. Under the central force no value independent of the mesh
exists, but the part of it that depends on it is small; at the free edge there is none.
"""

from pathlib import Path

import numpy as np
import pytest
from path_scenes import roof
from scipy.interpolate import CubicSpline

import ufl_origami as uo
from ufl_origami.analytic.reference_tables import read_table
from ufl_origami.gallery.shell_problems import displacement

REFERENCE = Path(__file__).parent / "reference"
ARC = uo.ArcSettings(first=0.1, largest=1e-3, tolerance=1e-4)
COLUMNS = {"A": "W_centre", "B": "W_free_edge_mid"}


def table(h):
    """Load and deflections of the reference."""
    values = read_table(REFERENCE / f"kirchhoff_love_hinged_roof_h{h:g}.csv")
    return values["P"], {point: values[name] for point, name in COLUMNS.items()}


def follow(h, model, n):
    """The path until the centre is below all deflections of the table, and its columns."""
    extra = {
        point: lambda model, point=point: -float(displacement(model, point)[2]) for point in COLUMNS
    }
    record = uo.Record(extra=extra, reactions=(), points=())
    stop = uo.at_position("A", "z", 2540.0 - 29.5)
    path = uo.follow_path(roof(h, model, n), [stop], record=record, arc=ARC)
    return path, 1e3 * path.history["load_factor"], {p: path.history[p] for p in COLUMNS}


def curve(load, deflection, place):
    """Load and deflection, spline functions of a place along the path."""
    return CubicSpline(place, load), CubicSpline(place, deflection)


def distance(load, deflection, curve, count):
    """Largest distance of points from a curve over the ranges of load and deflection."""
    place = np.linspace(0, count - 1, 100 * count)
    along = np.stack([part(place) / np.ptp(part(place)) for part in curve])
    scale = [np.ptp(part(place)) for part in curve]
    points = np.stack([load / scale[0], deflection / scale[1]])
    gaps = points[:, :, None] - along[:, None, :]
    return np.linalg.norm(gaps, axis=0).min(axis=1).max()


def turns(curve, count):
    """Deflections at which the path turns back in the deflection."""
    deflection = curve[1]
    places = deflection.derivative().roots(extrapolate=False)
    return deflection([place for place in places if 1 < place < count - 2])


def assert_roof(h, model, n):
    """Limit points and turning points within 1 %, the path within 1 % of its extent."""
    exact, deflections = table(h)
    path, load, found = follow(h, model, n)
    index = np.arange(len(exact))
    loads = curve(exact, exact, index)[0]
    extrema = loads(loads.derivative().roots(extrapolate=False))
    assert [1e3 * e.load for e in path.events] == pytest.approx(extrema, rel=0.01)
    assert [(e.kind, e.before, e.after) for e in path.events] == [
        ("limit point", 0, 1),
        ("limit point", 1, 0),
    ]
    for point, reference in deflections.items():
        line = curve(exact, reference, index)
        inside = found["A"] < 0.98 * deflections["A"][-1]
        inside[: len(inside) // 2] = True
        assert distance(load[inside], found[point][inside], line, len(index)) < 0.01
        own = curve(load, found[point], np.arange(len(load)))
        largest = np.ptp(reference)
        expected = [w for w in turns(line, len(index)) if w > 0.1 * largest]
        assert len(expected) == (2 if h < 10 else 0)
        here = [w for w in turns(own, len(load)) if w > 0.1 * largest]
        assert here[: len(expected)] == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("h", [12.7, 6.35])
def test_roof(h):
    assert_roof(h, "fem", 4)


@pytest.mark.slow
@pytest.mark.parametrize("h", [12.7, 6.35])
@pytest.mark.parametrize(("model", "n"), [("ddg", 20), ("fem", 8)])
def test_fine_roof(h, model, n):
    assert_roof(h, model, n)
