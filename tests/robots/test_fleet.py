"""A fleet moves its robots as the reference in plain Python does, one by one."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.motion import CONTACT_GAP, ReferenceRobot
from wheel_odometry import add_odometry

from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.protocol.dialect import WheelDrive
from radarsim.robots.fleet import Fleet
from radarsim.robots.obstacles import Obstacles
from radarsim.robots.robot import Robot

TICK = 0.01
MODELS = [load_robot(name) for name in ("P3AT", "P2DX", "P2AT")]
P3AT = MODELS[0]
FULL = 8.17
speeds = st.floats(-9, 9).map(lambda number: round(number, 1))
places = st.floats(-2.5, 2.5).map(lambda number: round(number, 2))
walls = st.lists(st.tuples(places, places, places, places), max_size=12)
starts = st.tuples(places, places, st.floats(-3, 3))
orders = st.tuples(st.integers(0, 5), speeds, speeds, st.integers(1, 40))


def obstacles(lines: Sequence[tuple[float, ...]], *, floor: float = 0.0) -> Obstacles:
    segments = np.array(lines, np.float64).reshape(-1, 2, 2)
    return Obstacles(segments, floor=floor)


def room(size: float) -> list[tuple[float, ...]]:
    a, b = -size, size
    return [(a, a, b, a), (b, a, b, b), (b, b, a, b), (a, b, a, a)]


def add(fleet: Fleet, around: Obstacles, pose: Pose2, model: int = 0) -> Robot:
    drive = WheelDrive(FULL)
    return fleet.add("R", MODELS[model], pose, obstacles=around, wheel_drive=drive)


def references(fleet: Fleet, around: Obstacles) -> tuple[ReferenceRobot, ...]:
    return tuple(ReferenceRobot(each.model, each.pose, around) for each in fleet.robots)


@settings(deadline=None, max_examples=15)
@given(
    lines=walls,
    start=st.lists(starts, min_size=1, max_size=5),
    commands=st.lists(orders, max_size=8),
)
def test_robots_move_as_in_plain_python(
    lines: list[tuple[float, ...]],
    start: list[tuple[float, float, float]],
    commands: list[tuple[int, float, float, int]],
) -> None:
    around, fleet = obstacles([*lines, *room(3)]), Fleet()
    for i, place in enumerate(start):
        add(fleet, around, Pose2(*place), model=i % len(MODELS))
    odometry = [add_odometry(robot) for robot in fleet.robots]
    expected = references(fleet, around)
    for number, left, right, ticks in commands:
        robot, reference = (
            fleet.robots[number % len(start)],
            expected[number % len(start)],
        )
        robot.drive(left, right)
        spin = robot.wheel_drive.spin
        reference.spins = spin(left), spin(right)
        for _ in range(ticks):
            fleet.step(TICK)
            for each in expected:
                each.step(TICK, expected)
        assert [each.pose for each in fleet.robots] == [e.pose for e in expected]
        assert [e.side_angles for e in fleet.robots] == [e.angles for e in expected]
        assert [each.pose for each in odometry] == [e.odometry for e in expected]
        touched = fleet.touched(fleet.slots).tolist()
        assert touched == [each.touched for each in expected]


def test_slots_stay_and_are_used_again() -> None:
    nothing, fleet = obstacles([]), Fleet()
    robots = [add(fleet, nothing, Pose2(2.0 * i, 0.0)) for i in range(20)]
    slots = [robot.slot for robot in robots]
    assert sorted(slots) == list(range(20))
    fleet.remove(robots[3])
    late = add(fleet, nothing, Pose2(6.0, 1.0))
    assert late.slot == slots[3]
    assert late.number == 21
    assert [robot.slot for robot in robots[4:]] == slots[4:]
    assert fleet.robots == (*robots[:3], *robots[4:], late)
    assert fleet.slots.tolist() == [robot.slot for robot in fleet.robots]
    assert late.pose == Pose2(6.0, 1.0)
    assert robots[3].pose == Pose2(6.0, 0.0)


def test_robot_that_is_removed_stands_where_it_was() -> None:
    fleet, wall = Fleet(), obstacles([(1, -5, 1, 5)])
    leaving = add(fleet, wall, Pose2(0, 0))
    odometry = add_odometry(leaving)
    leaving.drive(FULL, FULL)
    fleet.step(TICK)
    pose, counted = leaving.pose, odometry.pose
    fleet.remove(leaving)
    assert fleet.add_odometry(add(fleet, wall, Pose2(-2, 0))) == odometry.row
    for _ in range(100):
        fleet.step(TICK)
        leaving.fleet.step(TICK)
    assert (leaving.pose, odometry.pose) == (pose, counted)
    assert not leaving.touched
    with pytest.raises(ValueError, match="'R' is not in this fleet"):
        fleet.remove(leaving)


def test_walls_of_another_floor_are_passed() -> None:
    fleet = Fleet()
    below = add(fleet, obstacles([(1, -5, 1, 5)]), Pose2(0, 0))
    above = add(fleet, obstacles([(2, -5, 2, 5)], floor=3.0), Pose2(0, 2))
    for robot in (below, above):
        robot.drive(FULL, FULL)
    for _ in range(400):
        fleet.step(TICK)
    assert below.pose.x == pytest.approx(1 - P3AT.length / 2 - CONTACT_GAP)
    assert above.pose.x == pytest.approx(2 - P3AT.length / 2 - CONTACT_GAP)
    assert below.body.z == P3AT.origin_height
    assert above.body.z == 3 + P3AT.origin_height


def test_robots_meet_also_far_from_the_origin() -> None:
    nothing, fleet = obstacles([]), Fleet()
    parked = add(fleet, nothing, Pose2(-70_002.0, 1e6))
    moving = add(fleet, nothing, Pose2(-70_000.0, 1e6, math.pi))
    moving.drive(FULL, FULL)
    for _ in range(400):
        fleet.step(TICK)
    assert fleet.touched([moving.slot, parked.slot]).tolist() == [True, True]
    apart = moving.pose.x - parked.pose.x
    assert apart == pytest.approx(P3AT.length + CONTACT_GAP, abs=1e-6)


def test_boxes_are_those_of_the_robots_in_their_order() -> None:
    fleet, upstairs = Fleet(), obstacles([], floor=3.0)
    assert fleet.boxes().shape == (0, 8)
    first = add(fleet, obstacles([]), Pose2(1, 2, 3))
    second = add(fleet, upstairs, Pose2(4, 5, 0.5), model=1)
    small, size = second.model, (P3AT.length / 2, P3AT.width / 2)
    assert fleet.boxes().tolist() == [
        [1, 2, 3, 0, P3AT.height, *size, 1],
        [4, 5, 0.5, 3, 3 + small.height, small.length / 2, small.width / 2, 2],
    ]
    fleet.remove(first)
    assert fleet.boxes()[:, 7].tolist() == [2]


def test_many_robots_in_a_crowd_never_overlap() -> None:
    fleet, around = Fleet(), obstacles(room(4))
    robots = [
        add(fleet, around, Pose2(x, y, x + y), model=int(x + y) % 2)
        for x in range(-3, 4)
        for y in range(-3, 4)
    ]
    for i, robot in enumerate(robots):
        robot.drive(5.0 + i % 3, 6.0 - i % 5)
    for _ in range(300):
        fleet.step(TICK)
    hulls = [shapely.Polygon(r.footprint.outline(r.pose)[:, 0]) for r in robots]
    tree = shapely.STRtree(hulls)
    pairs = tree.query(hulls, predicate="intersects")
    assert (pairs[0] == pairs[1]).all()
    assert fleet.touched(fleet.slots).sum() > 10


def test_robots_near_a_place_are_those_that_may_reach_into_its_circle() -> None:
    nothing, fleet = obstacles([]), Fleet()
    robots = [add(fleet, nothing, Pose2(x, 0.0)) for x in (3.0, -1.0, 0.9, 5.0)]
    fleet.remove(robots[1])
    radius = robots[0].footprint.radius
    assert fleet.near(0.0, 0.0, 3.0 - radius + 0.01) == (robots[0], robots[2])
    assert fleet.near(0.0, 0.0, 3.0 - radius - 0.01) == (robots[2],)
    assert fleet.near(9.0, 0.0, 1.0) == ()


def test_touch_is_found_anew_after_each_step_and_each_change_of_the_fleet() -> None:
    nothing, fleet = obstacles([]), Fleet()
    moving = add(fleet, nothing, Pose2(0, 0))
    assert not moving.touched
    ahead = add(fleet, nothing, Pose2(P3AT.length + CONTACT_GAP, 0))
    assert fleet.touched(fleet.slots).tolist() == [True, True]
    assert moving.touched
    fleet.remove(ahead)
    assert not moving.touched
    assert not ahead.touched
    late = add(fleet, nothing, Pose2(-P3AT.length - CONTACT_GAP, 0))
    assert late.touched
    moving.drive(FULL, FULL)
    fleet.step(TICK)
    assert not late.touched


def test_heights_of_a_robot_that_flies_are_forgotten_but_not_those_in_use() -> None:
    fleet, drive = Fleet(), WheelDrive(2.0)
    wall = np.array([[[2.0, -5.0], [2.0, 5.0]]])
    ground, drone_model = Obstacles(wall), load_robot("AirRobot")
    rover = fleet.add(
        "R", load_robot("P3AT"), Pose2(0, 3), obstacles=ground, wheel_drive=drive
    )
    drone = fleet.add(
        "D", drone_model, Pose2(0, 0), obstacles=ground, wheel_drive=drive
    )
    for number in range(2000):
        fleet.lift(drone, 1 + 0.1 * number, Obstacles(wall + number, floor=number))
        assert len(fleet._floors) < 600
    assert ground in fleet._floors
    for robot in (rover, drone):
        robot.drive(2.0, 2.0)
    for _ in range(1000):
        fleet.step(0.01)
    assert rover.pose.x == pytest.approx(2 - 0.276, abs=0.002)
    assert drone.pose.x == pytest.approx(20.0)
    fleet.lift(drone, 3.0, Obstacles(wall + np.array([19.0, 0.0])))
    fleet.step(5.0)
    assert drone.pose.x == pytest.approx(21 - 0.5, abs=0.002)
