import math

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.autonomy.navigation.boundary_memory import (
    FollowedBoundary,
    Landmark,
)
from radarsim.autonomy.navigation.bug import (
    Bug1Policy,
    Bug2Policy,
    Decision,
)
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import SpeedLimits
from radarsim.autonomy.navigation.wall_following import WallFollower
from radarsim.autonomy.plans import GiveUp
from radarsim.geometry import Pose2

RADIUS = 3.0
STEP = 0.01  # rad on the circle


def on_circle(angle: float) -> Pose2:
    """A pose on the circle, facing along it."""
    return Pose2(
        RADIUS * math.cos(angle), RADIUS * math.sin(angle), angle + math.pi / 2
    )


def boundary() -> FollowedBoundary:
    """The circle, whose landmarks are passed up to 0.7 m away."""
    bumpers = Bumpers(safety_distance=0.45)
    followed = FollowedBoundary(WallFollower(bumpers, SpeedLimits()))
    followed.add_landmark(on_circle(0.0), math.pi / 2, 0.0)
    return followed


def take_step(
    policy: Bug1Policy | Bug2Policy, angle: float, *, free: bool = True
) -> Decision:
    """Step to an angle on the circle."""
    policy.boundary.travelled += RADIUS * STEP
    return policy.step(on_circle(angle), angle + math.pi / 2, free=free)


@given(st.floats(0.2, 2 * math.pi - 0.2))
@settings(max_examples=15)
def test_bug1_circles_once_and_returns_by_the_shorter_side(at: float) -> None:
    goal = (9 * math.cos(at), 9 * math.sin(at))
    policy = Bug1Policy(boundary(), goal)
    angle, sense, decisions = 0.0, 1, []
    for _ in range(2000):
        angle += sense * STEP
        decisions.append(take_step(policy, angle))
        sense = -1 if decisions[-1] is Decision.BACK else sense
        if decisions[-1] is Decision.LEAVE:
            break
    assert policy.circuits == 1
    assert math.remainder(angle - at, 2 * math.pi) == pytest.approx(0.0, abs=0.05)
    back = Decision.BACK in decisions
    assert back == (at > math.pi) or abs(at - math.pi) < 0.05
    travelled = len(decisions) * STEP
    assert travelled == pytest.approx(2 * math.pi + min(at, 2 * math.pi - at), abs=0.1)


def followed(
    policy: Bug1Policy | Bug2Policy, *, free: bool = True
) -> tuple[float, Decision]:
    """Follow the circle until the policy decides; return the angle there."""
    angle, verdict = 0.0, Decision.ONWARD
    while verdict is Decision.ONWARD:
        angle += STEP
        verdict = take_step(policy, angle, free=free)
    return angle, verdict


def test_bug1_gives_up_where_the_goal_is_blocked_at_the_nearest_point() -> None:
    policy = Bug1Policy(boundary(), (0.0, 1.0))
    angle, verdict = followed(policy, free=False)
    assert verdict is Decision.NO_PATH
    assert angle == pytest.approx(2.5 * math.pi, abs=0.05)


def line(give_up: GiveUp, start: Pose2, goal: tuple[float, float]) -> Bug2Policy:
    return Bug2Policy(boundary(), goal, on_circle(0.0), [start], give_up)


def test_line_of_bug2_ends_at_the_goal() -> None:
    """Beyond a goal inside the circle, the circle meets only its continuation."""
    policy = line(GiveUp.HIT_POINT, Pose2(9.0, 0.0), (-1.0, 0.0))
    angle, verdict = followed(policy)
    assert verdict is Decision.NO_PATH
    assert angle == pytest.approx(2 * math.pi, abs=0.04)


def test_bug2_leaves_at_the_line_only_where_it_is_free() -> None:
    for free in (True, False):
        policy = line(GiveUp.HIT_POINT, Pose2(9.0, 0.0), (-9.0, 0.0))
        angle, verdict = followed(policy, free=free)
        assert verdict is (Decision.LEAVE if free else Decision.NO_PATH)
        assert angle == pytest.approx(math.pi if free else 2 * math.pi, abs=0.04)
        assert policy.circuits == (not free)


def test_bug2_leaves_at_whichever_of_several_lines_it_meets_first() -> None:
    goal, starts = (-9.0, 0.0), (Pose2(9.0, 0.0), Pose2(2.0, 2.0))
    met = shapely.intersection(
        shapely.Point(0.0, 0.0).buffer(RADIUS, 1000).exterior,
        shapely.LineString([(2.0, 2.0), goal]),
    )
    ends = []
    for lines in (starts, starts[:1]):
        policy = Bug2Policy(boundary(), goal, on_circle(0.0), lines, GiveUp.HIT_POINT)
        angle, verdict = followed(policy)
        assert verdict is Decision.LEAVE
        ends.append(angle)
    assert ends == pytest.approx([math.atan2(met.y, met.x), math.pi], abs=0.05)


def test_bug2_gives_up_at_its_last_line_only() -> None:
    """The circle crosses the first line at 132 degrees, no nearer to the goal."""
    goal, starts = (-2.0, -9.0), (Pose2(-2.0, 9.0), Pose2(5.5, 4.5))
    policy = Bug2Policy(boundary(), goal, on_circle(0.0), starts, GiveUp.LINE)
    angle, verdict = followed(policy)
    assert verdict is Decision.LEAVE
    assert math.degrees(angle) > 180


def test_landmark_is_passed_once_by_a_path_beside_it() -> None:
    mark = Landmark(Pose2(1.0, 1.0), math.pi / 2, max_offset=0.7)
    path = [Pose2(1.4, y / 10) for y in range(30)]
    passed = [pose.y for pose in path if mark.observe(pose)]
    assert passed == [1.0]


def test_landmark_is_not_passed_onward_against_its_direction() -> None:
    path = [Pose2(1.4, y / 10) for y in reversed(range(30))]
    onward = Landmark(Pose2(1.0, 1.0), math.pi / 2, max_offset=0.7)
    assert not any(onward.observe(pose) for pose in path)
    back = Landmark(Pose2(1.0, 1.0), math.pi / 2, max_offset=0.7)
    assert sum([back.observe(pose, onward=False) for pose in path]) == 1


def test_landmark_is_not_passed_from_too_far_beside() -> None:
    mark = Landmark(Pose2(1.0, 1.0), math.pi / 2, max_offset=0.7)
    assert not any(mark.observe(Pose2(1.8, y / 10)) for y in range(30))


def test_standing_on_a_landmark_does_not_pass_it() -> None:
    mark = Landmark(Pose2(1.0, 1.0), 0.0, max_offset=0.7)
    assert not any(mark.observe(Pose2(1.0, 1.0)) for _ in range(5))
