"""A limit of messages per second."""

from collections import deque


class RateLimit:
    """Counts messages in a window of a second."""

    def __init__(self, most: int) -> None:
        """Start with an empty window.

        Args:
            most: Greatest number of messages in any second.
        """
        self._times: deque[float] = deque(maxlen=most)

    def allows(self, now: float) -> bool:
        """Count a message at a time in s, and return whether it is within the limit."""
        times = self._times
        is_full = len(times) == times.maxlen
        within = not is_full or now - times[0] >= 1.0
        times.append(now)
        return within
