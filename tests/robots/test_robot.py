import math

import pytest

from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import load_robot
from radarsim.protocol.dialect import WheelDrive
from radarsim.robots.fleet import Fleet
from radarsim.robots.obstacles import Obstacles
from radarsim.robots.robot import Battery, Robot

TICK = 0.01


def robot(
    pose: Pose2 | None = None,
    *,
    class_name: str = "P3AT",
    wheel_drive: WheelDrive | None = None,
    floor: float = 0.0,
) -> Robot:
    """Create a robot on an open floor."""
    return Fleet().add(
        "R1",
        load_robot(class_name),
        pose or Pose2(0, 0),
        obstacles=Obstacles(floor=floor),
        wheel_drive=wheel_drive or WheelDrive(8.17),
    )


def run(driven: Robot, seconds: float) -> None:
    for _ in range(round(seconds / TICK)):
        driven.fleet.step(TICK)


def test_robot_stands_until_it_is_driven() -> None:
    driven = robot(Pose2(1, 2, 3))
    run(driven, 1)
    assert driven.pose == Pose2(1, 2, 3)
    assert driven.side_angles == (0, 0)
    assert not driven.light
    assert not driven.touched


def test_full_speed_is_that_of_the_real_p3at() -> None:
    driven = robot()
    driven.drive(100, 100)
    run(driven, 10)
    assert driven.pose.x == pytest.approx(8.17 * 0.098 * 10)
    assert driven.pose.x == pytest.approx(8.0, abs=0.01)
    assert driven.pose.y == pytest.approx(0)


@pytest.mark.parametrize(
    ("left", "right"),
    [
        pytest.param(1.0, None, id="left alone"),
        pytest.param(None, 1.0, id="right alone"),
        pytest.param(None, None, id="neither"),
    ],
)
def test_set_points_change_only_when_both_sides_are_given(
    left: float | None, right: float | None
) -> None:
    driven = robot()
    driven.drive(2, 2)
    driven.drive(left, right)
    run(driven, 1)
    assert driven.side_angles == pytest.approx((2, 2))


def test_normalized_holds_for_later_commands() -> None:
    driven = robot()
    driven.drive(50, 50, normalized=True)
    driven.drive(1, 1)
    run(driven, 1)
    assert driven.side_angles == pytest.approx((0.0817, 0.0817))
    driven.drive(1, 1, normalized=False)
    run(driven, 1)
    assert driven.side_angles == pytest.approx((1.0817, 1.0817))


def test_light_is_independent_of_the_wheels() -> None:
    driven = robot()
    driven.drive(light=True)
    driven.drive(1, 1)
    assert driven.light
    driven.drive(light=False)
    assert not driven.light
    run(driven, 1)
    assert driven.side_angles == pytest.approx((1, 1))


def test_halt_stops_the_wheels() -> None:
    driven = robot()
    driven.drive(1, 1)
    driven.halt()
    run(driven, 1)
    assert driven.pose == Pose2(0, 0)


@pytest.mark.parametrize("speed", [math.nan, math.inf, -math.inf])
def test_speed_that_is_not_finite_is_rejected_without_effect(speed: float) -> None:
    driven = robot()
    with pytest.raises(ValueError, match="expected finite numbers"):
        driven.drive(speed, 1, light=True)
    with pytest.raises(ValueError, match="expected finite numbers"):
        driven.drive(1, speed, normalized=True)
    run(driven, 1)
    assert driven.pose == Pose2(0, 0)
    assert not driven.light


def test_body_frame_is_above_the_floor_by_its_height() -> None:
    upstairs = robot(Pose2(1, 2, 0.5), floor=3.0)
    assert upstairs.body == Pose3(1, 2, 3.146, 0, 0, 0.5)


def test_long_step_equals_many_short_ones() -> None:
    short, long = robot(), robot()
    for driven in (short, long):
        driven.drive(3, 5)
    run(short, 1)
    long.fleet.step(1.0)
    assert long.pose.x == pytest.approx(short.pose.x)
    assert long.pose.y == pytest.approx(short.pose.y)
    assert long.pose.yaw == pytest.approx(short.pose.yaw)


def test_top_speed_is_never_exceeded() -> None:
    driven = robot()
    assert driven.top_speed >= 0.8
    driven.drive(8.17, 8.17)
    driven.fleet.step(TICK)
    assert driven.pose.x <= driven.top_speed * TICK


@pytest.mark.parametrize(
    ("elapsed", "endless", "mortal"),
    [
        pytest.param(0.0, 1200, 1200, id="full"),
        pytest.param(0.1, 1199, 1199, id="a tenth later"),
        pytest.param(0.1 + 0.2 + 0.7, 1199, 1199, id="a second later"),
        pytest.param(sum([0.01] * 100), 1199, 1199, id="a hundred ticks later"),
        pytest.param(1199.0, 1, 1, id="last second"),
        pytest.param(1199.5, 1, 0, id="last half second"),
        pytest.param(1200.0, 1, 0, id="empty"),
        pytest.param(5000.0, 1, 0, id="long after"),
    ],
)
def test_battery_seconds_left(elapsed: float, endless: int, mortal: int) -> None:
    assert Battery(1200.0).seconds_left(elapsed) == endless
    assert Battery(1200.0, runs_out=True).seconds_left(elapsed) == mortal
