import math

import pytest
import shapely
import shapely.affinity
from flatland import flatland, navigator
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.controller import Activity
from radarsim.autonomy.plans import Algorithm, GiveUp, Rule
from radarsim.geometry import Pose2

S = 0.5
BOTH = pytest.mark.parametrize("algorithm", [Algorithm.BUG1, Algorithm.BUG2])
ALL = pytest.mark.parametrize(
    "algorithm",
    [
        *(Algorithm.BUG1, Algorithm.BUG2, Algorithm.TANGENT_BUG),
        pytest.param(Algorithm.PLANNED, marks=pytest.mark.slow),
    ],
)
HANDS = pytest.mark.parametrize("wall_on_left", [True, False], ids=["left", "right"])


BOX = shapely.box(-1.5, -2, 1.5, 2.5)
TRAP = shapely.box(-3, -4, 2, 4).difference(shapely.box(-4, -3.9, 1.9, 3.9))
CELL = shapely.box(-2, -2, 2, 2).difference(shapely.box(-1.9, -1.9, 1.9, 1.9))


@BOTH
@pytest.mark.parametrize(
    ("shape", "wall_on_left"),
    [
        pytest.param(BOX, True, id="box"),
        pytest.param(BOX, False, id="box, on the right"),
        pytest.param(TRAP, False, id="trap"),
    ],
)
def test_path_length_is_within_the_bounds_of_choset(
    shape: shapely.Polygon, algorithm: Algorithm, wall_on_left: bool
) -> None:
    world = flatland(shape, at=Pose2(-6.0, 0.0))
    robot = navigator(algorithm, (6.0, 0.2), wall_on_left=wall_on_left)
    world.run(robot)
    assert robot.activity is Activity.REACHED
    assert math.hypot(world.pose.x - 6, world.pose.y - 0.2) <= 0.15
    assert world.nearest > 0.45
    grown = shape.buffer(S + 0.5).exterior
    line = shapely.LineString([(-6, 0), (6, 0.2)])
    crossings = len(shapely.get_parts(grown.intersection(line)))
    share = 1.5 if algorithm is Algorithm.BUG1 else crossings / 2
    assert world.length <= 1.05 * (line.length + share * grown.length)
    assert len(robot.hit_points) == len(robot.leave_points) == 1
    assert robot.circuits == (algorithm is Algorithm.BUG1)


@ALL
@pytest.mark.parametrize(
    ("start", "goal", "wall_on_left"),
    [
        pytest.param((-6.0, 0.3), (0.2, 0.1), True, id="goal inside"),
        pytest.param((0.1, 0.2), (6.0, 0.4), False, id="start inside"),
    ],
)
def test_navigator_reports_that_there_is_no_path(
    algorithm: Algorithm,
    start: tuple[float, float],
    goal: tuple[float, float],
    wall_on_left: bool,
) -> None:
    world = flatland(CELL, at=Pose2(*start, 1.0))
    robot = navigator(algorithm, goal, wall_on_left=wall_on_left)
    world.run(robot)
    assert robot.activity is Activity.NO_PATH
    assert robot.circuits == (algorithm is not Algorithm.PLANNED)
    assert not robot.leave_points
    assert world.nearest > 0.4


def test_path_is_straight_without_obstacles() -> None:
    world = flatland(at=Pose2(0.0, 0.0, 2.0))
    robot = navigator(Algorithm.BUG1, (3.0, -4.0))
    world.run(robot)
    assert world.length == pytest.approx(5.0, abs=0.2)
    assert robot.hit_points == robot.leave_points == []


@ALL
def test_waypoints_are_reached_in_turn(algorithm: Algorithm) -> None:
    world = flatland(BOX, at=Pose2(-4.0, -4.0))
    goals = [(-4.0, 4.0), (4.0, 4.0), (4.0, -4.0)]
    robot = navigator(algorithm, *goals)
    world.run(robot)
    assert robot.activity is Activity.REACHED
    places = iter(world.track)
    for x, y in goals:  # each after the one before
        assert any(math.hypot(p.x - x, p.y - y) < 0.11 for p in places)


def test_robot_that_starts_at_the_goal_has_reached_it() -> None:
    world = flatland(at=Pose2(1.0, 1.0))
    robot = navigator(Algorithm.BUG2, (1.05, 1.0), (0.98, 1.0))
    world.run(robot)
    assert len(world.track) == 1
    assert robot.goals == []


