import math

import pytest
import shapely
from flatland import flatland, navigator

from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.autonomy.navigation.controller import Activity
from radarsim.geometry import Pose2

S = 0.5
TRAP = shapely.box(-3, -2.5, 2, 2.5).difference(shapely.box(-4, -2.4, 1.9, 2.4))
CELL = shapely.box(-2, -2, 2, 2).difference(shapely.box(-1.9, -1.9, 1.9, 1.9))


def test_goal_in_something_round_has_no_path() -> None:
    world = flatland(shapely.Point(3, 0).buffer(0.72), at=Pose2(-5.0, 0.0))
    robot = navigator(Algorithm.TANGENT_BUG, (3.0, 0.1))
    world.run(robot, steps=3000)
    assert robot.activity is Activity.NO_PATH


@pytest.mark.slow
def test_robot_gets_out_of_a_trap() -> None:
    world = flatland(TRAP, at=Pose2(0.5, 0.2))
    robot = navigator(Algorithm.TANGENT_BUG, (6.0, 0.0))
    world.run(robot)
    assert robot.activity is Activity.REACHED
    assert len(robot.hit_points) == len(robot.leave_points) >= 1
    assert world.nearest > S - 0.1


def test_boundary_is_not_left_for_what_one_scan_shows() -> None:
    world = flatland(CELL, at=Pose2(-0.5, 0.3))
    robot = navigator(Algorithm.TANGENT_BUG, (6.0, 0.4))
    for k in range(150):
        seen = world.scan()
        if k % 40 < 2:  # by beams that pass panes
            seen.ranges[:] = math.inf
        world.move(robot.step(seen))
    assert len(robot.hit_points) == 1
    assert not robot.leave_points
