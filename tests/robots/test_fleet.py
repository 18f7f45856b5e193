"""A fleet moves its robots as the reference in plain Python does, one by one."""

from collections.abc import Sequence

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.motion import ReferenceRobot

from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.robots.fleet import Fleet
from radarsim.robots.obstacles import Obstacles
from radarsim.robots.robot import Robot
from radarsim.robots.skid_steer import WheelDrive

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
    return tuple(
        ReferenceRobot(each.model, each.pose, around, top_speed=each.top_speed)
        for each in fleet.robots
    )


@settings(deadline=None, max_examples=60)
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
        touched = fleet.touched(fleet.slots).tolist()
        assert touched == [each.touched for each in expected]
