"""The commands of a client: one table of fields each, from lines and to lines.

An attribute of a command is annotated with its key, how its text is read, and how its
value is written; an attribute without a default is required. Fields come in any order,
and an empty field is a missing one, which leaves the attribute its default.

Positions and angles are in REP-103 frames; the axes of the wire are converted here. A
command is parsed completely or refused, so that a bad number in one field never leaves
half of the command. Written numbers have all their digits and no exponent, vectors have
commas, and truth values are lower case: servers of all generations read that.
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

Values: TypeAlias = Sequence[str | None]  # one for each key; None leaves it out
Read: TypeAlias = Callable[[str], Any]  # of a text that is not empty
Write: TypeAlias = Callable[[Any], str | None]  # of a value that is not None
Form: TypeAlias = tuple[Read, Write]

PACKAGE: Final = "USARBot."  # of robot classes
FOV: Final = "FOV"
VIEWPORTS: Final = tuple(f"Viewport{number}" for number in range(1, 5))
_CONFIGS: Final = ("singleview", "quadview", "0", "1")
# As a client lists them: red, green and blue of each.
TRACE_COLOURS: Final = {
    "Red": (1.0, 0.0, 0.0),
    "Yellow": (1.0, 1.0, 0.0),
    "Green": (0.0, 1.0, 0.0),
    "Cyan": (0.0, 1.0, 1.0),
    "White": (1.0, 1.0, 1.0),
    "Blue": (0.0, 0.0, 1.0),
    "Purple": (0.5, 0.0, 0.5),
}

# World controllers: clients that move things instead of driving a robot. Source of the
# lines: USARSim for UDK (repository hrnr/robocup-usarsim),
# ``USARBotAPI/classes/WorldController.uc`` and ``BotConnection.uc``.
CONTROLLER: Final = "WorldController"  # class of robots; it has no body
NOWHERE: Final = (0.0, 0.0, 0.0)  # as the original, which reads missing numbers as 0
CUBE: Final = (1.0, 1.0, 1.0)
LARGEST_PLACE: Final = 1e4  # m; rad
_FALLING: Final = ("rigidbody", "falling", "ground")


def format_number(value: float) -> str:
    """Write a number.

    Raises:
        ValueError: If it is not finite, or too large to be read.
    """
    if not math.isfinite(value) or abs(value) > LARGEST_COMMANDED:
        limit = f"at most {LARGEST_COMMANDED:g} in size"
        raise ValueError(f"number {value!r}, expected {limit}")
    # The sum makes 0.0 of -0.0, whose sign no server needs.
    return np.format_float_positional(value + 0.0, trim="0")


def _write_vector(values: Sequence[float]) -> str:
    return ",".join(map(format_number, values))


def _write_flipped(values: Triple) -> str:
    return _write_vector(flip_axes(values))


def bare_class(name: str) -> str:
    """Return the name of a class without its package."""
    return name.rpartition(".")[2]


def _write_class(name: str) -> str:
    return name if "." in _checked(name) else PACKAGE + name


def _parse_angle(text: str) -> float:
    return 0.0 - parse_commanded(text)


def _parse_attitude(text: str) -> Triple:
    roll, pitch, yaw = _parse_place(text)
    return wrap_angle(roll), wrap_angle(pitch), wrap_angle(yaw)


def _one_of(words: Sequence[str]) -> Read:
    """Return what reads one of some words in any case."""

    def read(text: str) -> str:
        for word in words:
            if word.lower() == text.lower():
                return word
        raise MalformedMessage(expected_one_of(text, list(map(str, words))))

    return read


def _parse_echoes(text: str) -> RobotChoice:
    """Parse a choice of robots, or whether all of them are meant."""
    return RobotChoice.parse(ECHO_WORDS.get(text.strip().casefold(), text))


parse_commanded: Final = partial(parse_number, largest=LARGEST_COMMANDED)
_parse_place: Final = partial(parse_flipped, largest=LARGEST_COMMANDED)
_parse_crate_place: Final = partial(parse_flipped, largest=LARGEST_PLACE)

# How attributes are read and written.
TEXT: Final[Form] = str, lambda text: text or None
NUMBER: Final[Form] = parse_commanded, format_number
# On the wire the right is positive.
ANGLE: Final[Form] = _parse_angle, lambda angle: format_number(-angle)
FLAG: Final[Form] = parse_flag, lambda flag: str(flag).lower()
# A truth value that is false where it is missing.
SWITCH: Final[Form] = parse_flag, lambda flag: "true" if flag else None
PLACE: Final[Form] = _parse_place, _write_flipped
ATTITUDE: Final[Form] = _parse_attitude, _write_flipped
CRATE_PLACE: Final[Form] = _parse_crate_place, _write_flipped


_FIELDS: Final[dict[type, Sequence[tuple[str, str, Read, Write, bool]]]] = {}


def _fields_of(command: type) -> Sequence[tuple[str, str, Read, Write, bool]]:
    """Return name, key, reader and writer of each attribute, and if it is required."""
    if command not in _FIELDS:
        hints = get_type_hints(command, include_extras=True)
        _FIELDS[command] = [
            (each.name, *hints[each.name].__metadata__, each.default is MISSING)
            for each in fields(command)
        ]
    return _FIELDS[command]


@dataclass_transform(frozen_default=True)
class KeyedCommand:
    """A command whose line follows from the annotations of its attributes.

    Every subclass is a frozen dataclass.

    Attributes:
        verb: First word of the line.
    """

    verb: ClassVar[str]

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True)(cls)

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Read the command from its message.

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
        """The keys of its fields."""
        return [key for _, key, *_others in _fields_of(type(self))]

    def values(self) -> Values:
        """Return the text for each of ``keys``."""
        attributes = [
            (getattr(self, name), write)
            for name, _, _read, write, _required in _fields_of(type(self))
        ]
        return [None if each is None else write(each) for each, write in attributes]


class Init(KeyedCommand):
    """Spawn a robot.

    Attributes:
        class_name: Robot class without its package, in the client's spelling.
        name: Name of the robot; None if the server chooses it.
        start: Name of a start pose; if it is given, position and rotation are None.
        position: x, y, z, m.
        rotation: Roll, pitch, yaw, rad.
        takes_free: Whether the robot takes the first start of the map at which it has
            room, whatever its own is; only radarsim knows this.
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
        """Read the command; the original ignores a pose with a Start, too."""
        if message.get("Start"):
            pose = ("location", "rotation")
            kept = [each for each in message.segments if each[0].lower() not in pose]
            message = Message(message.verb, tuple(kept))
        return super().decode(message, dialect)


