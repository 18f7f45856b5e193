"""Path planning: along the cheapest path to the goal, on the grid as it is seen so far.

What nobody has seen counts as open, so paths are as short as they can be, and are
planned anew while the robot drives. There is no path if none is left on the grid, nor
around it, and the robot has stood and looked for a moment.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from radarsim.geometry import Floats, Pose2
from radarsim.navigation.control import STOP, Twist, bearing_of, distance, moved
from radarsim.navigation.controller import (
    Activity,
    Controller,
    ControllerSettings,
    Point,
)
from radarsim.navigation.grid_path import may_join_outside, shortest_path
from radarsim.navigation.observation import Observation
from radarsim.navigation.obstacle_grid import CELL, ObstacleGrid
from radarsim.navigation.open_directions import leads_too_near
from radarsim.navigation.passage import CHEAP

INTERVAL: Final = 0.5  # s between two plans
LOOKAHEAD: Final = 2.0  # m of a path that is cut short where the straight line is open
SURE_AFTER: Final = 5.0  # s without a path after which there is none
ESCAPE_RADIUS: Final = 1.0  # m around a robot that is too near to something
ESCAPE_COST: Final = 10.0
_MOST_GROWN: Final = 10  # margins around the first grid


class PathPlanning(Controller):
    """Planned paths; has no hit points, leave points and circuits."""

    def __init__(self, goals: Sequence[Point], settings: ControllerSettings) -> None:
        super().__init__(goals, settings)
        self._grid: ObstacleGrid | None = None
        self._cost: Floats = np.zeros((0, 0))
        self._path: Floats = np.zeros((0, 2))
        self._planned = -math.inf  # s
        self._hopeless_since: float | None = None  # s
        self._grown = 0  # number of times that the grid has grown

    def _begin_goal(self, _: Pose2) -> None:
        self._planned = -math.inf

    def _decide(self, observation: Observation, _: float) -> Twist:
        if observation.time >= self._planned + INTERVAL:
            self._plan(observation)
        if len(self._path):
            return self._drive(observation)
        return self._look(observation)

    def _plan(self, observation: Observation) -> None:
        """Add the scan to the grid, and plan a path on it."""
        pose, goal = observation.pose, self.goals[0]
        if self._grid is None:
            self._grid = ObstacleGrid([(pose.x, pose.y), *self.goals])
        self._grid.add(observation)
        self._planned = observation.time
        cost = self._grid.cost(self._settings.bumpers.safety_distance)
        start, end = self._grid.cell((pose.x, pose.y)), self._grid.cell(goal)
        if not math.isfinite(cost[start]):
            rows, columns = np.indices(cost.shape)
            near = np.hypot(rows - start[0], columns - start[1]) * CELL < ESCAPE_RADIUS
            cost[near & ~np.isfinite(cost)] = ESCAPE_COST
        targets = np.zeros(cost.shape, np.bool_)
        targets[end] = True
        self._cost = cost
        self._path = self._grid.centres(shortest_path(cost, start, targets))
        if len(self._path):
            self._path[-1] = goal
        elif self._grown < _MOST_GROWN and may_join_outside(
            np.isfinite(cost), start, end
        ):
            self._grid.grow()
            self._grown += 1
            self._hopeless_since = None

    def _look(self, observation: Observation) -> Twist:
        """Stand where there is no path; if none appears, there is none."""
        if self._hopeless_since is None:
            self._hopeless_since = observation.time
        if observation.time - self._hopeless_since >= SURE_AFTER:
            self.activity = Activity.NO_PATH
        return STOP

    def _drive(self, observation: Observation) -> Twist:
        """Head for a point of the path, and only turn where something is too near."""
        self._hopeless_since = None
        pose = observation.pose
        left = distance(pose, *self.goals[0])
        bearing = bearing_of(pose, *self._next_point(pose))
        twist = self._settings.speed_limits.towards(bearing, most=0.05 + 0.8 * left)
        safety_distance = self._settings.bumpers.safety_distance
        is_near = leads_too_near(observation, safety_distance)
        return Twist(0.0, twist.turn) if is_near else twist

    def _next_point(self, pose: Pose2) -> Point:
        """Return the farthest point of the path to which the straight line is open."""
        distances = np.hypot(*(self._path - (pose.x, pose.y)).T)
        nearest = int(distances.argmin())
        ahead, away = self._path[nearest:], distances[nearest:]
        within = int((away > LOOKAHEAD).argmax()) if away.max() > LOOKAHEAD else None
        chosen = ahead[min(2, len(ahead) - 1)]
        for point in ahead[:within][::-1]:
            if self._is_cheap(pose, point):
                chosen = point
                break
        return float(chosen[0]), float(chosen[1])

    def _is_cheap(self, pose: Pose2, point: Floats) -> bool:
        """Return whether the straight line to a point costs little more than open."""
        assert self._grid is not None
        end = Pose2(float(point[0]), float(point[1]))
        count = max(2, math.ceil(moved(pose, end) / CELL * 2))
        line = np.linspace((pose.x, pose.y), (end.x, end.y), count)
        costs = self._cost[self._grid.cells(line)]
        return bool(costs.max() <= max(CHEAP, costs[0], costs[-1]))
