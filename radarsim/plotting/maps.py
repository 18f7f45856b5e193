"""Pictures of maps: cells in UsarCommander's colours, the path and the robot on them.

``MapPanel`` draws a map that may grow: once for a picture, frame by frame for a film.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from radarsim.geometry import Floats, Pose2
from radarsim.mapping.export import (
    BLACK,
    BLUE,
    GREY,
    MARK,
    WHITE,
    commander_pixels,
    sensed_window,
)
from radarsim.mapping.occupancy_grid import SHORT_RANGE, OccupancyGrid
from radarsim.plotting.cell_image import CellImage
from radarsim.plotting.outlines import KINDS, Outline, outlines_extent
from radarsim.plotting.palette import (
    MAPPED_PATH,
    TRUE_FOLIAGE,
    TRUE_SMOKE,
    TRUE_SOLID,
)
from radarsim.plotting.panels import Extent, Panels, titles_of
from radarsim.plotting.rendering import render
from radarsim.plotting.robots import draw_robot

Shade: TypeAlias = tuple[int, int, int]  # RGB, 0 to 255

CELL_TEXTS: Final[dict[Shade, str]] = {
    BLUE: "no beam has been here",
    WHITE: "sensed from afar",
    GREY: f"sensed within {SHORT_RANGE:g} m",
    BLACK: "beams end here",
}
PATH_WIDTH: Final = 1.6  # points
OUTLINE_WIDTH: Final = 1.2  # points
OUTLINE_COLOURS: Final = {
    "foliage": TRUE_FOLIAGE,
    "solid": TRUE_SOLID,
    "cloud": TRUE_SMOKE,
}
OUTLINE_TEXTS: Final = {
    "foliage": "foliage, in truth",
    "solid": "solid things, in truth",
    "cloud": "smoke or dust, in truth",
}
_WIDEST, _TALLEST = 900, 760  # pixels of a panel, at most
_LARGEST_CELL: Final = 6  # pixels
_MUCH: Final = 4.0  # times the sensed area that a scene may have to be shown whole
_EDGE: Final = 0.2  # m around what is shown


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
    """

    grid: OccupancyGrid
    path: Floats
    robot_class: str
    title: str
    outlines: tuple[Outline, ...] = ()
    subtitle: str = ""

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
        self, axes: Axes, robot_class: str, outlines: Sequence[Outline] = ()
    ) -> None:
        """Draw what does not change.

        Args:
            axes: The panel, m, map frame.
            robot_class: Class of the robot.
            outlines: What is truly there.
        """
        axes.set_facecolor(_rgb(BLUE))  # beyond the map
        self._axes = axes
        self._robot_class = robot_class
        self._image = CellImage(axes, zorder=1)
        axes.add_artist(self._image)
        self._outlines = [
            axes.add_collection(
                LineCollection(
                    outline.lines,
                    colors=OUTLINE_COLOURS[outline.kind],
                    linewidths=OUTLINE_WIDTH,
                    zorder=2,
                )
            )
            for outline in outlines
        ]
        (self._path,) = axes.plot(
            [], [], color=MAPPED_PATH, linewidth=PATH_WIDTH, zorder=3
        )
        (self._start,) = axes.plot([], [], zorder=3, **_START_STYLE)
        self._robot: list[Artist] = []

    def update(self, grid: OccupancyGrid, path: Floats) -> None:
        """Show a map, and the path so far, (N, 3) as in ``MapView``."""
        window = sensed_window(grid)
        self._image.show(commander_pixels(grid)[window], extent_of(grid, window))
        self._path.set_data(path[:, 0], path[:, 1])
        self._start.set_data(path[:1, 0], path[:1, 1])
        for artist in self._robot:
            artist.remove()
        pose = Pose2(*path[-1].tolist())
        self._robot = [*draw_robot(self._axes, self._robot_class, pose, zorder=4)]

    @property
    def artists(self) -> list[Artist]:
        """Everything in the panel, by which a film draws a frame."""
        return [self._image, *self._outlines, self._path, self._start, *self._robot]


_START_STYLE: Final[dict[str, Any]] = {
    "color": MAPPED_PATH,
    "marker": "o",
    "markersize": 7,
    "markeredgecolor": "white",
    "linestyle": "none",
}


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
        MapPanel(axes, view.robot_class, view.outlines).update(view.grid, view.path)
    panels.add_legend(legend_rows(views))
    return panels.figure


def pixels_per_metre(extent: Extent, resolution: float) -> float:
    """Return the scale of a panel that fits a picture, in whole pixels a cell.

    Args:
        extent: What the panel shows.
        resolution: Side of a cell, m.
    """
    room = min(_WIDEST / extent.width, _TALLEST / extent.height)
    pixels = room * resolution
    return min(pixels if pixels < 1 else int(pixels), _LARGEST_CELL) / resolution


def legend_rows(views: Sequence[MapView]) -> list[Artist]:
    """Return the rows of a legend of all that some maps show."""
    shown: set[tuple[int, ...]] = set()
    for view in views:
        cells = commander_pixels(view.grid)[sensed_window(view.grid)]
        shown |= {
            tuple(each) for each in np.unique(cells.reshape(-1, 3), axis=0).tolist()
        }
    kinds = {outline.kind for view in views for outline in view.outlines}
    return [
        *cell_rows([shade for shade in CELL_TEXTS if shade in shown]),
        *path_rows(),
        *outline_rows([kind for kind in KINDS if kind in kinds]),
    ]


def cell_rows(shades: Iterable[Shade] = tuple(CELL_TEXTS)) -> list[Artist]:
    """Return the rows of a legend for colours of cells."""
    return [
        Patch(facecolor=_rgb(shade), edgecolor="0.5", label=CELL_TEXTS[shade])
        for shade in shades
    ]


def path_rows() -> list[Artist]:
    """Return the rows of a legend for the path and the start of the robot."""
    return [
        Line2D([], [], color=MAPPED_PATH, linewidth=PATH_WIDTH, label="path"),
        Line2D([], [], label="start", **_START_STYLE),
    ]


def outline_rows(kinds: Iterable[str]) -> list[Artist]:
    """Return the rows of a legend for outlines of some kinds."""
    return [
        Line2D([], [], color=OUTLINE_COLOURS[kind], label=OUTLINE_TEXTS[kind])
        for kind in kinds
    ]


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


def _rgb(shade: Shade) -> tuple[float, float, float]:
    red, green, blue = shade
    return red / 255, green / 255, blue / 255
