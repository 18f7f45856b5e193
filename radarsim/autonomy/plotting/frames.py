"""Frames of films: of navigation runs, and of maps that grow.

All frames of a film have one size; what they show grows if it has to.
"""

from collections.abc import Sequence
from typing import Final

from matplotlib.path import Path

from radarsim.autonomy.mapping.export import sensed_window
from radarsim.autonomy.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.autonomy.navigation.run_log import RunLog
from radarsim.autonomy.plotting import maps, runs
from radarsim.autonomy.plotting.outlines import (
    Outline,
    area_rows,
    include_touched,
    outlines_extent,
)
from radarsim.autonomy.plotting.panels import Extent, Panels
from radarsim.autonomy.plotting.run_markers import HIT, LEAVE, marker_rows
from radarsim.geometry import Floats, Point
from radarsim.plotting.film import FrameCanvas, Pixels

_LARGEST_SCENE: Final = 40.0  # m of a side of a scene that is shown whole
_AROUND: Final = 2.0  # m around start and goals that are shown at first
_EDGE: Final = 0.7  # m around a scene whose walls keep the robot in
_OUTSIDE: Final = 2.0  # m around any other, for the robot to go round it
_MARGIN: Final = 0.4  # m around the path
_MAP_EDGE: Final = 0.5  # m around a scene that is mapped, or what is sensed of it
_TEXT: Final = 10.0  # points


def first_run_extent(
    outlines: Sequence[Outline], start: Point, goals: Sequence[Point]
) -> Extent:
    """Return what a film shows: start, goals, and all of a scene that is not too large.

    A robot that goes round anything in it hardly ever leaves this.

    Args:
        outlines: The scene; none if it is unknown.
        start: Start of the robot, m.
        goals: All goals, m.
    """
    shown = Extent(*start, *start)
    for goal in goals:
        shown = shown.union(Extent(*goal, *goal))
    shown = shown.grown(_AROUND)
    scene = outlines_extent(outlines)
    if scene is None:
        return shown
    if max(scene.width, scene.height) > _LARGEST_SCENE:
        return include_touched(shown.grown(_AROUND), outlines)
    walls = [line for each in outlines if each.kind == "solid" for line in each.lines]
    is_enclosed = any(Path(line).contains_point(start) for line in walls)
    return shown.union(scene.grown(_EDGE if is_enclosed else _OUTSIDE))


def first_map_extent(outlines: Sequence[Outline], grid: OccupancyGrid) -> Extent:
    """Return what a film shows at first: a scene that is known and not too large.

    Args:
        outlines: The scene; none if it is unknown.
        grid: The map, which is shown otherwise; at least one scan.
    """
    scene = outlines_extent(outlines)
    # A cell of a scene that is larger would be less than a pixel wide.
    if scene is None or max(scene.width, scene.height) > _LARGEST_SCENE:
        scene = maps.extent_of(grid, sensed_window(grid))
    return scene.grown(_MAP_EDGE)


class RunFrames:
    """Draws frames of a navigation run."""

    def __init__(
        self,
        extent: Extent,
        title: str,
        robot_class: str,
        sensor: runs.SteeringSensor | None,
        outlines: Sequence[Outline] = (),
        *,
        returns: bool = True,
    ) -> None:
        """Draw what does not change.

        Args:
            extent: What is shown at first.
            title: Title, in words, one line.
            robot_class: Class of the robot.
            sensor: The sensor that it steers by, as in ``RunView``.
            outlines: What is truly there.
            returns: Whether the robot may return to a leave point.
        """
        self._panels = Panels(extent, runs.pixels_per_metre(extent), [title], [""])
        axes = self._panels.axes[0]
        self._panel = runs.RunPanel(axes, robot_class, sensor, outlines)
        (self._title,), (self._status,) = self._panels.titles, self._panels.subtitles
        styles = [runs.GOING, runs.FOLLOWING, runs.RETURNING][: 2 + returns]
        truth = bool(outlines)
        # all that may come: the legend of a film does not change
        self._panels.add_legend(
            [
                *runs.path_rows(styles, truth=truth),
                *runs.run_rows(sensor, outlines, sensed=True, truth=truth),
                *area_rows(outlines),
                *marker_rows([HIT, LEAVE]),
            ]
        )
        self._canvas = FrameCanvas(self._panels.figure)

    @property
    def extent(self) -> Extent:
        """What the frames show now, m."""
        return self._panels.extent

    def draw(
        self, run_log: RunLog, true_path: Floats, status: str, title: str = ""
    ) -> Pixels:
        """Draw a frame, (H, W, 3).

        Args:
            run_log: The run; at least one row.
            true_path: Path that the robot truly drove, (N, 2) m.
            status: The second line of the title.
            title: Another title from now on; empty to keep the one that is there.
        """
        if title:
            self._title.set_text(title)
        self._panels.show(runs.path_extent(run_log, true_path).grown(_MARGIN))
        self._panel.update(run_log, true_path, text=_TEXT, is_over=False)
        self._status.set_text(status)
        return self._canvas.render(
            [*self._panel.artists, *self._panels.scale_bar, self._title, self._status]
        )


class MapFrames:
    """Draws frames of a map.

    Attributes:
        figure: The figure, as it was drawn last.
    """

    def __init__(
        self,
        extent: Extent,
        resolution: float,
        title: str,
        robot_class: str,
        outlines: Sequence[Outline] = (),
    ) -> None:
        """Draw what does not change.

        Args:
            extent: What is shown at first.
            resolution: Side of a cell, m.
            title: Title, in words, one line.
            robot_class: Class of the robot.
            outlines: What is truly there.
        """
        scale = maps.pixels_per_metre(extent, resolution)
        self._panels = Panels(extent, scale, [title], [""])
        self._panel = maps.MapPanel(self._panels.axes[0], robot_class, outlines)
        (self._status,) = self._panels.subtitles
        # what cells may come to be: anything, if the scene is unknown
        by_kind = {"foliage": CellClass.FOLIAGE, "cloud": CellClass.SMOKE}
        kinds = {outline.kind for outline in outlines} or by_kind.keys()
        absent = {each for kind, each in by_kind.items() if kind not in kinds}
        classes = [each for each in CellClass if each not in absent]
        self._panels.add_legend(maps.map_rows(classes, truth=bool(outlines)))
        self.figure = self._panels.figure
        self._canvas = FrameCanvas(self.figure)

    def draw(self, grid: OccupancyGrid, path: Floats, status: str) -> Pixels:
        """Draw a frame, (H, W, 3).

        Args:
            grid: The map.
            path: Estimated poses of the robot, (N, 3): x and y in m, yaw in rad.
            status: The second line of the title.
        """
        self._panel.update(grid, path)
        self._panels.show(maps.extent_of(grid, sensed_window(grid)))
        self._status.set_text(status)
        return self._canvas.render(
            [*self._panel.artists, *self._panels.scale_bar, self._status]
        )
