"""Builds replies to GETGEO and GETCONF: geometry and settings of robots and items."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import TYPE_CHECKING, Any, Final

from radarsim.geometry import Pose3
from radarsim.presets.robots import Item, RobotModel
from radarsim.protocol import reports
from radarsim.protocol.images import HEIGHT, WIDTH
from radarsim.protocol.packages import ACTUATOR
from radarsim.sensors.wheels import ENCODER_RESOLUTION
from radarsim.simulation.config import SimulationConfig

if TYPE_CHECKING:
    from radarsim.simulation.vehicle import Vehicle

TOUCH_DIAMETER = 0.01  # m; constant of the original server, meaningless for a bumper
ROBOT = "robot"
SCANNER_REPORTS = ("echoes", "radartargets")  # types of reports, not of items
PACKAGE = "mispkg"
CAMERA = "Camera"


def geometry(
    model: RobotModel, item_type: str, name: str | None
) -> reports.Report | None:
    """Return the mounting poses of items, or the dimensions of the robot.

    Args:
        model: The class of the robot.
        item_type: Type of the items, case-insensitive; the reply repeats its spelling.
            ``Robot`` for the robot itself.
        name: Name of one item, case-insensitive; None for all items of the type.

    Returns:
        The report; None if the robot has no such item.
    """
    if item_type.casefold() == ROBOT and model.flight is not None:
        return reports.AerialGeo(model.name, model.dimensions, model.cog)
    if item_type.casefold() == ROBOT:
        return reports.RobotGeo(
            name=model.name,
            dimensions=model.dimensions,
            cog=model.cog,
            wheel_radius=model.wheel_radius,
            wheel_separation=model.wheel_separation,
            wheel_base=model.wheel_base,
        )
    items = items_reporting(model, item_type, name)
    if not items:
        return None
    if items[0].links:
        packages = tuple((item.name, _link_poses(item)) for item in items)
        return reports.PackageGeo(item_type, packages, model.name)
    mounts = tuple((item.name, _mount_on(model, item)) for item in items)
    return reports.ItemGeo(item_type, mounts, model.name)


def configuration(
    model: RobotModel, config: SimulationConfig, item_type: str, name: str | None
) -> reports.Report | None:
    """Return the settings of items, or the performance of the robot.

    Arguments and result are as in ``geometry``; ``config`` contains the settings.
    """
    if item_type.casefold() == ROBOT:
        return _performance(model, config)
    items = items_reporting(model, item_type, name)
    # Some clients request the mission packages (such as arms) of every robot, even if
    # it has none.
    if item_type.casefold() == PACKAGE and not items:
        return reports.NameConf(item_type, ())
    if not items:
        return None
    if items[0].links:
        packages = tuple((item.name, item.links) for item in items)
        return reports.PackageConf(item_type, packages)
    return _settings_of(items, item_type, config)


def _performance(model: RobotModel, config: SimulationConfig) -> reports.RobotConf:
    """Return mass, maximum speed, torque and steering limits of a robot."""
    angles = None
    if model.flight is not None:
        return reports.AerialConf(model.name, model.mass, model.flight.max_linear)
    if model.steering is not None:
        limits = model.steering.max_front_deg, model.steering.max_rear_deg
        angles = config.dialect.steering_limits(*map(math.radians, limits))
    max_spin = config.wheel_drive(model).max_spin
    return reports.RobotConf(model.name, model.mass, max_spin, model.max_torque, angles)


def find_items(model: RobotModel, item_type: str, name: str | None) -> tuple[Item, ...]:
    """Return the items of a type, or the item with a name; both in any case."""
    items = model.items_of(item_type)
    if name is None:
        return items
    return tuple(item for item in items if item.name.casefold() == name.casefold())


def items_reporting(
    model: RobotModel, report_type: str, name: str | None = None
) -> tuple[Item, ...]:
    """Return the items that send reports of a type."""
    # The ROS driver asks for the geometry of each type that it has seen in a reading,
    # and waits for the answer. Echoes and targets are reports of a range scanner.
    is_scanner = report_type.casefold() in SCANNER_REPORTS
    item_type = "RangeScanner" if is_scanner else report_type
    if report_type.casefold() == ACTUATOR:  # the name of packages on UDK servers
        item_type = "MisPkg"
    return find_items(model, item_type, name)


def _link_poses(item: Item) -> tuple[Pose3, ...]:
    """Return the pose of each link in the frame of the previous link."""
    poses = [link.mount for link in item.links]
    return (item.mount.compose(poses[0]), *poses[1:])


def _mount_on(model: RobotModel, item: Item) -> Pose3:
    """Return the pose of an item on a robot whose links are in their rest position."""
    for package in model.items_of(PACKAGE):
        if package.name == item.parent:
            poses = [link.turned(link.limit(0.0)) for link in package.links]
            return reduce(Pose3.compose, [package.mount, *poses, item.mount])
    return item.mount


def camera_configuration(
    vehicle: Vehicle, item_type: str, name: str | None
) -> reports.Report | None:
    """Return the settings of cameras; None if the robot has no such camera."""
    cameras = []
    for item in find_items(vehicle.model, CAMERA, name):
        settings, corner = vehicle.config.settings_of(item), (0.0, 0.0)
        if vehicle.is_quad and item.name in vehicle.viewports:
            row, column = divmod(vehicle.viewports.index(item.name), 2)
            corner = float(column * WIDTH), float(row * HEIGHT)
        limits = settings.fov_deg, settings.min_fov_deg, settings.max_fov_deg
        first, low, high = map(math.radians, limits)
        fovs = first, low, high, math.radians(vehicle.fovs[item.name])
        cameras.append(reports.CameraLimits(item.name, corner, (WIDTH, HEIGHT), fovs))
    return reports.CameraConf(item_type, tuple(cameras)) if cameras else None


def _scanner_row(
    item: Item, config: SimulationConfig
) -> tuple[str, float, float, float, float]:
    scanner = config.scanner_settings(item)
    angles = math.radians(scanner.resolution_deg), math.radians(scanner.fov_deg)
    return (item.name, scanner.max_range, scanner.min_range, *angles)


def _sonar_row(
    item: Item, config: SimulationConfig
) -> tuple[str, float, float, float, float]:
    sonar, interval = config.settings_of(item), config.interval(item)
    angle = math.radians(sonar.beam_angle_deg)
    return item.name, sonar.max_range, sonar.min_range, angle, interval


# For each type of items, the class of its CONF report and the function for each row.
_CONFS: Final[
    dict[str, tuple[type[reports.ItemConf], Callable[[Item, SimulationConfig], Any]]]
] = {
    "RangeScanner": (reports.ScannerConf, _scanner_row),
    "Sonar": (reports.SonarConf, _sonar_row),
    "Encoder": (reports.EncoderConf, lambda item, _: (item.name, ENCODER_RESOLUTION)),
    "Touch": (reports.TouchConf, lambda item, _: (item.name, TOUCH_DIAMETER)),
    **dict.fromkeys(
        ("GroundTruth", "INS", "Odometry", "Tachometer", "GPS"),
        (reports.IntervalConf, lambda item, config: (item.name, config.interval(item))),
    ),
}


def _settings_of(
    items: Sequence[Item], item_type: str, config: SimulationConfig
) -> reports.Report:
    """Return the settings of items; ``item_type`` is in the client's spelling."""
    if items[0].type not in _CONFS:
        return reports.NameConf(item_type, tuple(item.name for item in items))
    conf, row_of = _CONFS[items[0].type]
    return conf(item_type, tuple(row_of(item, config) for item in items))
