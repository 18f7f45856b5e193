"""Reports of maps with few known cells."""

import json
import math

import numpy as np
import pytest

from radarsim.autonomy.cli.map_output import as_text, view_of
from radarsim.autonomy.evaluation.map_score import Score
from radarsim.autonomy.evaluation.mapping_run import MappingRun
from radarsim.autonomy.exploration.exploration import Outcome
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.occupancy_grid import CellClass
from radarsim.autonomy.plans import ExplorationPlan
from radarsim.autonomy.watching import WatchMapper
from radarsim.client import ScannerInfo
from radarsim.geometry import Pose3
from radarsim.protocol.reports import RangeScan
from radarsim.scene.scene import Scene
from radarsim.server.host import Host


@pytest.fixture
def mapper() -> Mapper:
    """Map one scan of a server that sends no poses."""
    facts = ScannerInfo("lms200", Pose3(0, 0, 0), 0.0, 20.0, 0.1, math.pi, 181)
    mapper = Mapper(facts, motion_source="none", echo_wait=0.0)
    ranges = np.full(181, 3.0)
    assert mapper.take(RangeScan(1.0, "lms200", math.radians(1), math.pi, ranges))
    return mapper


@pytest.fixture
def watched(mapper: Mapper) -> MappingRun:
    plan = ExplorationPlan(motion_source="none")
    watch_mapper = WatchMapper(plan)
    watch_mapper.mapper = mapper
    return MappingRun(plan, watched=watch_mapper)


def test_unknown_values_are_left_out(watched: MappingRun) -> None:
    first, *doubts, cells = as_text(watched)
    assert first == "mapped what was watched: 0.00 m in 0.0 s, 1 scans"
    assert doubts == [
        "doubt    100% of the walls were seen from only one place:"
        " some may be images in mirrors or glass",
        "doubt    poses are known from scans alone,"
        " which round halls and long corridors mislead",
    ]
    assert cells.startswith("map      ")
    reported = json.loads(watched.to_json())
    assert reported["pose_errors"] is None
    assert reported["strategy"] is None
    assert reported["doubts"] == [doubt.removeprefix("doubt    ") for doubt in doubts]


def test_map_without_scans_has_no_cells() -> None:
    assert as_text(MappingRun(ExplorationPlan())) == [
        "interrupted, exploring by auto: 0.00 m in 0.0 s, 0 scans"
    ]


def test_open_map_has_no_coverage(empty_room: Scene) -> None:
    run = MappingRun(ExplorationPlan(), Host(empty_room))
    assert as_text(run)[-1] == "truth    0.00 m, collisions: 0"
    run.score = score_with(right=3, wrong=1)
    assert as_text(run)[-1] == "truth    0.00 m, 3 cells right, 1 wrong, collisions: 0"


def score_with(**known: float) -> Score:
    names = ("coverage", "reachable_coverage", "hidden_coverage")
    return dict.fromkeys(names) | known


def test_view_is_titled_in_words(mapper: Mapper, empty_room: Scene) -> None:
    run = MappingRun(ExplorationPlan(), Host(empty_room))
    run.source.outcome, run.score = Outcome.EXPLORED, score_with(hidden_coverage=0.973)
    view = view_of(run, mapper)
    assert view.title == "The floor out of the robot's reach: 97 % mapped"
    assert view.subtitle.startswith("P3AT_Radar360 maps empty_room: ")
    assert [outline.kind for outline in view.outlines] == [CellClass.OBSTACLE]
    run.source.outcome, run.score = Outcome.BROKEN_OFF, score_with(coverage=0.4)
    view = view_of(run, mapper)
    assert view.title == "40 % of the floor mapped"
    assert view.subtitle.endswith(": 0.0 m in 0 s until interrupted")


def test_view_of_an_unknown_robot_and_scene_can_be_drawn(
    mapper: Mapper, watched: MappingRun
) -> None:
    view = view_of(watched, mapper)
    assert view.title == "14 m² mapped"  # half a disc of 3 m
    assert view.subtitle.startswith("A robot that another client drives maps what it")
    assert (view.robot_class, view.outlines) == ("P3AT", ())
    other = MappingRun(ExplorationPlan(robot_class="Zerg"))
    assert view_of(other, mapper).robot_class == "P3AT"
    assert view_of(other, mapper).subtitle.startswith("Zerg maps")
