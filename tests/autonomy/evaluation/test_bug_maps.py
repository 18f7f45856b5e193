"""The maps for bugs, run with ideal bugs that know the map exactly."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import pytest
import shapely
from bug_bounds import bug_bounds
from shapely import LineString, Point, Polygon
from shapely.geometry.polygon import orient
from shapely.ops import substring

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


@dataclass
class BugRun:
    """The run of an ideal bug, which follows the edge of the free space."""

    free: Polygon
    start: Position
    goal: Position
    outcome: str = ""
    length: float = 0.0
    hits: list[Position] = field(default_factory=list)

    def go(self, here: Position) -> tuple[LineString, float] | None:
        """Go towards the goal; return the boundary met and the position along it, m."""
        line = LineString([here, self.goal])
        wide = self.free.buffer(1e-6, join_style="mitre")
        first = shapely.get_parts(shapely.intersection(wide, line))
        segment = min(first, key=Point(here).distance)
        self.length += segment.length
        if segment.length > line.length - NEARER:
            self.outcome = "reached"
            return None
        hit = line.interpolate(segment.length)
        # clockwise around the free space: obstacles are on the left hand
        rings = shapely.get_rings(orient(self.free, -1.0)).tolist()
        ring = LineString(min(rings, key=hit.distance).coords)
        self.hits.append((hit.x, hit.y))
        return ring, ring.project(hit)

    def is_free(self, here: Position) -> bool:
        """Return whether the goal's direction is free."""
        away = math.dist(here, self.goal)
        ahead = substring(LineString([here, self.goal]), NEARER, min(0.05, away))
        return bool(self.free.covers(ahead))


def bug1(free: Polygon, start: Position, goal: Position) -> BugRun:
    run = BugRun(free, start, goal)
    here = start
    while met := run.go(here):
        ring, hit = met
        leave = ring.project(Point(goal))
        there = (leave - hit) % ring.length
        run.length += ring.length + min(there, ring.length - there)
        here = ring.interpolate(leave).coords[0]
        if not run.is_free(here):
            run.outcome = "no_path"
            return run
    return run


def bug2(
    free: Polygon, start: Position, goal: Position, *, patient: bool = True
) -> BugRun:
    """Follow Bug2; one that is not patient gives up where the line is no nearer."""
    run = BugRun(free, start, goal)
    line = LineString([start, goal])
    here: Position | None = start
    while here and (met := run.go(here)):
        ring, hit = met
        crossings = shapely.get_coordinates(shapely.intersection(ring, line)).tolist()
        candidates = sorted(
            ((ring.project(Point(each)) - hit) % ring.length, (each[0], each[1]))
            for each in crossings
        )
        candidates = [
            each for each in candidates if NEARER < each[0] < ring.length - NEARER
        ]
        far = math.dist(run.hits[-1], goal) - NEARER
        nearer = [each for each in candidates if math.dist(each[1], goal) < far]
        leaves = [each for each in nearer if run.is_free(each[1])]
        gives_up = not patient and candidates[:1] != nearer[:1]
        if gives_up or not leaves:
            run.outcome = "no_path"
            run.length += candidates[0][0] if gives_up else ring.length
            return run
        run.length += leaves[0][0]
        here = leaves[0][1]
    return run


def followed_edge(
    name: str, *, kept: float | None = None
) -> tuple[Polygon, Position, Position]:
    """Return the edge that bugs follow on a map, the start and the goal.

    They keep the map's safety distance, unless another is given, m.
    """
    tried = task(name)
    distance = (tried.safety_distance if kept is None else kept) + FOLLOWED
    free = component_around(free_space(tried.scene, distance), tried.start)
    assert free is not None
    return free, *tried.ends


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


@pytest.mark.parametrize("name", MAPS)
def test_ideal_bugs_stay_within_their_bounds(name: str) -> None:
    tried = task(name)
    bounds = bug_bounds(tried.scene, *tried.ends, tried.safety_distance)
    outcome = "reached" if name in WITH_PATH else "no_path"
    one, two = bug1(*followed_edge(name)), bug2(*followed_edge(name))
    assert one.outcome == two.outcome == outcome
    assert one.length <= bounds.bug1
    assert two.length <= bounds.bug2


@pytest.mark.parametrize("name", MAPS)
def test_no_path_is_longer_than_ins_is_accurate(name: str) -> None:
    assert bug1(*followed_edge(name)).length < 100
    assert bug2(*followed_edge(name)).length < 100


@pytest.mark.parametrize("name", [n for n in OPAQUE if n != "bug_maze"])
def test_ideal_bug_meets_a_single_obstacle_once(name: str) -> None:
    assert (
        len(bug1(*followed_edge(name)).hits)
        == len(bug2(*followed_edge(name)).hits)
        == 1
    )


def test_bug2_is_much_shorter_at_the_box() -> None:
    assert (
        bug2(*followed_edge("bug_box")).length
        < 0.5 * bug1(*followed_edge("bug_box")).length
    )


def test_bug1_is_shorter_in_the_maze() -> None:
    assert (
        bug1(*followed_edge("bug_maze")).length
        < 0.92 * bug2(*followed_edge("bug_maze")).length
    )


def test_bug_that_gives_up_at_the_line_misses_the_path_of_the_maze() -> None:
    hasty = bug2(*followed_edge("bug_maze"), patient=False)
    assert hasty.outcome == "no_path"
    assert bug2(*followed_edge("bug_maze")).hits == hasty.hits


@pytest.mark.parametrize("name", [n for n in OPAQUE if n != "bug_maze"])
def test_give_up_rules_of_bug2_are_equal_on_other_maps(name: str) -> None:
    hasty, patient = (
        bug2(*followed_edge(name), patient=False),
        bug2(*followed_edge(name)),
    )
    assert hasty.outcome == patient.outcome
    assert hasty.length == pytest.approx(patient.length)


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


@pytest.mark.parametrize("bug", [bug1, bug2])
def test_keeping_no_more_than_needed_halves_the_path(
    bug: Callable[[Polygon, Position, Position], BugRun],
) -> None:
    near = bug(*followed_edge("hedge_garden"))
    assert near.outcome == "reached"
    assert (
        near.length < 0.5 * bug(*followed_edge("hedge_garden", kept=BY_RANGES)).length
    )
