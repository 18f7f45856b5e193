"""Queue of lines between the thread that forwards bytes and the one that parses them.

The thread that adds never waits. If the thread that takes is slow, the oldest scans are
dropped whole, with the echoes before them, and all lines between them stay.
"""

import re
from collections import deque
from dataclasses import dataclass
from itertools import count
from threading import Condition
from typing import Final, Literal, TypeAlias

from radarsim.protocol.message import LineBuffer

Side: TypeAlias = Literal["client", "server"]  # that sends
ScanPart: TypeAlias = Literal["ranges", "echoes"]

MAX_SCANS: Final = 20
MAX_CHARACTERS: Final = 2**24  # of all lines
_SCAN_PARTS: Final[dict[str, ScanPart]] = {"rangescanner": "ranges", "echoes": "echoes"}
_TYPE: Final = re.compile(
    r"SEN\b.*?\{\s*Type\s+(RangeScanner|Echoes)\s*\}", re.IGNORECASE
)


@dataclass(frozen=True, slots=True)
class Line:
    """A line of one connection.

    Attributes:
        number: Number of the connection.
        side: Side that sent it.
        text: Text without the line end.
        scan_part: Part of a scan that it holds; None for any other line.
    """

    number: int
    side: Side
    text: str
    scan_part: ScanPart | None


def classify_line(number: int, side: Side, text: str) -> Line:
    """Return a line with the part of a scan that it holds, without parsing it.

    >>> classify_line(1, "server", "SEN {Time 2} {Type Echoes} {Name a}").scan_part
    'echoes'
    """
    match = _TYPE.match(text) if side == "server" else None
    part = _SCAN_PARTS[match[1].lower()] if match else None
    return Line(number, side, text, part)


_Numbered: TypeAlias = deque[tuple[int, Line]]


class LineQueue:
    """Accepts chunks of streams in one thread, and returns lines in another.

    Attributes:
        dropped: Number of scans dropped.
    """

    def __init__(
        self, max_scans: int = MAX_SCANS, max_characters: int = MAX_CHARACTERS
    ) -> None:
        """Create an empty queue.

        Args:
            max_scans: Limit of scans that wait, at least 1.
            max_characters: Limit of characters that wait; beyond it the oldest lines of
                any type are dropped.
        """
        self.dropped = 0
        self._max_scans = max_scans
        self._max_characters = max_characters
        self._buffers: dict[tuple[int, Side], LineBuffer] = {}
        # two queues, so that a scan is dropped without searching all lines
        self._scan_lines: _Numbered = deque()
        self._other_lines: _Numbered = deque()
        self._numbers = count()
        self._scans = 0
        self._characters = 0
        self._only: int | None = None
        self._has_ended = False
        self._changed = Condition()

    def put(self, number: int, side: Side, data: bytes) -> None:
        """Add a chunk that one side sent on one connection; never raises."""
        # Without the lock, as only the thread that adds uses the buffers.
        texts = self._split(number, side, data)
        lines = [classify_line(number, side, text) for text in texts]
        with self._changed:
            if self._has_ended or self._only not in (None, number):
                return
            for line in lines:
                self._append(line)
            if lines:
                self._changed.notify()

    def take(self) -> Line | None:
        """Wait for the next line; return None if there is none and none will come."""
        with self._changed:
            while not self._has_lines and not self._has_ended:
                self._changed.wait()
            return self._pop() if self._has_lines else None

    def end(self) -> None:
        """Accept no more; lines that wait can still be taken."""
        with self._changed:
            self._has_ended = True
            self._changed.notify()

    def keep_only(self, number: int) -> None:
        """Drop all lines of other connections, those to come included."""
        with self._changed:
            self._only = number
            kept: list[Line] = []
            while self._has_lines:
                line = self._pop()
                if line.number == number:
                    kept.append(line)
            for line in kept:
                self._append(line)

    def _split(self, number: int, side: Side, data: bytes) -> list[str]:
        """Return the lines that a chunk completes; overlong ones are left out."""
        # Not even split: bytes of other connections shall cost nothing.
        if self._only not in (None, number):
            self._buffers.pop((number, side), None)
            return []
        lines = []
        # line by line, so that an overlong one takes no other with it
        for chunk in data.splitlines(keepends=True):
            buffer = self._buffers.setdefault((number, side), LineBuffer())
            lines += buffer.feed(chunk)
            if buffer.overflow is not None:
                del self._buffers[number, side]
        return lines

    @property
    def _has_lines(self) -> bool:
        return bool(self._scan_lines or self._other_lines)

    def _append(self, line: Line) -> None:
        lines = self._other_lines if line.scan_part is None else self._scan_lines
        lines.append((next(self._numbers), line))
        self._scans += line.scan_part == "ranges"
        self._characters += len(line.text)
        if self._scans > self._max_scans:
            self._drop_scan()
        while self._characters > self._max_characters:
            self.dropped += self._pop().scan_part == "ranges"

    def _pop(self) -> Line:
        queues = [lines for lines in (self._scan_lines, self._other_lines) if lines]
        # The older of the two heads: lines leave in the order in which they came.
        return self._pop_from(min(queues, key=lambda lines: lines[0][0]))

    def _pop_from(self, lines: _Numbered) -> Line:
        _, line = lines.popleft()
        self._scans -= line.scan_part == "ranges"
        self._characters -= len(line.text)
        return line

    def _drop_scan(self) -> None:
        """Remove the oldest scan, and all echoes before it."""
        while self._pop_from(self._scan_lines).scan_part != "ranges":
            pass
        self.dropped += 1
