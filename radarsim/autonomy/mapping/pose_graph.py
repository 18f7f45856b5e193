"""Pose graph: keyframe poses, and measured motions between pairs of these poses.

Theory of operation
===================
Each pose is connected with the previous pose by the motion in between, and, where a
loop closes, with an older pose by a scan match. Both are edges of the graph. An edge
contains the measured pose of one end in the frame of the other end, with its
information matrix. The poses with the least sum of squared errors are found by
Gauss-Newton with sparse matrices; the first pose is fixed.

Source: Grisetti, Kümmerle, Stachniss and Burgard, "A tutorial on graph-based SLAM"
(2010).

A trajectory has a pose graph of its keyframes; the poses in between move with them.

Between two keyframes the covariance of the motion grows by the uncertainty of the
motion source, and shrinks by the information of each scan: it grows along a corridor,
but not across it. When a loop closes, the error is distributed over the loop in these
proportions.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from radarsim.geometry import Floats, Pose2, wrap_angle

MAX_ITERATIONS: Final = 20
CONVERGED: Final = 1e-4  # m and rad; smaller steps end the iteration
# Errors of a scan's points are correlated, so this many points count as one.
POINTS_PER_ERROR: Final = 10.0
MOTION_SIGMA: Final = (0.002, 0.002, 0.0005)  # m, m and rad; least error of a motion
CLOSURE_SIGMA: Final = (0.01, 0.01, 0.003)  # least error of a closure
MAX_SQUARED_ERROR: Final = 25.0  # largest squared error of a true closure, in variances


class Edge(NamedTuple):
    """An edge of the graph: a measured motion between two poses.

    Attributes:
        start: Number of the pose in whose frame the motion is.
        end: Number of the other pose.
        motion: Pose of the end in the frame of the start.
        information: (3, 3) inverse of the covariance of x, y and yaw of the motion, in
            that frame, 1/m² and 1/rad².
    """

    start: int
    end: int
    motion: Pose2
    information: Floats


def optimize(poses: Floats, edges: list[Edge]) -> Floats:
    """Return the poses that minimize the sum of squared errors over all edges.

    Args:
        poses: (N, 3) initial x and y in m and yaw in rad; the first one is fixed.
        edges: Motions that connect each pose with the first one.

    Returns:
        (N, 3).
    """
    poses = poses.copy()
    information = np.array([edge.information for edge in edges])
    # Each edge adds a (6, 6) block: three unknowns of each of its two poses.
    unknowns = (3 * _ends(edges)[:, :, None] + np.arange(3)).reshape(-1, 6)
    rows = np.repeat(unknowns, 6, axis=1).ravel()
    columns = np.tile(unknowns, (1, 6)).ravel()
    size = 3 * len(poses)
    for _ in range(MAX_ITERATIONS):
        errors, by_start, by_end = _linearized(poses, edges)
        jacobians = np.concatenate([by_start, by_end], axis=2)  # (E, 3, 6)
        weighted = jacobians.transpose(0, 2, 1) @ information
        gradient = np.zeros(size)
        forces = (weighted @ errors[:, :, None])[:, :, 0]
        # ``gradient[unknowns] += forces`` would add
        # only one of the edges that share a pose.
        np.add.at(gradient, unknowns, forces)
        # ``csc_array`` sums duplicate entries, so edges that share a pose add up.
        normal = csc_array(
            ((weighted @ jacobians).ravel(), (rows, columns)), shape=(size, size)
        )
        steps = np.zeros(size)
        # The rows of the first pose are left out, so that the first pose stays fixed.
        steps[3:] = splu(normal[3:, 3:]).solve(-gradient[3:])
        poses += steps.reshape(-1, 3)
        if np.abs(steps).max(initial=0.0) < CONVERGED:
            break
    return poses


def squared_errors(poses: Floats, edges: list[Edge]) -> Floats:
    """Return each edge's squared error, divided by its variance (chi squared), (E,)."""
    errors = _linearized(poses, edges)[0]
    information = np.array([edge.information for edge in edges])
    squares: Floats = np.einsum("ei,eij,ej->e", errors, information, errors)
    return squares


def _linearized(poses: Floats, edges: list[Edge]) -> tuple[Floats, Floats, Floats]:
    """Return the edges' errors, (E, 3), and Jacobians by start and end, (E, 3, 3)."""
    measured = np.array([(e.motion.x, e.motion.y, e.motion.yaw) for e in edges])
    starts, ends = _ends(edges).T
    yaws = poses[starts, 2]
    c, s = np.cos(yaws), np.sin(yaws)
    dx, dy, turn = (poses[ends] - poses[starts]).T
    ahead, left = c * dx + s * dy, c * dy - s * dx
    errors = np.column_stack([ahead, left, turn]) - measured
    # Errors of angles are wrapped to [-pi, pi].
    errors[:, 2] = np.arctan2(np.sin(errors[:, 2]), np.cos(errors[:, 2]))
    by_end = np.zeros((len(edges), 3, 3))
    by_end[:, 0, 0], by_end[:, 0, 1] = c, s
    by_end[:, 1, 0], by_end[:, 1, 1] = -s, c
    by_end[:, 2, 2] = 1.0
    by_start = -by_end
    # If the start pose turns left, the end pose seems to turn right in its frame.
    by_start[:, 0, 2], by_start[:, 1, 2] = left, -ahead
    return errors, by_start, by_end


