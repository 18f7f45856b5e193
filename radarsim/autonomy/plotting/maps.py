"""Pictures of maps: what each cell is, the path and the robot on them.

``MapPanel`` draws a map that may grow: once for a picture, frame by frame for a film.
"""

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

from radarsim.autonomy.mapping.export import MARK, sensed_window
from radarsim.autonomy.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.autonomy.plotting.cells import CellImage
from radarsim.autonomy.plotting.outlines import Outline, outlines_extent
from radarsim.autonomy.plotting.panels import Extent, Panels, titles_of
from radarsim.autonomy.plotting.run_markers import START
from radarsim.geometry import Floats, Pose2
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
from radarsim.plotting.style import (
    HALO,
    render,
)
from radarsim.scene.scene import Part

CELL_COLOURS: Final = {
    CellClass.UNKNOWN: NOT_SENSED,
    CellClass.FREE: PAPER,
    CellClass.OBSTACLE: INK,
    CellClass.FOLIAGE: FAMILY_COLOURS[Family.FOLIAGE],
    CellClass.SMOKE: FAMILY_COLOURS[Family.SMOKE],
}
CELL_TEXTS: Final = {
    CellClass.UNKNOWN: "not sensed",
    CellClass.FREE: "free",
    CellClass.OBSTACLE: "solid",
    CellClass.FOLIAGE: "foliage",
    CellClass.SMOKE: "smoke or dust",
}
PATH: Final[dict[str, Any]] = {"color": GOING, "linewidth": 2.0}
_SHADES: Final = np.array(
    [[round(255 * part) for part in to_rgb(CELL_COLOURS[each])] for each in CellClass],
    np.uint8,
)
_TRUTH: Final[dict[str, Any]] = {"color": TRUTH, "linewidth": 0.9}
_WIDEST, _TALLEST = 900, 760  # pixels of a panel, at most
_LARGEST_CELL: Final = 6  # pixels
_MUCH: Final = 4.0  # times the sensed area that a scene may have to be shown whole
_EDGE: Final = 0.2  # m around what is shown
_MOST_NAMES: Final = 15  # of objects; none are written if there are more
_LETTER: Final = 0.65  # width of a letter, in heights of the text
# Where the label of the start may be, the best first: horizontally and vertically.
_SIDES: Final = ((0, 1), (0, -1), (-1, 0), (1, 0))
_ALIGNMENTS: Final = ("center", "left", "right")  # by side: 0, 1, -1
_LEVELS: Final = ("center", "bottom", "top")
_ASIDE: Final = 7.0  # points from the start to its label


