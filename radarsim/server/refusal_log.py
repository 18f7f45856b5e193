"""The log of connections that a server refuses."""

import asyncio
import logging
from typing import Final

log = logging.getLogger("radarsim.server")

LOG_INTERVAL: Final = 10.0  # s between two lines, as thousands may come in a second


class RefusalLog:
    """Logs the first connection that is refused, and how many were refused since."""

    def __init__(self, kind: str) -> None:
        """Start with nothing refused.

        Args:
            kind: What the peers are, in plural.
        """
        self._kind = kind
        self._untold = 0
        self._next_line = 0.0

    def add(self, peer: str, limit: int) -> None:
        """Count a connection that is refused because there are as many as may be.

        Args:
            peer: Address and port of the peer.
            limit: How many there may be.
        """
        now = asyncio.get_running_loop().time()
        if now < self._next_line:
            self._untold += 1
            return
        others = f", and {self._untold} others before" if self._untold else ""
        reason = f"there are {limit} {self._kind}"
        log.warning("%s: refused%s: %s", peer, others, reason)
        self._untold, self._next_line = 0, now + LOG_INTERVAL
