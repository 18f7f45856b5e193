"""Who sees something come into its way stops and waits, then goes on."""

import math

import numpy as np
import pytest
import shapely
from flatland import flatland, outline

from radarsim.autonomy.navigation.bug import Bug
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import STOP, Twist
from radarsim.autonomy.navigation.controller import ControllerSettings
from radarsim.autonomy.navigation.moving_things import PATIENCE, Waiting
from radarsim.autonomy.plans import Algorithm, Mission
from radarsim.geometry import Pose2

BUMPERS = Bumpers(safety_distance=0.5)


def crossing(y: float) -> shapely.Polygon:
    return shapely.box(-0.25, y - 0.3, 0.25, y + 0.3)


@pytest.mark.parametrize("speed", [0.3, 0.5])
@pytest.mark.parametrize("begin", [-5.0, -4.0, -3.0])
def test_robot_lets_something_pass_and_reaches_its_goal(
    begin: float, speed: float
) -> None:
    world = flatland(at=Pose2(-3.0, 0.0))
    mission = Mission(algorithm=Algorithm.BUG1, goals=((3.0, 0.0),))
    bug = Bug(ControllerSettings(mission, BUMPERS))
    waiting, twist, nearest = Waiting(BUMPERS, 0.37), STOP, math.inf
    for k in range(600):
        other = crossing(begin + speed * 0.1 * k)
        world.walls = outline(other)
        place = shapely.Point(world.pose.x, world.pose.y)
        if twist.speed:  # the other one does not look where it goes
            nearest = min(nearest, other.distance(place))
        scan = world.scan()
        twist = STOP if waiting.has_to_wait(scan, twist) else bug.step(scan)
        world.move(twist)
        if bug.is_done:
            break
    assert not bug.goals
    assert not bug.circuits
    assert nearest > 0.5


def test_nothing_moves_where_only_the_robot_does() -> None:
    poles = [shapely.Point(x, y).buffer(0.1) for x in (0, 2, 4) for y in (-0.8, 0.9)]
    world = flatland(*poles, shapely.box(5, -2, 5.1, 2), at=Pose2(-1.0, 0.0))
    waiting = Waiting(BUMPERS, 0.37)
    for k in range(120):
        assert not waiting.moving_beams(world.scan(), 3.0).any()
        world.move(Twist(0.3, 0.3 * math.cos(0.1 * k)))


def test_robot_does_not_wait_for_ever() -> None:
    """Something drives to and fro before it."""
    world, waiting = flatland(at=Pose2(0.0, 0.0)), Waiting(BUMPERS, 0.37)
    waits = []
    for k in range(400):
        y = 0.4 * math.sin(0.08 * k)
        world.walls = outline(shapely.box(1.2, y - 0.2, 1.6, y + 0.2))
        waits.append(waiting.has_to_wait(world.scan(), STOP))
        world.move(STOP)
    ends = np.flatnonzero(np.diff([0, *waits, 0]))
    stood = (ends[1::2] - ends[::2]).max()
    assert 0 < stood <= 10 * PATIENCE + 1
    assert not all(waits[-200:])


def test_robot_that_is_driven_into_backs_off() -> None:
    """Something comes from ahead, at the robot's left front, and does not stop."""
    world, waiting = flatland(at=Pose2(0.0, 0.0)), Waiting(BUMPERS, 0.37)
    away = None
    for k in range(60):
        x = max(3.0 - 0.05 * k, 0.34)
        world.walls = outline(shapely.box(x, -0.1, x + 0.5, 0.3))
        scan = world.scan()
        waiting.has_to_wait(scan, Twist(0.3, 0.0))
        away = waiting.back_off(scan)
        assert (away is not None) == (scan.ranges.min() < 0.37)
        world.move(STOP)
    assert away is not None
    assert (away.speed < 0, away.turn) == (True, 0.0)


def test_robot_does_not_back_off_from_what_stands_or_into_something() -> None:
    behind = shapely.box(-1.0, -0.5, -0.4, 0.5)
    world, waiting = flatland(behind, at=Pose2(0.0, 0.0)), Waiting(BUMPERS, 0.45)
    assert waiting.back_off(world.scan()) is None
    for k in range(60):
        x = max(3.0 - 0.05 * k, 0.34)
        world.walls = flatland(
            behind, shapely.box(x, -0.1, x + 0.5, 0.3), at=world.pose
        ).walls
        scan = world.scan()
        waiting.has_to_wait(scan, Twist(0.3, 0.0))
        world.move(STOP)
    assert waiting.back_off(scan) == STOP


def test_robot_does_not_back_off_from_its_image() -> None:
    """It drives along a mirror, and its image comes along on the other side."""
    world, waiting = flatland(at=Pose2(0.0, 0.0)), Waiting(BUMPERS, 0.37)
    world.bearings = np.radians(np.arange(-180.0, 180.0))
    seen = 0
    for _ in range(80):
        image = shapely.box(-0.2, 0.34, 0.2, 0.6)
        image = shapely.affinity.translate(image, world.pose.x)
        world.walls = outline(image)
        scan = world.scan()
        seen += waiting.has_to_wait(scan, Twist(0.3, 0.0))
        assert scan.ranges.min() < 0.37
        assert waiting.back_off(scan) is None
        world.move(Twist(0.3, 0.0))
    assert world.pose.x > 1.0
    assert seen


def test_robot_does_not_back_off_from_what_stands_where_another_thing_moves() -> None:
    pole = shapely.box(-0.1, 0.34, 0.1, 0.6)
    world, waiting = flatland(pole, at=Pose2(0.0, 0.0)), Waiting(BUMPERS, 0.37)
    seen = 0
    for k in range(60):
        y = -1.5 + 0.05 * k
        world.walls = flatland(pole, crossing(y), at=world.pose).walls
        world.walls[:, :, 0] += np.where(np.arange(len(world.walls)) < 4, 0.0, 1.6)[
            :, None
        ]
        scan = world.scan()
        seen += waiting.has_to_wait(scan, Twist(0.3, 0.0))
        assert waiting.back_off(scan) is None
        world.move(STOP)
    assert seen