@ALL
def test_robot_turns_to_the_heading_at_its_last_goal(algorithm: Algorithm) -> None:
    world = flatland(at=Pose2(0.0, 0.0))
    robot = navigator(algorithm, (1.5, 0.0), (3.0, 0.0), heading=-3.0)
    yaws = []
    while not robot.is_done:
        world.move(robot.step(world.scan()))
        if robot.activity is Activity.TURNING:
            assert robot.goal == (3.0, 0.0)
            yaws.append(world.pose.yaw)
    assert world.pose.yaw == pytest.approx(-3.0, abs=0.05)
    assert yaws == sorted(yaws, reverse=True)  # the short way round
    assert math.hypot(world.pose.x - 3.0, world.pose.y) <= 0.1


def test_turn_at_the_goal_goes_on_though_the_pose_drifts_or_changes() -> None:
    world = flatland(at=Pose2(0.0, 0.0))
    robot = navigator(Algorithm.BUG2, (0.5, 0.0), heading=math.pi / 2)
    while robot.activity is not Activity.TURNING:
        world.move(robot.step(world.scan()))
    world.pose = Pose2(0.39, 0.0, world.pose.yaw)  # beyond the tolerance
    assert robot.step(world.scan()).speed == 0
    assert robot.activity is Activity.TURNING
    robot.reconsider(world.pose, lambda scan: scan)
    world.run(robot)
    assert robot.goals == robot.leave_points == []
    assert math.hypot(world.pose.x - 0.5, world.pose.y) <= 0.1
    assert world.pose.yaw == pytest.approx(math.pi / 2, abs=0.05)


def test_no_goal_is_refused() -> None:
    with pytest.raises(ValueError, match="no goals"):
        navigator(Algorithm.BUG1)


def test_object_beyond_the_goal_is_no_obstacle() -> None:
    world = flatland(shapely.box(3, -5, 4, 5), at=Pose2(0.0, 0.0))
    robot = navigator(Algorithm.BUG2, (2.45, 0.0))  # 0.55 m before the wall
    world.run(robot)
    assert robot.hit_points == []


def test_goal_beside_the_boundary_is_reached_from_it() -> None:
    world = flatland(BOX, at=Pose2(-6.0, 0.0))
    robot = navigator(Algorithm.BUG1, (2.1, 0.5))  # 0.6 m behind the box
    world.run(robot)
    assert robot.activity is Activity.REACHED
    assert robot.circuits == 0


def test_shorter_rule_gives_up_where_the_hit_point_rule_continues() -> None:
    """Inside a hook the line is met farther from the goal, before the exit."""
    hook = shapely.LineString(
        [(3, -3), (3, 3.5), (-7, 3.5), (-7, -3.5), (-2, -3.5), (-2, 0.8)]
    ).buffer(0.05, cap_style="flat", join_style="mitre")
    ends = {}
    for rule in GiveUp:
        world = flatland(hook, at=Pose2(0.5, 0.0))
        robot = navigator(Algorithm.BUG2, (6.5, 0.0), give_up=rule, wall_on_left=False)
        world.run(robot)
        ends[rule] = robot.activity
    assert ends == {GiveUp.HIT_POINT: Activity.REACHED, GiveUp.LINE: Activity.NO_PATH}


@pytest.mark.parametrize(
    ("count", "rule"),
    [(4, Rule.SHARE), (5, Rule.SHARE), (12, Rule.SHARE), (8, Rule.ALL)],
)
def test_goal_is_reached_with_any_number_of_bumpers_and_the_literal_rule(
    count: int, rule: Rule
) -> None:
    world = flatland(BOX, at=Pose2(-4.0, 0.0))
    bumpers = Bumpers(safety_distance=S, count=count, rule=rule)
    robot = navigator(Algorithm.BUG2, (4.0, 0.0), bumpers=bumpers)
    world.run(robot)
    assert robot.activity is Activity.REACHED
    assert world.nearest > 0.42


