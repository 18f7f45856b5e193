"""What world controllers ask for: clients that move things instead of driving a robot.

A client becomes one with an ``INIT`` of the class ``WorldController``.

Source of the lines: USARSim for UDK (repository hrnr/robocup-usarsim),
``USARBotAPI/classes/WorldController.uc`` and ``BotConnection.uc``.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import Annotated, ClassVar, Final, Self

import numpy as np

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose3
from radarsim.protocol.command_fields import (
    SWITCH,
    Key,
    KeyedCommand,
    format_place,
    format_vector,
)
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.line_template import WRAPPED, printable_name
from radarsim.protocol.message import (
    Message,
    Triple,
    parse_flipped,
    parse_triple,
    wrapped_pose,
)

CONTROLLER: Final = "WorldController"  # class of robots; it has no body
CRATE: Final = "WCCrate"  # class of objects
UNSUPPORTED_ACTIONS: Final = ("Conveyor", "Rotate", "SetWP", "AddWP", "ClearWP")
NOWHERE: Final = (0.0, 0.0, 0.0)  # as the original, in which what is missing is 0
CUBE: Final = (1.0, 1.0, 1.0)
LARGEST_PLACE: Final = 1e4  # m; rad
_FALLING: Final = ("rigidbody", "falling", "ground")

_parse_place = partial(parse_flipped, largest=LARGEST_PLACE)


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


@dataclass(frozen=True)
class Control(KeyedCommand):
    """Create, move, remove or list crates.

    Attributes:
        action: What to do.
        name: Name of the crate, in any case; None for all of them.
        class_name: Class of what is created or listed.
        position: Where it is put, or by what it is moved: x, y, z, m.
        rotation: Roll, pitch, yaw, rad.
        scale: Length, width and height of what is created, in those of its class.
        start: Start of the map at which it is created instead.
        falls: Whether what is created falls to the floor.
        stays: Whether it is still there when its client has left.
        low: A corner of the space in which all are removed; None for everywhere.
        high: The opposite corner, likewise.
    """

    verb: ClassVar[str] = "CONTROL"

    action: Annotated[Action, Key("Type", words=tuple(Action), is_required=True)]
    name: Annotated[str | None, Key("Name")] = None
    class_name: Annotated[
        str | None, Key("ClassName", lambda text: text.rpartition(".")[2])
    ] = None
    position: Annotated[Triple, Key("Location", _parse_place, format_place)] = NOWHERE
    rotation: Annotated[Triple, Key("Rotation", _parse_place, format_place)] = NOWHERE
    scale: Annotated[Triple, Key("Scale", _parse_scale, format_vector)] = CUBE
    start: Annotated[str | None, Key("Start")] = None
    falls: Annotated[
        bool,
        Key(
            "Physics",
            lambda text: text.lower() in _FALLING,
            lambda falls: "RigidBody" if falls else None,
        ),
    ] = False
    stays: Annotated[bool, Key("Permanent", *SWITCH)] = False
    low: Annotated[Triple | None, Key("MinPos", _parse_place, format_place)] = None
    high: Annotated[Triple | None, Key("MaxPos", _parse_place, format_place)] = None

    @property
    def corners(self) -> tuple[Triple, Triple] | None:
        """Lowest and highest x, y, z of the space in which all are removed.

        None for everywhere.
        """
        if self.low is None or self.high is None or self.low == self.high:
            return None
        low, high = np.sort([self.low, self.high], axis=0).tolist()
        return tuple(low), tuple(high)


@dataclass(frozen=True, slots=True)
class CrateStates:
    """Where crates are.

    Attributes:
        crates: Name of each, its length, width and height, m, and its pose.
    """

    crates: tuple[tuple[str, Triple, Pose3], ...]

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message.

        Raises:
            MalformedMessage: If four fields of each do not follow each other, or are
                not readable.
        """
        keys = [key.lower() for key, _ in message.segments]
        if keys != ["name", "size", "location", "rotation"] * (len(keys) // 4):
            expected = "Name, Size, Location and Rotation of each"
            raise MalformedMessage(f"fields {keys!r:.80}, expected {expected}")
        texts = [text for _, text in message.segments]
        rows = zip(*(texts[k::4] for k in range(4)), strict=True)
        return cls(
            tuple(
                (
                    name,
                    parse_triple(size),
                    wrapped_pose(parse_flipped(place), parse_flipped(angles)),
                )
                for name, size, place, angles in rows
            )
        )

    def encode(self, dialect: Dialect) -> str:
        """Write the report as one line without its end."""
        join, fields = dialect.robot.join_flipped, []
        for name, size, pose in self.crates:
            numbers = pose.numbers()
            fields.append(
                f" {{Name {printable_name(name)}}} {{Size {dialect.robot.join(size)}}}"
                f" {{Location {join(numbers[:3])}}}"
                f" {{Rotation {join(numbers[3:], WRAPPED)}}}"
            )
        return f"STA{''.join(fields)}"
