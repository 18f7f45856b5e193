"""Plots and films of maps: the class of each cell, the path and the robot.

``MapPanel`` draws a map that may grow: once for a plot, frame by frame for a film.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import Bbox

from radarsim.autonomy.evaluation.mapping_run import SHARES, AreaCurve
from radarsim.autonomy.mapping.export import sensed_window
from radarsim.autonomy.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.autonomy.plotting.outlines import Outline, outlines_extent
from radarsim.autonomy.plotting.panels import (
    Panels,
    add_cell_image,
    show_cells,
    titles_of,
)
from radarsim.autonomy.plotting.run_markers import START
from radarsim.geometry import Floats, Pose2
from radarsim.plotting.film import Pixels
from radarsim.plotting.palette import (
    FAMILY_COLOURS,
    GOING,
    INK,
    NOT_SENSED,
    PAPER,
    TRUTH,
    Family,
)
from radarsim.plotting.plan import draw_robot, name_objects
from radarsim.plotting.style import HALO, QUIET, SMALL_PRINT, figure_of, render
from radarsim.scene.scene import Part

# Colour and legend text of each class of cells.
CELLS: Final = {
    CellClass.UNKNOWN: (NOT_SENSED, "not sensed"),
    CellClass.FREE: (PAPER, "free"),
    CellClass.OBSTACLE: (INK, "solid"),
    CellClass.FOLIAGE: (FAMILY_COLOURS[Family.FOLIAGE], "foliage"),
    CellClass.SMOKE: (FAMILY_COLOURS[Family.SMOKE], "smoke or dust"),
}
PATH: Final[dict[str, Any]] = {"color": GOING, "linewidth": 2.0}
SHADES: Final = np.array(
    [[round(255 * part) for part in to_rgb(colour)] for colour, _ in CELLS.values()],
    np.uint8,
)
_TRUTH: Final[dict[str, Any]] = {"color": TRUTH, "linewidth": 0.9}
_WIDEST, _TALLEST = 900, 760  # pixels; largest size of a panel
_LARGEST_CELL: Final = 6  # pixels; largest side of a cell
_MUCH: Final = 4.0  # times the sensed area; a larger scene is not shown whole
_LARGEST_SCENE: Final = 40.0  # m; longest side of a scene that a film shows whole
_FILM_EDGE: Final = 0.5  # m around the first extent of a film
_EDGE: Final = 0.2  # m around a scene
_MOST_NAMES: Final = 15  # most objects that are named; with more, none is
_LETTER: Final = 0.65  # width of a letter, relative to the height of the text
# Possible positions of the label around the start, best first: (right, up).
_SIDES: Final = ((0, 1), (0, -1), (-1, 0), (1, 0))
_ALIGNMENTS: Final = ("center", "left", "right")  # by side: 0, 1, -1
_LEVELS: Final = ("center", "bottom", "top")
_ASIDE: Final = 7.0  # points between the start and its label


@dataclass(frozen=True, slots=True)
class MapView:
    """A map with all that a plot of it shows.

    Attributes:
        grid: The map.
        path: Estimated poses of the robot, (N, 3): x and y in m, yaw in rad; N >= 1.
        robot_class: Class of the robot.
        title: Title of the plot.
        outlines: True outlines of the scene.
        subtitle: A second line below the title; empty for no such line.
        parts: Parts of the scene whose objects are named; empty for no names.
        height: Height of the sensor, at which objects are named, m, map frame.
    """

    grid: OccupancyGrid
    path: Floats
    robot_class: str
    title: str
    outlines: tuple[Outline, ...] = ()
    subtitle: str = ""
    parts: tuple[Part, ...] = ()
    height: float = 0.0

    @property
    def extent(self) -> Bbox:
        """Extent of the plot: the sensed cells, and a scene that is not too large."""
        sensed = extent_of(self.grid, sensed_window(self.grid))
        scene = outlines_extent(self.outlines)
        if scene is None:
            return sensed
        whole = Bbox.union([sensed, scene.padded(_EDGE)])
        fits = whole.width * whole.height <= _MUCH * sensed.width * sensed.height
        return whole if fits else sensed


class MapPanel:
    """A panel that shows a map, and can be updated while the map grows."""

    def __init__(self, axes: Axes, view: MapView, *, text: float = 10.0) -> None:
        """Draw all parts that do not change.

        Args:
            axes: The panel, m, map frame.
            view: The map, with the robot and the outlines of all later updates.
            text: Size of labels, points.
        """
        axes.set_facecolor(NOT_SENSED)  # background outside the map
        self._axes = axes
        self._robot_class = view.robot_class
        self._image = add_cell_image(axes, zorder=1)
        self._outlines = [
            axes.add_collection(LineCollection(outline.lines, **_TRUTH, zorder=2))
            for outline in view.outlines
        ]
        self._path = axes.add_line(Line2D([], [], **PATH, zorder=3))
        (self._start,) = axes.plot([], [], zorder=3, **START.options)
        self._label = axes.annotate(
            START.label,
            (0.0, 0.0),
            xytext=(0.0, 0.0),
            textcoords="offset points",
            fontsize=text,
            fontweight="bold",
            path_effects=[HALO],
            zorder=3,
        )
        self._robot: Sequence[Artist] = ()

    def update(self, grid: OccupancyGrid, path: Floats) -> None:
        """Show a map, and the path so far, as in ``MapView``."""
        window = sensed_window(grid)
        shades = SHADES[grid.classes()[window]]
        show_cells(self._image, shades, extent_of(grid, window))
        self._path.set_data(path[:, 0], path[:, 1])
        self._start.set_data(path[:1, 0], path[:1, 1])
        self._place_label(path[:, :2])
        for artist in self._robot:
            artist.remove()
        end = Pose2(*path[-1].tolist())
        self._robot = draw_robot(self._axes, self._robot_class, end, zorder=4)

    def _place_label(self, path: Floats) -> None:
        """Place the start's label on the side where it covers least of the path."""
        pixels = self._axes.transData.transform(path)
        points = (pixels - pixels[0]) * 72 / figure_of(self._axes).dpi
        high = float(self._label.get_fontsize())
        size = np.array([_LETTER * high * len(START.label), high])
        covered = [
            np.all(np.abs(points - (_ASIDE + size / 2) * side) < size / 2, axis=1).sum()
            for side in _SIDES
        ]
        right, up = _SIDES[int(np.argmin(covered))]
        self._label.xy = (float(path[0, 0]), float(path[0, 1]))
        self._label.xyann = (_ASIDE * right, _ASIDE * up)
        self._label.set(ha=_ALIGNMENTS[right], va=_LEVELS[up])

    @property
    def artists(self) -> list[Artist]:
        """All artists of the panel, in the order in which a film draws them."""
        marks = (self._path, self._start, self._label)
        return [self._image, *self._outlines, *marks, *self._robot]


