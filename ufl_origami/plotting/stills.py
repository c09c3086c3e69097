"""Pictures and films of sheets with pyvista, off screen. Call on one rank only.

pyvista is imported on first use (it takes about a second); an X server is provided by
`display.virtual_display`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import cos, floor, log10, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from ufl_origami.errors import InputError
from ufl_origami.plotting.display import virtual_display

_FRONT, _BACK, _INK = "#9fc3de", "#e8c9a0", "#2b2b2b"
_OBSTACLE, _OBSTACLE_LINE = "#e3e3df", "#b4b4ae"
_OVERSAMPLING = 2  # rendered larger and reduced: smooth lines on any renderer
_FILM_FORMATS = {".gif": "GIF", ".webp": "WEBP", ".png": "PNG"}


@dataclass(frozen=True)
class Sheet:
    """A triangulated sheet to draw.

    Attributes:
        points: vertices (n, 3).
        triangles: vertex indices (m, 3).
        scalars: values to colour by, one per vertex (n,) or triangle (m,).
        crease_edges: vertex pairs (k, 2), drawn as dark lines.
    """

    points: ArrayLike
    triangles: ArrayLike
    scalars: ArrayLike | None = None
    crease_edges: ArrayLike | None = None

    def __post_init__(self) -> None:
        """Refuse arrays of the wrong shape, points that are not finite, indices out of range."""
        points, triangles = np.asarray(self.points), np.asarray(self.triangles)
        if points.ndim != 2 or points.shape[1] != 3 or not np.all(np.isfinite(points)):
            raise InputError(f"sheet: points {points.shape} must be finite, of shape (n, 3)")
        _check_indices("triangles", triangles, 3, len(points))
        if self.crease_edges is not None:
            _check_indices("crease_edges", np.asarray(self.crease_edges), 2, len(points))
        if self.scalars is not None:
            shape = np.shape(self.scalars)
            if shape not in ((len(points),), (len(triangles),)):
                raise InputError(f"sheet: scalars {shape} are neither per vertex nor per triangle")


@dataclass(frozen=True)
class Look:
    """How a sheet is shown.

    Attributes:
        camera: azimuth and elevation of the camera, degrees: (0, 0) looks along +y at the x-z
            plane, azimuth turns it round z towards +x.
        title: text above the sheet.
        scalar_label: name and unit of the scalars.
        scalar_range: colour limits; by default the smallest and largest scalar.
        colour_map: name of a matplotlib colour map.
        scale_label: unit behind the number of the scale bar; None leaves the bar out.
        edges: draw the triangles' edges.
        size: pixels, width and height.
        obstacles: surfaces drawn grey in each picture, their `crease_edges` as thin lines.
    """

    camera: tuple[float, float] = (-20.0, 30.0)
    title: str | None = None
    scalar_label: str = ""
    scalar_range: tuple[float, float] | None = None
    colour_map: str = "viridis"
    scale_label: str | None = ""
    edges: bool = True
    size: tuple[int, int] = (1200, 900)
    obstacles: Sequence[Sheet] = ()


def still(
    points: ArrayLike,
    triangles: ArrayLike,
    file: str | Path,
    *,
    scalars: ArrayLike | None = None,
    crease_edges: ArrayLike | None = None,
    look: Look | None = None,
) -> Path:
    """Draw one sheet into a png file; arrays as in `Sheet`. Returns the file's path.

    Raises:
        InputError: arrays that are no sheet, or another suffix than .png.
        DisplayError: there is no X server to render on.
    """
    path = Path(file)
    if path.suffix != ".png":
        raise InputError(f"still {path.name}: suffix must be .png")
    (image,) = _render([Sheet(points, triangles, scalars, crease_edges)], look or Look())
    path.parent.mkdir(parents=True, exist_ok=True)
    image.save(path)
    return path


def film(
    frames: Iterable[Sheet],
    file: str | Path,
    *,
    look: Look | None = None,
    frames_per_second: float = 12.0,
) -> Path:
    """Draw sheets into an endless animation (.gif, .webp or .png), camera and colours fixed.

    Raises:
        InputError: no frames, or another suffix.
        DisplayError: there is no X server to render on.
    """
    path, sheets = Path(file), list(frames)
    if path.suffix not in _FILM_FORMATS:
        raise InputError(f"film {path.name}: suffix must be one of {', '.join(_FILM_FORMATS)}")
    if not sheets:
        raise InputError(f"film {path.name}: no frames")
    first, *rest = _render(sheets, look or Look())
    path.parent.mkdir(parents=True, exist_ok=True)
    first.save(
        path,
        format=_FILM_FORMATS[path.suffix],
        save_all=True,
        append_images=rest,
        duration=1000 / frames_per_second,
        loop=0,
    )
    return path


@dataclass(frozen=True)
class _View:
    """Parallel view: directions, centre and half extents of the picture, size of what it shows."""

    right: NDArray[np.float64]
    up: NDArray[np.float64]
    towards: NDArray[np.float64]
    centre: NDArray[np.float64]
    half: tuple[float, float]
    size: float
    scalar_range: tuple[float, float] | None = None

    @classmethod
    def of(cls, sheets: Sequence[Sheet], look: Look) -> "_View":
        """View of all sheets and obstacles, with margins for title, scale bar and colour bar."""
        azimuth, elevation = map(radians, look.camera)
        towards = np.array(
            [sin(azimuth) * cos(elevation), -cos(azimuth) * cos(elevation), sin(elevation)]
        )
        right = np.array([cos(azimuth), sin(azimuth), 0.0])
        up = np.cross(towards, right)
        axes = np.array([right, up, towards])
        shown = [np.asarray(one.points, float) for one in (*sheets, *look.obstacles)]
        seen = np.concatenate(shown) @ axes.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        size = float(np.max(high - low)) / 2
        if size == 0:
            raise InputError("sheet: all points coincide")
        values = _range(sheets, look)
        margins = (0.08, 0.08 if values is None else 0.22, 0.15, 0.11 if look.title else 0.06)
        half, shift = _frame((high - low)[:2], margins, look.size[0] / look.size[1])
        centre = axes.T @ ((low + high) / 2) + shift[0] * right + shift[1] * up
        return cls(right, up, towards, centre, half, size, values)


def _frame(
    extent: NDArray, margins: tuple[float, float, float, float], aspect: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Half width and height of the picture and its centre relative to that of the extent.

    Margins are the parts of the picture left free at the left, right, bottom and top.
    """
    left, right, bottom, top = margins
    height = max(extent[1] / (1 - bottom - top), extent[0] / (1 - left - right) / aspect)
    width = height * aspect
    return (width / 2, height / 2), (width * (right - left) / 2, height * (top - bottom) / 2)


