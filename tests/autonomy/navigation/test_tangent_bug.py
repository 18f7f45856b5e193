import math

import pytest
import shapely
from flatland import World

from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import SpeedLimits
from radarsim.autonomy.navigation.controller import Activity, ControllerSettings
from radarsim.autonomy.navigation.tangent_bug import TangentBug
from radarsim.geometry import Pose2

S = 0.5
BOX = shapely.box(-1.5, -2, 1.5, 2.5)
TRAP = shapely.box(-3, -2.5, 2, 2.5).difference(shapely.box(-4, -2.4, 1.9, 2.4))
CELL = shapely.box(-2, -2, 2, 2).difference(shapely.box(-1.9, -1.9, 1.9, 1.9))


def tangent_bug(*goals: tuple[float, float]) -> TangentBug:
    settings = ControllerSettings(
        algorithm=Algorithm.TANGENT_BUG,
        bumpers=Bumpers(safety_distance=S),
        speed_limits=SpeedLimits(0.6, 1.5),
    )
    return TangentBug(goals, settings)


def shortest(shape: shapely.Polygon, *ends: tuple[float, float]) -> float:
    """The length of a string around a convex shape, kept at the safety distance."""
    grown = shape.buffer(S)
    hull = shapely.convex_hull(shapely.union(grown, shapely.MultiPoint(ends)))
    ring = hull.exterior
    one, other = (ring.project(shapely.Point(end)) for end in ends)
    way = abs(one - other)
    return float(min(way, ring.length - way))


def test_path_around_a_box_is_nearly_the_shortest(flatland: World) -> None:
    world = flatland(BOX, at=Pose2(-6.0, 0.0))
    navigator = tangent_bug((6.0, 0.2))
    world.run(navigator)
    assert navigator.activity is Activity.REACHED
    assert world.length <= 1.05 * shortest(BOX, (-6.0, 0.0), (6.0, 0.2))
    assert world.nearest > S - 0.05
    assert navigator.hit_points == []


def test_goal_in_something_round_has_no_path(flatland: World) -> None:
    world = flatland(shapely.Point(3, 0).buffer(0.72), at=Pose2(-5.0, 0.0))
    navigator = tangent_bug((3.0, 0.1))
    world.run(navigator, steps=3000)
    assert navigator.activity is Activity.NO_PATH


@pytest.mark.slow
def test_robot_gets_out_of_a_trap(flatland: World) -> None:
    world = flatland(TRAP, at=Pose2(0.5, 0.2))
    navigator = tangent_bug((6.0, 0.0))
    world.run(navigator)
    assert navigator.activity is Activity.REACHED
    assert len(navigator.hit_points) == len(navigator.leave_points) >= 1
    assert world.nearest > S - 0.1


@pytest.mark.parametrize(
    ("start", "goal"),
    [
        pytest.param((-6.0, 0.3), (0.2, 0.1), id="goal inside"),
        pytest.param((0.1, 0.2), (6.0, 0.4), id="start inside", marks=pytest.mark.slow),
    ],
)
def test_no_path_is_told_after_a_circuit(
    flatland: World, start: tuple[float, float], goal: tuple[float, float]
) -> None:
    world = flatland(CELL, at=Pose2(*start, 1.0))
    navigator = tangent_bug(goal)
    world.run(navigator)
    assert navigator.activity is Activity.NO_PATH
    assert navigator.circuits == 1
    assert world.nearest > S - 0.1


def test_boundary_is_not_left_for_what_one_scan_shows(flatland: World) -> None:
    world = flatland(CELL, at=Pose2(-0.5, 0.3))
    navigator = tangent_bug((6.0, 0.4))
    for k in range(150):
        seen = world.scan()
        if k % 40 < 2:  # by beams that pass panes
            seen.ranges[:] = math.inf
        world.move(navigator.step(seen))
    assert len(navigator.hit_points) == 1
    assert not navigator.leave_points


def test_goals_are_reached_in_turn(flatland: World) -> None:
    world = flatland(BOX, at=Pose2(-4.0, -4.0))
    goals = [(-4.0, 4.0), (4.0, 4.0)]
    navigator = tangent_bug(*goals)
    world.run(navigator)
    assert navigator.activity is Activity.REACHED
    for goal in goals:
        assert min(math.dist((p.x, p.y), goal) for p in world.track) <= 0.15
    assert world.length == pytest.approx(16, abs=0.6)


def test_goals_are_required() -> None:
    with pytest.raises(ValueError, match="no goals"):
        tangent_bug()
