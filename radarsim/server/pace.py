"""How simulated time follows the wall clock: how fast, or not at all."""

from __future__ import annotations

import math
from collections.abc import Callable

from radarsim.simulation.clock import TICK, ticks_of


class Pace:
    """Says whether simulated time passes in the next tick of a server, and how soon.

    While it is paused a server goes on with its ticks, in which it executes commands
    and answers them, but no time passes in them. Steps let some time pass meanwhile.

    Attributes:
        observers: Called when it is paused or not any more, and when the speed changes.
    """

    def __init__(self, speed: float = 1.0) -> None:
        """Let time pass.

        Args:
            speed: Simulated seconds in one second of the wall clock.
        """
        self.observers: list[Callable[[], None]] = []
        self._speed = speed
        self._is_paused = False
        self._steps = 0  # ticks in which time still passes while it is paused

    @property
    def speed(self) -> float:
        """Simulated seconds in one second of the wall clock."""
        return self._speed

    @property
    def is_paused(self) -> bool:
        """Whether time passes only by steps."""
        return self._is_paused

    @property
    def interval(self) -> float:
        """Time from one tick to the next, s of the wall clock."""
        return TICK / self._speed if self._passes else TICK

    def set_speed(self, speed: float) -> None:
        """Change the speed.

        Raises:
            ValueError: If it is not above 0, or not finite.
        """
        if not (speed > 0 and math.isfinite(speed)):
            raise ValueError(f"speed {speed}, expected a finite number above 0")
        self._change(speed, self._is_paused)

    def pause(self) -> None:
        """Let no more time pass, also of steps that are not over."""
        self._steps = 0
        self._change(self._speed, True)

    def resume(self) -> None:
        """Let time pass again."""
        self._steps = 0
        self._change(self._speed, False)

    def step(self, duration: float) -> None:
        """Let a duration pass, s, rounded to ticks and one of them at least, and pause.

        A step that is not over is followed by this one.
        """
        self._change(self._speed, True)
        self._steps += ticks_of(duration)

    def take_tick(self) -> bool:
        """Count a tick, and return whether time passes in it."""
        passes = self._passes
        self._steps = max(0, self._steps - 1)
        return passes

    @property
    def _passes(self) -> bool:
        return not self._is_paused or self._steps > 0

    def _change(self, speed: float, is_paused: bool) -> None:
        if (speed, is_paused) != (self._speed, self._is_paused):
            self._speed, self._is_paused = speed, is_paused
            for observer in self.observers:
                observer()