MOST_LINKS: Final = 32  # in a command, so that none takes long


def _few(orders: Sequence[LinkOrder]) -> tuple[LinkOrder, ...]:
    """Return orders that are not too many.

    Raises:
        MalformedMessage: If they are.
    """
    if len(orders) > MOST_LINKS:
        raise MalformedMessage(f"{len(orders)} links, expected at most {MOST_LINKS}")
    return tuple(orders)


@dataclass(frozen=True, slots=True)
class MovePackage:
    """Move links of a mission package.

    Attributes:
        name: Name of the package.
        orders: Orders for its links, in sequence.
    """

    verb: ClassVar[str] = "MISPKG"

    name: str
    orders: tuple[LinkOrder, ...]

    @classmethod
    def decode(cls, message: Message, _dialect: Dialect) -> Self:
        """Read the command from its message, whose fields are in order.

        A ``Rotation`` stands for the orders of a pan-tilt: roll, pan and tilt.

        Raises:
            MalformedMessage: If a number is not readable, or stands before its link.
        """
        name = message.require("Name")
        orders: list[LinkOrder] = []
        for key, text in message.segments:
            if key.lower() == "rotation":
                _, pan, tilt = parse_numbers(text, 3, largest=LARGEST_COMMANDED)
                # On the wire the right is positive; the first link turns to the left.
                orders = [LinkOrder(name, 1, 0.0 - pan), LinkOrder(name, 2, tilt)]
            elif key.lower() == "order" and message.get("Rotation"):
                kind = int(parse_commanded(text))
                orders = [each._replace(order=kind) for each in orders]
            elif key.lower() == "link":
                orders.append(LinkOrder(name, int(parse_commanded(text)), 0.0))
            elif key.lower() in ("value", "order"):
                if not orders:
                    raise MalformedMessage(f"{key} before a Link, expected it after")
                number, last = parse_commanded(text), orders.pop()
                if key.lower() == "value":
                    orders.append(last._replace(value=number))
                else:
                    orders.append(last._replace(order=int(number)))
        return cls(name, _few(orders))

    @property
    def keys(self) -> Sequence[str]:
        """The keys of its fields."""
        return ["Name", *("Link", "Value", "Order") * len(self.orders)]

    def values(self) -> Values:
        """Return the text for each of ``keys``."""
        texts = [self.name]
        for order in self.orders:
            texts += [str(order.link), format_number(order.value), str(order.order)]
        return tuple(texts)


class Act(MovePackage):
    """The same on servers for UDK."""

    verb: ClassVar[str] = "ACT"