def _range(sheets: Sequence[Sheet], look: Look) -> tuple[float, float] | None:
    values = [np.asarray(s.scalars, float) for s in sheets if s.scalars is not None]
    if look.scalar_range is not None or not values:
        return look.scalar_range
    return min(float(v.min()) for v in values), max(float(v.max()) for v in values)


def _check_indices(name: str, indices: NDArray, width: int, count: int) -> None:
    if indices.ndim != 2 or indices.shape[1] != width or indices.dtype.kind not in "iu":
        raise InputError(f"sheet: {name} {indices.shape} must be integers of shape (n, {width})")
    if indices.size and not (0 <= indices.min() and indices.max() < count):
        raise InputError(f"sheet: {name} hold an index outside 0..{count - 1}")


def _render(sheets: Sequence[Sheet], look: Look) -> list[Any]:
    """Finished images (PIL) of the sheets in one common view."""
    import pyvista as pv

    view, images = _View.of(sheets, look), []
    with virtual_display():
        size = [_OVERSAMPLING * n for n in look.size]
        plotter: Any = pv.Plotter(off_screen=True, window_size=size, lighting="none")
        try:
            plotter.set_background("white")
            _light(pv, plotter, view)
            for sheet in sheets:
                plotter.suppress_rendering = True  # else every change would be rendered
                plotter.clear_actors()
                _draw(pv, plotter, sheet, look, view)
                plotter.suppress_rendering = False
                plotter.render()
                images.append(_annotate(plotter.screenshot(return_img=True), look, view))
        finally:
            plotter.close()  # before the X server stops: VTK exits when it loses its server
    return images


def _light(pv, plotter, view: _View) -> None:
    """Key light from the upper left, fill from the right and from the camera, fixed to the view."""
    radius = 10 * max(view.half)
    for direction, intensity in (
        (view.towards + 0.8 * view.up - 0.5 * view.right, 0.6),
        (view.towards + 0.3 * view.up + 1.5 * view.right, 0.35),
        (view.towards, 0.15),
    ):
        plotter.add_light(
            pv.Light(
                position=view.centre + radius * direction,
                focal_point=view.centre,
                intensity=intensity,
                light_type="scene light",
            )
        )


