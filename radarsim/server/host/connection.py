r"""The state of one connection, and diagnostics of what its client sends.

The lines that wait to be sent to it are part of the state.

A client that reads too slowly loses the oldest readings. It never loses an answer, nor
part of a line. Lines that were taken from the queue are not dropped any more.

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

WATCH_LIMIT: Final = 4_194_304  # bytes; 100 robots can list as many echoes in a second
WATCH_CEILING: Final = 1_048_576  # bytes that tell of robots, some 20 000 of them


class SendQueue:
    """Bounded queue of lines for one client; its length is in bytes.

    Attributes:
        limit: Maximum size of waiting readings, bytes; beyond it the oldest are
            dropped.
        ceiling: Maximum size of waiting answers, bytes; beyond it ``overflowed``
            becomes true and the client is to be disconnected.
        dropped: Number of readings that were dropped.
        overflowed: Whether the client has sent requests without reading the answers.
    """

    def __init__(self, limit: int = 262_144, ceiling: int = 4_194_304) -> None:
        self.limit = limit
        self.ceiling = ceiling
        self.dropped = 0
        self.overflowed = False
        # Lines and whether they are kept; None if they are dropped one by one.
        self._lines: deque[tuple[bytes, bool | None]] = deque()
        self._readings = 0
        self._answers = 0

    def __len__(self) -> int:
        return self._readings + self._answers

    def put(self, line: bytes, *, keep: bool) -> None:
        """Add a line, or several that are dropped together.

        Args:
            line: Line with its end, or several whole lines.
            keep: Whether it is an answer, which must not be dropped.
        """
        self._lines.append((line, keep))
        if keep:
            self._answers += len(line)
            # Never reset: the client is disconnected even if it reads on.
            self.overflowed |= self._answers > self.ceiling
        else:
            self._readings += len(line)
            if self._readings > self.limit:
                self._drop_readings()

    def put_readings(self, lines: bytes) -> None:
        """Add lines that may be dropped, as if they were added one by one."""
        # Only a queue that overflows needs to know single lines: to split them
        # in each tick would be work for nothing.
        if self._readings + len(lines) > self.limit:
            for line in lines.splitlines(keepends=True):
                self.put(line, keep=False)
        elif lines:
            self._lines.append((lines, None))
            self._readings += len(lines)

    def take(self) -> bytes:
        """Remove and return all lines, in order."""
        # One write for each tick: a driver in Java loses the first line of each write,
        # and the first line is a status that it does not need.
        data = b"".join(line for line, _ in self._lines)
        self._lines.clear()
        self._readings = self._answers = 0
        return data

    def _drop_readings(self) -> None:
        """Drop the oldest readings until the rest fits into half the limit.

        Half, so that this pass over the queue is rare, however long the queue is.
        """
        answers: deque[tuple[bytes, bool | None]] = deque()
        while self._readings > self.limit // 2:
            line, keep = self._lines.popleft()
            if keep is None:
                each = line.splitlines(keepends=True)
                self._lines.extendleft([(line, False) for line in reversed(each)])
            # Answers keep their place before all readings that are left, so that a
            # client never gets one later than it would have without losses.
            elif keep:
                answers.append((line, keep))
            else:
                self._readings -= len(line)
                self.dropped += line.count(b"\n")
        # They were ahead of all lines that are left, so they return to the front.
        self._lines.extendleft(reversed(answers))


def _watch_queue() -> SendQueue:
    return SendQueue(WATCH_LIMIT, WATCH_CEILING)


@dataclass(slots=True)
class Client:
    """One connection.

    Attributes:
        number: Identifies the client within the host.
        address: Address of its machine; empty if it is not known.
        lines: Received bytes of a line that is not complete yet.
        pending: Received lines that are not handled yet.
        command_budget: Number of commands that may still be handled in this tick.
        next_spawn: First tick in which the next robot may be spawned.
        send_queue: Lines that are not sent yet.
        watch_queue: Copies of the lines of the robots that it watches.
        replies: Lines of replies for the next write.
        vehicle: The client's robot; None before INIT.
        spawning: The steps of its INIT while a free place is looked for.
        controls: Whether it is a world controller, without a robot.
        has_spoken: Whether its first line has come.
        speaks_http: Whether that line began a request of a web browser.
        fault: The error that has ended its robot, which only a bug can cause.
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
        """Add what was received to the lines that wait to be handled.

        Nothing of what a web browser sends is added.
        """
        lines = self.lines.feed(data)
        if lines and not self.has_spoken:
            self.has_spoken = True
            # The first line of a browser is that of its request; later ones may
            # contain anything.
            self.speaks_http = is_http_request(lines[0])  # for ever
        if not self.speaks_http:
            self.pending.extend(lines)

    def reply(self, report: Report, dialect: Dialect) -> None:
        """Add a reply to those that the client gets next."""
        self.replies.append(to_bytes([report.encode(dialect)]))

    @property
    def robot(self) -> Vehicle:
        """The client's robot, which has just reported."""
        assert self.vehicle is not None
        return self.vehicle

    def take(self) -> bytes:
        """Return and remove the bytes to send: whole lines, the robot's own first."""
        data = self.send_queue.take()
        return data + self.watch_queue.take() if self.watch_queue else data

    def close_reason(self) -> str:
        """Return why the connection is to be closed; empty if it is not."""
        if self.fault is not None:
            return f"an error in the server: {type(self.fault).__name__}: {self.fault}"
        if self.speaks_http:
            return "an HTTP request, expected commands"
        is_deaf = self.send_queue.overflowed or self.watch_queue.overflowed
        if self.lines.overflow is not None or is_deaf:
            return "endless line or unread answers"
        return ""


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """A command that had no effect, or not the one that was asked for.

    Attributes:
        kind: The same for all similar diagnostics, so that a log can skip repetitions.
        text: Text for the log, with what came and what was expected.
    """

    kind: str
    text: str

    @classmethod
    def of_malformed(cls, line: str, error: MalformedMessage) -> Diagnostic:
        """Describe a line that is not a command; the kind is that of its verb."""
        verb = line.partition("{")[0].strip().upper()
        return cls(f"malformed {verb if verb in COMMANDS else 'line'}", str(error))

    @classmethod
    def of_unsupported(cls, what: str, details: str = "") -> Diagnostic:
        """Describe what other servers have and this one does not: no mistake."""
        return cls(f"not supported {what}", f"not supported: {what}{details}")

    @classmethod
    def of_unknown_field(cls, command: Command, key: str) -> Diagnostic:
        """Describe a field that a command does not have."""
        verb, keys = command.verb, command.keys
        wanted = expected_one_of(key, keys) if keys else f"{key[:80]!r}, expected none"
        return cls(f"{verb} fields", f"{verb} field {wanted}")


def join_diagnostics(
    first: Diagnostic | None, consequence: Diagnostic | None
) -> Diagnostic | None:
    """Return a diagnostic and that of what it has led to as one."""
    if first is None or consequence is None:
        return first or consequence
    return Diagnostic(
        f"{first.kind}, {consequence.kind}", f"{first.text}; {consequence.text}"
    )
