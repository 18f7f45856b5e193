"""Commands and lines of watchers: clients that get copies of lines to other robots.

Names of robots are reduced to characters that a line can contain, as in all lines, so
names that differ only in other characters count as equal.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar, Final, Self

from radarsim.errors import MalformedMessage
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import (
    Field,
    LineReport,
    Number,
    PrintableText,
    Segment,
)
from radarsim.protocol.line_template import printable_name, reduce_text
from radarsim.protocol.message import Message

MOST_NAMES: Final = 1000  # per command, to limit the time to parse one
LONGEST_ERROR: Final = 1000  # maximum length of an error text, characters

SEE: Final = "SEE"

_ALL: Final = "all"
_NONE: Final = "none"
ECHO_WORDS: Final = {"true": _ALL, "false": _NONE}
_SEE: Final = re.compile(
    r"SEE\s*\{\s*Robot\s([^{}]*)\}\s*(\S.*)", re.IGNORECASE | re.DOTALL
)


@dataclass(frozen=True)
class RobotChoice:
    """A choice of robots to watch: all, none, or a list of names.

    >>> RobotChoice.parse("r1, R2").includes("R1")
    True

    If the only name is a keyword such as ``All``, a comma follows it.

    >>> str(RobotChoice(("All",)))
    'All,'

    Attributes:
        names: Names in the form of the wire, case-insensitive; None for all robots.
    """

    names: tuple[str, ...] | None = ()

    @classmethod
    def parse(cls, text: str) -> Self:
        """Parse a choice of robots: ``All``, ``None``, or names separated by commas.

        Raises:
            MalformedMessage: If there is no name, or more than ``MOST_NAMES``.
        """
        word = text.strip().casefold()
        if word == _ALL:
            return cls(None)
        if word == _NONE:
            return cls()
        names = [name for name in text.split(",", MOST_NAMES) if name.strip()]
        if not 0 < len(names) <= MOST_NAMES:
            expected = f"expected All, None, or 1 to {MOST_NAMES} names"
            raise MalformedMessage(f"{text[:80]!r}, {expected}")
        return cls(tuple(map(printable_name, names)))

    def __str__(self) -> str:
        if self.names is None:
            return _ALL.capitalize()
        text = ",".join(self.names)
        # A robot may be named "All". A comma after the name marks a list of one name.
        if text.casefold() in (_ALL, _NONE, *ECHO_WORDS):
            return f"{text},"
        return text or _NONE.capitalize()

    def includes(self, name: str) -> bool:
        """Return whether the choice includes a robot with a name, in any case."""
        if self.names is None:
            return True
        return name.casefold() in self._folded

    @cached_property
    def _folded(self) -> frozenset[str]:
        return frozenset(name.casefold() for name in self.names or ())


NO_ROBOTS: Final = RobotChoice()


class Choice(Field[RobotChoice]):
    """A field with a choice of robots, such as ``All`` or a list of names."""

    def read(self, message: Message) -> RobotChoice:
        return message.parse(self.key, RobotChoice.parse)

    def write(self, value: RobotChoice, _: Dialect) -> Sequence[Segment]:
        return (Segment(self.key, reduce_text(str(value))),)


class Watching(LineReport):
    """The answer to a client's command to watch robots.

    Attributes:
        robots: The robots that are watched from now on.
        echoes: The watched robots whose scanners also send echo lines.
    """

    verb: ClassVar[str] = "NFO"

    robots: Annotated[RobotChoice, Choice("Watching")]
    echoes: Annotated[RobotChoice, Choice("Echoes")] = NO_ROBOTS


class RobotJoined(LineReport):
    """Report to a watcher that a robot has joined, or had joined before.

    Attributes:
        robot: Name of the robot.
        class_name: Class of the robot.
    """

    verb: ClassVar[str] = "NFO"

    robot: Annotated[str, PrintableText("Joined")]
    class_name: Annotated[str, PrintableText("ClassName")]


class RobotLeft(LineReport):
    """Report to a watcher that a robot has left the simulation.

    Attributes:
        robot: Name of the robot.
    """

    verb: ClassVar[str] = "NFO"

    robot: Annotated[str, PrintableText("Left")]


class ClockTick(LineReport):
    """Report of the simulated time, sent to a watcher in each tick.

    Attributes:
        time: Simulated time, s.
    """

    verb: ClassVar[str] = "NFO"

    time: Annotated[float, Number("Clock", "time")]


class CommandError(LineReport):
    """Report that a command had no effect; sent mainly for radarsim's own commands.

    Attributes:
        text: The received text and the expected one.
    """

    verb: ClassVar[str] = "NFO"

    text: Annotated[str, PrintableText("Error", LONGEST_ERROR)]


def see_head(robot: str) -> bytes:
    """Return the prefix of all copied lines of a robot: ``SEE {Robot name}``."""
    head = Message(SEE, (("Robot", printable_name(robot)),)).encode()
    return f"{head} ".encode("ascii")


def split_seen(line: str) -> tuple[str, str]:
    """Split a line to a watcher into the name of a robot and the copied line.

    >>> split_seen("SEE {Robot R1} STA {Time 1.00}")
    ('R1', 'STA {Time 1.00}')

    Raises:
        MalformedMessage: If the name or the copied line is missing.
    """
    match = _SEE.fullmatch(line)
    if match is None:
        text = f"{line[:80]!r}, expected 'SEE {{Robot ...}}' and another line"
        raise MalformedMessage(text)
    return match[1].strip(), match[2].rstrip()


def is_seen(line: str) -> bool:
    """Return whether a line starts with ``SEE``, the verb of copied lines."""
    return line[:3].upper() == SEE and not line[3:4].isalnum()
