"""The clock of a simulation, and schedules of tasks that are due periodically.

Simulated time is counted in ticks of 10 ms, so rounding errors do not accumulate.
"""

from dataclasses import dataclass
from typing import Final, Generic, TypeVar

TICK: Final = 0.01  # s

Entry = TypeVar("Entry")


def seconds(ticks: int) -> float:
    """Return the simulated time of a tick, s."""
    # The division gives the nearest float of the decimal time: 57 / 100 is 0.57, but
    # 57 * 0.01 is not.
    return ticks / 100


def ticks_of(interval: float) -> int:
    """Convert an interval, s, to a whole number of ticks, at least one."""
    return max(1, round(interval / TICK))


@dataclass(slots=True)
class Clock:
    """Simulated time, counted in ticks.

    Attributes:
        ticks: Number of ticks since the start.
    """

    ticks: int = 0

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return seconds(self.ticks)


class Schedule(Generic[Entry]):
    """A schedule of entries that are due at regular intervals, counted from a tick.

    Finding the entries of a tick takes no time for entries that are not due.

    Attributes:
        clock: The clock that counts the ticks.
    """

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        # Entries by interval and by the remainder of their ticks; dicts keep the order.
        self._entries: dict[int, dict[int, dict[Entry, None]]] = {}
        self._requested: dict[Entry, None] = {}

    def add(self, entry: Entry, interval: int, since: int | None = None) -> None:
        """Make an entry due every ``interval`` ticks.

        An entry can have several intervals.

        Args:
            entry: The entry.
            interval: Ticks between two times at which the entry is due.
            since: The tick from which intervals are counted; None for the current tick.
        """
        start = self.clock.ticks if since is None else since
        phases = self._entries.setdefault(interval, {})
        phases.setdefault(start % interval, {})[entry] = None

    def request(self, entry: Entry) -> None:
        """Make an entry due once more, at the next call of ``due``."""
        self._requested[entry] = None

    def remove(self, entry: Entry) -> None:
        """Remove an entry with all its intervals."""
        self._requested.pop(entry, None)
        for interval, phases in list(self._entries.items()):
            for phase, entries in list(phases.items()):
                entries.pop(entry, None)
                if not entries:
                    del phases[phase]
            if not phases:
                del self._entries[interval]

    def due(self) -> list[Entry]:
        """Return all entries that are due in this tick, each only once."""
        # A dict keeps the order and drops duplicates: an entry may be both requested
        # and due.
        found, self._requested = self._requested, {}
        for interval, phases in self._entries.items():
            found |= phases.get(self.clock.ticks % interval, {})
        return list(found)
