"""Lines as they are overheard: who said them, where, and whether scans are in them."""

import re
from collections import deque
from dataclasses import dataclass
from itertools import count
from operator import itemgetter
from threading import Condition
from typing import Final, Literal, TypeAlias

from radarsim.protocol.framing import LineBuffer

Side: TypeAlias = Literal["client", "server"]  # who says something
Part: TypeAlias = Literal["ranges", "echoes"]

_PARTS: Final[dict[str, Part]] = {"rangescanner": "ranges", "echoes": "echoes"}
_TYPE: Final = re.compile(
    r"SEN\b.*?\{\s*Type\s+(RangeScanner|Echoes)\s*\}", re.IGNORECASE
)


@dataclass(frozen=True, slots=True)
class Line:
    """A line.

    Attributes:
        number: Of the connection.
        side: Who says it.
        text: Without its end.
        part: What it holds of a scan; None for any other line.
    """

    number: int
    side: Side
    text: str
    part: Part | None


def read_line(number: int, side: Side, text: str) -> Line:
    """Find out whether a line holds something of a scan, without reading it.

    >>> read_line(1, "server", "SEN {Time 2} {Type RangeScanner} {Name a} ...").part
    'ranges'
    """
    found = _TYPE.match(text) if side == "server" else None
    return Line(number, side, text, _PARTS[found[1].lower()] if found else None)


# Section from tap.backlog.
# Lines that were overheard and wait to be understood; the oldest scans give way.
#
# Who puts lines in is never kept waiting. Who takes them out may be slow: then scans
# are
# left out whole, with the echoes before them, and everything between them stays.

_Numbered: TypeAlias = deque[tuple[int, Line]]

MOST_SCANS: Final = 20
MOST_CHARACTERS: Final = 2**24  # of all lines


class LineQueue:
    """Takes pieces of streams in one thread, and gives lines in another.

    Attributes:
        dropped: How many scans were left out.
    """

    def __init__(
        self, most_scans: int = MOST_SCANS, most_characters: int = MOST_CHARACTERS
    ) -> None:
        """Begin with none.

        Args:
            most_scans: That wait, at least 1.
            most_characters: That wait; then the oldest lines give way, of any kind.
        """
        self.dropped = 0
        self._most_scans = most_scans
        self._most_characters = most_characters
        self._buffers: dict[tuple[int, Side], LineBuffer] = {}
        # apart, so that a scan is left out without looking through all else
        self._of_scans: _Numbered = deque()
        self._others: _Numbered = deque()
        self._numbers = count()
        self._scans = 0
        self._characters = 0
        self._only: int | None = None
        self._ended = False
        self._changed = Condition()

    def put(self, number: int, side: Side, data: bytes) -> None:
        """Take a piece of what one side says on one connection; never raises."""
        texts = self._cut(number, side, data)
        lines = [read_line(number, side, text) for text in texts]
        with self._changed:
            if self._ended or self._only not in (None, number):
                return
            for line in lines:
                self._append(line)
            if lines:
                self._changed.notify()

    def take(self) -> Line | None:
        """Wait for the next line; None if there is none, and none will come."""
        with self._changed:
            while not self._waits and not self._ended:
                self._changed.wait()
            return self._pop() if self._waits else None

    def end(self) -> None:
        """Take no more; what is there can still be had."""
        with self._changed:
            self._ended = True
            self._changed.notify()

    def keep_only(self, number: int) -> None:
        """From now on take nothing of other connections."""
        with self._changed:
            self._only = number
            kept: list[Line] = []
            while self._waits:
                line = self._pop()
                if line.number == number:
                    kept.append(line)
            for line in kept:
                self._append(line)

    def _cut(self, number: int, side: Side, data: bytes) -> list[str]:
        """Give the lines that a piece completes; what is too long is left out."""
        if self._only not in (None, number):
            self._buffers.pop((number, side), None)
            return []
        lines = []
        for piece in data.splitlines(keepends=True):
            buffer = self._buffers.setdefault((number, side), LineBuffer())
            lines += buffer.feed(piece)
            if buffer.overflow is not None:
                del self._buffers[number, side]
        return lines

    @property
    def _waits(self) -> bool:
        return bool(self._of_scans or self._others)

    def _append(self, line: Line) -> None:
        lines = self._others if line.part is None else self._of_scans
        lines.append((next(self._numbers), line))
        self._scans += line.part == "ranges"
        self._characters += len(line.text)
        if self._scans > self._most_scans:
            self._leave_out_a_scan()
        while self._characters > self._most_characters:
            self.dropped += self._pop().part == "ranges"

    def _pop(self) -> Line:
        """Take the oldest line."""
        fronts = (lines[0] for lines in (self._of_scans, self._others) if lines)
        _, oldest = min(fronts, key=itemgetter(0))
        return self._pop_from(self._others if oldest.part is None else self._of_scans)

    def _pop_from(self, lines: _Numbered) -> Line:
        _, line = lines.popleft()
        self._scans -= line.part == "ranges"
        self._characters -= len(line.text)
        return line

    def _leave_out_a_scan(self) -> None:
        """Remove the oldest scan, and all echoes before it."""
        while self._pop_from(self._of_scans).part != "ranges":
            pass
        self.dropped += 1
