"""The model of a robot for viewers: URDF, the robot descriptions of ROS.

Its links have the names of the frames in ``/tf`` and ``/tf_static``, so that it needs
no joint states: wheels are part of ``base_link``.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final, Self
from xml.etree import ElementTree as ET

from matplotlib.colors import to_rgb

from radarsim.client.robot_info import RobotInfo, ScannerInfo, same_name
from radarsim.errors import PresetError
from radarsim.geometry import Pose3
from radarsim.plotting.palette import MARKER, ROBOT
from radarsim.presets.robots import RobotModel, load_robot
from radarsim.protocol.reports import RobotGeo

TYRE: Final = 0.09  # m, width of a wheel
SCANNER_RADIUS, SCANNER_HEIGHT = 0.05, 0.08  # m
LEAST_HULL: Final = 0.05  # m, height


@dataclass(frozen=True, slots=True)
class RobotBody:
    """What is drawn of a robot besides its scanners; all in m.

    Attributes:
        length: Length of the hull.
        width: Width of the hull.
        height: Height above the floor of what it carries.
        origin_height: Height above the floor of the frame ``base_link``.
        wheel_radius: Radius of the wheels; 0 without any.
        wheel_separation: Distance between left and right wheels.
        wheel_base: Distance between front and rear wheels.
    """

    length: float
    width: float
    height: float
    origin_height: float
    wheel_radius: float
    wheel_separation: float
    wheel_base: float

    @classmethod
    def of(cls, robot: RobotInfo, geo: RobotGeo, classes: Iterable[RobotModel]) -> Self:
        """Return the numbers of a robot: of its class, or what the server tells.

        Args:
            robot: The robot.
            geo: Its geometry, as the server tells it.
            classes: Robot classes besides those that are shipped.
        """
        model = next((each for each in classes if same_name(each.name, geo.name)), None)
        if model is None:
            try:
                model = load_robot(geo.name)
            except PresetError:
                # No server tells where the origin is; that of most robots is near
                # their axles.
                base = geo.wheel_base
                return cls(
                    robot.length,
                    robot.width,
                    robot.height or 2 * robot.wheel_radius + LEAST_HULL,
                    robot.wheel_radius,
                    robot.wheel_radius,
                    robot.wheel_separation,
                    base if math.isfinite(base) else robot.length / 2,
                )
        body = cls(*(getattr(model, name) for name in cls.__slots__))
        return body if model.flight is None else replace(body, wheel_radius=0.0)


def robot_description(
    name: str,
    body: RobotBody,
    scanners: Sequence[ScannerInfo],
    frame: Callable[[str], str],
) -> str:
    """Return the URDF of a robot.

    Args:
        name: Name of the robot.
        body: Its dimensions.
        scanners: Its scanners, which stand on the hull.
        frame: Returns the name of a frame in ``/tf``, such as that of ``base_link``.
    """
    robot = ET.Element("robot", name=name)
    for material, colour in (("hull", ROBOT), ("black", MARKER)):
        rgba = _numbers(*to_rgb(colour), 1.0)
        ET.SubElement(
            ET.SubElement(robot, "material", name=material), "color", rgba=rgba
        )
    base = ET.SubElement(robot, "link", name=frame("base_link"))
    _add_hull(base, body, scanners)
    axle = body.wheel_radius - body.origin_height
    tyre = {"radius": _numbers(body.wheel_radius), "length": _numbers(TYRE)}
    ends = (body.wheel_base / 2, -body.wheel_base / 2)
    for x in ends if body.wheel_radius else ():
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


def _add_hull(
    base: ET.Element, body: RobotBody, scanners: Sequence[ScannerInfo]
) -> None:
    """Add a box from half the height of the axles up to what the scanners stand on."""
    bottom = body.wheel_radius / 2 - body.origin_height
    tops = [each.mount.z - SCANNER_HEIGHT / 2 for each in scanners]
    top = min([body.height - body.origin_height, *tops])
    top = max(top, bottom + LEAST_HULL)
    size = {"size": _numbers(body.length, body.width, top - bottom)}
    middle = Pose3(0.0, 0.0, (bottom + top) / 2)
    _add_visual(base, middle, "hull", "box", size)


def _add_visual(
    link: ET.Element, pose: Pose3, material: str, shape: str, numbers: dict[str, str]
) -> None:
    visual = ET.SubElement(link, "visual")
    _add_origin(visual, pose)
    ET.SubElement(ET.SubElement(visual, "geometry"), shape, numbers)
    ET.SubElement(visual, "material", name=material)


def _add_origin(parent: ET.Element, pose: Pose3) -> None:
    xyz, rpy = (
        _numbers(pose.x, pose.y, pose.z),
        _numbers(pose.roll, pose.pitch, pose.yaw),
    )
    ET.SubElement(parent, "origin", xyz=xyz, rpy=rpy)


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.6g}" for value in values)
