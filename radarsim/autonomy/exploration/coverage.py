"""Exploration strategies: nearest target, contour, spiral, and random bounces.

A frontier is the border between open floor and space that no beam has crossed. The
frontier strategy drives to the nearest frontier until none is left. The coverage
strategy drives to the nearest floor not seen at short range until none is left, since
the beams of a radar leave wide gaps far away and in foliage.

The contour strategy follows the walls of a room once around, then covers its interior.

The contour is the boundary of the floor that the robot can reach on the map; islands
within it are followed only if no other wall is left. It is closed when the robot, by
its own pose, passes the point where it began to follow. Around an island, the robot's
total turn has the opposite sign. Then the robot searches for another wall. If it finds
no wall of the room, it covers no interior.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from radarsim.autonomy.exploration.path_follower import ExplorationSettings, Strategy
from radarsim.autonomy.exploration.traversability import TraversabilityMap
from radarsim.autonomy.mapping.occupancy_grid import SHORT_RANGE, Mask, OccupancyGrid
from radarsim.autonomy.navigation.boundary_memory import Landmark
from radarsim.autonomy.navigation.control import (
    STOP,
    Twist,
    bearing_of,
    distance,
)
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.wall_following import WallFollower
from radarsim.geometry import Point, Pose2, wrap_angle

FULL_TURN: Final = 2 * math.pi
NEIGHBORHOOD: Final = 1.5  # m around the last target; targets there come first
WALL_DISTANCE: Final = 0.3  # m from a wall tile at which aligning begins
MIN_LENGTH: Final = 3.0  # m; least length of a contour
FOLLOWED_RADIUS: Final = 2.0  # m around the path along a wall that count as followed
TRACK_STEP: Final = 0.5  # m between two stored points of the path
LOST_CIRCLES: Final = 1.5  # circles without a wall before it counts as lost
SPACING: Final = 1.6 * SHORT_RANGE  # m between turns, so that coverage overlaps
POINT_SPACING: Final = 1.0  # m between two points along the spiral
ARRIVAL_DISTANCE: Final = 0.8  # m from a point that count as reached
MIN_TURN: Final = math.radians(30.0)
AIMED: Final = math.radians(8.0)
MAX_IDLE_LEGS: Final = 12  # legs in a row without new floor before the strategy ends
MIN_GAIN: Final = 1.0  # m² of floor; less is not new
_TURN_STEP: Final = math.radians(10.0)

TargetSelector = Callable[[TraversabilityMap], Mask]


class NearestTargetStrategy(Strategy):
    """Drives to the nearest target tile; a function selects the target tiles."""

    def __init__(
        self,
        settings: ExplorationSettings,
        select_targets: TargetSelector,
        activity: str,
        *,
        turn: float = 0.0,
    ) -> None:
        """Create a strategy.

        Args:
            settings: Settings of the exploration.
            select_targets: Returns the tiles to drive to.
            activity: Name of the activity.
            turn: Angle to turn on the spot first, rad, so that other beams cross the
                gaps between the beams of one scan; otherwise each gap would be a
                frontier.
        """
        super().__init__(settings)
        self.activity = activity
        self._turn = turn  # remaining angle
        self._yaw: float | None = None  # yaw at the last scan of the turn
        self._select_targets = select_targets

    def _decide(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        if self._turn > 0:
            last, self._yaw = self._yaw, observation.pose.yaw
            self._turn -= 0.0 if last is None else abs(wrap_angle(self._yaw - last))
            return Twist(0.0, self._settings.speed_limits.turn)
        follower = self._path_follower
        if follower.update_map(observation, grid):
            floor = follower.floor
            targets = self._select_targets(floor)
            # Targets near the last target come first. Otherwise the
            # robot could oscillate between two sides of a room: after
            # it has seen part of one side, the other side is nearer.
            if follower.end is not None:
                near = targets & floor.disc(*follower.end, NEIGHBORHOOD)
                targets = near if near.any() else targets
            self.is_done = not follower.plan(observation, targets)
        return follower.step(observation)


def frontier_strategy(
    settings: ExplorationSettings,
    select_targets: TargetSelector = lambda floor: floor.frontiers,
) -> NearestTargetStrategy:
    """Return a strategy that drives to the nearest frontier or selected frontier."""
    return NearestTargetStrategy(settings, select_targets, "frontier", turn=FULL_TURN)


def coverage_strategy(settings: ExplorationSettings) -> NearestTargetStrategy:
    """Return a strategy that drives to the nearest floor not seen at short range."""
    return NearestTargetStrategy(settings, lambda floor: floor.unvisited, "filling")


class ContourStrategy(Strategy):
    """Follows the contour of a room once, then covers the interior.

    Attributes:
        activity: ``seeking``, ``aligning``, ``following`` or ``filling``.
        contours: Number of closed contours, including those of islands.
    """

    def __init__(self, settings: ExplorationSettings) -> None:
        super().__init__(settings)
        self.activity = "seeking"
        self.contours = 0
        self._wall_follower = WallFollower(
            settings.bumpers,
            settings.speed_limits,
            wall_on_left=settings.plan.side == "left",
        )
        self._coverage = coverage_strategy(settings)
        self._track: list[Point] = []
        self._has_no_wall = False
        self._wall: Point = (0.0, 0.0)
        # first pose and latest pose of the current circuit along a wall
        self._begin: Landmark
        self._last: Pose2
        # length of the circuit, m, distance driven
        # without a wall in sight, m, and total turn, rad
        self._length = self._lost = self._turn = 0.0

    def _decide(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        if self.activity == "seeking":
            return self._seek(observation, grid)
        if self.activity == "aligning":
            return self._align(observation)
        if self.activity == "following":
            return self._follow(observation)
        twist = self._coverage.step(observation, grid)
        self.is_done = self._coverage.is_done
        return twist

    def _seek(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Drive to the nearest wall that has not been followed yet, and stop there."""
        path_follower = self._path_follower
        if path_follower.update_map(observation, grid):
            floor = path_follower.floor
            targets = floor.outer_boundary(floor.reachable(observation.pose))
            for point in self._track:
                # Walls that were followed or lost before are not followed again.
                targets &= ~floor.disc(*point, FOLLOWED_RADIUS)
            self._has_no_wall = not path_follower.plan(observation, targets)
        if self._has_no_wall and not self.contours:
            # The map does not contain a wall yet,
            # so the robot drives ahead to find one.
            if self._settings.bumpers.towards(observation, 0.0).blocked:
                return self._arrive(observation)
            return Twist(self._settings.speed_limits.speed, 0.0)
        end = path_follower.end
        if self._has_no_wall:
            self.is_done = True
        elif end is not None and distance(observation.pose, *end) < WALL_DISTANCE:
            return self._arrive(observation)
        return path_follower.step(observation)

    def _arrive(self, observation: Observation) -> Twist:
        self.activity = "aligning"
        # The wall is stored as a point on the map, since
        # during a turn another beam may become the shortest.
        nearest = int(observation.ranges.argmin())
        bearing = float(observation.bearings[nearest])
        self._wall = observation.pose.point(bearing, float(observation.ranges[nearest]))
        return STOP

    def _align(self, observation: Observation) -> Twist:
        bearing = bearing_of(observation.pose, *self._wall)
        wall_follower = self._wall_follower
        twist, aligned = wall_follower.align(observation, bearing)
        if aligned:
            self.activity = "following"
            direction = wall_follower.tangent(observation)
            reach, self._last = wall_follower.target_distance, observation.pose
            self._begin = Landmark(self._last, direction, max_offset=reach)
            self._length = self._lost = self._turn = 0.0
            self._track.append((self._last.x, self._last.y))
        return twist

    def _follow(self, observation: Observation) -> Twist:
        twist, found = self._wall_follower.step(observation)
        pose, last = observation.pose, self._last
        step, self._last = pose.distance(last), pose
        self._length += step
        self._lost = 0.0 if found else self._lost + step
        self._turn += wrap_angle(pose.yaw - last.yaw)
        if distance(pose, *self._track[-1]) > TRACK_STEP:
            self._track.append((pose.x, pose.y))
        # Near the start, noise may look like a robot that passes its start again, so a
        # minimum length is required.
        if self._begin.observe(pose) and self._length > MIN_LENGTH:
            self.contours += 1
            # Over a whole circuit, the robot turns to one side inside a room, and to
            # the other side around an island.
            is_inside = (self._turn < 0) == self._wall_follower.wall_on_left
            self.activity = "filling" if is_inside else "seeking"
        elif self._lost > LOST_CIRCLES * math.tau * self._wall_follower.target_distance:
            self.activity = "seeking"
        return twist


