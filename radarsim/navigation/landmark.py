"""Places on a boundary that a robot recognises when it comes by again.

Poses drift, so the very point is never met again. But a robot that follows the same
boundary in the same direction crosses the line that stands upright on its way there,
and does so not far from the point.
"""

import math

from radarsim.geometry import Pose2


class Landmark:
    """A point of a way, and the direction that the way has there.

    Attributes:
        x: m, map frame.
        y: m.
        direction: rad, map frame.
    """

    def __init__(self, pose: Pose2, direction: float, *, reach: float) -> None:
        """Remember a place.

        Args:
            pose: Where.
            direction: Of the way, rad, map frame.
            reach: How far beside the point a way still counts, m.
        """
        self.x, self.y = pose.x, pose.y
        self.direction = direction
        self._reach = reach
        self._ahead = 0.0

    def passed(self, pose: Pose2, *, onward: bool = True) -> bool:
        """Tell whether the last step went past it; to be asked at every step.

        Args:
            pose: Where the robot is now.
            onward: Whether to be passed in its direction, or against it.
        """
        dx, dy = pose.x - self.x, pose.y - self.y
        c, s = math.cos(self.direction), math.sin(self.direction)
        before, self._ahead = self._ahead, c * dx + s * dy
        beside = abs(c * dy - s * dx)
        if beside > self._reach:
            return False
        return before < 0 <= self._ahead if onward else before > 0 >= self._ahead
