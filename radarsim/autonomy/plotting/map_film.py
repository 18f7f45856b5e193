"""Frames of films of maps that grow."""

from collections.abc import Sequence
from typing import Final

from radarsim.autonomy.mapping.export import sensed_window
from radarsim.autonomy.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.autonomy.plotting.film import FrameCanvas, Pixels
from radarsim.autonomy.plotting.maps import (
    MapPanel,
    extent_of,
    map_rows,
    pixels_per_metre,
)
from radarsim.autonomy.plotting.outlines import Outline, outlines_extent
from radarsim.autonomy.plotting.panels import Extent, Panels
from radarsim.geometry import Floats

_EDGE: Final = 0.5  # m around a scene, or around what is sensed of it
_LARGEST_SCENE: Final = 40.0  # m of a side of a scene that it shows whole


def first_extent(outlines: Sequence[Outline], grid: OccupancyGrid) -> Extent:
    """Return what a film shows at first: a scene that is known and not too large.

    Args:
        outlines: The scene; none if it is unknown.
        grid: The map, which is shown otherwise; at least one scan.
    """
    scene = outlines_extent(outlines)
    if scene is None or max(scene.width, scene.height) > _LARGEST_SCENE:
        return extent_of(grid, sensed_window(grid)).grown(_EDGE)
    return scene.grown(_EDGE)


class MapFrames:
    """Draws frames of one size; what they show grows with the map if it has to.

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
        scale = pixels_per_metre(extent, resolution)
        self._panels = Panels(extent, scale, [title], [""])
        self._panel = MapPanel(self._panels.axes[0], robot_class, outlines)
        (self._status,) = self._panels.subtitles
        self._panels.add_legend(map_rows(_classes(outlines), truth=bool(outlines)))
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
        self._panels.show(extent_of(grid, sensed_window(grid)))
        self._status.set_text(status)
        return self._canvas.render(
            [*self._panel.artists, *self._panels.scale_bar, self._status]
        )


def _classes(outlines: Sequence[Outline]) -> list[CellClass]:
    """Return what cells may come to be: anything, if the scene is unknown."""
    by_kind = {"foliage": CellClass.FOLIAGE, "cloud": CellClass.SMOKE}
    kinds = {outline.kind for outline in outlines} or by_kind.keys()
    absent = {each for kind, each in by_kind.items() if kind not in kinds}
    return [each for each in CellClass if each not in absent]
