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
"""

from typing import Final, NamedTuple

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from radarsim.geometry import Floats, Pose2

MAX_ITERATIONS: Final = 20
CONVERGED: Final = 1e-4  # m and rad


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
    starts = np.array([edge.start for edge in edges])
    ends = np.array([edge.end for edge in edges])
    information = np.array([edge.information for edge in edges])
    rows, columns = _places(starts, ends)
    size = 3 * len(poses)
    for _ in range(MAX_ITERATIONS):
        errors, by_start, by_end = _linearized(poses, edges, starts, ends)
        jacobians = np.concatenate([by_start, by_end], axis=2)  # (E, 3, 6)
        weighted = jacobians.transpose(0, 2, 1) @ information
        gradient = np.zeros(size)
        forces = (weighted @ errors[:, :, None])[:, :, 0]
        np.add.at(
            gradient, np.concatenate([_rows(starts), _rows(ends)], axis=1), forces
        )
        normal = csc_array(
            ((weighted @ jacobians).ravel(), (rows, columns)), shape=(size, size)
        )
        steps = np.zeros(size)
        steps[3:] = splu(normal[3:, 3:]).solve(-gradient[3:])
        poses += steps.reshape(-1, 3)
        if np.abs(steps).max(initial=0.0) < CONVERGED:
            break
    return poses


def squared_errors(poses: Floats, edges: list[Edge]) -> Floats:
    """Return the error of each edge, (E,), in variances: chi squared."""
    starts = np.array([edge.start for edge in edges])
    ends = np.array([edge.end for edge in edges])
    errors = _linearized(poses, edges, starts, ends)[0]
    information = np.array([edge.information for edge in edges])
    squares: Floats = np.einsum("ei,eij,ej->e", errors, information, errors)
    return squares


def _linearized(
    poses: Floats, edges: list[Edge], starts: Floats, ends: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return errors, (E, 3), and their Jacobians by start and by end, (E, 3, 3)."""
    measured = np.array([(e.motion.x, e.motion.y, e.motion.yaw) for e in edges])
    yaws = poses[starts, 2]
    c, s = np.cos(yaws), np.sin(yaws)
    dx, dy, turn = (poses[ends] - poses[starts]).T
    ahead, left = c * dx + s * dy, c * dy - s * dx
    errors = np.column_stack([ahead, left, turn]) - measured
    errors[:, 2] = np.arctan2(np.sin(errors[:, 2]), np.cos(errors[:, 2]))
    by_end = np.zeros((len(edges), 3, 3))
    by_end[:, 0, 0], by_end[:, 0, 1] = c, s
    by_end[:, 1, 0], by_end[:, 1, 1] = -s, c
    by_end[:, 2, 2] = 1.0
    by_start = -by_end
    by_start[:, 0, 2], by_start[:, 1, 2] = left, -ahead
    return errors, by_start, by_end


def _rows(numbers: Floats) -> Floats:
    """Return the three unknowns of each pose, (E, 3)."""
    return 3 * numbers[:, None] + np.arange(3)


def _places(starts: Floats, ends: Floats) -> tuple[Floats, Floats]:
    """Return row and column of each number of the edges' blocks of (6, 6)."""
    unknowns = np.concatenate([_rows(starts), _rows(ends)], axis=1)
    rows = np.repeat(unknowns, 6, axis=1)
    columns = np.tile(unknowns, (1, 6))
    return rows.ravel(), columns.ravel()
