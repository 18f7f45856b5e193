"""Strategies in a flat world: exact scans, exact moves, and the map that grows."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
import shapely
from flat_world import NOWHERE, look, rectangle
from flatland import Flatland

from radarsim.autonomy.exploration import coverage
from radarsim.autonomy.exploration.path_follower import (
    PATIENCE,
    WAYPOINT_RADIUS,
    ExplorationSettings,
    PathFollower,
    Strategy,
    WaypointFollower,
)
from radarsim.autonomy.exploration.strategies import AutoStrategy, create_strategy
from radarsim.autonomy.exploration.traversability import TraversabilityMap
from radarsim.autonomy.mapping.occupancy_grid import OccupancyGrid
from radarsim.autonomy.mapping.scan import BeamEnd
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import SpeedLimits, Twist
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.plans import ExplorationPlan, StrategyName
from radarsim.geometry import Floats, Pose2
from radarsim.rng import generator_for

FAR = 9.0  # m to which the sensor sees
CLEARANCE = 0.371  # m; half the diagonal of a P3AT
SETTINGS = ExplorationSettings(
    bumpers=Bumpers(safety_distance=0.5),
    speed_limits=SpeedLimits(speed=0.6, turn=1.0),
    plan=ExplorationPlan(radius=5.0),
)
STRAIGHT = Twist(0.3, 0.0)


HALL = rectangle(-5.0, -3.5, 5.0, 3.5)
PILLAR = rectangle(-0.4, -0.4, 0.4, 0.4)
CLOSET = rectangle(-1.5, -1.5, 1.5, 1.5)
# Two rooms of 5 by 5 m, with a door of 1.8 m between them.
TWO_ROOMS = np.concatenate(
    [
        rectangle(-5.0, -2.5, 5.0, 2.5),
        [[[0.0, -2.5], [0.0, -0.9]], [[0.0, 0.9], [0.0, 2.5]]],
    ]
)
# The same with a gap that is too narrow for the robot.
TOO_NARROW = np.concatenate(
    [TWO_ROOMS, [[[0.0, -0.9], [0.0, -0.3]], [[0.0, 0.3], [0.0, 0.9]]]]
)


@dataclass
class World(Flatland):
    """A flat world, and the map of the robot."""

    pause: float = 0.2
    grid: OccupancyGrid = field(default_factory=lambda: OccupancyGrid(0.1))
    activities: list[str] = field(default_factory=list)

    @property
    def floor(self) -> TraversabilityMap:
        return SETTINGS.traversability(self.grid)

    def scan(self) -> Observation:
        scan = look(self.walls, self.pose, time=self.time)
        nothing = scan.ends == BeamEnd.NOTHING
        known_range = np.where(
            nothing, np.minimum(scan.known_range, FAR), scan.known_range
        )
        scan = replace(scan, known_range=known_range)
        self.grid.add(self.pose, scan)
        self.grid.clear_disc(self.pose, 0.25)
        ended = (scan.ends == BeamEnd.HIT) | (scan.ends == BeamEnd.UNSURE)
        ranges = np.where(ended, scan.known_range, math.inf)
        return Observation(self.time, self.pose, scan.angles.copy(), ranges)

    def explore(self, strategy: Strategy, *, steps: int = 2000) -> None:
        for _ in range(steps):
            twist = strategy.step(self.scan(), self.grid)
            if self.activities[-1:] != [strategy.activity]:
                self.activities.append(strategy.activity)
            if strategy.is_done:
                return
            self.move(twist)
        raise AssertionError(f"{strategy.activity} after {steps} steps at {self.pose}")


def world(walls: Floats, x: float = 0.0, y: float = 0.0, yaw: float = 0.3) -> World:
    return World(walls, Pose2(x, y, yaw))


def generator(seed: int = 0) -> np.random.Generator:
    return generator_for(seed, "exploring")


@pytest.mark.parametrize("name", list(StrategyName))
def test_every_strategy_ends_and_keeps_the_safety_distance(name: StrategyName) -> None:
    here = world(TWO_ROOMS, -3.0, 0.4)
    strategy = create_strategy(name, SETTINGS, generator())
    here.explore(strategy)
    assert strategy.is_done
    assert here.nearest > CLEARANCE
    assert strategy.step(here.scan(), here.grid) == Twist(0.0, 0.0)


@pytest.mark.parametrize("x", [-0.4, -0.25, -0.1, 0.0, 0.12, 0.3])
def test_robot_in_a_narrow_door_drives_on(x: float) -> None:
    """Not to where it is: the way out of a door is costlier than its own place."""
    jambs = [[[0.0, -2.5], [0.0, -0.6]], [[0.0, 0.6], [0.0, 2.5]]]
    here = world(np.concatenate([rectangle(-5.0, -2.5, 5.0, 2.5), jambs]), x, 0.03, 0.0)
    observation = here.scan()
    follower = PathFollower(SETTINGS)
    follower.update_map(observation, here.grid)
    assert follower.plan(observation, follower.floor.disc(3.0, 0.0, 0.2))
    twist = follower.step(observation)
    assert twist.speed > 0.5 * SETTINGS.speed_limits.speed


@pytest.mark.parametrize("name", ["contour", "turn_away"])
def test_whole_room_is_seen_at_short_range(name: str) -> None:
    here = world(HALL, -3.0, 0.4)
    here.explore(create_strategy(StrategyName(name), SETTINGS, generator()))
    floor = here.floor
    left = floor.unvisited & floor.reachable(here.pose)
    assert floor.area(left) < 1.0


@pytest.mark.parametrize("wall_on_left", [True, False])
def test_contour_is_followed_once_and_then_the_interior_is_covered(
    wall_on_left: bool,
) -> None:
    here = world(np.concatenate([HALL, PILLAR]), -3.0, 0.5)
    plan = replace(SETTINGS.plan, side="left" if wall_on_left else "right")
    settings = replace(SETTINGS, plan=plan)
    strategy = coverage.ContourStrategy(settings)
    here.explore(strategy)
    assert here.activities == ["seeking", "aligning", "following", "filling"]
    assert strategy.contours == 1
    path = shapely.LineString([(pose.x, pose.y) for pose in here.track])
    for corner in ((-4.2, -2.7), (4.2, -2.7), (4.2, 2.7), (-4.2, 2.7)):
        assert path.distance(shapely.Point(corner)) < 0.4
    assert here.length < 2 * (8.5 + 5.5) + 25
    turns = np.diff([pose.yaw for pose in here.track])
    assert (turns.sum() < 0) == wall_on_left


def test_island_is_left_for_a_wall_of_the_room() -> None:
    """Whether a wall in the open belongs to a room is unknown at first."""
    strategy = coverage.ContourStrategy(SETTINGS)
    here = world(PILLAR, 2.0, 0.0, math.pi)
    here.explore(strategy)
    assert strategy.contours == 1  # that of the pillar, from outside
    assert here.activities == ["seeking", "aligning", "following", "seeking"]
    assert here.length < 12  # and nothing is filled


def test_robot_drives_ahead_when_no_wall_is_sensed() -> None:
    class Nearsighted(World):
        def scan(self) -> Observation:
            observation = super().scan()
            self.grid = OccupancyGrid()  # forgets all
            ranges = np.where(observation.ranges < 2.0, observation.ranges, math.inf)
            return Observation(
                observation.time, observation.pose, observation.bearings, ranges
            )

    here = Nearsighted(HALL, Pose2(0.0, 0.0, 0.0))
    strategy = coverage.ContourStrategy(SETTINGS)
    for _ in range(60):
        here.move(strategy.step(here.scan(), here.grid))
    assert here.pose.x > 3.0
    assert strategy.activity in ("aligning", "following")


def test_frontiers_lead_through_doors() -> None:
    here = world(TWO_ROOMS, -3.0, 0.4)
    here.explore(coverage.frontier_strategy(SETTINGS))
    assert here.pose.x > -1.0
    inside = shapely.box(-4.9, -2.4, 4.9, 2.4)
    across, up = here.floor.tile_centers()
    x, y = np.meshgrid(across, up)
    known = ~here.floor.unknown[shapely.contains_xy(inside, x, y)]
    assert known.mean() > 0.99


def test_strategy_is_done_at_once_in_a_closet() -> None:
    here = world(CLOSET)
    here.explore(coverage.frontier_strategy(SETTINGS), steps=60)  # turns round once
    assert here.pose.yaw > 2 * math.pi
    here.explore(coverage.coverage_strategy(SETTINGS), steps=20)
    assert here.length == 0.0


def test_random_bounce_is_repeatable_by_its_seed() -> None:
    tracks = []
    for seed in (0, 0, 1):
        here = world(HALL, -3.0, 0.5)
        strategy = coverage.RandomBounce(SETTINGS, generator(seed))
        for _ in range(120):
            here.move(strategy.step(here.scan(), here.grid))
        tracks.append(here.track)
    assert tracks[0] == tracks[1] != tracks[2]


def test_random_bounce_drives_straight_between_walls() -> None:
    here = world(HALL, -3.0, 0.5)
    strategy = coverage.RandomBounce(SETTINGS, generator())
    for _ in range(200):
        activity = strategy.activity
        twist = strategy.step(here.scan(), here.grid)
        if activity == strategy.activity == "straight":
            assert twist.speed > 0.5
            assert abs(twist.turn) < 0.4
        elif strategy.activity == "turning":
            assert twist.speed == 0.0
        here.move(twist)
    assert here.length > 15


def test_walled_in_robot_turns_about() -> None:
    here = world(rectangle(-0.8, -0.8, 0.8, 0.8))
    strategy = coverage.RandomBounce(SETTINGS, generator())
    here.explore(strategy, steps=50)
    assert here.length == 0.0


def test_spiral_widens() -> None:
    here = world(NOWHERE, 2.0, 1.0)
    here.explore(coverage.SpiralCoverage(SETTINGS))
    far = [math.dist((pose.x, pose.y), (2.0, 1.0)) for pose in here.track]
    assert max(far) == pytest.approx(SETTINGS.plan.radius, abs=1.2)
    assert (np.maximum.accumulate(far) - far).max() < 1.0
    angles = np.unwrap([math.atan2(p.y - 1.0, p.x - 2.0) for p in here.track[80:]])
    assert angles[-1] - angles[0] > 2.0
    assert not (here.floor.unvisited & here.floor.disc(2.0, 1.0, 3.0)).any()


def test_spiral_ends_at_a_border_on_all_sides() -> None:
    here = world(CLOSET)
    strategy = coverage.SpiralCoverage(
        replace(SETTINGS, plan=ExplorationPlan(radius=50.0))
    )
    here.explore(strategy, steps=300)
    assert here.length < 5


@pytest.mark.parametrize(
    ("walls", "chosen"),
    [
        pytest.param(HALL, ["contour"], id="walls all round"),
        pytest.param(TWO_ROOMS, ["frontiers", "contour"], id="more behind a door"),
        pytest.param(rectangle(-1.0, -0.5, 0.0, 0.5), ["centre_out"], id="a box"),
    ],
)
def test_auto_chooses_by_what_is_sensed(walls: Floats, chosen: list[str]) -> None:
    here = world(walls, -3.0, 0.4)
    strategy = AutoStrategy(SETTINGS)
    here.explore(strategy)
    assert [name.value for name in strategy.chosen] == chosen


def test_auto_stops_the_spiral_at_walls() -> None:
    """In front of the open side of a house only that side is sensed."""
    house = np.concatenate(
        [rectangle(2.0, -4.0, 12.0, 4.0)[:3], [[[2.0, 2.5], [2.0, 4.0]]]]
    )
    here = world(house, 0.5, 0.0)
    strategy = AutoStrategy(replace(SETTINGS, plan=ExplorationPlan(radius=8.0)))
    here.explore(strategy)
    assert [name.value for name in strategy.chosen] == ["centre_out", "frontiers"]
    assert max(pose.x for pose in here.track) < 9.0


def sensed_with(near: dict[float, float]) -> Observation:
    """Return an observation with obstacles at some bearings, deg, and distances, m."""
    bearings = np.radians(np.arange(360.0) - 180)
    ranges = np.full(360, math.inf)
    for bearing, distance in near.items():
        apart = np.abs(np.degrees(bearings) - bearing)
        ranges[apart <= 20] = distance
    return Observation(0.0, Pose2(0, 0), bearings, ranges)


@pytest.mark.parametrize(
    ("near", "twist", "allowed"),
    [
        pytest.param({}, STRAIGHT, STRAIGHT, id="nothing"),
        pytest.param({0: 0.6}, STRAIGHT, STRAIGHT, id="something in the band"),
        pytest.param({90: 0.4}, STRAIGHT, STRAIGHT, id="at the side"),
        pytest.param({0: 0.4}, STRAIGHT, Twist(0.0, 1.0), id="ahead"),
        pytest.param({0: 0.4}, Twist(0.3, -0.5), Twist(0.0, -0.5), id="turning"),
        pytest.param({0: 0.4}, Twist(-0.3, 0.1), Twist(-0.3, 0.1), id="backward"),
        pytest.param({0: 0.4}, Twist(0.0, 0.1), Twist(0.0, 0.1), id="standing"),
    ],
)
def test_bumpers_overrule_the_path(
    near: dict[float, float], twist: Twist, allowed: Twist
) -> None:
    assert SETTINGS.limit_by_bumpers(sensed_with(near), twist) == allowed


def test_nearest_clear_bearing_is_chosen() -> None:
    assert SETTINGS.clear_bearing(sensed_with({}), 0.2) == 0.2
    clear = SETTINGS.clear_bearing(sensed_with({0: 0.4}), 0.1)
    assert 30 < math.degrees(clear) < 70
    walled_in = sensed_with(dict.fromkeys(range(-180, 181, 20), 0.4))
    assert SETTINGS.clear_bearing(walled_in, 0.2) == 0.2


def test_target_without_progress_is_given_up() -> None:
    """The obstacle that blocks the robot is on no map."""
    here, follower = world(HALL, -3.0, 0.4), PathFollower(SETTINGS)
    ends: list[Any] = []
    for _ in range(round(PATIENCE / here.pause) + 20):
        seen = here.scan()
        follower.update_map(seen, here.grid)
        assert follower.plan(seen, follower.floor.unvisited)
        follower.step(seen)
        here.track.append(here.pose)
        ends.append(follower.end)
    assert math.dist(ends[20], ends[-1]) > 0.5


def test_robot_without_a_path_stands() -> None:
    here = world(HALL)
    follower = PathFollower(SETTINGS)
    assert follower.step(here.scan()) == Twist(0.0, 0.0)
    assert follower.end is None
    assert follower.update_map(here.scan(), here.grid)
    assert not follower.update_map(here.scan(), here.grid)


def test_waypoints_are_reached_in_turn() -> None:
    here = world(HALL, -4.0)
    places = [(-3.0, -2.0), (3.0, -2.0), (3.0, 2.0)]
    strategy = WaypointFollower(SETTINGS, places)
    here.explore(strategy)
    assert strategy.unreached == []
    near = [
        min(math.dist(place, (pose.x, pose.y)) for pose in here.track)
        for place in places
    ]
    assert max(near) < WAYPOINT_RADIUS
    assert here.length < 1.05 * (2.24 + 6 + 4)
    assert set(here.activities) == {"underway"}


def test_unreachable_waypoint_is_skipped() -> None:
    here = world(TOO_NARROW, -4.0)
    strategy = WaypointFollower(SETTINGS, [(3.0, 0.0), (-4.0, 1.5)])
    here.explore(strategy)
    assert strategy.unreached == [(3.0, 0.0)]
    assert math.dist((here.pose.x, here.pose.y), (-4.0, 1.5)) < WAYPOINT_RADIUS
    assert max(pose.x for pose in here.track) > -1.2  # as near as it can get


def test_nearby_waypoint_is_reached_and_not_skipped() -> None:
    for away in np.arange(0.05, 0.6, 0.1):
        here = world(HALL, -3.0)
        place = (-3.0 - away, 0.0)
        strategy = WaypointFollower(SETTINGS, [place])
        here.explore(strategy)
        assert strategy.unreached == []
        assert math.dist((here.pose.x, here.pose.y), place) < WAYPOINT_RADIUS


@pytest.mark.parametrize("far", [8.0, 1e300])
def test_waypoint_outside_is_skipped_after_no_progress(far: float) -> None:
    here = world(HALL, -3.0)
    strategy = WaypointFollower(SETTINGS, [(far, 0.0), (0.0, 0.0)])
    here.explore(strategy, steps=800)
    assert strategy.unreached == [(far, 0.0)]
    assert math.dist((here.pose.x, here.pose.y), (0.0, 0.0)) < WAYPOINT_RADIUS
