"""The maps for bugs: which goals have a path, and how wide it is."""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from shapely import Point, Polygon

from radarsim.autonomy.evaluation.shortest_path import shortest_path
from radarsim.presets.robots import load_robot
from radarsim.scene.map_file import load_map, load_variants
from radarsim.scene.scene import Scene
from radarsim.simulation.map_warnings import (
    Position,
    component_around,
    free_space,
    is_connected,
)

OPAQUE = ("bug_box", "bug_u_trap", "bug_spiral", "bug_closed_box", "bug_maze")
MAPS = (*OPAQUE, "foliage_room", "hedge_garden")
WITH_PATH = tuple(name for name in MAPS if name != "bug_closed_box")
FOLLOWED = 0.25  # m beyond the safety distance, where bugs go along boundaries
PRESSED = 0.5  # m beyond it, where they take to them
SEEN_INTO = 1.0  # m; how far a radar sees into a hedge of hedge_garden
BY_RANGES = 1.7  # m; what it has to keep there if it does not use its echoes
NEARER = 1e-3  # m


@dataclass(frozen=True)
class Task:
    """Start and goal of a trial."""

    scene: Scene
    start: Position
    goal: Position
    safety_distance: float

    @property
    def ends(self) -> tuple[Position, Position]:
        return self.start, self.goal


@cache
def task(name: str) -> Task:
    scene = load_map(name)
    assert scene.trial is not None
    start = scene.start(scene.trial.start)
    assert start is not None
    where = (start.pose.x, start.pose.y)
    return Task(scene, where, scene.trial.goal, scene.trial.safety_distance)


@pytest.mark.parametrize("name", MAPS)
def test_all_variants_load_and_have_a_trial(name: str) -> None:
    for scene in load_variants(name):
        assert scene.trial is not None
        assert scene.trial.start in {start.name for start in scene.starts}


@pytest.mark.parametrize("name", MAPS)
def test_start_and_goal_are_farther_from_obstacles_than_the_followed_boundary(
    name: str,
) -> None:
    tried = task(name)
    free = free_space(tried.scene, tried.safety_distance + FOLLOWED)
    assert all(component_around(free, place) for place in tried.ends)


@pytest.mark.parametrize("name", OPAQUE)
def test_start_and_goal_are_away_from_walls(name: str) -> None:
    tried = task(name)
    free = free_space(tried.scene, 1.1 - 1e-6)
    assert all(component_around(free, place) for place in tried.ends)


@pytest.mark.parametrize("name", MAPS)
def test_every_goal_but_that_of_the_closed_box_has_a_path(name: str) -> None:
    tried = task(name)
    robot = load_robot("P3AT_Radar360")
    clearance = math.hypot(robot.length, robot.width) / 2
    path = shortest_path(tried.scene, *tried.ends, clearance)
    connected = is_connected(tried.scene, *tried.ends, tried.safety_distance)
    assert (path is not None) is connected is (name in WITH_PATH)


@pytest.mark.parametrize("name", [*OPAQUE, "hedge_garden"])
def test_passages_are_wide_enough_to_back_off_after_contact(name: str) -> None:
    tried = task(name)
    wide = tried.safety_distance + PRESSED + 0.1
    assert is_connected(tried.scene, *tried.ends, wide) is (name in WITH_PATH)


def test_goal_of_the_closed_box_is_inside_it() -> None:
    tried = task("bug_closed_box")
    free = component_around(free_space(tried.scene, 0.0), tried.goal)
    assert free is not None
    assert free.area < 12


def test_start_of_the_spiral_is_inside_it() -> None:
    tried = task("bug_spiral")
    (spiral,) = free_space(tried.scene, 0.01).geoms[0].interiors
    assert Polygon(spiral).convex_hull.contains(Point(tried.start))
    assert not Polygon(spiral).convex_hull.contains(Point(tried.goal))


def test_radar_sees_into_hedges_but_not_through_them() -> None:
    hedges = [p for p in load_map("hedge_garden").parts if p.material.penetrable]
    assert len(hedges) == 3
    for hedge in hedges:
        assert hedge.material.density == 1 / SEEN_INTO
        assert np.ptp(hedge.vertices, axis=0)[:2].min() >= 2 * SEEN_INTO


def test_gaps_between_hedges_are_open_at_the_safety_distance_of_echoes() -> None:
    tried = task("hedge_garden")
    by_echoes = free_space(tried.scene, tried.safety_distance + PRESSED)
    by_ranges = free_space(tried.scene, BY_RANGES - SEEN_INTO + PRESSED)
    laser_too_far_away = free_space(tried.scene, BY_RANGES)
    assert len(by_echoes.geoms[0].interiors) == 3
    assert len(by_ranges.geoms[0].interiors) == 3
    assert len(laser_too_far_away.geoms[0].interiors) == 1
