import math

import numpy as np
import pytest
import shapely
from flat_world import rectangle
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.motion import CONTACT_GAP

from radarsim.geometry import Floats, Pose2, wrap_angle
from radarsim.presets.robots import load_robot
from radarsim.protocol.dialect import WheelDrive
from radarsim.robots.fleet import Fleet
from radarsim.robots.obstacles import Obstacles, finish
from radarsim.robots.robot import Robot

TICK = 0.01
P3AT = load_robot("P3AT")
FULL = 8.17
speeds = st.floats(-9, 9).map(lambda number: round(number, 1))
Command = tuple[float, float, int]
commands = st.lists(st.tuples(speeds, speeds, st.integers(1, 60)), max_size=8)


def wall(*ends: tuple[float, float]) -> Floats:
    """Return the lines from each point to the next."""
    points = np.array(ends, dtype=np.float64)
    return np.stack([points[:-1], points[1:]], axis=1)


def robot(obstacles: Obstacles, pose: Pose2, fleet: Fleet | None = None) -> Robot:
    """Add a robot to a fleet, or to one of its own."""
    fleet, wheel_drive = fleet or Fleet(), WheelDrive(FULL)
    return fleet.add("R", P3AT, pose, obstacles=obstacles, wheel_drive=wheel_drive)


def drive(driven: Robot, left: float, right: float, ticks: int) -> None:
    driven.drive(left, right)
    for _ in range(ticks):
        driven.fleet.step(TICK)


def polygon(driven: Robot) -> shapely.Polygon:
    return shapely.Polygon(driven.footprint.outline(driven.pose)[:, 0])


def lines(obstacles: Obstacles) -> shapely.MultiLineString:
    return shapely.multilinestrings(shapely.linestrings(obstacles.segments))


@st.composite
def clutter(draw: st.DrawFn) -> Obstacles:
    """Return a closed room of 6 by 6 m with boxes, posts and thin walls in it."""
    place = st.floats(-3, 3).map(lambda number: round(number, 2))
    size = st.floats(0.01, 1).map(lambda number: round(number, 2))
    found = [rectangle(-3, -3, 3, 3)]
    for _ in range(draw(st.integers(0, 8))):
        x, y, a, b = draw(place), draw(place), draw(size), draw(size)
        found.append(
            rectangle(x, y, x + a, y + b)
            if draw(st.booleans())
            else wall((x, y), (x + a, y - b))
        )
    return Obstacles(np.concatenate(found))


@settings(deadline=None, max_examples=40)
@given(obstacles=clutter(), yaw=st.floats(-3, 3), orders=commands)
def test_no_drive_ends_inside_an_obstacle(
    obstacles: Obstacles, yaw: float, orders: list[Command]
) -> None:
    start = Pose2(0, 0, yaw)
    footprint = robot(obstacles, start).footprint
    free = finish(obstacles.search_free_pose(footprint, start, within=2))
    driven = robot(obstacles, free or start)
    solid = lines(obstacles)
    for left, right, ticks in orders if free else []:
        drive(driven, left, right, ticks)
        assert not polygon(driven).intersects(solid)


@settings(deadline=None, max_examples=25)
@given(orders=st.lists(st.lists(st.tuples(speeds, speeds), min_size=4, max_size=4)))
def test_robots_never_overlap(orders: list[list[tuple[float, float]]]) -> None:
    obstacles, fleet = Obstacles(rectangle(-1.5, -1.5, 1.5, 1.5)), Fleet()
    places = [(-0.7, -0.7), (0.7, -0.7), (-0.7, 0.7), (0.7, 0.7)]
    robots = [robot(obstacles, Pose2(x, y, x * y), fleet) for x, y in places]
    for order in orders:
        for driven, (left, right) in zip(robots, order, strict=True):
            driven.drive(left, right)
        for _ in range(50):
            fleet.step(TICK)
        hulls = [polygon(driven) for driven in robots]
        pairs = [(a, b) for i, a in enumerate(hulls) for b in hulls[:i]]
        assert not any(a.intersects(b) for a, b in pairs)
        assert not any(hull.intersects(lines(obstacles)) for hull in hulls)


@settings(deadline=None, max_examples=30)
@given(
    yaw=st.floats(-1.4, 1.4),
    left=st.floats(1, 8),
    right=st.floats(1, 8),
    ticks=st.integers(1, 300),
)
def test_robot_can_always_back_off_from_a_wall(
    yaw: float, left: float, right: float, ticks: int
) -> None:
    driven = robot(Obstacles(wall((1, -50), (1, 50))), Pose2(0, 0, yaw))
    drive(driven, left, right, ticks)
    before = driven.pose
    slower = -4 if abs(wrap_angle(before.yaw)) < math.pi / 2 else 4
    drive(driven, slower, slower, 100)
    moved = math.hypot(driven.pose.x - before.x, driven.pose.y - before.y)
    assert moved == pytest.approx(4 * 0.098, abs=0.03)
    assert driven.pose.x < before.x + 1e-9


