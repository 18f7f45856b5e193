"""How far a disc can go, against the distance of a swept disc by shapely."""

import math

import numpy as np
import pytest
import shapely
from flatland import flatland

from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.open_directions import (
    HORIZON,
    MOST_DIRECTIONS,
    OpenDirections,
    leads_too_near,
)
from radarsim.geometry import Pose2

R = 0.6
POLE = shapely.Point(3.0, 0.0).buffer(0.5)
WALL = shapely.box(-4.0, 2.0, 6.0, 2.5)


def test_lengths_are_those_of_a_swept_disc() -> None:
    scan = flatland(POLE, WALL, at=Pose2(0.0, 0.0, 0.4)).scan()
    directions = OpenDirections(scan, R)
    grown = shapely.union(POLE, WALL).buffer(R)
    exact = np.full(len(directions.lengths), HORIZON)
    for i, bearing in enumerate(directions.bearings):
        far = HORIZON * np.array([math.cos(bearing + 0.4), math.sin(bearing + 0.4)])
        blocked = shapely.LineString([(0, 0), far]).intersection(grown)
        if not blocked.is_empty:
            exact[i] = blocked.distance(shapely.Point(0, 0))
    close = np.abs(directions.lengths - exact) < 0.1
    # a direction that grazes the end of something may miss it between two beams
    jumps = np.abs(np.diff(exact, append=exact[:1])) > 0.3
    aside = jumps | np.roll(jumps, 1) | np.roll(jumps, 2) | np.roll(jumps, -1)
    assert (close | aside).all()
    assert close.mean() > 0.95


def test_dense_scan_has_fewer_directions_but_all_its_points() -> None:
    """The way to a disc of 0.5 m, 3 m ahead, in closed form."""
    bearings = np.linspace(-math.pi, math.pi, 3600, endpoint=False)
    half = 0.25 - np.square(3 * np.sin(bearings))
    is_seen = (half > 0) & (np.cos(bearings) > 0)
    ranges = np.full(3600, math.inf)
    ranges[is_seen] = 3 * np.cos(bearings[is_seen]) - np.sqrt(half[is_seen])
    scan = Observation(0.0, Pose2(0.0, 0.0), bearings, ranges)
    directions = OpenDirections(scan, R)
    assert len(directions.bearings) == MOST_DIRECTIONS
    meets = np.abs(directions.bearings) < 0.95 * math.asin((0.5 + R) / 3)
    near = directions.bearings[meets]
    exact = 3 * np.cos(near) - np.sqrt((0.5 + R) ** 2 - np.square(3 * np.sin(near)))
    assert directions.lengths[meets] == pytest.approx(exact, abs=0.01)
    assert len(directions.edges()) == 2


def test_edges_are_beside_the_ends_of_what_is_seen() -> None:
    scan = flatland(POLE, at=Pose2(0.0, 0.0, -1.0)).scan()
    edges = OpenDirections(scan, R).edges()
    assert len(edges) == 2
    assert sorted(np.sign(edges[:, 1]).tolist()) == [-1, 1]
    for x, y in edges:
        assert POLE.distance(shapely.Point(x, y)) == pytest.approx(R, abs=0.3)


def test_place_behind_a_pole_is_not_reached_straight() -> None:
    directions = OpenDirections(flatland(POLE, at=Pose2(0.0, 0.0)).scan(), R)
    assert not directions.reaches((5.0, 0.0))
    assert directions.reaches((5.0, 5.0))


@pytest.mark.parametrize("limit", [4.5, 3.0, 1.0])
def test_place_nearer_than_a_limit_can_be_gone_to_straight(limit: float) -> None:
    scan = flatland(POLE, at=Pose2(0.0, 0.0)).scan()
    goal = (5.0, 1.0)
    place = OpenDirections(scan, R).place_nearer_than(limit, goal)
    assert place is not None
    assert math.dist(place, goal) < limit
    way = shapely.LineString([(0, 0), place])
    assert way.distance(POLE) > R - 0.05
    assert way.length + math.dist(place, goal) < _shortest_way(limit, goal) + 0.3


def _shortest_way(limit: float, goal: tuple[float, float]) -> float:
    """Search for the shortest way over a place that the disc reaches straight."""
    ways = []
    for angle in np.radians(np.arange(0, 360, 2)):
        for length in np.arange(0.1, HORIZON, 0.1):
            place = (length * math.cos(angle), length * math.sin(angle))
            if math.dist(place, goal) >= limit:
                continue
            if shapely.LineString([(0, 0), place]).distance(POLE) < R:
                break
            ways.append(length + math.dist(place, goal))
    return min(ways)


def test_there_may_be_no_place_nearer_than_a_limit() -> None:
    scan = flatland(POLE, WALL, at=Pose2(0.0, 0.0)).scan()
    behind = (0.0, 5.0)
    assert OpenDirections(scan, R).place_nearer_than(2.0, behind) is None


def test_walls_are_as_far_from_what_is_seen_as_the_disc() -> None:
    begins, ends = OpenDirections(flatland(POLE, at=Pose2(0.0, 0.0)).scan(), R).walls()
    assert len(begins) > 10
    for point in (*begins, *ends):
        assert POLE.distance(shapely.Point(point)) == pytest.approx(R, abs=0.05)


def test_wall_goes_out_of_sight_behind_a_pole() -> None:
    directions = OpenDirections(
        flatland(POLE, shapely.box(5, -9, 5.5, 9), at=Pose2(0.0, 0.0)).scan(), R
    )
    ends = directions.hidden_ends()
    assert len(ends) == 2
    assert ends[:, 0] == pytest.approx(5 - R, abs=0.1)
    # the directions that touch the pole
    reach = math.tan(math.asin((0.5 + R) / 3)) * (5 - R)
    assert np.sort(ends[:, 1]) == pytest.approx([-reach, reach], abs=0.2)


def test_post_beside_a_wall_is_no_edge_of_it() -> None:
    wall, post = shapely.box(3, -4, 3.2, 0), shapely.box(3, 1.0, 3.2, 1.2)
    directions = OpenDirections(flatland(wall, post, at=Pose2(0.0, 0.0)).scan(), R)
    edges = directions.edges()
    assert all(not -4 < y < 1.2 for _, y in edges)


def test_step_towards_something_near_leads_too_near() -> None:
    for yaw, expected in ((0.0, True), (math.pi, False)):
        scan = flatland(POLE, at=Pose2(1.98, 0.0, yaw)).scan()
        assert leads_too_near(scan, 0.5) == expected
