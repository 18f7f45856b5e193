"""Boundaries followed by the states of bumpers alone, as in the thesis."""

import math

import pytest
import shapely
import shapely.affinity
from flatland import flatland

from radarsim.autonomy.navigation.bug import Bug
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import SpeedLimits, Twist
from radarsim.autonomy.navigation.controller import Activity, ControllerSettings
from radarsim.autonomy.navigation.wall_following import BumperWallFollower
from radarsim.autonomy.plans import Algorithm, Mission, Rule
from radarsim.geometry import Pose2

S = 0.5
LIMITS = SpeedLimits(0.3)
WALL = shapely.box(-30, 0, 30, 1)  # to the left of a robot that faces along x
CORNER = shapely.union(WALL, shapely.box(3, -30, 4, 0))


def steering(*, wall_on_left: bool = True) -> BumperWallFollower:
    bumpers = Bumpers(safety_distance=S, rule=Rule.THESIS)
    return BumperWallFollower(bumpers, LIMITS, wall_on_left=wall_on_left)


@pytest.mark.parametrize(
    ("distance", "speed", "turn"),
    [
        pytest.param(0.75, 1.0, 0, id="only the side pressed: straight on"),
        pytest.param(1.2, 1.0, 1, id="lost: towards it"),
        pytest.param(0.45, 0.5, -1, id="too near: away from it"),
    ],
)
def test_side_bumper_decides_along_a_wall(
    distance: float, speed: float, turn: int
) -> None:
    scan = flatland(WALL, at=Pose2(0.0, -distance)).scan()
    twist, _ = steering().step(scan)
    assert twist.speed == pytest.approx(speed * LIMITS.speed)
    assert math.copysign(1, twist.turn) * (twist.turn != 0) == turn


@pytest.mark.parametrize("wall_on_left", [True, False])
def test_pressed_front_is_turned_away_from_until_the_back_is_pressed(
    wall_on_left: bool,
) -> None:
    yaw = 0.0 if wall_on_left else math.pi
    side = 1 if wall_on_left else -1
    corner = shapely.affinity.scale(CORNER, side, 1, origin=(0, 0))
    world = flatland(corner, at=Pose2(side * 2.2, -0.75, yaw))
    follow = steering(wall_on_left=wall_on_left)
    twist, _ = follow.step(world.scan())
    assert twist == Twist(0.0, -LIMITS.turn if wall_on_left else LIMITS.turn)
    while twist.speed == 0:
        world.move(twist)
        twist, _ = follow.step(world.scan())
    turned = abs(world.pose.yaw - yaw)
    assert turned == pytest.approx(math.pi / 2, abs=0.35)
    assert world.nearest > S


def test_turn_that_no_bumper_ends_ends_after_a_circle() -> None:
    world = flatland(shapely.Point(0.55, 0).buffer(0.1), at=Pose2(0.0, 0.0))
    follow, turned = steering(), 0.0
    twist, _ = follow.step(world.scan())
    while twist.speed == 0 and turned < 10:
        world.move(twist)
        turned += abs(twist.turn) * 0.1
        twist, _ = follow.step(world.scan())
    assert turned <= 2 * math.pi + 0.6  # and past the obstacle ahead


@pytest.mark.parametrize("algorithm", [Algorithm.BUG1, Algorithm.BUG2])
def test_bug_gets_around_a_box_by_bumpers_alone(algorithm: Algorithm) -> None:
    world = flatland(shapely.box(-1.5, -2, 1.5, 2.5), at=Pose2(-4.0, 0.0))
    bumpers = Bumpers(safety_distance=S, rule=Rule.THESIS)
    mission = Mission(algorithm=algorithm, goals=((4.0, 0.2),))
    bug = Bug(ControllerSettings(mission, bumpers))
    world.run(bug)
    assert bug.activity is Activity.REACHED
    assert world.nearest > 0.4
