"""What a robot says of itself: GEO and CONF lines to reports.

Generations of servers differ in where mounts are told: in one group for each item, or
in a group for each word of it. What a client can do without may be missing.
"""

import math
import re
from collections.abc import Callable
from typing import Final

import numpy as np

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose2, Pose3, wrap_angle
from radarsim.protocol.echoes import read_echo_fields
from radarsim.protocol.message import (
    Message,
    Triple,
    decode_message,
    items_of,
    name_of,
    number_or_nan,
    read_if_there,
    read_needed,
    read_triple,
    read_turned,
    require,
)
from radarsim.protocol.numbers import read_flag, read_list, read_number
from radarsim.protocol.reports import (
    READING_TYPES,
    SETTING_KEYS,
    VEHICLES,
    EchoLine,
    Encoder,
    Greeting,
    GroundTruth,
    Ins,
    ItemGeo,
    NameConf,
    Odometry,
    RangeScan,
    Reading,
    Report,
    RobotConf,
    RobotGeo,
    ScannerConf,
    Settings,
    StartPoses,
    Status,
    Tachometer,
    Touch,
)

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
    kind = require(message, "Type")
    for settings, key in SETTING_KEYS.items():
        if message.get(key) is not None:
            return settings(kind, _values(message, key))
    return NameConf(kind, tuple(name_of(item) for item in items_of(message)))


def _is_of_robot(message: Message) -> bool:
    return require(message, "Type").lower() in _VEHICLES


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
    return ItemGeo(require(message, "Type"), tuple(mounts), robot)


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
    return ScannerConf(require(message, "Type"), tuple(rows))


def _values(message: Message, key: str) -> tuple[tuple[str, float], ...]:
    return tuple(
        (name_of(item), read_needed(item, key, read_number))
        for item in items_of(message)
    )


# Section from protocol.decoding.
# Lines to reports: what a server of any generation says, in the simulation's frame.
#
# The order of fields is free, and so is the case of keys and types. What a server
# leaves
# out and a client can do without, such as a time, is not a number here.


def decode_report(line: str) -> Report | None:
    """Read one line of a server; None for a kind of report that is not known.

    >>> decode_report("NFO {Gametype BotDeathMatch} {Level DM-Yard} {TimeLimit 0}")
    Greeting(level='DM-Yard')

    Raises:
        MalformedMessage: If the line is none, or of a known kind and lacks a field
            that it needs, or has a number that is none.
    """
    message = decode_message(line)
    read = _VERBS.get(message.verb.upper())
    return read(message) if read else None


def _info(message: Message) -> Greeting | StartPoses | None:
    if message.get("StartPoses") is not None:
        return _start_poses(message)
    level = message.get("Level")
    return None if level is None else Greeting(level)


def _reading(message: Message) -> Reading | None:
    read = _READINGS.get((message.get("Type") or "").lower())
    return read(message) if read else None


def _start_poses(message: Message) -> StartPoses:
    keys = [key.lower() for key, _ in message.segments]
    lists = message.segments[keys.index("startposes") + 1 :]
    words = [word for key, value in lists for word in (key, *value.split())]
    if len(words) % 3:
        text = f"start poses {' '.join(words)[:80]!r}"
        raise MalformedMessage(f"{text}, expected 'name x,y,z roll,pitch,yaw' of each")
    return StartPoses(
        tuple(
            (words[i], _wrapped_pose(read_turned(words[i + 1]), words[i + 2]))
            for i in range(0, len(words), 3)
        )
    )


def _status(message: Message) -> Status:
    """Read a status; a battery that is not told of is empty."""
    battery = read_if_there(message, "Battery", read_number)
    light = message.get("LightToggle") or ""
    return Status(_time(message), int(battery or 0), read_flag(light, any_case=True))


def _range_scan(message: Message) -> RangeScan:
    return RangeScan(
        _time(message),
        name_of(message),
        read_needed(message, "Resolution", read_number),
        read_needed(message, "FOV", read_number),
        np.array(read_needed(message, "Range", read_list)),
    )


def _echo_line(message: Message) -> EchoLine:
    return read_echo_fields(message, _time(message), name_of(message))


def _ground_truth(message: Message) -> GroundTruth:
    return GroundTruth(_time(message), name_of(message), _pose(message))


def _ins(message: Message) -> Ins:
    return Ins(_time(message), name_of(message), _pose(message))


def _odometry(message: Message) -> Odometry:
    x, y, yaw = read_needed(message, "Pose", read_triple)
    return Odometry(_time(message), name_of(message), Pose2(x, 0.0 - y, 0.0 - yaw))


def _tachometer(message: Message) -> Tachometer:
    velocities = read_needed(message, "Vel", read_list)
    positions = read_needed(message, "Pos", read_list)
    return Tachometer(
        _time(message), name_of(message), tuple(velocities), tuple(positions)
    )


def _encoder(message: Message) -> Encoder:
    ticks = [
        (name_of(item), int(read_needed(item, "Tick", read_number)))
        for item in items_of(message)
    ]
    return Encoder(_time(message), tuple(ticks))


def _touch(message: Message) -> Touch:
    touched = read_flag(require(message, "Touch"), any_case=True)
    return Touch(_time(message), name_of(message), touched)


def _time(message: Message) -> float:
    return number_or_nan(message, "Time")


def _pose(message: Message) -> Pose3:
    location = read_needed(message, "Location", read_turned)
    return _wrapped_pose(location, require(message, "Orientation"))


def _wrapped_pose(location: Triple, orientation: str) -> Pose3:
    """Put a pose together; some count angles to a whole turn, here they are wrapped."""
    roll, pitch, yaw = read_turned(orientation)
    return Pose3(*location, wrap_angle(roll), wrap_angle(pitch), wrap_angle(yaw))


_VERBS: Final[dict[str, Callable[[Message], Report | None]]] = {
    "NFO": _info,
    "STA": _status,
    "SEN": _reading,
    "GEO": read_geometry,
    "CONF": read_configuration,
}
_READERS: Final[dict[type[Reading], Callable[[Message], Reading]]] = {
    RangeScan: _range_scan,
    EchoLine: _echo_line,
    GroundTruth: _ground_truth,
    Ins: _ins,
    Odometry: _odometry,
    Tachometer: _tachometer,
    Encoder: _encoder,
    Touch: _touch,
}
_READINGS = {word.lower(): _READERS[kind] for kind, word in READING_TYPES.items()}
