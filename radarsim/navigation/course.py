"""How far a robot has come, and for how long."""

from radarsim.geometry import Pose2
from radarsim.navigation.following import moved
from radarsim.navigation.sensed import Sensed


class Course:
    """Adds up a run, scan by scan.

    Attributes:
        start: Where the robot was at the first scan; None before that.
        time: From the first scan to the last, s.
        length: Of the way, m.
    """

    def __init__(self, *, noise: float = 0.0) -> None:
        """Begin.

        Args:
            noise: m; the robot has not moved as long as it is no farther away.
        """
        self.start: Pose2 | None = None
        self.time = 0.0
        self.length = 0.0
        self._noise = noise
        self._began = 0.0
        self._last = Pose2(0.0, 0.0)

    def add(self, sensed: Sensed) -> None:
        """Take in a scan."""
        if self.start is None:
            self.start = self._last = sensed.pose
            self._began = sensed.time
        self.time = sensed.time - self._began
        step = moved(self._last, sensed.pose)
        if step > self._noise:
            self.length += step
            self._last = sensed.pose
