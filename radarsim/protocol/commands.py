"""The commands of a client: classes that parse lines and encode lines.

An attribute of a command is annotated with its key, a parser and a formatter; an
attribute without a default is required. Fields come in any order. An empty field counts
as missing, and the attribute of a missing field keeps its default.

Positions and angles are in REP-103 frames; this module converts them from and to the
axes of the wire. A command with a malformed field is refused as a whole. Numbers are
written with all digits and without exponent, vectors with commas, and Booleans in lower
case, because servers of all generations read these forms.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, fields, replace
from enum import StrEnum
from functools import partial
from typing import (
    Annotated,
    Any,
    ClassVar,
    Final,
    Self,
    TypeAlias,
    dataclass_transform,
    get_type_hints,
)

import numpy as np

from radarsim.errors import MalformedMessage, expected_one_of
from radarsim.geometry import Pose3, wrap_angle
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.message import (
    LARGEST_COMMANDED,
    Message,
    Triple,
    decode_message,
    flip_axes,
    parse_flag,
    parse_flipped,
    parse_number,
    parse_numbers,
    parse_triple,
    wrapped_pose,
)
from radarsim.protocol.packages import ABSOLUTE, LinkOrder
from radarsim.protocol.watch import ECHO_WORDS, NO_ROBOTS, RobotChoice

Values: TypeAlias = Sequence[str | None]  # a text per key; None omits the key
Read: TypeAlias = Callable[[str], Any]  # parses a text that is not empty
Write: TypeAlias = Callable[[Any], str | None]  # formats a value that is not None
Form: TypeAlias = tuple[Read, Write]

PACKAGE: Final = "USARBot."  # package prefix of robot classes
FOV: Final = "FOV"
VIEWPORTS: Final = tuple(f"Viewport{number}" for number in range(1, 5))
_CONFIGS: Final = ("singleview", "quadview", "0", "1")
# Colours of trails as red, green and blue; the names come from the source code of a
# client.
TRACE_COLOURS: Final = {
    "Red": (1.0, 0.0, 0.0),
    "Yellow": (1.0, 1.0, 0.0),
    "Green": (0.0, 1.0, 0.0),
    "Cyan": (0.0, 1.0, 1.0),
    "White": (1.0, 1.0, 1.0),
    "Blue": (0.0, 0.0, 1.0),
    "Purple": (0.5, 0.0, 0.5),
}

# World controllers are clients that move objects instead of driving a robot. Source of
# the lines: USARSim for UDK (repository hrnr/robocup-usarsim),
# ``USARBotAPI/classes/WorldController.uc`` and ``BotConnection.uc``.
CONTROLLER: Final = "WorldController"  # robot class of a controller, without a body
NOWHERE: Final = (0.0, 0.0, 0.0)  # default vector, as in the original server
CUBE: Final = (1.0, 1.0, 1.0)
LARGEST_PLACE: Final = 1e4  # limit of coordinates and angles of crates, m or rad
_FALLING: Final = ("rigidbody", "falling", "ground")


def format_number(value: float) -> str:
    """Format a number with all digits and without exponent.

    Raises:
        ValueError: If the number is not finite, or larger than ``LARGEST_COMMANDED``.
    """
    if not math.isfinite(value) or abs(value) > LARGEST_COMMANDED:
        limit = f"a magnitude of at most {LARGEST_COMMANDED:g}"
        raise ValueError(f"number {value!r}, expected {limit}")
    # Adding 0.0 turns -0.0 into 0.0.
    return np.format_float_positional(value + 0.0, trim="0")


def _write_vector(values: Sequence[float]) -> str:
    return ",".join(map(format_number, values))


def _write_flipped(values: Triple) -> str:
    return _write_vector(flip_axes(values))


def bare_class(name: str) -> str:
    """Return an Unreal class name without its package, such as ``P3AT``."""
    return name.rpartition(".")[2]


def _write_class(name: str) -> str:
    return name if "." in _checked(name) else PACKAGE + name


def _parse_angle(text: str) -> float:
    return 0.0 - parse_commanded(text)


def _parse_attitude(text: str) -> Triple:
    roll, pitch, yaw = _parse_place(text)
    return wrap_angle(roll), wrap_angle(pitch), wrap_angle(yaw)


def _one_of(words: Sequence[str]) -> Read:
    """Return a parser that accepts only the given words, in any case."""

    def read(text: str) -> str:
        for word in words:
            if word.lower() == text.lower():
                return word
        raise MalformedMessage(expected_one_of(text, list(map(str, words))))

    return read


def _parse_echoes(text: str) -> RobotChoice:
    """Parse a choice of robots: names, ``true`` for all, or ``false`` for none."""
    return RobotChoice.parse(ECHO_WORDS.get(text.strip().casefold(), text))


parse_commanded: Final = partial(parse_number, largest=LARGEST_COMMANDED)
_parse_place: Final = partial(parse_flipped, largest=LARGEST_COMMANDED)
_parse_crate_place: Final = partial(parse_flipped, largest=LARGEST_PLACE)

# Functions that parse and format a field, by which attributes are annotated.
TEXT: Final[Form] = str, lambda text: text or None
NUMBER: Final[Form] = parse_commanded, format_number
# Lines count angles positive to the right, attributes positive to the left.
ANGLE: Final[Form] = _parse_angle, lambda angle: format_number(-angle)
FLAG: Final[Form] = parse_flag, lambda flag: str(flag).lower()
# A Boolean whose field is only written if it is true.
SWITCH: Final[Form] = parse_flag, lambda flag: "true" if flag else None
PLACE: Final[Form] = _parse_place, _write_flipped
ATTITUDE: Final[Form] = _parse_attitude, _write_flipped
CRATE_PLACE: Final[Form] = _parse_crate_place, _write_flipped


_FIELDS: Final[dict[type, Sequence[tuple[str, str, Read, Write, bool]]]] = {}


def _fields_of(command: type) -> Sequence[tuple[str, str, Read, Write, bool]]:
    """Return name, key, parser, formatter of each attribute, and if it is required."""
    if command not in _FIELDS:
        hints = get_type_hints(command, include_extras=True)
        _FIELDS[command] = [
            (each.name, *hints[each.name].__metadata__, each.default is MISSING)
            for each in fields(command)
        ]
    return _FIELDS[command]


@dataclass_transform(frozen_default=True)
class KeyedCommand:
    """Base class of commands, whose annotated attributes become fields of a line.

    Every subclass is a frozen dataclass.

    Attributes:
        verb: First word of the line.
    """

    verb: ClassVar[str]

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True)(cls)

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Create the command from the fields of a parsed line.

        Raises:
            MalformedMessage: If a field is missing or not readable.
        """
        values = {}
        for name, key, read, _write, is_required in _fields_of(cls):
            parse = message.parse if is_required else message.parse_optional
            value = parse(key, read)
            if value is not None:
                values[name] = value
        create: Callable[..., Self] = cls
        return create(**values)

    @property
    def keys(self) -> Sequence[str]:
        """The keys of the ``{Key value}`` fields of the command's line."""
        return [key for _, key, *_others in _fields_of(type(self))]

    def values(self) -> Values:
        """Return the text of each field in the order of ``keys``; None omits it."""
        attributes = [
            (getattr(self, name), write)
            for name, _, _read, write, _required in _fields_of(type(self))
        ]
        return [None if each is None else write(each) for each, write in attributes]


