"""Worlds in BARN's form: the rules by which the benchmark drew its own."""

import numpy as np
import pytest

from radarsim.generators.barn_worlds import (
    CELL,
    COLUMNS,
    GOAL,
    RADIUS,
    ROWS,
    START,
    BarnWorld,
    make_barn_world,
)

FIELD = slice(34, 64)
NUMBERS = [0, 4, 11, 17]


@pytest.fixture(params=NUMBERS, scope="module")
def world(request: pytest.FixtureRequest) -> BarnWorld:
    return make_barn_world(request.param)


def test_same_number_gives_the_same_world() -> None:
    one, other = make_barn_world(5), make_barn_world(5)
    assert one.as_sdf() == other.as_sdf()
    assert (one.path == other.path).all()
    assert make_barn_world(6).as_sdf() != one.as_sdf()


def test_yard_is_walled_on_three_sides(world: BarnWorld) -> None:
    assert world.grid.shape == (ROWS, COLUMNS)
    assert world.grid[[0, -1], :34].all()
    assert world.grid[:, 0].all()
    assert not world.grid[1:-1, 1:34].any()
    assert not world.grid[:, 64:].any()


def test_fields_are_walled_and_filled_by_their_share(world: BarnWorld) -> None:
    shares = [make_barn_world(number).grid[1:-1, FIELD].mean() for number in (0, 9)]
    assert shares[0] < 0.1 < shares[1]
    assert world.grid[[0, -1], FIELD].all()


def test_path_is_free_for_the_robot_of_the_benchmark(world: BarnWorld) -> None:
    field, path = world.grid[:, FIELD], world.path
    assert (path[0, 1], path[-1, 1]) == (0, 29)
    assert np.abs(np.diff(path, axis=0)).max() == 1
    for row, column in path:
        around = field[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
        assert not around.any()


def test_cylinders_are_those_that_something_may_meet(world: BarnWorld) -> None:
    centres = world.centres()
    cells = np.rint((centres - (-4.425, 0.075)) / CELL).astype(np.int64)
    assert world.grid[tuple(cells.T)].all()
    padded = np.pad(world.grid, 1)
    hidden = np.argwhere(world.grid)
    shown = {tuple(cell) for cell in cells.tolist()}
    for row, column in hidden.tolist():
        is_amid = bool(padded[row : row + 3, column : column + 3].all())
        assert is_amid != ((row, column) in shown)
    away = np.hypot(*(centres - START).T), np.hypot(*(centres - GOAL).T)
    assert min(each.min() for each in away) - RADIUS > 1.0
