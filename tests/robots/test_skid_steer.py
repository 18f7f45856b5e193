import math

import pytest

from radarsim.geometry import Pose2, wrap_angle
from radarsim.presets.robots import load_robot
from radarsim.protocol.dialect import DriveUnit, WheelDrive
from radarsim.robots.fleet import Fleet
from radarsim.robots.obstacles import Obstacles


def advance(
    pose: Pose2, left: float, right: float, *, track: float, dt: float
) -> Pose2:
    model = load_robot("P3AT").model_copy(update={"track": track, "wheel_radius": 1.0})
    drive, nothing = WheelDrive(1.0), Obstacles()
    robot = Fleet().add("R", model, pose, obstacles=nothing, wheel_drive=drive)
    robot.drive(left, right)
    robot.fleet.step(dt)
    return robot.pose


def same(one: Pose2, other: Pose2) -> bool:
    apart = math.hypot(one.x - other.x, one.y - other.y)
    return apart < 1e-9 and abs(wrap_angle(one.yaw - other.yaw)) < 1e-9


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
    assert same(advance(Pose2(0, 0), left, right, track=0.36, dt=2), end)


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
