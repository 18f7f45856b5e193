"""Robots that follow the path of their footprint where a disc does not fit."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from flatland import flatland, moved, navigator

from radarsim.autonomy.navigation.control import SpeedLimits
from radarsim.autonomy.navigation.controller import Activity, Controller
from radarsim.autonomy.navigation.footprint_follower import (
    LEAST_ROOM,
    SLOW,
    FootprintFollower,
)
from radarsim.autonomy.navigation.footprint_planning import Footprint
from radarsim.autonomy.plans import Algorithm
from radarsim.geometry import Floats, Pose2

HULL = Footprint(0.552, 0.497)
LIMITS = SpeedLimits(0.3, 0.8)
NOTHING: Floats = np.zeros((0, 2))
ROOM = shapely.box(-4, -3, 4, 3).difference(shapely.box(-3.9, -2.9, 3.9, 2.9))


def planning(
    goal: tuple[float, float], footprint: Footprint | None = HULL
) -> Controller:
    return navigator(Algorithm.PLANNED, goal, speed_limits=LIMITS, footprint=footprint)


def least_room(world: Any) -> float:
    """Return how near the footprint has come to the walls of a world, m."""
    corners = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) / 2
    corners = corners * (HULL.length, HULL.width)
    walls = shapely.multilinestrings(world.walls)
    shapely.prepare(walls)
    rooms = []
    for pose in world.track:
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        turned = corners @ np.array([[c, s], [-s, c]]) + (pose.x, pose.y)
        rooms.append(float(walls.distance(shapely.Polygon(turned))))
    return min(rooms)


def gate(gap: float, thick: float = 0.3) -> list[shapely.Polygon]:
    """Return a room that a wall with a gap parts."""
    sides = [shapely.box(0, -3, thick, -gap / 2), shapely.box(0, gap / 2, thick, 3)]
    return [shapely.union_all([ROOM, *sides])]


@pytest.mark.slow
@pytest.mark.parametrize("y", [0.0, 1.3])
def test_gap_that_is_too_narrow_for_a_disc_is_passed(y: float) -> None:
    world = flatland(*gate(0.66), at=Pose2(-2.5, y, 0.4))
    planned = planning((2.5, -y))
    world.run(planned, steps=2000)
    assert planned.activity is Activity.REACHED
    assert least_room(world) > 0.03
    assert world.length < 1.15 * 2 * math.hypot(2.5, y) + 0.2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gap", "footprint"), [pytest.param(0.5, HULL, id="gap"), pytest.param(0.66, None)]
)
def test_no_path_is_reported_where_nothing_passes(
    gap: float, footprint: Footprint | None
) -> None:
    world = flatland(*gate(gap), at=Pose2(-2.5, 0.3, 0.4))
    planned = planning((2.5, 0.0), footprint)
    world.run(planned, steps=1000)
    assert planned.activity is Activity.NO_PATH
    assert world.nearest > 0.4


@pytest.mark.slow
def test_where_the_disc_passes_the_footprint_changes_nothing() -> None:
    tracks = []
    for footprint in (HULL, None):
        world = flatland(*gate(1.4), at=Pose2(-2.5, 1.3, 0.4))
        world.run(planning((2.5, -1.3), footprint))
        tracks.append(world.track)
    assert tracks[0] == tracks[1]


def test_path_is_followed_forward_and_backward_and_to_its_end() -> None:
    path = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 0, math.pi / 2], [1, 0.6, math.pi / 2], [1, 0, 0]]
    )
    path[4, 2] = path[3, 2]
    follower, pose = FootprintFollower(HULL, path, LIMITS), Pose2(0.02, 0.03, 0.1)
    left = []
    for _ in range(300):
        twist = follower.twist(pose, NOTHING)
        if twist is None:
            break
        left.append(len(follower.path))
        pose = moved(pose, twist)
    assert (pose.x, pose.y) == pytest.approx((1, 0), abs=0.03)
    assert pose.yaw == pytest.approx(math.pi / 2, abs=0.1)
    assert left == sorted(left, reverse=True)
    assert set(left) == {2, 3, 4, 5}


def test_it_drives_slowly_where_there_is_little_room() -> None:
    path = np.array([[0.0, 0, 0], [2, 0, 0]])
    speeds = []
    for room in (0.02, 0.1, 0.5):
        points = np.array([[0.0, HULL.width / 2 + room]])
        follower = FootprintFollower(HULL, path, LIMITS)
        twist = follower.twist(Pose2(0.0, 0.0), points)
        assert twist is not None
        speeds.append(twist.speed)
    assert speeds == pytest.approx([SLOW, 0.2, 0.3])


@pytest.mark.parametrize(
    "pose", [Pose2(0.5, 0.1), Pose2(0.5, 0.0, 0.4), Pose2(-0.5, -0.3)]
)
def test_path_is_left_to_another_where_the_robot_is_off(pose: Pose2) -> None:
    path = np.array([[0.0, 0, 0], [2, 0, 0]])
    assert FootprintFollower(HULL, path, LIMITS).twist(pose, NOTHING) is None


def test_nothing_that_is_seen_is_driven_into() -> None:
    path = np.array([[0.0, 0, 0], [2, 0, 0]])
    follower = FootprintFollower(HULL, path, LIMITS)
    ahead = np.array([[HULL.length / 2 + 0.03, 0.1]])
    assert follower.is_blocked(ahead)
    assert follower.twist(Pose2(0.0, 0.0), ahead) is None
    behind = -ahead
    assert not follower.is_blocked(behind)
    assert follower.twist(Pose2(0.0, 0.0), behind) is not None
    aside = np.array([[1.0, HULL.width / 2 + LEAST_ROOM / 2]])
    assert follower.is_blocked(aside)


def test_what_is_seen_within_the_footprint_is_in_error() -> None:
    world = flatland(*gate(0.66), at=Pose2(-2.5, 0.0))
    planned = planning((2.5, 0.0))
    for _ in range(400):
        seen = world.scan()
        if planned.goals and world.pose.x > -0.3:
            ranges = np.where(np.arange(len(seen.ranges)) % 45 == 0, 0.1, seen.ranges)
            seen = replace(seen, ranges=ranges)
        world.move(planned.step(seen))
        if planned.is_done:
            break
    assert planned.activity is Activity.REACHED
