"""Answers to GETGEO and GETCONF: what a robot says about itself and its items."""

import math
from collections.abc import Callable, Sequence

from radarsim.presets.robots import Item
from radarsim.protocol import reports
from radarsim.sensors.proprioceptive import ENCODER_RESOLUTION
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.vehicle import Vehicle

TOUCH_DIAMETER = 0.01  # m; the original's number, of no meaning for a bumper
ROBOT = "robot"
ECHOES = "echoes"  # no items, but what scanners tell, under a type of their own
NO_ITEMS = "mispkg"  # mission packages: asked for by clients, carried by no robot


def geometry(vehicle: Vehicle, kind: str, name: str | None) -> reports.Report | None:
    """Tell where things are; None for what the robot does not have.

    Args:
        vehicle: That is asked.
        kind: Type of the items, any case, to be echoed; ``Robot`` for the robot.
        name: Of one item, any case; None for all of the type.
    """
    model = vehicle.model
    if kind.casefold() == ROBOT:
        return reports.RobotGeo(
            name=model.name,
            dimensions=model.dimensions,
            cog=model.cog,
            wheel_radius=model.wheel_radius,
            wheel_separation=model.wheel_separation,
            wheel_base=model.wheel_base,
        )
    items = _telling(vehicle, kind, name)
    if not items:
        return None
    mounts = tuple((item.name, item.mount) for item in items)
    return reports.ItemGeo(kind, mounts, model.name)


def configuration(
    vehicle: Vehicle, config: SimulationConfig, kind: str, name: str | None
) -> reports.Report | None:
    """Tell settings; arguments and None as in ``geometry``."""
    model = vehicle.model
    if kind.casefold() == ROBOT:
        drive = vehicle.robot.wheel_drive
        return reports.RobotConf(
            model.name, model.mass, drive.max_spin, model.max_torque
        )
    if kind.casefold() == NO_ITEMS:
        return reports.NameConf(kind, ())
    items = _telling(vehicle, kind, name)
    if not items:
        return None
    return _CONFIGURATIONS.get(items[0].type, _names)(kind, items, config)


def matching(vehicle: Vehicle, kind: str, name: str | None) -> tuple[Item, ...]:
    """Find items by type and name, both in any case."""
    items = vehicle.model.items_of(kind)
    if name is None:
        return items
    return tuple(item for item in items if item.name.casefold() == name.casefold())


def _telling(vehicle: Vehicle, kind: str, name: str | None) -> tuple[Item, ...]:
    """Find the items whose readings are of a type; drivers ask for each that comes."""
    source = "RangeScanner" if kind.casefold() == ECHOES else kind
    return matching(vehicle, source, name)


def _scanners(
    kind: str, items: Sequence[Item], config: SimulationConfig
) -> reports.Report:
    rows = []
    for item in items:
        settings = config.scanner(item).settings
        resolution = math.radians(settings.resolution_deg)
        fov = math.radians(settings.fov_deg)
        rows.append(
            (item.name, settings.max_range, settings.min_range, resolution, fov)
        )
    return reports.ScannerConf(kind, tuple(rows))


def _intervals(
    kind: str, items: Sequence[Item], config: SimulationConfig
) -> reports.Report:
    rows = tuple((item.name, config.interval(item)) for item in items)
    return reports.IntervalConf(kind, rows)


def _encoders(kind: str, items: Sequence[Item], _: SimulationConfig) -> reports.Report:
    rows = tuple((item.name, ENCODER_RESOLUTION) for item in items)
    return reports.EncoderConf(kind, rows)


def _touches(kind: str, items: Sequence[Item], _: SimulationConfig) -> reports.Report:
    return reports.TouchConf(kind, tuple((item.name, TOUCH_DIAMETER) for item in items))


def _names(kind: str, items: Sequence[Item], _: SimulationConfig) -> reports.Report:
    return reports.NameConf(kind, tuple(item.name for item in items))


_CONFIGURATIONS: dict[
    str, Callable[[str, Sequence[Item], SimulationConfig], reports.Report]
] = {
    "RangeScanner": _scanners,
    "GroundTruth": _intervals,
    "INS": _intervals,
    "Odometry": _intervals,
    "Tachometer": _intervals,
    "Encoder": _encoders,
    "Touch": _touches,
}
