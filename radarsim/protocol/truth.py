"""The lines of USARTruth, which tells on a port of its own where robots are.

A client asks with a line such as ``{Class USARBot.P3AT} {Name R1}``; each field limits
the answer, and ``{Actors}`` or a blank line does not. The answer is a line for each
robot and each victim, and ``{End}``.
"""

from collections.abc import Iterable
from typing import Final

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.line_template import WRAPPED, printable_name
from radarsim.protocol.message import Message, parse_segments

VICTIM: Final = "Victim"
# Classes of the original without their packages: of all, and of the robots.
_ALL: Final = frozenset(("", "actor", "pawn"))
_ROBOTS: Final = frozenset(("basevehicle", "usarvehicle"))
END: Final = b"{End}\r\n"


def answer_truth(
    line: str, actors: Iterable[tuple[str, str, Pose3]], time: float, dialect: Dialect
) -> bytes:
    """Return the lines for those of some actors that a question asks for, and the end.

    Args:
        line: The question.
        actors: Name and class of each robot and victim, ``VICTIM`` of the latter, and
            the pose of its body, map frame.
        time: Simulated time, s.
        dialect: Formats of numbers.
    """
    try:
        message = Message("TRUTH", parse_segments(line, keeps_closed=True))
    except MalformedMessage:
        return END
    wanted = (message.get("Class") or "").rpartition(".")[2].lower()
    join, text = dialect.ins.join_flipped, ""
    for name, class_name, pose in actors:
        is_robot = wanted in _ROBOTS and class_name != VICTIM
        is_of_class = wanted in _ALL or is_robot or wanted == class_name.lower()
        if is_of_class and message.name in ("", name):
            numbers = pose.numbers()
            text += (
                f"{{Name {printable_name(name)}}} {{Class {class_name}}}"
                f" {{Time {dialect.time.format(time)}}}"
                f" {{Location {join(numbers[:3])}}}"
                f" {{Rotation {join(numbers[3:], WRAPPED)}}}\r\n"
            )
    return text.encode("ascii") + END
