"""The commands of a client, from lines and to lines.

Positions and angles are in REP-103 frames; the axes of the wire are converted here. A
command is parsed completely or refused, so that a bad number in one field never leaves
half of the command. Fields come in any order, and an empty field is a missing one.

Written numbers have all their digits and no exponent, vectors have commas, and truth
values are lower case: servers of all generations read that.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Final, Self, TypeAlias

import numpy as np

from radarsim.errors import MalformedMessage, expected_one_of
from radarsim.geometry import Pose3, wrap_angle
from radarsim.protocol.control import UNSUPPORTED_ACTIONS, Control
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
    wrapped_pose,
)
from radarsim.protocol.packages import ABSOLUTE, LinkOrder
from radarsim.protocol.watch import Watch

PACKAGE: Final = "USARBot."  # of robot classes

_parse_number = partial(parse_number, largest=LARGEST_COMMANDED)
_parse_flipped = partial(parse_flipped, largest=LARGEST_COMMANDED)


def _parse_angle(text: str) -> float:
    return 0.0 - _parse_number(text)


def _parse_attitude(text: str) -> Triple:
    roll, pitch, yaw = _parse_flipped(text)
    return wrap_angle(roll), wrap_angle(pitch), wrap_angle(yaw)


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
Values: TypeAlias = tuple[str | None, ...]  # one for each key; None leaves it out


@dataclass(frozen=True, slots=True)
class Init:
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
    keys: ClassVar[Sequence[str]] = [
        "ClassName",
        "Name",
        "Start",
        "Location",
        "Rotation",
        "FreeStart",
    ]

    class_name: str
    name: str | None = None
    start: str | None = None
    position: Triple | None = None
    rotation: Triple | None = None
    takes_free: bool = False

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Read the command from its message."""
        class_name = message.require("ClassName").rpartition(".")[2]
        name = message.get("Name") or None
        start = message.get("Start") or None
        takes_free = bool(message.parse_optional("FreeStart", parse_flag))
        # The original ignores Location and Rotation beside a Start, too.
        if start is not None:
            return cls(class_name, name, start, takes_free=takes_free)
        return cls(
            class_name,
            name,
            position=message.parse_optional("Location", _parse_flipped),
            rotation=message.parse_optional("Rotation", _parse_attitude),
            takes_free=takes_free,
        )

    def values(self) -> Values:
        """Return the text for each of ``keys``."""
        class_name = _checked(self.class_name)
        return (
            class_name if "." in class_name else PACKAGE + class_name,
            self.name,
            self.start,
            None if self.position is None else _format_vector(flip_axes(self.position)),
            None if self.rotation is None else _format_vector(flip_axes(self.rotation)),
            "true" if self.takes_free else None,
        )


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
        orders: What its links are told, in order.
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
                kind = int(_parse_number(text))
                orders = [each._replace(order=kind) for each in orders]
            elif key.lower() == "link":
                orders.append(LinkOrder(name, int(_parse_number(text)), 0.0))
            elif key.lower() in ("value", "order"):
                if not orders:
                    raise MalformedMessage(f"{key} before a Link, expected it after")
                number, last = _parse_number(text), orders.pop()
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
            texts += [str(order.link), _format_number(order.value), str(order.order)]
        return tuple(texts)


@dataclass(frozen=True, slots=True)
class Act(MovePackage):
    """The same on servers for UDK."""

    verb: ClassVar[str] = "ACT"


