"""Detection of stuck robots."""

import math

import numpy as np
import pytest

from radarsim.autonomy.navigation.control import (
    StandstillDetector,
    StuckDetector,
    Twist,
)
from radarsim.autonomy.navigation.observation import Observation
from radarsim.errors import NavigationError
from radarsim.geometry import Pose2


def at(time: float, x: float = 0.0, yaw: float = 0.0) -> Observation:
    return Observation(time, Pose2(x, 1.5, yaw), np.zeros(0), np.zeros(0))


def test_standstill_of_a_minute_is_an_error() -> None:
    watch = StandstillDetector()
    for time in range(61):
        watch.check(at(time, 0.05 * math.sin(time), 0.1 * math.cos(time)))
    with pytest.raises(NavigationError, match=r"stood at 0\.00 1\.50 for 60 s"):
        watch.check(at(61.0))


@pytest.mark.parametrize(
    "speed_limits", [Twist(0.01, 0.0), Twist(0.0, 0.02)], ids=["creeps", "turns"]
)
def test_slow_motion_is_no_standstill(speed_limits: Twist) -> None:
    watch = StandstillDetector()
    for time in range(300):
        watch.check(at(time, speed_limits.speed * time, speed_limits.turn * time))


def test_3_m_commanded_without_motion_is_stuck() -> None:
    push = StuckDetector()
    for time in range(13):
        push.check(at(time), Twist(0.25, 0.0))
    with pytest.raises(
        NavigationError, match=r"stays at 0\.00 1\.50 although commanded to go 3 m"
    ):
        push.check(at(13.0), Twist(0.25, 0.0))


def test_robot_is_not_stuck_because_its_scans_come_late() -> None:
    detector = StuckDetector()
    for time in (10.0, 22.0, 40.0):  # on its first scans, of a fast simulation
        detector.check(at(time), Twist(0.3, 0.5))


def test_two_turns_commanded_without_turning_are_stuck() -> None:
    detector = StuckDetector()
    for time in range(26):
        detector.check(at(time, yaw=0.02 * (time % 2)), Twist(0.0, -0.5))
    with pytest.raises(
        NavigationError, match=r"at 0\.00 1\.50 although commanded to turn 720"
    ):
        detector.check(at(26.0), Twist(0.0, -0.5))


def test_robot_that_turns_or_stands_as_commanded_is_not_stuck() -> None:
    turning, standing = StuckDetector(), StuckDetector()
    for time in range(300):
        turning.check(at(time, yaw=0.05 * time), Twist(0.0, 0.5))
        standing.check(at(time), Twist(0.0, 0.0))


def test_turning_on_the_spot_does_not_hide_that_a_robot_cannot_go_ahead() -> None:
    detector = StuckDetector()
    for time in range(30):
        detector.check(at(time, yaw=0.5 * time), Twist(0.1, 0.5))
    with pytest.raises(NavigationError, match="commanded to go 3 m"):
        detector.check(at(31.0), Twist(0.1, 0.5))
