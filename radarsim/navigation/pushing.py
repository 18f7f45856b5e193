"""When a robot pushes against something that it does not see."""

from collections.abc import Callable

from radarsim.errors import NavigationError
from radarsim.navigation.following import moved
from radarsim.navigation.motion import Motion
from radarsim.navigation.sensed import Sensed

STUCK_AFTER = 3.0  # m that a robot was told to go while it stayed where it is
_STAYS = 0.1  # m


class Push:
    """Compares where a robot is with how far it was told to go."""

    def __init__(self, clock: Callable[[], float]) -> None:
        """Begin.

        Args:
            clock: Gives s, for scans whose time stamps do not advance.
        """
        self._clock = clock
        self._since: Sensed | None = None
        self._stamp = 0.0
        self._read = 0.0
        self._told = 0.0

    def check(self, sensed: Sensed, motion: Motion) -> None:
        """Take in a scan, and what was decided by it.

        Raises:
            NavigationError: If it stays where it is.
        """
        passed = self._passed(sensed.time)
        if self._since is None or moved(self._since.pose, sensed.pose) > _STAYS:
            self._since, self._told = sensed, 0.0
        else:
            self._told += abs(motion.speed) * passed
        if self._told > STUCK_AFTER:
            pose = self._since.pose
            raise NavigationError(
                f"the robot stays at {pose.x:.2f} {pose.y:.2f}, told to go"
                f" {STUCK_AFTER:g} m; perhaps something is nearer than it is seen,"
                " and the safety distance too small"
            )

    def _passed(self, stamp: float) -> float:
        """Give s since the last scan."""
        by_stamps, self._stamp = stamp - self._stamp, stamp
        now = self._clock()
        by_clock, self._read = now - self._read, now
        return by_stamps if by_stamps > 0 else by_clock
