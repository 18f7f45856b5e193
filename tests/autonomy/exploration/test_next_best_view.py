"""Where unknown area should be seen for a short way."""

import math

import numpy as np
import pytest

from radarsim.autonomy.exploration.next_best_view import RAYS, visible_area


def lone(shape: tuple[int, int], row: int, column: int) -> np.ndarray:
    tiles = np.zeros(shape, np.bool_)
    tiles[row, column] = True
    return tiles


@pytest.mark.parametrize("reach", [10, 20])
def test_in_the_open_a_disc_is_seen(reach: int) -> None:
    unknown, walls = np.ones((2, 61, 61), np.bool_)
    walls = ~walls
    (area,) = visible_area(unknown, walls, lone((61, 61), 30, 30), reach)
    assert area == pytest.approx(math.pi * reach**2, rel=0.12)


def test_outside_of_the_map_is_unknown() -> None:
    known = np.zeros((5, 5), np.bool_)
    (area,) = visible_area(known, known, lone((5, 5), 2, 2), 20)
    disc, inner = math.pi * 20**2, 25
    assert area == pytest.approx(disc - inner, rel=0.1)


def test_what_is_behind_a_wall_is_not_seen() -> None:
    unknown = np.zeros((61, 61), np.bool_)
    unknown[:, 40:] = True
    walls = np.zeros((61, 61), np.bool_)
    tiles = lone((61, 61), 30, 30)
    (open_area,) = visible_area(unknown, walls, tiles, 20)
    walls[:, 36] = True
    assert visible_area(unknown, walls, tiles, 20) == 0
    # through a door of 5 tiles, 6 tiles away: a sector of 2 atan(2.5 / 6)
    walls[28:33, 36] = False
    (through,) = visible_area(unknown, walls, tiles, 20)
    share = 2 * math.atan(2.5 / 6) * (20**2 - 10**2) / 2
    assert through == pytest.approx(share, rel=0.25)
    assert through < open_area


def test_each_place_is_told_in_the_order_of_its_tile() -> None:
    unknown = np.zeros((21, 61), np.bool_)
    unknown[:, 50:] = True
    walls = np.zeros_like(unknown)
    walls[0], walls[-1], walls[:, 0], walls[:, -1] = True, True, True, True
    tiles = lone((21, 61), 10, 10) | lone((21, 61), 10, 48)
    far, near = visible_area(unknown, walls, tiles, 30)
    assert far == 0
    assert 0 < near < 2 * 21 * 11
    assert RAYS >= 72
