"""Pictures of navigation runs: the estimated and the true path among obstacles.

``RunPanel`` draws a run that may go on: once for a picture, frame by frame for a film.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from radarsim.geometry import Floats, Pose2
from radarsim.navigation.bug import Activity
from radarsim.navigation.run_log import CELL, RunLog
from radarsim.plotting import palette
from radarsim.plotting.outlines import Outline, area_rows, draw_areas
from radarsim.plotting.panels import Extent, Panels, titles_of
from radarsim.plotting.rendering import render
from radarsim.plotting.robots import draw_robot
from radarsim.plotting.run_markers import (
    STYLES,
    draw_markers,
    marker_places,
    marker_rows,
)

AROUND: Final = 3.0  # m around the path that are shown
NO_PATH: Final[Floats] = np.zeros((0, 2))
FAINTEST: Final = 0.2  # opacity of dots where one beam ended
_MARGIN: Final = 0.6  # m
_DOT: Final = 0.85  # diameter of a dot, in sides of the cell that it stands for
_WIDEST, _TALLEST = 900, 640  # pixels of a panel, at most
_CLOSEST: Final = 160.0  # pixels per metre, at most


@dataclass(frozen=True, slots=True)
class PathStyle:
    """Line style of the estimated path during an activity."""

    text: str
    colour: str
    width: float
    zorder: float


GOING: Final = PathStyle("going to the goal", palette.GOING, 2.2, 4.0)
FOLLOWING: Final = PathStyle("following a boundary", palette.FOLLOWING, 2.8, 3.0)
RETURNING: Final = PathStyle(
    "returning to the leave point", palette.RETURNING, 1.4, 3.5
)
PATH_STYLES: Final = {
    Activity.ALIGNING: FOLLOWING,
    Activity.FOLLOWING: FOLLOWING,
    Activity.RETURNING: RETURNING,
}


@dataclass(frozen=True, slots=True)
class SteeringSensor:
    """The sensor that a robot steers by: name of the preset, and its medium."""

    name: str
    medium: str


def _sensor_colour(sensor: SteeringSensor | None) -> str:
    if sensor is None:
        return palette.UNKNOWN_SENSOR
    return palette.sensor_colour(sensor.name, sensor.medium)


@dataclass(frozen=True, slots=True)
class RunView:
    """A run that is to be drawn.

    Attributes:
        run_log: The run; at least one row.
        title: Title, in words.
        robot_class: Class of the robot.
        sensor: The sensor that it steers by; None if that is unknown.
        outlines: What is truly there, if it is known.
        subtitle: A further line; empty for none.
        true_path: Path that it truly drove, (N, 2) m; none if it is unknown.
    """

    run_log: RunLog
    title: str
    robot_class: str
    sensor: SteeringSensor | None = None
    outlines: tuple[Outline, ...] = ()
    subtitle: str = ""
    true_path: Floats = field(default_factory=lambda: NO_PATH)

    @property
    def extent(self) -> Extent:
        """What is to be shown: the paths, the goals, and beam ends near them."""
        return run_extent(self.run_log, self.true_path)


def run_extent(run_log: RunLog, true_path: Floats = NO_PATH) -> Extent:
    """Return the extent of a run: its paths and goals, and beam ends near them."""
    ends = [end for line in run_log.goal_lines for end in (line.start, line.goal)]
    path = np.concatenate([run_log.path, np.array(ends).reshape(-1, 2), true_path])
    low, high = path.min(axis=0) - AROUND, path.max(axis=0) + AROUND
    beam_ends = run_log.beam_ends[:, :2]
    near = ((beam_ends >= low) & (beam_ends <= high)).all(axis=1)
    shown = np.concatenate([path, beam_ends[near]])
    corners = (*shown.min(axis=0).tolist(), *shown.max(axis=0).tolist())
    return Extent(*corners).grown(_MARGIN)


class RunPanel:
    """A run in a panel, which can be updated while it goes on."""

    def __init__(
        self, axes: Axes, robot_class: str, sensor: SteeringSensor | None
    ) -> None:
        self._axes = axes
        self._robot_class = robot_class
        self._colour = to_rgb(_sensor_colour(sensor))
        self._moving: list[Artist] = []

    def update(self, run_log: RunLog, true_path: Floats, *, text: float) -> None:
        """Show a run as it is.

        Args:
            run_log: The run; at least one row.
            true_path: Path that the robot truly drove, (N, 2) m.
            text: Size of labels, points.
        """
        for artist in self._moving:
            artist.remove()
        axes = self._axes
        self._moving = [_draw_sensed(axes, run_log, self._colour)]
        for line in run_log.goal_lines:
            ends = np.array([line.start, line.goal])
            self._moving += axes.plot(*ends.T, **_GOAL_LINE, zorder=2.0)
        for lines in _path_lines(run_log):
            axes.add_collection(lines, autolim=False)
            self._moving.append(lines)
        if len(true_path):
            self._moving += axes.plot(*true_path.T, **_TRUE_PATH, zorder=4.5)
        last = run_log.rows[-1]
        x, y = true_path[-1].tolist() if len(true_path) else (last.x, last.y)
        others = {*axes.patches}
        draw_robot(axes, self._robot_class, Pose2(x, y, last.yaw), zorder=6.0)
        self._moving += [each for each in axes.patches if each not in others]
        self._moving += draw_markers(axes, run_log, text=text)

    @property
    def artists(self) -> list[Artist]:
        """Everything that ``update`` has drawn."""
        return self._moving


_GOAL_LINE: Final[dict[str, Any]] = {
    "color": "0.3",
    "linestyle": "--",
    "linewidth": 1.0,
}
_TRUE_PATH: Final[dict[str, Any]] = {"color": palette.TRUE_PATH, "linewidth": 0.9}


def draw_run(view: RunView, *, form: str = "png") -> bytes:
    """Draw a run into a file of a form; equal runs give equal bytes."""
    return render(run_figure([view], numbers=True), form)


def run_figure(
    views: Sequence[RunView], *, text: float = 10.0, numbers: bool = False
) -> Figure:
    """Draw runs beside each other, at one scale.

    Args:
        views: One run for each panel.
        text: Size of the text, points.
        numbers: Whether coordinates are written beside the panels.
    """
    extent = views[0].extent
    for view in views[1:]:
        extent = extent.union(view.extent)
    scale = pixels_per_metre(extent)
    panels = Panels(extent, scale, *titles_of(views), text=text, numbers=numbers)
    for axes, view in zip(panels.axes, views, strict=True):
        draw_areas(axes, view.outlines)
        panel = RunPanel(axes, view.robot_class, view.sensor)
        panel.update(view.run_log, view.true_path, text=text)
    panels.add_legend(_legend_rows(views))
    return panels.figure


def pixels_per_metre(extent: Extent) -> float:
    """Return the scale of a panel that fits a picture."""
    return min(_WIDEST / extent.width, _TALLEST / extent.height, _CLOSEST)


def _legend_rows(views: Sequence[RunView]) -> list[Artist]:
    """Return the rows of a legend of all that some runs show."""
    styles = {style for view in views for style in _styles(view.run_log)}
    markers = {style for view in views for style in marker_places(view.run_log)}
    return [
        *path_rows(
            [style for style in (GOING, FOLLOWING, RETURNING) if style in styles]
        ),
        *run_rows(views[0].sensor, truth=any(len(view.true_path) for view in views)),
        *area_rows(views[0].outlines),
        *marker_rows([style for style in STYLES if style in markers]),
    ]


def path_rows(styles: Collection[PathStyle]) -> list[Artist]:
    """Return the rows of a legend for paths of some styles."""
    return [
        Line2D([], [], color=style.colour, linewidth=style.width, label=style.text)
        for style in styles
    ]


def run_rows(sensor: SteeringSensor | None, *, truth: bool) -> list[Artist]:
    """Return the rows of a legend for the true path, goal lines and what is sensed."""
    by = "" if sensor is None else f" by the {sensor.medium}"
    dot: dict[str, Any] = {
        "color": _sensor_colour(sensor),
        "marker": ".",
        "linestyle": "none",
    }
    rows: list[Artist] = [
        Line2D([], [], **dot, label=f"sensed{by}"),
        Line2D([], [], **_GOAL_LINE, label="line to the goal"),
    ]
    return [Line2D([], [], **_TRUE_PATH, label="true path"), *rows] if truth else rows


def _draw_sensed(
    axes: Axes, run_log: RunLog, colour: tuple[float, float, float]
) -> Artist:
    """Draw dots where beams ended, the more opaque the more often they did."""
    x, y, counts = run_log.beam_ends.T
    often = np.log1p(counts) / np.log1p(counts.max(initial=1.0))
    shades = np.tile((*colour, 1.0), (len(counts), 1))
    shades[:, 3] = FAINTEST + (1 - FAINTEST) * often
    points_per_metre = axes.bbox.width / axes.viewLim.width * 72 / axes.figure.dpi
    size = (_DOT * CELL * points_per_metre) ** 2
    return axes.scatter(x, y, size, shades, linewidths=0.0, zorder=2.5)


def _styles(run_log: RunLog) -> list[PathStyle]:
    """Return the style of the step from each row to the next."""
    return [PATH_STYLES.get(row.activity, GOING) for row in run_log.rows[:-1]]


def _path_lines(run_log: RunLog) -> list[LineCollection]:
    """Return the estimated path, coloured by activity."""
    path, styles = run_log.path, _styles(run_log)
    steps = np.stack([path[:-1], path[1:]], axis=1)
    drawn = []
    for style in (GOING, FOLLOWING, RETURNING):
        chosen = np.array([one is style for one in styles], dtype=np.bool_)
        if chosen.any():
            lines = LineCollection(
                _chains(steps[chosen]),
                colors=style.colour,
                linewidths=style.width,
                zorder=style.zorder,
            )
            drawn.append(lines)
    return drawn


def _chains(steps: Floats) -> list[Floats]:
    """Join consecutive steps, (S, 2, 2), so that lines have no gaps."""
    breaks = np.nonzero((steps[1:, 0] != steps[:-1, 1]).any(axis=1))[0] + 1
    return [
        np.concatenate([chain[:1, 0], chain[:, 1]]) for chain in np.split(steps, breaks)
    ]
