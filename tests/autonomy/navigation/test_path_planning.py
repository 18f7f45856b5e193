"""Paths that are planned on the cells seen so far."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from flatland import flatland, navigator

from radarsim.autonomy.navigation.controller import Activity
from radarsim.autonomy.navigation.grid_search import may_join_outside, step_cost
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.obstacle_grid import ObstacleGrid
from radarsim.autonomy.plans import Algorithm
from radarsim.errors import NavigationError
from radarsim.geometry import Pose2

S = 0.5
BOX = shapely.box(-1.5, -2, 1.5, 2.5)
TRAP = shapely.box(-1.5, -2, 1, 2).difference(shapely.box(-4, -1.9, 0.9, 1.9))


@pytest.mark.parametrize(
    ("algorithm", "shape", "longest"),
    [
        (Algorithm.TANGENT_BUG, BOX, 1.05),
        pytest.param(Algorithm.PLANNED, BOX, 1.15, marks=pytest.mark.slow),
        pytest.param(Algorithm.PLANNED, TRAP, 1.15, id="trap"),
    ],
)
def test_path_is_little_longer_than_the_shortest(
    algorithm: Algorithm, shape: shapely.Polygon, longest: float
) -> None:
    """A string around a convex shape, kept at the safety distance."""
    world = flatland(shape, at=Pose2(-6.0, 0.0))
    driven = navigator(algorithm, (6.0, 0.2))
    world.run(driven)
    assert driven.activity is Activity.REACHED
    assert driven.hit_points == []
    assert world.nearest > S - (0.05 if algorithm is Algorithm.TANGENT_BUG else 0.1)
    ends = shapely.LineString([(-6, 0), (6, 0.2)])
    grown = shape.convex_hull.buffer(S)
    hull = shapely.union(grown, ends).convex_hull.exterior
    around = [hull.project(shapely.Point(*end)) for end in ends.coords]
    half = abs(around[1] - around[0])
    assert world.length <= longest * min(half, hull.length - half)


def test_what_is_only_seen_from_afar_closes_no_way() -> None:
    # As an image in a pane: who comes near sees that nothing is there.
    ring = shapely.box(-3, -3, 3, 3).difference(shapely.box(-2.9, -2.9, 2.9, 2.9))
    image, world = flatland(ring, at=Pose2(0.0, 0.3)), flatland(at=Pose2(0.0, 0.3))
    planned = navigator(Algorithm.PLANNED, (6.0, 0.1))
    for _ in range(1000):
        image.pose, image.track = world.pose, world.track
        scan = image.scan()
        far = np.where(scan.ranges < 1.4, math.inf, scan.ranges)
        world.move(planned.step(replace(scan, ranges=far)))
        if planned.is_done:
            break
    assert planned.activity is Activity.REACHED


def test_goal_too_far_for_a_grid_is_refused() -> None:
    with pytest.raises(NavigationError, match="grid of 9016 by 9016 m"):
        ObstacleGrid([(0.0, 0.0), (9000.0, 9000.0)])


@pytest.mark.slow
def test_way_around_a_wall_longer_than_the_grid_is_found() -> None:
    wall = shapely.box(1.5, -9.5, 1.7, 30)
    world = flatland(wall, at=Pose2(0.0, 0.0))
    world.bearings = np.radians(np.arange(360.0) - 180)  # the wall is long
    planned = navigator(Algorithm.PLANNED, (3.2, 0.0))
    world.run(planned, steps=3000)
    assert planned.activity is Activity.REACHED
    assert world.length < 1.2 * shapely.LineString([(0, 0), (1.6, -10)]).length * 2
    assert world.nearest > 0.4


def test_what_is_seen_behind_something_thin_is_on_the_grid() -> None:
    grid, bearings = ObstacleGrid([(0.0, 0.0), (4.0, 0.0)]), np.zeros(1)
    behind = np.array([[0.0, 3.0]])
    grid.add(Observation(0.0, Pose2(0.0, 0.0), bearings, np.full(1, 2.0), behind))
    cost = step_cost(grid.clearance(), 0.3)
    assert math.isinf(cost[grid.cell((2.0, 0.0))])
    assert math.isinf(cost[grid.cell((3.0, 0.0))])
    assert cost[grid.cell((1.0, 0.0))] == 1


def test_what_has_driven_away_is_forgotten() -> None:
    grid, bearings = ObstacleGrid([(0.0, 0.0), (4.0, 0.0)]), np.zeros(1)
    for length in (2.0, *[4.003] * 3):
        pose = Pose2(0.0, 0.0)
        grid.add(Observation(0.0, pose, bearings, np.full(1, length)))
    assert grid.points == pytest.approx(np.array([[4.003, 0.0]]))
    assert cost_is_open(grid, (2.0, 0.0))
    assert not cost_is_open(grid, (4.0, 0.0))


@pytest.mark.parametrize(
    ("distance", "pause", "is_closed"),
    [(1.0, 8.0, True), (1.0, 1.0, False), (3.0, 8.0, False)],
)
def test_cell_that_is_closed_a_third_time_stays_closed(
    distance: float, pause: float, is_closed: bool
) -> None:
    grid, bearings = ObstacleGrid([(0.0, 0.0), (4.0, 0.0)]), np.zeros(1)
    here, wall = np.array([distance]), np.array([6.0])
    for time in np.arange(6) * pause:
        for ranges in (here, here, wall, wall, wall):  # through a pane
            grid.add(Observation(time, Pose2(0.0, 0.0), bearings, ranges))
    grid.grow()
    grid.add(Observation(99.0, Pose2(0.0, 0.0), bearings, wall))
    assert (grid.clearance()[grid.cell((distance, 0.0))] == 0) == is_closed


def test_cell_beside_one_that_stays_closed_stays_closed_at_once() -> None:
    grid, bearings = ObstacleGrid([(0.0, 0.0), (4.0, 0.0)]), np.zeros(1)
    for time, distance in enumerate([0.8, 0.8, 0.8, 1.0, 1.4]):
        for length in (*[distance] * 4, *[6.0] * 6):
            seen = np.array([length])
            grid.add(Observation(8.0 * time, Pose2(0.0, 0.0), bearings, seen))
    closed = [grid.clearance()[grid.cell((x, 0.0))] == 0 for x in (0.8, 1.0, 1.4)]
    assert closed == [True, True, False]


def test_grid_keeps_what_it_has_seen_when_it_grows() -> None:
    grid = ObstacleGrid([(0.0, 0.0), (4.0, 0.0)])
    grid.add(Observation(0.0, Pose2(0.0, 0.0), np.zeros(1), np.full(1, 2.0)))
    shape = step_cost(grid.clearance(), 0.3).shape
    far = grid.cell((0.0, -12.0))
    grid.grow()
    assert np.array(step_cost(grid.clearance(), 0.3).shape).tolist() == [
        n + 160 for n in shape
    ]
    assert not cost_is_open(grid, (2.0, 0.0))
    assert grid.cell((0.0, -12.0)) != far
    assert grid.centres(np.array([grid.cell((0.0, -12.0))]))[0] == pytest.approx(
        [0.0, -12.0], abs=0.051
    )


def test_only_what_is_open_to_the_border_may_be_joined_outside() -> None:
    rows, columns = np.indices((20, 30))
    wall = columns == 15
    assert may_join_outside(~wall, (10, 5), (10, 25))
    # a larger grid opens no way to closed cells, and none is needed without the wall
    assert not may_join_outside(~wall, (10, 5), (10, 15))
    assert not may_join_outside(~wall, (10, 5), (15, 10))
    ring = np.maximum(abs(rows - 10), abs(columns - 22)) == 3
    assert not may_join_outside(~ring, (10, 5), (10, 22))
    assert not may_join_outside(~ring, (10, 22), (10, 5))


def cost_is_open(grid: ObstacleGrid, point: tuple[float, float]) -> bool:
    return bool(np.isfinite(step_cost(grid.clearance(), 0.3)[grid.cell(point)]))


def test_pole_stays_though_beams_pass_beside_it() -> None:
    """A pole of 5 cm is met by every fourth scan of beams 2 degrees apart."""
    grid = ObstacleGrid([(0.0, 0.0), (6.0, 0.0)])
    for k in range(60):
        y = 0.013 * k
        bearing = np.radians(np.arange(-10.0, 10.0, 2.0))
        # the distance of the pole's axis from each beam
        off = 6.0 * np.sin(bearing) + y * np.cos(bearing)
        ranges = np.where(np.abs(off) < 0.025, 6.0 * np.cos(bearing), np.inf)
        grid.add(Observation(0.5 * k, Pose2(0.0, y), bearing, ranges))
        if k > 20:
            assert grid.clearance()[grid.cell((6.0, 0.0))] < 0.15


def test_who_waited_has_not_looked_for_a_path_meanwhile() -> None:
    # So small that all of it is near enough to be no image.
    cell = shapely.box(-1, -1, 1, 1).difference(shapely.box(-0.9, -0.9, 0.9, 0.9))
    world = flatland(cell, at=Pose2(0.1, 0.2))
    planned, seen = navigator(Algorithm.PLANNED, (6.0, 0.4)), world.scan()
    reported = []
    for time in (0.0, 20.0, *np.arange(20.5, 25.1, 0.5)):
        planned.step(replace(seen, time=float(time)))
        reported.append(planned.activity is Activity.NO_PATH)
    assert not any(reported[:-1])
    assert reported[-1]
