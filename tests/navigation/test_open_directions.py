"""How far a disc can go, against the distance of a swept disc by shapely."""

import math
from typing import Any, Protocol

import numpy as np
import pytest
import shapely

from radarsim.geometry import Pose2
from radarsim.navigation.open_directions import (
    HORIZON,
    OpenDirections,
    leads_too_near,
)

R = 0.6
POLE = shapely.Point(3.0, 0.0).buffer(0.5)
WALL = shapely.box(-4.0, 2.0, 6.0, 2.5)


class World(Protocol):
    """Makes a flat world of polygons, with the robot at a pose."""

    def __call__(self, *shapes: shapely.Polygon, at: Pose2) -> Any: ...


def test_lengths_are_those_of_a_swept_disc(flatland: World) -> None:
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
    beside = jumps | np.roll(jumps, 1) | np.roll(jumps, 2) | np.roll(jumps, -1)
    assert (close | beside).all()
    assert close.mean() > 0.95


def test_edges_are_beside_the_ends_of_what_is_seen(flatland: World) -> None:
    scan = flatland(POLE, at=Pose2(0.0, 0.0, -1.0)).scan()
    edges = OpenDirections(scan, R).edges()
    assert len(edges) == 2
    assert sorted(np.sign(edges[:, 1]).tolist()) == [-1, 1]
    for x, y in edges:
        assert POLE.distance(shapely.Point(x, y)) == pytest.approx(R, abs=0.3)


def test_place_behind_a_pole_is_not_reached_straight(flatland: World) -> None:
    directions = OpenDirections(flatland(POLE, at=Pose2(0.0, 0.0)).scan(), R)
    assert not directions.reaches((5.0, 0.0))
    assert directions.reaches((5.0, 5.0))
    x, y = directions.nearest_to((5.0, 0.0))
    assert math.hypot(x - 5, y) < 3.1


def test_step_towards_something_near_leads_too_near(flatland: World) -> None:
    for yaw, expected in ((0.0, True), (math.pi, False)):
        scan = flatland(POLE, at=Pose2(1.98, 0.0, yaw)).scan()
        assert leads_too_near(scan, 0.5) == expected
