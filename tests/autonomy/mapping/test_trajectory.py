import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.autonomy.mapping.trajectory import Trajectory, trajectory_errors, tum_text
from radarsim.geometry import Pose2

angles = st.floats(-3.1, 3.1)
shifts = st.floats(-5, 5)
poses = st.builds(Pose2, shifts, shifts, angles)


def trajectory_of(*poses: Pose2, every: float = 1.0) -> Trajectory:
    trajectory = Trajectory()
    for i, pose in enumerate(poses):
        trajectory.add(every * i, pose)
    return trajectory


def straight(n: int = 11) -> list[Pose2]:
    return [Pose2(0.5 * i, 0.0, 0.0) for i in range(n)]


@settings(max_examples=25)
@given(path=st.lists(poses, min_size=2), by=poses)
def test_displaced_trajectory_has_no_relative_error(
    path: list[Pose2], by: Pose2
) -> None:
    moved = trajectory_of(*map(by.compose, path))
    found = trajectory_errors(moved, trajectory_of(*path))
    assert found["yaw"] == pytest.approx(abs(by.yaw))
    assert math.isnan(found["rpe"]) or found["rpe"] == pytest.approx(0.0, abs=1e-6)
    assert math.isnan(found["rpe_yaw"]) or found["rpe_yaw"] == pytest.approx(
        0.0, abs=1e-6
    )


def test_absolute_errors_are_those_of_the_definition() -> None:
    guess = [Pose2(0, 0, 0), Pose2(0.5, 0.3, 0.1), Pose2(1.4, 0, -0.1)]
    found = trajectory_errors(trajectory_of(*guess), trajectory_of(*straight(3)))
    assert found["ate"] == pytest.approx(math.sqrt((0 + 0.09 + 0.16) / 3))
    assert found["ate_max"] == pytest.approx(0.4)
    assert found["yaw"] == pytest.approx(math.sqrt(0.02 / 3))
    assert found["yaw_max"] == pytest.approx(0.1)
    assert found["length"] == 1.0


def test_motions_ten_percent_too_long_have_ten_percent_error() -> None:
    guess = [Pose2(1.1 * pose.x, 0, 0) for pose in straight()]
    found = trajectory_errors(trajectory_of(*guess), trajectory_of(*straight()))
    assert found["rpe"] == pytest.approx(0.1)
    longer = trajectory_errors(
        trajectory_of(*guess), trajectory_of(*straight()), rpe_over=2.0
    )
    assert longer["rpe"] == pytest.approx(0.2)
    assert longer["rpe_over"] == 2.0


def test_heading_error_is_the_smaller_angle() -> None:
    one, other = Pose2(0, 0, math.pi - 0.05), Pose2(0, 0, 0.05 - math.pi)
    found = trajectory_errors(trajectory_of(one), trajectory_of(other))
    assert found["yaw"] == pytest.approx(0.1)


def test_short_path_has_no_relative_error() -> None:
    short = trajectory_of(*straight(2))
    found = trajectory_errors(short, short)
    assert math.isnan(found["rpe"])
    assert math.isnan(found["rpe_yaw"])


def test_true_poses_are_interpolated() -> None:
    truth = trajectory_of(Pose2(0, 0, 3.1), Pose2(1, 2, -3.1), every=2.0)
    guess = Trajectory()
    guess.add(1.0, Pose2(0.5, 1.0, math.pi))
    found = trajectory_errors(guess, truth)
    assert found["ate"] == pytest.approx(0.0)
    assert found["yaw"] == pytest.approx(0.0, abs=1e-9)


def test_only_times_covered_by_both_are_compared() -> None:
    guess = Trajectory()
    for time in (-1.0, 0.0, 4.0, 11.0):
        guess.add(time, Pose2(0.5 * time, 0.0, 0.0))
    truth = trajectory_of(*straight())
    assert trajectory_errors(guess, truth)["poses"] == 2


@pytest.mark.parametrize(
    "truth",
    [
        pytest.param(Trajectory(), id="no truth"),
        pytest.param(trajectory_of(Pose2(0, 0)), id="another time"),
    ],
)
def test_trajectories_without_common_times_are_an_error(truth: Trajectory) -> None:
    guess = Trajectory()
    guess.add(5.0, Pose2(0, 0))
    with pytest.raises(ValueError, match="do not overlap in time"):
        trajectory_errors(guess, truth)


@settings(max_examples=25)
@given(path=st.lists(poses, min_size=1, max_size=5))
def test_tum_text_is_read_back_by_numpy(path: list[Pose2]) -> None:
    trajectory = trajectory_of(*path, every=0.1)
    rows = np.loadtxt(tum_text(trajectory).splitlines(), ndmin=2)
    assert rows[:, 0] == pytest.approx(trajectory.times)
    assert rows[:, 1:3].tolist() == [
        pytest.approx([pose.x, pose.y], abs=1e-6) for pose in path
    ]
    assert (rows[:, 3:6] == 0).all()
    yaws = 2 * np.arctan2(rows[:, 6], rows[:, 7])
    assert yaws == pytest.approx([pose.yaw for pose in path], abs=1e-4)
