"""Where a robot was when, and how far that is from the truth."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from radarsim.geometry import Floats, Pose2


class Trajectory:
    """Poses by time.

    Attributes:
        times: s, in the order in which they were added.
        poses: Of the robot, map frame.
    """

    def __init__(self) -> None:
        self.times: list[float] = []
        self.poses: list[Pose2] = []

    def __len__(self) -> int:
        """Give the number of poses."""
        return len(self.poses)

    def __iter__(self) -> Iterator[tuple[float, Pose2]]:
        """Give times with poses."""
        return zip(self.times, self.poses, strict=True)

    def add(self, time: float, pose: Pose2) -> None:
        """Add a pose."""
        self.times.append(time)
        self.poses.append(pose)

    def rows(self) -> Floats:
        """Give the poses as (N, 3): x and y in m, yaw in rad."""
        rows = [(pose.x, pose.y, pose.yaw) for pose in self.poses]
        return np.array(rows, np.float64).reshape(-1, 3)


@dataclass(frozen=True, slots=True)
class TrajectoryErrors:
    """How far an estimated trajectory is from the true one.

    Nothing is aligned first: both begin at a pose that is known.

    Attributes:
        poses: How many were compared.
        length: Of the true way, m.
        ate: Absolute error of the place, root of the mean square, m.
        ate_max: The largest one, m.
        yaw: Absolute error of the heading, root of the mean square, rad.
        yaw_max: The largest one, rad.
        rpe: Error of the motion over ``rpe_over`` metres of the way, root of the mean
            square, m; nan if the way is shorter.
        rpe_yaw: The same of the turn, rad.
        rpe_over: m.
    """

    poses: int
    length: float
    ate: float
    ate_max: float
    yaw: float
    yaw_max: float
    rpe: float
    rpe_yaw: float
    rpe_over: float


def trajectory_errors(
    estimate: Trajectory, truth: Trajectory, *, rpe_over: float = 1.0
) -> TrajectoryErrors:
    """Compare a trajectory with the true one.

    Poses between those of the truth are compared with what lies between these; poses
    before the first and after the last one are left out.

    Raises:
        ValueError: If there is no pose to compare.
    """
    times = np.array(estimate.times)
    known = np.array(truth.times)
    inside = np.zeros(len(times), np.bool_)
    if len(known):
        inside = (times >= known.min()) & (times <= known.max())
    if not inside.any():
        raise ValueError("no pose of the estimate is at a time of the truth")
    guess, true = estimate.rows()[inside], _between(truth, times[inside])
    off = np.hypot(guess[:, 0] - true[:, 0], guess[:, 1] - true[:, 1])
    turned = _wrapped(guess[:, 2] - true[:, 2])
    steps = np.hypot(*np.diff(true[:, :2], axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    rpe, rpe_yaw = _relative(guess, true, way, rpe_over)
    return TrajectoryErrors(
        poses=len(guess),
        length=float(way[-1]),
        ate=_root_mean_square(off),
        ate_max=float(off.max()),
        yaw=_root_mean_square(turned),
        yaw_max=float(np.abs(turned).max()),
        rpe=rpe,
        rpe_yaw=rpe_yaw,
        rpe_over=rpe_over,
    )


def tum_text(trajectory: Trajectory) -> str:
    """Write a trajectory as TUM's tools read it.

    A line for each pose: time, x, y, z and the quaternion x, y, z, w.
    """
    lines = ["# radarsim map: timestamp tx ty tz qx qy qz qw\n"]
    for time, pose in trajectory:
        half = pose.yaw / 2
        turn = f"{math.sin(half):.6f} {math.cos(half):.6f}"
        lines.append(f"{time:.6f} {pose.x:.6f} {pose.y:.6f} 0 0 0 {turn}\n")
    return "".join(lines)


def _between(truth: Trajectory, times: Floats) -> Floats:
    """Give the true poses at some times, (N, 3)."""
    rows, known = truth.rows(), np.array(truth.times)
    order = np.argsort(known, kind="stable")
    rows, known = rows[order], known[order]
    rows[:, 2] = np.unwrap(rows[:, 2])
    columns = [np.interp(times, known, column) for column in rows.T]
    return np.column_stack(columns)


def _relative(
    guess: Floats, true: Floats, way: Floats, over: float
) -> tuple[float, float]:
    ends = np.searchsorted(way, way + over)
    starts = np.flatnonzero(ends < len(way))
    if not len(starts):
        return math.nan, math.nan
    ends = ends[starts]
    made = _motions(guess[starts], guess[ends])
    due = _motions(true[starts], true[ends])
    off = np.hypot(made[:, 0] - due[:, 0], made[:, 1] - due[:, 1])
    return _root_mean_square(off), _root_mean_square(_wrapped(made[:, 2] - due[:, 2]))


def _motions(starts: Floats, ends: Floats) -> Floats:
    """Give each end as seen from its start, (N, 3)."""
    c, s = np.cos(starts[:, 2]), np.sin(starts[:, 2])
    dx, dy, turn = (ends - starts).T
    return np.column_stack([c * dx + s * dy, c * dy - s * dx, turn])


def _wrapped(angles: Floats) -> Floats:
    return np.arctan2(np.sin(angles), np.cos(angles))


def _root_mean_square(values: Floats) -> float:
    return math.sqrt(float(np.square(values).mean()))