def _draw(pv, plotter, sheet: Sheet, look: Look, view: _View) -> None:
    """Obstacles; surface, border and creases of the sheet; camera."""
    for body in look.obstacles:
        plotter.add_mesh(_mesh(pv, body), color=_OBSTACLE, ambient=0.75, diffuse=0.3)
        _draw_lines(plotter, _crease_lines(pv, body), 0.002 * view.size, _OBSTACLE_LINE)
    mesh = _mesh(pv, sheet)
    _draw_surface(plotter, mesh, sheet, look, view)
    border = mesh.extract_feature_edges(
        boundary_edges=True, feature_edges=False, manifold_edges=False, non_manifold_edges=False
    )
    _draw_lines(plotter, border, 0.0025 * view.size, "#555555")
    _draw_lines(plotter, _crease_lines(pv, sheet), 0.006 * view.size, _INK)
    camera = plotter.camera
    camera.position = view.centre + 20 * view.size * view.towards
    camera.focal_point, camera.up = view.centre, view.up
    plotter.enable_parallel_projection()
    camera.parallel_scale = view.half[1]
    plotter.reset_camera_clipping_range()


def _mesh(pv, sheet: Sheet) -> Any:
    points, triangles = np.asarray(sheet.points, float), np.asarray(sheet.triangles)
    return pv.PolyData.from_regular_faces(points, triangles)


def _crease_lines(pv, sheet: Sheet) -> Any:
    edges = () if sheet.crease_edges is None else sheet.crease_edges
    pairs = np.asarray(edges, int).reshape(-1, 2)
    lines = np.column_stack([np.full(len(pairs), 2), pairs]).ravel()
    return pv.PolyData(np.asarray(sheet.points, float), lines=lines)


def _draw_surface(plotter, mesh, sheet: Sheet, look: Look, view: _View) -> None:
    options: dict[str, Any] = {"color": _FRONT, "backface_params": {"color": _BACK}}
    if sheet.scalars is not None:
        options = {
            "scalars": np.asarray(sheet.scalars, float),
            "clim": view.scalar_range,
            "cmap": look.colour_map,
            "show_scalar_bar": False,
        }
    plotter.add_mesh(
        mesh,
        show_edges=look.edges,
        edge_color="#3c4a57",
        edge_opacity=0.22,
        line_width=1.0,
        ambient=0.48 if sheet.scalars is None else 0.65,
        diffuse=0.7 if sheet.scalars is None else 0.45,
        **options,
    )


def _draw_lines(plotter, lines, radius: float, colour: str) -> None:
    """Tubes round line segments: visible from both sides, without flicker on the surface."""
    if lines.n_lines:
        plotter.add_mesh(lines.tube(radius=radius), color=colour, ambient=0.6, diffuse=0.4)


def _annotate(pixels: NDArray, look: Look, view: _View) -> Any:
    """Rendered picture with title, scale bar and colour bar, as a PIL image."""
    from PIL import Image

    picture = Image.fromarray(pixels).resize(look.size, Image.Resampling.LANCZOS)
    dpi = look.size[0] / 7.0  # text as on a picture 7 inches wide
    inches = [(n + 0.5) / dpi for n in look.size]  # half a pixel more: the canvas rounds down
    figure = Figure(figsize=(inches[0], inches[1]), dpi=dpi)
    canvas = FigureCanvasAgg(figure)
    figure.figimage(np.asarray(picture), zorder=-1)
    axes = figure.add_axes((0, 0, 1, 1), frameon=False)
    axes.set(xlim=(-view.half[0], view.half[0]), ylim=(-view.half[1], view.half[1]))
    axes.set_axis_off()
    if look.title:
        figure.text(0.5, 0.965, look.title, ha="center", va="top", fontsize=13, color=_INK)
    if look.scale_label is not None:
        _draw_scale(axes, look, view)
    if view.scalar_range is not None:
        norm = Normalize(*view.scalar_range)
        bar = figure.colorbar(
            ScalarMappable(norm, look.colour_map), cax=figure.add_axes((0.885, 0.25, 0.022, 0.5))
        )
        bar.ax.spines[:].set_visible(False)
        bar.ax.tick_params(labelsize=9.5, colors=_INK, length=3)
        bar.ax.set_title(look.scalar_label, fontsize=11, color=_INK, pad=10)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def _draw_scale(axes, look: Look, view: _View) -> None:
    """Bar of a round length in the picture's plane, at the lower left."""
    length = _round_length(0.5 * view.half[0])
    x, y = -0.92 * view.half[0], -0.9 * view.half[1]
    axes.plot([x, x + length], [y, y], color=_INK, lw=2.5, solid_capstyle="butt")
    text = f"{length:g} {look.scale_label}".strip()
    style = {"va": "center", "fontsize": 10.5, "color": _INK}
    axes.annotate(text, (x + length, y), xytext=(7, 0), textcoords="offset points", **style)


def _round_length(length: float) -> float:
    """Largest 1, 2 or 5 times a power of ten up to a length."""
    power = 10.0 ** floor(log10(length))
    return max(m for m in (1, 2, 5) if m * power <= length * (1 + 1e-12)) * power
