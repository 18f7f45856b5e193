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
from typing import Final

import numpy as np

from radarsim.geometry import Floats, Pose2
from radarsim.jit import Int, njit_cached, njit_inline

MARGIN: Final = 1e-6  # m; a smaller gap counts as contact; far above rounding errors
NO_SEGMENTS: Floats = np.zeros((0, 2, 2))
NO_SEGMENTS.setflags(write=False)


# Columns of a table of lines: middle, vector from the middle to the second end, m, map
# frame; of lines at the same distance the one of lowest rank counts.
MIDDLE_X, MIDDLE_Y, HALF_X, HALF_Y, RANK = range(5)


def line_table(segments: Floats) -> Floats:
    """Return segments, (S, 2, 2), as a table of lines, (S, 5), ranked as they come."""
    first, second = segments[:, 0], segments[:, 1]
    ranks = np.arange(len(segments))
    return np.column_stack([(first + second) / 2, (second - first) / 2, ranks])


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
        lines = line_table(segments)
        place = (float(pose.x), float(pose.y), float(pose.yaw))
        half_size = (self.length / 2, self.width / 2)
        return Contact(*find_contact(lines, len(segments), place, half_size))


@njit_cached
def find_contact(
    lines: Floats,
    count: Int,
    pose: tuple[float, float, float],
    half_size: tuple[float, float],
) -> tuple[float, float, float]:
    """Find the contact of a rectangle with the first ``count`` of some lines.

    Args:
        lines: (L, 5) table of lines.
        count: How many of them there are.
        pose: x, y and yaw of the rectangle, m, rad, map frame.
        half_size: Half its length and half its width, m.

    Returns:
        The gap, m, and x and y of the unit vector away from the line.
    """
    x, y, yaw = pose
    length, width = half_size
    c, s = math.cos(yaw), math.sin(yaw)
    gap, rank, away_x, away_y = np.inf, 0.0, 0.0, 0.0
    for i in range(count):
        dx, dy = lines[i, MIDDLE_X] - x, lines[i, MIDDLE_Y] - y
        middle_x, middle_y = dx * c + dy * s, dy * c - dx * s
        dx, dy = lines[i, HALF_X], lines[i, HALF_Y]
        half_x, half_y = dx * c + dy * s, dy * c - dx * s
        along_x = abs(middle_x) - abs(half_x) - length
        along_y = abs(middle_y) - abs(half_y) - width
        if max(along_x, along_y) > gap:
            # Spares the normal and its square root, as the gap is the largest of the
            # three: row j of the benchmarks.
            continue
        across = abs(middle_x * half_y - middle_y * half_x)
        across -= length * abs(half_y) + width * abs(half_x)
        across /= math.hypot(half_x, half_y)
        found = max(along_x, along_y, across)
        if found < gap or (found == gap and lines[i, RANK] < rank):
            gap, rank = found, lines[i, RANK]
            axis_x, axis_y = 1.0, 0.0
            if along_x < found and along_y == found:
                axis_x, axis_y = 0.0, 1.0
            elif along_x < found:
                axis_x, axis_y = _normal(half_x, half_y)
            if axis_x * middle_x + axis_y * middle_y > 0:
                axis_x, axis_y = -axis_x, -axis_y
            away_x, away_y = c * axis_x - s * axis_y, s * axis_x + c * axis_y
    return gap, away_x, away_y


@njit_inline
def _normal(x: float, y: float) -> tuple[float, float]:
    """Return the unit vector to the right of a vector."""
    length = math.hypot(x, y)
    return y / length, -x / length
