"""A scene from above with a robot and its goal, as an image."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose2
from radarsim.plotting.plan import HEIGHT, draw_plan, show_extent
from radarsim.plotting.robots import draw_robot
from radarsim.scene.scene import Scene

_SIZE = (6.0, 6.0)  # inches
_DPI = 100


class Picture:
    """The plan of a scene, onto which robots are drawn again and again."""

    def __init__(self, scene: Scene, robot: str) -> None:
        """Draw the plan.

        Args:
            scene: The map.
            robot: Class of the robots.
        """
        self._robot = robot
        figure = Figure(figsize=_SIZE, dpi=_DPI, layout="compressed")
        self._canvas = FigureCanvasAgg(figure)
        self._axes = figure.add_subplot()
        self._axes.set_axis_off()
        plan = draw_plan(self._axes, scene, scene.floor_at(0.0, 0.0) + HEIGHT)
        show_extent(self._axes, plan.corners)

    def draw(self, poses: Floats, goals: Floats) -> NDArray[np.uint8]:
        """Return the image, (H, W, 3).

        Args:
            poses: (3,) or (N, 3) x, y and yaw of the robots, m and rad, map frame.
            goals: (2,) or (N, 2) x and y of their goals, m, map frame.
        """
        drawn = [
            artist
            for pose in np.atleast_2d(poses)
            for artist in draw_robot(self._axes, self._robot, Pose2(*pose.tolist()))
        ]
        x, y = np.atleast_2d(goals).T
        stars = self._axes.plot(x, y, "*", color="black", markersize=14, zorder=4)
        data, (width, height) = self._canvas.print_to_buffer()  # type: ignore[no-untyped-call]
        image = np.frombuffer(data, np.uint8).reshape(height, width, 4)[..., :3].copy()
        for artist in (*drawn, *stars):
            artist.remove()
        return image
