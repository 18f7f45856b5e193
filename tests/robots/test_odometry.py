import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wheel_odometry import WheelOdometry, add_odometry

from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.protocol.dialect import WheelDrive
from radarsim.robots.fleet import Fleet
from radarsim.robots.obstacles import Obstacles
from radarsim.robots.robot import Robot

P3AT = load_robot("P3AT").model_copy(
    update={"wheel_radius": 0.1, "wheel_separation": 0.4}
)
NOTHING = Obstacles()
angles = st.floats(-50, 50)


def robot(fleet: Fleet | None = None) -> Robot:
    drive, fleet = WheelDrive(1e3), fleet or Fleet()
    return fleet.add("R", P3AT, Pose2(5, 5, 2), obstacles=NOTHING, wheel_drive=drive)


def odometry() -> WheelOdometry:
    driven = robot()
    return add_odometry(driven)


def turn(wheels: WheelOdometry, left: float, right: float) -> None:
    """Turn the wheels by angles, rad, within one step."""
    wheels.robot.drive(left, right)
    wheels.robot.fleet.step(1.0)


def test_odometry_of_a_quarter_turn_to_the_left() -> None:
    wheels = odometry()
    turn(wheels, 0, 2 * math.pi)
    turned = 0.1 * 2 * math.pi / 0.4
    assert wheels.pose.yaw == pytest.approx(turned)
    assert wheels.pose.x == pytest.approx(0.2 * math.sin(turned))
    assert wheels.pose.y == pytest.approx(0.2 * (1 - math.cos(turned)))


@settings(max_examples=25)
@given(left=angles, right=angles, parts=st.integers(2, 9))
def test_odometry_integrates_an_arc_exactly(
    left: float, right: float, parts: int
) -> None:
    whole, piecewise = odometry(), odometry()
    turn(whole, left, right)
    for _ in range(parts):
        turn(piecewise, left / parts, right / parts)
    for name in ("x", "y", "yaw"):
        expected = getattr(whole.pose, name)
        assert getattr(piecewise.pose, name) == pytest.approx(expected, abs=1e-9)


def test_odometry_does_not_wrap_its_angle() -> None:
    wheels = odometry()
    turn(wheels, -40, 40)
    assert wheels.pose.yaw == pytest.approx(20)


def test_odometry_counts_from_where_it_is_added() -> None:
    wheels = odometry()
    turn(wheels, 10, 10)
    later = add_odometry(wheels.robot)
    turn(wheels, 10, 10)
    assert wheels.pose.x == pytest.approx(2)
    assert later.pose.x == pytest.approx(1)


def test_each_robot_has_its_own_odometry_when_another_leaves() -> None:
    fleet = Fleet()
    leaving, staying = robot(fleet), robot(fleet)
    first, second = add_odometry(leaving), add_odometry(staying)
    leaving.drive(10, 10)
    staying.drive(-20, -20)
    fleet.step(1.0)
    fleet.remove(leaving)
    fleet.step(1.0)
    assert first.pose.x == pytest.approx(1)
    assert second.pose.x == pytest.approx(-4)
