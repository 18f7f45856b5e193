"""How far a robot could go in each direction, and the edges of what is in its way.

The robot is a disc, and the ends of beams are points: in each direction the first point
that the disc would touch ends its way.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.navigation.observation import Observation, wrap_angles

HORIZON: Final = 10.0  # m; nothing farther away is looked at
JUMP: Final = 0.5  # m between two neighbouring directions, where an obstacle ends
TOO_NEAR: Final = 0.1  # m less than the safety distance that nothing ahead may be
_FACING: Final = math.cos(math.radians(60.0))  # towards what the disc already touches
_STEP: Final = 0.15  # m ahead of the robot that ``leads_too_near`` looks

Point = tuple[float, float]


class OpenDirections:
    """What one scan tells of the ways of a disc.

    Attributes:
        bearings: (N,) rad from the robot's front, increasing.
        lengths: (N,) m that the disc's centre could go, at most ``HORIZON``.
    """

    def __init__(self, observation: Observation, radius: float) -> None:
        """Compute them.

        Args:
            observation: The scan.
            radius: Of the disc, m.
        """
        self._pose = observation.pose
        self._radius = radius
        self.bearings = np.sort(observation.bearings)
        self.lengths = open_lengths(observation, self.bearings, radius)

    def reaches(self, point: Point) -> bool:
        """Return whether the disc could go straight to a point, m, map frame."""
        dx, dy = point[0] - self._pose.x, point[1] - self._pose.y
        bearing = math.atan2(dy, dx) - self._pose.yaw
        nearest = np.abs(wrap_angles(self.bearings - bearing)).argmin()
        return bool(self.lengths[nearest] >= min(math.hypot(dx, dy), HORIZON))

    def edges(self) -> Floats:
        """Return where obstacles end, (M, 2) m, map frame: the disc passes them there.

        That is in the first open direction beside an obstacle, beside its end.
        """
        after = np.roll(self.lengths, -1)
        opens = np.flatnonzero(after - self.lengths > JUMP)
        closes = np.flatnonzero(self.lengths - after > JUMP)
        free = np.concatenate([(opens + 1) % len(after), closes])
        beside = np.concatenate([self.lengths[opens], after[closes]])
        return self._points(free, np.minimum(beside + self._radius, self.lengths[free]))

    def nearest_to(self, goal: Point) -> Point:
        """Return the place nearest to a goal to which the disc could go straight."""
        angles = self.bearings + self._pose.yaw
        dx, dy = goal[0] - self._pose.x, goal[1] - self._pose.y
        along = dx * np.cos(angles) + dy * np.sin(angles)
        places = self._points(np.arange(len(angles)), np.clip(along, 0.0, self.lengths))
        x, y = places[np.hypot(*(places - goal).T).argmin()].tolist()
        return x, y

    def _points(self, directions: NDArray[np.int64], lengths: Floats) -> Floats:
        angles = self.bearings[directions] + self._pose.yaw
        x = self._pose.x + lengths * np.cos(angles)
        y = self._pose.y + lengths * np.sin(angles)
        return np.column_stack([x, y])


def open_lengths(observation: Observation, bearings: Floats, radius: float) -> Floats:
    """Return how far the centre of a disc could go in some directions.

    What it touches already closes the directions towards it.

    Args:
        observation: The scan.
        bearings: (M,) rad from the robot's front.
        radius: Of the disc, m.

    Returns:
        (M,) m, at most ``HORIZON``.
    """
    near = observation.ranges < HORIZON + radius
    ranges, angles = observation.ranges[near], observation.bearings[near]
    x, y = ranges * np.cos(angles), ranges * np.sin(angles)
    c, s = np.cos(bearings)[:, None], np.sin(bearings)[:, None]
    along, beside = c * x + s * y, np.abs(c * y - s * x)
    before = along - np.sqrt(np.maximum(radius**2 - beside**2, 0.0))
    touches = ranges <= radius
    closes = np.where(touches, along > _FACING * ranges, beside < radius) & (along > 0)
    lengths = np.where(closes, np.where(touches, 0.0, before), HORIZON)
    shortest: Floats = np.maximum(lengths.min(axis=1, initial=HORIZON), 0.0)
    return shortest


def leads_too_near(observation: Observation, safety_distance: float) -> bool:
    """Return whether a step ahead would bring the robot too near to something.

    Args:
        observation: The newest scan.
        safety_distance: m from the robot's centre.
    """
    near = observation.ranges < safety_distance + 2 * _STEP
    ranges, bearings = observation.ranges[near], observation.bearings[near]
    x, y = ranges * np.cos(bearings), ranges * np.sin(bearings)
    after = float(np.hypot(x - _STEP, y).min(initial=math.inf))
    return after < min(safety_distance - TOO_NEAR, float(ranges.min(initial=math.inf)))
