"""What world controllers ask for: clients that move things instead of driving a robot.

A client becomes one with an ``INIT`` of the class ``WorldController``.

Source of the lines: USARSim for UDK (repository hrnr/robocup-usarsim),
``USARBotAPI/classes/WorldController.uc`` and ``BotConnection.uc``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import ClassVar, Final, Self

import numpy as np

from radarsim.errors import MalformedMessage, expected_one_of
from radarsim.geometry import Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.line_template import WRAPPED, printable_name
from radarsim.protocol.message import (
    Message,
    Triple,
    flip_axes,
    parse_flag,
    parse_flipped,
    parse_triple,
    wrapped_pose,
)

CONTROLLER: Final = "WorldController"  # class of robots; it has no body
CRATE: Final = "WCCrate"  # class of objects
UNSUPPORTED_ACTIONS: Final = ("Conveyor", "Rotate", "SetWP", "AddWP", "ClearWP")
NOWHERE: Final = (0.0, 0.0, 0.0)
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


@dataclass(frozen=True, slots=True)
class Control:
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
        corners: Lowest and highest x, y, z of the space in which all are removed; None
            for everywhere.
    """

    verb: ClassVar[str] = "CONTROL"
    keys: ClassVar[Sequence[str]] = (
        "Type",
        "Name",
        "ClassName",
        "Location",
        "Rotation",
        "Scale",
        "Start",
        "Physics",
        "Permanent",
        "MinPos",
        "MaxPos",
    )

    action: Action
    name: str | None = None
    class_name: str | None = None
    position: Triple = NOWHERE
    rotation: Triple = NOWHERE
    scale: Triple = (1.0, 1.0, 1.0)
    start: str | None = None
    falls: bool = False
    stays: bool = False
    corners: tuple[Triple, Triple] | None = None

    @classmethod
    def decode(cls, message: Message, _: Dialect) -> Self:
        """Read the command from its message.

        Raises:
            MalformedMessage: If there is no such action, or a number is not readable.
        """
        wanted = message.require("Type")
        action = next((a for a in Action if a.lower() == wanted.lower()), None)
        if action is None:
            raise MalformedMessage(
                f"Type {expected_one_of(wanted, [each.value for each in Action])}"
            )
        class_name = (message.get("ClassName") or "").rpartition(".")[2]
        scale = message.parse_optional("Scale", parse_triple)
        low, high = (
            message.parse_optional(key, _parse_place) for key in ("MinPos", "MaxPos")
        )
        corners = None
        if low is not None and high is not None and low != high:
            ends = np.sort([low, high], axis=0).tolist()
            corners = tuple(ends[0]), tuple(ends[1])
        return cls(
            action,
            message.get("Name") or None,
            class_name or None,
            # As the original, in which what is missing is 0.
            message.parse_optional("Location", _parse_place) or NOWHERE,
            message.parse_optional("Rotation", _parse_place) or NOWHERE,
            scale if scale is not None and any(scale) else (1.0, 1.0, 1.0),
            message.get("Start") or None,
            (message.get("Physics") or "").lower() in _FALLING,
            parse_flag(message.get("Permanent") or ""),
            corners,
        )

    def values(self) -> tuple[str | None, ...]:
        """Return the text for each of ``keys``."""
        low, high = self.corners or (None, None)
        return (
            self.action,
            self.name,
            self.class_name,
            *(_vector(flip_axes(each)) for each in (self.position, self.rotation)),
            _vector(self.scale),
            self.start,
            "RigidBody" if self.falls else None,
            "true" if self.stays else None,
            *(each and _vector(flip_axes(each)) for each in (low, high)),
        )


def _vector(triple: Triple) -> str:
    numbers = [np.format_float_positional(each + 0.0, trim="0") for each in triple]
    return ",".join(numbers)


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
