r"""The state of one connection with its send queues, and diagnostics of commands.

A client that reads too slowly loses the oldest readings. It never loses an answer, or
part of a line. Only lines in the queue can be dropped.

>>> queue = SendQueue(limit=20)
>>> queue.put(b"NFO {A b}\r\n", keep=True)
>>> queue.put(b"SEN {A 1}\r\n", keep=False)
>>> queue.put(b"SEN {A 2}\r\n", keep=False)
>>> queue.take()
b'NFO {A b}\r\n'
>>> queue.dropped
2
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from radarsim.errors import MalformedMessage, expected_one_of
from radarsim.protocol.commands import COMMANDS, Command
from radarsim.protocol.message import LineBuffer, is_http_request
from radarsim.protocol.reports import Report, to_bytes

if TYPE_CHECKING:
    from collections.abc import Generator

    from radarsim.protocol.dialect import Dialect
    from radarsim.simulation.vehicle import Vehicle

WATCH_LIMIT: Final = 4_194_304  # bytes; echo lines of 100 robots in one second
WATCH_CEILING: Final = 1_048_576  # bytes; reports about some 20 000 joining robots


class SendQueue:
    """Bounded queue of lines for one client; ``len`` returns its size in bytes.

    Attributes:
        limit: Maximum size of waiting readings, bytes; above it the oldest readings are
            dropped.
        ceiling: Maximum size of waiting answers, bytes; above it ``overflowed`` becomes
            True, and the caller has to disconnect the client.
        dropped: Number of dropped readings.
        overflowed: Whether the waiting answers have exceeded the ceiling.
    """

    def __init__(self, limit: int = 262_144, ceiling: int = 4_194_304) -> None:
        self.limit = limit
        self.ceiling = ceiling
        self.dropped = 0
        self.overflowed = False
        # Pairs of lines and a flag: True for answers, False for readings to be dropped
        # together, None for readings that can be dropped one by one.
        self._lines: deque[tuple[bytes, bool | None]] = deque()
        self._readings = 0
        self._answers = 0

    def __len__(self) -> int:
        return self._readings + self._answers

    def put(self, line: bytes, *, keep: bool) -> None:
        """Add a line, or several lines that are dropped together.

        Args:
            line: Line with its end, or several whole lines.
            keep: Whether the line is an answer, which must not be dropped.
        """
        self._lines.append((line, keep))
        if keep:
            self._answers += len(line)
            # This flag is never reset: the client is disconnected even if it resumes
            # reading.
            self.overflowed |= self._answers > self.ceiling
        else:
            self._readings += len(line)
            if self._readings > self.limit:
                self._drop_readings()

    def put_readings(self, lines: bytes) -> None:
        """Add readings that can be dropped one by one."""
        # Lines are split only if the queue overflows, because splitting takes time.
        if self._readings + len(lines) > self.limit:
            for line in lines.splitlines(keepends=True):
                self.put(line, keep=False)
        elif lines:
            self._lines.append((lines, None))
            self._readings += len(lines)

    def take(self) -> bytes:
        """Remove and return all lines, in order."""
        # All lines of a tick are sent in one write. The Java client maldo loses the
        # first line of each write; if a tick is one write, this is a status line, which
        # maldo does not need.
        data = b"".join(line for line, _ in self._lines)
        self._lines.clear()
        self._readings = self._answers = 0
        return data

    def _drop_readings(self) -> None:
        """Drop the oldest readings until the rest fits into half the limit.

        Because half the queue is freed, this pass over the queue is rare.
        """
        answers: deque[tuple[bytes, bool | None]] = deque()
        while self._readings > self.limit // 2:
            line, keep = self._lines.popleft()
            if keep is None:
                each = line.splitlines(keepends=True)
                self._lines.extendleft([(line, False) for line in reversed(each)])
            # Answers stay before all remaining readings, so that dropping never delays
            # an answer.
            elif keep:
                answers.append((line, keep))
            else:
                self._readings -= len(line)
                self.dropped += line.count(b"\n")
        # The answers came before all remaining lines, so they return to the front.
        self._lines.extendleft(reversed(answers))


def _watch_queue() -> SendQueue:
    return SendQueue(WATCH_LIMIT, WATCH_CEILING)


@dataclass(slots=True)
class Client:
    """The state of one connected client.

    Attributes:
        number: Identifies the client within the host.
        address: IP address of the client's machine; empty if it is not known.
        lines: Buffer of received bytes of an incomplete line.
        pending: Received lines that are not handled yet.
        command_budget: Number of commands that may still be handled in this tick.
        next_spawn: First tick in which the next robot may be spawned.
        send_queue: Lines for the client that are not sent yet.
        watch_queue: Unsent copies of lines of the robots that the client watches.
        replies: Lines of replies for the next write.
        vehicle: The client's robot; None before INIT.
        spawning: Generator that executes INIT during the search for a free position.
        controls: Whether the client is a world controller, which has no robot.
        has_spoken: Whether the client has sent its first line.
        speaks_http: Whether the first line was the start of an HTTP request.
        fault: The error that has ended the client's robot, which only a bug can cause.
    """

    number: int
    address: str = ""
    lines: LineBuffer = field(default_factory=LineBuffer)
    pending: deque[str] = field(default_factory=deque)
    command_budget: int = 0
    next_spawn: int = 0
    send_queue: SendQueue = field(default_factory=SendQueue)
    watch_queue: SendQueue = field(default_factory=_watch_queue)
    replies: list[bytes] = field(default_factory=list)
    vehicle: Vehicle | None = None
    spawning: Generator[int, None, Diagnostic | None] | None = None
    controls: bool = False
    has_spoken: bool = False
    speaks_http: bool = False
    fault: Exception | None = None

    def feed(self, data: bytes) -> None:
        """Add received bytes; complete lines are queued to be handled.

        All lines of a client that has sent an HTTP request are ignored.
        """
        lines = self.lines.feed(data)
        if lines and not self.has_spoken:
            self.has_spoken = True
            # Only the first line shows an HTTP request; the page in a browser chooses
            # the contents of later lines.
            self.speaks_http = is_http_request(lines[0])
        if not self.speaks_http:
            self.pending.extend(lines)

    def reply(self, report: Report, dialect: Dialect) -> None:
        """Queue a reply for the next write to the client."""
        self.replies.append(to_bytes([report.encode(dialect)]))

    @property
    def robot(self) -> Vehicle:
        """The client's robot, which must exist."""
        assert self.vehicle is not None
        return self.vehicle

    def take(self) -> bytes:
        """Remove and return all lines to send; copies for watchers come last."""
        data = self.send_queue.take()
        return data + self.watch_queue.take() if self.watch_queue else data

    def close_reason(self) -> str:
        """Return the reason to close the connection; empty to keep it open."""
        if self.fault is not None:
            return f"an error in the server: {type(self.fault).__name__}: {self.fault}"
        if self.speaks_http:
            return "an HTTP request, expected commands"
        is_deaf = self.send_queue.overflowed or self.watch_queue.overflowed
        if self.lines.overflow is not None or is_deaf:
            return "a line without end, or answers not read by the client"
        return ""


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """A report that a command had no effect, or another effect than requested.

    Attributes:
        kind: Key of similar diagnostics, by which a log can skip repetitions.
        text: Text for the log, with the received value and the expected one.
    """

    kind: str
    text: str

    @classmethod
    def of_malformed(cls, line: str, error: MalformedMessage) -> Diagnostic:
        """Describe a malformed line; the kind contains its verb if that is known."""
        verb = line.partition("{")[0].strip().upper()
        return cls(f"malformed {verb if verb in COMMANDS else 'line'}", str(error))

    @classmethod
    def of_unsupported(cls, what: str, details: str = "") -> Diagnostic:
        """Describe a feature of other servers that this server does not support."""
        return cls(f"not supported {what}", f"not supported: {what}{details}")

    @classmethod
    def of_unknown_field(cls, command: Command, key: str) -> Diagnostic:
        """Describe an unknown field of a command."""
        verb, keys = command.verb, command.keys
        wanted = expected_one_of(key, keys) if keys else f"{key[:80]!r}, expected none"
        return cls(f"{verb} fields", f"{verb} field {wanted}")


def join_diagnostics(
    first: Diagnostic | None, consequence: Diagnostic | None
) -> Diagnostic | None:
    """Join the diagnostics of an event and its consequence; either may be None."""
    if first is None or consequence is None:
        return first or consequence
    return Diagnostic(
        f"{first.kind}, {consequence.kind}", f"{first.text}; {consequence.text}"
    )
