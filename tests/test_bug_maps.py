"""The maps for bugs, tried with bugs that know exactly where everything is."""

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

from radarsim.evaluation.free_space import (
    Position,
    component_around,
    free_space,
    is_connected,
)
from radarsim.evaluation.shortest_path import shortest_path
from radarsim.presets.robots import load_robot
from radarsim.scene.map_file import load_map, load_variants
from radarsim.scene.scene import Scene

OPAQUE = ("bug_box", "bug_u_trap", "bug_spiral", "bug_closed_box", "bug_maze")
MAPS = (*OPAQUE, "foliage_room", "hedge_garden")
WITH_PATH = tuple(name for name in MAPS if name != "bug_closed_box")
FOLLOWED = 0.25  # m beyond the safety distance, where bugs go along boundaries
PRESSED = 0.5  # m beyond it, where they take to them
SEEN_INTO = 1.0  # m; how far a radar sees into a hedge of hedge_garden
NEARER = 1e-3  # m


@dataclass(frozen=True)
class Task:
    """Where a trial is to go."""

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
class RayState:
    """What an ideal bug does: it goes along the edge of where it may be."""

    free: Polygon
    start: Position
    goal: Position
    outcome: str = ""
    length: float = 0.0
    hits: list[Position] = field(default_factory=list)

    def go(self, here: Position) -> tuple[LineString, float] | None:
        """Go towards the goal; give the boundary in the way, and where on it."""
        line = LineString([here, self.goal])
        wide = self.free.buffer(1e-6, join_style="mitre")
        first = shapely.get_parts(shapely.intersection(wide, line))
        way = min(first, key=Point(here).distance)
        self.length += way.length
        if way.length > line.length - NEARER:
            self.outcome = "reached"
            return None
        hit = line.interpolate(way.length)
        # clockwise around what is free: obstacles are on the left hand
        rings = shapely.get_rings(orient(self.free, -1.0)).tolist()
        ring = LineString(min(rings, key=hit.distance).coords)
        self.hits.append((hit.x, hit.y))
        return ring, ring.project(hit)

    def is_free(self, here: Position) -> bool:
        """Tell whether the goal's direction is free."""
        away = math.dist(here, self.goal)
        ahead = substring(LineString([here, self.goal]), NEARER, min(0.05, away))
        return bool(self.free.covers(ahead))


def bug1(free: Polygon, start: Position, goal: Position) -> RayState:
    walk = RayState(free, start, goal)
    here = start
    while met := walk.go(here):
        ring, hit = met
        leave = ring.project(Point(goal))
        there = (leave - hit) % ring.length
        walk.length += ring.length + min(there, ring.length - there)
        here = ring.interpolate(leave).coords[0]
        if not walk.is_free(here):
            walk.outcome = "no_path"
            return walk
    return walk


def bug2(
    free: Polygon, start: Position, goal: Position, *, patient: bool = True
) -> RayState:
    """Follow Bug2; one that is not patient gives up where the line is no nearer."""
    walk = RayState(free, start, goal)
    line = LineString([start, goal])
    here: Position | None = start
    while here and (met := walk.go(here)):
        ring, hit = met
        crossings = shapely.get_coordinates(shapely.intersection(ring, line)).tolist()
        ways = sorted(
            ((ring.project(Point(each)) - hit) % ring.length, (each[0], each[1]))
            for each in crossings
        )
        ways = [way for way in ways if NEARER < way[0] < ring.length - NEARER]
        far = math.dist(walk.hits[-1], goal) - NEARER
        nearer = [way for way in ways if math.dist(way[1], goal) < far]
        leaves = [way for way in nearer if walk.is_free(way[1])]
        gives_up = not patient and ways[:1] != nearer[:1]
        if gives_up or not leaves:
            walk.outcome = "no_path"
            walk.length += ways[0][0] if gives_up else ring.length
            return walk
        walk.length += leaves[0][0]
        here = leaves[0][1]
    return walk


def along(name: str, *, seen_into: float = 0.0) -> tuple[Polygon, Position, Position]:
    """Give the edge that bugs follow on a map, and the ends of their way."""
    tried = task(name)
    distance = tried.safety_distance + FOLLOWED - seen_into
    free = component_around(free_space(tried.scene, distance), tried.start)
    assert free is not None
    return free, *tried.ends


@pytest.mark.parametrize("name", MAPS)
def test_all_variants_load_and_have_a_trial(name: str) -> None:
    for scene in load_variants(name):
        assert scene.trial is not None
        assert scene.trial.start in {start.name for start in scene.starts}


