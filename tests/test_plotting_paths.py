"""Charts of paths: what is solid and dashed, where events stand, what is refused."""

import re

import numpy as np
import pytest
from PIL import Image

from ufl_origami.errors import InputError
from ufl_origami.plotting.paths import PathCurve, path_chart, stable_parts

ARC = np.linspace(0.0, 1.0, 11)
LOAD = ARC * (1.5 - ARC)  # turns at arc 0.75
UNSTABLE = (ARC > 0.75).astype(int)
TURN = [("limit point", 0.5625, 1.5)]


def curve(label="fold", **options):
    options = {"events": TURN} | options
    return PathCurve(LOAD, 2.0 * ARC, UNSTABLE, label, **options)


def drawn(text):
    """Paths of an SVG that are curves: points and whether they are dashed."""
    found = re.findall(r'<path d="M ([^"]*)" clip[^>]*style="([^"]*)"', text)
    lines = [(np.array([p.split() for p in re.split("[ML]", d)], float), s) for d, s in found]
    return [(points, "dasharray" in style) for points, style in lines if len(points) > 2]


def test_parts_share_the_state_at_which_the_verdict_changes():
    parts = [(part.start, part.stop, stable) for part, stable in stable_parts([0, 0, 1, 2, 0])]
    assert parts == [(0, 3, True), (2, 5, False), (4, 6, True)]
    assert [(p.start, p.stop, s) for p, s in stable_parts([1])] == [(0, 2, False)]


def test_unstable_states_are_dashed_and_named_in_the_legend(tmp_path):
    charts = {"soft": {"energy": [curve()]}, "stiff": {"energy": [curve(events=())]}}
    text = path_chart(charts, tmp_path / "paths.svg", abscissa="load").read_text()
    for shown in ("soft", "stiff", "energy", "unstable", "limit point", "fold"):
        assert text.count(f">{shown}<") == 1, shown
    assert text.count(">load<") == 2
    assert "bifurcation" not in text
    lines = [(len(points), dashed) for points, dashed in drawn(text)]
    assert sorted(lines) == sorted(2 * [(9, False), (3, True)])


def test_an_event_stands_where_it_is(tmp_path):
    """Beside the state of arc 0.7, a step of 0.1 before which the curve is at most as steep."""
    text = path_chart({"": {"y": [curve()]}}, tmp_path / "paths.svg", abscissa="x").read_text()
    points = np.concatenate([points for points, _ in drawn(text)])
    use = re.search(r'<g clip-path[^>]*>\s*<use [^>]*x="([\d.]+)" y="([\d.]+)"', text)
    assert use
    place, height = np.array(use.groups(), float), np.ptp(points[:, 1])
    expected = points[0, 1] - 0.75 * height  # the ordinate is twice the arc length
    assert abs(place[1] - expected) < 1e-3 * height
    assert place[0] >= points[:, 0].max()


def test_points_are_full_where_stable_and_hollow_elsewhere(tmp_path):
    file = path_chart({"": {"y": [curve(kind="points")]}}, tmp_path / "p.svg", abscissa="x")
    text = file.read_text()
    assert text.count("unstable (hollow)") == 1
    assert not drawn(text)
    picture = path_chart({"": {"y": [curve()]}}, tmp_path / "p.png", abscissa="x")
    ink = np.mean(np.any(np.asarray(Image.open(picture).convert("RGB")) < 200, axis=2))
    assert 0.003 < ink < 0.3


@pytest.mark.parametrize(
    ("charts", "message"),
    [
        (lambda: {}, "nothing to draw"),
        (lambda: {"a": {"y": [curve()]}, "b": {"z": [curve()]}}, "different ordinates"),
        (lambda: {"a": {"y": [PathCurve(LOAD, LOAD, [0], "one")]}}, "does not pair"),
        (lambda: {"a": {"y": [curve(events=[("snap", 0.1, 0.1)])]}}, "'snap' is none of"),
    ],
)
def test_what_cannot_be_drawn_is_refused(charts, message, tmp_path):
    with pytest.raises(InputError, match=message):
        path_chart(charts(), tmp_path / "p.png", abscissa="x")
