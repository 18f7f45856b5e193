import math
from dataclasses import replace
from pathlib import Path

import pytest
from bug_bounds import bug_bounds

from radarsim.autonomy.evaluation.navigation_run import GroundTruthMonitor
from radarsim.autonomy.evaluation.task_runner import in_order, run_tasks
from radarsim.autonomy.evaluation.trials import (
    TrialResult,
    config_with_sensor,
    load_trial,
    run_trial,
)
from radarsim.client import Client
from radarsim.errors import MapError, PresetError
from radarsim.geometry import Pose2
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport

QUICK = ("bug_box", "bug2", "radar", 0)
CLOSED = ("bug_closed_box", "bug2", "laser", 1)
DONE = TrialResult(
    map="bug_box",
    algorithm="bug2",
    sensor="radar",
    seed=0,
    outcome="reached",
    collisions=0,
    path_length=11.41849,
    shortest_path=9.1,
    time=42.0,
    circuits=0,
    off=0.15,
    note="",
)


def test_start_names_ignore_case(tmp_path: Path) -> None:
    map_ = tmp_path / "yard.yaml"
    map_.write_text(
        """
version: 1
objects:
  - {name: floor, box: [9, 9, 0.2], position: [0, 0, -0.1], material: concrete}
starts:
  - {name: RobotStart1, position: [0, 0, 0]}
trial: {start: robotstart1, goal: [1, 0], safety_distance: 0.5}
"""
    )
    assert run_trial(str(map_), "bug2", "laser", 0).is_correct


@pytest.mark.slow
def test_results_do_not_depend_on_the_number_of_processes() -> None:
    wanted = [CLOSED, QUICK, (*QUICK[:3], 1)]
    one, two = (in_order(run_tasks(run_trial, wanted, workers=n)) for n in (1, 2))
    assert two == one


@pytest.mark.parametrize(
    ("change", "is_correct"),
    [
        pytest.param({}, True, id="as it should be"),
        pytest.param({"collisions": 1}, False, id="touched"),
        pytest.param({"outcome": "no_path"}, False, id="gave up"),
        pytest.param({"outcome": "failed"}, False, id="failed"),
        pytest.param({"shortest_path": None}, False, id="there is no path"),
        pytest.param(
            {"shortest_path": None, "outcome": "no_path"},
            True,
            id="no path, and reported",
        ),
    ],
)
def test_results_that_the_map_allows_are_correct(
    change: dict[str, object], is_correct: bool
) -> None:
    assert replace(DONE, **change).is_correct is is_correct  # type: ignore[arg-type]


def test_json_is_rounded_to_millimetres_and_has_null() -> None:
    values = replace(DONE, shortest_path=None).to_dict()
    assert values["path_length"] == 11.418
    assert values["shortest_path"] is None
    assert (values["map"], values["seed"], values["outcome"]) == (
        "bug_box",
        0,
        "reached",
    )


def test_monitor_counts_each_touch_once_and_the_true_path_length(
    empty_room: Scene,
) -> None:
    host = Host(empty_room)
    monitor = GroundTruthMonitor(host)
    assert monitor.distance((0.0, 0.0)) == math.inf
    with Client(InProcessTransport(host, after_tick=monitor.watch)) as client:
        client.spawn("P3AT", pose=Pose2(9.0, 0.0, 0.0))
        client.drive(6.0, 6.0)
        for _ in range(100):
            client.read()
        into_the_wall = monitor.path_length
        client.drive(-3.0, -3.0)
        for _ in range(20):
            client.read()
    assert monitor.collisions == 1
    assert 0.8 < into_the_wall < 1.3
    assert monitor.path_length > into_the_wall + 0.1
    assert monitor.distance((9.0, 0.0)) < into_the_wall


def test_unknown_sensor_and_a_map_without_a_trial_are_errors() -> None:
    with pytest.raises(PresetError, match="expected one of"):
        config_with_sensor("sonar")
    with pytest.raises(MapError, match="empty_room: no 'trial'"):
        load_trial("empty_room")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("map_", "shorter"),
    [
        pytest.param("bug_maze", "bug1", id="bug1 is the shorter"),
        pytest.param("bug_box", "bug2", id="bug2 is the shorter"),
    ],
)
def test_paths_keep_the_bounds_and_depend_on_the_map(map_: str, shorter: str) -> None:
    scores = {score.algorithm: score for score in _run(map_, "radar")}
    assert all(score.is_correct for score in scores.values())
    scene, trial = load_trial(map_)
    start = scene.starts[0].pose
    bounds = bug_bounds(scene, (start.x, start.y), trial.goal, trial.safety_distance)
    assert scores["bug1"].path_length <= 1.05 * bounds.bug1
    assert scores["bug2"].path_length <= 1.05 * bounds.bug2
    assert min(scores, key=lambda name: scores[name].path_length) == shorter


@pytest.mark.slow
def test_radar_and_laser_take_the_same_gaps_of_the_hedge_garden() -> None:
    radar, laser = _run("hedge_garden", "radar"), _run("hedge_garden", "laser")
    assert all(score.is_correct for score in (*radar, *laser))
    for one, other in zip(radar, laser, strict=True):
        assert one.path_length == pytest.approx(other.path_length, rel=0.1)
        assert one.path_length < 33  # around all hedges it is 37 m or more


def _run(map_: str, sensor: str) -> list[TrialResult]:
    return [run_trial(map_, algorithm, sensor, 0) for algorithm in ("bug1", "bug2")]
