"""Client and server in one process, in turns, as fast as the machine allows.

No socket and no wall clock is between them: a client that waits lets simulated time
pass, and what it decides takes none. The same seed, map and client give the same run.
"""

from collections.abc import Callable

from radarsim.host import Host
from radarsim.simulation.config import TICK


class InProcessTransport:
    """A client's connection to a host of this process.

    Attributes:
        host: The server.
        number: That the host knows this client by.
    """

    def __init__(
        self, host: Host, *, after_tick: Callable[[], None] = lambda: None
    ) -> None:
        """Connect.

        Args:
            host: The server; whoever waits on this link lets its time pass.
            after_tick: Called after every tick, for whoever judges the run.
        """
        self.host = host
        self.number = host.connect()
        self._after_tick = after_tick
        self._open = True

    def time(self) -> float:
        """Simulated time, s."""
        return self.host.simulation.time

    def send(self, data: bytes) -> None:
        """Hand over bytes.

        Raises:
            ConnectionError: If the link is closed.
        """
        self._check()
        self.host.receive(self.number, data)

    def receive(self, timeout: float) -> bytes:
        """Let time pass until there is something to read.

        Args:
            timeout: Longest simulated wait, s.

        Raises:
            TimeoutError: If nothing has come by then.
            ConnectionError: If the link is closed.
        """
        self._check()
        data = self.host.take(self.number)
        for _ in range(max(1, round(timeout / TICK))):
            if data:
                return data
            self.host.step()
            self._after_tick()
            data = self.host.take(self.number)
        if data:
            return data
        raise TimeoutError(f"nothing came within {timeout:g} s of simulated time")

    def close(self) -> None:
        """Leave the host, upon which the robot leaves the floor."""
        if self._open:
            self._open = False
            self.host.disconnect(self.number)

    def _check(self) -> None:
        if not self._open:
            raise ConnectionError("the link is closed")
