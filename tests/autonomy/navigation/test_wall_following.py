import math

import numpy as np
import pytest
import shapely
from flatland import flatland

from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import SpeedLimits
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.wall_following import WallFollower
from radarsim.geometry import Pose2

S = 0.5
TARGET = 0.75  # m


def follower(*, wall_on_left: bool = True, forward: bool = True) -> WallFollower:
    bumpers, limits = Bumpers(safety_distance=S), SpeedLimits(0.3)
    made = WallFollower(bumpers, limits, wall_on_left=wall_on_left)
    made.forward = forward
    return made


FOLLOWERS = pytest.mark.parametrize(
    "follow",
    [
        pytest.param(
            follower(wall_on_left=wall_on_left, forward=forward),
            id=f"{'left' if wall_on_left else 'right'}, {name}",
        )
        for wall_on_left in (True, False)
        for forward, name in ((True, "forward"), (False, "backward"))
    ],
)


def alongside(follow: WallFollower, *, distance: float) -> Pose2:
    """A pose at a boundary at y = 0 that is above the robot."""
    # facing east on the boundary's side, for either direction along it
    return Pose2(0.0, -distance, 0.0 if follow.wall_on_left else math.pi)


@FOLLOWERS
@pytest.mark.parametrize("distance", [0.55, 0.75, 0.98])
def test_follower_settles_in_the_middle_of_the_band(
    follow: WallFollower, distance: float
) -> None:
    world = flatland(
        shapely.box(-30, 0, 30, 1), at=alongside(follow, distance=distance)
    )
    for _ in range(300):
        twist, found = follow.step(world.scan())
        assert found
        assert (twist.speed > 0) == follow.forward
        world.move(twist)
    assert world.pose.y == pytest.approx(-TARGET, abs=0.12)
    assert abs(world.pose.x) > 7
    east = (world.pose.x > 0) == (follow.wall_on_left == follow.forward)
    assert east
    assert world.nearest > S


@pytest.mark.parametrize(
    "follow",
    [
        pytest.param(follower(), id="left, forward"),
        pytest.param(follower(wall_on_left=False, forward=False), id="right, backward"),
    ],
)
@pytest.mark.parametrize(
    "shape",
    [
        pytest.param(shapely.Point(0, 1.0).buffer(1.0), id="disc"),
        pytest.param(shapely.Point(0, 0.1).buffer(0.1), id="pole"),
        pytest.param(shapely.box(-2, 0, 2, 0.02), id="thin wall"),
        pytest.param(shapely.box(-2, 0, 2, 3), id="box"),
        pytest.param(
            shapely.box(-4, 0, 4, 6).difference(shapely.box(-1.3, 1, 1.3, 7)),
            id="inlet",
        ),
        pytest.param(
            shapely.box(-4, 0, 4, 6).difference(shapely.box(-0.4, 1, 0.4, 7)),
            id="inlet that is too narrow",
        ),
    ],
)
def test_path_around_an_obstacle_is_its_boundary_offset_outward(
    shape: shapely.Polygon, follow: WallFollower
) -> None:
    world = flatland(shape, at=alongside(follow, distance=0.75))
    begin, turned = world.pose, 0.0
    for _ in range(3000):
        twist, _ = follow.step(world.scan())
        world.move(twist)
        turned += twist.turn * 0.1
        home = math.hypot(world.pose.x - begin.x, world.pose.y - begin.y)
        if abs(turned) > 4 and world.length > 3 and home < 0.35:
            break
    else:
        pytest.fail(f"not round after {world.length:.1f} m, at {world.pose}")
    assert world.nearest > 0.45
    inner, outer = shape.buffer(0.55), shape.buffer(1.0)
    closed = outer.buffer(0)
    assert world.length == pytest.approx(shape.buffer(0.75).exterior.length, rel=0.12)
    assert closed.covers(shapely.Point(world.pose.x, world.pose.y))
    assert inner.area < closed.area


@FOLLOWERS
def test_lost_boundary_is_searched_for_on_its_side(follow: WallFollower) -> None:
    twist, found = follow.step(flatland(at=Pose2(0.0, 0.0)).scan())
    assert not found
    # about a centre on the boundary's hand, at the distance that is kept
    radius = TARGET if follow.wall_on_left else -TARGET
    assert twist.speed / twist.turn == pytest.approx(radius)
    assert (twist.speed > 0) == follow.forward


def test_follower_keeps_to_the_middle_of_a_gap() -> None:
    walls = shapely.box(-20, 0.6, 20, 1), shapely.box(-20, -1, 20, -0.6)
    world = flatland(*walls, at=Pose2(-15.0, 0.05, 0.0))
    for _ in range(600):
        world.move(follower().step(world.scan())[0])
    assert world.pose.x > 0
    assert world.nearest > 0.5


@pytest.mark.parametrize(("pole_deg", "drives"), [(-60, False), (-120, True)])
def test_follower_that_turns_goes_no_nearer_to_what_is_too_near(
    pole_deg: int, drives: bool
) -> None:
    bearings = np.radians(np.arange(360.0) - 180.0)
    ranges = np.full(360, math.inf)
    ranges[[180 + 110, 180 + pole_deg]] = 0.7, 0.42
    seen = Observation(0.0, Pose2(0.0, 0.0), bearings, ranges)
    twist, _ = follower().step(seen)
    assert twist.turn > 0.3
    assert (twist.speed > 0) == drives


def test_walled_in_follower_turns_on_the_spot() -> None:
    well = shapely.Point(0, 0).buffer(0.6).exterior.buffer(0.01)
    world = flatland(well, at=Pose2(0.0, 0.0))
    for _ in range(100):
        world.move(follower().step(world.scan())[0])
    assert world.nearest > 0.4


def test_tangent_is_the_direction_along_the_boundary() -> None:
    wall = shapely.box(-9, 0, 9, 1)
    for wall_on_left, expected in ((True, 0.0), (False, math.pi)):
        world = flatland(wall, at=Pose2(0.0, -0.8, expected + 0.4))
        tangent = follower(wall_on_left=wall_on_left).tangent(world.scan())
        assert math.cos(tangent - expected) == pytest.approx(1.0, abs=0.01)
    away = flatland(at=Pose2(0.0, 0.0, 0.4))
    assert follower().tangent(away.scan()) == pytest.approx(0.4)


@FOLLOWERS
def test_nearest_point_of_a_boundary_is_where_it_is(follow: WallFollower) -> None:
    world = flatland(shapely.box(-9, 0, 9, 1), at=alongside(follow, distance=0.8))
    found = follow.boundary(world.scan())
    assert found is not None
    (x, y), distance = found
    assert (x, y) == pytest.approx((0.0, 0.0), abs=0.05)
    assert distance == pytest.approx(0.8, abs=0.01)
