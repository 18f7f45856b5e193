"""The lines of USARTruth, which tells on a port of its own where robots are.

A client asks with a line such as ``{Class USARBot.P3AT} {Name R1}``; each field limits
the answer, and ``{Actors}`` does not. The answer is a line for each robot, and
``{End}``.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple, Self

from radarsim.geometry import Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.message import Message, parse_segments, wrapped_pose_on_wire

# Classes of the original of which every robot is, without their packages.
_ALL: Final = frozenset(("", "actor", "pawn", "basevehicle", "usarvehicle"))
END: Final = b"{End}\r\n"


class ActorTruth(NamedTuple):
    """Where a robot is.

    Attributes:
        name: Name that its client chose.
        class_name: Class of the robot.
        pose: Pose of its body, map frame.
    """

    name: str
    class_name: str
    pose: Pose3

    def encode(self, time: float, dialect: Dialect) -> bytes:
        """Return its line at a simulated time, s."""
        numbers, join = wrapped_pose_on_wire(self.pose), dialect.ins.join
        line = (
            f"{{Name {printable_name(self.name)}}} {{Class {self.class_name}}}"
            f" {{Time {dialect.time.format(time)}}} {{Location {join(numbers[:3])}}}"
            f" {{Rotation {join(numbers[3:])}}}\r\n"
        )
        return line.encode("ascii")


class TruthRequest(NamedTuple):
    """A question where robots are.

    Attributes:
        class_name: Class of the robots without its package, in lower case; empty for
            any.
        name: Name of the robot; empty for any.
    """

    class_name: str
    name: str

    @classmethod
    def decode(cls, line: str) -> Self:
        """Read a question.

        Raises:
            MalformedMessage: If a brace is not closed.
        """
        message = Message("TRUTH", parse_segments(line))
        class_name = (message.get("Class") or "").rpartition(".")[2].lower()
        any_class = class_name in _ALL
        return cls("" if any_class else class_name, message.get("Name") or "")

    def answer(
        self, actors: Iterable[ActorTruth], time: float, dialect: Dialect
    ) -> bytes:
        """Return the lines for those of some robots that are asked for, and the end."""
        lines = [
            actor.encode(time, dialect)
            for actor in actors
            if self.class_name in ("", actor.class_name.lower())
            and self.name in ("", actor.name)
        ]
        return b"".join([*lines, END])