class SpiralCoverage(Strategy):
    """Drives in a spiral around its start, and skips unreachable points.

    The strategy is done at the maximum radius, or if no point of a full turn is
    reachable.
    """

    activity = "spiral"

    def __init__(self, settings: ExplorationSettings) -> None:
        super().__init__(settings)
        self._angle = 0.0
        self._skipped_angle = 0.0

    def _decide(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        has_arrived = distance(observation.pose, *self._point()) < ARRIVAL_DISTANCE
        if self._path_follower.update_map(observation, grid) or has_arrived:
            self._choose(observation, has_arrived=has_arrived)
        return self._path_follower.step(observation)

    def _choose(self, observation: Observation, *, has_arrived: bool) -> None:
        floor = self._path_follower.floor
        reachable = floor.reachable(observation.pose)
        if has_arrived:
            self._skipped_angle = 0.0
            self._advance()
        # Unreachable points are skipped. If all points of a full turn of the spiral are
        # unreachable, the robot is enclosed.
        while not self.is_done:
            targets = reachable & floor.disc(*self._point(), POINT_SPACING / 2)
            if self._path_follower.plan(observation, targets):
                return
            self._skipped_angle += self._advance()
            self.is_done |= self._skipped_angle > 2 * math.pi

    def _point(self) -> Point:
        assert self._start is not None
        return self._start.point(self._angle, SPACING * self._angle / (2 * math.pi))

    def _advance(self) -> float:
        """Advance to the next point of the spiral; return the angle to it, rad."""
        radius = SPACING * self._angle / (2 * math.pi)
        # The least radius keeps a step near the
        # centre from being more than a full turn.
        step = POINT_SPACING / max(radius, POINT_SPACING)
        self._angle += step
        self.is_done = radius > self._settings.plan.radius
        return step


class RandomBounce(Strategy):
    """Drives straight to a wall and turns by a random angle, like a vacuum robot.

    The strategy is done when all reachable floor has been seen at short range, or when
    the robot has seen no new floor on the last straight legs.
    """

    min_scans = 0

    def __init__(self, settings: ExplorationSettings, rng: np.random.Generator) -> None:
        super().__init__(settings)
        self.activity = "straight"
        self._rng = rng
        self._heading: float | None = None
        self._unvisited_area = math.inf
        self._idle_legs = 0

    def _decide(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        settings, yaw = self._settings, observation.pose.yaw
        if self._heading is None:
            self._heading = yaw
        if self.activity == "turning" and abs(wrap_angle(self._heading - yaw)) < AIMED:
            self.activity = "straight"
        ahead = settings.bumpers.towards(observation, wrap_angle(self._heading - yaw))
        if self.activity == "straight" and ahead.blocked:
            # The robot has driven straight up to a wall. This
            # was useful only if it saw new floor on the way.
            floor = settings.traversability(grid)
            remaining = floor.area(floor.unvisited & floor.reachable(observation.pose))
            self._idle_legs += 1
            if self._unvisited_area - remaining > MIN_GAIN:
                self._idle_legs, self._unvisited_area = 0, remaining
            self.is_done = remaining == 0 or self._idle_legs >= MAX_IDLE_LEGS
            self._heading = yaw + self._draw_turn(observation)
            self.activity = "turning"
        if self.is_done:
            return STOP
        twist = settings.speed_limits.towards(wrap_angle(self._heading - yaw))
        if self.activity == "turning":
            return Twist(0.0, twist.turn)
        return settings.limit_by_bumpers(observation, twist)

    def _draw_turn(self, observation: Observation) -> float:
        """Return a random turn, rad, to a free direction; pi if no direction is free.

        The bumper has stopped the robot away from the wall, so it has room to turn.
        """
        turns = np.arange(MIN_TURN, 2 * math.pi - MIN_TURN, _TURN_STEP)
        bumpers = self._settings.bumpers
        free = [
            turn for turn in turns if not bumpers.towards(observation, turn).blocked
        ]
        return float(self._rng.choice(free)) if free else math.pi
