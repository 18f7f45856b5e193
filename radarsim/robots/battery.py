"""The battery: it drains with time alone, whatever the robot does."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Battery:
    """A charge that falls by one second of life a second.

    Attributes:
        life: Full charge, s.
        runs_out: Whether it ever gets empty. One that does not stays at its last
            second, because clients pause a robot whose battery reads 0.
    """

    life: float
    runs_out: bool = False

    def seconds_left(self, elapsed: float) -> int:
        """Give what is left ``elapsed`` s after the spawn, whole s, rounded down."""
        # rounded first: a sum of ticks that is a hair too long must not cost a second
        left = int(max(0.0, self.life - round(elapsed, 6)))
        return left if self.runs_out else max(1, left)

    def is_empty(self, elapsed: float) -> bool:
        """Tell whether the robot is dead ``elapsed`` s after the spawn."""
        return self.seconds_left(elapsed) == 0
