"""What the host keeps of one connection."""

from collections import deque
from dataclasses import dataclass, field

from radarsim.protocol.framing import LineBuffer
from radarsim.protocol.outbox import Outbox
from radarsim.protocol.reports import Report
from radarsim.simulation.vehicle import Vehicle


@dataclass(slots=True)
class Client:
    """One connection.

    Attributes:
        lines: What it has sent of a line that is not whole yet.
        pending: Lines that wait for their turn.
        turns: How many commands it may still give in this tick.
        next_spawn: The first tick in which it may have a robot made.
        outbox: What it has not been sent yet.
        answers: What the next write of a tick begins with, behind the status.
        vehicle: Its robot.
    """

    lines: LineBuffer = field(default_factory=LineBuffer)
    pending: deque[str] = field(default_factory=deque)
    turns: int = 0
    next_spawn: int = 0
    outbox: Outbox = field(default_factory=Outbox)
    answers: list[Report] = field(default_factory=list)
    vehicle: Vehicle | None = None