def _ends(edges: list[Edge]) -> NDArray[np.int64]:
    """Return the numbers of the start pose and the end pose of each edge, (E, 2)."""
    return np.array([(edge.start, edge.end) for edge in edges], np.int64)


class KeyframeGraph:
    """Motions between keyframes, and the trajectory poses that move with each keyframe.

    Attributes:
        edges: Motions between keyframes, including closures.
    """

    def __init__(self) -> None:
        self.edges: list[Edge] = []
        self._closures: list[int] = []  # indices of the edges of closures
        self._poses: list[Pose2] = []  # poses of all keyframes
        self._following: list[tuple[int, Pose2]] = []  # keyframe, and pose in its frame
        self._covariance: Floats = np.zeros((3, 3))

    def learn(self, sigma: Floats, information: Floats) -> None:
        """Add one step to the covariance of the motion since the last keyframe.

        Args:
            sigma: (3,) standard deviations of the next step, m, m and rad.
            information: (3, 3) information matrix of the next pose from the scan.
        """
        moved = np.linalg.inv(self._covariance + np.diag(np.square(sigma)))
        # The motion source and the scan both measure this motion,
        # so their information adds up. In a corridor, the scan
        # does not reduce the variance along the corridor.
        self._covariance = _inverse(moved + information / POINTS_PER_ERROR)

    def add(self, pose: Pose2) -> None:
        """Add a keyframe, with the motion that led to its pose."""
        if self._poses:
            last = self._poses[-1]
            information = _information(self._covariance, last.yaw, MOTION_SIGMA)
            number = len(self._poses)
            motion = pose.relative_to(last)
            self.edges.append(Edge(number - 1, number, motion, information))
        self._poses.append(pose)
        # The error of this motion is stored in its edge,
        # and the next motion starts without error.
        self._covariance = np.zeros((3, 3))

    def follow(self, pose: Pose2) -> None:
        """Add a pose of the trajectory that moves with the last keyframe."""
        if self._poses:
            pose = pose.relative_to(self._poses[-1])
        self._following.append((len(self._poses) - 1, pose))

    def close(self, start: int, pose: Pose2, information: Floats) -> list[Pose2] | None:
        """Close a loop from an old keyframe to the last one, and optimize all poses.

        Args:
            start: Number of an old keyframe.
            pose: Pose of the last keyframe by the map around the old one.
            information: (3, 3) information matrix of that pose on the map's axes.

        Returns:
            The optimized poses of all keyframes; None if the closure contradicts the
            motions or earlier closures, and is dropped.
        """
        old = self._poses[start]
        # Points at a single position give no heading, so 1/m² and 1/rad² are added to
        # make the matrix invertible.
        covariance = _inverse(information / POINTS_PER_ERROR + np.eye(3))
        weight = _information(covariance, old.yaw, CLOSURE_SIGMA)
        edge = Edge(start, len(self._poses) - 1, pose.relative_to(old), weight)
        edges, closures = [*self.edges, edge], [*self._closures, len(self.edges)]
        rows = np.array([(each.x, each.y, each.yaw) for each in self._poses])
        rows = optimize(rows, edges)
        # A wrong closure bends the whole map, so a doubtful closure is rejected: its
        # large error shows that it contradicts the motions or an earlier closure.
        if squared_errors(rows, edges)[closures].max() > MAX_SQUARED_ERROR:
            return None
        self.edges, self._closures = edges, closures
        self._poses = [Pose2(x, y, wrap_angle(yaw)) for x, y, yaw in rows.tolist()]
        return self._poses

    def move(self, first: int, frame: Pose2) -> list[Pose2]:
        """Move all keyframes from a given number on; used before any loop closure.

        Args:
            first: Number of the first keyframe that moves.
            frame: Pose that the moved part of the map gets, map frame.

        Returns:
            The poses of all keyframes.
        """
        moved = [frame.compose(pose) for pose in self._poses[first:]]
        self._poses = [*self._poses[:first], *moved]
        # Only this motion changes: from the last fixed keyframe to the first moved one.
        motion = self._poses[first].relative_to(self._poses[first - 1])
        self.edges[first - 1] = self.edges[first - 1]._replace(motion=motion)
        return self._poses

    def trajectory(self) -> list[Pose2]:
        """Return the poses of the trajectory, which have moved with their keyframes."""
        return [
            # Poses before the first keyframe are not moved.
            pose if number < 0 else self._poses[number].compose(pose)
            for number, pose in self._following
        ]


def _information(
    covariance: Floats, yaw: float, least: tuple[float, float, float]
) -> Floats:
    """Return the information matrix of a motion in the frame of its start pose.

    Args:
        covariance: (3, 3) covariance of x, y and yaw of its end, on the map's axes.
        yaw: Heading of its start, rad.
        least: Standard deviations to add, m, m and rad.
    """
    c, s = np.cos(yaw), np.sin(yaw)
    axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    # Errors of a scan's points are correlated, so the covariance has a lower limit.
    own = axes @ covariance @ axes.T + np.diag(np.square(least))
    information = _inverse(own)
    # Rounding makes the matrix slightly asymmetric.
    return (information + information.T) / 2


def _inverse(matrix: Floats) -> Floats:
    inverse: Floats = np.linalg.inv(matrix).astype(np.float64, copy=False)
    return inverse
