import math

import numpy as np
import pytest

from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.reports import (
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    RobotConf,
    Status,
    Touch,
)
from radarsim.teleop.robot_state import MOTION_WINDOW, RobotState


def scan(time: float, *ranges: float, name: str = "lms200") -> RangeScan:
    fan = np.array(ranges)
    return RangeScan(time, name, math.pi / (len(fan) - 1), math.pi, fan)


def truth(time: float, x: float, y: float, yaw: float) -> GroundTruth:
    return GroundTruth(time, "GndTruth", Pose3(x, y, 0.1, yaw=yaw))


def speed_of(readings: RobotState) -> float:
    motion = readings.motion()
    assert motion is not None
    return motion[0]


def test_of_each_kind_the_newest_is_kept(readings: RobotState) -> None:
    for time in (1.0, 2.0):
        readings.take(truth(time, time, 0.0, 0.0))
        readings.take(Ins(time, "InsTest", Pose3(time, 1.0, 0.0)))
        readings.take(Odometry(time, "Odometer", Pose2(time, 2.0)))
        readings.take(Touch(time, "Bumper", touched=time == 1.0))
        readings.take(Status(time, battery=3600 - int(time), light=False))
        readings.take(scan(time, 3.0, time, 3.0))
    assert readings.time == 2.0
    assert readings.poses == {
        GroundTruth: Pose2(2.0, 0.0),
        Ins: Pose2(2.0, 1.0),
        Odometry: Pose2(2.0, 2.0),
    }
    assert readings.touched == {"Bumper": False}
    assert readings.battery == 3598
    assert readings.scan is not None
    assert readings.scan.ranges[1] == 2.0


def test_what_is_not_shown_changes_nothing(readings: RobotState) -> None:
    readings.take(RobotConf("P3AT", 11.9, 8.17, 1.0))
    readings.take(scan(1.0, 1.0, 1.0, 1.0, name="Hokuyo"))
    assert math.isnan(readings.time)
    assert readings.scan is None
    assert len(readings.points()) == 0
    assert not readings.is_blind()


def test_points_are_seen_from_the_robots_centre(readings: RobotState) -> None:
    readings.take(scan(1.0, 1.0, 2.0, 3.0))
    expected = [[0.2, -1.0], [2.2, 0.0], [0.2, 3.0]]
    assert readings.points() == pytest.approx(np.array(expected), abs=1e-6)


def test_beams_that_met_nothing_give_no_points(readings: RobotState) -> None:
    readings.take(scan(1.0, 10.0, 9.98, 0.0))
    assert readings.points() == pytest.approx(np.array([[10.18, 0.0]]), abs=1e-6)


def test_a_scanner_that_reads_0_everywhere_is_blind(readings: RobotState) -> None:
    readings.take(scan(1.0, 0.0, 0.0, 0.0))
    assert readings.is_blind()
    assert len(readings.points()) == 0
    readings.take(scan(1.1, 0.0, 1.0, 0.0))
    assert not readings.is_blind()


def test_the_rate_is_that_of_the_servers_time(readings: RobotState) -> None:
    assert math.isnan(readings.scan_rate())
    readings.take(scan(0.0, 1.0, 1.0, 1.0))
    assert math.isnan(readings.scan_rate())
    for i in range(1, 30):
        readings.take(scan(i / 5, 1.0, 1.0, 1.0))
    assert readings.scan_rate() == pytest.approx(5.0)


@pytest.mark.parametrize("yaw", [0.0, 2.0, math.pi - 0.1])
@pytest.mark.parametrize("speed", [0.4, -0.4])
def test_the_motion_is_measured_along_the_robots_front(
    readings: RobotState, yaw: float, speed: float
) -> None:
    assert readings.motion() is None
    turn, radius = 0.5, speed / 0.5
    for i in range(12):
        angle = yaw + turn * i / 10
        place = radius * math.sin(angle), -radius * math.cos(angle)
        readings.take(truth(i / 10, *place, math.remainder(angle, 2 * math.pi)))
    measured = readings.motion()
    assert measured is not None
    assert measured[0] == pytest.approx(speed, rel=0.01)
    assert measured[1] == pytest.approx(turn)


def test_a_robot_that_stops_is_seen_to_stand_after_the_window(
    readings: RobotState,
) -> None:
    for i in range(20):
        readings.take(truth(i / 10, min(i, 10) / 10, 0.0, 0.0))
    assert MOTION_WINDOW < 0.9
    assert readings.motion() == (0.0, 0.0)


def test_the_best_pose_measures_the_motion(readings: RobotState) -> None:
    readings.take(Odometry(0.0, "Odometer", Pose2(0.0, 0.0)))
    readings.take(Odometry(0.1, "Odometer", Pose2(0.1, 0.0)))
    assert speed_of(readings) == pytest.approx(1.0)
    for time, x in ((0.2, 0.0), (0.3, 0.05)):
        readings.take(truth(time, x, 0.0, 0.0))
        readings.take(Odometry(time, "Odometer", Pose2(9.0, 0.0)))
    assert speed_of(readings) == pytest.approx(0.5)


def test_time_that_begins_anew_measures_anew(readings: RobotState) -> None:
    for report in (truth(5.0, 0.0, 0.0, 0.0), truth(0.1, 3.0, 0.0, 0.0)):
        readings.take(report)
    assert readings.motion() is None
    readings.take(truth(0.2, 3.1, 0.0, 0.0))
    assert speed_of(readings) == pytest.approx(1.0)
