"""Charts and pictures: files of the right size that show what they were given."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from PIL import Image

import ufl_origami
from ufl_origami.errors import InputError
from ufl_origami.plotting import (
    DisplayError,
    Look,
    Series,
    Sheet,
    convergence_chart,
    film,
    fold_angle_chart,
    history_chart,
    profile_chart,
    settling_chart,
    still,
    virtual_display,
)

pytestmark = pytest.mark.serial

X = np.linspace(0.1, 1.0, 10)
SMALL = (300, 225)
TOP = Look(camera=(0.0, 90.0), size=(600, 450), edges=False)


def pixels(file):
    return np.asarray(Image.open(file).convert("RGB"), float)


def assert_drawn(file, least_width=300):
    image = pixels(file)
    assert image.shape[1] >= least_width and image.shape[0] >= least_width / 3
    ink = np.mean(np.any(image < 200, axis=2))
    assert 0.002 < ink < 0.6


def tent(height=0.5, n=4):
    """Two square panels joined at y = 0: points, triangles, crease edges."""
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(-1, 1, 2 * n - 1), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), height * (1 - np.abs(y.ravel()))])
    index = np.arange(points.shape[0]).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.concatenate([np.dstack([a, b, c]), np.dstack([a, c, d])]).reshape(-1, 3)
    return points, triangles, np.column_stack([index[:-1, n - 1], index[1:, n - 1]])


# --- charts


def test_charts_are_drawn_and_leave_matplotlib_alone(tmp_path):
    history = tmp_path / "history.csv"
    np.savetxt(
        history, np.column_stack([X, X**2, X**3]), delimiter=",", header="t,a,b", comments=""
    )
    before = dict(mpl.rcParams)
    series = [Series(X, X, "line"), Series(X, X**2, "points", "points")]
    rows = {"a (N)": ["a"], "J": ["a", "b"]}
    charts = [
        profile_chart({"one": series, "two": series}, tmp_path / "a" / "profile.png"),
        fold_angle_chart(series, tmp_path / "angle.png", limits={"rigid": 1.0}),
        history_chart(history, tmp_path / "history.png", x="t", y=rows),
        convergence_chart(series, tmp_path / "order.png"),
    ]
    for file in charts:
        assert_drawn(file, 1200)
    assert dict(mpl.rcParams) == before


def test_legend_names_every_series_once_with_its_order(tmp_path):
    series = [Series(X, 3 * X**2, "director"), Series(X, X**1.5, "averaged", "dashed")]
    text = convergence_chart(series, tmp_path / "order.svg").read_text()
    assert text.count("director (order 2.00)") == 1
    assert text.count("averaged (order 1.50)") == 1
    assert ">order 1<" in text and ">order 2<" in text


def test_one_colour_for_a_label_in_all_charts_of_a_figure(tmp_path):
    a, b = Series(X, X, "stiff"), Series(X, 1 - X, "soft")
    text = profile_chart({"one": [a, b], "two": [b]}, tmp_path / "p.svg").read_text()
    assert text.count(">stiff<") == text.count(">soft<") == 1
    stroke = [line.split("stroke: ")[1][:7] for line in text.splitlines() if "stroke: #" in line]
    lines = [c for c in stroke if c in ("#0072b2", "#d55e00")]
    assert sorted(lines) == ["#0072b2"] * 2 + ["#d55e00"] * 3  # drawn, plus one legend entry each


@pytest.mark.parametrize(
    ("draw", "named"),
    [
        (lambda f: fold_angle_chart([Series(X, X, "a")], f.with_suffix(".doc")), "suffix"),
        (lambda f: Series(X, X[:3], "short"), "short"),
        (lambda f: Series([], [], "empty"), "empty"),
        (lambda f: Series(X, X, "odd", "wavy"), "wavy"),
        (lambda f: convergence_chart([Series(X, -X, "negative")], f), "negative"),
        (lambda f: profile_chart({}, f), "nothing to draw"),
        (lambda f: settling_chart([], 1.0, f), "curves"),
        (lambda f: settling_chart([Series(X, X, "a")], 0.0, f), "limit other than zero"),
    ],
)
def test_bad_chart_input_is_named(tmp_path, draw, named):
    with pytest.raises(InputError, match=named):
        draw(tmp_path / "chart.png")
    assert not list(tmp_path.iterdir())


def test_missing_history_column_is_named(tmp_path):
    (tmp_path / "h.csv").write_text("t,force\n0,1\n1,2\n")
    with pytest.raises(InputError, match=r"energy.*force"):
        history_chart(tmp_path / "h.csv", tmp_path / "h.png", x="t", y={"J": ["energy"]})


def test_settling_chart_shows_value_and_distance_from_the_limit(tmp_path):
    time = np.linspace(0.0, 10.0, 101)
    speed = Series(time, 2.0 + np.exp(-time), "speed")
    options = {"limit_label": "creep", "tolerance": 0.02, "labels": ("t", "v (m/s)")}
    text = settling_chart([speed], 2.0, tmp_path / "s.svg", **options).read_text()
    assert all(f">{word}<" in text for word in ("creep", "2 %", "v (m/s)", "t"))
    curves = [line for line in text.splitlines() if "stroke: #0072b2" in line]
    assert len(curves) == 2
    assert_drawn(settling_chart([speed], 2.0, tmp_path / "s.png"), 1200)
    there = Series(time, np.where(time < 5, 3.0, 2.0), "there")
    assert_drawn(settling_chart([speed, there], 2.0, tmp_path / "t.png"), 1200)


# --- pictures


def test_still_shows_sheet_and_scale_at_one_scale(tmp_path):
    """Seen from above, a flat sheet of 1 x 2 covers its area; the bar's length is the label's."""
    points, triangles, crease = tent(height=0.0)
    image = pixels(still(points, triangles, tmp_path / "s.png", crease_edges=crease, look=TOP))
    assert image.shape == (450, 600, 3)
    ink = np.any(image < 240, axis=2)
    ink[int(0.87 * len(ink)) :] = False  # the scale bar is below
    height, width = np.ptp(np.flatnonzero(ink.any(1))), np.ptp(np.flatnonzero(ink.any(0)))
    assert height / width == pytest.approx(2.0, rel=0.02)
    assert np.count_nonzero(ink) == pytest.approx(height * width, rel=0.02)
    assert bar_length(image) / width == pytest.approx(0.5, rel=0.03)


def bar_length(image):
    """Longest run of dark pixels in a row of the picture's lowest part."""
    dark = np.all(image < 110, axis=2)[int(0.87 * len(image)) :]
    columns = np.flatnonzero(dark[np.argmax(dark.sum(axis=1))])
    return max(len(run) for run in np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1))


