"""What robots and operators ask a wireless server (WSS), and how well they hear.

Source of lines and model: the WSS of USARSim (repository hrnr/robocup-usarsim,
``USARTools/WSS``), its ``RobotManagementConnection`` and ``ObstaclePropagationModel``.
"""

import math
from typing import Final, NamedTuple, Self

from radarsim.errors import MalformedMessage
from radarsim.protocol.message import decode_message

POWER_AT_REFERENCE: Final = -49.67  # dBm
REFERENCE: Final = 2.0  # m
EXPONENT: Final = 1.0  # of the loss with distance
LOSS_AN_OBSTACLE: Final = 6.325  # dB
CUTOFF: Final = -93.0  # dBm; below it nobody hears
LARGEST_PORT: Final = 65_535


def signal_strength(distance: float, obstacles: int) -> float:
    """Return what is received of a robot, dBm; inf at no distance.

    Args:
        distance: m.
        obstacles: How many are between the two.
    """
    if distance <= 0.0:
        return math.inf
    loss = 10 * EXPONENT * math.log10(distance / REFERENCE)
    return POWER_AT_REFERENCE - loss - obstacles * LOSS_AN_OBSTACLE


class RadioRequest(NamedTuple):
    """A request; what it does not have is empty.

    Attributes:
        verb: Its first word, in capitals.
        robot: Name of a robot.
        ports: Numbers of ports; None if they are no such numbers.
    """

    verb: str
    robot: str = ""
    ports: tuple[int, ...] | None = ()

    @classmethod
    def decode(cls, line: str) -> Self:
        """Read a request; one without a verb if the line is no message."""
        try:
            message = decode_message(line)
        except MalformedMessage:
            return cls("")
        words = (message.get("Port") or "").split(",")
        texts = [word.strip() for word in words if word.strip()]
        ports: tuple[int, ...] | None = None
        if all(text.isascii() and text.isdecimal() and len(text) < 6 for text in texts):
            ports = tuple(map(int, texts))
            if not all(0 < port <= LARGEST_PORT for port in ports):
                ports = None
        return cls(message.verb.upper(), message.get("Robot") or "", ports)


def strength_text(strength: float | None) -> str:
    """Return a strength as the answer to ``GETSS`` has it.

    Args:
        strength: dBm; None if a robot is nowhere.
    """
    if strength is None or 0 < strength < math.inf:
        return "{Strength NaN} {Error Model.Returned.NaN}"
    if strength == math.inf:
        return "{Strength INF} {Error Model.Returned.INF}"
    return f"{{Strength {strength:g}}}"
