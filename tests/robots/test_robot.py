import math

import pytest

from radarsim.geometry import Pose2, Pose3, wrap_angle
from radarsim.presets.robots import load_robot
from radarsim.protocol.dialect import DriveUnit, WheelDrive
from radarsim.robots.fleet import Fleet
from radarsim.robots.obstacles import Obstacles
from radarsim.robots.robot import Robot

TICK = 0.01
ORIGIN = Pose2(0, 0)
P3AT = load_robot("P3AT")


def robot(pose: Pose2 = ORIGIN, *, floor: float = 0.0) -> Robot:
    """Create a robot on an open floor."""
    drive, around = WheelDrive(8.17), Obstacles(floor=floor)
    return Fleet().add("R1", P3AT, pose, obstacles=around, wheel_drive=drive)


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


def advance(
    pose: Pose2, left: float, right: float, *, track: float, dt: float
) -> Pose2:
    model = P3AT.model_copy(update={"track": track, "wheel_radius": 1.0})
    drive, nothing = WheelDrive(1.0), Obstacles()
    robot = Fleet().add("R", model, pose, obstacles=nothing, wheel_drive=drive)
    robot.drive(left, right)
    robot.fleet.step(dt)
    return robot.pose


@pytest.mark.parametrize(
    ("left", "right", "end"),
    [
        pytest.param(0.5, 0.5, Pose2(1, 0, 0), id="straight ahead"),
        pytest.param(-0.5, -0.5, Pose2(-1, 0, 0), id="straight back"),
        pytest.param(0, 0.36 * math.pi / 4, Pose2(0.18, 0.18, math.pi / 2), id="left"),
        pytest.param(
            0.36 * math.pi / 4, 0, Pose2(0.18, -0.18, -math.pi / 2), id="right"
        ),
        pytest.param(
            -0.18 * math.pi / 2, 0.18 * math.pi / 2, Pose2(0, 0, math.pi), id="spin"
        ),
    ],
)
def test_known_arcs(left: float, right: float, end: Pose2) -> None:
    found = advance(Pose2(0, 0), left, right, track=0.36, dt=2)
    assert math.hypot(found.x - end.x, found.y - end.y) < 1e-9
    assert abs(wrap_angle(found.yaw - end.yaw)) < 1e-9


@pytest.mark.parametrize(
    ("unit", "limit", "value", "normalized", "spin"),
    [
        ("rad_per_s", 8.17, 2.5, False, 2.5),
        ("rad_per_s", 8.17, -9, False, -8.17),
        ("rad_per_s", 8.17, 50, True, 4.085),
        ("rad_per_s", 8.17, -250, True, -8.17),
        ("rev_per_s", 1.3, 1, False, 2 * math.pi),
        ("rev_per_s", 1.3, 5, False, 2.6 * math.pi),
        ("rev_per_s", 1.3, 100, True, 2.6 * math.pi),
    ],
)
def test_conversion_of_commanded_speeds(
    unit: DriveUnit, limit: float, value: float, normalized: bool, spin: float
) -> None:
    drive = WheelDrive(limit, unit)
    assert drive.spin(value, normalized=normalized) == pytest.approx(spin)
