"""Times of scans that go on even where a server's time stamps do not."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from radarsim.geometry import Floats, Pose2, Pose3


class ScanClock:
    """Reads time stamps; some servers send none, or the same one again and again."""

    def __init__(self, clock: Callable[[], float]) -> None:
        """Begin.

        Args:
            clock: Gives s; counts from one scan to the next where stamps do not.
        """
        self._clock = clock
        self._stamp = math.nan
        self._read = math.nan
        self._ahead = 0.0  # s by the clock that the stamps have left out

    def time_of(self, stamp: float) -> float:
        """Give the time of the next scan, s.

        Args:
            stamp: Its own, s; nan if it has none.
        """
        now = self._clock()
        if math.isnan(self._stamp):
            self._stamp = stamp if math.isfinite(stamp) else now
        elif stamp > self._stamp:
            self._stamp = stamp
        else:
            self._ahead += now - self._read
        self._read = now
        return self._stamp + self._ahead


# Section from navigation.sensed.
# What a navigator knows at one moment: where it seems to be, and what is around.
#
# Everything that it decides by is measured from the robot's centre, about which it
# turns: a turn on the spot then changes no distance.

FAR = 1e3  # m; where a beam without return is taken to end, to have a bearing


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """One scan, seen from the robot's centre, and the pose that belongs to it.

    Attributes:
        time: s of the server.
        pose: Where the robot takes itself to be, map frame.
        bearings: (N,) rad, counter-clockwise from the robot's front, in [-pi, pi).
        ranges: (N,) m from the robot's centre, ``inf`` where nothing came back.
    """

    time: float
    pose: Pose2
    bearings: Floats
    ranges: Floats

    def points(self) -> Floats:
        """Give the places where beams ended, (M, 2) m, map frame."""
        ended = np.isfinite(self.ranges)
        angles = self.bearings[ended] + self.pose.yaw
        ahead = np.column_stack([np.cos(angles), np.sin(angles)])
        points: Floats = ahead * self.ranges[ended, None] + (self.pose.x, self.pose.y)
        return points


def from_centre(
    ranges: Floats, angles: Floats, mount: Pose3, max_range: float
) -> tuple[Floats, Floats]:
    """Express a scan by bearings and ranges from the robot's centre.

    Args:
        ranges: (N,) m from the scanner; at ``max_range`` and beyond nothing came back.
        angles: (N,) rad, counter-clockwise from the scanner's front.
        mount: The scanner in the body frame; level, whatever its height.
        max_range: m.

    Returns:
        Bearings and ranges as in ``Observation``, (N,) each.
    """
    ended = ranges < max_range - 1e-6
    reach = np.where(ended, ranges, FAR)
    angles = angles + mount.yaw
    x = mount.x + reach * np.cos(angles)
    y = mount.y + reach * np.sin(angles)
    bearings = np.arctan2(y, x)
    bearings[bearings >= math.pi] = -math.pi
    return bearings, np.where(ended, np.hypot(x, y), math.inf)
