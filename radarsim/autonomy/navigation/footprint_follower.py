"""Path follower for a rectangular footprint, which drives slowly in tight spaces.

The robot is steered back to the line of each straight motion, and turns on the spot at
the ends of the line. It makes no motion that would bring the footprint closer than a
centimetre to a seen point. It stops following a path that leads so close, and the
caller has to plan another path.
"""

import math
from typing import Final

import numpy as np

from radarsim.autonomy.navigation.control import (
    HEADING_GAIN,
    SpeedLimits,
    Twist,
)
from radarsim.autonomy.navigation.footprint_planning import SLACK, Footprint
from radarsim.geometry import Floats, Pose2, wrap_angle

LEAST_ROOM: Final = 0.01  # m of clearance between the footprint and seen points
TOUCHING: Final = 0.001  # m of clearance, below which the footprint touches a point
OFF: Final = 0.06  # m from the path, beyond which it is not followed
OFF_TURN: Final = 0.3  # rad off the path's heading, beyond which it is not followed
SLOW: Final = 0.08  # m/s at the smallest clearance
SPEED_GAIN: Final = 2.0  # 1/s: m/s for each m of clearance around the footprint
SLOW_TURN: Final = 0.5  # rad/s; keeps the corners of the footprint slow
AT_END: Final = 0.01  # m from the end of a straight motion, within which it is done
ALIGNED: Final = 0.03  # rad of heading error that counts as aligned
AHEAD: Final = 0.4  # s for which a motion is predicted, longer than a scan takes
LINE_GAIN: Final = 2.0  # rad of heading correction for each m off the line
_MOST: Final = 0.25  # rad; greatest heading correction


class FootprintFollower:
    """Steers a robot along a planned path of turns on the spot and straight lines."""

    def __init__(self, footprint: Footprint, path: Floats, limits: SpeedLimits) -> None:
        """Create a follower for a path; the robot is at the beginning of the path.

        Args:
            footprint: The footprint.
            path: (P, 3) m and rad, as ``plan_footprint`` returns it.
            limits: Highest speeds where there is enough clearance.
        """
        self._footprint = footprint
        self._path = path
        self._limits = limits
        self._next = 1  # index of the pose that the robot drives to

    @property
    def path(self) -> Floats:
        """The remaining path, (Q, 3), from the beginning of the current motion."""
        return self._path[self._next - 1 :]

    def is_blocked(self, points: Floats) -> bool:
        """Return whether the path leads too close to any of the points, (N, 2) m."""
        least = _least(self._footprint.clearance(points, self.path[0]))
        return bool((self._footprint.clearances(points, self.path) < least).any())

    def twist(self, pose: Pose2, points: Floats) -> Twist | None:
        """Return the motion of the robot until the next scan.

        Args:
            pose: Pose of the robot.
            points: Seen points, (N, 2) m, map frame.

        Returns:
            None if the path has ended, or cannot be followed from this pose.
        """
        here = np.array([pose.x, pose.y, pose.yaw])
        room = self._footprint.clearance(points, here)
        while self._next < len(self._path):
            begin, end = self._path[self._next - 1 : self._next + 1]
            twist = self._straight(here, begin, end, room)
            if not (end[:2] - begin[:2]).any():
                twist = self._turn(here, end)
            if twist is None:
                self._next += 1
                continue
            after = _moved_by(here, twist)
            is_near = self._footprint.clearance(points, after) < _least(room)
            return None if is_near or self._is_off(here, begin, end) else twist
        return None

    def _turn(self, here: Floats, end: Floats) -> Twist | None:
        """Return the turn to the heading of a pose; None once the robot has turned."""
        error = wrap_angle(end[2] - here[2])
        return None if abs(error) < ALIGNED else Twist(0.0, self._turn_rate(error))

    def _turn_rate(self, error: float) -> float:
        """Return the turn rate, rad/s, that corrects a heading error, rad."""
        most = min(self._limits.turn, SLOW_TURN)
        return max(-most, min(most, HEADING_GAIN * error))

    def _straight(
        self, here: Floats, begin: Floats, end: Floats, room: float
    ) -> Twist | None:
        """Return the robot's motion along a line; None at the end of the line."""
        c, s = math.cos(end[2]), math.sin(end[2])
        dx, dy = end[:2] - here[:2]
        sign = math.copysign(1.0, c * (end[0] - begin[0]) + s * (end[1] - begin[1]))
        left = sign * (c * dx + s * dy)
        if left < AT_END:
            return None
        off = s * dx - c * dy  # m that the robot is left of the line
        towards = -sign * max(-_MOST, min(_MOST, LINE_GAIN * off))
        error = wrap_angle(end[2] + towards - here[2])
        speed = min(self._limits.speed, max(SLOW, SPEED_GAIN * room), 0.05 + left)
        return Twist(sign * speed, self._turn_rate(error))

    def _is_off(self, here: Floats, begin: Floats, end: Floats) -> bool:
        """Return whether the robot is too far off the line or turn that it follows."""
        way, to = end[:2] - begin[:2], here[:2] - begin[:2]
        share = way @ to / (way @ way) if way.any() else 0.0
        off = math.dist(to, share * way)
        turned = abs(wrap_angle(end[2] - here[2])) if way.any() else 0.0
        return bool(off > OFF or turned > OFF_TURN)


def _least(room: float) -> float:
    """Return the least clearance allowed in a motion, given the clearance now, m."""
    # A motion may reduce a small clearance only slightly. Planning uses the same rule.
    return max(min(LEAST_ROOM, room - SLACK), TOUCHING)


def _moved_by(pose: Floats, twist: Twist) -> Floats:
    """Return the pose, (3,), that a motion reaches in ``AHEAD`` seconds."""
    turned = pose[2] + twist.turn * AHEAD
    middle, way = (pose[2] + turned) / 2, twist.speed * AHEAD
    step = np.array([way * math.cos(middle), way * math.sin(middle)])
    return np.array([*(pose[:2] + step), turned])
