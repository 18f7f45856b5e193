"""The state of one connection, and diagnostics of what its client sends."""

from collections import deque
from dataclasses import dataclass, field

from radarsim.errors import MalformedMessage
from radarsim.protocol.commands import COMMANDS, ParsedCommand
from radarsim.protocol.framing import LineBuffer
from radarsim.protocol.reports import Report
from radarsim.protocol.send_queue import SendQueue
from radarsim.simulation.vehicle import Vehicle

<<<<<<< HEAD
# The fields that have a meaning here; clients of other servers also send others.
FIELDS: dict[str, tuple[str, ...]] = {
    "INIT": ("ClassName", "Name", "Start", "Location", "Rotation"),
    "DRIVE": ("Left", "Right", "Normalized", "Light", "Flip"),
    "GETGEO": ("Type", "Name"),
    "GETCONF": ("Type", "Name"),
    "SET": ("Type", "Name", "Opcode", "Params"),
    "GETSTARTPOSES": (),
}

=======
>>>>>>> 5b5d6fb (Reports and commands write and read themselves)

@dataclass(slots=True)
class Client:
    """One connection.

    Attributes:
        lines: Received bytes of a line that is not complete yet.
        pending: Received lines that are not handled yet.
        command_budget: Number of commands that may still be handled in this tick.
        next_spawn: First tick in which the next robot may be spawned.
        send_queue: Lines that are not sent yet.
        replies: Replies for the next write.
        vehicle: The client's robot; None before INIT.
    """

    lines: LineBuffer = field(default_factory=LineBuffer)
    pending: deque[str] = field(default_factory=deque)
    command_budget: int = 0
    next_spawn: int = 0
    send_queue: SendQueue = field(default_factory=SendQueue)
    replies: list[Report] = field(default_factory=list)
    vehicle: Vehicle | None = None


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """A command that had no effect, or not the one that was asked for.

    Attributes:
        kind: The same for all similar diagnostics, so that a log can skip repetitions.
        text: What came, and what was expected.
    """

    kind: str
    text: str

    @classmethod
    def of_malformed(cls, line: str, error: MalformedMessage) -> "Diagnostic":
        """Describe a line that is not a command; the kind is that of its verb."""
        verb = line.partition("{")[0].strip().upper()
        return cls(f"malformed {verb if verb in FIELDS else 'line'}", str(error))

<<<<<<< HEAD
    @classmethod
    def of_unknown_fields(cls, line: str) -> "Diagnostic | None":
        """Describe the fields of a command that have no meaning; None without any."""
        message = decode_message(line)
        verb = message.verb.upper()
        known = FIELDS[verb]
        lowered = {key.lower() for key in known}
        unknown = [key for key, _ in message.segments if key.lower() not in lowered]
        if not unknown:
            return None
        text = f"{verb} {unknown[0][:80]!r}, expected of {list(known)}"
        return cls(f"{verb} fields", text)

    def then(self, consequence: "Diagnostic") -> "Diagnostic":
        """Join with the diagnostic of what this one has led to."""
        return Diagnostic(
            f"{self.kind}, {consequence.kind}", f"{self.text}; {consequence.text}"
        )
=======
def malformed(line: str, error: MalformedMessage) -> Diagnostic:
    """Tell of a line that is no command; those of one verb are alike."""
    verb = line.partition("{")[0].strip().upper()
    return Diagnostic(f"malformed {verb if verb in COMMANDS else 'line'}", str(error))


def unknown_fields(parsed: ParsedCommand) -> Diagnostic | None:
    """Report the fields that a command does not have, if there are any."""
    if not parsed.unknown_keys:
        return None
    verb, unknown = parsed.command.verb, parsed.unknown_keys[0]
    return Diagnostic(
        f"{verb} fields",
        f"{verb} {unknown[:80]!r}, expected of {list(parsed.command.keys)}",
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
>>>>>>> 5b5d6fb (Reports and commands write and read themselves)
