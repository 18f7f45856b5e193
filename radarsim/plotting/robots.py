"""Robots in pictures, seen from above."""

from typing import Final

from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from radarsim.geometry import Pose2
from radarsim.plotting.palette import MARKER, ROBOT
from radarsim.presets.robots import RobotModel, load_robot
from radarsim.robots.footprint import Footprint

_TYRE: Final = 0.09  # m, width of a wheel


def draw_robot(
    axes: Axes, class_name: str, pose: Pose2, *, zorder: float = 5
) -> list[Polygon]:
    """Draw a robot from above: hull, wheels and a wedge that points ahead.

    Args:
        axes: Axes in m, map frame.
        class_name: Name of the robot class.
        pose: Pose of the robot.
        zorder: Z-order of the hull; wheels and wedge are drawn a little above it.

    Returns:
        What was drawn.
    """
    model = load_robot(class_name)
    hull = Footprint(model.length, model.width)
    tyre = Footprint(2 * model.wheel_radius, _TYRE)
    drawn = [_patch(axes, hull, pose, ROBOT, zorder)]
    drawn += [
        _patch(axes, tyre, wheel, MARKER, zorder + 0.1)
        for wheel in _wheels(model, pose)
    ]
    x, y = model.length / 2, model.width / 5
    corners = [_at(pose, *place) for place in ((x, 0.0), (x / 2, y), (x / 2, -y))]
    wedge = Polygon(corners, facecolor=MARKER, zorder=zorder + 0.2)
    axes.add_patch(wedge)
    return [*drawn, wedge]


def _patch(
    axes: Axes, shape: Footprint, pose: Pose2, colour: str, zorder: float
) -> Polygon:
    corners = shape.outline(pose)[:, 0]
    patch = Polygon(corners, facecolor=colour, edgecolor=MARKER, linewidth=0.8)
    patch.set_zorder(zorder)
    axes.add_patch(patch)
    return patch


def _wheels(model: RobotModel, pose: Pose2) -> list[Pose2]:
    ahead, aside = model.wheel_base / 2, model.wheel_separation / 2
    places = ((ahead, aside), (ahead, -aside), (-ahead, aside), (-ahead, -aside))
    return [Pose2(*_at(pose, *place), pose.yaw) for place in places]


def _at(pose: Pose2, ahead: float, aside: float) -> tuple[float, float]:
    place = pose.compose(Pose2(ahead, aside))
    return place.x, place.y