@pytest.mark.parametrize("name", MAPS)
def test_start_and_goal_are_farther_from_everything_than_is_followed(name: str) -> None:
    tried = task(name)
    free = free_space(tried.scene, tried.safety_distance + FOLLOWED)
    assert all(component_around(free, place) for place in tried.ends)


@pytest.mark.parametrize("name", OPAQUE)
def test_start_and_goal_are_away_from_walls(name: str) -> None:
    tried = task(name)
    free = free_space(tried.scene, 1.1 - 1e-6)
    assert all(component_around(free, place) for place in tried.ends)


@pytest.mark.parametrize("name", MAPS)
def test_there_is_a_path_but_to_the_closed_box(name: str) -> None:
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
def test_ideal_bugs_find_out_within_their_bounds(name: str) -> None:
    tried = task(name)
    bounds = bug_bounds(tried.scene, *tried.ends, tried.safety_distance)
    outcome = "reached" if name in WITH_PATH else "no_path"
    one, two = bug1(*along(name)), bug2(*along(name))
    assert one.outcome == two.outcome == outcome
    assert one.length <= bounds.bug1
    assert two.length <= bounds.bug2


@pytest.mark.parametrize("name", MAPS)
def test_no_path_is_longer_than_ins_is_accurate(name: str) -> None:
    assert bug1(*along(name)).length < 100
    assert bug2(*along(name)).length < 100


@pytest.mark.parametrize("name", [n for n in OPAQUE if n != "bug_maze"])
def test_an_ideal_bug_meets_one_obstacle_once(name: str) -> None:
    assert len(bug1(*along(name)).hits) == len(bug2(*along(name)).hits) == 1


def test_on_the_box_bug2_is_the_shorter_by_far() -> None:
    assert bug2(*along("bug_box")).length < 0.5 * bug1(*along("bug_box")).length


def test_in_the_maze_bug1_is_the_shorter() -> None:
    assert bug1(*along("bug_maze")).length < 0.92 * bug2(*along("bug_maze")).length


def test_bug_that_gives_up_at_the_line_misses_the_path_of_the_maze() -> None:
    hasty = bug2(*along("bug_maze"), patient=False)
    assert hasty.outcome == "no_path"
    assert bug2(*along("bug_maze")).hits == hasty.hits


@pytest.mark.parametrize("name", [n for n in OPAQUE if n != "bug_maze"])
def test_elsewhere_it_makes_no_difference_when_bug2_gives_up(name: str) -> None:
    hasty, patient = bug2(*along(name), patient=False), bug2(*along(name))
    assert hasty.outcome == patient.outcome
    assert hasty.length == pytest.approx(patient.length)


def test_the_goal_of_the_closed_box_is_inside_of_it() -> None:
    tried = task("bug_closed_box")
    free = component_around(free_space(tried.scene, 0.0), tried.goal)
    assert free is not None
    assert free.area < 12


def test_the_start_of_the_spiral_is_inside_of_it() -> None:
    tried = task("bug_spiral")
    (spiral,) = free_space(tried.scene, 0.01).geoms[0].interiors
    assert Polygon(spiral).convex_hull.contains(Point(tried.start))
    assert not Polygon(spiral).convex_hull.contains(Point(tried.goal))


def test_a_radar_sees_into_hedges_but_not_through_them() -> None:
    hedges = [p for p in load_map("hedge_garden").parts if p.material.penetrable]
    assert len(hedges) == 3
    for hedge in hedges:
        assert hedge.material.density == 1 / SEEN_INTO
        assert np.ptp(hedge.vertices, axis=0)[:2].min() >= 2 * SEEN_INTO


def test_gaps_between_hedges_are_open_to_a_radar_and_closed_to_a_laser() -> None:
    tried = task("hedge_garden")
    seen_by_laser = free_space(tried.scene, tried.safety_distance)
    seen_by_radar = free_space(tried.scene, tried.safety_distance - SEEN_INTO + PRESSED)
    assert len(seen_by_laser.geoms[0].interiors) == 1
    assert len(seen_by_radar.geoms[0].interiors) == 3


@pytest.mark.parametrize("bug", [bug1, bug2])
def test_seeing_into_hedges_halves_the_path(
    bug: Callable[[Polygon, Position, Position], RayState],
) -> None:
    radar = bug(*along("hedge_garden", seen_into=SEEN_INTO))
    assert radar.outcome == "reached"
    assert radar.length < 0.5 * bug(*along("hedge_garden")).length
