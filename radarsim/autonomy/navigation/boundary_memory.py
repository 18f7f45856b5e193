"""Memory of the boundary that a robot follows: points, landmarks and circuits.

Points with a gap between them that is too narrow for the robot belong to one obstacle.
So a robot that circles one of two poles does not switch to the other pole when both are
equally near.

Another robot that moves looks like an obstacle, and a path around it looks like a
circuit. So before a navigator concludes that no path exists, it checks the points of
the followed boundary in the newest scan. If beams pass through a point, the obstacle
there has moved away. Beams also pass through panes and reflect off mirrors. So an
obstacle that seemed to have moved away, but that the robot meets again at the same
position, counts as standing.

The boundary also checks whether the followed obstacle is the obstacle that was hit: its
first points have to be near the hit point, and a circuit has to pass there again.

The yaw of an INS drifts with the turned angle, so a point counts as gone only if beams
pass through all of its possible positions. Otherwise a robot that returns after a long
circuit would miss an obstacle that still stands.

Poses drift, so a robot never meets exactly the same point again. But a robot that
follows the same boundary in the same direction crosses the line perpendicular to its
path near the point. So a point is recognised by that line: a landmark.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.observation import Observation, wrap_angles
from radarsim.autonomy.navigation.wall_following import WallFollower
from radarsim.geometry import Point, Pose2, wrap_angle

LEAST_CIRCUIT: Final = 1.5  # m; a shorter closed path is not a circuit
LANDMARK_SPACING: Final = 2.0  # m between landmarks on a boundary
LINK: Final = 0.1  # m beyond twice the safety distance: widest gap within one obstacle
NEARER: Final = 0.15  # m; another obstacle nearer by this is followed instead
_REACH: Final = 0.6  # m that the nearest point may jump between two scans
NEAR = 0.6  # m from the hit point to the first points of its boundary
FIRST = 4  # points that have to be near the hit point
SPACING = 0.25  # m between two stored points
MAX_DISTANCE = 10.0  # m; points farther away are not checked
MARGIN = 0.4  # m beyond a point; longer beams show that it has gone
DRIFT = 0.03  # rad; the yaw drifts by this times the root of the turned angle
MOST_GONE: Final = 20  # vanished obstacles before the robot gives up
_BESIDE = 0.15  # m from a point to the beams that are compared with it


class Landmark:
    """A point on the robot's path, to detect when the robot passes it again.

    Attributes:
        x: Position, m, map frame.
        y: Position, m, map frame.
        direction: Direction of the path, rad, map frame.
        max_offset: Greatest distance from the point at which a path still passes it, m.
    """

    def __init__(self, pose: Pose2, direction: float, *, max_offset: float) -> None:
        """Create a landmark at a pose.

        Args:
            pose: A pose at the point.
            direction: Direction of the path, rad, map frame.
            max_offset: Greatest distance from the point at which a path still passes
                it, m.
        """
        self.x, self.y = pose.x, pose.y
        self.direction = direction
        self.max_offset = max_offset
        self._progress = 0.0  # m past the landmark, along its direction

    def observe(self, pose: Pose2, *, onward: bool = True) -> bool:
        """Add the robot's next pose; return whether it has just passed the point.

        Args:
            pose: The newest pose of the robot.
            onward: Count passes in the landmark's direction, instead of against it.
        """
        dx, dy = pose.x - self.x, pose.y - self.y
        c, s = math.cos(self.direction), math.sin(self.direction)
        before, self._progress = self._progress, c * dx + s * dy
        offset = abs(c * dy - s * dx)
        # Progress along the direction is stored at distant poses, too. Otherwise a
        # later step could look like a pass of the point.
        if offset > self.max_offset:
            return False
        return before < 0 <= self._progress if onward else before > 0 >= self._progress


def _linked_beams(
    observation: Observation, point: Point, bumpers: Bumpers
) -> NDArray[np.bool_]:
    """Return which beams, as (N,) booleans, end on the same obstacle as a point."""
    gap = 2 * bumpers.safety_distance + LINK
    near = np.flatnonzero(observation.ranges < bumpers.pressed_below + gap)
    pose = complex(observation.pose.x, observation.pose.y)
    ends = pose + observation.offsets(near)
    beams = np.zeros(len(observation.ranges), np.bool_)
    linked = np.abs(ends - complex(*point)) <= _REACH
    links = np.abs(ends[:, None] - ends) <= gap
    while not np.array_equal(grown := np.any(links[linked], axis=0), linked):
        linked = grown
    beams[near[linked]] = True
    return beams


class FollowedBoundary:
    """The obstacle boundary that the robot follows, with its points and landmarks.

    Passing one of its landmarks again closes a circuit. The hit point itself may lie
    off the path of a robot that follows the boundary. Then the first landmark on that
    path closes the circuit.

    Attributes:
        follower: Computes the motion along the boundary.
        hit_place: The point of the boundary that was hit, m, map frame.
        travelled: Distance driven along the boundary, m.
        least: Distance to drive along the boundary before the robot leaves it, m.
        reached_at: Time at which the robot reached the boundary, s.
        goal_distance: Least distance of the boundary from the goal so far, m.
        landmarks: Distance along the path, m, and landmark, the hit point first; empty
            until a circuit begins.
        circuit_start: Distance along the path at which the last circuit began, m.
    """

    def __init__(self, follower: WallFollower) -> None:
        self.follower = follower
        self.hit_place: Point = (math.nan, math.nan)
        self.travelled = 0.0
        self.least = 0.0
        self.reached_at = -math.inf
        self.goal_distance = -math.inf  # prevents leaving an unreached boundary
        self.landmarks: list[tuple[float, Landmark]] = []
        self.circuit_start = 0.0
        self._nearest: Point | None = None  # nearest point of the boundary, map frame
        self._seen: Point | None = None  # nearest point in the last scan, map frame
        # points of the boundary, m; for each one, the distance travelled, m, and the
        # angle turned, rad, at the time when the robot saw it
        self._points: list[tuple[Point, float, float]] = []
        self._turned = 0.0  # rad
        self._yaw: float | None = None  # rad; yaw of the last pose

    @property
    def is_reached(self) -> bool:
        """Whether the robot is next to the boundary."""
        return self._nearest is not None

    def reach(self, observation: Observation, bearing: float, goal: Point) -> float:
        """Start to follow the boundary of the obstacle at a bearing, rad.

        Returns:
            Direction along the boundary, rad, map frame.
        """
        self.hit_place, along = self.follower.hit(observation, bearing)
        self._nearest = self.hit_place
        self.reached_at = observation.time
        # ``look`` only ever reduces this distance, so its first value is set here.
        self.goal_distance = math.dist(self.hit_place, goal)
        return along

    def look(self, observation: Observation, goal: Point) -> Observation:
        """Return the scan without the beams that end on other obstacles.

        If another obstacle is clearly nearer on the boundary's side, or this boundary
        is out of sight, the whole scan is returned, so the nearest obstacle is
        followed. This method also updates the least distance of the boundary from the
        goal.
        """
        assert self._nearest is not None
        ends = _linked_beams(observation, self._nearest, self.follower.bumpers)
        part = replace(observation, ranges=np.where(ends, observation.ranges, np.inf))
        own = self.follower.boundary(part)
        nearest = self.follower.boundary(observation)
        self._seen = None if nearest is None else nearest[0]
        if nearest is None:
            return observation
        self._nearest, _ = own or nearest
        if own is None or nearest[1] < own[1] - NEARER:
            return observation
        self._seen = own[0]
        distances = np.hypot(*(part.points() - goal).T)
        nearest_to_goal = float(distances.min(initial=math.inf))
        self.goal_distance = min(self.goal_distance, nearest_to_goal)
        return part

    def remember(self, yaw: float, step: float) -> None:
        """Store the boundary point nearest to the robot; call this after ``look``.

        Args:
            yaw: Yaw of the robot, rad.
            step: Distance driven along the boundary since the last scan, m.
        """
        self.travelled += step
        if self._seen is not None:
            self.add(self._seen, yaw)

    def add(self, point: Point, yaw: float) -> None:
        """Store a point of the boundary, if it is far enough from the last stored one.

        Args:
            point: m, map frame.
            yaw: Yaw of the robot, rad; needed at every step.
        """
        self._turned, self._yaw = self._turned_until(yaw), yaw
        if not self._points or math.dist(point, self._points[-1][0]) >= SPACING:
            self._points.append((point, self.travelled, self._turned))

    def _turned_until(self, yaw: float) -> float:
        if self._yaw is None:
            return self._turned
        return self._turned + abs(wrap_angle(yaw - self._yaw))

    def has_gone(self, observation: Observation, gone: list[Point]) -> bool:
        """Return whether the followed obstacle has moved away in the meantime.

        Args:
            observation: The newest scan.
            gone: Hit points of obstacles that have gone, m, map frame; this hit point
                is added if its obstacle has gone.
        """
        is_there_again = any(self._passes(each, 0.0) for each in gone)
        if is_there_again or len(gone) >= MOST_GONE or self._stands(observation):
            return False
        gone.append(self.hit_place)
        return True

    def _stands(self, observation: Observation) -> bool:
        """Return whether at least half of the boundary points in view are still there.

        A boundary without any visible point has gone as well, since a robot that
        follows a standing boundary sees some of its points.
        """
        points = np.array([each for each, *_ in self._points]).reshape(-1, 2)
        pose = observation.pose
        x, y = (points - (pose.x, pose.y)).T
        distances = np.hypot(x, y)
        bearings = np.arctan2(y, x) - pose.yaw
        # The yaw error is a random walk: it grows with the square
        # root of the angle turned since a point was seen. So
        # beams at all possible bearings of the point are checked.
        turned_at = np.array([at for *_, at in self._points])
        turned = self._turned_until(pose.yaw) - turned_at
        spread = np.maximum(_BESIDE / np.maximum(distances, _BESIDE), math.radians(2))
        spread += DRIFT * np.sqrt(turned)
        is_near = distances < MAX_DISTANCE
        distances, bearings = distances[is_near], bearings[is_near]
        offsets = wrap_angles(bearings[:, None] - observation.bearings)
        is_beam = np.abs(offsets) <= spread[is_near, None]
        beams = np.where(is_beam, observation.ranges, math.inf)
        beyond = beams.min(axis=1, initial=math.inf) - distances
        # If a nearer obstacle hides a point, the point
        # counts neither as gone nor as standing.
        gone, standing = beyond > MARGIN, np.abs(beyond) <= MARGIN
        return bool(gone.sum() <= standing.sum() and standing.any())

    def _passes(self, point: Point, station: float) -> bool:
        """Return whether the boundary, after a length, m, comes near a point, m.

        Without stored points the answer is unknown, and True is returned.
        """
        return not self._points or any(
            at >= station and math.dist(each, point) <= NEAR
            for each, at, _ in self._points
        )

    def is_what_was_hit(self) -> bool:
        """Return whether the robot has circled the same obstacle that it hit.

        In that case most of the first points are near the hit point. After a hit in a
        gap, the robot may instead follow the other side of the gap. Inside a gap it may
        also switch to another obstacle and not return.
        """
        hit = self.hit_place
        first = [math.dist(each, hit) <= NEAR for each, *_ in self._points[:FIRST]]
        begins_there = 2 * sum(first) >= len(first)
        return begins_there and self._passes(hit, self.circuit_start)

    def closes_circuit(self, pose: Pose2, direction: float) -> bool:
        """Add the next step along the boundary; return whether a circuit is complete.

        Call this after ``remember``. It also adds landmarks at regular distances.

        Args:
            pose: Pose of the robot.
            direction: Direction along the boundary, rad, map frame.
        """
        if not self.landmarks:
            self.add_landmark(pose, direction, 0.0)
        # A landmark detects passes only if it has observed every pose.
        passed = [at for at, mark in self.landmarks if mark.observe(pose)]
        if self.travelled - self.landmarks[-1][0] >= LANDMARK_SPACING:
            self.add_landmark(pose, direction, self.travelled)
        # Noise may look like a pass of a landmark that
        # was added recently, so such passes do not count.
        closing = [at for at in passed if self.travelled - at >= LEAST_CIRCUIT]
        self.circuit_start = closing[0] if closing else self.circuit_start
        return bool(closing)

    def add_landmark(self, pose: Pose2, direction: float, at: float) -> None:
        """Add a landmark at a pose, with its direction, rad, and path length, m."""
        reach = self.follower.target_distance
        self.landmarks.append((at, Landmark(pose, direction, max_offset=reach)))
