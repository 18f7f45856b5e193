"""Pose graph: poses, and measured motions between pairs of them.

Theory of operation
===================
Each pose is tied to the one before by the motion in between, and, where a loop is
closed, to an older one by what the scans say. Both are edges: a measured pose of one
end in the frame of the other, with its information matrix. The poses with the least sum
of squared errors are found by Gauss-Newton with sparse matrices; the first pose is
fixed.

Source: Grisetti, Kümmerle, Stachniss and Burgard, "A tutorial on graph-based SLAM"
(2010).

A trajectory has a pose graph of its keyframes; the poses in between move with them.

Between two keyframes the variance of the motion grows by what the motion source is
unsure of, and shrinks by what each scan says: along a corridor it grows, across one it
does not. When a loop closes, the error is spread over the loop in these proportions.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from radarsim.geometry import Floats, Pose2, wrap_angle

MAX_ITERATIONS: Final = 20
CONVERGED: Final = 1e-4  # m and rad
# Points of a scan err together: they hold far less information than if each were alone.
POINTS_PER_ERROR: Final = 10.0
MOTION_SIGMA: Final = (0.002, 0.002, 0.0005)  # m, m and rad; least error of a motion
CLOSURE_SIGMA: Final = (0.01, 0.01, 0.003)  # of a closure, which compares two maps
MAX_SQUARED_ERROR: Final = 25.0  # of a closure, variances, beyond which it is false


class Edge(NamedTuple):
    """A measured motion.

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
    """Return the poses that fit all edges best.

    Args:
        poses: (N, 3) x and y in m and yaw in rad to begin at; the first one stays.
        edges: Motions, which connect each pose with the first one.

    Returns:
        (N, 3).
    """
    poses = poses.copy()
    information = np.array([edge.information for edge in edges])
    # each edge adds a block of (6, 6), of the unknowns of both of its ends
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
        # Indexing would add only one of the edges that share a pose.
        np.add.at(gradient, unknowns, forces)
        # The matrix sums entries of one place: edges that share a pose have such.
        normal = csc_array(
            ((weighted @ jacobians).ravel(), (rows, columns)), shape=(size, size)
        )
        steps = np.zeros(size)
        # without the rows of the first pose, which would leave the map free to move
        steps[3:] = splu(normal[3:, 3:]).solve(-gradient[3:])
        poses += steps.reshape(-1, 3)
        if np.abs(steps).max(initial=0.0) < CONVERGED:
            break
    return poses


def squared_errors(poses: Floats, edges: list[Edge]) -> Floats:
    """Return the error of each edge, (E,), in variances: chi squared."""
    errors = _linearized(poses, edges)[0]
    information = np.array([edge.information for edge in edges])
    squares: Floats = np.einsum("ei,eij,ej->e", errors, information, errors)
    return squares


def _linearized(poses: Floats, edges: list[Edge]) -> tuple[Floats, Floats, Floats]:
    """Return errors, (E, 3), and their Jacobians by start and by end, (E, 3, 3)."""
    measured = np.array([(e.motion.x, e.motion.y, e.motion.yaw) for e in edges])
    starts, ends = _ends(edges).T
    yaws = poses[starts, 2]
    c, s = np.cos(yaws), np.sin(yaws)
    dx, dy, turn = (poses[ends] - poses[starts]).T
    ahead, left = c * dx + s * dy, c * dy - s * dx
    errors = np.column_stack([ahead, left, turn]) - measured
    # turns are equal modulo whole ones
    errors[:, 2] = np.arctan2(np.sin(errors[:, 2]), np.cos(errors[:, 2]))
    by_end = np.zeros((len(edges), 3, 3))
    by_end[:, 0, 0], by_end[:, 0, 1] = c, s
    by_end[:, 1, 0], by_end[:, 1, 1] = -s, c
    by_end[:, 2, 2] = 1.0
    by_start = -by_end
    # A turn of the start moves the end around it, the other way.
    by_start[:, 0, 2], by_start[:, 1, 2] = left, -ahead
    return errors, by_start, by_end


def _ends(edges: list[Edge]) -> NDArray[np.int64]:
    """Return the numbers of the poses at both ends of each edge, (E, 2)."""
    return np.array([(edge.start, edge.end) for edge in edges], np.int64)


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
        """Add the information on the next step to that since the last keyframe.

        Args:
            sigma: (3,) standard deviations of the next step, m, m and rad.
            information: (3, 3) information matrix of the next pose by a scan's points.
        """
        moved = np.linalg.inv(self._covariance + np.diag(np.square(sigma)))
        # Information adds up where both tell the same motion, as the scan's points and
        # the motion source do: a corridor's points leave the variance along it.
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
        # The next motion begins here, and the error of this one is in its edge.
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
        # A wrong closure is worse than none, as it bends all of the map. It contradicts
        # the motions, or a closure before that was right.
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
        # All other motions are between keyframes that move together, or not at all.
        motion = self._poses[first].relative_to(self._poses[first - 1])
        self.edges[first - 1] = self.edges[first - 1]._replace(motion=motion)
        return self._poses

    def trajectory(self) -> list[Pose2]:
        """Return the poses of the trajectory, as they follow the keyframes."""
        return [
            # Poses before the first keyframe follow none, and stay.
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
    # All points of a scan may err together, so a motion is never as sure as they agree.
    own = axes @ covariance @ axes.T + np.diag(np.square(least))
    information = _inverse(own)
    # Rounding leaves the two halves a little different.
    return (information + information.T) / 2


def _inverse(matrix: Floats) -> Floats:
    inverse: Floats = np.linalg.inv(matrix).astype(np.float64, copy=False)
    return inverse