def map_figure(
    views: Sequence[MapView], *, text: float = 10.0, numbers: bool = False
) -> Figure:
    """Draw several maps next to each other at one scale.

    Args:
        views: One map for each panel.
        text: Size of the text, points.
        numbers: Whether to write coordinates along the panels.
    """
    extent = Bbox.union([view.extent for view in views])
    scale = pixels_per_metre(extent, views[0].grid.frame.resolution)
    panels = Panels(extent, scale, *titles_of(views), text=text, numbers=numbers)
    for axes, view in zip(panels.axes, views, strict=True):
        panel = MapPanel(axes, view, text=text)
        panel.update(view.grid, view.path)
        name_objects(axes, view.parts, view.height, most=_MOST_NAMES)
    shown = {
        int(each)
        for view in views
        for each in np.unique(view.grid.classes()[sensed_window(view.grid)])
    }
    panels.add_legend(map_rows(shown, truth=any(view.outlines for view in views)))
    return panels.figure


def pixels_per_metre(extent: Bbox, resolution: float) -> float:
    """Return the scale of a panel, with whole pixels per cell if possible.

    Args:
        extent: Extent of the panel.
        resolution: Side of a cell, m.
    """
    room = min(_WIDEST / extent.width, _TALLEST / extent.height)
    # If a cell has more than a pixel, its number of pixels
    # is whole, so that all cells look equally wide.
    pixels = room * resolution
    return min(pixels if pixels < 1 else int(pixels), _LARGEST_CELL) / resolution