class Init(KeyedCommand):
    """The command INIT, which spawns a robot.

    Attributes:
        class_name: Robot class without its package, in the client's spelling.
        name: Name of the robot; None if the server chooses it.
        start: Name of a start pose; if it is given, position and rotation are None.
        position: x, y, z, m.
        rotation: Roll, pitch, yaw, rad.
        takes_free: Whether the robot takes the first start of the map with room for it,
            even if another pose is requested; an extension of radarsim.
    """

    verb: ClassVar[str] = "INIT"

    class_name: Annotated[str, "ClassName", bare_class, _write_class]
    name: Annotated[str | None, "Name", *TEXT] = None
    start: Annotated[str | None, "Start", *TEXT] = None
    position: Annotated[Triple | None, "Location", *PLACE] = None
    rotation: Annotated[Triple | None, "Rotation", *ATTITUDE] = None
    takes_free: Annotated[bool, "FreeStart", *SWITCH] = False

    @classmethod
    def decode(cls, message: Message, dialect: Dialect) -> Self:
        """Create the command from a parsed line; a named start replaces a pose."""
        if message.get("Start"):
            pose = ("location", "rotation")
            kept = [each for each in message.segments if each[0].lower() not in pose]
            message = Message(message.verb, tuple(kept))
        return super().decode(message, dialect)


