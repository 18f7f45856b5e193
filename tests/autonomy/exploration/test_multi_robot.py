"""Several robots that make one map, in lockstep with a simulated server."""

import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from flat_world import Look
from office_map import office_map, row_of_rooms

from radarsim.autonomy.evaluation.mapping_run import MultiRobotRun
from radarsim.autonomy.exploration import multi_robot as map_merger
from radarsim.autonomy.exploration.exploration import Outcome
from radarsim.autonomy.exploration.multi_robot import MapMerger
from radarsim.autonomy.exploration.path_follower import WAITING, ExplorationSettings
from radarsim.autonomy.exploration.plans import ExplorationPlan, StrategyName
from radarsim.autonomy.exploration.target_allocation import (
    DEADLOCK,
    SharedTargetStrategy,
    TargetBoard,
)
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.occupancy_grid import OccupancyGrid
from radarsim.autonomy.mapping.scan_grid import RobotMap, SharedMap
from radarsim.autonomy.mapping.slam import Slam, SlamSettings
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.observation import Observation
from radarsim.errors import ClientTimeout, NavigationError
from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.protocol.reports import Ins, Report
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.server.host import Host

HERE = Pose2(0.0, 0.0)
PATHS = [
    [Pose2(x + 0.3 * k, y, 0.05 * k) for k in range(14)]
    for x, y in ((-4.5, 2.5), (-4.0, 0.0), (0.0, -2.5))
]


def run(scene: Scene, robots: int = 2, seed: int = 0, **plan: Any) -> MultiRobotRun:
    values = {"strategy": StrategyName.FRONTIERS, **plan}
    made = MultiRobotRun(ExplorationPlan(**values), robots, Host(scene, seed=seed))
    made.run(("", 0))
    made.judge()
    return made


def test_two_robots_make_one_map(empty_room: Scene) -> None:
    made = run(empty_room, time_limit=1.2)
    told = json.loads(made.result.to_json())
    assert told["outcome"] == "time_limit"
    assert [robot["start"] for robot in told["robots"]] == [
        "RobotStart1",
        "RobotStart2",
    ]
    assert told["robots"][0]["aligned"] == [0, 0, 0]
    assert told["robots"][1]["aligned"] == pytest.approx([0, 0, 0], abs=0.1)
    assert told["scans"] == sum(robot["scans"] for robot in told["robots"])
    assert told["pose_errors"]["poses"] == told["scans"]
    assert told["pose_errors"]["ate"] < 0.03
    assert told["judge"]["collisions"] == 0
    first, second = made.exploration.maps
    assert first.grid is second.grid is made.exploration.shared.grid
    ends = [trajectory.poses[-1].y for trajectory in made.result.trajectories.values()]
    assert ends == pytest.approx([0.0, 3.5], abs=0.05)