@dataclass(frozen=True, slots=True)
class MultiDrive:
    """Turn several links to angles.

    Attributes:
        orders: Orders for links, each by its own name.
    """

    verb: ClassVar[str] = "MULTIDRIVE"

    orders: tuple[LinkOrder, ...]

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Read the command from its message, whose keys are names of links."""
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
        """The names of the links."""
        return [order.name for order in self.orders]

    def values(self) -> Values:
        """Return the text for each of ``keys``."""
        return tuple(format_number(order.value) for order in self.orders)


class Drive(KeyedCommand):
    """Set wheel speeds and lamps; None leaves them as they are.

    Attributes:
        left: Wheel speed in the dialect's drive unit, or percent of the maximum.
        right: Likewise; a command with only one of the two does not move the robot.
        normalized: Whether speeds are percentages from this command on.
        light: Whether the headlight is on.
        flip: Whether to turn over a robot that lies on its back.
        speed: Wheel speed of a robot that steers as a car does, as ``left``.
        front_steer: Angle of its front wheels, rad, left positive.
        rear_steer: Angle of its rear wheels, likewise.
        joint: Name of a link to move; clients also send the robot's name there.
        value: Value of its order, as of ``LinkOrder``; None if no link is meant.
        order: How the value is meant.
        altitude: Speed upwards of a robot that flies, m/s, or percent of the maximum if
            this command is normalized.
        linear: Its speed ahead, likewise.
        lateral: Its speed to the left, likewise.
        rotational: Its turn rate, counter-clockwise, rad/s, likewise.
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
        """Read the command, with the units and truth values of a dialect."""
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
    """Ask for the start poses of the map."""

    verb: ClassVar[str] = "GETSTARTPOSES"


class _ItemQuery(KeyedCommand):
    """A question about the robot or its items.

    Attributes:
        type: Type of the items in the client's spelling, which the answer repeats;
            ``Robot`` for the robot itself.
        name: Name of one item; None for all items of the type.
        robot: Name of the robot, in any case; None for the client's own.
    """

    type: Annotated[str, "Type", *TEXT]
    name: Annotated[str | None, "Name", *TEXT] = None
    robot: Annotated[str | None, "Robot", *TEXT] = None


class GetGeo(_ItemQuery):
    """Ask where items are mounted, or for the dimensions of the robot."""

    verb: ClassVar[str] = "GETGEO"


class GetConf(_ItemQuery):
    """Ask for the settings of items or of the robot."""

    verb: ClassVar[str] = "GETCONF"


class SetItem(KeyedCommand):
    """Send an opcode to items of one type.

    Attributes:
        type: Type of the items in the client's spelling.
        name: Name of one item; None for all items of the type.
        opcode: ``SCAN``, ``RESET``, ``POSE``, ``ECHOES``, ``TARGETS``, ``SETTING``,
            ``ZOOM`` or ``FOV`` in the client's spelling.
        params: Parameters of the opcode; empty if there are none.
        fov: Always None: a field of view is read as an opcode.
    """

    verb: ClassVar[str] = "SET"

    type: Annotated[str, "Type", *TEXT]
    name: Annotated[str | None, "Name", *TEXT] = None
    opcode: Annotated[str, "Opcode", *TEXT] = ""
    params: Annotated[str, "Params", *TEXT] = ""
    fov: Annotated[None, FOV, lambda _: None, str] = None

    @classmethod
    def decode(cls, message: Message, dialect: Dialect) -> Self:
        """Read the command; students' clients write a field of view as a field."""
        angle = message.get(FOV)
        if angle and message.get("Opcode") is None:
            opcode = ("Opcode", FOV), ("Params", angle)
            message = Message(message.verb, (*opcode, *message.segments))
        command = super().decode(message, dialect)
        message.require("Opcode")
        return command


class ShowCamera(KeyedCommand):
    """Choose whose camera the viewers of pictures on a machine see.

    Attributes:
        client: Address of the machine.
        robot: Name of the robot, in any case; None to choose none.
        name: Name of its camera; None for what its viewports show.
        type: Type of the items.
    """

    verb: ClassVar[str] = "SET"

    client: Annotated[str, "Client", *TEXT]
    robot: Annotated[str | None, "Robot", *TEXT] = None
    name: Annotated[str | None, "Name", *TEXT] = None
    type: Annotated[str, "Type", str.capitalize, str] = "Camera"


