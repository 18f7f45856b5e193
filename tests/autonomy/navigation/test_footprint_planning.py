"""Paths of a rectangle: closed forms, and no motion that overlaps what was seen."""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from radarsim.autonomy.navigation.footprint_planning import (
    LEAST_MARGIN,
    Footprint,
    plan_footprint,
)
from radarsim.engine import engine
from radarsim.geometry import Floats, Pose2

HULL = Footprint(0.552, 0.497)
WIDTH = HULL.width + 2 * LEAST_MARGIN
ROUNDED = 0.01  # m by which places of points are in error
CELL = 0.05  # m between two tracks side by side


def line(*ends: tuple[float, float]) -> Floats:
    """Return points on the lines from end to end, a centimetre apart, (N, 2) m."""
    parts = [
        np.linspace(a, b, 2 + int(math.dist(a, b) / 0.01)) for a, b in pairwise(ends)
    ]
    return np.concatenate(parts)


def room_with_gap(low: float, high: float) -> Floats:
    """Return a room of 6 x 3 m, parted by a wall with a gap at x = 0."""
    walls = line((-3, -1.5), (3, -1.5), (3, 1.5), (-3, 1.5), (-3, -1.5))
    return np.vstack([walls, line((0, -1.5), (0, low)), line((0, high), (0, 1.5))])


def swept(path: Floats) -> list[shapely.Geometry]:
    """Return what the footprint covers in each motion of a path."""
    half, aside = HULL.length / 2, HULL.width / 2
    corners = np.array([(half, aside), (half, -aside), (-half, -aside)])
    corners = np.vstack([corners, [(-half, aside)]])
    areas = []
    for begin, end in pairwise(path):
        turn = math.remainder(end[2] - begin[2], 2 * math.pi)
        footprints = []
        for share in np.linspace(0, 1, 60):
            x, y = begin[:2] + share * (end[:2] - begin[:2])
            yaw = begin[2] + share * turn
            c, s = math.cos(yaw), math.sin(yaw)
            turned = corners @ np.array([[c, s], [-s, c]]) + (x, y)
            footprints.append(shapely.Polygon(turned))
        areas.append(shapely.union_all(footprints))
    return areas


def check(path: Floats, points: Floats, least: float) -> None:
    """Check that a path is of motions that a robot can make, and how near they lead."""
    for begin, end in pairwise(path):
        way = end[:2] - begin[:2]
        if way.any():
            assert begin[2] == end[2]
            aside = way @ (-math.sin(end[2]), math.cos(end[2]))
            assert abs(aside) < 1e-6
    places = shapely.multipoints(points)
    assert min(area.distance(places) for area in swept(path)) > least


@pytest.mark.parametrize("yaw", [0.0, 0.7, math.pi])
@pytest.mark.parametrize(
    ("gap", "is_wide"),
    [
        pytest.param(WIDTH + 2 * ROUNDED + CELL, True, id="wide enough"),
        pytest.param(WIDTH - 2 * ROUNDED, False, id="too narrow"),
        pytest.param(2 * HULL.radius, True, id="too narrow for a disc"),
    ],
)
def test_gap_is_passed_if_the_hull_and_its_margins_fit_in(
    gap: float, is_wide: bool, yaw: float
) -> None:
    points = room_with_gap(0.2 - gap / 2, 0.2 + gap / 2)
    path = plan_footprint(HULL, points, Pose2(-1.5, -0.3, yaw), (1.5, 0.1))
    assert (path is not None) is is_wide
    if path is not None:
        assert path[0] == pytest.approx([-1.5, -0.3, yaw])
        assert path[-1, :2] == pytest.approx([1.5, 0.1])
        check(path, points, LEAST_MARGIN - ROUNDED)


def two_rooms(wide: float) -> Floats:
    """Return a room on the left and one above, joined by a corridor with a corner."""
    return np.vstack(
        [
            line((-3, 0), (wide, 0), (wide, 3), (2, 3), (2, 6), (-1, 6), (-1, 3)),
            line((-1, 3), (0, 3), (0, wide), (-3, wide), (-3, 2), (-5, 2), (-5, -2)),
            line((-5, -2), (-3, -2), (-3, 0)),
        ]
    )


def test_no_path_is_searched_where_the_hull_gets_through_but_not_around(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A search that finds no path visits all poses, which takes seconds."""
    monkeypatch.setattr(engine, "search_states", None)
    start, goal = Pose2(-4.0, 0.0, 0.0), (0.5, 4.5)
    assert plan_footprint(HULL, two_rooms(0.62), start, goal) is None


def test_corridor_with_a_corner_that_no_disc_passes_is_passed() -> None:
    wide = 0.72
    assert wide < 2 * HULL.radius
    points = two_rooms(wide)
    path = plan_footprint(HULL, points, Pose2(-4.0, 0.0, 1.0), (0.5, 4.5))
    assert path is not None
    check(path, points, LEAST_MARGIN - ROUNDED)


def test_dead_end_in_which_it_cannot_turn_is_left_backward() -> None:
    wide = 0.65
    points = line((-1, 0), (2, 0), (2, wide), (-1, wide))
    path = plan_footprint(HULL, points, Pose2(1.4, wide / 2), (-3.0, wide / 2))
    assert path is not None
    assert path[1, 0] < path[0, 0]
    assert path[1, 2] == path[0, 2] == 0
    check(path, points, LEAST_MARGIN - ROUNDED)


def test_path_keeps_farther_away_where_there_is_room() -> None:
    points = line((-2, 0.5), (2, 0.5))
    path = plan_footprint(HULL, points, Pose2(-3.0, 0.5), (3.0, 0.3))
    assert path is not None
    check(path, points, 0.08)
    ways = np.hypot(*np.diff(path[:, :2], axis=0).T)
    assert ways.sum() < 6.3


@pytest.mark.slow
@given(
    places=st.lists(
        st.tuples(st.floats(-1.6, 1.6), st.floats(-1.2, 1.2)), min_size=1, max_size=12
    ),
    yaw=st.floats(-3, 3),
)
def test_no_motion_overlaps_what_was_seen(
    places: list[tuple[float, float]], yaw: float
) -> None:
    points = np.vstack([places, room_with_gap(1.5, 1.5)[:1800]])
    points = points[np.hypot(*(points - (-2.2, 0.0)).T) > HULL.radius + LEAST_MARGIN]
    path = plan_footprint(HULL, points, Pose2(-2.2, 0.0, yaw), (2.2, 0.0))
    if path is not None:
        check(path, points, LEAST_MARGIN - ROUNDED)


def test_start_nearer_than_the_margin_is_left_and_not_approached() -> None:
    aside = HULL.width / 2 + 0.005
    points = line((-1, aside), (1, aside))
    path = plan_footprint(HULL, points, Pose2(0.0, 0.0), (3.0, -1.0))
    assert path is not None
    check(path, points, 0.004)


def test_closed_room_has_no_path() -> None:
    points = room_with_gap(0.0, 0.0)
    assert plan_footprint(HULL, points, Pose2(-1.5, 0.0), (1.5, 0.0)) is None