@pytest.mark.slow("sampled")
def test_robots_look_again_when_the_last_fit_moves_a_map(
    empty_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends = []
    for moved in ([False], [True, False], [True, True, False]):
        answers = [*moved, False]  # the last one when the run ends
        monkeypatch.setattr(
            MapMerger, "refine_all", lambda _, left=answers: left.pop(0)
        )
        made = run(empty_room)
        assert made.exploration.outcome is Outcome.EXPLORED
        assert answers == []
        ends.append(made.exploration.trip.time)
    # Robots look for targets once a second.
    assert [b - a for a, b in pairwise(ends)] == pytest.approx([1.0, 1.0], abs=0.3)


def explored(
    look: Look,
    walls: Floats,
    shared: SharedMap,
    path: Sequence[Pose2],
    off: Pose2 = HERE,
) -> SimpleNamespace:
    """Let a robot drive whose start pose is off; its map is put where it is right."""
    own = [pose.relative_to(off) for pose in path]
    slam = Slam(SlamSettings(motion_source="odometry"), own[0])
    map_ = shared.join(0.2)
    for k, (pose, prior) in enumerate(zip(path, own, strict=True)):
        scan = look(walls, pose, time=0.1 * k)
        slam.step(scan, prior)
        map_.add(slam.trajectory, scan)
    map_.align(off)
    return SimpleNamespace(mapper=SimpleNamespace(slam=slam))


def merger_of(shared: SharedMap, robots: Sequence[Any]) -> MapMerger:
    shared.finish()
    return MapMerger(robots, shared.robots)


def test_maps_that_contradict_each_other_are_taken_off(
    look: Look, room: Floats, monkeypatch: pytest.MonkeyPatch
) -> None:
    shared = SharedMap(0.05)
    robots = [explored(look, room, shared, path) for path in PATHS]
    merger = merger_of(shared, robots)
    merger.refine_all()
    assert None not in [map_.frame for map_ in shared.robots]
    shared.robots[2].align(Pose2(1.3, 0.0))
    with monkeypatch.context() as context:
        context.setattr(map_merger, "refine", lambda *_: None)
        assert merger.refine_all()
    assert [map_.frame is None for map_ in shared.robots] == [False, False, True]
    on_map = {id(stored.trajectory) for stored in shared.scans}
    assert on_map == {id(map_.trajectory) for map_ in shared.robots[:2]}
    # At the end it is tried once more.
    merger.finish()
    found = shared.robots[2].frame
    assert found is not None
    assert (found.x, found.y) == pytest.approx((0.0, 0.0), abs=0.05)


def test_where_only_two_others_contradict_each_other_both_are_taken_off(
    look: Look, room: Floats, nowhere: Floats, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(map_merger, "refine", lambda *_: None)
    shared = SharedMap(0.05)
    robots = [explored(look, nowhere, shared, PATHS[0])]  # which has seen nothing
    robots += [explored(look, room, shared, path) for path in PATHS[1:]]
    merger = merger_of(shared, robots)
    shared.robots[2].align(Pose2(1.3, 0.0))
    assert merger.refine_all()
    assert [map_.frame is None for map_ in shared.robots] == [False, True, True]


def test_a_map_that_is_farther_off_than_start_poses_may_be_is_taken_off(
    look: Look, room: Floats
) -> None:
    for x, is_off in ((1.4, False), (1.6, True)):
        shared = SharedMap(0.05)
        robots = [explored(look, room, shared, PATHS[0])]
        robots.append(explored(look, room, shared, PATHS[1], Pose2(x, 0.0)))
        merger_of(shared, robots).refine_all()
        assert (shared.robots[1].frame is None) is is_off


def three_rooms(starts: Sequence[tuple[float, float, float]]) -> str:
    """Return the map file of three rooms in a row.

    Args:
        starts: x and y in m, and yaw in degrees, of each start.
    """
    walls = [(x, 0.0, 0.1, 6.1) for x in (-9.0, 9.0)]
    walls += [(0.0, y, 18.1, 0.1) for y in (-3.0, 3.0)]
    # The doors are far apart: from the first room nobody sees the third one.
    walls += [(-3, -1.0, 0.1, 4.0), (-3, 2.75, 0.1, 0.5)]
    walls += [(3, 1.0, 0.1, 4.0), (3, -2.75, 0.1, 0.5)]
    walls += [(-5, -2, 0.6, 1.0), (0, 0.3, 0.4, 0.4), (6, 1.5, 1.2, 0.5)]
    objects = "".join(
        f"  - {{name: wall_{i}, box: [{length}, {width}, 1.4],"
        f" position: [{x}, {y}, 0.7], material: wall}}\n"
        for i, (x, y, length, width) in enumerate(walls)
    )
    names = "".join(
        f"  - {{name: RobotStart{k}, position: [{x}, {y}, 0], yaw_deg: {yaw}}}\n"
        for k, (x, y, yaw) in enumerate(starts, 1)
    )
    return (
        "version: 1\nmaterials:\n  wall: {density: opaque}\nobjects:\n"
        "  - {name: floor, box: [30, 30, 0.2], position: [0, 0, -0.1],"
        f" material: wall}}\n{objects}starts:\n{names}"
    )


def test_a_robot_is_on_the_map_by_what_others_than_the_first_one_have_seen(
    tmp_path: Path,
) -> None:
    aligned = []
    # Each of two neighbours sees far into the room of the other one by the door.
    first, second, third = (-6, 1.7, 0), (0, -1, 0), (5.5, -1, 0)
    for starts in ((first, third), (first, second, third)):
        path = tmp_path / "rooms.yaml"
        path.write_text(three_rooms(starts))
        made = run(load_map(path), len(starts), time_limit=1.2)
        aligned.append(json.loads(made.result.to_json())["robots"][-1]["aligned"])
    assert aligned[0] is None
    assert aligned[1][:2] == pytest.approx([0, 0], abs=0.2)
    assert aligned[1][2] == pytest.approx(0, abs=1.5)


def test_each_robot_needs_a_start(empty_room: Scene) -> None:
    with pytest.raises(NavigationError, match="3 start poses, expected 4"):
        run(empty_room, robots=4)
    with pytest.raises(NavigationError, match="expected one of"):
        run(empty_room, start="RobotStart7")
    with pytest.raises(ValueError, match="expected auto or frontiers"):
        run(empty_room, strategy=StrategyName.CONTOUR)


def strategies(fills: bool = False) -> tuple[TargetBoard, list[SharedTargetStrategy]]:
    settings = ExplorationSettings(bumpers=Bumpers(safety_distance=0.4))
    board = TargetBoard(2)
    return board, [
        SharedTargetStrategy(settings, board, k, fills=fills) for k in range(2)
    ]


def turn_round(strategy: SharedTargetStrategy, seen: Observation, grid: Any) -> None:
    """Let a robot look, and turn once, so that it drives from its next scan on."""
    for k in range(30):
        pose = Pose2(seen.pose.x, seen.pose.y, 0.5 * k)
        strategy.step(Observation(0.1 * k, pose, seen.bearings, seen.ranges), grid)


@pytest.mark.slow
def test_a_robot_whose_antenna_does_not_turn_is_named(empty_room: Scene) -> None:
    plan = ExplorationPlan(
        strategy=StrategyName.FRONTIERS,
        robot_class="P3AT_Navtech",
        scanner="Navtech",
    )
    made = MultiRobotRun(plan, 2, Host(empty_room, seed=0))
    expected = "^robot 2 at RobotStart2: no scan of 'Navtech' .* expected one robot, or"
    with pytest.raises(ClientTimeout, match=expected):
        made.run(("", 0))
    robots = json.loads(made.result.to_json())["robots"]
    assert robots[0]["error"] is None
    assert robots[1]["error"].startswith("no scan of 'Navtech'")


def test_robots_drive_to_different_frontiers(look: Look, room: Floats) -> None:
    grid, poses = OccupancyGrid(), (Pose2(-4.5, 2.5), Pose2(-4.5, 3.0))
    for pose in poses:
        grid.add(pose, look(room, pose).within(4.0))
    board, robots = strategies()
    for number, (robot, pose) in enumerate(zip(robots, poses, strict=True)):
        scan = look(room, pose)
        seen = Observation(9.0, pose, scan.angles, scan.known_range)
        board.note_pose(number, Pose2(9.0 * number, 0.0), is_on_map=False)
        turn_round(robot, seen, grid)
        robot.step(seen, grid)
        assert robot.activity == "frontier"
        assert number in board.targets
    (x, y), (other_x, other_y) = board.targets.values()
    assert (x - other_x) ** 2 + (y - other_y) ** 2 > 2.0**2
    assert board.other_targets(0) == [(other_x, other_y)]


def test_robots_wait_for_each_other_and_are_done_together(
    look: Look, room: Floats
) -> None:
    grid, pose = OccupancyGrid(), Pose2(-4.5, 2.5)
    for x, y in ((-4.5, 2.5), (4.5, 2.5), (4.5, -2.5), (-4.5, -3.5), (0.0, 0.0)):
        grid.add(Pose2(x, y), look(room, Pose2(x, y)))
    board, (robot, other) = strategies()
    scan = look(room, pose)
    seen = Observation(9.0, pose, scan.angles, scan.known_range)
    turn_round(robot, seen, grid)
    robot.step(seen, grid)
    assert robot.activity == WAITING  # all is sensed
    assert not robot.is_done
    board.leave(1)
    robot.step(Observation(9.1, pose, seen.bearings, seen.ranges), grid)
    assert robot.is_done
    assert not other.is_done


def test_robots_that_only_wait_for_each_other_give_up() -> None:
    board = TargetBoard(2)
    board.targets[0] = (1.0, 2.0)
    assert not board.is_over(5.0)
    del board.targets[0]
    assert not board.is_over(5.0 + DEADLOCK)
    assert board.is_over(5.1 + DEADLOCK)


def test_of_two_robots_near_each_other_only_one_moves() -> None:
    board = TargetBoard(3)
    for number, x in enumerate((0.0, 0.9, 9.0)):
        board.note_pose(number, Pose2(x, 0.0), is_on_map=True)
    assert [board.may_move(k, wants_to=True) for k in range(3)] == [True, False, True]
    assert not board.may_move(0, wants_to=False)
    assert board.may_move(1, wants_to=True)  # the first one waits
    assert board.may_move(0, wants_to=True)
    assert not board.may_move(1, wants_to=True)
    board.leave(0)
    assert board.may_move(1, wants_to=True)


def test_robots_that_may_be_near_each_other_give_way_too() -> None:
    board = TargetBoard(2)
    board.note_pose(0, Pose2(0.0, 0.0), is_on_map=True)
    assert board.may_move(0, wants_to=True)
    assert not board.may_move(1, wants_to=True)  # nobody knows where it is
    board.note_pose(1, Pose2(2.4, 0.0), is_on_map=False)
    assert not board.may_move(1, wants_to=True)
    board.note_pose(1, Pose2(2.8, 0.0), is_on_map=False)
    assert board.may_move(1, wants_to=True)
    board.note_pose(1, Pose2(1.3, 0.0), is_on_map=True)
    assert board.may_move(1, wants_to=True)


LAYOUTS = {  # x and y, m, and yaw, deg
    "side by side": ((-6, 0.8, 0), (-6, 1.6, 0)),
    "face to face": ((-6, 1, 0), (-4.8, 1, 180)),
    "one behind the other": ((-6, 1, 0), (-5.1, 1, 0)),
    "three": ((-6, 1, 0), (-6, 1.85, 0), (-5.1, 1.4, 90)),
}


@pytest.mark.slow
@pytest.mark.parametrize("is_aligned", [True, False])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_robots_that_start_near_each_other_do_not_touch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, layout: str, is_aligned: bool
) -> None:
    if not is_aligned:
        monkeypatch.setattr(map_merger, "align", lambda *_: None)
    starts = LAYOUTS[layout]
    path = tmp_path / "rooms.yaml"
    path.write_text(three_rooms(starts))
    made = run(load_map(path), len(starts), strategy=StrategyName.AUTO, time_limit=25)
    told = json.loads(made.result.to_json())
    assert told["judge"]["collisions"] == 0
    assert (told["robots"][1]["aligned"] is not None) is is_aligned
    assert told["path_length"] > 3.0


@pytest.mark.slow
def test_two_robots_explore_an_office_sooner_than_one(tmp_path: Path) -> None:
    path = tmp_path / "office.yaml"
    path.write_text(office_map(1.2))
    scene, times = load_map(path), []
    for robots in (1, 2):
        made = run(scene, robots, safety_distance=0.38)
        told = json.loads(made.result.to_json())
        assert made.exploration.outcome is Outcome.EXPLORED
        assert told["judge"]["collisions"] == 0
        assert told["judge"]["reachable_coverage"] > 0.95
        assert told["judge"]["misplaced"] < 0.005
        times.append(told["time"])
    assert times[1] < 0.8 * times[0]


def misplace(monkeypatch: pytest.MonkeyPatch, offsets: Sequence[Pose2]) -> None:
    """Let the INS of each robot begin beside its start, by x, y in m and a yaw."""
    take = Mapper.take
    starts: dict[int, tuple[Pose2, Pose2]] = {}

    def shifted(mapper: Mapper, report: Report) -> Observation | None:
        shared = getattr(mapper, "_grid", None)
        if isinstance(report, Ins) and isinstance(shared, RobotMap):
            pose = report.pose
            at = Pose2(pose.x, pose.y, pose.yaw)
            if id(mapper) not in starts:
                off = offsets[len(starts)]
                starts[id(mapper)] = (
                    at,
                    Pose2(at.x + off.x, at.y + off.y, at.yaw + off.yaw),
                )
            start, told = starts[id(mapper)]
            at = told.compose(at.relative_to(start))
            moved = Pose3(at.x, at.y, pose.z, pose.roll, pose.pitch, at.yaw)
            report = replace(report, pose=moved)
        return take(mapper, report)

    monkeypatch.setattr(Mapper, "take", shifted)


# x and y, m, and yaw, rad, by which the start poses of three robots are off, and the
# greatest error of their places, m
OFF = [
    ([Pose2(0, 0), Pose2(0, 0), Pose2(0, 0)], 0.1),
    ([Pose2(0, 0), Pose2(1.2, 0), Pose2(-1.2, 0)], 0.1),
    ([Pose2(0, 0), Pose2(-1.2, 0, 0.05), Pose2(1.1, 0.3, -0.05)], 0.2),
]


@pytest.mark.slow
@pytest.mark.parametrize(("offsets", "most"), OFF)
def test_robots_in_equal_rooms_are_where_they_are_or_not_on_the_map(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    offsets: Sequence[Pose2],
    most: float,
) -> None:
    path = tmp_path / "rooms.yaml"
    path.write_text(row_of_rooms())
    misplace(monkeypatch, offsets)
    made = run(load_map(path), 3, seed=1, safety_distance=0.38)
    told = json.loads(made.result.to_json())
    assert told["judge"]["collisions"] == 0
    is_whole = True
    for robot in told["robots"]:
        is_whole = is_whole and robot["aligned"] is not None
        assert robot["aligned"] is None or robot["ate"] < most
    assert told["outcome"] == ("explored" if is_whole else "incomplete")
