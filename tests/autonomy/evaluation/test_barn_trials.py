"""Trials on worlds of BARN: what is read, and how runs are scored."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import shapely

from radarsim.autonomy.evaluation.barn_trials import (
    BarnClock,
    BarnTrialSpec,
    all_barn_trials,
    find_worlds,
    optimal_time,
    read_cylinders,
    read_path,
    run_barn_trial,
    score_of,
)
from radarsim.autonomy.evaluation.task_runner import split_tasks
from radarsim.errors import ForeignFileError
from radarsim.generators.barn_worlds import make_barn_world
from radarsim.generators.random_maps import SAFETY_DISTANCE, Disc, RandomMap
from radarsim.geometry import Pose2
from radarsim.server.host import Host

WORLD = """\
<sdf version='1.6'>
  <world name='default'>
    <model name='unit_cylinder_0'>
      <static>1</static>\\
      <pose frame=''>-2.025 6.5 0 0 0 0</pose>
      <link name='link'>
        <collision name='collision'>
          <geometry><cylinder><radius>0.075</radius></cylinder></geometry>
        </collision>
      </link>
    </model>
  </world>
</sdf>
"""


def write_world(folder: Path, number: int, *, paths: str = "path_files") -> None:
    """Write a world of the generator as the benchmark does."""
    world = make_barn_world(number)
    (folder / paths).mkdir(parents=True, exist_ok=True)
    (folder / f"world_{number}.world").write_text(world.as_sdf())
    np.save(folder / paths / f"path_{number}.npy", world.path)


def test_world_is_read_as_it_was_drawn(tmp_path: Path) -> None:
    write_world(tmp_path, 3)
    discs = read_cylinders(tmp_path / "world_3.world")
    found = np.array([(disc.x, disc.y) for disc in discs])
    assert found == pytest.approx(make_barn_world(3).centres())
    assert {disc.radius for disc in discs} == {0.075}


def test_map_is_turned_so_that_the_robot_starts_along_x(tmp_path: Path) -> None:
    file = tmp_path / "world_0.world"
    file.write_text(WORLD)
    np.save(tmp_path / "path_0.npy", [[15, 0], [15, 29]])
    map_, time = BarnTrialSpec(0, "planned", "laser", file, find(tmp_path)).read()
    (disc,) = map_.solids
    assert (disc.x, disc.y) == pytest.approx((6.5, 2.025))
    assert (map_.start, map_.goal) == ((3.0, 2.25), (13.0, 2.25))
    # from the start at y = 3 m straight to the first cell, and on to the goal
    first, last = (-2.325, 5.075), (-2.325, 9.425)
    ways = math.dist((-2.25, 3), first) + 4.35 + math.dist(last, (-2.25, 13))
    assert time == pytest.approx(ways / 2)


def find(folder: Path) -> Path:
    ((_, path),) = find_worlds(folder).values()
    return path


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        pytest.param(
            "<static>1</static>\\", "<static>1<static>\\", ":11: no XML", id="open"
        ),
        pytest.param("0.075", "-1", ":8: <radius> -1", id="radius"),
        pytest.param("cylinder><radius", "box><radius", ":8: no XML", id="tag"),
        pytest.param("-2.025 6.5 0 0 0 0", "1 2", ":5: '1 2'", id="pose"),
        pytest.param("6.5 0 0", "6.5 0 .1", ":5: '-2.025", id="tilted"),
        pytest.param("unit_", "<", ":3: no XML", id="name"),
        pytest.param("geometry", "size", ":7: no shape", id="shape"),
    ],
)
def test_wrong_world_names_file_and_line(
    tmp_path: Path, old: str, new: str, place: str
) -> None:
    file = tmp_path / "world_7.world"
    file.write_text(WORLD.replace(old, new))
    with pytest.raises(ForeignFileError) as caught:
        read_cylinders(file)
    assert f"world_7.world{place}" in str(caught.value)


@pytest.mark.parametrize("text", ["<a/>", "<sdf/>", "<sdf><world/></sdf>"])
def test_world_without_cylinders_is_wrong(tmp_path: Path, text: str) -> None:
    file = tmp_path / "world_7.world"
    file.write_text(text)
    with pytest.raises(ForeignFileError, match=r"world_7\.world:1: .*expected"):
        read_cylinders(file)


@pytest.mark.parametrize(
    "cells",
    [
        pytest.param(np.array([{"a": 1}], object), id="pickle"),
        pytest.param(np.zeros((3, 3)), id="three columns"),
        pytest.param(np.zeros((0, 2)), id="empty"),
        pytest.param(np.array([[0.0, math.nan]]), id="nan"),
        pytest.param(np.array([["a", "b"]]), id="text"),
    ],
)
def test_path_is_an_array_of_cells(tmp_path: Path, cells: Any) -> None:
    file = tmp_path / "path_7.npy"
    np.save(file, cells, allow_pickle=True)
    with pytest.raises(ForeignFileError, match=r"path_7\.npy: .*expected"):
        read_path(file)
    file.write_bytes(b"\x93NUMPY\x01")
    with pytest.raises(ForeignFileError, match=r"path_7\.npy: no array"):
        read_path(file)


def test_worlds_are_found_with_their_paths(tmp_path: Path) -> None:
    with pytest.raises(ForeignFileError, match=r"no world_N\.world"):
        find_worlds(tmp_path)
    (tmp_path / "world_files").mkdir()
    for name in ("world_10.world", "world_2.world", "world_x.world"):
        (tmp_path / "world_files" / name).write_text(WORLD)
    with pytest.raises(ForeignFileError, match=r"no path_10\.npy"):
        find_worlds(tmp_path)
    (tmp_path / "path_files").mkdir()
    for number in (2, 10):
        np.save(tmp_path / "path_files" / f"path_{number}.npy", [[1, 2]])
    assert list(find_worlds(tmp_path)) == [2, 10]
    done = [
        {"number": number, "algorithm": "bug2", "sensor": sensor}
        for number, sensor in ((2, "laser"), (3, "laser"), (10, "radar"))
    ]
    specs = all_barn_trials(tmp_path, ["bug2", "planned"], ["laser"])
    left, results = split_tasks(specs, done, ("number", "algorithm", "sensor"))
    assert results == done[:1]
    assert [(spec.number, spec.algorithm) for spec in left] == [
        (2, "planned"),
        (10, "bug2"),
        (10, "planned"),
    ]
    (tmp_path / "world_2.world").write_text(WORLD)
    with pytest.raises(ForeignFileError, match="second world of number 2"):
        find_worlds(tmp_path)


@pytest.mark.parametrize(
    ("actual", "score"),
    [(None, 0.0), (1.0, 0.5), (10.0, 0.5), (25.0, 0.2), (40.0, 0.125), (90.0, 0.125)],
)
def test_score_is_that_of_the_benchmark(actual: float | None, score: float) -> None:
    """It is OT / clip(AT, 2 OT, 8 OT), here of OT = 5 s."""
    path = np.array([[-2.25, 8.0]])
    assert optimal_time(path) == pytest.approx(5.0)
    assert score_of(actual, 5.0) == pytest.approx(score)


def clock_after(*steps: tuple[float, float, bool]) -> float | None:
    """Return the time of a drive from 3, 0 to 13, 0 by times, places and touches."""
    robot = SimpleNamespace(pose=Pose2(3.0, 0.0), touched=False)
    simulation = SimpleNamespace(time=0.0, vehicles=[])
    host = SimpleNamespace(simulation=simulation)
    clock = BarnClock(cast(Host, host), (3.0, 0.0), (13.0, 0.0))
    clock.watch()
    simulation.vehicles.append(SimpleNamespace(robot=robot))
    for simulation.time, x, robot.touched in steps:
        robot.pose = Pose2(x, 0.0)
        clock.watch()
    return clock.actual_time


def test_time_counts_from_the_first_motion_to_a_metre_from_the_goal() -> None:
    begin = (5.0, 3.05, False), (6.0, 3.2, False)
    assert clock_after(*begin, (30.0, 11.9, False)) is None
    assert clock_after(*begin, (30.0, 12.1, False), (31.0, 13.0, False)) == 24.0
    assert clock_after(*begin, (107.0, 8.0, False), (108.0, 13.0, False)) is None
    assert clock_after(*begin, (9.0, 5.0, True), (30.0, 12.1, False)) is None


@pytest.mark.slow
@pytest.mark.parametrize("number", [2, 3])
def test_field_in_which_no_disc_keeps_its_distance_is_crossed(
    tmp_path: Path, number: int
) -> None:
    write_world(tmp_path, number)
    (spec,) = all_barn_trials(tmp_path, ["planned"], ["laser"])
    map_, _ = spec.read()
    assert not is_open_to_discs(map_, SAFETY_DISTANCE)
    result = run_barn_trial(spec)
    assert (result.outcome, result.collisions) == ("reached", 0)
    assert result.success
    assert result.shortest_path is not None
    assert result.path_length <= 1.15 * result.shortest_path


def is_open_to_discs(map_: RandomMap, radius: float) -> bool:
    """Return whether start and goal are connected for a disc, among its cylinders."""
    discs = [
        shapely.Point(solid.x, solid.y).buffer(solid.radius + radius)
        for solid in map_.solids
        if isinstance(solid, Disc)
    ]
    free = shapely.box(-1, -3, 14, 8).difference(shapely.union_all(discs))
    start, goal = shapely.Point(map_.start), shapely.Point(map_.goal)
    return any(
        part.contains(start) and part.contains(goal) for part in shapely.get_parts(free)
    )
