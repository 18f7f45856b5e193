"""The grammar of one line: ``VERB {Key value} {Key value}``.

Blanks around and inside of braces do not count, nor does text between two groups.
Groups do not nest. Keys are found whatever their case, and the first of two equal
ones counts. Verbs keep their case here, since clients tell replies apart by it.
"""

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose3
from radarsim.protocol.numbers import read_number, read_numbers

_GROUP = re.compile(r"\{([^{}]*)\}")


@dataclass(frozen=True, slots=True)
class Message:
    """One line: its verb and its groups, key and value, in their order.

    A group without a value, ``{Name }``, has an empty one; one without a key is left
    out. The value of a list of start poses or of an item's mount holds blanks.
    """

    verb: str
    segments: tuple[tuple[str, str], ...] = ()

    def get(self, key: str) -> str | None:
        """Give the first value of a key, whatever its case, or None."""
        wanted = key.lower()
        for name, value in self.segments:
            if name.lower() == wanted:
                return value
        return None

    def encode(self) -> str:
        """Write the line, without a line end."""
        groups = [f"{{{f'{key} {value}'.rstrip()}}}" for key, value in self.segments]
        return " ".join([self.verb, *groups])


def decode_message(line: str) -> Message:
    """Read one line.

    >>> decode_message("DRIVE{Left 1}{ Right  -0,5 }")
    Message(verb='DRIVE', segments=(('Left', '1'), ('Right', '-0,5')))

    Raises:
        MalformedMessage: If there is no verb, if text other than a group follows
            it, or if a brace stays open.
    """
    head, _, _ = line.partition("{")
    if not head.strip():
        raise _expected("a verb", 0, line)
    verb, *rest = head.split(maxsplit=1)
    if rest:
        raise _expected("'{Key value}'", len(head) - len(rest[0]), line)
    groups = _GROUP.findall(line)
    if len(groups) != line.count("{"):
        raise _expected("'}' after the brace", _open_brace(line), line)
    return Message(verb, tuple(_split(group) for group in groups if group.strip()))


def _split(group: str) -> tuple[str, str]:
    key, *rest = group.split(maxsplit=1)
    return key, rest[0].rstrip() if rest else ""


def _open_brace(line: str) -> int:
    """Find the first brace that is not closed before the next one opens."""
    closed = {match.start() for match in _GROUP.finditer(line)}
    return next(i for i, sign in enumerate(line) if sign == "{" and i not in closed)


def _expected(what: str, index: int, line: str) -> MalformedMessage:
    return MalformedMessage(f"expected {what} at column {index + 1} in {line[:80]!r}")


# Section from protocol.axes.
# The axes of the wire: x forward, y right, z down, yaw clockwise from above.
#
# They are the simulation's, turned half way about x. The turn is its own inverse, and
# it takes roll, pitch and yaw the way it takes x, y and z: the first stays, the
# others
# change their sign.

Triple = tuple[float, float, float]


def flip_axes(triple: Triple) -> Triple:
    """Take a position or roll, pitch, yaw from one frame to the other; never -0.0.

    >>> flip_axes((1.0, 2.0, 0.0))
    (1.0, -2.0, 0.0)
    """
    first, second, third = triple
    return (first, 0.0 - second, 0.0 - third)


def position_on_wire(pose: Pose3) -> Triple:
    """Give x, y, z of a pose in the frame of the wire, m."""
    return flip_axes((pose.x, pose.y, pose.z))


def angles_on_wire(pose: Pose3) -> Triple:
    """Give roll, pitch, yaw of a pose in the frame of the wire, rad."""
    return flip_axes((pose.roll, pose.pitch, pose.yaw))


def pose_from_wire(numbers: Sequence[float]) -> Pose3:
    """Make a pose of x, y, z, roll, pitch, yaw in the frame of the wire."""
    x, y, z, roll, pitch, yaw = numbers
    return Pose3(*flip_axes((x, y, z)), *flip_axes((roll, pitch, yaw)))


# Section from protocol.fields.
# One field of a line, all fields of an item, and what an error says of them.

Value = TypeVar("Value")


def require(message: Message, key: str) -> str:
    """Give the text of a field that must be there, and not be empty.

    Raises:
        MalformedMessage: If it is not.
    """
    value = message.get(key)
    if not value:
        raise MalformedMessage(
            f"{message.encode()[:80]!r}, expected a field '{{{key} ...}}'"
        )
    return value


def read_needed(message: Message, key: str, read: Callable[[str], Value]) -> Value:
    """Read a field that must be there.

    Raises:
        MalformedMessage: If it is not, or cannot be read; says which field it is.
    """
    return _read(message, key, require(message, key), read)


def read_if_there(
    message: Message, key: str, read: Callable[[str], Value]
) -> Value | None:
    """Read a field; None if it is missing or empty.

    Raises:
        MalformedMessage: If it cannot be read; says which field it is.
    """
    text = message.get(key)
    return _read(message, key, text, read) if text else None


def read_triple(text: str) -> Triple:
    """Read three numbers as they are written.

    Raises:
        MalformedMessage: If these are not three numbers.
    """
    first, second, third = read_numbers(text, 3)
    return (first, second, third)


def read_turned(text: str) -> Triple:
    """Read x, y, z or roll, pitch, yaw of the wire; give them in the other frame.

    Raises:
        MalformedMessage: If these are not three numbers.
    """
    return flip_axes(read_triple(text))


def number_or_nan(message: Message, key: str) -> float:
    """Read a number that a client can do without; not a number if it is missing.

    Raises:
        MalformedMessage: If it is there and cannot be read.
    """
    number = read_if_there(message, key, read_number)
    return math.nan if number is None else number


def name_of(message: Message) -> str:
    """Give the name of whatever the line or item is about, or an empty one."""
    return message.get("Name") or ""


def items_of(message: Message) -> Iterator[Message]:
    """Give the fields of each item; the next one begins where a key comes again."""
    item: list[tuple[str, str]] = []
    seen: set[str] = set()
    for key, value in message.segments:
        word = key.lower()
        if word in ("type", "time"):
            continue
        if word in seen:
            yield Message(message.verb, tuple(item))
            item.clear()
            seen.clear()
        item.append((key, value))
        seen.add(word)
    if item:
        yield Message(message.verb, tuple(item))


def _read(message: Message, key: str, text: str, read: Callable[[str], Value]) -> Value:
    try:
        return read(text)
    except MalformedMessage as error:
        raise MalformedMessage(f"{message.verb} {key}: {error}") from None
