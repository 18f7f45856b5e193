import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.geometry import Pose2
from radarsim.navigation.boundary_policy import (
    Bug1Policy,
    Bug2Policy,
    Decision,
    Landmark,
    Step,
)
from radarsim.navigation.options import GiveUp

RADIUS = 3.0
STEP = 0.01  # rad on the circle


def on_circle(angle: float) -> Pose2:
    """A place on the way round, which is clockwise with the obstacle on the right."""
    return Pose2(
        RADIUS * math.cos(angle), RADIUS * math.sin(angle), angle + math.pi / 2
    )


def mark(angle: float) -> Landmark:
    return Landmark(on_circle(angle), angle + math.pi / 2, max_offset=0.7)


def walk(angle: float, sense: int) -> tuple[float, Step]:
    angle += sense * STEP
    direction = angle + math.pi / 2
    return angle, Step(on_circle(angle), RADIUS * STEP, direction, free=True)


@given(st.floats(0.2, 2 * math.pi - 0.2))
def test_bug1_goes_round_once_and_the_shorter_way_to_the_nearest_place(
    at: float,
) -> None:
    goal = (9 * math.cos(at), 9 * math.sin(at))
    circling = Bug1Policy(mark(0.0), goal, 0.7)
    angle, sense, verdicts = 0.0, 1, []
    for _ in range(2000):
        angle, step = walk(angle, sense)
        verdicts.append(circling.step(step))
        sense = -1 if verdicts[-1] is Decision.BACK else sense
        if verdicts[-1] is Decision.LEAVE:
            break
    assert circling.circuits == 1
    assert math.remainder(angle - at, 2 * math.pi) == pytest.approx(0.0, abs=0.05)
    back = Decision.BACK in verdicts
    assert back == (at > math.pi) or abs(at - math.pi) < 0.05
    travelled = len(verdicts) * STEP
    assert travelled == pytest.approx(2 * math.pi + min(at, 2 * math.pi - at), abs=0.1)


def test_bug1_gives_up_where_the_nearest_place_is_not_free() -> None:
    circling = Bug1Policy(mark(0.0), (0.0, 1.0), 0.7)
    angle, verdict = 0.0, Decision.ONWARD
    while verdict is Decision.ONWARD:
        angle, step = walk(angle, 1)
        verdict = circling.step(Step(step.pose, step.moved, step.direction, free=False))
    assert verdict is Decision.NO_PATH
    assert angle == pytest.approx(2.5 * math.pi, abs=0.05)


def line(give_up: GiveUp, start: Pose2, goal: tuple[float, float]) -> Bug2Policy:
    return Bug2Policy(mark(0.0), (start, goal), give_up, 0.7)


def test_bug2_leaves_at_the_line_only_where_it_is_free() -> None:
    for free in (True, False):
        circling = line(GiveUp.HIT_POINT, Pose2(9.0, 0.0), (-9.0, 0.0))
        angle, verdict = 0.0, Decision.ONWARD
        while verdict is Decision.ONWARD:
            angle, step = walk(angle, 1)
            verdict = circling.step(Step(step.pose, step.moved, step.direction, free))
        assert verdict is (Decision.LEAVE if free else Decision.NO_PATH)
        assert angle == pytest.approx(math.pi if free else 2 * math.pi, abs=0.04)
        assert circling.circuits == (not free)


def test_the_rules_of_giving_up_differ_where_the_line_is_met_farther_away() -> None:
    ends = {}
    for rule in GiveUp:  # the line passes the hit point and goes on to the right
        circling = line(rule, Pose2(-9.0, 0.0), (9.0, 0.0))
        angle, verdict = 0.0, Decision.ONWARD
        while verdict is Decision.ONWARD:
            angle, step = walk(angle, 1)
            verdict = circling.step(step)
        assert verdict is Decision.NO_PATH
        ends[rule] = angle
    assert ends[GiveUp.LINE] == pytest.approx(math.pi, abs=0.04)
    assert ends[GiveUp.HIT_POINT] == pytest.approx(2 * math.pi, abs=0.02)
