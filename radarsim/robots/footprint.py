"""The footprint of a robot, and its signed distance to line segments.

Theory of operation
===================
In the frame of the rectangle, three axes can separate it from a segment: x, y and the
segment's normal (separating axis theorem for two convex shapes). On each axis, the
distance between the two projections is a lower bound of the distance between the
shapes. The largest of the three distances is negative only if the shapes overlap; then
its absolute value is the smallest displacement that separates them, along that axis. So
one number serves as collision test, clearance and penetration depth.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.geometry import Floats, Pose2

MARGIN: Final = 1e-6  # m; smaller gaps count as contact, far above rounding errors
NO_SEGMENTS: Floats = np.zeros((0, 2, 2))
NO_SEGMENTS.setflags(write=False)


Lines: TypeAlias = NDArray[np.void]  # structures of the dtype LINE
LINE: Final = engine.rows["LineSegment"]
_CONTACT: Final = engine.rows["Contact"]


def line_table(segments: Floats) -> Lines:
    """Convert segments, (S, 2, 2) m, to lines, (S,); ranks are segment indices."""
    first, second = segments[:, 0], segments[:, 1]
    ranks = np.arange(len(segments))
    columns = (first + second) / 2, (second - first) / 2, ranks
    return np.column_stack(columns).view(LINE)[:, 0]


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
        """Return whether a point in the map frame, m, is inside the rectangle."""
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        dx, dy = x - pose.x, y - pose.y
        along, across = c * dx + s * dy, c * dy - s * dx
        return abs(along) <= self.length / 2 and abs(across) <= self.width / 2

    def gaps(self, poses: Floats, lines: Lines) -> Floats:
        """Return the gap to the closest line at each pose, (P,) m; see ``contacts``."""
        gaps: Floats = self.contacts(poses, lines)["gap"]
        return gaps

    def contacts(self, poses: Floats, lines: Lines) -> NDArray[np.void]:
        """Return the contact with the closest, or deepest, line at each pose.

        Args:
            poses: (P, 3) m, rad, map frame.
            lines: Lines with lengths above 0.

        Returns:
            (P,) of type ``Contact`` in C++: gap, m, negative by the penetration depth,
            and the direction in which the gap grows. If gaps are equal, the contact of
            the first line is returned.
        """
        contacts = np.zeros(len(poses), _CONTACT)
        half_size = self.length / 2, self.width / 2
        engine.find_contacts(lines, poses, *half_size, contacts)
        return contacts
