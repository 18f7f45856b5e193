import math

import numpy as np
import pytest
import shapely
from flatland import flatland, navigator
from hypothesis import given
from hypothesis import strategies as st

from radarsim.autonomy.navigation.controller import Activity
from radarsim.autonomy.navigation.open_directions import OpenDirections
from radarsim.autonomy.navigation.tangent_bug import crosses_any, ways_to_goal
from radarsim.autonomy.plans import Algorithm
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


R = 0.6
coordinates = st.floats(-10, 10, allow_subnormal=False)
segments = st.tuples(*[coordinates] * 4)


@given(segment=segments, walls=st.lists(segments, min_size=1, max_size=5))
def test_segments_cross_walls_as_shapely_computes(
    segment: tuple[float, ...], walls: list[tuple[float, ...]]
) -> None:
    line = shapely.LineString([segment[:2], segment[2:]])
    others = [shapely.LineString([wall[:2], wall[2:]]) for wall in walls]
    ends = np.array(walls)
    crossed = crosses_any(
        np.array([segment[:2]]), np.array([segment[2:]]), (ends[:, :2], ends[:, 2:])
    )
    inside = any(
        line.crosses(other) and not line.touches(other.boundary) for other in others
    )
    apart = all(line.distance(other) > 1e-9 for other in others)
    if apart:
        assert not crossed[0]
    elif inside and all(_is_clear(line, other) for other in others):
        assert crossed[0]


def _is_clear(line: shapely.LineString, other: shapely.LineString) -> bool:
    """Return whether no end of one of two lines is almost on the other."""
    ends = [shapely.Point(p) for p in (*line.coords, *other.coords)]
    distances = [ends[0].distance(other), ends[1].distance(other)]
    distances += [ends[2].distance(line), ends[3].distance(line)]
    return all(float(distance) > 1e-6 for distance in distances)


def test_way_leads_around_a_wall_that_is_seen() -> None:
    wall = shapely.box(3, -4, 3.2, 2)
    directions = OpenDirections(flatland(wall, at=Pose2(0.0, 0.0)).scan(), R)
    edges = directions.edges()
    upper, lower = edges[edges[:, 1].argmax()], edges[edges[:, 1].argmin()]
    goal = (2.9, -1.0)  # behind the thin wall that the robot's disc would touch
    ways = ways_to_goal(np.array([upper, lower]), goal, directions)
    assert ways == pytest.approx([math.dist(upper, goal), math.dist(lower, goal)])
    before = (-1.0, -1.0)
    across = ways_to_goal(np.array([before, upper, lower]), goal, directions)
    to = [math.dist(before, edge) + math.dist(edge, goal) for edge in (upper, lower)]
    assert across[0] == pytest.approx(min(to), abs=0.05)


def test_no_way_leads_out_of_a_closed_room() -> None:
    room = shapely.box(-3, -3, 3, 3).difference(shapely.box(-2.9, -2.9, 2.9, 2.9))
    directions = OpenDirections(flatland(room, at=Pose2(0.3, 0.2)).scan(), R)
    ways = ways_to_goal(np.array([[0.0, 1.0], [1.0, 0.0]]), (6.0, 0.0), directions)
    assert np.isinf(ways).all()


def test_blocks_of_segments_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    begins, ends, *walls = rng.uniform(-5, 5, (4, 30, 2))
    whole = crosses_any(begins, ends, (walls[0], walls[1]))
    assert 0 < whole.sum() <= 30
    monkeypatch.setattr("radarsim.autonomy.navigation.tangent_bug.MOST_PAIRS", 100)
    assert (crosses_any(begins, ends, (walls[0], walls[1])) == whole).all()
