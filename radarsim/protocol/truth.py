"""The lines of USARTruth, which tells on a port of its own where robots are.

A client asks with a line such as ``{Class USARBot.P3AT} {Name R1}``; each field limits
the answer, and ``{Actors}`` or a blank line does not. The answer is a line for each
robot and each victim, and ``{End}``.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple, Self

from radarsim.geometry import Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.message import Message, parse_segments, wrapped_pose_on_wire

VICTIM: Final = "Victim"
# Classes of the original without their packages: of all, and of the robots.
_ALL: Final = frozenset(("", "actor", "pawn"))
_ROBOTS: Final = frozenset(("basevehicle", "usarvehicle"))
END: Final = b"{End}\r\n"


class ActorTruth(NamedTuple):
    """Where a robot or a victim is.

    Attributes:
        name: Name of the robot or the victim.
        class_name: Class of the robot, or ``VICTIM``.
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
    """A question where robots and victims are.

    Attributes:
        class_name: Class without its package, in lower case; empty for any.
        name: Name of the robot or the victim; empty for any.
    """

    class_name: str
    name: str

    @classmethod
    def decode(cls, line: str) -> Self:
        """Read a question.

        Raises:
            MalformedMessage: If a brace other than the last is not closed.
        """
        message = Message("TRUTH", parse_segments(line, keeps_closed=True))
        class_name = (message.get("Class") or "").rpartition(".")[2].lower()
        return cls(class_name, message.get("Name") or "")

    def answer(
        self, actors: Iterable[ActorTruth], time: float, dialect: Dialect
    ) -> bytes:
        """Return the lines for those of some actors that are asked for, and the end."""
        lines = [
            actor.encode(time, dialect)
            for actor in actors
            if self._includes(actor.class_name) and self.name in ("", actor.name)
        ]
        return b"".join([*lines, END])

    def _includes(self, class_name: str) -> bool:
        is_any = self.class_name in _ALL
        is_robot = self.class_name in _ROBOTS and class_name != VICTIM
        return is_any or is_robot or self.class_name == class_name.lower()
