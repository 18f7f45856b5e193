"""Poses by SLAM for navigators: they may jump, and what was kept can be corrected."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.autonomy.navigation.observation import Observation, ObservationBuilder
from radarsim.autonomy.plans import PoseSource
from radarsim.client import ScannerInfo
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.reports import Ins, RangeScan

FOV = math.radians(356)
SCANNER = ScannerInfo("x", Pose3(0, 0, 0), 0.1, 6.0, math.radians(4), FOV, 90)


class LoopingSlam:
    """Takes the motion as it is, until a loop closes and moves all poses but one."""

    def __init__(self, moved_by: Pose2) -> None:
        self.pose = Pose2(0.0, 0.0)
        self.trajectory = Trajectory()
        self.revision = 0
        self._moved_by = moved_by

    def step(self, scan: Any, prior: Pose2, _: float) -> Pose2:
        self.pose = prior
        self.trajectory.add(scan.time, prior)
        if len(self.trajectory) == 3:
            first, *others = self.trajectory.poses
            moved = [self._moved_by.compose(pose) for pose in others]
            self.trajectory.poses = [first, *moved]
            self.pose = moved[-1]
            self.revision += 1
        return self.pose


def square_room(x: float, y: float) -> np.ndarray[Any, Any]:
    """Return ranges all round to the walls of a room of 10 x 10 m, (90,) m."""
    angles = SCANNER.angles
    along = np.column_stack([np.cos(angles), np.sin(angles)])
    with np.errstate(divide="ignore"):
        ranges = (np.where(along > 0, 5.0, -5.0) - (x, y)) / along
    return np.asarray(ranges.min(axis=1))


def reports_of(k: int, x: float, ins_x: float) -> tuple[Ins, RangeScan]:
    ranges = square_room(x, 0.3)
    scan = RangeScan(0.1 * k, "x", SCANNER.resolution, SCANNER.fov, ranges)
    return Ins(0.1 * k, "INS", Pose3(ins_x, 0.3, 0.0)), scan


def test_pose_is_found_although_the_ins_measures_a_tenth_too_much() -> None:
    scanner = replace(SCANNER, max_range=20.0)
    source = ObservationBuilder(scanner, PoseSource.SLAM, lambda: 0.0)
    for k in range(60):
        x = 0.03 * k
        motion, scan = reports_of(k, x, 1.1 * x)
        source.take(motion)
        observation = source.take(scan)
    assert x > 1.7
    assert observation is not None
    pose = observation.pose
    assert math.hypot(pose.x - x, pose.y - 0.3) < 0.06
    assert not source.pop_jump()


@pytest.mark.parametrize(
    ("moved_by", "is_jump"),
    [
        pytest.param(Pose2(0.5, 0.0), True, id="moved"),
        pytest.param(Pose2(0.0, 0.0, 0.05), True, id="turned"),
        pytest.param(Pose2(0.05, 0.0, 0.01), False, id="little"),
    ],
)
def test_scans_that_were_kept_are_corrected_after_a_loop(
    moved_by: Pose2, is_jump: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "radarsim.autonomy.navigation.observation.Slam"
    monkeypatch.setattr(name, lambda **_: LoopingSlam(moved_by))
    source = ObservationBuilder(SCANNER, PoseSource.SLAM, lambda: 0.0)
    seen: list[Observation] = []
    for k in range(5):
        for report in reports_of(k, 0.1 * k, 0.1 * k):
            observation = source.take(report)
        assert observation is not None
        seen.append(observation)
        assert source.pop_jump() == (is_jump and k == 2)
    assert source.corrected(seen[0]).pose == seen[0].pose
    second = moved_by.compose(Pose2(0.1, 0.3))
    assert source.corrected(seen[1]).pose == second
    assert seen[1].pose == Pose2(0.1, 0.3)


def test_other_poses_never_jump() -> None:
    source = ObservationBuilder(SCANNER, PoseSource.INS, lambda: 0.0)
    reports = [each for k in range(3) for each in reports_of(k, 0.1 * k, 0.1 * k)]
    seen = [each for report in reports if (each := source.take(report))]
    assert len(seen) == 3
    assert not source.pop_jump()
    assert source.corrected(seen[0]) is seen[0]
