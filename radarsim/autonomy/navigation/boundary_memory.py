"""The boundary that a robot follows, and what it remembers of it.

Points between which the robot does not fit belong to one obstacle. So a robot that goes
around one of two poles does not change to the other where that is as near.

A robot that drives by looks like an obstacle, and a path around it closes like a
circuit. So before a navigator concludes that there is no path, it looks again at the
points of the boundary that it has followed: those that beams go through have gone.
Beams go through panes as well, and off mirrors. So what it meets where something seemed
to have gone stands there.

It also checks whether the robot followed the obstacle that it hit: then its first
points are near the hit point, and a circuit passes there again.

The yaw of an INS drifts with the angles turned, so a point has gone only if beams go
through wherever it may be by now. Otherwise a robot that has come back after a long
circuit would not find what stands there.

Poses drift, so the very same point is never met again. But a robot that follows the
same boundary in the same direction crosses the line perpendicular to its path there,
not far from the point. So a point is recognised by that line: a landmark.
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

LEAST_CIRCUIT: Final = 1.5  # m; a shorter closed path is no circuit
LANDMARK_SPACING: Final = 2.0  # m between landmarks on a boundary
LINK: Final = 0.1  # m beyond twice the safety distance: widest gap within an obstacle
NEARER: Final = 0.15  # m by which another obstacle is nearer if it is steered by
_REACH: Final = 0.6  # m that the nearest point may jump between two scans
NEAR = 0.6  # m from what was hit to the points of its boundary there
FIRST = 4  # such points
SPACING = 0.25  # m between the points that are kept
MAX_DISTANCE = 10.0  # m; points farther away are not looked at
MARGIN = 0.4  # m that a beam goes beyond a point that has gone, or stops before it
DRIFT = 0.03  # rad; times the root of the angle turned, the drift of the yaw
MOST_GONE: Final = 20  # obstacles that go away, before it gives up nevertheless
_BESIDE = 0.15  # m from a point, at which beams still count as beams to it


class Landmark:
    """A point of a path, and the direction of the path there.

    Attributes:
        x: m, map frame.
        y: m, map frame.
        direction: rad, map frame.
        max_offset: Distance at which a path still passes the point, m.
    """

    def __init__(self, pose: Pose2, direction: float, *, max_offset: float) -> None:
        """Create a landmark.

        Args:
            pose: A pose at the point.
            direction: Direction of the path, rad, map frame.
            max_offset: Distance at which a path still passes the point, m.
        """
        self.x, self.y = pose.x, pose.y
        self.direction = direction
        self.max_offset = max_offset
        self._progress = 0.0  # m past the landmark, along its direction

    def observe(self, pose: Pose2, *, onward: bool = True) -> bool:
        """Take the next pose of a path; return whether it has just passed this point.

        Args:
            pose: The robot's pose now.
            onward: Whether the pass counts along the landmark's direction, or against.
        """
        dx, dy = pose.x - self.x, pose.y - self.y
        c, s = math.cos(self.direction), math.sin(self.direction)
        before, self._progress = self._progress, c * dx + s * dy
        offset = abs(c * dy - s * dx)
        # Only now that the progress is noted, or a later step would seem to pass it.
        if offset > self.max_offset:
            return False
        return before < 0 <= self._progress if onward else before > 0 >= self._progress


def _linked_beams(
    observation: Observation, point: Point, bumpers: Bumpers
) -> NDArray[np.bool_]:
    """Return which beams end on the obstacle that a point belongs to, (N,)."""
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
    """The boundary that is followed, and its points and landmarks so far.

    Passing one of its landmarks again closes a circuit. The hit point itself may lie
    off the path of a robot that follows the boundary. Then the first landmark on that
    path closes the circuit.

    Attributes:
        follower: Follows it.
        hit_place: The point of it that was hit, m, map frame.
        travelled: m along it.
        least: m to be followed before it is left for a place nearer to the goal.
        reached_at: When the robot reached it, s.
        goal_distance: Its least distance from the goal so far, m.
        landmarks: Where on the path along it each is, m, the hit point first; none
            before a circuit around it begins.
        circuit_start: Where on the path along it the last circuit began, m.
    """

    def __init__(self, follower: WallFollower) -> None:
        self.follower = follower
        self.hit_place: Point = (math.nan, math.nan)
        self.travelled = 0.0
        self.least = 0.0
        self.reached_at = -math.inf
        self.goal_distance = -math.inf  # so that it is not left before it is reached
        self.landmarks: list[tuple[float, Landmark]] = []
        self.circuit_start = 0.0
        self._nearest: Point | None = None  # point of it, map frame
        self._seen: Point | None = None  # nearest point of the last look, likewise
        # points of it, m; where along the path each was seen, m, and the rad turned by
        # then, to look at them again
        self._points: list[tuple[Point, float, float]] = []
        self._turned = 0.0  # rad
        self._yaw: float | None = None  # rad; of the last pose

    @property
    def is_reached(self) -> bool:
        """Whether the robot has reached it."""
        return self._nearest is not None

    def reach(self, observation: Observation, bearing: float, goal: Point) -> float:
        """Begin at it, where a bumper is pressed towards a bearing, rad.

        Returns:
            The direction along it, rad, map frame.
        """
        self.hit_place, along = self.follower.hit(observation, bearing)
        self._nearest = self.hit_place
        self.reached_at = observation.time
        # Known before it is looked at: else any place would be nearer to the goal.
        self.goal_distance = math.dist(self.hit_place, goal)
        return along

    def look(self, observation: Observation, goal: Point) -> Observation:
        """Return a scan without the beams that end on other obstacles.

        If another one is clearly nearer on the boundary's hand, or this one is out of
        sight, the whole scan is returned: then the nearest one is followed. The least
        distance of the boundary from a goal is updated.
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
        """Remember its nearest point, after a look.

        Args:
            yaw: The robot's, rad.
            step: m that the robot has driven along it since the last scan.
        """
        self.travelled += step
        if self._seen is not None:
            self.add(self._seen, yaw)

    def add(self, point: Point, yaw: float) -> None:
        """Add a point of it, if that is away from the last.

        Args:
            point: m, map frame.
            yaw: The robot's, rad; needed at every step.
        """
        self._turned, self._yaw = self._turned_until(yaw), yaw
        if not self._points or math.dist(point, self._points[-1][0]) >= SPACING:
            self._points.append((point, self.travelled, self._turned))

    def _turned_until(self, yaw: float) -> float:
        if self._yaw is None:
            return self._turned
        return self._turned + abs(wrap_angle(yaw - self._yaw))

    def has_gone(self, observation: Observation, gone: list[Point]) -> bool:
        """Return whether it has driven away since it was followed.

        Args:
            observation: The newest scan.
            gone: Where others were hit that had gone, m, map frame; this one is added.
        """
        is_there_again = any(self._passes(each, 0.0) for each in gone)
        if is_there_again or len(gone) >= MOST_GONE or self._stands(observation):
            return False
        gone.append(self.hit_place)
        return True

    def _stands(self, observation: Observation) -> bool:
        """Return whether no more points have gone than stand, of those in sight.

        A boundary without a point in sight has gone as well: a robot that follows one
        that stands sees some of it.
        """
        points = np.array([each for each, *_ in self._points]).reshape(-1, 2)
        pose = observation.pose
        x, y = (points - (pose.x, pose.y)).T
        distances = np.hypot(x, y)
        bearings = np.arctan2(y, x) - pose.yaw
        # The yaw walks at random as the robot turns: it is off by the root of the turn
        # since a point was seen. So all beams count on which the point may be by now.
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
        # Points behind something nearer are neither gone nor known to stand.
        gone, standing = beyond > MARGIN, np.abs(beyond) <= MARGIN
        return bool(gone.sum() <= standing.sum() and standing.any())

    def _passes(self, point: Point, station: float) -> bool:
        """Return whether it came near a point, m, map frame, after a station.

        If none of its points is known, that is not known, and counts as passed.
        """
        return not self._points or any(
            at >= station and math.dist(each, point) <= NEAR
            for each, at, _ in self._points
        )

    def is_what_was_hit(self) -> bool:
        """Return whether the last circuit went around what the robot has hit.

        Most of the first points of that are near the hit point. Where the robot hits
        something in a gap, what it follows may be the other side of the gap; and in a
        gap that it follows it may get to another obstacle, and not back.
        """
        hit = self.hit_place
        first = [math.dist(each, hit) <= NEAR for each, *_ in self._points[:FIRST]]
        begins_there = 2 * sum(first) >= len(first)
        return begins_there and self._passes(hit, self.circuit_start)

    def closes_circuit(self, pose: Pose2, direction: float) -> bool:
        """Take the next step along it; return whether that ends a circuit.

        To be called after ``remember``. A landmark is set there if it is time for one.

        Args:
            pose: Of the robot.
            direction: Along it, rad, map frame.
        """
        if not self.landmarks:
            self.add_landmark(pose, direction, 0.0)
        # Each of them has to see every step.
        passed = [at for at, mark in self.landmarks if mark.observe(pose)]
        if self.travelled - self.landmarks[-1][0] >= LANDMARK_SPACING:
            self.add_landmark(pose, direction, self.travelled)
        # The landmarks that were just set are passed by noise alone.
        closing = [at for at in passed if self.travelled - at >= LEAST_CIRCUIT]
        self.circuit_start = closing[0] if closing else self.circuit_start
        return bool(closing)

    def add_landmark(self, pose: Pose2, direction: float, at: float) -> None:
        """Add a landmark at a pose, m along the path; arguments as those before."""
        reach = self.follower.target_distance
        self.landmarks.append((at, Landmark(pose, direction, max_offset=reach)))
