"""Frames of grids, and occupancy grids that scans are added to."""

import math
from dataclasses import replace

import numpy as np
import pytest
from flat_world import NOWHERE, ROOM, look, look_through
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from radarsim.autonomy.mapping.occupancy_grid import (
    GROWTH_STEP,
    SHORT_RANGE,
    CellClass,
    GridFrame,
    OccupancyGrid,
    distance_field,
)
from radarsim.autonomy.mapping.scan import PlanarScan, read_scan
from radarsim.errors import MappingError
from radarsim.geometry import Floats, Pose2
from radarsim.protocol.reports import RangeScan
from radarsim.rng import generator_for

SIZE = 0.05
metres = st.floats(-40, 40)
points = st.tuples(metres, metres)


def frame_of(*places: tuple[float, float]) -> GridFrame:
    frame = GridFrame(SIZE)
    for place in places:
        frame = frame.extended_to(place, place)
    return frame


@given(places=st.lists(points, min_size=1, max_size=6), place=points)
def test_frame_is_unchanged_if_it_contains_the_box(
    places: list[tuple[float, float]], place: tuple[float, float]
) -> None:
    frame = frame_of(*places, place)
    assert frame.extended_to(place, place) == frame


@given(place=points)
def test_cell_centers_are_in_their_cells(place: tuple[float, float]) -> None:
    frame = frame_of(place)
    x, y = frame.cell_centers()
    row, column = frame.cell(*place) or (-1, -1)
    assert abs(x[column] - place[0]) <= SIZE / 2 + 1e-9
    assert abs(y[row] - place[1]) <= SIZE / 2 + 1e-9
    assert frame.origin == pytest.approx((x[0] - SIZE / 2, y[0] - SIZE / 2))


def test_frame_grows_in_steps_of_many_cells() -> None:
    frame = frame_of((0.0, 0.0))
    assert frame.shape == (GROWTH_STEP, GROWTH_STEP)
    assert frame.extended_to((-0.01, 0), (0, 0)).shape == (GROWTH_STEP, 2 * GROWTH_STEP)


def test_position_outside_has_no_cell() -> None:
    assert GridFrame(SIZE).cell(0, 0) is None
    assert frame_of((0.0, 0.0)).cell(-0.01, 0) is None


@pytest.mark.parametrize("far", [1e4, math.inf, math.nan])
def test_position_too_far_away_is_an_error(far: float) -> None:
    with pytest.raises((MappingError, ValueError, OverflowError)):
        GridFrame(SIZE).extended_to((0.0, 0.0), (far, 0.0))


def test_area_too_large_is_an_error() -> None:
    side = SIZE * 8000
    frame = GridFrame(SIZE).extended_to((0.0, 0.0), (side, side))
    assert frame.shape > (8000, 8000)
    with pytest.raises(MappingError, match=r"in cells of 0\.\d+ m, expected at most"):
        frame.extended_to((-side, 0.0), (0.0, 0.0))


HERE = Pose2(1.0, -0.5, 0.4)
MAX_RANGE = 20.0
places = st.floats(-7, 7)


def grid_of(*scans: PlanarScan, pose: Pose2 | None = None) -> OccupancyGrid:
    grid = OccupancyGrid()
    for scan in scans:
        grid.add(pose or Pose2(0.0, 0.0), scan)
    return grid


def class_at(grid: OccupancyGrid, x: float, y: float) -> int:
    cell = grid.frame.cell(x, y)
    return CellClass.UNKNOWN if cell is None else int(grid.classes()[cell])


@pytest.fixture(scope="module")
def mapped() -> OccupancyGrid:
    return grid_of(look(ROOM, HERE), pose=HERE)


def test_empty_map_is_unknown() -> None:
    grid = OccupancyGrid()
    assert not grid.sensed(0.0, 0.0)
    assert not grid.drivable(0.0, 0.0, 0.5)
    assert grid.classes().size == 0


def test_room_is_free_inside_and_unknown_behind_its_walls(
    mapped: OccupancyGrid,
) -> None:
    assert class_at(mapped, 1.0, -1.0) == CellClass.FREE
    assert class_at(mapped, -5.0, 3.0) == CellClass.FREE
    assert class_at(mapped, 6.5, 0.0) == CellClass.UNKNOWN
    assert class_at(mapped, 2.0, 1.0) == CellClass.UNKNOWN  # in a box
    assert class_at(mapped, 2.9, 2.5) == CellClass.UNKNOWN  # in its shadow


def test_walls_are_where_beams_end(mapped: OccupancyGrid) -> None:
    ends, _ = look(ROOM, HERE).points()
    c, s = math.cos(HERE.yaw), math.sin(HERE.yaw)
    placed = ends @ np.array([[c, s], [-s, c]]) + (HERE.x, HERE.y)
    middles_x, middles_y = mapped.frame.cell_centers()
    rows, columns = np.nonzero(mapped.classes() == CellClass.OBSTACLE)
    x, y = middles_x[columns], middles_y[rows]
    apart = np.hypot(placed[:, :1] - x, placed[:, 1:] - y)
    assert apart.min(axis=0).max() <= 0.05 * math.sqrt(0.5) + 1e-9
    assert apart.min(axis=1).max() <= 0.05 * math.sqrt(0.5) + 1e-9


def test_beams_begin_at_the_mount() -> None:
    relative_to = Pose2(1.0, 0.0, 0.9)
    scan = look(ROOM, relative_to)
    mount = Pose2(0.2, 0.1, 0.5)
    moved = replace(scan, mount=mount)
    c, s = math.cos(0.4), math.sin(0.4)
    body = Pose2(1.0 - (0.2 * c - 0.1 * s), -(0.2 * s + 0.1 * c), 0.4)
    one = grid_of(scan, pose=relative_to)
    other = grid_of(moved, pose=body)
    assert one.frame == other.frame
    assert (one.classes() != other.classes()).mean() < 1e-3  # rounding at borders