def test_crease_is_drawn_where_it_is(tmp_path):
    points, triangles, crease = tent(height=0.0)
    look = Look(camera=(0.0, 90.0), size=(600, 450), edges=False, scale_label=None)
    images = [
        pixels(still(points, triangles, tmp_path / "s.png", crease_edges=edges, look=look))
        for edges in (crease, None)
    ]
    changed = np.any(np.abs(images[0] - images[1]) > 60, axis=2)
    rows, columns = np.nonzero(changed)
    sheet = np.nonzero(np.any(images[1] < 240, axis=2))
    assert np.mean(rows) == pytest.approx((sheet[0].min() + sheet[0].max()) / 2, abs=1.5)
    assert np.ptp(rows) < 12
    assert np.ptp(columns) == pytest.approx(np.ptp(sheet[1]), rel=0.05)


def test_scalars_colour_the_sheet_and_make_a_bar(tmp_path):
    points, triangles, _ = tent()
    look = Look(size=SMALL, scalar_label="z", title="tent")
    image = pixels(still(points, triangles, tmp_path / "s.png", scalars=points[:, 2], look=look))
    yellow = (image[..., 0] > 180) & (image[..., 1] > 170) & (image[..., 2] < 120)
    columns = np.flatnonzero(yellow.any(axis=0))
    assert columns.min() < 0.7 * SMALL[0] and columns.max() > 0.87 * SMALL[0]
    assert np.all(image[:, :5] == 255)


def test_film_has_its_frames_in_one_view(tmp_path):
    sheets = []
    for height in (0.1, 0.4, 0.9):
        points, triangles, crease = tent(height)
        sheets.append(Sheet(points, triangles, crease_edges=crease))
    look = Look(camera=(90.0, 5.0), size=SMALL)
    file = film(sheets, tmp_path / "f.gif", look=look, frames_per_second=5)
    with Image.open(file) as animation:
        assert (animation.n_frames, animation.size) == (3, SMALL)
        assert animation.info["duration"] == 200
        frames = []
        for n in range(3):
            animation.seek(n)
            frames.append(np.asarray(animation.convert("L"), float))
    top = [np.flatnonzero((frame < 200).any(axis=1))[0] for frame in frames]
    assert top[0] > top[1] + 10 > top[2] + 20  # the ridge rises
    foot = [frame[int(0.9 * SMALL[1]) :] for frame in frames]
    assert np.mean(np.abs(foot[0] - foot[2])) < 2  # the scale bar stays


