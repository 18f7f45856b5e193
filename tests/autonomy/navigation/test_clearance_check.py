"""Starts and goals inside the safety distance are reported."""

from contextlib import nullcontext
from dataclasses import replace

import pytest
import shapely
from flatland import flatland

from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import Twist
from radarsim.autonomy.navigation.runner import STANDING_AFTER, ClearanceCheck
from radarsim.errors import TooNearError
from radarsim.geometry import Pose2

BUMPERS = Bumpers(safety_distance=0.5)
STILL = Twist(0.0, 0.0)
WALL = shapely.box(2, -1, 2.5, 1)
GOAL = (4.0, 3.0)


def test_start_near_a_wall_is_reported_by_the_first_scan() -> None:
    world = flatland(WALL, at=Pose2(1.58, 0.2))
    with pytest.raises(TooNearError, match=r"start 1\.58 0\.20 is 0\.42 m from"):
        ClearanceCheck(BUMPERS).check(world.scan(), GOAL)


def test_start_at_the_safety_distance_is_good() -> None:
    world, check = flatland(WALL, at=Pose2(1.49, 0.2)), ClearanceCheck(BUMPERS)
    for _ in range(100):
        check.check(world.scan(), GOAL)
        world.move(STILL)


def test_goal_near_a_wall_is_reported_as_soon_as_that_stands() -> None:
    world, check = flatland(WALL, at=Pose2(0.4, 0.0)), ClearanceCheck(BUMPERS)
    for _ in range(20):  # another goal comes first
        check.check(world.scan(), GOAL)
        world.move(STILL)
    begin = world.scan().time
    while world.scan().time < begin + STANDING_AFTER - 0.05:
        check.check(world.scan(), (1.7, 0.2))
        world.move(STILL)
    with pytest.raises(TooNearError, match=r"goal 1\.70 0\.20 is 0\.30 m from"):
        check.check(world.scan(), (1.7, 0.2))


def test_what_drives_by_a_goal_is_no_reason_to_give_up() -> None:
    check = ClearanceCheck(BUMPERS)
    for k in range(200):
        y = -3 + 0.02 * k  # 0.2 m/s
        world = flatland(shapely.box(2, y, 2.6, y + 0.5), at=Pose2(0.5, 0.0))
        world.track = [world.pose] * k
        check.check(world.scan(), (1.9, 0.0))


@pytest.mark.parametrize("metres", [0.0, 18.0, 22.0])
def test_pose_that_may_have_drifted_does_not_bring_a_goal_near_a_wall(
    metres: float,
) -> None:
    world, check = flatland(WALL, at=Pose2(0.4, 0.0)), ClearanceCheck(BUMPERS)
    observation = world.scan()
    far = replace(observation, pose=Pose2(0.4 - metres / 2, 0.0))
    for seen in (observation, far, observation):
        check.check(seen, GOAL)
    check.check(observation, (1.7, 0.2))
    later = replace(observation, time=observation.time + STANDING_AFTER)
    with pytest.raises(TooNearError) if metres < 20 else nullcontext():
        check.check(later, (1.7, 0.2))


def test_what_is_seen_near_a_goal_from_afar_may_be_an_image() -> None:
    world, check = flatland(WALL, at=Pose2(-3.0, 0.0)), ClearanceCheck(BUMPERS)
    begin = world.scan().time
    while world.scan().time < begin + 2 * STANDING_AFTER:
        check.check(world.scan(), (1.7, 0.2))
        world.move(STILL)