def test_foliage_is_sensed_and_not_drivable() -> None:
    grid = grid_of(look_through(2.0, 3.0, 6.0))
    assert class_at(grid, 2.5, 0.0) == CellClass.FOLIAGE
    assert grid.sensed(2.5, 0.0)
    assert not grid.drivable(2.5, 0.0, 0.0)
    assert class_at(grid, 4.5, 0.0) == CellClass.FREE
    assert class_at(grid, 6.0, 0.0) == CellClass.OBSTACLE


def test_smoke_is_sensed_and_drivable() -> None:
    grid = grid_of(look_through(2.0, 3.0, 6.0, passes=True))
    assert class_at(grid, 2.5, 0.0) == CellClass.SMOKE
    assert grid.drivable(2.5, 0.0, 0.3)


def test_spent_beam_leaves_a_beam_end_and_no_obstacle() -> None:
    grid = grid_of(look_through(2.0, 3.5, None))
    assert class_at(grid, 3.49, 0.0) == CellClass.FOLIAGE
    assert class_at(grid, 3.7, 0.0) == CellClass.UNKNOWN
    cell = grid.frame.cell(3.5, 0.0)
    assert cell is not None
    assert grid.beam_end_cells()[cell]


@given(x=places, y=places, safety=st.floats(0, 1))
def test_drivable_cells_are_sensed_and_far_from_obstacles(
    mapped: OccupancyGrid, x: float, y: float, safety: float
) -> None:
    cell = mapped.frame.cell(x, y)
    expected = False
    if cell is not None:
        rows, columns = np.nonzero(mapped.blocked_cells())
        apart = np.hypot(rows - cell[0], columns - cell[1]) * 0.05
        expected = mapped.sensed(x, y) and apart.min() > safety
    assert mapped.drivable(x, y, safety) == expected


def test_beams_without_return_clear_up_to_their_limit() -> None:
    grid = grid_of(look(NOWHERE, HERE), pose=HERE)
    bearing = HERE.yaw + math.radians(0.5)
    for away in (0.1, 10.0, 29.9):
        x = HERE.x + away * math.cos(bearing)
        assert grid.sensed(x, HERE.y + away * math.sin(bearing))
    assert not (grid.classes() == CellClass.OBSTACLE).any()
    assert not grid.beam_end_cells().any()


def test_map_does_not_depend_on_the_order_of_growth() -> None:
    poses = [Pose2(-5.0, -3.0, 0.0), HERE, Pose2(5.0, 3.0, 2.0)]
    open_side = np.array([[[-6.5, -6.5], [6.5, -6.5]]])
    seen = [look(ROOM, poses[0]), look(open_side, poses[1]), look(ROOM, poses[2])]
    one, other = OccupancyGrid(), OccupancyGrid()
    for pose, scan in zip(poses, seen, strict=True):
        one.add(pose, scan)
    for pose, scan in zip(reversed(poses), reversed(seen), strict=True):
        other.add(pose, scan)
    assert one.frame == other.frame
    assert (one.classes() == other.classes()).all()


def test_near_cells_are_within_the_short_range() -> None:
    grid = OccupancyGrid()
    grid.add(HERE, look(NOWHERE, HERE))
    x, y = grid.frame.cell_centers()
    away = np.hypot(x - HERE.x, y[:, None] - HERE.y)
    assert away[grid.short_range_cells()].max() <= SHORT_RANGE + 0.05
    assert grid.short_range_cells()[away < SHORT_RANGE - 0.1].mean() > 0.99


def test_occupancy_is_a_probability_where_cells_are_known() -> None:
    grid = grid_of(*[look_through(2.0, 3.0, 6.0)] * 4)
    occupancy_probability = grid.occupancy_probability()
    for x, low, high in [(1.0, 0.0, 0.4), (2.5, 0.9, 1.0), (6.0, 0.9, 1.0)]:
        cell = grid.frame.cell(x, 0.0)
        assert cell is not None
        assert low < occupancy_probability[cell] < high
    assert (
        np.isnan(occupancy_probability) == (grid.classes() == CellClass.UNKNOWN)
    ).all()


@pytest.mark.parametrize("angle", [math.nan, math.inf])
@pytest.mark.filterwarnings("ignore:invalid value")
def test_beam_without_a_direction_is_an_error(angle: float) -> None:
    report = RangeScan(0.0, "lms200", 0.1, angle, np.ones(3))
    with pytest.raises(ValueError, match="angles or ranges of beams"):
        OccupancyGrid().add(HERE, read_scan(report, max_range=9.0))


def expected_distances(cells: NDArray[np.bool_], reach: float) -> Floats:
    rows, columns = np.nonzero(cells)
    found = np.full(cells.shape, np.inf)
    for i, j in np.ndindex(*cells.shape):
        apart = np.hypot(rows - i, columns - j)
        found[i, j] = apart[apart <= reach].min(initial=np.inf)
    return found


@given(
    seed=st.integers(0, 10**6),
    share=st.sampled_from([0.0, 0.01, 0.1, 0.9]),
    reach=st.floats(0, 15),
    shape=st.tuples(st.integers(1, 25), st.integers(1, 25)),
)
def test_distance_field_holds_distances_to_the_nearest_cell(
    seed: int, share: float, reach: float, shape: tuple[int, int]
) -> None:
    cells = generator_for(seed, "cells").random(shape) < share
    assert distance_field(cells, reach) == pytest.approx(
        expected_distances(cells, reach)
    )


def test_all_distances_are_infinite_without_true_cells() -> None:
    assert distance_field(np.zeros((0, 0), np.bool_), 3.0).shape == (0, 0)
