"""How much is read from each connection, so that no client keeps the server busy.

A connection has an allowance of bytes that grows with every tick. While it lasts, the
connection is read whenever something has come. One that has used up its allowance has
to wait for its turn, in which it is read once, and a tick has only a few turns: what
all clients together can send beyond their allowances is limited, and a client that
sends little never waits.
"""

from collections import deque

REFILL = 512  # bytes a tick; 50 kB/s is ten times what a robot's driver sends
BURST = 2048  # bytes at once
READ_COST = 128  # bytes that a read counts besides its own; each costs some 30 us
TURNS = 8  # in a tick, of all connections together


class ReadAllowance:
    """What may be read from one connection.

    Attributes:
        exhausted: Whether the connection has to wait for its turn.
        closed: Whether the connection is closed, and needs no turn.
    """

    def __init__(self, turns: "ReadTurns") -> None:
        self.exhausted = False
        self.closed = False
        self._turns = turns
        self._left = BURST
        self._tick = turns.ticks

    def spend(self, size: int) -> None:
        """Count a read of ``size`` bytes."""
        grown = (self._turns.ticks - self._tick) * REFILL
        self._tick = self._turns.ticks
        self._left = min(BURST, self._left + grown) - size - READ_COST
        if self._left < 0 and not self.exhausted:
            self.exhausted = True
            self._turns.append(self)

    def grant(self) -> None:
        """Permit one more read, however large."""
        self.exhausted = False
        self._left = 0
        self._tick = self._turns.ticks


class ReadTurns:
    """The connections that wait for their turns, the first come first.

    Attributes:
        ticks: Number of ticks so far.
    """

    def __init__(self) -> None:
        self.ticks = 0
        self._waiting: deque[ReadAllowance] = deque()

    def append(self, allowance: ReadAllowance) -> None:
        """Let a connection wait for its turn."""
        self._waiting.append(allowance)

    def advance(self) -> None:
        """Start a tick, and grant its turns."""
        self.ticks += 1
        turns = TURNS
        while self._waiting and turns:
            allowance = self._waiting.popleft()
            if not allowance.closed:
                allowance.grant()
                turns -= 1