MOST_LINKS: Final = 32  # per command, to limit the time to execute one


def _few(orders: Sequence[LinkOrder]) -> tuple[LinkOrder, ...]:
    """Return the link orders of a command as a tuple, if they are not too many.

    Raises:
        MalformedMessage: If there are more than ``MOST_LINKS`` orders.
    """
    if len(orders) > MOST_LINKS:
        raise MalformedMessage(f"{len(orders)} links, expected at most {MOST_LINKS}")
    return tuple(orders)


@dataclass(frozen=True, slots=True)
class MovePackage:
    """Move links of a mission package, such as an arm, a flipper or a camera mount.

    Attributes:
        name: Name of the package.
        orders: Orders for its links, in the order of the fields.
    """

    verb: ClassVar[str] = "MISPKG"

    name: str
    orders: tuple[LinkOrder, ...]

    @classmethod
    def decode(cls, message: Message, _dialect: Dialect) -> Self:
        """Create the command from a parsed line, with one order per field ``Link``.

        ``Rotation`` contains roll, pan and tilt for the two links of a pan-tilt unit.

        Raises:
            MalformedMessage: If a number is not readable, or precedes its ``Link``.
        """
        name = message.require("Name")
        orders: list[LinkOrder] = []
        for key, text in message.segments:
            if key.lower() == "rotation":
                _, pan, tilt = parse_numbers(text, 3, largest=LARGEST_COMMANDED)
                # Pan is positive to the right, but the angle of the first link is
                # positive to the left.
                orders = [LinkOrder(name, 1, 0.0 - pan), LinkOrder(name, 2, tilt)]
            elif key.lower() == "order" and message.get("Rotation"):
                kind = int(parse_commanded(text))
                orders = [each._replace(order=kind) for each in orders]
            elif key.lower() == "link":
                orders.append(LinkOrder(name, int(parse_commanded(text)), 0.0))
            elif key.lower() in ("value", "order"):
                if not orders:
                    raise MalformedMessage(f"{key} before Link, expected Link first")
                number, last = parse_commanded(text), orders.pop()
                if key.lower() == "value":
                    orders.append(last._replace(value=number))
                else:
                    orders.append(last._replace(order=int(number)))
        return cls(name, _few(orders))

    @property
    def keys(self) -> Sequence[str]:
        """The keys of the ``{Key value}`` fields of the command's line."""
        return ["Name", *("Link", "Value", "Order") * len(self.orders)]

    def values(self) -> Values:
        """Return the text of each field in the order of ``keys``."""
        texts = [self.name]
        for order in self.orders:
            texts += [str(order.link), format_number(order.value), str(order.order)]
        return tuple(texts)


class Act(MovePackage):
    """Move links of a mission package, such as an arm, by a command of UDK servers."""

    verb: ClassVar[str] = "ACT"