@dataclass(frozen=True, slots=True)
class MultiDrive:
    """Turn several links to angles.

    Attributes:
        orders: What links are told, each by its own name.
    """

    verb: ClassVar[str] = "MULTIDRIVE"

    orders: tuple[LinkOrder, ...]

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Read the command from its message, whose keys are names of links."""
        return cls(
            _few(
                [
                    LinkOrder(key, None, _parse_number(text))
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
        return tuple(_format_number(order.value) for order in self.orders)


@dataclass(frozen=True, slots=True)
class Drive:
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
        value: What the link is told, as of ``LinkOrder``; None if no link is meant.
        order: How the value is meant.
        altitude: Speed upwards of a robot that flies, m/s, or percent of the maximum if
            this command is normalized.
        linear: Its speed ahead, likewise.
        lateral: Its speed to the left, likewise.
        rotational: Its turn rate, counter-clockwise, rad/s, likewise.
    """

    verb: ClassVar[str] = "DRIVE"
    keys: ClassVar[Sequence[str]] = [
        *("Left", "Right", "Normalized", "Light", "Flip"),
        *("Speed", "FrontSteer", "RearSteer", "Name", "Value", "Order"),
        *("AltitudeVelocity", "LinearVelocity", "LateralVelocity"),
        "RotationalVelocity",
    ]

    left: float | None = None
    right: float | None = None
    normalized: bool | None = None
    light: bool | None = None
    flip: bool | None = None
    speed: float | None = None
    front_steer: float | None = None
    rear_steer: float | None = None
    joint: str | None = None
    value: float | None = None
    order: int = ABSOLUTE
    altitude: float | None = None
    linear: float | None = None
    lateral: float | None = None
    rotational: float | None = None

    @classmethod
    def decode(cls, message: Message, dialect: Dialect) -> Self:
        """Read the command from its message."""
        flag = partial(parse_flag, any_case=dialect.accepts_any_case_true)
        normalized = message.parse_optional("Normalized", flag)
        turn = message.parse_optional("RotationalVelocity", _parse_angle)
        if turn is not None and dialect.turns_in_degrees and not normalized:
            turn = math.radians(turn)
        return cls(
            altitude=message.parse_optional("AltitudeVelocity", _parse_number),
            linear=message.parse_optional("LinearVelocity", _parse_number),
            lateral=message.parse_optional("LateralVelocity", _parse_angle),
            rotational=turn,
            left=message.parse_optional("Left", _parse_number),
            right=message.parse_optional("Right", _parse_number),
            speed=message.parse_optional("Speed", _parse_number),
            front_steer=message.parse_optional("FrontSteer", _parse_angle),
            rear_steer=message.parse_optional("RearSteer", _parse_angle),
            joint=message.get("Name") or None,
            value=message.parse_optional("Value", _parse_number),
            order=int(message.parse_optional("Order", _parse_number) or ABSOLUTE),
            normalized=normalized,
            light=message.parse_optional("Light", flag),
            flip=message.parse_optional("Flip", flag),
        )

    def values(self) -> Values:
        """Return the text for each of ``keys``."""
        flags = (self.normalized, self.light, self.flip)
        # On the wire the right is positive.
        steers = (self.front_steer, self.rear_steer, self.lateral, self.rotational)
        front, rear, right, clockwise = (
            None if each is None else -each for each in steers
        )
        return (
            _number_text(self.left),
            _number_text(self.right),
            *(None if flag is None else str(flag).lower() for flag in flags),
            _number_text(self.speed),
            _number_text(front),
            _number_text(rear),
            self.joint,
            _number_text(self.value),
            str(self.order) if self.order else None,
            *map(_number_text, (self.altitude, self.linear, right, clockwise)),
        )


@dataclass(frozen=True, slots=True)
class GetStartPoses:
    """Ask for the start poses of the map."""

    verb: ClassVar[str] = "GETSTARTPOSES"
    keys: ClassVar[Sequence[str]] = ()

    @classmethod
    def decode(cls, _message: Message, _dialect: Dialect) -> Self:
        """Return the command; it has no fields."""
        return cls()

    def values(self) -> Values:
        """Return nothing; the command has no fields."""
        return ()


