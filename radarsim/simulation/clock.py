"""Simulated time: whole ticks of 10 ms, so that times never drift from their digits."""

from typing import Final

TICK: Final = 0.01  # s


def seconds(ticks: int) -> float:
    """Give the time of a tick, s."""
    return ticks / 100


def ticks_of(interval: float) -> int:
    """Give the number of ticks nearest to an interval in s, at least one."""
    return max(1, round(interval / TICK))