@dataclass(frozen=True, slots=True)
class MultiDrive:
    """Move several links of a robot, such as flippers, to given joint angles.

    Attributes:
        orders: Orders for links, which are addressed by their own names.
    """

    verb: ClassVar[str] = "MULTIDRIVE"

    orders: tuple[LinkOrder, ...]

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Create the command from a parsed line, whose keys are names of links."""
        return cls(
            _few(
                [
                    LinkOrder(key, None, parse_commanded(text))
                    for key, text in message.segments
                ]
            )
        )

    @property
    def keys(self) -> Sequence[str]:
        """The names of the links, which are the keys of the command's fields."""
        return [order.name for order in self.orders]

    def values(self) -> Values:
        """Return the text of each field in the order of ``keys``."""
        return tuple(format_number(order.value) for order in self.orders)


class Drive(KeyedCommand):
    """Set the speeds, the steering angles, the headlight or a link of a robot.

    A value of None leaves the present setting unchanged.

    Attributes:
        left: Speed of the left wheels in the dialect's drive unit, or in percent of the
            maximum. Without ``right``, it does not move the robot.
        right: Speed of the right wheels, as ``left``; it needs ``left``.
        normalized: Whether speeds are percentages from this command on.
        light: Whether the headlight is on.
        flip: Whether to turn over a robot that lies on its back.
        speed: Wheel speed of a robot with car-like steering, in the unit of ``left``.
        front_steer: Angle of the front wheels, rad, left positive.
        rear_steer: Angle of the rear wheels, rad, left positive.
        joint: Name of a link to move; some clients send the robot's name here.
        value: Angle or speed of the link, see ``LinkOrder``; None to move no link.
        order: Meaning of ``value``, such as ``ABSOLUTE``.
        altitude: Upward speed of a flying robot, m/s, or percent of the maximum if
            this command is normalized.
        linear: Forward speed of a flying robot, in the same unit.
        lateral: Speed of a flying robot to the left, in the same unit.
        rotational: Yaw rate of a flying robot, counter-clockwise, rad/s or percent.
    """

    verb: ClassVar[str] = "DRIVE"

    left: Annotated[float | None, "Left", *NUMBER] = None
    right: Annotated[float | None, "Right", *NUMBER] = None
    normalized: Annotated[bool | None, "Normalized", *FLAG] = None
    light: Annotated[bool | None, "Light", *FLAG] = None
    flip: Annotated[bool | None, "Flip", *FLAG] = None
    speed: Annotated[float | None, "Speed", *NUMBER] = None
    front_steer: Annotated[float | None, "FrontSteer", *ANGLE] = None
    rear_steer: Annotated[float | None, "RearSteer", *ANGLE] = None
    joint: Annotated[str | None, "Name", *TEXT] = None
    value: Annotated[float | None, "Value", *NUMBER] = None
    order: Annotated[
        int,
        "Order",
        lambda text: int(parse_commanded(text)),
        lambda order: str(order) if order else None,
    ] = ABSOLUTE
    altitude: Annotated[float | None, "AltitudeVelocity", *NUMBER] = None
    linear: Annotated[float | None, "LinearVelocity", *NUMBER] = None
    lateral: Annotated[float | None, "LateralVelocity", *ANGLE] = None
    rotational: Annotated[float | None, "RotationalVelocity", *ANGLE] = None

    @classmethod
    def decode(cls, message: Message, dialect: Dialect) -> Self:
        """Create the command; the dialect determines the units and the Booleans."""
        command = super().decode(message, dialect)
        if not dialect.accepts_any_case_true:
            flags: Any = {
                name: message.get(name) == "true"
                for name in ("normalized", "light", "flip")
                if message.get(name)
            }
            command = replace(command, **flags)
        turn = command.rotational
        if turn is not None and dialect.turns_in_degrees and not command.normalized:
            command = replace(command, rotational=math.radians(turn))
        return command


class GetStartPoses(KeyedCommand):
    """Request the start poses of the map."""

    verb: ClassVar[str] = "GETSTARTPOSES"


