"""What a client asks for, as values in the frames of the simulation.

Positions and angles are REP-103: the axes of the wire end here. A command is read
whole or refused whole, so that a bad number in one field never leaves half of it.
Fields come in any order, unknown ones are ignored, and an empty one is a missing one.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial, singledispatch
from typing import TypeAlias

import numpy as np

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.message import (
    Message,
    Triple,
    decode_message,
    flip_axes,
    pose_from_wire,
    read_if_there,
    read_turned,
    require,
)
from radarsim.protocol.numbers import LARGEST_READ, read_flag, read_number, read_numbers


@dataclass(frozen=True, slots=True)
class Init:
    """Spawn a robot.

    Attributes:
        class_name: Robot class without its package, as the client spelt it.
        name: None if the client leaves it to the server.
        start: Name of a start pose; if it is given, position and rotation are None.
        position: x, y, z in m.
        rotation: Roll, pitch, yaw in rad.
    """

    class_name: str
    name: str | None = None
    start: str | None = None
    position: Triple | None = None
    rotation: Triple | None = None


@dataclass(frozen=True, slots=True)
class Drive:
    """Set wheel speeds and lamps; what is None stays as it is.

    Attributes:
        left: Wheel speed in the dialect's drive unit, or percent of the largest.
        right: Likewise; a command with only one of the two moves no wheel.
        normalized: Whether speeds count in percent from this command on.
        light: Whether the headlight burns.
        flip: Whether a robot that lies on its back shall be turned over.
    """

    left: float | None = None
    right: float | None = None
    normalized: bool | None = None
    light: bool | None = None
    flip: bool | None = None


@dataclass(frozen=True, slots=True)
class GetStartPoses:
    """Ask for the start poses of the map."""


@dataclass(frozen=True, slots=True)
class GetGeo:
    """Ask where the robot's items of one type are mounted.

    Attributes:
        type: As the client spelt it, to be echoed; ``Robot`` means the robot itself.
        name: None for all items of that type.
    """

    type: str
    name: str | None = None


@dataclass(frozen=True, slots=True)
class GetConf:
    """Ask for the settings of items of one type; attributes as in ``GetGeo``."""

    type: str
    name: str | None = None


@dataclass(frozen=True, slots=True)
class SetItem:
    """Give an order to the items of one type.

    Attributes:
        type: As the client spelt it.
        name: None for all items of that type.
        opcode: ``SCAN``, ``RESET``, ``POSE``, ``ECHOES`` and the like, as the client
            spelt it.
        params: Text, empty if there is none.
    """

    type: str
    name: str | None
    opcode: str
    params: str = ""


@dataclass(frozen=True, slots=True)
class Unsupported:
    """Anything that USARSim servers know and this one accepts without effect."""

    verb: str


Command: TypeAlias = (
    Init | Drive | GetStartPoses | GetGeo | GetConf | SetItem | Unsupported
)


def parse_command(line: str, dialect: Dialect) -> Command:
    """Read one line of a client.

    Raises:
        MalformedMessage: If the line is no command, lacks a field that it needs, or
            has a number that is none.
    """
    message = decode_message(line)
    verb = message.verb.upper()
    if verb in _UNSUPPORTED:
        return Unsupported(verb)
    if verb not in _PARSERS:
        raise MalformedMessage(
            f"verb {message.verb[:80]!r}, expected one of {sorted(_PARSERS)}"
        )
    return _PARSERS[verb](message, dialect)


def parse_pose(params: str) -> Pose3:
    """Read the ``x,y,z,roll,pitch,yaw`` of an INS POSE order, in the wire's frame.

    Raises:
        MalformedMessage: If these are not six numbers.
    """
    return pose_from_wire(read_numbers(params, 6))


def parse_switch(params: str) -> bool:
    """Read the ``true`` or ``false``, in any case, of an order that switches.

    Raises:
        MalformedMessage: If it is neither.
    """
    word = params.strip().lower()
    if word not in ("true", "false"):
        raise MalformedMessage(f"{params[:80]!r}, expected 'true' or 'false'")
    return word == "true"


def _init(message: Message) -> Init:
    class_name = require(message, "ClassName").rpartition(".")[2]
    name = message.get("Name") or None
    start = message.get("Start") or None
    if start is not None:
        return Init(class_name, name, start)
    return Init(
        class_name,
        name,
        position=read_if_there(message, "Location", read_turned),
        rotation=read_if_there(message, "Rotation", read_turned),
    )


def _drive(message: Message, dialect: Dialect) -> Drive:
    flag = partial(read_flag, any_case=dialect.accepts_any_case_true)
    return Drive(
        left=read_if_there(message, "Left", read_number),
        right=read_if_there(message, "Right", read_number),
        normalized=read_if_there(message, "Normalized", flag),
        light=read_if_there(message, "Light", flag),
        flip=read_if_there(message, "Flip", flag),
    )


def _set(message: Message) -> SetItem:
    return SetItem(
        require(message, "Type"),
        message.get("Name") or None,
        require(message, "Opcode"),
        message.get("Params") or "",
    )


_PARSERS: dict[str, Callable[[Message, Dialect], Command]] = {
    "INIT": lambda message, _: _init(message),
    "DRIVE": _drive,
    "SET": lambda message, _: _set(message),
    "GETSTARTPOSES": lambda *_: GetStartPoses(),
    "GETGEO": lambda message, _: GetGeo(
        require(message, "Type"), message.get("Name") or None
    ),
    "GETCONF": lambda message, _: GetConf(
        require(message, "Type"), message.get("Name") or None
    ),
}

# Verbs of the servers of all generations that do nothing to a wheeled robot here.
_UNSUPPORTED = frozenset(
    (
        *("ACT", "CAMERA", "CONTROL", "GETCLOSESTPATHNODE", "GETNFO", "GETPATHNODES"),
        *("GOTO", "MISPKG", "MOVE", "MULTIDRIVE", "PAUSE", "PING", "TEST", "TRACE"),
    )
)


# Section from protocol.asking.
# Commands to lines: what a client says, so that ``parse_command`` reads it back.
#
# Numbers are written with all their digits and without an exponent, vectors with
# commas,
# and truth values in small letters, which servers of all generations read.

PACKAGE = "USARBot."  # of robot classes


def encode_command(command: Command) -> str:
    """Write a command as one line, without its end.

    Raises:
        ValueError: If a number in it is not finite or too large to be read, or a text
            has line ends, braces or what is not ASCII.
    """
    return _line(command)


@singledispatch
def _line(command: object) -> str:
    raise TypeError(f"{command!r}, expected a command")


@_line.register
def _(command: Init) -> str:
    class_name = command.class_name
    if "." not in class_name:
        class_name = PACKAGE + class_name
    location, rotation = command.position, command.rotation
    return _format_line(
        "INIT",
        ("ClassName", class_name),
        ("Name", command.name),
        ("Start", command.start),
        ("Location", None if location is None else _format_vector(flip_axes(location))),
        ("Rotation", None if rotation is None else _format_vector(flip_axes(rotation))),
    )


@_line.register
def _(command: Drive) -> str:
    return _format_line(
        "DRIVE",
        ("Left", _number_if_given(command.left)),
        ("Right", _number_if_given(command.right)),
        ("Normalized", _flag_if_given(command.normalized)),
        ("Light", _flag_if_given(command.light)),
        ("Flip", _flag_if_given(command.flip)),
    )


@_line.register
def _(_: GetStartPoses) -> str:
    return _format_line("GETSTARTPOSES")


@_line.register
def _(command: GetGeo) -> str:
    return _format_line("GETGEO", ("Type", command.type), ("Name", command.name))


@_line.register
def _(command: GetConf) -> str:
    return _format_line("GETCONF", ("Type", command.type), ("Name", command.name))


@_line.register
def _(command: SetItem) -> str:
    return _format_line(
        "SET",
        ("Type", command.type),
        ("Name", command.name),
        ("Opcode", command.opcode),
        ("Params", command.params or None),
    )


@_line.register
def _(command: Unsupported) -> str:
    return _format_line(command.verb)


def _format_line(verb: str, *fields: tuple[str, str | None]) -> str:
    given = tuple((key, _checked(text)) for key, text in fields if text is not None)
    return Message(verb, given).encode()


def _checked(text: str) -> str:
    """Give a text back if a line can hold it: another's line must not be in it."""
    if text.isascii() and text.isprintable() and not {*text} & {"{", "}"}:
        return text
    raise ValueError(f"text {text[:80]!r}, expected printable ASCII without braces")


def _number_if_given(value: float | None) -> str | None:
    return None if value is None else _format_number(value)


def _flag_if_given(value: bool | None) -> str | None:
    return None if value is None else str(value).lower()


def _format_vector(values: Iterable[float]) -> str:
    return ",".join([_format_number(value) for value in values])


def _format_number(value: float) -> str:
    if not math.isfinite(value) or abs(value) > LARGEST_READ:
        raise ValueError(f"number {value!r}, expected at most {LARGEST_READ:g} in size")
    return np.format_float_positional(value + 0.0, trim="0")
