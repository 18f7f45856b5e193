"""Answers queries for true poses and wireless signals, which use separate ports.

**USARTruth** reports the poses of robots. A client sends a line such as ``{Class
USARBot.P3AT} {Name R1}``; each field filters the answer, and ``{Actors}`` or a blank
line asks for all. The answer is a line for each robot and each victim, and ``{End}``.

**Wireless servers** (WSS) relay connections between robots and their operators and
model the signal strength. The original WSS is a separate program, which queries a port
of the simulator: ``GETPOS`` asks for the positions of all robots, ``GETOBS`` for the
number of obstacles between two robots or positions. Robots and operators ask the WSS
for ports on which they reach each other.

Source of lines and model: USARSim for UDK (repository hrnr/robocup-usarsim),
``USARBotAPI/classes/ComServerInterface.uc`` and ``ComServerNewCon.uc``; its WSS
(``USARTools/WSS``), ``RobotManagementConnection`` and ``ObstaclePropagationModel``.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Final

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose3
from radarsim.protocol.commands import bare_class
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.line_template import WRAPPED, printable_name
from radarsim.protocol.message import (
    Message,
    Triple,
    decode_message,
    parse_flipped,
    parse_segments,
)

VICTIM: Final = "Victim"
# Classes in queries that match all robots and victims, then classes for all robots.
_ALL: Final = frozenset(("", "actor", "pawn"))
_ROBOTS: Final = frozenset(("basevehicle", "usarvehicle"))
END: Final = b"{End}\r\n"

UNKNOWN: Final = -1.0  # number of obstacles if a robot does not exist
POWER_AT_REFERENCE: Final = -49.67  # received power at the distance REFERENCE, dBm
REFERENCE: Final = 2.0  # m
EXPONENT: Final = 1.0  # path loss exponent
LOSS_AN_OBSTACLE: Final = 6.325  # loss per obstacle, dB
CUTOFF: Final = -93.0  # dBm; a weaker signal is not received
LARGEST_PORT: Final = 65_535


def answer_truth(
    line: str, actors: Iterable[tuple[str, str, Pose3]], time: float, dialect: Dialect
) -> bytes:
    """Answer a query for true poses: a line per robot or victim, and then ``{End}``.

    Args:
        line: The query.
        actors: Name, class and body pose in the map frame of each robot and victim;
            the class of victims is ``VICTIM``.
        time: Simulated time, s.
        dialect: Dialect with the number formats.
    """
    try:
        message = Message("TRUTH", parse_segments(line, keeps_closed=True))
    except MalformedMessage:
        return END
    wanted = bare_class(message.get("Class") or "").lower()
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


def answer_wireless(
    line: str,
    robots: Sequence[tuple[str, Triple, bool]],
    count_obstacles: Callable[[Triple, Triple], int],
    dialect: Dialect,
) -> bytes:
    """Return the answer of a wireless server to a query about robots.

    A blank line gets no answer. An unknown query gets a blank line, as from the
    original server, so that the client does not wait for an answer.

    Args:
        line: The query.
        robots: Name of each robot, its position, m, map frame, and whether its battery
            is empty.
        count_obstacles: Returns the number of obstacles between two positions, m, map
            frame.
        dialect: Dialect with the number formats.
    """
    text = ""
    try:
        message = decode_message(line)
        if message.verb.upper() == "GETPOS":
            join = dialect.ins.join_flipped
            text = f"POSITIONS {{Robots {len(robots)}}}"
            for name, place, is_spent in robots:
                text += f" {{Name {printable_name(name)} Location"
                text += f" {join(place)} BatteryEmpty {is_spent}}}"
        elif message.verb.upper() == "GETOBS":
            places = {name: place for name, place, _ in robots}
            text = _count_between(message, places, count_obstacles)
    except MalformedMessage:
        if not line:
            return b""
    return f"{text}\r\n".encode("ascii")


def _count_between(
    message: Message,
    robots: dict[str, Triple],
    count_obstacles: Callable[[Triple, Triple], int],
) -> str:
    """Count obstacles between the positions in a query; return the answer or ``""``."""
    for keys, find in (
        (("From", "To"), robots.get),
        (("Start", "End"), parse_flipped),
    ):
        ends = [message.get(key) or "" for key in keys]
        if all(ends):
            start, end = map(find, ends)
            count = UNKNOWN
            if start is not None and end is not None:
                count = count_obstacles(start, end)
            named = zip(keys, ends, strict=True)
            fields = " ".join(f"{{{key} {printable_name(end)}}}" for key, end in named)
            return f"NUMOBS {fields} {{ObstCount {count:.4f}}}"
    return ""


def signal_strength(distance: float, obstacles: int) -> float:
    """Return the strength, dBm, of a radio signal at a receiver; inf at distance 0.

    Args:
        distance: Distance between sender and receiver, m.
        obstacles: Number of obstacles between sender and receiver.
    """
    if distance <= 0.0:
        return math.inf
    loss = 10 * EXPONENT * math.log10(distance / REFERENCE)
    return POWER_AT_REFERENCE - loss - obstacles * LOSS_AN_OBSTACLE


def strength_text(strength: float | None) -> str:
    """Return the fields of the answer to a query for a signal strength, ``GETSS``.

    Args:
        strength: Signal strength, dBm; None if it is unknown.
    """
    if strength is None or 0 < strength < math.inf:
        return "{Strength NaN} {Error Model.Returned.NaN}"
    if strength == math.inf:
        return "{Strength INF} {Error Model.Returned.INF}"
    return f"{{Strength {strength:g}}}"


def read_request(line: str) -> tuple[str, str, tuple[int, ...] | None]:
    """Parse a request of a robot to a wireless server.

    Returns:
        The verb in capitals, the name of a robot, and the port numbers. Missing parts
        are empty, and the ports are None if one of them is not a valid port number.
    """
    try:
        message = decode_message(line)
    except MalformedMessage:
        return "", "", ()
    words = (message.get("Port") or "").split(",")
    texts = [word.strip() for word in words if word.strip()]
    ports: tuple[int, ...] | None = None
    if all(text.isascii() and text.isdecimal() and len(text) < 6 for text in texts):
        ports = tuple(map(int, texts))
        if not all(0 < port <= LARGEST_PORT for port in ports):
            ports = None
    return message.verb.upper(), message.get("Robot") or "", ports
