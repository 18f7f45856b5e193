"""Whether an obstacle still stands where it was when a robot went around it.

A robot that drives by looks like an obstacle, and a path around it closes like a
circuit. So before a navigator concludes that there is no path, it looks again at the
points of the boundary that it has followed: those that beams go through have gone.

It also tells whether what was followed is what was hit: its first points are near the
hit point, and a circuit passes there again.

The yaw of an INS drifts with the angles turned, so a point has gone only if beams go
through wherever it may be by now. Otherwise a robot that has come back after a long
circuit would not find what stands there.
"""

import math

import numpy as np

from radarsim.geometry import wrap_angle
from radarsim.navigation.observation import Observation, wrap_angles

NEAR = 0.6  # m from what was hit to the points of its boundary there
FIRST = 4  # such points
SPACING = 0.25  # m between the points that are kept
MAX_DISTANCE = 10.0  # m; points farther away are not looked at
MARGIN = 0.4  # m that a beam goes beyond a point that has gone, or stops before it
DRIFT = 0.03  # rad; times the root of the angle turned, the drift of the yaw
_BESIDE = 0.15  # m beside a point that beams still count as beams to it

Point = tuple[float, float]


class StandingObstacle:
    """Keeps points of a boundary, to look at them again."""

    def __init__(self) -> None:
        self._points: list[Point] = []
        self._stations: list[float] = []  # m along the path where each was seen
        self._turned_at: list[float] = []  # rad turned when each point was seen
        self._turned = 0.0  # rad
        self._yaw: float | None = None  # rad; of the last pose

    def add(self, point: Point, yaw: float, station: float = 0.0) -> None:
        """Add a point of the boundary, if it is away from the last.

        Args:
            point: m, map frame.
            yaw: The robot's, rad; to be told at every step.
            station: Length of the path along the boundary until there, m.
        """
        self._turn_to(yaw)
        if not self._points or math.dist(point, self._points[-1]) >= SPACING:
            self._points.append(point)
            self._turned_at.append(self._turned)
            self._stations.append(station)

    def _turn_to(self, yaw: float) -> None:
        self._turned += 0.0 if self._yaw is None else abs(wrap_angle(yaw - self._yaw))
        self._yaw = yaw

    def begins_at(self, point: Point) -> bool:
        """Return whether most of its first points are near a point, m, map frame."""
        first = [math.dist(each, point) <= NEAR for each in self._points[:FIRST]]
        return 2 * sum(first) >= len(first)

    def passes(self, point: Point, station: float) -> bool:
        """Return whether its boundary came near a point, m, map frame, after a station.

        If it has no points, that is not known, and counts as passed.
        """
        return not self._points or any(
            math.dist(each, point) <= NEAR
            for each, at in zip(self._points, self._stations, strict=True)
            if at >= station
        )

    def has_gone(self, observation: Observation) -> bool:
        """Return whether more points have gone than stand, of those in sight.

        A boundary of which no point is in sight has gone as well: who follows a
        boundary that stands sees some of it.
        """
        points = np.array(self._points).reshape(-1, 2)
        pose = observation.pose
        self._turn_to(pose.yaw)
        drift = DRIFT * np.sqrt(self._turned - np.array(self._turned_at))
        x, y = (points - (pose.x, pose.y)).T
        distances = np.hypot(x, y)
        bearings = np.arctan2(y, x) - pose.yaw
        is_near = distances < MAX_DISTANCE
        distances, bearings = distances[is_near], bearings[is_near]
        spread = np.maximum(_BESIDE / np.maximum(distances, _BESIDE), math.radians(2))
        spread += drift[is_near]
        offsets = wrap_angles(bearings[:, None] - observation.bearings)
        beams = np.where(
            np.abs(offsets) <= spread[:, None], observation.ranges, math.inf
        )
        beyond = beams.min(axis=1, initial=math.inf) - distances
        gone, standing = beyond > MARGIN, np.abs(beyond) <= MARGIN
        return bool(gone.sum() > standing.sum() or not standing.any())
