"""Distances that a robot can drive in each direction, and the edges of obstacles.

The robot is a disc, and the ends of beams are points: in each direction, the free
distance ends at the first point that the disc would touch.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.autonomy.navigation.observation import Observation, wrap_angles
from radarsim.geometry import Floats, Point

HORIZON: Final = 10.0  # m; points farther away are ignored
MOST_DIRECTIONS: Final = 720  # directions computed; all beams still count as obstacles
JUMP: Final = 0.5  # m; a larger jump of the free distance is an edge
PAST: Final = 0.3  # m from the end of an obstacle to its edge point
TOO_NEAR: Final = 0.1  # m by which the space ahead may be too small
_FACING: Final = math.cos(math.radians(60.0))  # towards a touched point
_PLACES: Final = 20  # positions checked in each direction
_STEP: Final = 0.15  # m; length of the step in ``leads_too_near``


class OpenDirections:
    """How far a disc can move in each direction, computed from one scan.

    Attributes:
        bearings: (N,) rad from the robot's front, increasing; for more than
            ``MOST_DIRECTIONS`` beams, only every second, third and so on is used.
        lengths: (N,) m that the disc's centre can move, at most ``HORIZON``.
    """

    def __init__(self, observation: Observation, radius: float) -> None:
        """Compute how far a disc can move in each direction of a scan.

        Args:
            observation: The scan.
            radius: Radius of the disc, m.
        """
        self._pose = observation.pose
        step = 1 + (len(observation.bearings) - 1) // MOST_DIRECTIONS
        # Bearings of a scan may jump from pi to -pi, so they are sorted.
        self.bearings = np.sort(observation.bearings)[::step]
        self.lengths, ends = _first_touches(observation, self.bearings, radius)
        self._ends = ends
        after = np.roll(ends, -1, axis=0)
        # A disc cannot pass between two points that are closer than its diameter.
        is_linked = np.hypot(*(after - ends).T) <= 2 * radius
        grows = np.roll(self.lengths, -1) - self.lengths
        self._is_wall = is_linked | (np.abs(grows) <= JUMP)
        opens = np.flatnonzero(~self._is_wall & (grows > 0))
        closes = np.flatnonzero(~self._is_wall & (grows < 0))
        beyond = len(grows)
        # Each end of an obstacle lies between an open direction and a closed one.
        self._open = np.concatenate([(opens + 1) % beyond, closes])
        self._beside = np.concatenate([opens, (closes + 1) % beyond])

    def reaches(self, point: Point) -> bool:
        """Return whether the disc can move straight to a point, m, map frame."""
        dx, dy = point[0] - self._pose.x, point[1] - self._pose.y
        bearing = math.atan2(dy, dx) - self._pose.yaw
        # Free distances are known only for some
        # directions; the nearest of these is used.
        nearest = np.abs(wrap_angles(self.bearings - bearing)).argmin()
        return bool(self.lengths[nearest] >= min(math.hypot(dx, dy), HORIZON))

    def edges(self) -> Floats:
        """Return edges of obstacles, (M, 2) m, map frame, that the disc can pass.

        An edge lies in the first open direction next to an obstacle, a little past its
        end.
        """
        angles = self.bearings[self._open]
        x, y = self._ends[self._beside].T
        past = x * np.cos(angles) + y * np.sin(angles) + PAST
        return self._points(self._open, np.minimum(past, self.lengths[self._open]))

    def hidden_ends(self) -> Floats:
        """Return points, (M, 2) m, map frame, where edges begin to hide a wall."""
        lengths = self.lengths[self._open]
        is_wall = lengths < HORIZON
        return self._points(self._beside[is_wall], lengths[is_wall])

    def walls(self) -> tuple[Floats, Floats]:
        """Return the visible parts of obstacles as thin walls between two end points.

        Returns:
            Two arrays, (K, 2) m, map frame.
        """
        places = self._points(np.arange(len(self.lengths)), self.lengths)
        after = np.roll(self.lengths, -1)
        is_near = (self.lengths < HORIZON) & (after < HORIZON)
        is_wall = self._is_wall & is_near
        return places[is_wall], np.roll(places, -1, axis=0)[is_wall]

    def place_nearer_than(self, distance: float, goal: Point) -> Point | None:
        """Return a position nearer to a goal that the disc reaches in a straight line.

        Of all such positions, the one on the shortest path to the goal is returned.

        Args:
            distance: Greatest distance of the position from the goal, m.
            goal: m, map frame.

        Returns:
            m, map frame; None without such a position.
        """
        directions = np.repeat(np.arange(len(self.lengths)), _PLACES)
        shares = np.tile(np.arange(1, _PLACES + 1) / _PLACES, len(self.lengths))
        places = self._points(directions, shares * self.lengths[directions])
        left = np.hypot(*(places - goal).T)
        ways = left + np.hypot(*(places - (self._pose.x, self._pose.y)).T)
        ways[left >= distance] = math.inf
        best = int(ways.argmin())
        if not math.isfinite(ways[best]):
            return None
        return float(places[best, 0]), float(places[best, 1])

    def _points(self, directions: NDArray[np.int64], lengths: Floats) -> Floats:
        angles = self.bearings[directions] + self._pose.yaw
        x = self._pose.x + lengths * np.cos(angles)
        y = self._pose.y + lengths * np.sin(angles)
        return np.column_stack([x, y])


def open_length(observation: Observation, bearing: float, radius: float) -> float:
    """Return how far, m, the centre of a disc can move in a direction.

    A point that the disc already touches closes only the directions towards it.

    Args:
        observation: The scan.
        bearing: rad from the robot's front.
        radius: Radius of the disc, m.

    Returns:
        At most ``HORIZON``.
    """
    (length,), _ = _first_touches(observation, np.array([bearing]), radius)
    return float(length)


def _first_touches(
    observation: Observation, bearings: Floats, radius: float
) -> tuple[Floats, Floats]:
    """Return how far a disc can move, (M,), and the points that it then touches.

    Returns:
        (M,) m, and (M, 2) m in the robot's frame; nan in free directions.
    """
    near = observation.ranges < HORIZON + radius
    if not near.any():
        return np.full(len(bearings), HORIZON), np.full((len(bearings), 2), np.nan)
    ranges, angles = observation.ranges[near], observation.bearings[near]
    x, y = ranges * np.cos(angles), ranges * np.sin(angles)
    c, s = np.cos(bearings)[:, None], np.sin(bearings)[:, None]
    along, off = c * x + s * y, np.abs(c * y - s * x)
    # distance of the disc's centre when its edge touches
    # a point that is ``off`` from the line of motion
    before = along - np.sqrt(np.maximum(radius**2 - off**2, 0.0))
    # A point inside the disc blocks only the directions towards it, so that a robot
    # that is too close to an obstacle can drive away.
    touches = ranges <= radius
    closes = np.where(touches, along > _FACING * ranges, off < radius) & (along > 0)
    lengths = np.where(closes, np.where(touches, 0.0, before), HORIZON)
    first = lengths.argmin(axis=1)
    shortest = np.clip(lengths.min(axis=1), 0.0, HORIZON)
    ends = np.column_stack([x[first], y[first]])
    ends[shortest >= HORIZON] = np.nan  # nan compares false, so no points are linked
    return shortest, ends


def leads_too_near(observation: Observation, safety_distance: float) -> bool:
    """Return whether a step ahead would bring the robot too close to an obstacle.

    Args:
        observation: The newest scan.
        safety_distance: Safety distance from the robot's centre, m.
    """
    near = observation.ranges < safety_distance + 2 * _STEP
    ranges, bearings = observation.ranges[near], observation.bearings[near]
    x, y = ranges * np.cos(bearings), ranges * np.sin(bearings)
    # The limit is at most the current distance, so that a
    # robot that is too close to an obstacle can drive away.
    after = float(np.hypot(x - _STEP, y).min(initial=math.inf))
    return after < min(safety_distance - TOO_NEAR, float(ranges.min(initial=math.inf)))
