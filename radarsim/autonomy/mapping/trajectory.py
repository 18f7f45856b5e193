"""Trajectories of robots, and the errors of an estimated trajectory."""

import math

import numpy as np

from radarsim.geometry import Floats, Pose2


class Trajectory:
    """A trajectory: poses of a robot with their times.

    Attributes:
        times: Times in s, in the order in which they were added.
        poses: Poses of the robot, map frame.
    """

    def __init__(self) -> None:
        self.times: list[float] = []
        self.poses: list[Pose2] = []

    def __len__(self) -> int:
        """Return the number of poses."""
        return len(self.poses)

    def add(self, time: float, pose: Pose2) -> None:
        """Add a pose with its time."""
        self.times.append(time)
        self.poses.append(pose)

    def rows(self) -> Floats:
        """Return the poses as (N, 3): x and y in m, yaw in rad."""
        rows = [(pose.x, pose.y, pose.yaw) for pose in self.poses]
        return np.array(rows, np.float64).reshape(-1, 3)


def trajectory_errors(
    estimate: Trajectory, truth: Trajectory, *, rpe_over: float = 1.0
) -> dict[str, float]:
    """Compare an estimated trajectory with the ground truth.

    The trajectories are not aligned first, since both begin at a known pose. The ground
    truth is interpolated at the times of the estimate; poses outside its time range are
    ignored.

    Returns:
        poses: Number of compared poses.
        length: Length of the true path, m.
        ate: Absolute trajectory error, root mean square, m.
        ate_max: Largest absolute position error, m.
        yaw: Absolute heading error, root mean square, rad.
        yaw_max: Largest absolute heading error, rad.
        rpe: Relative pose error of the motion over ``rpe_over`` metres of the path,
            root mean square, m; nan if the path is shorter.
        rpe_yaw: Relative heading error over the same distance, root mean square, rad.
        rpe_over: Path length of the compared motions, m.

    Raises:
        ValueError: If there is no pose to compare.
    """
    times = np.array(estimate.times)
    known = np.array(truth.times)
    inside = np.zeros(len(times), np.bool_)
    if len(known):
        inside = (times >= known.min()) & (times <= known.max())
    if not inside.any():
        raise ValueError("estimate and ground truth do not overlap in time")
    poses, true = estimate.rows()[inside], _interpolated(truth, times[inside])
    off = np.hypot(poses[:, 0] - true[:, 0], poses[:, 1] - true[:, 1])
    turned = _wrapped(poses[:, 2] - true[:, 2])
    steps = np.hypot(*np.diff(true[:, :2], axis=0).T)
    path = np.concatenate([[0.0], np.cumsum(steps)])
    # For each pose, find the first pose that is ``rpe_over`` farther along the path.
    ends = np.searchsorted(path, path + rpe_over)
    # The last poses of the path have no pose at that distance, so they are left out.
    starts = np.flatnonzero(ends < len(path))
    rpe = rpe_yaw = math.nan
    if len(starts):
        ends = ends[starts]
        motions = _motions(poses[starts], poses[ends])
        dx, dy, turn = (motions - _motions(true[starts], true[ends])).T
        rpe = _root_mean_square(np.hypot(dx, dy))
        rpe_yaw = _root_mean_square(_wrapped(turn))
    return {
        "poses": len(poses),
        "length": float(path[-1]),
        "ate": _root_mean_square(off),
        "ate_max": float(off.max()),
        "yaw": _root_mean_square(turned),
        "yaw_max": float(np.abs(turned).max()),
        "rpe": rpe,
        "rpe_yaw": rpe_yaw,
        "rpe_over": rpe_over,
    }


def tum_text(trajectory: Trajectory) -> str:
    """Return a trajectory as text in the TUM format.

    One line per pose: time, x, y, z and the quaternion x, y, z, w.
    """
    lines = ["# radarsim map: timestamp tx ty tz qx qy qz qw\n"]
    for time, pose in zip(trajectory.times, trajectory.poses, strict=True):
        half = pose.yaw / 2
        turn = f"{math.sin(half):.6f} {math.cos(half):.6f}"
        lines.append(f"{time:.6f} {pose.x:.6f} {pose.y:.6f} 0 0 0 {turn}\n")
    return "".join(lines)


def _interpolated(truth: Trajectory, times: Floats) -> Floats:
    """Return the true poses, interpolated at the given times, (N, 3)."""
    rows, known = truth.rows(), np.array(truth.times)
    order = np.argsort(known, kind="stable")
    rows, known = rows[order], known[order]
    rows[:, 2] = np.unwrap(rows[:, 2])  # avoids a turn back between pi and -pi
    columns = [np.interp(times, known, column) for column in rows.T]
    return np.column_stack(columns)


def _motions(starts: Floats, ends: Floats) -> Floats:
    """Return the motions from start poses to end poses, in the start frames, (N, 3)."""
    c, s = np.cos(starts[:, 2]), np.sin(starts[:, 2])
    dx, dy, turn = (ends - starts).T
    return np.column_stack([c * dx + s * dy, c * dy - s * dx, turn])


def _wrapped(angles: Floats) -> Floats:
    return np.arctan2(np.sin(angles), np.cos(angles))


def _root_mean_square(values: Floats) -> float:
    return math.sqrt(float(np.square(values).mean()))
