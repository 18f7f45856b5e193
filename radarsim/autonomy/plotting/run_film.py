"""Frames of films of navigation runs."""

from collections.abc import Sequence
from typing import Final

from matplotlib.path import Path

from radarsim.autonomy.navigation.run_log import RunLog
from radarsim.autonomy.plotting.film import FrameCanvas, Pixels
from radarsim.autonomy.plotting.outlines import (
    Outline,
    area_rows,
    include_touched,
    outlines_extent,
)
from radarsim.autonomy.plotting.panels import Extent, Panels
from radarsim.autonomy.plotting.run_markers import HIT, LEAVE, marker_rows
from radarsim.autonomy.plotting.runs import (
    FOLLOWING,
    GOING,
    RETURNING,
    RunPanel,
    SteeringSensor,
    path_extent,
    path_rows,
    pixels_per_metre,
    run_rows,
)
from radarsim.geometry import Floats, Point

_AROUND: Final = 2.0  # m around start and goals that a film shows at first
_EDGE: Final = 0.7  # m around a scene whose walls keep the robot in
_OUTSIDE: Final = 2.0  # m around any other, for the robot to go round it
_LARGEST_SCENE: Final = 40.0  # m of a side of a scene that it shows whole
_MARGIN: Final = 0.4  # m around the path
_TEXT: Final = 10.0  # points


def first_extent(
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
    edge = _EDGE if _encloses(outlines, start) else _OUTSIDE
    return shown.union(scene.grown(edge))


def _encloses(outlines: Sequence[Outline], place: Point) -> bool:
    """Return whether a solid outline runs all around a place, m."""
    solid = [each for each in outlines if each.kind == "solid"]
    return any(
        Path(line).contains_point(place) for each in solid for line in each.lines
    )


class RunFrames:
    """Draws frames of one size; what they show grows with the run if it has to."""

    def __init__(
        self,
        extent: Extent,
        title: str,
        robot_class: str,
        sensor: SteeringSensor | None,
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
        self._panels = Panels(extent, pixels_per_metre(extent), [title], [""])
        axes = self._panels.axes[0]
        self._panel = RunPanel(axes, robot_class, sensor, outlines)
        (self._title,), (self._status,) = self._panels.titles, self._panels.subtitles
        paths = [GOING, FOLLOWING, RETURNING] if returns else [GOING, FOLLOWING]
        self._panels.add_legend(
            [
                *path_rows(paths, truth=bool(outlines)),
                *run_rows(sensor, outlines, sensed=True, truth=bool(outlines)),
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
        self._panels.show(path_extent(run_log, true_path).grown(_MARGIN))
        self._panel.update(run_log, true_path, text=_TEXT, is_over=False)
        self._status.set_text(status)
        return self._canvas.render(
            [*self._panel.artists, *self._panels.scale_bar, self._title, self._status]
        )
