import math

import numpy as np
import pytest
import shapely
from flatland import World

from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import SpeedLimits
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.wall_following import FollowMode, WallFollower
from radarsim.geometry import Pose2

S = 0.5
FOLLOWER = WallFollower(Bumpers(safety_distance=S), SpeedLimits(0.3))
MODES = [
    pytest.param(
        FollowMode(wall_on_left, forward),
        id=f"{'left' if wall_on_left else 'right'}, {name}",
    )
    for wall_on_left in (True, False)
    for forward, name in ((True, "forward"), (False, "backward"))
]


def alongside(mode: FollowMode, *, distance: float) -> Pose2:
    """A pose beside a boundary at y = 0 that is above the robot."""
    facing_east = (
        mode.wall_on_left
    )  # the boundary's side, for either direction along it
    return Pose2(0.0, -distance, 0.0 if facing_east else math.pi)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("distance", [0.55, 0.75, 0.98])
def test_follower_settles_in_the_middle_of_the_band(
    flatland: World, mode: FollowMode, distance: float
) -> None:
    world = flatland(shapely.box(-30, 0, 30, 1), at=alongside(mode, distance=distance))
    for _ in range(300):
        twist, found = FOLLOWER.step(world.scan(), mode)
        assert found
        assert (twist.speed > 0) == mode.forward
        world.move(twist)
    assert world.pose.y == pytest.approx(-FOLLOWER.target_distance, abs=0.12)
    assert abs(world.pose.x) > 7
    east = (world.pose.x > 0) == (mode.wall_on_left == mode.forward)
    assert east
    assert world.nearest > S


@pytest.mark.parametrize("mode", MODES)
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
    flatland: World, shape: shapely.Polygon, mode: FollowMode
) -> None:
    world = flatland(shape, at=alongside(mode, distance=0.75))
    begin, turned = world.pose, 0.0
    for _ in range(3000):
        twist, _ = FOLLOWER.step(world.scan(), mode)
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


def test_lost_boundary_is_searched_for_on_its_side(flatland: World) -> None:
    world = flatland(at=Pose2(0.0, 0.0))
    for mode in (
        FollowMode(),
        FollowMode(wall_on_left=False),
        FollowMode(forward=False),
        FollowMode(False, False),
    ):
        twist, found = FOLLOWER.step(world.scan(), mode)
        assert not found
        # about a centre on the boundary's hand, at the distance that is kept
        assert twist.speed / twist.turn == pytest.approx(
            FOLLOWER.target_distance * (1 if mode.wall_on_left else -1)
        )
        assert (twist.speed > 0) == mode.forward


def test_follower_keeps_to_the_middle_of_a_gap(flatland: World) -> None:
    walls = shapely.box(-20, 0.6, 20, 1), shapely.box(-20, -1, 20, -0.6)
    world = flatland(*walls, at=Pose2(-15.0, 0.05, 0.0))
    for _ in range(600):
        world.move(FOLLOWER.step(world.scan(), FollowMode())[0])
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
    twist, _ = FOLLOWER.step(seen, FollowMode())
    assert twist.turn > 0.3
    assert (twist.speed > 0) == drives


def test_walled_in_follower_turns_on_the_spot(flatland: World) -> None:
    well = shapely.Point(0, 0).buffer(0.6).exterior.buffer(0.01)
    world = flatland(well, at=Pose2(0.0, 0.0))
    for _ in range(100):
        world.move(FOLLOWER.step(world.scan(), FollowMode())[0])
    assert world.nearest > 0.4


def test_tangent_is_the_direction_along_the_boundary(flatland: World) -> None:
    wall = shapely.box(-9, 0, 9, 1)
    for mode, expected in (
        (FollowMode(), 0.0),
        (FollowMode(wall_on_left=False), math.pi),
    ):
        world = flatland(wall, at=Pose2(0.0, -0.8, expected + 0.4))
        tangent = FOLLOWER.tangent(world.scan(), mode)
        assert math.cos(tangent - expected) == pytest.approx(1.0, abs=0.01)
    away = flatland(at=Pose2(0.0, 0.0, 0.4))
    assert FOLLOWER.tangent(away.scan(), FollowMode()) == pytest.approx(0.4)


def test_reversed_mode_keeps_the_side() -> None:
    mode = FollowMode(wall_on_left=False)
    assert mode.reversed == FollowMode(wall_on_left=False, forward=False)
    assert mode.reversed.reversed == mode


@pytest.mark.parametrize("mode", MODES)
def test_bearing_conversion_is_its_own_inverse(
    flatland: World, mode: FollowMode
) -> None:
    observation = flatland(shapely.box(1, -1, 2, 1), at=Pose2(0.0, 0.0)).scan()
    view = mode.canonical(observation)
    back = np.array([mode.bearing(float(b)) for b in view.bearings])
    assert np.cos(back - observation.bearings) == pytest.approx(1.0)