def map_rows(classes: Collection[int], *, truth: bool) -> list[Artist]:
    """Return the rows of a legend for some classes of cells and for the path.

    Args:
        classes: The classes.
        truth: Whether the true outlines are shown.
    """
    cells = [
        Patch(facecolor=CELLS[each][0], edgecolor="0.5", label=CELLS[each][1])
        for each in CellClass
        if each in classes
    ]
    path = Line2D([], [], **PATH, label="path")
    outline = Line2D([], [], **_TRUTH, label="true outlines")
    return [*cells, path, outline] if truth else [*cells, path]


def extent_of(grid: OccupancyGrid, window: tuple[slice, slice]) -> Bbox:
    """Return the extent of the given rows and columns of a map, m."""
    rows, columns = window
    corners = np.array([[columns.start, rows.start], [columns.stop, rows.stop]])
    return Bbox(corners * grid.frame.resolution + grid.frame.origin)


def first_map_extent(outlines: Sequence[Outline], grid: OccupancyGrid) -> Bbox:
    """Return the extent of a film's first frame: the scene, or else the map.

    Args:
        outlines: The outlines of the scene; empty if it is unknown.
        grid: The map with at least one scan, shown without such a scene.
    """
    scene = outlines_extent(outlines)
    # If the scene is larger than this, a cell would be less than a pixel wide.
    if scene is None or max(scene.width, scene.height) > _LARGEST_SCENE:
        scene = extent_of(grid, sensed_window(grid))
    return scene.padded(_FILM_EDGE)


class MapFrames:
    """Draws the frames of a film that shows a map.

    Attributes:
        figure: The figure with the last frame.
    """

    def __init__(self, first: MapView) -> None:
        """Draw all parts that do not change.

        Args:
            first: The map of the first frame; robot and outlines stay the same.
        """
        extent = first_map_extent(first.outlines, first.grid)
        scale = pixels_per_metre(extent, first.grid.frame.resolution)
        self._panels = Panels(extent, scale, [first.title], [""])
        self._panel = MapPanel(self._panels.axes[0], first)
        # These classes of cells may appear on the
        # map; without a scene, all classes may.
        kinds = {outline.kind for outline in first.outlines} or {*CellClass}
        shown = {*CellClass} - ({CellClass.FOLIAGE, CellClass.SMOKE} - kinds)
        self._panels.add_legend(map_rows(shown, truth=bool(first.outlines)))
        self.figure = self._panels.figure

    def draw(self, view: MapView) -> Pixels:
        """Draw a frame of the film, (H, W, 3)."""
        self._panel.update(view.grid, view.path)
        self._panels.show(extent_of(view.grid, sensed_window(view.grid)))
        return self._panels.render(self._panel.artists, view.title, view.subtitle)


def draw_area_curve(curve: AreaCurve, name: str, title: str, form: str) -> bytes:
    """Return a file with a plot of the known area, or its share, over time.

    The share of the reachable floor is drawn if it is known, otherwise the sensed area.

    Args:
        curve: The curve; it has a sample.
        name: Name of the curve in the legend.
        title: What is explored.
        form: One of ``radarsim.plotting.style.FORMS``.
    """
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.add_subplot()
    end, table = curve.samples[-1], np.array(curve.samples)
    shows_share = math.isfinite(end.reachable)
    axes.plot(
        table[:, 0],
        100 * table[:, 3] if shows_share else table[:, 2],
        color=GOING,
        linewidth=2.0,
        label=f"{name}: {end.path_length:.0f} m in {end.time:.0f} s",
    )
    if shows_share:
        for share in SHARES:
            axes.axhline(100 * share, color=QUIET, linewidth=0.6, linestyle=":")
    share_label = "known share of the floor within reach, %"
    axes.set_ylabel(share_label if shows_share else "sensed area, m²")
    axes.set_xlabel("time, s")
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.grid(visible=True, color="0.9")
    axes.legend(loc="lower right", fontsize=SMALL_PRINT + 1)
    axes.set_title(title, loc="left", fontsize=14, fontweight="bold", parse_math=False)
    return render(figure, form)
