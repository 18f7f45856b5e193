"""Runs client and server in lockstep in one process, as fast as the machine allows.

There is no socket and no wall clock: simulated time passes only while the client waits
for data, and stands still during the client's computations. The same seed, map and
client give the same run.
"""

from collections.abc import Callable, Iterable
from typing import Final

from radarsim.server.host import Diagnostic, Host
from radarsim.simulation.clock import TICK

MOST_DIAGNOSTICS: Final = 10  # number of newest texts that are kept


def receive_stepwise(
    take: Callable[[], bytes], step: Callable[[], None], timeout: float
) -> bytes:
    """Advance simulated time until there is data, and return the data.

    Args:
        take: Returns received data, which may be empty.
        step: Advances simulated time by one tick.
        timeout: Longest simulated wait, s.

    Raises:
        TimeoutError: If no data comes within the timeout.
    """
    # Ticks are counted, because a sum of times would accumulate rounding errors.
    for _ in range(max(1, round(timeout / TICK))):
        if data := take():
            return data
        step()
    if data := take():
        return data
    raise TimeoutError(f"no data within {timeout:g} s of simulated time")


class InProcessTransport:
    """A client's connection to a host in the same process.

    Attributes:
        host: The server.
        number: The client's number at the host.
        diagnostics: Newest texts about the client's commands without effect.
    """

    def __init__(
        self, host: Host, *, after_tick: Callable[[], None] = lambda: None
    ) -> None:
        """Connect to a host.

        Args:
            host: The server, whose time passes while ``receive`` waits.
            after_tick: Called after every tick, to observe the simulation.
        """
        self.host = host
        self.number = host.connect()
        self.diagnostics: list[str] = []
        self._after_tick = after_tick
        self._open = True

    def time(self) -> float:
        """Return simulated time, s."""
        return self.host.simulation.time

    def send(self, data: bytes) -> None:
        """Send bytes.

        Raises:
            ConnectionError: If the connection is closed.
        """
        self._require_open()
        self._note(self.host.receive(self.number, data))

    def receive(self, timeout: float) -> bytes:
        """Advance simulated time until there is data, and return the data.

        Args:
            timeout: Longest simulated wait, s.

        Raises:
            TimeoutError: If no data comes within the timeout.
            ConnectionError: If the connection is closed.
            Exception: The error that has ended a robot, which only a bug can cause.
        """
        self._require_open()
        return receive_stepwise(
            lambda: self.host.take(self.number), self._step, timeout
        )

    def _step(self) -> None:
        waited = self.host.step()
        self.host.raise_fault()
        self._note([found for number, found in waited if number == self.number])
        self._after_tick()

    def close(self) -> None:
        """Disconnect, which removes the client's robot."""
        if self._open:
            self._open = False
            self.host.disconnect(self.number)

    def _note(self, found: Iterable[Diagnostic]) -> None:
        self.diagnostics += [each.text for each in found]
        del self.diagnostics[:-MOST_DIAGNOSTICS]

    def _require_open(self) -> None:
        if not self._open:
            raise ConnectionError("the connection is closed")
