r"""What waits to be sent to one client: whole lines, the stale ones given up first.

A client that reads too slowly loses old readings, never an answer, and never part of a
line. What has been taken is on its way and cannot be lost any more.

>>> outbox = SendQueue(limit=20)
>>> outbox.put(b"NFO {A b}\r\n", keep=True)
>>> outbox.put(b"SEN {A 1}\r\n", keep=False)
>>> outbox.put(b"SEN {A 2}\r\n", keep=False)
>>> outbox.take()
b'NFO {A b}\r\n'
>>> outbox.dropped
2
"""

from collections import deque


class SendQueue:
    """Lines that wait for one client.

    Attributes:
        limit: Bytes of readings that may wait; beyond it the oldest are dropped.
        ceiling: Bytes of answers that may wait; beyond it ``overflowed`` becomes true,
            and the client is to be disconnected.
        dropped: How many readings were given up.
        flooded: Whether the client asks, and does not read the answers.
    """

    def __init__(self, limit: int = 262_144, ceiling: int = 4_194_304) -> None:
        self.limit = limit
        self.ceiling = ceiling
        self.dropped = 0
        self.overflowed = False
        self._lines: deque[tuple[bytes, bool]] = deque()
        self._readings = 0
        self._answers = 0

    def __len__(self) -> int:
        return self._readings + self._answers

    def put(self, line: bytes, *, keep: bool) -> None:
        """Add a line.

        Args:
            line: With its end.
            keep: Whether it is an answer, which may not be dropped.
        """
        self._lines.append((line, keep))
        if keep:
            self._answers += len(line)
            self.overflowed |= self._answers > self.ceiling
        else:
            self._readings += len(line)
            if self._readings > self.limit:
                self._give_up_readings()

    def take(self) -> bytes:
        """Give all that waits, in order."""
        data = b"".join(line for line, _ in self._lines)
        self._lines.clear()
        self._readings = self._answers = 0
        return data

    def _give_up_readings(self) -> None:
        """Drop the oldest readings until the rest fits in half the limit.

        In half, so that the walk over all lines is rare, however many there are.
        """
        kept: deque[tuple[bytes, bool]] = deque()
        while self._readings > self.limit // 2:
            line, keep = self._lines.popleft()
            if keep:
                kept.append((line, keep))
            else:
                self._readings -= len(line)
                self.dropped += 1
        self._lines.extendleft(reversed(kept))