@dataclass(frozen=True, slots=True)
class SetViewports:
    """Choose which cameras of a robot a picture shows.

    Attributes:
        is_quad: Whether a picture shows four cameras, not one; None leaves it.
        cameras: Names of the cameras in the four viewports; ``Disable`` for none. None
            leaves a viewport as it is.
    """

    verb: ClassVar[str] = "SET"
    keys: ClassVar[Sequence[str]] = ("Type", "Config", *VIEWPORTS)

    is_quad: bool | None = None
    cameras: tuple[str | None, ...] = (None,) * len(VIEWPORTS)

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Read the command from its message.

        Raises:
            MalformedMessage: If there is no such configuration.
        """
        config, is_quad = message.get("Config"), None
        if config:
            if config.lower() not in _CONFIGS:
                raise MalformedMessage(f"Config {expected_one_of(config, _CONFIGS)}")
            is_quad = config.lower() in ("quadview", "1")
        return cls(is_quad, tuple(message.get(key) or None for key in VIEWPORTS))

    def values(self) -> Values:
        """Return the text for each of ``keys``."""
        config = None
        if self.is_quad is not None:
            config = "QuadView" if self.is_quad else "SingleView"
        return ("Viewports", config, *self.cameras)


class Trace(KeyedCommand):
    """Leave a trail that cameras see, as servers for UT2004 draw one.

    Attributes:
        is_on: Whether to leave one; if not, what there is vanishes.
        interval: Time between two marks, s.
        colour: One of ``TRACE_COLOURS``.
    """

    verb: ClassVar[str] = "TRACE"

    is_on: Annotated[bool, "On", *FLAG] = False
    interval: Annotated[float, "Interval", *NUMBER] = 1.0
    colour: Annotated[str, "Color", _one_of([*TRACE_COLOURS]), str] = "Red"


class Action(StrEnum):
    """What a world controller does."""

    CREATE = "Create"
    KILL = "Kill"
    KILL_ALL = "KillAll"
    MOVE_TO = "AbsMove"
    MOVE_BY = "RelMove"
    GET_STATE = "GetSTA"


def _parse_scale(text: str) -> Triple:
    scale = parse_triple(text)
    return scale if any(scale) else CUBE  # as the original


class Control(KeyedCommand):
    """Create, move, remove or list crates.

    Attributes:
        action: What to do.
        name: Name of the crate, in any case; None for all of them.
        class_name: Class of the objects that are created or listed.
        position: Where it is put, or by what it is moved: x, y, z, m.
        rotation: Roll, pitch, yaw, rad.
        scale: Length, width and height of the created object, in those of its class.
        start: Start of the map at which it is created instead.
        falls: Whether the created object falls to the floor.
        stays: Whether it is still there when its client has left.
        low: A corner of the space in which all are removed; None for everywhere.
        high: The opposite corner, likewise.
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
        """Lowest and highest x, y, z of the space in which all are removed.

        None for everywhere.
        """
        if self.low is None or self.high is None or self.low == self.high:
            return None
        low, high = np.sort([self.low, self.high], axis=0).tolist()
        return tuple(low), tuple(high)


class Watch(KeyedCommand):
    """Watch robots from now on, instead of those watched before.

    Attributes:
        robots: The robots; only with all of them the watcher gets which there are.
        echoes: Those of them whose scanners list their echoes.
        clock: Whether the watcher gets the time in every tick.
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


# Those that need a robot.
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

# Angles of a pan-tilt, as a driver of Player and older servers have them; of crates
# their looks and a text that only logs tell.
_NEEDLESS_KEYS: Final = {
    MovePackage.verb: ["Type", "Rotation"],
    Control.verb: ["Material", "Memory"],
}


def parse_command(line: str, dialect: Dialect) -> tuple[Command, Sequence[str]]:
    """Parse one line of a client.

    Returns:
        The command, and the keys of fields that it does not have, since clients of
        other servers send some. Fields that drive commands of common clients have
        without need are not among them.

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
    """Write a command as one line without its end.

    Raises:
        ValueError: If a number in it is not finite or too large to be read, or a text
            contains line ends, braces or non-ASCII characters.
    """
    fields = zip(command.keys, command.values(), strict=True)
    given = tuple((key, _checked(text)) for key, text in fields if text is not None)
    return Message(command.verb, given).encode()


def parse_pose(params: str) -> Pose3:
    """Parse ``x,y,z,roll,pitch,yaw`` in the wire's frame, the parameters of INS POSE.

    Raises:
        MalformedMessage: If the text is not six numbers.
    """
    x, y, z, roll, pitch, yaw = parse_numbers(params, 6, largest=LARGEST_COMMANDED)
    return wrapped_pose(flip_axes((x, y, z)), flip_axes((roll, pitch, yaw)))


def parse_switch(params: str) -> bool:
    """Parse ``true`` or ``false`` in any case, the parameters of ECHOES.

    Raises:
        MalformedMessage: If the text is neither.
    """
    word = params.strip().lower()
    if word not in ("true", "false"):
        raise MalformedMessage(f"{params[:80]!r}, expected 'true' or 'false'")
    return word == "true"


def _checked(text: object) -> str:
    """Return a text that cannot end its field or its line.

    Raises:
        ValueError: If it could, or it is no text.
    """
    if isinstance(text, str):
        if text.isascii() and text.isprintable() and not {*text} & {"{", "}"}:
            return text
        text = text[:80]
    raise ValueError(f"text {text!r}, expected printable ASCII without braces")
