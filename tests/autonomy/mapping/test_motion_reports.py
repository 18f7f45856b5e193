"""Reported motion at the times of scans that come more often than reports."""

import math

import numpy as np
import pytest
from flat_world import ROOM, look

from radarsim.autonomy.mapping.slam import MotionReports, Slam
from radarsim.autonomy.mapping.trajectory import Trajectory, trajectory_errors
from radarsim.geometry import Pose2


def reports(*poses: tuple[float, Pose2]) -> MotionReports:
    motion = MotionReports()
    for time, pose in poses:
        motion.add(time, pose)
    return motion


def test_first_report_stands_for_all_times() -> None:
    motion = MotionReports()
    assert motion.at(0.1) is None
    motion.add(0.2, Pose2(1.0, 2.0, 0.5))
    for time in (0.1, 0.2, 0.35):
        assert motion.at(time) == (Pose2(1.0, 2.0, 0.5), 0.0)


@pytest.mark.parametrize(
    ("time", "x", "yaw"),
    [(0.2, 0.1, 0.2), (0.25, 0.15, 0.3), (0.3, 0.2, 0.4), (0.5, 0.2, 0.4)],
)
def test_motion_goes_on_for_as_long_as_between_two_reports(
    time: float, x: float, yaw: float
) -> None:
    motion = reports((0.1, Pose2(0.0, 0.0)), (0.2, Pose2(0.1, 0.0, 0.2)))
    found = motion.at(time)
    assert found is not None
    pose, guessed = found
    assert pose.yaw == pytest.approx(yaw)
    assert math.hypot(pose.x, pose.y) == pytest.approx(x, rel=0.02)
    assert guessed == pytest.approx(time - 0.2)


def test_guesses_are_reported_between_scans() -> None:
    motion = reports((0.1, Pose2(0.0, 0.0)), (0.2, Pose2(0.1, 0.0)))
    guessed = []
    for time in (0.2, 0.22, 0.28):
        found = motion.at(time)
        assert found is not None
        guessed.append(found[1])
    motion.add(0.3, Pose2(0.1, 0.0))  # it has stopped
    found = motion.at(0.31)
    assert found is not None
    assert found[0] == Pose2(0.1, 0.0)
    # The last scan was .08 s after its report, and this one is .01 s after the next.
    assert [*guessed, found[1]] == pytest.approx([0.0, 0.02, 0.06, 0.09])


@pytest.mark.parametrize("times", [(math.nan, math.nan), (0.1, 0.1), (0.2, 0.1)])
def test_times_that_do_not_advance_give_no_speed(times: tuple[float, float]) -> None:
    poses = Pose2(0.0, 0.0), Pose2(0.1, 0.0)
    motion = reports(*zip(times, poses, strict=True))
    assert motion.at(0.3) == (Pose2(0.1, 0.0), 0.0)
    assert motion.at(math.nan) == (Pose2(0.1, 0.0), 0.0)


def drive() -> list[Pose2]:
    """Return the poses every .01 s on a curve to and fro, at up to .8 rad/s.

    The robot stands for .3 s, as robots do when they are spawned.
    """
    yaws = [0.8 * math.sin(0.01 * k) for k in range(600)]
    x = -4.0 + 0.006 * np.cumsum(np.cos(yaws))
    y = 2.2 + 0.006 * np.cumsum(np.sin(yaws))
    path = [Pose2(*row) for row in np.column_stack([x, y, yaws]).tolist()]
    return [path[0]] * 30 + path


@pytest.mark.parametrize("every", [1, 3])
def test_scans_between_reports_are_matched_as_well_as_others(every: int) -> None:
    """At 100 and 33 Hz, with a report every .1 s, whose x drifts by 2 %."""
    poses, motion, truth = drive(), MotionReports(), Trajectory()
    slam = Slam("ins", poses[0])
    for k, pose in enumerate(poses):
        time = 0.01 * k
        if k % 10 == 0:
            motion.add(time, Pose2(1.02 * pose.x, pose.y, pose.yaw))
        if k % every == 0:
            truth.add(time, pose)
            slam.step(look(ROOM, pose, time=time), *(motion.at(time) or ()))
    found = trajectory_errors(slam.trajectory, truth)
    assert found["length"] > 3
    assert found["ate_max"] < 0.01
    assert found["yaw_max"] < math.radians(0.2)
