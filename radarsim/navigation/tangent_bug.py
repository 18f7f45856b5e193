"""TangentBug: towards the goal by the edges of obstacles that a scan shows.

Theory of operation
===================
A scan tells how far the robot could go in each direction. Where that distance jumps, an
obstacle ends: its edge is a place that the robot could head for. It heads for the one
over which the way to the goal is shortest, or for the goal itself if nothing is in
between. So unlike Bug1 and Bug2 it goes around what it has not yet reached.

If the way over the best edge becomes longer while it drives, it is in a dead end. Then
it drives to the obstacle that hides the goal and follows its boundary, on the hand to
which it was heading, and remembers how near to the goal that boundary comes. As soon as
it could go straight to a place that is nearer, it does, and never leads farther away
again: so it ends. Back where it was on the same boundary, there is no path.

Source: I. Kamon, E. Rimon, E. Rivlin, TangentBug: a range-sensor-based navigation
algorithm, International Journal of Robotics Research 17, 1998.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from radarsim.geometry import Pose2
from radarsim.navigation.boundary_policy import Landmark, Step, Trail
from radarsim.navigation.bug import GRAZE, NOISE
from radarsim.navigation.control import STOP, Twist, bearing_of, distance
from radarsim.navigation.controller import (
    Activity,
    Controller,
    ControllerSettings,
    Point,
)
from radarsim.navigation.followed_obstacle import FollowedObstacle
from radarsim.navigation.observation import Observation
from radarsim.navigation.open_directions import (
    HORIZON,
    OpenDirections,
    leads_too_near,
    open_lengths,
)
from radarsim.navigation.standing_obstacle import StandingObstacle
from radarsim.navigation.wall_following import ALIGNED, FollowMode, WallFollower

LONGER: Final = 0.5  # m by which the way grows in a dead end, and not by noise
NEARER: Final = 0.2  # m nearer to the goal than the boundary, where it is left
KEPT: Final = 0.3  # m by which another edge has to be better than the last one
ARRIVED: Final = 0.3  # m from a place that it heads for, where it has arrived
_SAME: Final = 0.7  # m within which an edge is the last one
_MOST_GONE: Final = 20  # obstacles that go away, before it gives up nevertheless


class TangentBug(Controller):
    """TangentBug; attributes are those of ``Controller``."""

    def __init__(self, goals: Sequence[Point], settings: ControllerSettings) -> None:
        super().__init__(goals, settings)
        self._follower = WallFollower(settings.bumpers, settings.speed_limits)
        self._radius = settings.bumpers.safety_distance + GRAZE
        self._edge: Point | None = None  # that it heads for
        self._shortest_way = math.inf  # m; over the best edge, so far
        self._place: Point | None = None  # that it heads for after a boundary
        self._left_at = math.inf  # m of that place from the goal; no way leads farther
        self._boundary: _Boundary | None = None
        self._gone = 0

    def _begin_goal(self, _: Pose2) -> None:
        self._start_anew()
        self._left_at = math.inf

    def _decide(self, observation: Observation, driven: float) -> Twist:
        if self._boundary is None:
            return self._go(observation)
        return self._follow(observation, self._boundary, driven)

    def _start_anew(self) -> None:
        self.activity, self._boundary = Activity.GOING, None
        self._edge, self._place, self._shortest_way = None, None, math.inf

    def _go(self, observation: Observation) -> Twist:
        """Head for the goal, or for the edge over which the way there is shortest."""
        point = self._choose(observation)
        if point is None or self._is_held(observation, point):
            return self._hit(observation, self._edge or self.goals[0])
        return self._head_for(observation, point)

    def _choose(self, observation: Observation) -> Point | None:
        """Choose the place to head for; None in a dead end."""
        goal, pose = self.goals[0], observation.pose
        if self._sees_goal(observation):
            return goal
        directions = OpenDirections(observation, self._radius)
        if self._place is not None:
            is_away = distance(pose, *self._place) > ARRIVED
            if is_away and directions.reaches(self._place):
                return self._place
            self._place = None
        edges = directions.edges()
        edges = edges[np.hypot(*(edges - goal).T) < self._left_at]
        if not len(edges):
            return None
        ways = np.hypot(*(edges - goal).T) + np.hypot(*(edges - (pose.x, pose.y)).T)
        if self._edge is not None:
            ways -= KEPT * (np.hypot(*(edges - self._edge).T) < _SAME)
        best = int(ways.argmin())
        self._edge = (float(edges[best, 0]), float(edges[best, 1]))
        if ways[best] > self._shortest_way + LONGER:
            return None
        self._shortest_way = min(self._shortest_way, float(ways[best]))
        return self._edge

    def _sees_goal(self, observation: Observation) -> bool:
        """Return whether the way straight to the goal is open."""
        left = distance(observation.pose, *self.goals[0])
        bearing = bearing_of(observation.pose, *self.goals[0])
        # a goal may be as near to something as the safety distance
        is_last = left < self._settings.bumpers.pressed_below
        radius = self._radius - (GRAZE + NOISE / 2) * is_last
        (length,) = open_lengths(observation, np.array([bearing]), radius)
        return bool(length >= min(left, HORIZON))

    def _is_held(self, observation: Observation, point: Point) -> bool:
        """Return whether the robot faces a point and cannot go there."""
        safety_distance = self._settings.bumpers.safety_distance
        is_faced = abs(bearing_of(observation.pose, *point)) < ALIGNED
        return is_faced and leads_too_near(observation, safety_distance)

    def _head_for(self, observation: Observation, point: Point) -> Twist:
        """Turn to a point, drive there, and only turn where something is too near."""
        pose = observation.pose
        left = distance(pose, *self.goals[0])
        twist = self._settings.speed_limits.towards(
            bearing_of(pose, *point), most=0.05 + 0.8 * left
        )
        safety_distance = self._settings.bumpers.safety_distance
        if leads_too_near(observation, safety_distance):
            return Twist(0.0, twist.turn)
        return twist

    def _hit(self, observation: Observation, towards: Point) -> Twist:
        """Turn to the boundary of what hides the goal, to follow it towards a point."""
        pose, goal = observation.pose, self.goals[0]
        self.hit_points.append((pose.x, pose.y))
        self.activity = Activity.ALIGNING
        offset = bearing_of(pose, *towards) - bearing_of(pose, *goal)
        is_left = math.sin(offset) < 0 if offset else self._settings.wall_on_left
        self._boundary = _Boundary(self._follower, FollowMode(wall_on_left=is_left))
        return STOP

    def _follow(
        self, observation: Observation, boundary: "_Boundary", step: float
    ) -> Twist:
        """Follow a boundary until a place nearer to the goal can be gone to."""
        goal = self.goals[0]
        place = OpenDirections(observation, self._radius).nearest_to(goal)
        nearer = math.dist(place, goal)
        if nearer < min(boundary.goal_distance, self._left_at) - NEARER:
            self._left_at = nearer
            return self._leave(observation, place)
        if self._sees_goal(observation) and not self._is_held(observation, goal):
            return self._leave(observation, goal)
        if not boundary.is_reached:
            return self._approach(observation, boundary)
        part = boundary.look(observation, goal)
        if self.activity is Activity.ALIGNING:
            bearing = bearing_of(observation.pose, *goal)
            twist, done = self._follower.align(observation, boundary.mode, bearing)
            self.activity = Activity.FOLLOWING if done else Activity.ALIGNING
            return twist
        if boundary.closes(part, step):
            return self._conclude(observation, boundary)
        return self._follower.step(observation, boundary.mode, part)[0]

    def _approach(self, observation: Observation, boundary: "_Boundary") -> Twist:
        """Drive towards what hides the goal until that is in reach of the bumpers."""
        bearing = bearing_of(observation.pose, *self.goals[0])
        (length,) = open_lengths(observation, np.array([bearing]), self._radius)
        ahead = self._settings.bumpers.towards(observation, bearing)
        is_held = self._is_held(observation, self.goals[0])
        if ahead.blocked or length < GRAZE or is_held:
            boundary.reach(observation, bearing)
            return STOP
        return self._head_for(observation, self.goals[0])

    def _leave(self, observation: Observation, place: Point) -> Twist:
        self.leave_points.append((observation.pose.x, observation.pose.y))
        self._start_anew()
        self._place = place
        return self._head_for(observation, place)

    def _conclude(self, observation: Observation, boundary: "_Boundary") -> Twist:
        """Conclude that there is no path, unless what was circled has gone."""
        self.circuits += 1
        if self._gone < _MOST_GONE and boundary.circled.has_gone(observation):
            self._gone += 1
            self._left_at = math.inf
            return self._leave(observation, self.goals[0])
        self.activity = Activity.NO_PATH
        return STOP


class _Boundary:
    """The boundary that is followed, and what is known of it.

    Attributes:
        mode: How it is followed.
        goal_distance: Its least distance from the goal so far, m.
        circled: Points of it, to look at them again.
    """

    def __init__(self, follower: WallFollower, mode: FollowMode) -> None:
        self.mode = mode
        self.goal_distance = -math.inf  # so that it is not left before it is reached
        self.circled = StandingObstacle()
        self._follower = follower
        self._obstacle: FollowedObstacle | None = None
        self._trail: Trail | None = None
        self._travelled = 0.0  # m along it

    @property
    def is_reached(self) -> bool:
        """Whether the robot is beside it."""
        return self._obstacle is not None

    def reach(self, observation: Observation, bearing: float) -> None:
        """Begin beside it, where a bumper is pressed towards a bearing, rad."""
        point = self._follower.hit_point(observation, self.mode, bearing)
        place = point.point_from(observation.pose)
        self._obstacle = FollowedObstacle(place, self._follower)
        self.goal_distance = math.inf

    def look(self, observation: Observation, goal: Point) -> Observation:
        """Return the part of a scan that shows it; note its distance from a goal."""
        assert self._obstacle is not None
        part = self._obstacle.part_of(observation, self.mode)
        distances = np.hypot(*(part.points() - goal).T)
        nearest = float(distances.min(initial=math.inf))
        self.goal_distance = min(self.goal_distance, nearest)
        return part

    def closes(self, part: Observation, step: float) -> bool:
        """Return whether the robot has come back to where it was on it.

        Args:
            part: The part of the scan that shows it.
            step: m that the robot has driven since the last scan.
        """
        self._travelled += step
        if nearest := self._follower.boundary(part, self.mode):
            self.circled.add(nearest.point_from(part.pose), part.pose.yaw)
        pose, direction = part.pose, self._follower.tangent(part, self.mode)
        if self._trail is None:
            offset = self._follower.target_distance
            hit = Landmark(pose, direction, max_offset=offset)
            self._trail = Trail(hit, offset)
        here = Step(pose, step, direction, free=False)
        return self._trail.closes(here, self._travelled) is not None
