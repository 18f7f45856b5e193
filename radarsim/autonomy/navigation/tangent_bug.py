"""TangentBug: drive to the goal around edges of obstacles, which scans show.

Theory of operation
===================
A scan gives the free distance of the robot in each direction. Where that distance
jumps, an obstacle ends: its edge is a possible target. The robot heads for the edge on
the shortest path to the goal around all obstacles in the scan, or for the goal itself
if no obstacle is in between. So unlike Bug1 and Bug2, it starts to drive around
obstacles before it reaches them.

The robot is in a dead end if no edge leads to the goal, or if the path over the best
edge becomes longer while the robot drives and leads away from the goal. It is also in a
dead end if the path becomes no shorter over twice its length, as in a circle around the
goal. Then it drives to the obstacle that hides the goal and follows its boundary in the
direction with the shorter path, and stores the least distance of that boundary from the
goal. As soon as it can drive straight to a position closer to the goal than this
distance, it does so. It never heads for a position farther from the goal again, so the
algorithm ends. If it completes a circuit of the same boundary, no path exists.

Noise opens and closes gaps that are barely wide enough for the robot. So an edge is
kept while the path to it is nearly open, and a robot that cannot go on where it has
just left a boundary follows that boundary again for a while.

The local tangent graph gives the distance to the goal over these edges. The visible
part of an obstacle is treated as a thin wall, and the unseen space as open. The
shortest paths around thin walls lead straight from edge to edge, and to the goal; where
a wall continues out of sight behind an obstacle, it is assumed to end.

Source: I. Kamon, E. Rimon, E. Rivlin, TangentBug: a range-sensor-based navigation
algorithm, International Journal of Robotics Research 17, 1998.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from radarsim.autonomy.navigation.boundary_memory import FollowedBoundary
from radarsim.autonomy.navigation.bug import GRAZE, NOISE, BoundaryController
from radarsim.autonomy.navigation.control import STOP, Twist, bearing_of, distance
from radarsim.autonomy.navigation.controller import (
    Activity,
    ControllerSettings,
)
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.open_directions import (
    HORIZON,
    OpenDirections,
    leads_too_near,
    open_length,
)
from radarsim.autonomy.navigation.wall_following import (
    ALIGNED,
)
from radarsim.geometry import Floats, Point, Pose2

MOST_PAIRS: Final = 1_000_000  # pairs of a segment and a wall, to limit memory
LONGER: Final = 0.5  # m; a larger increase of the path means a dead end, not noise
SHORTER: Final = 0.5  # m; least decrease of the path that counts as progress
DRIVEN: Final = 2.0  # times the path length plus 1 m without progress
NEARER: Final = 0.2  # m; a leave target is this much closer to the goal
KEPT: Final = 0.3  # m by which another edge has to be better than the last one
ARRIVED: Final = 0.3  # m from a target position, within which it is reached
AGAIN: Final = 0.5  # m from a leave point, to follow the boundary again
MOST_ALIGNING: Final = 8.0  # s; time for a full turn
_SURE: Final = 3  # scans in a row before leaving; a single scan may miss a pane
_SAME: Final = 0.7  # m between two sightings of the same edge
_MOST_RESUMED: Final = 5  # circuits restarted where a boundary was left


def ways_to_goal(edges: Floats, goal: Point, directions: OpenDirections) -> Floats:
    """Return the length of the shortest path from each edge to the goal.

    Args:
        edges: (M, 2) m, map frame.
        goal: m, map frame.
        directions: Free distances from a scan.

    Returns:
        (M,) m; ``inf`` where thin walls block all paths.
    """
    places = np.vstack([goal, edges, directions.hidden_ends()])
    lengths = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
    first, second = np.triu_indices(len(places), 1)
    closed = crosses_any(places[first], places[second], directions.walls())
    # Only the upper triangle is set, since ``dijkstra`` gets only that triangle.
    lengths[first[closed], second[closed]] = np.inf
    ways: Floats = dijkstra(np.triu(lengths), directed=False, indices=0)
    return ways[1 : len(edges) + 1]


def crosses_any(
    begins: Floats, ends: Floats, walls: tuple[Floats, Floats]
) -> NDArray[np.bool_]:
    """Return which segments, as (N,) booleans, cross a wall.

    Args:
        begins: (N, 2) m.
        ends: (N, 2) m.
        walls: Start and end points of the walls, (K, 2) m each.

    Returns:
        (N,)
    """
    c, d = walls
    closed = np.zeros(len(begins), np.bool_)
    block = max(1, MOST_PAIRS // max(len(c), 1))
    for first in range(0, len(begins), block):
        rows = slice(first, first + block)
        a, b = begins[rows, None], ends[rows, None]
        sides_of_wall = _side(c, d, a) * _side(c, d, b)
        sides_of_segment = _side(a, b, c) * _side(a, b, d)
        # The comparison is strict, since paths may
        # touch the ends of walls, where edges are.
        closed[rows] = ((sides_of_wall < 0) & (sides_of_segment < 0)).any(axis=1)
    return closed


def _side(begin: Floats, end: Floats, point: Floats) -> Floats:
    # The sign of the cross product tells on which side of the line the point is.
    along, to = end - begin, point - begin
    cross: Floats = along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0]
    return cross


class TangentBug(BoundaryController):
    """The TangentBug algorithm; the attributes are those of ``Controller``."""

    def __init__(self, settings: ControllerSettings) -> None:
        super().__init__(settings)
        # The robot enters only gaps that are wide enough for a wall follower, too.
        self._radius = settings.bumpers.safety_distance + GRAZE
        self._edge: Point | None = None  # edge that the robot drives to
        self._shortest_way = math.inf  # m; shortest path over the best edge so far
        # m; length of the shortest path so far, and distance driven since it was found
        self._way, self._driven = math.inf, 0.0
        self._place: Point | None = None  # target position after leaving a boundary
        self._left_at = math.inf  # m; new edges have to be closer to the goal
        self._open = 0  # scans in a row that allow leaving a boundary
        self._left: FollowedBoundary | None = None  # the boundary that was left last
        # how often the robot has returned to a boundary that it had left, in the whole
        # run; limited, since reflections in mirrors could restart circuits forever
        self._resumed = 0
        self._last_hand: bool | None = None  # whether the last boundary was on the left

    def _begin_goal(self, pose: Pose2) -> None:
        super()._begin_goal(pose)
        self._restart()
        self._left_at, self._left, self._last_hand = math.inf, None, None

    def _decide(self, observation: Observation, driven: float) -> Twist:
        self._driven += driven
        if self.activity is not Activity.GOING:
            return self._follow(observation, driven)
        # The robot drives straight to the goal, or to the edge with the shortest path.
        point = self._choose(observation)
        if point is None or self._is_held(observation, point):
            return self._hit(observation)
        return self._head_for(observation, point)

    def _restart(self) -> None:
        self.activity = Activity.GOING
        self._edge, self._place, self._shortest_way = None, None, math.inf
        self._way, self._driven = math.inf, 0.0

    def _choose(self, observation: Observation) -> Point | None:
        """Return the point that the robot drives to; None in a dead end."""
        goal, pose = self.goals[0], observation.pose
        if self._sees_goal(observation):
            return goal
        directions = OpenDirections(observation, self._radius)
        if self._place is not None:
            is_away = distance(pose, *self._place) > ARRIVED
            if is_away and directions.reaches(self._place):
                return self._place
            self._place = None
        return self._choose_edge(observation, directions)

    def _choose_edge(
        self, observation: Observation, directions: OpenDirections
    ) -> Point | None:
        """Return the edge on the best acceptable path to the goal; None if none."""
        edges = directions.edges()
        # Noise may hide an edge in one scan, so the robot
        # keeps its edge while it can nearly reach it.
        if self._edge is not None and self._is_open(observation, self._edge):
            edges = np.vstack([edges, self._edge])
        # The limit on the distance of edges to the goal makes sure the algorithm ends.
        edges = edges[np.hypot(*(edges - self.goals[0]).T) < self._left_at]
        edge, way = self._best_edge(edges, directions, observation.pose)
        if edge is None or not self._accept_way(edge, way, observation.pose):
            return None
        self._edge, self._shortest_way = edge, min(self._shortest_way, way)
        return edge

    def _best_edge(
        self, edges: Floats, directions: OpenDirections, pose: Pose2
    ) -> tuple[Point | None, float]:
        """Return the edge on the shortest path to the goal, and that path's length."""
        if not len(edges):
            return None, math.inf
        ways = ways_to_goal(edges, self.goals[0], directions)
        offsets = edges - (pose.x, pose.y)
        ways += np.hypot(*offsets.T)
        if self._edge is not None:
            # Of two edges close to each other, one may
            # be ahead of the robot and one behind it.
            is_ahead = offsets @ (np.array(self._edge) - (pose.x, pose.y)) > 0
            is_near = np.hypot(*(edges - self._edge).T) < _SAME
            ways -= KEPT * (is_near & is_ahead)
        best = int(ways.argmin())
        if not math.isfinite(ways[best]):
            return None, math.inf
        return (float(edges[best, 0]), float(edges[best, 1])), float(ways[best])

    def _accept_way(self, edge: Point, way: float, pose: Pose2) -> bool:
        """Return whether to drive to an edge, given the path length, m, to the goal.

        A path may become longer when more of an obstacle comes into view. Then the
        robot goes on only if it is closer to the goal than at all earlier such events,
        and the edge is closer still.
        """
        if way < self._way - SHORTER:
            self._way, self._driven = way, 0.0
        if self._driven > DRIVEN * (self._way + 1.0):
            # Later, the robot leaves the boundary
            # only for a position closer to the goal.
            self._left_at = min(self._left_at, self._goal_distance(pose))
            return False
        if way <= self._shortest_way + LONGER:
            return True
        left = self._goal_distance(pose)
        if math.dist(edge, self.goals[0]) > left or left > self._left_at - NEARER:
            return False
        self._left_at, self._shortest_way = left, way
        self._way, self._driven = way, 0.0
        return True

    def _is_open(self, observation: Observation, edge: Point) -> bool:
        """Return whether the edge that the robot heads for is ahead and reachable.

        The check uses a smaller radius than the search, since noise may close a gap.
        """
        pose = observation.pose
        away = distance(pose, *edge)
        radius = self._settings.bumpers.safety_distance - NOISE / 2
        length = open_length(observation, bearing_of(pose, *edge), radius)
        return away > ARRIVED and length >= min(away, HORIZON)

    def _sees_goal(self, observation: Observation) -> bool:
        left = self._goal_distance(observation.pose)
        # A goal may be exactly at the safety distance from an obstacle, so a smaller
        # radius is used on the last stretch.
        is_last = left < self._settings.bumpers.pressed_below
        radius = self._radius - (GRAZE + NOISE / 2) * is_last
        length = open_length(observation, self._goal_bearing(observation.pose), radius)
        return length >= min(left, HORIZON)

    def _is_held(self, observation: Observation, point: Point) -> bool:
        """Return whether a near obstacle blocks a robot that faces a point."""
        safety_distance = self._settings.bumpers.safety_distance
        is_faced = abs(bearing_of(observation.pose, *point)) < ALIGNED
        return is_faced and leads_too_near(observation, safety_distance)

    def _hit(self, observation: Observation) -> Twist:
        pose = observation.pose
        self.hit_points.append((pose.x, pose.y))
        if self._left is not None and distance(pose, *self.leave_points[-1]) < AGAIN:
            # The robot was blocked right after it left a boundary, so it continues to
            # follow that boundary.
            boundary, self.activity = self._left, Activity.FOLLOWING
            # The robot has to drive on, or it might leave again at the same position.
            boundary.least = boundary.travelled + AGAIN
            if self._resumed < _MOST_RESUMED:
                # The robot has been away from the
                # boundary, so a new circuit begins here.
                boundary.landmarks = []
            self._boundary, self._resumed = boundary, self._resumed + 1
            return STOP
        # The boundary is followed on the side with the shorter visible path.
        wall_on_left = self._settings.mission.side == "left"
        directions = OpenDirections(observation, self._radius)
        edge, _ = self._best_edge(directions.edges(), directions, pose)
        if edge is not None:
            offset = bearing_of(pose, *edge) - self._goal_bearing(pose)
            # A path to the right of the goal passes an obstacle on the left.
            wall_on_left = math.sin(offset) < 0
        if self._last_hand is not None:
            wall_on_left, self._last_hand = not self._last_hand, None
        self._begin_boundary(wall_on_left=wall_on_left)
        return STOP

    def _follow(self, observation: Observation, step: float) -> Twist:
        """Follow a boundary until a position closer to the goal is reachable."""
        boundary, goal = self._boundary, self.goals[0]
        directions = OpenDirections(observation, self._radius)
        limit = min(boundary.goal_distance, self._left_at) - NEARER
        nearer = place = directions.place_nearer_than(limit, goal)
        if self._sees_goal(observation) and not self._is_held(observation, goal):
            place = nearer or goal
        self._open = 0 if place is None else self._open + 1
        is_due = boundary.travelled >= boundary.least and self._open >= _SURE
        if place is not None and is_due:
            if nearer is not None:
                self._left_at = limit
            return self._leave(observation, place)
        if not boundary.is_reached:
            return self._approach(observation)
        part = boundary.look(observation, goal)
        if self.activity is Activity.ALIGNING:
            bearing = self._goal_bearing(observation.pose)
            twist, done = boundary.follower.align(observation, bearing)
            done = done or observation.time > boundary.reached_at + MOST_ALIGNING
            self.activity = Activity.FOLLOWING if done else Activity.ALIGNING
            return twist
        boundary.remember(part.pose.yaw, step)
        direction = boundary.follower.tangent(part)
        if boundary.closes_circuit(part.pose, direction):
            self.circuits += 1
            return self._conclude(observation)
        return boundary.follower.step(observation, part)[0]

    def _approach(self, observation: Observation) -> Twist:
        """Drive towards the obstacle that hides the goal, until a bumper is pressed."""
        bearing = self._goal_bearing(observation.pose)
        length = open_length(observation, bearing, self._radius)
        ahead = self._settings.bumpers.towards(observation, bearing)
        is_held = self._is_held(observation, self.goals[0])
        if ahead.blocked or length < GRAZE or is_held:
            self._boundary.reach(observation, bearing, self.goals[0])
            return STOP
        return self._head_for(observation, self.goals[0])

    def _leave(self, observation: Observation, place: Point) -> Twist:
        """Leave the boundary for a position; store the boundary for another hit."""
        self.leave_points.append((observation.pose.x, observation.pose.y))
        self._left = self._boundary if self._boundary.is_reached else None
        self._restart()
        self._place = place
        return self._head_for(observation, place)

    def _go_on(self, observation: Observation, *, is_other: bool) -> Twist:
        # The limit was set for an obstacle that is gone, or for another obstacle.
        self._left_at = math.inf
        twist = self._leave(observation, self.goals[0])
        # If the robot hits the same obstacle next,
        # it follows the boundary on the other side.
        self._left = None
        hand = self._boundary.follower.wall_on_left
        self._last_hand = hand if is_other else None
        return twist