@dataclass(frozen=True, slots=True)
class _ItemQuery:
    """A question about the robot or its items.

    Attributes:
        type: Type of the items in the client's spelling, which the answer repeats;
            ``Robot`` for the robot itself.
        name: Name of one item; None for all items of the type.
        robot: Name of the robot, in any case; None for the client's own.
    """

    keys: ClassVar[Sequence[str]] = ("Type", "Name", "Robot")

    type: str
    name: str | None = None
    robot: str | None = None

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Read the command from its message."""
        name, robot = message.get("Name"), message.get("Robot")
        return cls(message.require("Type"), name or None, robot or None)

    def values(self) -> Values:
        """Return the text for each of ``keys``."""
        return (self.type, self.name, self.robot)


@dataclass(frozen=True, slots=True)
class GetGeo(_ItemQuery):
    """Ask where items are mounted, or for the dimensions of the robot."""

    verb: ClassVar[str] = "GETGEO"


@dataclass(frozen=True, slots=True)
class GetConf(_ItemQuery):
    """Ask for the settings of items or of the robot."""

    verb: ClassVar[str] = "GETCONF"


@dataclass(frozen=True, slots=True)
class SetItem:
    """Send an opcode to items of one type.

    Attributes:
        type: Type of the items in the client's spelling.
        name: Name of one item; None for all items of the type.
        opcode: ``SCAN``, ``RESET``, ``POSE``, ``ECHOES``, ``TARGETS``, ``SETTING``,
            ``ZOOM`` or ``FOV`` in the client's spelling.
        params: Parameters of the opcode; empty if there are none.
    """

    verb: ClassVar[str] = "SET"
    keys: ClassVar[Sequence[str]] = ("Type", "Name", "Opcode", "Params", FOV)

    type: str
    name: str | None
    opcode: str
    params: str = ""

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Read the command from its message."""
        params = message.get("Params")
        opcode = message.get("Opcode")
        if opcode is None and message.get(FOV):  # as students' clients write it
            opcode, params = FOV, message.get(FOV)
        return cls(
            message.require("Type"),
            message.get("Name") or None,
            message.require("Opcode") if opcode is None else opcode,
            params or "",
        )

    def values(self) -> Values:
        """Return the text for each of ``keys``."""
        return (self.type, self.name, self.opcode, self.params or None, None)


@dataclass(frozen=True, slots=True)
class ShowCamera:
    """Choose whose camera the viewers of pictures on a machine see.

    Attributes:
        client: Address of the machine.
        robot: Name of the robot, in any case; None to choose none.
        name: Name of its camera; None for what its viewports show.
    """

    verb: ClassVar[str] = "SET"
    keys: ClassVar[Sequence[str]] = ("Type", "Robot", "Name", "Client")

    client: str
    robot: str | None = None
    name: str | None = None

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Read the command from its message."""
        robot, name = message.get("Robot"), message.get("Name")
        return cls(message.require("Client"), robot or None, name or None)

    def values(self) -> Values:
        """Return the text for each of ``keys``."""
        return ("Camera", self.robot, self.name, self.client)


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


@dataclass(frozen=True, slots=True)
class Trace:
    """Leave a trail that cameras see, as servers for UT2004 draw one.

    Attributes:
        is_on: Whether to leave one; if not, what there is vanishes.
        interval: Time between two marks, s.
        colour: One of ``TRACE_COLOURS``.
    """

    verb: ClassVar[str] = "TRACE"
    keys: ClassVar[Sequence[str]] = ("On", "Interval", "Color")

    is_on: bool
    interval: float = 1.0
    colour: str = "Red"

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Read the command from its message.

        Raises:
            MalformedMessage: If the interval is no number, or there is no such colour.
        """
        interval = message.parse_optional("Interval", _parse_number)
        wanted = message.get("Color") or "Red"
        colour = wanted.capitalize()
        if colour not in TRACE_COLOURS:
            raise MalformedMessage(f"Color {expected_one_of(wanted, TRACE_COLOURS)}")
        is_on = parse_flag(message.get("On") or "")
        return cls(is_on, 1.0 if interval is None else interval, colour)

    def values(self) -> Values:
        """Return the text for each of ``keys``."""
        return (str(self.is_on).lower(), _format_number(self.interval), self.colour)


@dataclass(frozen=True, slots=True)
class Unsupported:
    """A command that other USARSim servers know and this one accepts without effect."""

    keys: ClassVar[Sequence[str]] = ()

    verb: str

    def values(self) -> Values:
        """Return nothing; the fields of the command are not kept."""
        return ()


Command: TypeAlias = (
    Init
    | Drive
    | MovePackage
    | MultiDrive
    | GetStartPoses
    | GetGeo
    | GetConf
    | SetItem
    | ShowCamera
    | SetViewports
    | Trace
    | Control
    | Watch
    | Unsupported
)


