"""Path planning: along the cheapest path to the goal, on the grid as it is seen so far.

What nobody has seen counts as open, so paths are as short as they can be, and are
planned again while the robot drives. There is no path if none is left on the grid, nor
around it, and the robot has stood and looked for a moment.

Paths are those of a disc, which keeps the safety distance. Once it is sure that none of
them leads to the goal, the robot follows paths of its footprint from wherever there is
none.

What was seen only from afar may be an image in a mirror. So before the robot gives up,
it drives through unsure obstacles, where that is the shortest, until it has seen them
from near: there is no path if sure ones close all ways.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from radarsim.autonomy.navigation.control import (
    STOP,
    Twist,
)
from radarsim.autonomy.navigation.controller import (
    Activity,
    Controller,
    ControllerSettings,
)
from radarsim.autonomy.navigation.footprint_follower import FootprintFollower
from radarsim.autonomy.navigation.footprint_planning import plan_footprint
from radarsim.autonomy.navigation.grid_search import (
    CHEAP,
    ESCAPE_COST,
    ESCAPE_RADIUS,
    may_join_outside,
    shortest_path,
    step_cost,
)
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.obstacle_grid import CELL, ObstacleGrid
from radarsim.geometry import Floats, Point, Pose2

INTERVAL: Final = 0.5  # s between two plans
LOOKAHEAD: Final = 2.0  # m of a path that is cut short where the straight line is open
SURE_AFTER: Final = 5.0  # s without a path after which there is none
NEARER: Final = 10.0  # times that, nearer to it than the robot is
PAUSE: Final = 2.0  # s between two looks that are not one
APART: Final = (0.3, 0.3)  # m and rad between two scans that are kept
DOUBT: Final = 5.0  # times the cost of a step, through what may be an image
MOST_DOUBTED: Final = 200.0  # s on such ways to a goal, so that each run ends
_MOST_GROWN: Final = 10  # margins around the first grid


class PathPlanning(Controller):
    """Planned paths; has no hit points, leave points and circuits."""

    def __init__(self, settings: ControllerSettings) -> None:
        super().__init__(settings)
        self._grid: ObstacleGrid | None = None
        self._scans: list[Observation] = []  # by which the grid can be rebuilt
        self._cost: Floats = np.zeros((0, 0))
        self._path: Floats = np.zeros((0, 2))
        self._planned = -math.inf  # s
        self._hopeless_since: float | None = None  # s
        self._looked_at = -math.inf  # s; when there last was no path
        # where something meets the robot, (M, 2) m, map frame
        self._moving: Floats = np.zeros((0, 2))
        self._grown = 0  # number of times that the grid has grown
        self._footprint = settings.footprint
        self._is_narrow = False  # whether there was no path of the disc
        self._follower: FootprintFollower | None = None
        # s; since when it drives through unsure obstacles; None before
        self._doubts_since: float | None = None

    def reconsider(
        self, pose: Pose2, correct: Callable[[Observation], Observation]
    ) -> None:
        """See ``Controller``; the grid is rebuilt from the scans so far."""
        super().reconsider(pose, correct)
        self._hopeless_since = None
        self._follower = None
        if self._grid is not None:
            self._grid.clear()
            self._scans = [correct(scan) for scan in self._scans]
            for scan in self._scans:
                self._grid.add(scan)

    def avoid(self, places: Floats) -> bool:
        """See ``Controller``; paths of the footprint have no room to do so."""
        # It will have left the goal by then: a goal that is closed has no path at all.
        if self.goals:
            least = self._settings.bumpers.safety_distance + 2 * CELL
            places = places[np.hypot(*(places - self.goals[0]).T) > least]
        if len(places) and not len(self._moving):
            self._planned = -math.inf
        self._moving = places
        return bool(len(places)) and self._follower is None

    def _begin_goal(self, _: Pose2) -> None:
        self._planned = -math.inf
        self._follower = None
        self._doubts_since = None

    def _decide(self, observation: Observation, driven: float) -> Twist:  # noqa: ARG002 - for Bugs
        if observation.time >= self._planned + INTERVAL:
            self._plan(observation)
        if self._follower is not None:
            self._hopeless_since = None
            points = self._outside(observation.points(), observation.pose)
            twist = self._follower.twist(observation.pose, points)
            if twist is not None:
                return twist
            self._follower = None
            self._planned = -math.inf
            return STOP
        if not len(self._path):
            return self._look(observation)
        self._hopeless_since = None
        return self._head_for(observation, self._next_point(observation.pose))

    def _plan(self, observation: Observation) -> None:
        """Add the scan to the grid, and plan a path on it."""
        pose, goal = observation.pose, self.goals[0]
        if self._grid is None:
            self._grid = ObstacleGrid([(pose.x, pose.y), *self.goals])
        self._grid.add(observation)
        if not self._scans or pose.is_apart(self._scans[-1].pose, *APART):
            self._scans.append(observation)
        self._planned = observation.time
        self._plan_disc(pose, goal)
        since = self._doubts_since
        doubts = since is not None and observation.time < since + MOST_DOUBTED
        if doubts and not len(self._path):
            self._plan_disc(pose, goal, doubts=True)
        if len(self._path):
            # The centre of its cell may be 7 cm off, of the 10 that are allowed.
            self._path[-1] = goal
            self._follower = None
            return
        # Such a plan takes long: while it doubts, only before it gives up.
        is_due = since is None or self._follower is not None
        if self._is_narrow and is_due and self._plan_footprint(observation):
            return
        start, end = self._grid.cell((pose.x, pose.y)), self._grid.cell(goal)
        if self._grown < _MOST_GROWN and may_join_outside(
            np.isfinite(self._cost), start, end
        ):
            self._grid.grow()
            self._grown += 1
            # On the larger grid nothing has been planned yet.
            self._hopeless_since = None

    def _plan_disc(self, pose: Pose2, goal: Point, *, doubts: bool = False) -> None:
        """Plan a path of the disc, also through what may be an image if it doubts."""
        assert self._grid is not None
        safety_distance = self._settings.bumpers.safety_distance
        clearance = self._grid.clearance(self._moving)
        cost = step_cost(clearance, safety_distance)
        if doubts:
            sure = step_cost(
                self._grid.clearance(self._moving, surely=True), safety_distance
            )
            cost = np.where(np.isfinite(cost), cost, DOUBT * sure)
        start, end = self._grid.cell((pose.x, pose.y)), self._grid.cell(goal)
        # It is too near to something, by noise or as that has moved: it may leave, and
        # come nearer only where there is no other way.
        is_near = not math.isfinite(cost[start])
        if is_near and (doubts or not self._is_narrow):
            rows, columns = np.indices(cost.shape)
            near = np.hypot(rows - start[0], columns - start[1]) * CELL < ESCAPE_RADIUS
            near &= ~np.isfinite(cost)
            cost[near] = ESCAPE_COST
            cost[near & (clearance < clearance[start])] *= NEARER
        targets = np.zeros(cost.shape, np.bool_)
        targets[end] = True
        self._cost = cost
        self._path = np.zeros((0, 2))
        # Where only the footprint fits in, no disc leads anywhere.
        if doubts or not (is_near and self._is_narrow):
            self._path = self._grid.centres(shortest_path(cost, start, targets))

    def _look(self, observation: Observation) -> Twist:
        """Stand where there is no path; if none appears, there is none."""
        looked, self._looked_at = self._looked_at, observation.time
        # Who waited meanwhile for something that moves has not looked.
        is_new = self._hopeless_since is None or observation.time > looked + PAUSE
        # Something that moves will not be in the way for long.
        if is_new or len(self._moving):
            self._hopeless_since = observation.time
        assert self._hopeless_since is not None
        if observation.time - self._hopeless_since >= SURE_AFTER:
            # Nothing leads there as a disc; once sure, the footprint may get through.
            self._is_narrow = self._footprint is not None
            if self._is_narrow and self._plan_footprint(observation):
                return STOP
            if self._doubts_since is None:
                self._doubts_since = observation.time
                self._plan_disc(observation.pose, self.goals[0], doubts=True)
            if not len(self._path):
                self.activity = Activity.NO_PATH
        return STOP

    def _plan_footprint(self, observation: Observation) -> bool:
        """Plan a path of the footprint, unless one is open; return whether any is."""
        assert self._grid is not None
        assert self._footprint is not None
        points = np.vstack([self._grid.points, observation.blocking_points()])
        points = self._outside(points, observation.pose)
        if self._follower is not None and not self._follower.is_blocked(points):
            return True
        path = plan_footprint(self._footprint, points, observation.pose, self.goals[0])
        self._follower = None
        if path is not None:
            limits = self._settings.speed_limits
            self._follower = FootprintFollower(self._footprint, path, limits)
        return path is not None

    def _outside(self, points: Floats, pose: Pose2) -> Floats:
        """Return the points outside the footprint: others are in error or gone."""
        assert self._footprint is not None
        here = np.array([[pose.x, pose.y, pose.yaw]])
        outside: Floats = points[self._footprint.distances(points, here)[0] > 0]
        return outside

    def _next_point(self, pose: Pose2) -> Point:
        """Return the farthest point of the path to which the straight line is open."""
        distances = np.hypot(*(self._path - (pose.x, pose.y)).T)
        nearest = int(distances.argmin())
        ahead, away = self._path[nearest:], distances[nearest:]
        within = int((away > LOOKAHEAD).argmax()) if away.max() > LOOKAHEAD else None
        # Never nearer, as a robot that heads for where it is turns on the spot forever.
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
        count = max(2, math.ceil(pose.distance(end) / CELL * 2))
        line = np.linspace((pose.x, pose.y), (end.x, end.y), count)
        costs = self._cost[self._grid.cells(line)]
        # Near a wall, or at a goal close to one, the ends cost more than that.
        return bool(costs.max() <= max(CHEAP, costs[0], costs[-1]))
