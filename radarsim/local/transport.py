"""The connection between a client of the library and a robot in the same process."""

from __future__ import annotations

from typing import TYPE_CHECKING

from radarsim.errors import ClientError
from radarsim.server.host.connection import SendQueue
from radarsim.simulation.clock import TICK

if TYPE_CHECKING:
    from radarsim.local.robot import LocalRobot


class LocalTransport:
    """The connection of a client of the library to a robot in this process.

    Attributes:
        unread: What the robot was sent and the client has not read.
        diagnostics: Texts on commands without effect.
    """

    def __init__(self, robot: LocalRobot) -> None:
        self.unread = SendQueue()
        self.diagnostics: list[str] = []
        self._robot = robot

    def time(self) -> float:
        """Return simulated time, s."""
        return self._robot.simulation.time

    def send(self, data: bytes) -> None:
        """Send bytes."""
        try:
            self._robot.send(data)
        except ClientError as error:
            self.diagnostics.append(str(error))

    def receive(self, timeout: float) -> bytes:
        """Return what is unread, or else what comes in the next steps.

        Args:
            timeout: Longest simulated wait, s.

        Raises:
            TimeoutError: If nothing has come by then.
        """
        for _ in range(max(1, round(timeout / TICK))):
            if data := self._take():
                return data
            self._robot.simulation.step(TICK)
        if data := self._take():
            return data
        raise TimeoutError(f"nothing came within {timeout:g} s of simulated time")

    def _take(self) -> bytes:
        # Between two ticks: the server's thread may add to it.
        return self._robot.simulation.call(lambda _: self.unread.take())

    def close(self) -> None:
        """Do nothing: the robot stays in the simulation."""
