"""Whether what was circled still stands."""

import math
from dataclasses import replace

import pytest
import shapely
from flatland import flatland

from radarsim.autonomy.navigation.boundary_memory import FollowedBoundary
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import SpeedLimits
from radarsim.autonomy.navigation.wall_following import WallFollower
from radarsim.geometry import Point, Pose2

BOX = shapely.box(1, -1, 2, 1)


def followed() -> FollowedBoundary:
    return FollowedBoundary(WallFollower(Bumpers(safety_distance=0.5), SpeedLimits()))


@pytest.mark.parametrize("yaw", [0.0, 2.0, -3.0])
@pytest.mark.parametrize(
    ("shapes", "has_gone"),
    [
        pytest.param([BOX], False, id="stands"),
        pytest.param([], True, id="gone"),
        pytest.param([shapely.box(1.1, -0.9, 2, 1)], False, id="pose has drifted"),
        pytest.param([shapely.box(5, -4, 6, 4)], True, id="moved away"),
        pytest.param([BOX, shapely.box(3, -4, 4, 4)], False, id="wall behind"),
    ],
)
def test_obstacle_has_gone_if_beams_go_through_where_it_was(
    shapes: list[shapely.Polygon], has_gone: bool, yaw: float
) -> None:
    obstacle = followed()
    ring = BOX.exterior
    for along in range(int(ring.length * 10)):
        point = ring.interpolate(along / 10)
        obstacle.add((point.x, point.y), yaw)
    world = flatland(*shapes, at=Pose2(0.0, 0.2, yaw))
    assert obstacle.has_gone(world.scan(), []) is has_gone


def test_what_is_met_where_something_had_gone_stands() -> None:
    goal, at, places = (3.0, 0.0), Pose2(0.2, 0.1, 0.0), list[Point]()
    for has_gone in (True, False):
        boundary = followed()
        scan = flatland(BOX, at=at).scan()
        boundary.reach(scan, 0.0, goal)
        # Known from then on, or it would be left for any place at once.
        assert boundary.goal_distance == math.dist(boundary.hit_place, goal)
        boundary.look(scan, goal)
        boundary.remember(scan.pose.yaw, 0.0)
        # Beams go through it, as through a pane.
        assert boundary.has_gone(flatland(at=at).scan(), places) is has_gone
    assert places == [pytest.approx(boundary.hit_place)]


@pytest.mark.parametrize("stands", [True, False])
def test_obstacle_that_is_seen_at_a_drifted_yaw_has_not_gone(stands: bool) -> None:
    """After a circuit of many turns the INS is some degrees off."""
    obstacle, poles = followed(), []
    for k in range(20):
        angle = k * math.tau / 20
        pole = 2 * math.cos(angle), 2 * math.sin(angle)
        poles.append(shapely.Point(pole).buffer(0.1))
        for yaw in (0.0, 1.0):
            obstacle.add(pole, yaw)
    world = flatland(*poles[: 20 * stands], at=Pose2(0.0, 0.0, 0.0))
    scan = world.scan()
    drifted = replace(scan, pose=Pose2(0.0, 0.0, math.radians(9)))
    assert obstacle.has_gone(drifted, []) is not stands


@pytest.mark.parametrize(
    ("points", "begins"),
    [
        pytest.param([(0.1, 0), (0.4, 0), (0.7, 0), (1.0, 0), (3, 0)], True, id="hit"),
        pytest.param([(0.3, 0)], True, id="a pole"),
        pytest.param([(2, 0), (0.3, 0), (2, 1), (1, 1)], False, id="the other side"),
    ],
)
def test_boundary_begins_where_it_was_hit(
    points: list[tuple[float, float]], begins: bool
) -> None:
    obstacle = followed()
    for point in points:
        obstacle.add(point, 0.0)
    obstacle.hit_place = (0.0, 0.0)
    assert obstacle.is_what_was_hit() is begins


def test_circuit_passes_what_was_hit_only_where_it_was_there_again() -> None:
    obstacle = followed()
    obstacle.hit_place = (0.1, 0.3)
    for station in range(10):  # away from the hit, and around something else
        for along in (0.0, 0.25, 0.5, 0.75):
            obstacle.travelled = station + along
            x = obstacle.travelled
            obstacle.add((min(x, 5.0), max(x - 5.0, 0.0)), 0.0)
    assert obstacle.is_what_was_hit()
    obstacle.circuit_start = 2.0
    assert not obstacle.is_what_was_hit()
    obstacle.travelled = 18.0
    obstacle.add((0.2, 0.0), 0.0)
    assert obstacle.is_what_was_hit()
