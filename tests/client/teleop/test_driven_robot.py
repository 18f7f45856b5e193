import math

import numpy as np
import pytest

from radarsim.client.robot_state import MOTION_WINDOW
from radarsim.client.teleop_view import DrivenRobot
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol import reports


def scan(time: float, *ranges: float, name: str = "lms200") -> reports.RangeScan:
    fan = np.array(ranges)
    return reports.RangeScan(time, name, math.pi / (len(fan) - 1), math.pi, fan)


def truth(time: float, x: float, y: float, yaw: float) -> reports.GroundTruth:
    return reports.GroundTruth(time, "GndTruth", Pose3(x, y, 0.1, yaw=yaw))


def speed_of(state: DrivenRobot) -> float:
    motion = state.motion()
    assert motion is not None
    return motion[0]


def test_newest_report_of_each_kind_is_kept(state: DrivenRobot) -> None:
    for time in (1.0, 2.0):
        state.take(truth(time, time, 0.0, 0.0))
        state.take(reports.Ins(time, "InsTest", Pose3(time, 1.0, 0.0)))
        state.take(reports.Odometry(time, "Odometer", Pose2(time, 2.0)))
        state.take(reports.Touch(time, "Bumper", touched=time == 1.0))
        state.take(reports.Status(time, battery=3600 - int(time), light=False))
        state.take(scan(time, 3.0, time, 3.0))
    assert state.time == 2.0
    assert state.poses == {
        reports.GroundTruth: Pose2(2.0, 0.0),
        reports.Ins: Pose2(2.0, 1.0),
        reports.Odometry: Pose2(2.0, 2.0),
    }
    assert state.touched == {"Bumper": False}
    assert state.battery == 3598
    assert state.scan is not None
    assert state.scan.ranges[1] == 2.0


def test_other_reports_are_ignored(state: DrivenRobot) -> None:
    state.take(reports.RobotConf("P3AT", 11.9, 8.17, 1.0))
    state.take(scan(1.0, 1.0, 1.0, 1.0, name="Hokuyo"))
    assert math.isnan(state.time)
    assert state.scan is None
    assert len(state.points()) == 0
    assert not state.is_blind()


def test_points_are_relative_to_the_robot_centre(state: DrivenRobot) -> None:
    state.take(scan(1.0, 1.0, 2.0, 3.0))
    expected = [[0.2, -1.0], [2.2, 0.0], [0.2, 3.0]]
    assert state.points() == pytest.approx(np.array(expected), abs=1e-6)


def test_scanner_that_reads_only_0_is_blind(state: DrivenRobot) -> None:
    state.take(scan(1.0, 0.0, 0.0, 0.0))
    assert state.is_blind()
    assert len(state.points()) == 0
    state.take(scan(1.1, 0.0, 1.0, 0.0))
    assert not state.is_blind()


def test_scan_rate_is_by_server_time(state: DrivenRobot) -> None:
    assert math.isnan(state.scan_rate())
    state.take(scan(0.0, 1.0, 1.0, 1.0))
    assert math.isnan(state.scan_rate())
    for i in range(1, 30):
        state.take(scan(i / 5, 1.0, 1.0, 1.0))
    assert state.scan_rate() == pytest.approx(5.0)


@pytest.mark.parametrize("yaw", [0.0, 2.0, math.pi - 0.1])
@pytest.mark.parametrize("speed", [0.4, -0.4])
def test_speed_is_measured_along_the_heading(
    state: DrivenRobot, yaw: float, speed: float
) -> None:
    assert state.motion() is None
    turn, radius = 0.5, speed / 0.5
    for i in range(12):
        angle = yaw + turn * i / 10
        place = radius * math.sin(angle), -radius * math.cos(angle)
        state.take(truth(i / 10, *place, math.remainder(angle, 2 * math.pi)))
    measured = state.motion()
    assert measured is not None
    assert measured[0] == pytest.approx(speed, rel=0.01)
    assert measured[1] == pytest.approx(turn)


def test_measured_speed_is_zero_one_window_after_a_stop(state: DrivenRobot) -> None:
    for i in range(20):
        state.take(truth(i / 10, min(i, 10) / 10, 0.0, 0.0))
    assert MOTION_WINDOW < 0.9
    assert state.motion() == (0.0, 0.0)


def test_motion_is_measured_by_the_best_pose_sensor(state: DrivenRobot) -> None:
    state.take(reports.Odometry(0.0, "Odometer", Pose2(0.0, 0.0)))
    state.take(reports.Odometry(0.1, "Odometer", Pose2(0.1, 0.0)))
    assert speed_of(state) == pytest.approx(1.0)
    for time, x in ((0.2, 0.0), (0.3, 0.05)):
        state.take(truth(time, x, 0.0, 0.0))
        state.take(reports.Odometry(time, "Odometer", Pose2(9.0, 0.0)))
    assert speed_of(state) == pytest.approx(0.5)


def test_clock_reset_restarts_the_measurement(state: DrivenRobot) -> None:
    for report in (truth(5.0, 0.0, 0.0, 0.0), truth(0.1, 3.0, 0.0, 0.0)):
        state.take(report)
    assert state.motion() is None
    state.take(truth(0.2, 3.1, 0.0, 0.0))
    assert speed_of(state) == pytest.approx(1.0)
