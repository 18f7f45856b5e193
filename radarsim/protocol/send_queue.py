r"""The lines that wait to be sent to one client.

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

from collections import deque


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
        if self._readings + len(lines) > self.limit:
            for line in lines.splitlines(keepends=True):
                self.put(line, keep=False)
        elif lines:
            self._lines.append((lines, None))
            self._readings += len(lines)

    def take(self) -> bytes:
        """Remove and return all lines, in order."""
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
            elif keep:
                answers.append((line, keep))
            else:
                self._readings -= len(line)
                self.dropped += line.count(b"\n")
        # They were ahead of all lines that are left, so they return to the front.
        self._lines.extendleft(reversed(answers))