@dataclass(frozen=True, slots=True)
class ParsedCommand:
    """A command and what its line has besides.

    Attributes:
        command: The command.
        unknown_keys: Keys of fields that the command does not have; clients of other
            servers send some. Empty for a command without effect. Fields that drive
            commands of common clients have without need are not among them.
        unsupported_keys: Keys of fields for vehicles that this server does not have.
    """

    command: Command
    unknown_keys: tuple[str, ...] = ()
    unsupported_keys: tuple[str, ...] = ()


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

# Fields for boats, and for single wheels and joints.
_UNSUPPORTED_KEYS: Final = {
    Drive.verb: [
        "Propeller",
        "Rudder",
        "SternPlane",
        "WheelNumber",
        "WheelSpeed",
        "WheelSteer",
        "Steer",
        "Bone",
        "Axis",
    ]
}

# Types of items of the servers of all generations that no robot carries here.
UNSUPPORTED_TYPES: Final = frozenset(
    [
        "Acoustic",
        "Actuator",
        "CO2Sensor",
        "Effecter",
        "Gripper",
        "HumanMotion",
        "Joint",
        "MisPkg",
        "ObjectSensor",
        "RangeImager",
        "RFID",
        "Sound",
        "ToolChanger",
        "VictSensor",
    ]
)

# Verbs of the servers of all generations that do nothing to a wheeled robot here.
_UNSUPPORTED: Final = frozenset(
    [
        "CAMERA",
        "GETCLOSESTPATHNODE",
        "GETNFO",
        "GETPATHNODES",
        "GOTO",
        "MOVE",
        "PAUSE",
        "PING",
        "TEST",
    ]
)


def parse_command(line: str, dialect: Dialect) -> ParsedCommand:
    """Parse one line of a client.

    Raises:
        MalformedMessage: If the line is not a command, lacks a required field, or has
            a field that is not readable.
    """
    message = decode_message(line, keeps_closed=True)
    # The original never answers with an error, so that what other servers know and this
    # one does not has to pass in silence too.
    verb = message.verb.upper()
    if verb in _UNSUPPORTED:
        return ParsedCommand(Unsupported(verb))
    if verb not in COMMANDS:
        expected = expected_one_of(message.verb, sorted(COMMANDS))
        raise MalformedMessage(f"verb {expected}")
    form: Any = COMMANDS[verb]
    if verb == Control.verb:
        for action in UNSUPPORTED_ACTIONS:
            if action.casefold() == (message.get("Type") or "").casefold():
                return ParsedCommand(Unsupported(f"{verb} {action}"))
    if verb == SetItem.verb and message.get("Opcode") is None:
        wanted = (message.get("Type") or "").casefold()
        if wanted == "viewports":
            form = SetViewports
        elif wanted == "camera" and message.get("Client"):
            form = ShowCamera
        for kind in UNSUPPORTED_TYPES:
            # They have fields of their own instead, such as those of Gripper.
            if kind.casefold() == wanted:
                return ParsedCommand(Unsupported(kind))
    command: Command = form.decode(message, dialect)
    known = {key.lower() for key in (*command.keys, *_NEEDLESS_KEYS.get(verb, ()))}
    of_others = {key.lower() for key in _UNSUPPORTED_KEYS.get(verb, ())}
    keys = [key for key, _ in message.segments if key.lower() not in known]
    unknown = tuple(key for key in keys if key.lower() not in of_others)
    unsupported = tuple(key for key in keys if key.lower() in of_others)
    return ParsedCommand(command, unknown, unsupported)


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


def _format_vector(values: Iterable[float]) -> str:
    return ",".join([_format_number(value) for value in values])


def _number_text(value: float | None) -> str | None:
    return None if value is None else _format_number(value)


def _format_number(value: float) -> str:
    if not math.isfinite(value) or abs(value) > LARGEST_COMMANDED:
        limit = f"at most {LARGEST_COMMANDED:g} in size"
        raise ValueError(f"number {value!r}, expected {limit}")
    # The sum makes 0.0 of -0.0, whose sign no server needs.
    return np.format_float_positional(value + 0.0, trim="0")
