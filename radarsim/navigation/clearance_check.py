"""Notices a start or a goal that is nearer to something than the safety distance."""

import math
from typing import Final

import numpy as np

from radarsim.errors import TooNearError
from radarsim.geometry import Pose2
from radarsim.navigation.bumpers import Bumpers
from radarsim.navigation.control import moved
from radarsim.navigation.observation import Observation

START_NOISE: Final = 0.05  # m that something at the start may seem nearer than it is
GOAL_NOISE: Final = 0.1  # m; at the goal, which is seen from afar
DRIFT: Final = 0.005  # m for each m of path by which the goal may seem elsewhere
STANDING_AFTER: Final = 4.0  # s for which something is near the goal, if it stands
_PLACE: Final = 0.15  # m within which it is the same thing

Point = tuple[float, float]


class ClearanceCheck:
    """Looks at the start once, and at what is seen around the next goal."""

    def __init__(self, bumpers: Bumpers) -> None:
        self._bumpers = bumpers
        self._is_first = True
        self._previous: Pose2 | None = None
        self._travelled = 0.0  # m
        self._place = (math.inf, math.inf)  # of what is near the goal, m, map frame
        self._since = 0.0  # s; when it was first seen there

    def check(self, observation: Observation, goal: Point | None) -> None:
        """Look at a scan.

        Args:
            observation: The scan.
            goal: The next goal, m, map frame; None if there is none.

        Raises:
            TooNearError: If something is nearer to the start than the safety distance,
                or stands so near to the goal.
        """
        self._travelled += moved(self._previous or observation.pose, observation.pose)
        self._previous = observation.pose
        if self._is_first:
            self._is_first = False
            self._check_start(observation)
        if goal is not None:
            self._check_goal(observation, goal)

    def _check_start(self, observation: Observation) -> None:
        nearest = min(each.distance for each in self._bumpers.read(observation))
        if nearest < self._bumpers.safety_distance - START_NOISE:
            pose = observation.pose
            self._raise("start", (pose.x, pose.y), nearest)

    def _check_goal(self, observation: Observation, goal: Point) -> None:
        points = observation.points()
        distances = np.hypot(*(points - goal).T)
        safety_distance = self._bumpers.safety_distance
        unsure = min(GOAL_NOISE + DRIFT * self._travelled, safety_distance / 2)
        near = distances < safety_distance - unsure
        if not near.any():
            self._place = (math.inf, math.inf)
            return
        if np.hypot(*(points[near] - self._place).T).min() > _PLACE:
            x, y = points[distances.argmin()].tolist()
            self._place, self._since = (x, y), observation.time
        if observation.time - self._since >= STANDING_AFTER:
            self._raise("goal", goal, float(distances.min()))

    def _raise(self, what: str, place: Point, distance: float) -> None:
        least = self._bumpers.safety_distance
        raise TooNearError(
            f"{what} {place[0]:.2f} {place[1]:.2f} is {distance:.2f} m from something,"
            f" expected at least the safety distance, {least:g} m"
        )
