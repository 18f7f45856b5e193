"""Observations of a navigator: its pose, and the ranges around it.

Ranges are measured from the robot's centre, about which it turns: a turn on the spot
then changes no distance.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from radarsim.geometry import Floats, Pose2, Pose3

FAR = 1e3  # m; assumed range of beams without return, to compute their bearings


class ScanClock:
    """Times scans by their time stamps, and by a clock where the stamps do not advance.

    Some servers send no time stamps, or the same one again and again.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        """Create the clock.

        Args:
            clock: Returns the time in s; measures what the stamps leave out.
        """
        self._clock = clock
        self._stamp = math.nan
        self._last_read = math.nan
        self._offset = 0.0  # s by the clock while the stamps did not advance

    def time_of(self, stamp: float) -> float:
        """Return the time of the next scan, s.

        Args:
            stamp: Time stamp of the scan, s; nan if it has none.
        """
        now = self._clock()
        if math.isnan(self._stamp):
            self._stamp = stamp if math.isfinite(stamp) else now
        elif stamp > self._stamp:
            self._stamp = stamp
        else:
            self._offset += now - self._last_read
        self._last_read = now
        return self._stamp + self._offset


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """One scan as seen from the robot's centre, and the pose that belongs to it.

    Attributes:
        time: Server time, s.
        pose: Estimated pose of the robot, map frame.
        bearings: (N,) rad, counter-clockwise from the robot's front, in [-pi, pi).
        ranges: (N,) m from the robot's centre; ``inf`` for beams without return.
        farther: (M, 2) bearings, rad, and ranges, m, of what else blocks robots, behind
            what the ranges tell; seen through something thin.
    """

    time: float
    pose: Pose2
    bearings: Floats
    ranges: Floats
    farther: Floats = field(default_factory=lambda: np.zeros((0, 2)))

    def points(self) -> Floats:
        """Return the end points of the beams with a return, (M, 2) m, map frame."""
        returned = np.isfinite(self.ranges)
        return self._points(self.bearings[returned], self.ranges[returned])

    def blocking_points(self) -> Floats:
        """Return these points and those of ``farther``, (M, 2) m, map frame."""
        return np.vstack([self.points(), self._points(*self.farther.T)])

    def _points(self, bearings: Floats, ranges: Floats) -> Floats:
        angles = bearings + self.pose.yaw
        directions = np.column_stack([np.cos(angles), np.sin(angles)])
        points: Floats = directions * ranges[:, None]
        points += self.pose.x, self.pose.y
        return points


def from_centre(
    ranges: Floats, angles: Floats, mount: Pose3, max_range: float
) -> tuple[Floats, Floats]:
    """Convert a scan to bearings and ranges from the robot's centre.

    Args:
        ranges: (N,) m from the scanner; ``max_range`` or more means no return.
        angles: (N,) rad, counter-clockwise from the scanner's front.
        mount: Pose of the scanner in the body frame; level, at any height.
        max_range: m.

    Returns:
        Bearings and ranges as in ``Observation``, (N,) each.
    """
    returned = ranges < max_range - 1e-6
    lengths = np.where(returned, ranges, FAR)
    angles = angles + mount.yaw
    x = mount.x + lengths * np.cos(angles)
    y = mount.y + lengths * np.sin(angles)
    bearings = np.arctan2(y, x)
    bearings[bearings >= math.pi] = -math.pi
    return bearings, np.where(returned, np.hypot(x, y), math.inf)


def wrap_angles(angles: Floats) -> Floats:
    """Wrap angles to [-pi, pi), rad."""
    # numpy's remainder takes three times as long
    turns = np.floor((angles + math.pi) / (2 * math.pi))
    wrapped: Floats = angles - 2 * math.pi * turns
    return wrapped
