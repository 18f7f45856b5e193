"""The clock of a simulation, and schedules of regular intervals.

Simulated time is counted in ticks of 10 ms, so that sums of steps do not drift.
"""

from dataclasses import dataclass
from typing import Final, Generic, TypeVar

TICK: Final = 0.01  # s

Entry = TypeVar("Entry")


def seconds(ticks: int) -> float:
    """Return the time of a tick, s."""
    # A division, not a product with 0.01: 57 ticks are 0.57 s, and 57 * 0.01 is
    # not.
    return ticks / 100


def ticks_of(interval: float) -> int:
    """Return the number of ticks nearest to an interval in s, at least one."""
    return max(1, round(interval / TICK))


@dataclass(slots=True)
class Clock:
    """Simulated time.

    Attributes:
        ticks: Number of ticks since the start.
    """

    ticks: int = 0

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return seconds(self.ticks)


class Schedule(Generic[Entry]):
    """Entries that are due at regular intervals, each counted from its own tick.

    Finding the entries of a tick takes no time for entries that are not.

    Attributes:
        clock: The clock whose ticks count.
    """

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        # Entries by interval and by the remainder of their ticks; dicts keep the order.
        self._entries: dict[int, dict[int, dict[Entry, None]]] = {}
        self._requested: dict[Entry, None] = {}

    def add(self, entry: Entry, interval: int, since: int | None = None) -> None:
        """Make an entry due every ``interval`` ticks.

        It may be there with other intervals already.

        Args:
            entry: The entry.
            interval: Ticks from one time to the next.
            since: The tick from which intervals are counted; None for this one.
        """
        start = self.clock.ticks if since is None else since
        phases = self._entries.setdefault(interval, {})
        phases.setdefault(start % interval, {})[entry] = None

    def request(self, entry: Entry) -> None:
        """Make an entry due once more, the next time that ``due`` is called."""
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
        """Return the entries that are due in this tick, each of them once."""
        # A dict keeps who came first, and has each entry once: a scan may be both
        # requested and due.
        found, self._requested = self._requested, {}
        for interval, phases in self._entries.items():
            found |= phases.get(self.clock.ticks % interval, {})
        return list(found)
