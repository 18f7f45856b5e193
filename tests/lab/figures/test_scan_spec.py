import math

import pytest

from radarsim import Scan
from radarsim.lab.figures.figure import (
    ScanSpec,
    find_start_pose,
    hit_points,
    load_scene,
)

MIXED = ScanSpec(
    "empty_room", "radar", 3, (("ray_weights", (0, 1, 0)), ("max_range", 80.0))
)


def test_sensor_is_at_its_mount_on_the_p3at() -> None:
    pose, robot = MIXED.pose, MIXED.robot
    assert math.hypot(pose.x - robot.x, pose.y - robot.y) == pytest.approx(0.2085)
    assert pose.z == pytest.approx(0.346)


def test_command_holds_all_settings() -> None:
    assert MIXED.command == (
        "radarsim scan empty_room --sensor radar --set ray_weights=0,1,0"
        " --set max_range=80 --start RobotStart1 --seed 3"
    )
    words = ScanSpec("m@dust", "radar", 0, (("side_mode", "cone"),), count=10).command
    assert words.endswith(
        "--set side_mode=cone --start RobotStart1 --seed 0 --count 10"
    )


def test_rays_end_on_the_walls_of_an_empty_room() -> None:
    (scan,) = MIXED.take()
    assert isinstance(scan, Scan)
    ends = hit_points(scan)
    outside = MIXED.scene.bounds[1, :2] - abs(ends[:, :2])
    assert (outside > 0).all()
    assert outside.min(axis=1) == pytest.approx(0.2, abs=0.1)


def test_unknown_start_is_refused() -> None:
    with pytest.raises(ValueError, match=r"'Nowhere', expected one of \['RobotStart1'"):
        find_start_pose(load_scene("empty_room"), "Nowhere")