class _ItemQuery(KeyedCommand):
    """A query about a robot, or about its sensors and other items.

    Attributes:
        type: Type of the items in the client's spelling, which the answer repeats;
            ``Robot`` for the robot itself.
        name: Name of one item; None for all items of the type.
        robot: Name of the robot, case-insensitive; None for the client's own robot.
    """

    type: Annotated[str, "Type", *TEXT]
    name: Annotated[str | None, "Name", *TEXT] = None
    robot: Annotated[str | None, "Robot", *TEXT] = None


class GetGeo(_ItemQuery):
    """Request the dimensions of a robot, or the mounting poses of its items."""

    verb: ClassVar[str] = "GETGEO"


class GetConf(_ItemQuery):
    """Request the settings of a robot, or of its sensors and other items."""

    verb: ClassVar[str] = "GETCONF"


class SetItem(KeyedCommand):
    """Send an opcode, such as ``RESET``, to the items of one type on a robot.

    Attributes:
        type: Type of the items in the client's spelling.
        name: Name of one item; None for all items of the type.
        opcode: ``SCAN``, ``RESET``, ``POSE``, ``ECHOES``, ``TARGETS``, ``SETTING``,
            ``ZOOM`` or ``FOV`` in the client's spelling.
        params: Parameters of the opcode; empty if there are none.
        fov: Always None, because ``decode`` reads a field ``FOV`` as an opcode.
    """

    verb: ClassVar[str] = "SET"

    type: Annotated[str, "Type", *TEXT]
    name: Annotated[str | None, "Name", *TEXT] = None
    opcode: Annotated[str, "Opcode", *TEXT] = ""
    params: Annotated[str, "Params", *TEXT] = ""
    fov: Annotated[None, FOV, lambda _: None, str] = None

    @classmethod
    def decode(cls, message: Message, dialect: Dialect) -> Self:
        """Create the command; a field ``FOV`` of some clients becomes the opcode."""
        angle = message.get(FOV)
        if angle and message.get("Opcode") is None:
            opcode = ("Opcode", FOV), ("Params", angle)
            message = Message(message.verb, (*opcode, *message.segments))
        command = super().decode(message, dialect)
        message.require("Opcode")
        return command


class ShowCamera(KeyedCommand):
    """Choose the robot and camera that the image viewers on a machine show.

    Attributes:
        client: IP address of the machine.
        robot: Name of the robot, case-insensitive; None to cancel the choice.
        name: Name of the robot's camera; None for the picture of its viewports.
        type: Type of the item, always ``Camera``.
    """

    verb: ClassVar[str] = "SET"

    client: Annotated[str, "Client", *TEXT]
    robot: Annotated[str | None, "Robot", *TEXT] = None
    name: Annotated[str | None, "Name", *TEXT] = None
    type: Annotated[str, "Type", str.capitalize, str] = "Camera"