def test_robot_stops_at_a_wall() -> None:
    driven = robot(Obstacles(wall((1, -5), (1, 5))), Pose2(0, 0))
    drive(driven, FULL, FULL, 100)
    assert driven.pose.x == pytest.approx(1 - P3AT.length / 2 - CONTACT_GAP)
    assert driven.pose.y == pytest.approx(0)
    assert driven.touched
    stopped = driven.pose
    drive(driven, FULL, FULL, 1000)
    assert driven.pose.x == pytest.approx(stopped.x, abs=1e-9)


def test_robot_slides_along_a_wall_met_at_an_angle() -> None:
    driven = robot(Obstacles(wall((1, -50), (1, 50))), Pose2(0, 0, math.pi / 4))
    drive(driven, 5, 5, 400)
    before = driven.pose
    drive(driven, 5, 5, 100)
    distance = 5 * 0.098
    assert driven.touched
    assert driven.pose.x == pytest.approx(before.x)
    assert driven.pose.y - before.y == pytest.approx(distance * math.sin(math.pi / 4))


def test_robot_slides_into_a_corner_and_leaves_it() -> None:
    corner = Obstacles(wall((1, -5), (1, 1), (-5, 1)))
    driven = robot(corner, Pose2(0, 0, 0.6))
    drive(driven, FULL, FULL, 500)
    assert driven.touched
    stuck = driven.pose
    drive(driven, FULL, FULL, 100)
    assert math.dist((stuck.x, stuck.y), (driven.pose.x, driven.pose.y)) < 0.01
    drive(driven, -FULL, -FULL, 100)
    assert math.dist((stuck.x, stuck.y), (driven.pose.x, driven.pose.y)) > 0.7
    assert not driven.touched


def test_turning_in_a_narrow_corridor_stops_at_its_walls() -> None:
    half = P3AT.width / 2 + 0.02
    corridor = np.concatenate(
        [wall((-5, half), (5, half)), wall((-5, -half), (5, -half))]
    )
    driven = robot(Obstacles(corridor), Pose2(0, 0))
    drive(driven, -2, 2, 300)
    assert driven.touched
    assert 0 < driven.pose.yaw < 0.2
    assert not polygon(driven).intersects(lines(Obstacles(corridor)))


@pytest.mark.parametrize("thickness", [0.0, 1e-4, 0.01])
@pytest.mark.parametrize("speed", [pytest.param(1, id="slow"), FULL])
def test_thin_wall_is_not_passed_through(thickness: float, speed: float) -> None:
    post = wall((1, 0), (1 + thickness, 0.005), (1, 0.005), (1, 0))
    driven = robot(Obstacles(post), Pose2(0, 0))
    drive(driven, speed, speed, round(2000 / speed))
    assert driven.pose.x < 1 - P3AT.length / 2


def test_touch_lasts_until_the_robot_backs_off() -> None:
    driven = robot(Obstacles(wall((0.5, -5), (0.5, 5))), Pose2(0, 0))
    assert not driven.touched
    drive(driven, 5, 5, 200)
    drive(driven, 0, 0, 100)
    assert driven.touched
    drive(driven, -5, -5, 1)
    assert not driven.touched


def test_robot_that_is_hit_is_touched_and_does_not_move() -> None:
    nothing, fleet = Obstacles(), Fleet()
    parked = robot(nothing, Pose2(2, 0), fleet)
    moving = robot(nothing, Pose2(0, 0), fleet)
    moving.drive(5, 5)
    touched = []
    for _ in range(500):
        fleet.step(TICK)
        touched.append(parked.touched)
    assert not touched[0]
    assert touched[-1]
    assert moving.touched
    assert parked.pose == Pose2(2, 0)
    assert moving.pose.x == pytest.approx(2 - P3AT.length - CONTACT_GAP)


def test_robots_that_appear_or_leave_are_noticed() -> None:
    nothing = Obstacles()
    moving = robot(nothing, Pose2(0, 0))
    drive(moving, 5, 5, 10)
    appeared = robot(nothing, Pose2(1, 0), moving.fleet)
    drive(moving, 5, 5, 200)
    assert moving.touched
    assert moving.pose.x < 1 - P3AT.length
    moving.fleet.remove(appeared)
    drive(moving, 5, 5, 200)
    assert not moving.touched
    assert moving.pose.x > 1


def test_robot_approaching_from_afar_is_met_where_it_is() -> None:
    nothing, fleet = Obstacles(), Fleet()
    starts = (Pose2(-6, 0), Pose2(6, 0, math.pi))
    robots = [robot(nothing, pose, fleet) for pose in starts]
    for driven in robots:
        driven.drive(FULL, FULL)
    for _ in range(1000):
        fleet.step(TICK)
    assert all(driven.touched for driven in robots)
    apart = robots[1].pose.x - robots[0].pose.x
    assert P3AT.length < apart < P3AT.length + 0.02


def test_robot_placed_inside_a_wall_can_leave_it() -> None:
    driven = robot(Obstacles(wall((0.2, -5), (0.2, 5))), Pose2(0, 0))
    assert driven.touched
    drive(driven, -5, -5, 100)
    assert not driven.touched
    assert driven.pose.x == pytest.approx(-5 * 0.098, abs=0.02)


def test_robot_placed_inside_a_wall_cannot_go_deeper() -> None:
    driven = robot(Obstacles(wall((0.2, -5), (0.2, 5))), Pose2(0, 0))
    drive(driven, 5, 5, 100)
    assert driven.pose.x == pytest.approx(0)
