"""What a wireless server asks, which computes how well robots can talk to each other.

Such a server (WSS) is a program of its own, between the robots and their operators. On
a port of the simulator it asks with ``GETPOS`` where all robots are, and with
``GETOBS`` how many obstacles are between two robots, or between two places.

Source of the lines: USARSim for UDK (repository hrnr/robocup-usarsim),
``USARBotAPI/classes/ComServerInterface.uc`` and ``ComServerNewCon.uc``.
"""

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple, Self

from radarsim.protocol.dialect import Dialect
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.message import (
    Triple,
    decode_message,
    flip_axes,
    parse_flipped,
)

UNKNOWN: Final = -1.0  # number of obstacles from a robot that is not there


class Station(NamedTuple):
    """A robot that talks by radio.

    Attributes:
        name: Name that its client chose.
        place: x, y, z of its body, m, map frame.
        is_spent: Whether its battery is empty.
    """

    name: str
    place: Triple
    is_spent: bool


class WirelessRequest(NamedTuple):
    """A question; without ends it is where all robots are.

    Attributes:
        keys: Keys of both ends: ``From`` and ``To`` of robots, ``Start`` and ``End`` of
            places; empty without ends.
        ends: What the client wrote for each.
    """

    keys: tuple[str, ...] = ()
    ends: tuple[str, ...] = ()

    @classmethod
    def decode(cls, line: str) -> Self | None:
        """Read a question; None if it is another one, or ends are missing.

        Raises:
            MalformedMessage: If the line is not a message.
        """
        message = decode_message(line)
        verb = message.verb.upper()
        if verb == "GETPOS":
            return cls()
        for keys in (("From", "To"), ("Start", "End")):
            ends = tuple(message.get(key) or "" for key in keys)
            if verb == "GETOBS" and all(ends):
                return cls(keys, ends)
        return None

    def answer(
        self,
        stations: Iterable[Station],
        count_obstacles: Callable[[Triple, Triple], int],
        dialect: Dialect,
    ) -> bytes:
        """Return the line that answers the question.

        Args:
            stations: All robots.
            count_obstacles: Returns how many are between two places, m, map frame.
            dialect: Formats of numbers.

        Raises:
            MalformedMessage: If an end is no place.
        """
        robots = list(stations)
        if not self.keys:
            join = dialect.ins.join
            listed = [
                f" {{Name {printable_name(each.name)} Location"
                f" {join(flip_axes(each.place))} BatteryEmpty {each.is_spent}}}"
                for each in robots
            ]
            return _line(f"POSITIONS {{Robots {len(robots)}}}{''.join(listed)}")
        if self.keys == ("From", "To"):
            known = {each.name: each.place for each in robots}
            places = [known.get(end) for end in self.ends]
        else:
            places = [parse_flipped(end) for end in self.ends]
        start, end = places
        count = UNKNOWN
        if start is not None and end is not None:
            count = float(count_obstacles(start, end))
        fields = [
            f"{{{key} {printable_name(end)}}}"
            for key, end in zip(self.keys, self.ends, strict=True)
        ]
        return _line(f"NUMOBS {' '.join(fields)} {{ObstCount {count:.4f}}}")


def _line(text: str) -> bytes:
    return f"{text}\r\n".encode("ascii")