@dataclass(frozen=True, slots=True)
class MapView:
    """A map that is to be drawn.

    Attributes:
        grid: The map.
        path: Estimated poses of the robot, (N, 3): x and y in m, yaw in rad; N >= 1.
        robot_class: Class of the robot.
        title: Title, in words.
        outlines: What is truly there.
        subtitle: A further line; empty for none.
        parts: Parts of the scene whose objects are named; none for no names.
        height: Height at which the sensor cuts them, m, map frame.
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
    def extent(self) -> Extent:
        """Return what is to be shown: all that is sensed, and a scene that fits it."""
        sensed = extent_of(self.grid, sensed_window(self.grid))
        scene = outlines_extent(self.outlines)
        if scene is None:
            return sensed
        whole = sensed.union(scene.grown(_EDGE))
        fits = whole.width * whole.height <= _MUCH * sensed.width * sensed.height
        return whole if fits else sensed


class MapPanel:
    """A map in a panel, which can be updated while it grows."""

    def __init__(
        self,
        axes: Axes,
        robot_class: str,
        outlines: Sequence[Outline] = (),
        *,
        text: float = 10.0,
    ) -> None:
        """Draw what does not change.

        Args:
            axes: The panel, m, map frame.
            robot_class: Class of the robot.
            outlines: What is truly there.
            text: Size of labels, points.
        """
        axes.set_facecolor(NOT_SENSED)  # beyond the map
        self._axes = axes
        self._robot_class = robot_class
        self._image = CellImage(axes, zorder=1)
        axes.add_artist(self._image)
        self._outlines = [
            axes.add_collection(LineCollection(outline.lines, **_TRUTH, zorder=2))
            for outline in outlines
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
        """Show a map, and the path so far, (N, 3) as in ``MapView``."""
        window = sensed_window(grid)
        self._image.show(_SHADES[grid.classes()[window]], extent_of(grid, window))
        self._path.set_data(path[:, 0], path[:, 1])
        self._start.set_data(path[:1, 0], path[:1, 1])
        self._place_label(path[:, :2])
        for artist in self._robot:
            artist.remove()
        end = Pose2(*path[-1].tolist())
        self._robot = draw_robot(self._axes, self._robot_class, end, zorder=4)

    def _place_label(self, path: Floats) -> None:
        """Place the label of the start on a side where it covers little of the path."""
        figure = self._axes.get_figure(root=True)
        assert figure is not None
        pixels = self._axes.transData.transform(path)
        points = (pixels - pixels[0]) * 72 / figure.dpi
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
        """Everything in the panel, by which a film draws a frame."""
        marks = (self._path, self._start, self._label)
        return [self._image, *self._outlines, *marks, *self._robot]


def draw_map_view(view: MapView) -> bytes:
    """Draw a map with a scale, the path and a legend.

    Returns:
        Content of a PNG file; the same map gives the same bytes.
    """
    return render(map_figure([view], numbers=True), software=MARK)


def map_figure(
    views: Sequence[MapView], *, text: float = 10.0, numbers: bool = False
) -> Figure:
    """Draw maps beside each other, at one scale.

    Args:
        views: One map for each panel.
        text: Size of the text, points.
        numbers: Whether coordinates are written beside the panels.
    """
    extent = views[0].extent
    for view in views[1:]:
        extent = extent.union(view.extent)
    scale = pixels_per_metre(extent, views[0].grid.frame.resolution)
    panels = Panels(extent, scale, *titles_of(views), text=text, numbers=numbers)
    for axes, view in zip(panels.axes, views, strict=True):
        panel = MapPanel(axes, view.robot_class, view.outlines, text=text)
        panel.update(view.grid, view.path)
        name_objects(axes, view.parts, view.height, most=_MOST_NAMES)
    panels.add_legend(legend_rows(views))
    return panels.figure


def pixels_per_metre(extent: Extent, resolution: float) -> float:
    """Return the scale of a panel that fits a picture, in whole pixels a cell.

    Args:
        extent: What the panel shows.
        resolution: Side of a cell, m.
    """
    room = min(_WIDEST / extent.width, _TALLEST / extent.height)
    # whole pixels, unless cells are smaller: else some would look wider than others
    pixels = room * resolution
    return min(pixels if pixels < 1 else int(pixels), _LARGEST_CELL) / resolution


def legend_rows(views: Sequence[MapView]) -> list[Artist]:
    """Return the rows of a legend of all that some maps show."""
    shown: set[int] = set()
    for view in views:
        shown |= {*np.unique(view.grid.classes()[sensed_window(view.grid)]).tolist()}
    truth = any(view.outlines for view in views)
    classes = [each for each in CellClass if each in shown]
    return map_rows(classes, truth=truth)


def map_rows(classes: Collection[CellClass], *, truth: bool) -> list[Artist]:
    """Return the rows of a legend for some classes of cells and the path.

    Args:
        classes: The classes.
        truth: Whether outlines of what is truly there are shown.
    """
    cells = [
        Patch(facecolor=CELL_COLOURS[each], edgecolor="0.5", label=CELL_TEXTS[each])
        for each in classes
    ]
    path = Line2D([], [], **PATH, label="path")
    outline = Line2D([], [], **_TRUTH, label="what is truly there")
    return [*cells, path, outline] if truth else [*cells, path]


def extent_of(grid: OccupancyGrid, window: tuple[slice, slice]) -> Extent:
    """Return the extent of some rows and columns of a map."""
    rows, columns = window
    x, y = grid.frame.origin
    size = grid.frame.resolution
    return Extent(
        x + columns.start * size,
        y + rows.start * size,
        x + columns.stop * size,
        y + rows.stop * size,
    )
