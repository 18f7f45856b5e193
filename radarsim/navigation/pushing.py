"""When a robot pushes against something that it does not see."""

from radarsim.errors import NavigationError
from radarsim.navigation.following import moved
from radarsim.navigation.motion import Motion
from radarsim.navigation.sensed import Sensed

STUCK_AFTER = 3.0  # m that a robot was told to go while it stayed where it is
_STAYS = 0.1  # m


class Push:
    """Compares where a robot is with how far it was told to go."""

    def __init__(self) -> None:
        self._since: Sensed | None = None
        self._time = 0.0
        self._told = 0.0

    def check(self, sensed: Sensed, motion: Motion) -> None:
        """Take in a scan, and what was decided by it.

        Raises:
            NavigationError: If it stays where it is.
        """
        if self._since is None or moved(self._since.pose, sensed.pose) > _STAYS:
            self._since, self._told = sensed, 0.0
        else:
            self._told += abs(motion.speed) * (sensed.time - self._time)
        self._time = sensed.time
        if self._told > STUCK_AFTER:
            pose = self._since.pose
            raise NavigationError(
                f"the robot stays at {pose.x:.2f} {pose.y:.2f}, told to go"
                f" {STUCK_AFTER:g} m; perhaps something is nearer than it is seen,"
                " and the safety distance too small"
            )
