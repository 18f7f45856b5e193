"""What a robot says of itself: GEO and CONF lines to reports.

Generations of servers differ in where mounts are told: in one group for each item, or
in a group for each word of it. What a client can do without may be missing.
"""

import math
import re

from radarsim.geometry import Pose3
from radarsim.protocol.fields import (
    items_of,
    name_of,
    needed,
    number_or_nan,
    read_if_there,
    read_needed,
    read_triple,
    read_turned,
)
from radarsim.protocol.numbers import read_number
from radarsim.protocol.reports import (
    ItemGeo,
    NameConf,
    RobotConf,
    RobotGeo,
    ScannerConf,
)
from radarsim.protocol.wire import Message
from radarsim.protocol.words import SETTING_KEYS, VEHICLES, Settings

_MOUNT_WORD = re.compile(r"\s+(Location|Orientation|Mount)\s+", re.IGNORECASE)
_RIGID = "hard"  # how something is mounted, where others say what it is mounted on
_VEHICLES = frozenset(vehicle.lower() for vehicle in VEHICLES)


def read_geometry(message: Message) -> RobotGeo | ItemGeo:
    """Read a GEO line.

    Raises:
        MalformedMessage: If a field is missing or cannot be read.
    """
    return _robot_geo(message) if _is_of_robot(message) else _item_geo(message)


def read_configuration(
    message: Message,
) -> RobotConf | ScannerConf | Settings | NameConf:
    """Read a CONF line; what settings there are says of what kind the items are.

    Raises:
        MalformedMessage: If a field is missing or cannot be read.
    """
    if _is_of_robot(message):
        return _robot_conf(message)
    if message.get("MaxRange") is not None:
        return _scanner_conf(message)
    kind = needed(message, "Type")
    for settings, key in SETTING_KEYS.items():
        if message.get(key) is not None:
            return settings(kind, _values(message, key))
    return NameConf(kind, tuple(name_of(item) for item in items_of(message)))


def _is_of_robot(message: Message) -> bool:
    return needed(message, "Type").lower() in _VEHICLES


def _robot_geo(message: Message) -> RobotGeo:
    unknown = (math.nan, math.nan, math.nan)
    return RobotGeo(
        name=name_of(message),
        dimensions=read_needed(message, "Dimensions", read_triple),
        cog=read_if_there(message, "COG", read_turned) or unknown,
        wheel_radius=read_needed(message, "WheelRadius", read_number),
        wheel_separation=read_needed(message, "WheelSeparation", read_number),
        wheel_base=number_or_nan(message, "WheelBase"),
    )


def _robot_conf(message: Message) -> RobotConf:
    return RobotConf(
        name=name_of(message),
        mass=number_or_nan(message, "Mass"),
        max_speed=read_needed(message, "MaxSpeed", read_number),
        max_torque=number_or_nan(message, "MaxTorque"),
    )


def _item_geo(message: Message) -> ItemGeo:
    """Read mounts; what does not say what it is mounted on, is on no known robot."""
    mounts: list[tuple[str, Pose3]] = []
    robot = ""
    for item in items_of(_taken_apart(message)):
        mounts.append((name_of(item), _mount(item)))
        told = item.get("Mount") or ""
        robot = robot or ("" if told.lower() == _RIGID else told)
    return ItemGeo(needed(message, "Type"), tuple(mounts), robot)


def _taken_apart(message: Message) -> Message:
    """Make the form with a group for each item that with a group for each word."""
    segments: list[tuple[str, str]] = []
    for key, value in message.segments:
        first, *rest = _MOUNT_WORD.split(value)
        segments += [(key, first), *zip(rest[::2], rest[1::2], strict=True)]
    return Message(message.verb, tuple(segments))


def _mount(item: Message) -> Pose3:
    turn = read_if_there(item, "Orientation", read_turned) or (0.0, 0.0, 0.0)
    return Pose3(*read_needed(item, "Location", read_turned), *turn)


def _scanner_conf(message: Message) -> ScannerConf:
    rows = [
        (
            name_of(item),
            read_needed(item, "MaxRange", read_number),
            read_if_there(item, "MinRange", read_number) or 0.0,
            number_or_nan(item, "Resolution"),
            number_or_nan(item, "Fov"),
        )
        for item in items_of(message)
    ]
    return ScannerConf(needed(message, "Type"), tuple(rows))


def _values(message: Message, key: str) -> tuple[tuple[str, float], ...]:
    return tuple(
        (name_of(item), read_needed(item, key, read_number))
        for item in items_of(message)
    )
