"""Plots and films of navigation runs: paths and goals among obstacles.

``RunPanel`` draws a run that may continue: once for a plot, frame by frame for a film.
All frames of a film have one size; their extent grows if necessary.

Arrow heads along a path show the direction of motion.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.transforms import Affine2D, Bbox

from radarsim.autonomy.mapping.occupancy_grid import CellClass
from radarsim.autonomy.navigation.controller import Activity
from radarsim.autonomy.navigation.run_log import RunLog
from radarsim.autonomy.plotting.outlines import (
    Outline,
    area_rows,
    box_around,
    draw_areas,
    include_touched,
    outlines_extent,
)
from radarsim.autonomy.plotting.panels import Panels, titles_of
from radarsim.autonomy.plotting.run_markers import (
    HIT,
    LEAVE,
    MarkerStyle,
    SensedCells,
    draw_markers,
    marker_places,
    marker_rows,
    sensed_rows,
)
from radarsim.geometry import Floats, Point, Pose2
from radarsim.plotting import palette
from radarsim.plotting.film import Pixels
from radarsim.plotting.palette import MARKER, PAPER
from radarsim.plotting.plan import draw_robot

_HEAD: Final = Path(
    np.array([(1.0, 0.0), (-0.8, 0.8), (-0.3, 0.0), (-0.8, -0.8), (1.0, 0.0)]),
    closed=True,
)
_SIZE: Final = 11.0  # points; size of an arrow head
_EVERY: Final = 0.25  # of the width of the panel between two arrow heads
_AROUND: Final = 0.15  # m of the path before and after, for the direction
AROUND: Final = 3.0  # m around the path that are shown
NO_PATH: Final[Floats] = np.zeros((0, 2))
ROBOT_OPACITY: Final = 0.6  # keeps markers on the robot visible
_MARGIN: Final = 0.6  # m around the shown paths and beam ends
_WIDEST, _TALLEST = 900, 640  # pixels; largest size of a panel
_CLOSEST: Final = 160.0  # pixels per metre; largest scale
_LARGEST_SCENE: Final = 40.0  # m; longest side of a scene that a film shows whole
_AROUND_START: Final = 2.0  # m around start and goals in the first extent of a film
_EDGE: Final = 0.7  # m around a scene with walls around the robot
_OUTSIDE: Final = 2.0  # m around any other scene, for paths around it
_FILM_MARGIN: Final = 0.4  # m around the path
_GOAL_LINE: Final[dict[str, Any]] = {
    "color": "0.3",
    "linestyle": "--",
    "linewidth": 1.0,
}
_TRUE_PATH: Final[dict[str, Any]] = {
    "color": palette.TRUTH,
    "linestyle": (0, (1.0, 1.6)),
    "linewidth": 1.1,
}


def arrow_places(path: Floats, spacing: float) -> Floats:
    """Return positions and directions of the arrow heads along a path.

    Args:
        path: The path, (N, 2) m.
        spacing: Path length between two arrow heads, m; half of it before the first.

    Returns:
        x and y in m, and the direction in rad from the x axis, (M, 3).
    """
    if len(path) < 2:
        return np.zeros((0, 3))
    steps = np.hypot(*np.diff(path, axis=0).T)
    along = np.concatenate([np.zeros(1), np.cumsum(steps)])
    places = np.arange(spacing / 2, along[-1], spacing)

    def at(lengths: Floats) -> Floats:
        return np.column_stack([np.interp(lengths, along, axis) for axis in path.T])

    # The direction is averaged over several steps of the path, since one step is noisy.
    x, y = (at(places + _AROUND) - at(places - _AROUND)).T
    return np.column_stack([at(places), np.arctan2(y, x)])


def draw_arrows(axes: Axes, path: Floats, zorder: float) -> list[Artist]:
    """Draw arrow heads at equal distances along a path, (N, 2) m."""
    drawn: list[Artist] = []
    for x, y, direction in arrow_places(path, _EVERY * axes.viewLim.width).tolist():
        drawn += axes.plot(
            x,
            y,
            marker=_HEAD.transformed(Affine2D().rotate(direction)),
            markersize=_SIZE,
            markerfacecolor=MARKER,
            markeredgecolor=PAPER,
            markeredgewidth=0.7,
            zorder=zorder,
        )
    return drawn


@dataclass(frozen=True, slots=True)
class PathStyle:
    """How the estimated path is drawn during one activity of the robot."""

    text: str
    colour: str
    width: float
    zorder: float


GOING: Final = PathStyle("going to the goal", palette.GOING, 3.0, 4.0)
FOLLOWING: Final = PathStyle("following a boundary", palette.FOLLOWING, 3.4, 3.0)
RETURNING: Final = PathStyle(
    "returning to the leave point", palette.RETURNING, 2.2, 3.5
)
PATH_STYLES: Final = (GOING, FOLLOWING, RETURNING)
_STYLE_OF: Final = {
    Activity.ALIGNING: FOLLOWING,
    Activity.FOLLOWING: FOLLOWING,
    Activity.RETURNING: RETURNING,
}


def _sensor_colour(medium: str) -> str:
    return palette.sensor_colour(medium) if medium else palette.UNKNOWN_SENSOR


@dataclass(frozen=True, slots=True)
class RunView:
    """A navigation run with all that a plot of it shows.

    Attributes:
        run_log: The run, with at least one row.
        title: Title of the plot.
        robot_class: Class of the robot.
        medium: Type of the sensor, ``radar`` or ``laser``; empty if unknown.
        outlines: True outlines of the scene, if it is known.
        subtitle: A second line below the title; empty for no such line.
        true_path: True path of the robot, (N, 2) m; empty if unknown.
    """

    run_log: RunLog
    title: str
    robot_class: str
    medium: str = ""
    outlines: tuple[Outline, ...] = ()
    subtitle: str = ""
    true_path: Floats = field(default_factory=lambda: NO_PATH)

    @property
    def paths(self) -> Bbox:
        """Extent of the paths and the goals, m."""
        log = self.run_log
        ends = np.array([end for leg in log.legs for end in (leg.start, leg.goal)])
        points = [log.path, ends.reshape(-1, 2), self.true_path]
        return box_around(np.concatenate(points))

    @property
    def extent(self) -> Bbox:
        """Extent of the plot: paths, goals, near beam ends, and whole objects."""
        shown, around = self.paths, self.paths.padded(AROUND)
        beam_ends = self.run_log.beam_ends[:, :2]
        # Distant beam ends are excluded, since the run would otherwise appear tiny.
        near = ((beam_ends >= around.min) & (beam_ends <= around.max)).all(axis=1)
        if near.any():
            shown = Bbox.union([shown, box_around(beam_ends[near])])
        return include_touched(shown.padded(_MARGIN), self.outlines)


class RunPanel:
    """A panel that shows a run, and can be updated while the run continues."""

    def __init__(self, axes: Axes, view: RunView) -> None:
        """Draw all parts that do not change.

        Args:
            axes: The panel, m, map frame.
            view: The run, with the robot, sensor and outlines of all later updates.
        """
        self._axes = axes
        self._robot_class = view.robot_class
        self._areas = draw_areas(axes, view.outlines)
        colour = _sensor_colour(view.medium)
        self._sensed = SensedCells(axes, colour, view.outlines)
        self._moving: list[Artist] = []

    def update(
        self, view: RunView, *, text: float = 10.0, is_over: bool = True
    ) -> None:
        """Show the current state of a run.

        Args:
            view: The run.
            text: Size of labels, points.
            is_over: Whether the run has ended, so that an unreached goal is missed.
        """
        for artist in self._moving:
            artist.remove()
        axes, run_log, true_path = self._axes, view.run_log, view.true_path
        self._sensed.update(run_log)
        self._moving = []
        for leg in run_log.legs:
            ends = np.array([leg.start, leg.goal])
            self._moving += axes.plot(*ends.T, **_GOAL_LINE, zorder=2.8)
        for lines in _path_lines(run_log):
            axes.add_collection(lines, autolim=False)
            self._moving.append(lines)
        if len(true_path):
            self._moving += axes.plot(*true_path.T, **_TRUE_PATH, zorder=4.5)
        self._moving += draw_arrows(axes, run_log.path, zorder=4.7)
        last = run_log.rows[-1]
        x, y = true_path[-1].tolist() if len(true_path) else (last.x, last.y)
        robot = draw_robot(axes, self._robot_class, Pose2(x, y, last.yaw), zorder=6.0)
        for patch in robot:
            patch.set_alpha(ROBOT_OPACITY)
        self._moving += robot
        self._moving += draw_markers(axes, run_log, text=text, is_over=is_over)

    @property
    def artists(self) -> list[Artist]:
        """All artists of the panel, in the order in which a film draws them."""
        return [*self._areas, *self._sensed.artists, *self._moving]


def run_figure(
    views: Sequence[RunView], *, text: float = 10.0, numbers: bool = False
) -> Figure:
    """Draw several runs side by side at one scale.

    Args:
        views: One run for each panel.
        text: Size of the text, points.
        numbers: Whether to write coordinates along the panels.
    """
    extent = Bbox.union([view.extent for view in views])
    scale = pixels_per_metre(extent)
    panels = Panels(extent, scale, *titles_of(views), text=text, numbers=numbers)
    for axes, view in zip(panels.axes, views, strict=True):
        RunPanel(axes, view).update(view, text=text)
    panels.add_legend(
        _legend_rows(
            {style for view in views for style in _styles(view.run_log)},
            views[0].medium,
            [outline for view in views for outline in view.outlines],
            {style for view in views for style in marker_places(view.run_log)},
            sensed=any(len(view.run_log.beam_ends) for view in views),
            truth=any(len(view.true_path) for view in views),
        )
    )
    return panels.figure


def pixels_per_metre(extent: Bbox) -> float:
    """Return the largest scale at which an extent fits a panel."""
    return min(_WIDEST / extent.width, _TALLEST / extent.height, _CLOSEST)


def _legend_rows(
    styles: Collection[PathStyle],
    medium: str,
    outlines: Sequence[Outline],
    markers: Collection[MarkerStyle],
    *,
    sensed: bool = True,
    truth: bool,
) -> list[Artist]:
    """Return the rows of the legend for a navigation run.

    Args:
        styles: Styles of the estimated path.
        medium: Type of the sensor, as in ``RunView``.
        outlines: True outlines of the scene.
        markers: Styles of markers.
        sensed: Whether any beam end is drawn.
        truth: Whether the true path is drawn in addition to the estimated one.
    """
    whose = "estimate, " if truth else ""
    rows: list[Artist] = [
        Line2D([], [], color=each.colour, linewidth=each.width, label=whose + each.text)
        for each in PATH_STYLES
        if each in styles
    ]
    if truth:
        rows.append(Line2D([], [], **_TRUE_PATH, label="true path, to the robot"))
    rows.append(Line2D([], [], **_GOAL_LINE, label="line to the goal"))
    if sensed:
        by = f" by the {medium}" if medium else ""
        rows += sensed_rows(_sensor_colour(medium), by, outlines)
    return [*rows, *area_rows(outlines), *marker_rows(markers)]


def _styles(run_log: RunLog) -> list[PathStyle]:
    """Return the line style of each step from one row of the log to the next."""
    return [_STYLE_OF.get(row.activity, GOING) for row in run_log.rows[:-1]]


def _path_lines(run_log: RunLog) -> list[LineCollection]:
    path, styles = run_log.path, _styles(run_log)
    steps = np.stack([path[:-1], path[1:]], axis=1)
    drawn = []
    for style in PATH_STYLES:
        chosen = np.array([one is style for one in styles], dtype=np.bool_)
        if chosen.any():
            # Consecutive steps are joined, so that lines have no gaps.
            mine = steps[chosen]
            breaks = np.nonzero((mine[1:, 0] != mine[:-1, 1]).any(axis=1))[0] + 1
            lines = LineCollection(
                [
                    np.concatenate([chain[:1, 0], chain[:, 1]])
                    for chain in np.split(mine, breaks)
                ],
                colors=style.colour,
                linewidths=style.width,
                zorder=style.zorder,
            )
            drawn.append(lines)
    return drawn


def first_run_extent(
    outlines: Sequence[Outline], start: Point, goals: Sequence[Point]
) -> Bbox:
    """Return a film's extent: start, goals, and the scene unless it is too large.

    Robots hardly ever leave this extent.

    Args:
        outlines: The outlines of the scene; empty if it is unknown.
        start: Start of the robot, m.
        goals: All goals, m.
    """
    shown = box_around(np.array([start, *goals])).padded(_AROUND_START)
    scene = outlines_extent(outlines)
    if scene is None:
        return shown
    if max(scene.width, scene.height) > _LARGEST_SCENE:
        return include_touched(shown.padded(_AROUND_START), outlines)
    walls = [
        line
        for each in outlines
        if each.kind == CellClass.OBSTACLE
        for line in each.lines
    ]
    is_enclosed = any(Path(line).contains_point(start) for line in walls)
    return Bbox.union([shown, scene.padded(_EDGE if is_enclosed else _OUTSIDE)])


class RunFrames:
    """Draws the frames of a film of a navigation run.

    Attributes:
        axes: The panel.
    """

    def __init__(self, extent: Bbox, first: RunView, *, returns: bool = True) -> None:
        """Draw all parts that do not change.

        Args:
            extent: Extent of the first frame.
            first: The run of the first frame; robot, sensor and outlines stay the same.
            returns: Whether the robot may return to a leave point.
        """
        self._panels = Panels(extent, pixels_per_metre(extent), [first.title], [""])
        self.axes = self._panels.axes[0]
        self._panel = RunPanel(self.axes, first)
        styles, outlines = PATH_STYLES[: 2 + returns], first.outlines
        # The legend of a film does not change, so
        # it contains all rows that may be needed.
        rows = _legend_rows(
            styles, first.medium, outlines, [HIT, LEAVE], truth=bool(outlines)
        )
        self._panels.add_legend(rows)

    def draw(self, view: RunView) -> Pixels:
        """Draw a frame of the film, (H, W, 3)."""
        self._panels.show(view.paths.padded(_FILM_MARGIN))
        self._panel.update(view, is_over=False)
        return self._panels.render(self._panel.artists, view.title, view.subtitle)
