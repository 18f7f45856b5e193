"""Times of scans that go on even where a server's time stamps do not."""

import math
from collections.abc import Callable


class Stamps:
    """Reads time stamps; some servers send none, or the same one again and again."""

    def __init__(self, clock: Callable[[], float]) -> None:
        """Begin.

        Args:
            clock: Gives s; counts from one scan to the next where stamps do not.
        """
        self._clock = clock
        self._stamp = math.nan
        self._read = math.nan
        self._ahead = 0.0  # s by the clock that the stamps have left out

    def time_of(self, stamp: float) -> float:
        """Give the time of the next scan, s.

        Args:
            stamp: Its own, s; nan if it has none.
        """
        now = self._clock()
        if math.isnan(self._stamp):
            self._stamp = stamp if math.isfinite(stamp) else now
        elif stamp > self._stamp:
            self._stamp = stamp
        else:
            self._ahead += now - self._read
        self._read = now
        return self._stamp + self._ahead
