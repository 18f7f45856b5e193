"""The pose graph of a trajectory's keyframes, and the poses in between.

Between two keyframes the variance of the motion grows by what the motion source is
unsure of, and shrinks by what each scan says: along a corridor it grows, across one it
does not. When a loop closes, the error is spread over the loop in these proportions.
"""

from typing import Final

import numpy as np

from radarsim.geometry import Floats, Pose2, wrap_angle
from radarsim.mapping.pose_graph import Edge, optimize, squared_errors

# Points of a scan err together: they hold far less information than if each were alone.
POINTS_PER_ERROR: Final = 10.0
MOTION_SIGMA: Final = (0.002, 0.002, 0.0005)  # m, m and rad; least error of a motion
CLOSURE_SIGMA: Final = (0.01, 0.01, 0.003)  # of a closure, which compares two maps
MAX_SQUARED_ERROR: Final = 25.0  # of a closure, variances, beyond which it is false


class KeyframeGraph:
    """Motions between keyframes, and the poses that follow each of them.

    Attributes:
        edges: Motions between keyframes, closures included.
    """

    def __init__(self) -> None:
        self.edges: list[Edge] = []
        self._closures: list[int] = []  # numbers of edges
        self._poses: list[Pose2] = []  # of keyframes, when they were added
        self._following: list[tuple[int, Pose2]] = []  # keyframe, and pose in its frame
        self._covariance: Floats = np.zeros((3, 3))

    def learn(self, sigma: Floats, information: Floats) -> None:
        """Add up what is known of the motion since the last keyframe.

        Args:
            sigma: (3,) standard deviations of the next step, m, m and rad.
            information: (3, 3) information matrix of the next pose by a scan's points.
        """
        moved = np.linalg.inv(self._covariance + np.diag(np.square(sigma)))
        self._covariance = _inverse(moved + information / POINTS_PER_ERROR)

    def add(self, pose: Pose2) -> None:
        """Add a keyframe."""
        if self._poses:
            last = self._poses[-1]
            information = _information(self._covariance, last.yaw, MOTION_SIGMA)
            number = len(self._poses)
            motion = pose.relative_to(last)
            self.edges.append(Edge(number - 1, number, motion, information))
        self._poses.append(pose)
        self._covariance = np.zeros((3, 3))

    def follow(self, pose: Pose2) -> None:
        """Add a pose of the trajectory, which belongs to the last keyframe."""
        if self._poses:
            pose = pose.relative_to(self._poses[-1])
        self._following.append((len(self._poses) - 1, pose))

    def close(self, start: int, pose: Pose2, information: Floats) -> list[Pose2] | None:
        """Close a loop.

        Args:
            start: Number of an old keyframe.
            pose: Where the last keyframe is by the map around the old one.
            information: (3, 3) information matrix of that pose, on the map's axes.

        Returns:
            The poses of all keyframes by all motions; None if the closure contradicts
            these, or closures before, and is left out.
        """
        old = self._poses[start]
        # 1/m² and 1/rad² more: points that are all in one place say nothing of a turn.
        covariance = _inverse(information / POINTS_PER_ERROR + np.eye(3))
        weight = _information(covariance, old.yaw, CLOSURE_SIGMA)
        edge = Edge(start, len(self._poses) - 1, pose.relative_to(old), weight)
        edges, closures = [*self.edges, edge], [*self._closures, len(self.edges)]
        rows = np.array([(each.x, each.y, each.yaw) for each in self._poses])
        rows = optimize(rows, edges)
        if squared_errors(rows, edges)[closures].max() > MAX_SQUARED_ERROR:
            return None
        self.edges, self._closures = edges, closures
        self._poses = [Pose2(x, y, wrap_angle(yaw)) for x, y, yaw in rows.tolist()]
        return self._poses

    def move(self, first: int, frame: Pose2) -> list[Pose2]:
        """Move all keyframes from a number on, as long as no loop is closed.

        Args:
            first: Number of the first keyframe that moves.
            frame: Pose of the map that they are on now, map frame.

        Returns:
            The poses of all keyframes.
        """
        moved = [frame.compose(pose) for pose in self._poses[first:]]
        self._poses = [*self._poses[:first], *moved]
        motion = self._poses[first].relative_to(self._poses[first - 1])
        self.edges[first - 1] = self.edges[first - 1]._replace(motion=motion)
        return self._poses

    def trajectory(self) -> list[Pose2]:
        """Return the poses of the trajectory, as they follow the keyframes."""
        return [
            pose if number < 0 else self._poses[number].compose(pose)
            for number, pose in self._following
        ]


def _information(
    covariance: Floats, yaw: float, least: tuple[float, float, float]
) -> Floats:
    """Return the information matrix of a motion.

    Args:
        covariance: (3, 3) of x, y and yaw of its end, on the map's axes.
        yaw: Heading of its start, rad, in whose frame the motion is.
        least: Standard deviations that are added, m, m and rad.
    """
    c, s = np.cos(yaw), np.sin(yaw)
    axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    own = axes @ covariance @ axes.T + np.diag(np.square(least))
    information = _inverse(own)
    return (information + information.T) / 2


def _inverse(matrix: Floats) -> Floats:
    inverse: Floats = np.linalg.inv(matrix).astype(np.float64, copy=False)
    return inverse