def test_an_obstacle_is_drawn_below_the_sheet_with_its_lines(tmp_path):
    """Seen from above: a grey square of 2 x 2 around a sheet of 1 x 1, one line across it."""
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    triangles = [[0, 1, 2], [0, 2, 3]]
    ground = np.column_stack([2 * corners - 0.5, np.full(4, -0.1)])
    sheet = np.column_stack([corners, np.zeros(4)])
    images = []
    for lines in ([], [[0, 2]]):
        look = Look(
            camera=(0.0, 90.0),
            size=(600, 450),
            edges=False,
            scale_label=None,
            obstacles=[Sheet(ground, triangles, crease_edges=np.array(lines, int).reshape(-1, 2))],
        )
        images.append(pixels(still(sheet, triangles, tmp_path / "s.png", look=look)))
    shown = np.any(images[0] < 250, axis=2)
    coloured = np.ptp(images[0], axis=2) > 30  # the sheet; the obstacle is grey
    assert np.count_nonzero(shown) / np.count_nonzero(coloured) == pytest.approx(4.0, rel=0.05)
    changed = np.any(np.abs(images[0] - images[1]) > 10, axis=2)
    assert np.ptp(np.nonzero(changed)[1]) == pytest.approx(np.ptp(np.nonzero(shown)[1]), rel=0.05)
    assert not np.any(changed & coloured)  # the sheet hides the line's middle


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"points": np.zeros((3, 2))}, "points"),
        ({"points": np.full((3, 3), np.nan)}, "finite"),
        ({"points": np.zeros((3, 3))}, "coincide"),
        ({"triangles": [[0, 1, 3]]}, "triangles"),
        ({"triangles": [[0.0, 1.0, 2.0]]}, "triangles"),
        ({"crease_edges": [[0, 1, 2]]}, "crease_edges"),
        ({"scalars": [1.0, 2.0]}, "scalars"),
        ({"file": "s.jpg"}, "suffix"),
    ],
)
def test_bad_sheets_are_refused(tmp_path, change, named):
    arguments = {"points": np.eye(3), "triangles": [[0, 1, 2]], "file": "s.png"} | change
    arguments["file"] = tmp_path / arguments["file"]
    with pytest.raises(InputError, match=named):
        still(**arguments)


def test_film_without_frames_is_refused(tmp_path):
    with pytest.raises(InputError, match="no frames"):
        film([], tmp_path / "f.gif")


# --- display


def test_own_server_is_stopped_and_the_display_restored(monkeypatch):
    monkeypatch.setenv("DISPLAY", ":9999")  # nobody answers there
    servers, popen = [], subprocess.Popen
    monkeypatch.setattr(
        subprocess, "Popen", lambda *a, **k: servers.append(popen(*a, **k)) or servers[-1]
    )
    with virtual_display() as first, virtual_display() as second:
        assert first != second
        assert os.environ["DISPLAY"] == second
        assert [server.poll() for server in servers] == [None, None]
    assert os.environ["DISPLAY"] == ":9999"
    assert len(servers) == 2 and None not in [server.poll() for server in servers]


def test_stale_display_does_not_end_the_process(tmp_path, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":9999")
    points, triangles, _ = tent()
    assert_drawn(still(points, triangles, tmp_path / "s.png", look=Look(size=SMALL)))


def test_missing_server_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(DisplayError, match="Xvfb is not installed"), virtual_display():
        pass
    monkeypatch.setenv("DISPLAY", ":7")
    with virtual_display() as display:
        assert display == ":7"


def test_server_that_does_not_start_is_reported(monkeypatch, tmp_path):
    server = tmp_path / "Xvfb"
    server.write_text("#!/bin/sh\nexit 3\n")
    server.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(DisplayError, match="did not start"), virtual_display():
        pass


# --- imports


def test_charts_do_not_load_pyvista():
    code = "import sys, ufl_origami.plotting; sys.exit('pyvista' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_nothing_in_the_package_imports_plotting():
    root = Path(ufl_origami.__file__).parent
    for file in sorted(root.rglob("*.py")):
        if file.parent.name == "plotting":
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not any("plotting" in name for name in names), file
