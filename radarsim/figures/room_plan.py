"""The test map as the background of figures 6 to 12."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from radarsim.figures.foliage_wall import hidden_parts
from radarsim.figures.scan_spec import ROBOT, ScanSpec
from radarsim.plotting.annotations import HALO, as_words, draw_scale_bar
from radarsim.plotting.plan import draw_plan
from radarsim.plotting.robots import draw_robot
from radarsim.scene.scene import Scene

FRAME: Final = (0.01, 0.06, 0.98, 0.87)  # of the axes in a figure of SIZE
SIZE: Final = (12, 8.2)  # inches
_EDGE: Final = 0.45  # m around the room
_BELOW: Final = 0.6  # m more below it, for the scale bar


def new_sheet() -> tuple[Figure, Axes]:
    """Return a figure for the test map, and its axes."""
    drawing = Figure(figsize=SIZE, dpi=120)
    return drawing, drawing.add_axes(FRAME)


def draw_room(axes: Axes, shot: ScanSpec) -> None:
    """Draw the test map with the robot of a scan, without axes and with a scale bar."""
    draw_plan(axes, shot.scene, shot.pose.z)
    draw_robot(axes, ROBOT, shot.robot, zorder=6)
    show_room(axes, shot.scene)


def show_room(axes: Axes, scene: Scene) -> None:
    """Set the limits, the same in all figures, and replace axes by a scale bar."""
    low, high = scene.bounds[:, :2] + np.array([[-_EDGE], [_EDGE]])
    low[1] -= _BELOW
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_axis_off()
    draw_scale_bar(axes)


def name_hidden_objects(axes: Axes, scene: Scene) -> None:
    """Write the names of the objects behind the bushes to their right."""
    for part in hidden_parts(scene):
        low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
        axes.annotate(
            as_words(part.object_name),
            (high[0], (low[1] + high[1]) / 2),
            xytext=(5, 0),
            textcoords="offset points",
            va="center",
            fontsize="large",
            path_effects=[HALO],
            zorder=8,
        )