def test_robot_leaves_a_boundary_that_vanishes() -> None:
    world = flatland(BOX, at=Pose2(-6.0, 0.0))
    robot = navigator(Algorithm.BUG1, (6.0, 0.0))
    while robot.activity != Activity.FOLLOWING:
        world.move(robot.step(world.scan()))
    empty = flatland(at=world.pose)
    empty.run(robot)
    assert robot.is_done
    assert not robot.goals
    assert math.hypot(empty.pose.x - 6, empty.pose.y) <= 0.15


def turned_box(
    length: float, width: float, angle: float, aside: float
) -> shapely.Polygon:
    box = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
    box = shapely.affinity.rotate(box, angle, use_radians=True)
    return shapely.affinity.translate(box, 0, aside)


BOXES = st.builds(
    turned_box,
    st.floats(0.2, 5.0),
    st.floats(0.2, 5.0),
    st.floats(0, math.pi),
    st.floats(-2.0, 2.0),
)


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.sampled_from([Algorithm.BUG1, Algorithm.BUG2]), st.booleans(), BOXES)
def test_goal_behind_any_box_is_reached(
    algorithm: Algorithm, wall_on_left: bool, box: shapely.Polygon
) -> None:
    world = flatland(box, at=Pose2(-5.5, 0.0))
    robot = navigator(algorithm, (5.5, 0.0), wall_on_left=wall_on_left)
    world.run(robot, steps=4000)
    assert robot.activity is Activity.REACHED
    assert world.nearest > 0.42


@BOTH
@pytest.mark.parametrize("gap", [0.1, 0.4])
def test_goal_too_near_to_an_obstacle_is_reached_or_has_no_path(
    algorithm: Algorithm, gap: float
) -> None:
    world = flatland(BOX, at=Pose2(-4.0, 0.0))
    robot = navigator(algorithm, (-1.5 - gap, 0.3))
    world.run(robot, steps=3000)
    assert len(robot.hit_points) < 8
    assert world.nearest > 0.38
    assert robot.activity in (Activity.NO_PATH, Activity.REACHED)


def gate(width: float) -> list[shapely.Polygon]:
    """A wall across, with a gap off the line to the goal."""
    return [
        shapely.box(-0.1, -4, 0.1, -width / 2),
        shapely.box(-0.1, width / 2, 0.1, 4),
    ]


@pytest.mark.slow
@BOTH
@HANDS
@pytest.mark.parametrize("width", [1.4, 1.5, 1.9])
@pytest.mark.parametrize("start", [0.0, 1.5])
def test_bug_passes_gaps_wider_than_twice_the_safety_distance(
    algorithm: Algorithm, wall_on_left: bool, width: float, start: float
) -> None:
    room = shapely.box(-6, -4.1, 6, 4.1).exterior.buffer(0.1, cap_style="square")
    world = flatland(room, *gate(width), at=Pose2(-4.0, start))
    robot = navigator(algorithm, (4.0, 1.0), wall_on_left=wall_on_left)
    world.run(robot)
    assert robot.activity is Activity.REACHED
    assert world.nearest > 0.42


@BOTH
@pytest.mark.parametrize(("width", "wall_on_left"), [(1.3, True), (1.7, False)])
def test_bug_leaves_a_dead_end(
    algorithm: Algorithm, width: float, wall_on_left: bool
) -> None:
    half = width / 2
    walls = shapely.box(-2, -half - 0.1, 2, half + 0.1)
    dead_end = walls.difference(shapely.box(-3, -half, 1.9, half))
    world = flatland(dead_end, at=Pose2(-4.0, 0.1))
    robot = navigator(algorithm, (4.0, 0.1), wall_on_left=wall_on_left)
    world.run(robot)
    assert robot.activity is Activity.REACHED


@BOTH
def test_obstacle_that_drives_away_is_no_reason_to_give_up(
    algorithm: Algorithm,
) -> None:
    """Another robot crosses an empty field, is followed, and drives off."""
    world = flatland(at=Pose2(-4.0, 0.0))
    robot = navigator(algorithm, (6.0, 0.0))
    hits = 0
    for k in range(1500):
        y = -1.2 + 0.03 * k
        other = [] if y > 4 else [shapely.box(-1.3, y - 0.3, -0.7, y + 0.3)]
        world.walls = flatland(*other, at=world.pose).walls
        world.move(robot.step(world.scan()))
        hits = len(robot.hit_points)
        if robot.is_done:
            break
    assert hits
    assert robot.activity is Activity.REACHED
