"""Lines to reports: what a server of any generation says, in the simulation's frame.

The order of fields is free, and so is the case of keys and types. What a server leaves
out and a client can do without, such as a time, is not a number here.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose2, Pose3, wrap_angle
from radarsim.protocol.axes import Triple
from radarsim.protocol.describing import read_configuration, read_geometry
from radarsim.protocol.echofields import read_echo_fields
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
from radarsim.protocol.numbers import read_flag, read_list, read_number
from radarsim.protocol.reports import (
    EchoLine,
    Encoder,
    Greeting,
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
    StartPoses,
    Status,
    Tachometer,
    Touch,
)
from radarsim.protocol.wire import Message, decode_message
from radarsim.protocol.words import READING_TYPES, Reading


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
    touched = read_flag(needed(message, "Touch"), any_case=True)
    return Touch(_time(message), name_of(message), touched)


def _time(message: Message) -> float:
    return number_or_nan(message, "Time")


def _pose(message: Message) -> Pose3:
    location = read_needed(message, "Location", read_turned)
    return _wrapped_pose(location, needed(message, "Orientation"))


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
