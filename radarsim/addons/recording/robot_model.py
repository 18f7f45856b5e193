"""The URDF description of a robot, for viewers such as RViz.

Its links have the names of the frames in ``/tf`` and ``/tf_static``. Wheels are part of
``base_link``, so no joint states are needed.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Final
from xml.etree import ElementTree as ET

from matplotlib.colors import to_rgb

from radarsim.client.robot_info import RobotInfo, ScannerInfo, same_name
from radarsim.errors import PresetError
from radarsim.geometry import Pose3
from radarsim.plotting.palette import MARKER, ROBOT
from radarsim.presets.robots import RobotModel, load_robot
from radarsim.protocol.reports import RobotGeo

TYRE: Final = 0.09  # m; width of a wheel
SCANNER_RADIUS, SCANNER_HEIGHT = 0.05, 0.08  # m
LEAST_BODY: Final = 0.05  # m; least height of a drawn body


def body_of(
    robot: RobotInfo, geo: RobotGeo, classes: Iterable[RobotModel]
) -> RobotModel:
    """Return the model of a robot class; an unknown class is a P3AT of reported size.

    Args:
        robot: The robot.
        geo: Geometry of the robot, as the server reports it.
        classes: Robot classes in addition to the shipped classes.
    """
    for each in classes:
        if same_name(each.name, geo.name):
            return each
    try:
        return load_robot(geo.name)
    except PresetError:
        base = geo.wheel_base
        known = {
            "length": robot.length,
            "width": robot.width,
            "height": robot.height or 2 * robot.wheel_radius + LEAST_BODY,
            # Servers do not report the height of the robot's origin. Most robots have
            # their origin near the axles.
            "origin_height": robot.wheel_radius,
            "wheel_radius": robot.wheel_radius,
            "wheel_separation": robot.wheel_separation,
            "wheel_base": base if math.isfinite(base) else robot.length / 2,
        }
        return load_robot("P3AT").model_copy(update=known)


def robot_description(
    name: str,
    body: RobotModel,
    scanners: Sequence[ScannerInfo],
    frame: Callable[[str], str],
) -> str:
    """Return the URDF of a robot.

    Args:
        name: Name of the robot.
        body: Class of the robot, or another class with its dimensions.
        scanners: Scanners of the robot, which stand on its body.
        frame: Function that returns the full name in ``/tf`` of a frame, such as
            ``base_link``.
    """
    robot = ET.Element("robot", name=name)
    for material, colour in (("hull", ROBOT), ("black", MARKER)):
        rgba = _numbers(*to_rgb(colour), 1.0)
        ET.SubElement(
            ET.SubElement(robot, "material", name=material), "color", rgba=rgba
        )
    base = ET.SubElement(robot, "link", name=frame("base_link"))
    radius = 0.0 if body.flight else body.wheel_radius
    # The body is drawn as a box from half the axle height up to the lowest scanner.
    bottom = radius / 2 - body.origin_height
    tops = [each.mount.z - SCANNER_HEIGHT / 2 for each in scanners]
    top = min([body.height - body.origin_height, *tops])
    top = max(top, bottom + LEAST_BODY)
    size = {"size": _numbers(body.length, body.width, top - bottom)}
    middle = Pose3(0.0, 0.0, (bottom + top) / 2)
    _add_visual(base, middle, "hull", "box", size)
    axle = radius - body.origin_height
    tyre = {"radius": _numbers(radius), "length": _numbers(TYRE)}
    ends = (body.wheel_base / 2, -body.wheel_base / 2)
    for x in ends if radius else ():
        for y in (body.wheel_separation / 2, -body.wheel_separation / 2):
            place = Pose3(x, y, axle, roll=math.pi / 2)
            _add_visual(base, place, "black", "cylinder", tyre)
    case = {"radius": _numbers(SCANNER_RADIUS), "length": _numbers(SCANNER_HEIGHT)}
    for scanner in scanners:
        link = ET.SubElement(robot, "link", name=frame(scanner.name))
        _add_visual(link, Pose3(0.0, 0.0, 0.0), "black", "cylinder", case)
        joint = ET.SubElement(
            robot, "joint", name=f"{frame(scanner.name)}_mount", type="fixed"
        )
        ET.SubElement(joint, "parent", link=frame("base_link"))
        ET.SubElement(joint, "child", link=frame(scanner.name))
        _add_origin(joint, scanner.mount)
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode")


def _add_visual(
    link: ET.Element, pose: Pose3, material: str, shape: str, numbers: dict[str, str]
) -> None:
    visual = ET.SubElement(link, "visual")
    _add_origin(visual, pose)
    ET.SubElement(ET.SubElement(visual, "geometry"), shape, numbers)
    ET.SubElement(visual, "material", name=material)


def _add_origin(parent: ET.Element, pose: Pose3) -> None:
    xyz, rpy = pose.position(), (pose.roll, pose.pitch, pose.yaw)
    ET.SubElement(parent, "origin", xyz=_numbers(*xyz), rpy=_numbers(*rpy))


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.6g}" for value in values)