@dataclass(frozen=True, slots=True)
class SetViewports:
    """Choose which one or four cameras of a robot its pictures show.

    Attributes:
        is_quad: Whether a picture shows four cameras instead of one; None keeps the
            present setting.
        cameras: Names of the cameras in the four viewports; ``Disable`` shows none, and
            None keeps the present camera.
    """

    verb: ClassVar[str] = "SET"
    keys: ClassVar[Sequence[str]] = ("Type", "Config", *VIEWPORTS)

    is_quad: bool | None = None
    cameras: tuple[str | None, ...] = (None,) * len(VIEWPORTS)

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Create the command from the fields of a parsed line.

        Raises:
            MalformedMessage: If the value of ``Config`` is unknown.
        """
        config, is_quad = message.get("Config"), None
        if config:
            if config.lower() not in _CONFIGS:
                raise MalformedMessage(f"Config {expected_one_of(config, _CONFIGS)}")
            is_quad = config.lower() in ("quadview", "1")
        return cls(is_quad, tuple(message.get(key) or None for key in VIEWPORTS))

    def values(self) -> Values:
        """Return the text of each field in the order of ``keys``; None omits it."""
        config = None
        if self.is_quad is not None:
            config = "QuadView" if self.is_quad else "SingleView"
        return ("Viewports", config, *self.cameras)


class Trace(KeyedCommand):
    """Draw a trail of marks behind the robot, visible to cameras, as UT2004 servers do.

    Attributes:
        is_on: Whether to draw a trail; False removes the present trail.
        interval: Time between two marks, s.
        colour: One of ``TRACE_COLOURS``.
    """

    verb: ClassVar[str] = "TRACE"

    is_on: Annotated[bool, "On", *FLAG] = False
    interval: Annotated[float, "Interval", *NUMBER] = 1.0
    colour: Annotated[str, "Color", _one_of([*TRACE_COLOURS]), str] = "Red"


class Action(StrEnum):
    """An action on crates by a world controller, which is a client without a robot."""

    CREATE = "Create"
    KILL = "Kill"
    KILL_ALL = "KillAll"
    MOVE_TO = "AbsMove"
    MOVE_BY = "RelMove"
    GET_STATE = "GetSTA"


def _parse_scale(text: str) -> Triple:
    scale = parse_triple(text)
    return scale if any(scale) else CUBE  # as in the original server


class Control(KeyedCommand):
    """Create, move, remove or list crates.

    Attributes:
        action: The action.
        name: Name of the crate, case-insensitive; None for all crates.
        class_name: Class of the crates to create or list.
        position: Position of the crate, or displacement for ``RelMove``: x, y, z, m.
        rotation: Roll, pitch, yaw of the crate, or a rotation by these angles, rad.
        scale: Factors of length, width and height to the size of the class.
        start: Name of a start of the map, which replaces ``position`` of a new crate.
        falls: Whether the new crate falls to the floor.
        stays: Whether the crate remains after its client has disconnected.
        low: Corner of the box in which all crates are removed; None for everywhere.
        high: Opposite corner of the box; None for everywhere.
    """

    verb: ClassVar[str] = "CONTROL"

    action: Annotated[Action, "Type", _one_of([*Action]), str]
    name: Annotated[str | None, "Name", *TEXT] = None
    class_name: Annotated[str | None, "ClassName", bare_class, TEXT[1]] = None
    position: Annotated[Triple, "Location", *CRATE_PLACE] = NOWHERE
    rotation: Annotated[Triple, "Rotation", *CRATE_PLACE] = NOWHERE
    scale: Annotated[Triple, "Scale", _parse_scale, _write_vector] = CUBE
    start: Annotated[str | None, "Start", *TEXT] = None
    falls: Annotated[
        bool,
        "Physics",
        lambda text: text.lower() in _FALLING,
        lambda falls: "RigidBody" if falls else None,
    ] = False
    stays: Annotated[bool, "Permanent", *SWITCH] = False
    low: Annotated[Triple | None, "MinPos", *CRATE_PLACE] = None
    high: Annotated[Triple | None, "MaxPos", *CRATE_PLACE] = None

    @property
    def corners(self) -> tuple[Triple, Triple] | None:
        """Lowest and highest x, y, z of the box in which crates are removed.

        The value is None if crates are removed everywhere.
        """
        if self.low is None or self.high is None or self.low == self.high:
            return None
        low, high = np.sort([self.low, self.high], axis=0).tolist()
        return tuple(low), tuple(high)


class Watch(KeyedCommand):
    """Request copies of the lines to given robots; ends any earlier ``Watch``.

    Attributes:
        robots: The watched robots. Only a watcher of all robots receives lines about
            robots that join or leave.
        echoes: The watched robots whose scanners also send echo lines.
        clock: Whether the watcher receives the simulated time in every tick.
    """

    verb: ClassVar[str] = "WATCH"

    robots: Annotated[RobotChoice, "Robots", RobotChoice.parse, str]
    echoes: Annotated[
        RobotChoice,
        "Echoes",
        _parse_echoes,
        lambda echoes: None if echoes == NO_ROBOTS else str(echoes),
    ] = NO_ROBOTS
    clock: Annotated[bool, "Clock", *SWITCH] = False


# Commands that a client can send only after it has spawned a robot.
RobotCommand: TypeAlias = (
    Drive | MovePackage | MultiDrive | Trace | SetViewports | SetItem
)
OtherCommand: TypeAlias = (
    GetStartPoses | GetGeo | GetConf | ShowCamera | Control | Watch
)
Command: TypeAlias = Init | RobotCommand | OtherCommand

COMMANDS: Final = {
    command.verb: command
    for command in (
        *(Init, Drive, MovePackage, Act, MultiDrive),
        *(GetStartPoses, GetGeo, GetConf, SetItem, Trace, Control, Watch),
    )
}

# Keys without an attribute that are still not reported as unknown: the rotation of a
# pan-tilt unit from a Player driver, and the appearance and the log text of crates.
_NEEDLESS_KEYS: Final = {
    MovePackage.verb: ["Type", "Rotation"],
    Control.verb: ["Material", "Memory"],
}


def parse_command(line: str, dialect: Dialect) -> tuple[Command, Sequence[str]]:
    """Parse a line from a client and return its command.

    Returns:
        The command, and the keys of unknown fields. Clients of other servers send such
        fields; keys in ``_NEEDLESS_KEYS`` are not returned.

    Raises:
        MalformedMessage: If the line is not a command, lacks a required field, or has
            a field that is not readable.
    """
    message = decode_message(line, keeps_closed=True)
    verb = message.verb.upper()
    if verb not in COMMANDS:
        expected = expected_one_of(message.verb, sorted(COMMANDS))
        raise MalformedMessage(f"verb {expected}")
    form: Any = COMMANDS[verb]
    if verb == SetItem.verb and message.get("Opcode") is None:
        wanted = (message.get("Type") or "").casefold()
        if wanted == "viewports":
            form = SetViewports
        elif wanted == "camera" and message.get("Client"):
            form = ShowCamera
    command: Command = form.decode(message, dialect)
    known = {key.lower() for key in (*command.keys, *_NEEDLESS_KEYS.get(verb, ()))}
    keys = (key for key, _ in message.segments)
    return command, [key for key in keys if key.lower() not in known]


def encode_command(command: Command) -> str:
    """Encode a command as a line of the protocol, without a line end.

    Raises:
        ValueError: If a number is not finite or larger than ``LARGEST_COMMANDED``, or a
            text contains line ends, braces or non-ASCII characters.
    """
    fields = zip(command.keys, command.values(), strict=True)
    given = tuple((key, _checked(text)) for key, text in fields if text is not None)
    return Message(command.verb, given).encode()


def parse_pose(params: str) -> Pose3:
    """Parse a pose that a client sets: ``x,y,z,roll,pitch,yaw`` in the wire frame.

    Raises:
        MalformedMessage: If the text is not six numbers.
    """
    x, y, z, roll, pitch, yaw = parse_numbers(params, 6, largest=LARGEST_COMMANDED)
    return wrapped_pose(flip_axes((x, y, z)), flip_axes((roll, pitch, yaw)))


def parse_switch(params: str) -> bool:
    """Parse the parameter of the opcode ECHOES: ``true`` or ``false`` in any case.

    Raises:
        MalformedMessage: If the text is another word.
    """
    word = params.strip().lower()
    if word not in ("true", "false"):
        raise MalformedMessage(f"{params[:80]!r}, expected 'true' or 'false'")
    return word == "true"


def _checked(text: object) -> str:
    """Return a text for a field, after a check that it does not end the field.

    Raises:
        ValueError: If the text is not printable ASCII without braces, or no ``str``.
    """
    if isinstance(text, str):
        if text.isascii() and text.isprintable() and not {*text} & {"{", "}"}:
            return text
        text = text[:80]
    raise ValueError(f"text {text!r}, expected printable ASCII without braces")
