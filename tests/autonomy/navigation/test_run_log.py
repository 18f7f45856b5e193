import csv
import io
import math
from typing import Any

import numpy as np
import pytest
import shapely
from flatland import flatland, navigator
from hypothesis import given
from hypothesis import strategies as st

from radarsim.autonomy.navigation.bumpers import Bumpers, pressed_names
from radarsim.autonomy.navigation.control import STOP, Twist
from radarsim.autonomy.navigation.controller import Activity, Controller
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.run_log import CELL, RunLog
from radarsim.autonomy.navigation.runner import NavigationStep
from radarsim.autonomy.plans import Algorithm
from radarsim.geometry import Pose2

BUMPERS = Bumpers(safety_distance=0.5)
BOX = shapely.box(-1.5, -2, 1.5, 2.5)
GOALS = ((6.0, 0.2), (0.0, 5.0))


def moment(
    x: float, y: float, activity: Activity, *ranges: float, time: float = 0.0
) -> NavigationStep:
    bearings = np.linspace(-1.0, 1.0, len(ranges))
    observation = Observation(time, Pose2(x, y, 0.5), bearings, np.array(ranges))
    goal = None if activity is Activity.REACHED else (5.0, 0.0)
    return NavigationStep(
        observation, activity, Twist(0.3, -0.1), ("front", "left"), goal
    )


def driven(world: Any, algorithm: Algorithm) -> tuple[Controller, RunLog]:
    """Run a bug in a flat world and log it."""
    bug, run_log = navigator(algorithm, *GOALS, bumpers=BUMPERS), RunLog()
    while not bug.is_done:
        observation = world.scan()
        twist = bug.step(observation)
        goal = bug.goals[0] if bug.goals else None
        pressed = pressed_names(BUMPERS.read(observation))
        run_log.add(NavigationStep(observation, bug.activity, twist, pressed, goal))
        world.move(twist)
    return bug, run_log


@pytest.mark.parametrize("algorithm", [Algorithm.BUG1, Algorithm.BUG2])
def test_log_agrees_with_the_bug(algorithm: Algorithm) -> None:
    world = flatland(BOX, at=Pose2(-6.0, 0.0))
    bug, run_log = driven(world, algorithm)
    assert run_log.hit_points == bug.hit_points
    assert run_log.leave_points == bug.leave_points
    assert run_log.circuits == bug.circuits == (algorithm is Algorithm.BUG1)
    assert [leg.goal for leg in run_log.legs] == list(GOALS)
    assert run_log.legs[0].start == (-6.0, 0.0)
    assert run_log.legs[1].start == pytest.approx(GOALS[0], abs=0.15)
    lengths = [leg.path_length for leg in run_log.legs]
    assert sum(lengths) == pytest.approx(run_log.path_length)
    times = [leg.ended - leg.began for leg in run_log.legs]
    assert sum(times) == pytest.approx(run_log.time)
    assert min(times) > 5
    assert run_log.path_length == pytest.approx(world.length, abs=0.1)
    assert run_log.nearest == pytest.approx(world.nearest, abs=0.02)


def test_goal_reached_at_a_boundary_is_no_leave_point() -> None:
    run_log = RunLog()
    run_log.add(moment(0, 0, Activity.GOING))
    run_log.add(moment(1, 0, Activity.ALIGNING))
    run_log.add(moment(1, 1, Activity.FOLLOWING))
    run_log.add(moment(5, 0, Activity.REACHED))
    assert run_log.hit_points == [(1, 0)]
    assert run_log.leave_points == []
    assert run_log.rows[-1].goal_distance == 0


def test_run_that_starts_at_an_obstacle_starts_with_a_hit_point() -> None:
    run_log = RunLog()
    run_log.add(moment(0, 0, Activity.FOLLOWING))
    run_log.add(moment(1, 0, Activity.GOING))
    assert (run_log.hit_points, run_log.leave_points) == ([(0, 0)], [(1, 0)])


def test_empty_log_has_no_rows() -> None:
    run_log = RunLog()
    assert (run_log.time, run_log.path_length, run_log.nearest) == (0.0, 0.0, math.inf)
    assert run_log.path.shape == (0, 2)
    assert run_log.beam_ends.shape == (0, 3)
    assert run_log.as_csv().count("\n") == 1


@given(
    st.floats(-500, 500),
    st.floats(-500, 500),
    st.lists(st.floats(0.1, 80.0), min_size=1, max_size=30),
)
def test_every_beam_end_is_kept_to_half_a_cell(
    x: float, y: float, ranges: list[float]
) -> None:
    run_log = RunLog()
    seen = moment(x, y, Activity.GOING, *ranges, math.inf)
    run_log.add(seen)
    run_log.add(seen)
    kept = run_log.beam_ends
    points = seen.observation.points()
    apart = np.abs(points[:, None] - kept[None, :, :2]).max(axis=2).min(axis=1)
    assert apart.max() <= CELL / 2 + 1e-6
    assert kept[:, 2].sum() == 2 * len(ranges)


def test_trace_has_a_row_for_each_scan_and_empty_fields() -> None:
    run_log = RunLog()
    run_log.add(moment(-0.00001, 1.23456, Activity.GOING, 2.5, 1.5, time=0.2))
    run_log.add(moment(0.1, 1.25, Activity.REACHED, math.inf, time=0.30000000000000004))
    first, last = csv.DictReader(io.StringIO(run_log.as_csv()))
    assert first == {
        "time": "0.2",
        "x": "0.0",
        "y": "1.2346",
        "yaw": "0.5",
        "doing": "going",
        "goal_x": "5.0",
        "goal_y": "0.0",
        "speed": "0.3",
        "turn": "-0.1",
        "nearest": "1.5",
        "pressed": "front left",
    }
    assert (last["time"], last["goal_x"], last["nearest"]) == ("0.3", "", "")


def test_yaw_stays_within_half_a_turn() -> None:
    run_log = RunLog()
    observation = Observation(0.0, Pose2(0, 0, 7.0), np.zeros(0), np.zeros(0))
    row = run_log.add(
        NavigationStep(observation, Activity.NO_PATH, STOP, (), (1.0, 0.0))
    )
    assert row.yaw == pytest.approx(7.0 - 2 * math.pi)
