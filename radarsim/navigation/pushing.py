"""When a robot gets nowhere: it pushes against what it does not see, or just stands."""

from typing import Final

from radarsim.errors import NavigationError
from radarsim.geometry import Pose2, wrap_angle
from radarsim.navigation.following import moved
from radarsim.navigation.motion import Motion
from radarsim.navigation.sensed import Sensed

STUCK_AFTER = 3.0  # m that a robot was told to go while it stayed where it is
_STAYS = 0.1  # m
_TURNS = 0.3  # rad
STOOD_FOR: Final = 60.0  # s


class Push:
    """Compares where a robot is with how far it was told to go."""

    def __init__(self) -> None:
        self._since: Sensed | None = None
        self._last = 0.0
        self._told = 0.0

    def check(self, sensed: Sensed, motion: Motion) -> None:
        """Take in a scan, and what was decided by it.

        Raises:
            NavigationError: If it stays where it is.
        """
        passed, self._last = sensed.time - self._last, sensed.time
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


class Standstill:
    """Notices that a robot neither goes nor turns any more, whatever the reason."""

    def __init__(self) -> None:
        self._since: Sensed | None = None

    def check(self, sensed: Sensed) -> None:
        """Take in a scan.

        Raises:
            NavigationError: If it has stood for a minute.
        """
        since = self._since
        if since is None or _has_moved(since.pose, sensed.pose):
            self._since = sensed
        elif sensed.time - since.time > STOOD_FOR:
            pose = sensed.pose
            raise NavigationError(
                f"the robot has stood at {pose.x:.2f} {pose.y:.2f} for {STOOD_FOR:g} s:"
                " on all sides something is nearer than the safety distance"
            )


def _has_moved(before: Pose2, now: Pose2) -> bool:
    turned = abs(wrap_angle(now.yaw - before.yaw))
    return moved(before, now) > _STAYS or turned > _TURNS
