"""What is said to the log when a client asks for something in vain."""

from collections import deque
from dataclasses import dataclass, field

from radarsim.errors import MalformedMessage
from radarsim.protocol.framing import LineBuffer
from radarsim.protocol.message import decode_message
from radarsim.protocol.reports import Report
from radarsim.protocol.send_queue import SendQueue
from radarsim.simulation.vehicle import Vehicle

# The fields that have a meaning here; clients of other servers send others too.
FIELDS: dict[str, tuple[str, ...]] = {
    "INIT": ("ClassName", "Name", "Start", "Location", "Rotation"),
    "DRIVE": ("Left", "Right", "Normalized", "Light", "Flip"),
    "GETGEO": ("Type", "Name"),
    "GETCONF": ("Type", "Name"),
    "SET": ("Type", "Name", "Opcode", "Params"),
    "GETSTARTPOSES": (),
}


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """Something that a client did and that had no effect, or not the one it asked for.

    Attributes:
        kind: The same for all notices alike, so that a log need say it only once.
        text: What came, and what was expected.
    """

    kind: str
    text: str


def malformed(line: str, error: MalformedMessage) -> Diagnostic:
    """Tell of a line that is no command; those of one verb are alike."""
    verb = line.partition("{")[0].strip().upper()
    return Diagnostic(f"malformed {verb if verb in FIELDS else 'line'}", str(error))


def unknown_fields(line: str) -> Diagnostic | None:
    """Tell of the fields of a command that have no meaning here, if it has any."""
    message = decode_message(line)
    verb = message.verb.upper()
    known = FIELDS[verb]
    lowered = {key.lower() for key in known}
    strange = [key for key, _ in message.segments if key.lower() not in lowered]
    if not strange:
        return None
    return Diagnostic(
        f"{verb} fields", f"{verb} {strange[0][:80]!r}, expected of {list(known)}"
    )


# Section from host.client.
# What the host keeps of one connection.


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
    outbox: SendQueue = field(default_factory=SendQueue)
    answers: list[Report] = field(default_factory=list)
    vehicle: Vehicle | None = None
