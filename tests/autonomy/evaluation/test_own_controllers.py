"""A controller of one's own is judged by the truth, as the package's navigators are."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from random_trials import mission_to

import radarsim
from radarsim.autonomy.evaluation.own_controllers import Evaluation, evaluate
from radarsim.autonomy.evaluation.trials import run_trial
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.navigation.mission import run_mission
from radarsim.errors import MapError, NavigationError, PresetError
from radarsim.geometry import Point, wrap_angle
from radarsim.local import LocalRobot

MAPS = "bug_box", "bug_closed_box"  # the goal of the second one is shut in
YARD = """
version: 1
objects: [{name: post, box: [0.4, 0.4, 1], material: concrete}]
starts: [{name: RobotStart1, position: [-1.5, 0, 0]}]
trial: {start: RobotStart1, goal: [1.2, 0], safety_distance: 0.5}
"""


def tangent_bug(robot: LocalRobot, goal: Point) -> bool:
    """Let a navigator of the package drive."""
    trial = robot.simulation.scene.trial
    assert trial is not None
    mission = mission_to(goal, "tangentbug", safety_distance=trial.safety_distance)
    return run_mission(robot.as_client(), mission, info=robot.info).outcome == "reached"


def drive_straight(robot: LocalRobot, goal: Point) -> None:
    """Drive to a point, through obstacles."""
    while math.dist((robot.pose.x, robot.pose.y), goal) > 0.2:
        pose = robot.pose
        bearing = math.atan2(goal[1] - pose.y, goal[0] - pose.x) - pose.yaw
        robot.drive(0.3, turn=wrap_angle(bearing))
        robot.simulation.step(0.1)


def stand_still(*_: object) -> None:
    """Say that the goal is reached."""


def test_navigator_of_the_package_is_judged_as_by_trials(tmp_path: Path) -> None:
    yard = tmp_path / "yard.yaml"
    yard.write_text(YARD)
    (row,) = evaluate(tangent_bug, maps=[yard], seeds=[1]).rows
    known = run_trial(str(yard), "tangentbug", "radar", 1)
    assert row.outcome == known.outcome == "reached"
    assert row.is_correct
    assert (row.map, row.algorithm) == (str(yard), "tangent_bug")
    assert row.shortest_path == known.shortest_path
    assert row.path_length == pytest.approx(known.path_length, rel=0.1)


def test_touches_and_false_claims_are_no_success(tmp_path: Path) -> None:
    straight = evaluate(
        drive_straight, maps=MAPS[:1], seeds=2, time_limit=40, pictures=tmp_path / "p"
    )
    assert [row.outcome for row in straight.rows] == ["failed"] * 2
    assert straight.rows[0].note == "not there after 40 s"
    assert straight.rows[0].time == pytest.approx(40)
    assert straight.rows[0].collisions > 0
    names = sorted(path.name for path in (tmp_path / "p").iterdir())
    assert names == ["bug_box-0.png", "bug_box-1.png"]
    (still,) = evaluate(stand_still, maps=MAPS[:1], seeds=1).rows
    assert still.outcome == "failed"
    assert still.note.startswith("says reached, ")
    assert still.time == 0.1


def test_claim_that_there_is_no_path_is_right_where_there_is_none() -> None:
    found = evaluate(lambda *_: False, maps=MAPS, seeds=3, workers=2)
    assert {name: each.value for name, each in found.success.items()} == {
        "bug_box": 0.0,
        "bug_closed_box": 1.0,
        "all": 0.5,
    }
    assert found.detour == {}


def test_table_shows_intervals() -> None:
    (row,) = evaluate(lambda *_: False, maps=["bug_closed_box"], seeds=1).rows
    # Wilson's interval of 10 of 10 begins at 1 / (1 + z² / 10), with z = 1.96.
    found = Evaluation((row,) * 10)
    text = "bug_closed_box: 100% (72% to 100%) of 10 right"
    assert str(found) == text
    other = replace(row, map="bug_box")
    lines = str(Evaluation((*found.rows, other))).splitlines()
    # A single run has no interval, and shares of several maps have a line of their own.
    assert lines[:2] == [text, "bug_box: 100% of 1 right"]
    assert lines[2].startswith("all: ")


def test_controller_that_lets_no_time_pass_is_an_error() -> None:
    def forget_to_step(robot: LocalRobot, _: Point) -> None:
        while True:
            robot.drive(0.1)

    with pytest.raises(ValueError, match="the same simulated time, expected a call"):
        evaluate(forget_to_step, maps=MAPS[:1], seeds=1)


def test_errors_of_navigators_fail_a_run_and_others_end_the_evaluation() -> None:
    def give_up(*_: object) -> None:
        raise NavigationError("too wide")

    def divide(*_: object) -> float:
        return 1 / 0

    (row,) = evaluate(give_up, maps=MAPS[:1], seeds=1).rows
    assert (row.outcome, row.note) == ("failed", "too wide")
    with pytest.raises(ZeroDivisionError) as error:
        evaluate(divide, maps=MAPS[:1], seeds=[7])
    assert error.value.__notes__ == ["on map bug_box, seed 7, at 0.10 s"]


@pytest.mark.parametrize(
    ("options", "kind", "text"),
    [
        ({"maps": ["bug_bx"]}, MapError, "did you mean 'bug_box'"),
        ({"maps": ["empty_room"]}, MapError, "no 'trial'"),
        ({"sensor": "lasr"}, PresetError, "did you mean 'laser'"),
        ({"seeds": 0}, ValueError, "at least one map and one seed"),
    ],
)
def test_mistakes_are_found_before_any_run(
    options: dict[str, Any], kind: type[Exception], text: str
) -> None:
    with pytest.raises(kind, match=text):
        radarsim.evaluate(stand_still, **options)


def test_mapper_takes_the_reports_of_a_robot() -> None:
    sim = radarsim.simulate("empty_room")
    robot = sim.spawn("P3AT_SICK")
    robot.request_echoes()
    mapper = Mapper(robot.info.scanner())
    robot.drive(0.3, turn=0.2)
    for _ in range(50):
        sim.step(0.1)
        for report in robot.reports:
            mapper.take(report)
    assert mapper.scans > 40
    pose, truth = mapper.trajectory.poses[-1], robot.pose
    assert math.dist((pose.x, pose.y), (truth.x, truth.y)) < 0.2
