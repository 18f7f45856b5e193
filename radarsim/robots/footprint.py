"""The distance between a robot's rectangle and line segments, and the direction out.

Theory of operation
===================
In the frame of the rectangle three axes can separate a segment from it: x, y and the
segment's own normal (separating axis theorem for two convex shapes). On each axis the
distance between the two projections is a lower bound of the distance between the
shapes, and the largest of the three is negative only if they overlap; then it is the
smallest displacement that separates them, along that axis. One number so serves as
collision test, as clearance and as penetration depth.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.geometry import Floats, Pose2

MARGIN: Final = 1e-6  # m; a smaller gap counts as contact; far above rounding errors
NO_SEGMENTS: Floats = np.zeros((0, 2, 2))
NO_SEGMENTS.setflags(write=False)


Lines: TypeAlias = NDArray[np.void]  # structures of the type LINE
LINE: Final = engine.rows["LineSegment"]
_CONTACT: Final = engine.rows["Contact"]


def line_table(segments: Floats) -> Lines:
    """Return segments, (S, 2, 2), as lines, (S,), ranked as they come."""
    lines = np.zeros(len(segments), LINE)
    engine.fill_lines(np.ascontiguousarray(segments, np.float64), lines)
    return lines


@dataclass(frozen=True, slots=True)
class Contact:
    """The segment closest to a footprint, or deepest in it.

    Attributes:
        gap: Lower bound of the distance to the segment, m; negative, minus the
            penetration depth, if the segment reaches into the footprint.
        away_x: x of the unit vector along which the gap grows, map frame.
        away_y: y of that vector.
    """

    gap: float
    away_x: float = 0.0
    away_y: float = 0.0


@dataclass(frozen=True)
class Footprint:
    """The rectangle that a robot occupies, centred on its origin.

    Attributes:
        length: Extent along x of the robot, m.
        width: Extent along y of the robot, m.
    """

    length: float
    width: float

    @cached_property
    def radius(self) -> float:
        """Distance from the centre to a corner, m."""
        return math.hypot(self.length, self.width) / 2

    @cached_property
    def _sides(self) -> Floats:
        x, y = self.length / 2, self.width / 2
        corners = np.array([[x, y], [-x, y], [-x, -y], [x, -y]])
        return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)

    def outline(self, pose: Pose2) -> Floats:
        """Return the four sides as segments, (4, 2, 2) m, map frame."""
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        sides: Floats = self._sides @ np.array([[c, s], [-s, c]])
        centre: Floats = np.array([pose.x, pose.y])
        return sides + centre

    def covers(self, pose: Pose2, x: float, y: float) -> bool:
        """Return whether a point of the map lies inside."""
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        dx, dy = x - pose.x, y - pose.y
        along, across = c * dx + s * dy, c * dy - s * dx
        return abs(along) <= self.length / 2 and abs(across) <= self.width / 2

    def contact(self, pose: Pose2, segments: Floats) -> Contact:
        """Find the segment that is closest, or deepest inside.

        Args:
            pose: Pose of the robot.
            segments: (S, 2, 2) m, map frame, none of them of length 0.

        Returns:
            The contact with the smallest gap; of equal ones, that of the first segment.
        """
        poses = np.array([[pose.x, pose.y, pose.yaw]], np.float64)
        contacts = self._contacts(poses, line_table(segments))
        return Contact(*contacts[0].tolist())

    def gaps(self, poses: Floats, lines: Lines) -> Floats:
        """Return the gap to lines at each pose, (P, 3) m, rad, as of ``Contact``."""
        gaps: Floats = self._contacts(poses, lines)["gap"]
        return gaps

    def _contacts(self, poses: Floats, lines: Lines) -> NDArray[np.void]:
        contacts = np.zeros(len(poses), _CONTACT)
        half_size = self.length / 2, self.width / 2
        engine.find_contacts(lines, poses, *half_size, contacts)
        return contacts
