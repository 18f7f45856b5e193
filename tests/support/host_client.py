"""A client of a host without sockets, and all that it reads."""

import pytest

from radarsim.protocol.dialect import COMPAT, UDK
from radarsim.server.host import Host

DIALECTS = pytest.mark.parametrize(
    "dialect", [COMPAT, UDK], ids=lambda dialect: dialect.name
)
GREETING = b"NFO {Gametype BotDeathMatch} {Level DM-EmptyRoom} {TimeLimit 0}\r\n"
STARTS = (  # of the empty room
    b"NFO {StartPoses 3} {RobotStart1 -8.00,0.00,0.00 0.00,0.00,0.00 "
    b"RobotStart2 -8.00,-3.50,0.00 0.00,0.00,0.00 "
    b"RobotStart3 -8.00,3.50,0.00 0.00,0.00,0.00}\r\n"
)


class HostClient:
    """A client of a host."""

    def __init__(self, host: Host, *lines: bytes) -> None:
        """Connect, and send lines that give no diagnostics."""
        self.host = host
        self.number = host.connect()
        host.take(self.number)
        self.writes: list[bytes] = []
        for line in lines:
            assert set(self.send(line)) <= {"outside"}

    @property
    def data(self) -> bytes:
        """All that it read."""
        return b"".join(self.writes)

    def send(self, data: bytes) -> list[str]:
        """Send bytes, and return the kinds of the diagnostics."""
        return [each.kind for each in self.host.receive(self.number, data)]

    def read(self, ticks: int = 0) -> bytes:
        """Let time pass, and return what comes, also what there is already."""
        before = len(self.writes)
        self.writes.append(self.host.take(self.number))
        for _ in range(ticks):
            self.host.step()
            self.writes.append(self.host.take(self.number))
        return b"".join(self.writes[before:])
