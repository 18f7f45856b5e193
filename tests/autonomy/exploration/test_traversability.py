"""Traversability of a mapped room of 12 by 8 m."""

import math
from dataclasses import replace

import numpy as np
import pytest
from flat_world import NOWHERE, ROOM, look

from radarsim.autonomy.exploration.traversability import TraversabilityMap
from radarsim.autonomy.mapping.occupancy_grid import OccupancyGrid
from radarsim.autonomy.mapping.scan import BeamHits, Layer
from radarsim.geometry import Floats, Pose2

SAFETY = 0.5
MIDDLE = Pose2(0.0, 2.0)


def seen(walls: Floats, *poses: Pose2, resolution: float = 0.05) -> OccupancyGrid:
    grid = OccupancyGrid(resolution)
    for pose in poses:
        for turn in np.linspace(0, math.radians(1), 4, endpoint=False):
            there = Pose2(pose.x, pose.y, pose.yaw + turn)
            grid.add(there, look(walls, there))
    return grid


@pytest.fixture(scope="module")
def floor() -> TraversabilityMap:
    return TraversabilityMap(seen(ROOM, MIDDLE), SAFETY)


def test_open_floor_keeps_the_safety_distance(floor: TraversabilityMap) -> None:
    nearest = 4.0 - SAFETY  # of the wall at y = 4
    assert floor.is_open(0.0, nearest - 0.15)
    assert not floor.is_open(0.0, nearest + 0.15)
    assert not floor.is_open(0.0, 99.0)


def test_short_cuts_cross_no_obstacle(floor: TraversabilityMap) -> None:
    assert floor.is_line_cheap(MIDDLE, -4.0, 2.0)
    assert not floor.is_line_cheap(MIDDLE, -4.6, -2.0)  # a box is between


def test_unknown_is_behind_things_and_walls(floor: TraversabilityMap) -> None:
    across, up = floor.tile_centers()
    for x, y, due in [
        (4.5, 0.0, True),
        (0.0, 4.5, True),
        (-5.0, 3.0, False),
        (6.5, 0.0, True),
    ]:
        row, column = np.abs(up - y).argmin(), np.abs(across - x).argmin()
        assert floor.unknown[row, column] == due


def test_frontiers_are_where_the_unknown_begins(floor: TraversabilityMap) -> None:
    rows, columns = np.nonzero(floor.frontiers)
    across, up = floor.tile_centers()
    assert len(rows) > 10
    assert (up[rows] < 1.6).all()  # the boxes are in the south
    assert (np.abs(across[columns]) < 6).all()


def test_no_path_through_walls_or_from_outside_the_map(
    floor: TraversabilityMap,
) -> None:
    outside = floor.disc(0.0, 6.0, 1.0)
    assert not floor.find_path(MIDDLE, outside)
    assert not floor.find_path(Pose2(99.0, 0.0), floor.frontiers)
    assert not floor.reachable(Pose2(99.0, 0.0)).any()


def test_robot_too_near_to_something_may_leave(floor: TraversabilityMap) -> None:
    near = Pose2(0.0, 3.75)
    assert not floor.is_open(near.x, near.y)
    path = floor.find_path(near, floor.disc(0.0, 1.0, 0.3))
    assert path
    assert path[0][1] == pytest.approx(3.75, abs=0.1)
    assert floor.reachable(near)[floor.disc(0.0, 1.0, 0.3)].all()


def test_outer_boundary_excludes_islands() -> None:
    corners = [Pose2(x, y) for x in (-5, 0, 5) for y in (-3, 3)]
    floor = TraversabilityMap(seen(ROOM, *corners), SAFETY)
    outer_boundary = floor.outer_boundary(floor.reachable(MIDDLE))
    assert outer_boundary.any()
    assert not (outer_boundary & floor.disc(2.0, 1.0, 1.5)).any()
    for side in [(5.2, 0), (-5.2, 0), (0, 3.2), (4.0, -3.2)]:
        assert (outer_boundary & floor.disc(*side, 0.3)).any()


def test_floor_is_unvisited_where_it_was_seen_from_afar() -> None:
    floor = TraversabilityMap(seen(ROOM, Pose2(-4.0, 1.0)), SAFETY)
    assert not (floor.unvisited & floor.disc(-4.0, 1.0, 2.8)).any()
    assert (floor.unvisited & floor.disc(4.0, 2.0, 0.5)).any()
    assert floor.area(floor.disc(0.0, 0.0, 1.0)) == pytest.approx(math.pi, rel=0.05)


@pytest.mark.parametrize("resolution", [0.03, 0.1, 0.25])
def test_cells_of_any_size_give_the_same_floor(resolution: float) -> None:
    floor = TraversabilityMap(seen(ROOM, MIDDLE, resolution=resolution), SAFETY)
    assert floor.is_open(-3.0, 2.0)
    assert not floor.is_open(2.0, -0.2 + 1.0)  # next to a box
    assert floor.find_path(MIDDLE, floor.disc(-4.0, 2.0, 0.3))


def test_foliage_keeps_a_robot_out_though_beams_get_in() -> None:
    scan = look(NOWHERE, Pose2(0.0, 0.0))
    beams = np.arange(170, 191)
    here, there = np.full(len(beams), 2.0), np.full(len(beams), 3.0)
    layers = np.full(len(beams), Layer.FOLIAGE, np.int8)
    hits = BeamHits(beams, here, there, layers)
    scan = replace(scan, hits=hits, sees_through=True)
    grid = OccupancyGrid()
    grid.add(Pose2(0.0, 0.0), scan)
    floor = TraversabilityMap(grid, SAFETY)
    assert floor.is_open(1.2, 0.0)
    assert not floor.is_open(1.6, 0.0)
    assert not floor.is_open(2.5, 0.0)
    assert floor.is_open(4.0, 0.0)  # sensed, and drivable for whoever gets there
