"""Path planning: follow the cheapest path to the goal on a grid of seen obstacles.

Unseen cells count as open, so paths are as short as possible, and are planned again
while the robot drives. The planner gives up if there is no path on the grid or around
it, even after the robot has waited for a moment.

Paths are planned for a disc, which keeps the safety distance. Once it is certain that
no such path leads to the goal, the robot follows paths of its footprint from positions
without a path for the disc.

A point that was only seen from far away may be an image in a mirror. So before the
robot gives up, it drives through such uncertain cells on the shortest path, until it
has seen them from nearby. No path exists if certain cells block all paths.
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
LOOKAHEAD: Final = 2.0  # m of a path that a straight line may cut short
SURE_AFTER: Final = 5.0  # s; after this time without a path the robot gives up
NEARER: Final = 10.0  # cost factor of cells nearer to an obstacle than the robot
PAUSE: Final = 2.0  # s; after a longer gap the wait for a path restarts
APART: Final = (0.3, 0.3)  # m and rad between two stored scans
DOUBT: Final = 5.0  # cost factor of cells that may be mirror images
MOST_DOUBTED: Final = 200.0  # s on paths through such cells, so that each run ends
_MOST_GROWN: Final = 10  # times that a margin is added to the first grid


class PathPlanning(Controller):
    """Follows planned paths to the goals; there are no hit points or circuits."""

    def __init__(self, settings: ControllerSettings) -> None:
        super().__init__(settings)
        self._grid: ObstacleGrid | None = None
        self._scans: list[Observation] = []  # stored for a rebuild of the grid
        self._cost: Floats = np.zeros((0, 0))
        self._path: Floats = np.zeros((0, 2))
        self._planned = -math.inf  # s; time of the last plan
        self._hopeless_since: float | None = None  # s; start of the wait
        self._looked_at = -math.inf  # s; time of the last plan without a path
        # current and predicted positions of an approaching object, (M, 2) m, map frame
        self._moving: Floats = np.zeros((0, 2))
        self._grown = 0  # number of times that the grid has grown
        self._footprint = settings.footprint
        self._is_narrow = False  # whether no path for the disc exists
        self._follower: FootprintFollower | None = None
        # time, s, at which the robot began to drive
        # through uncertain cells; None before
        self._doubts_since: float | None = None

    def reconsider(
        self, pose: Pose2, correct: Callable[[Observation], Observation]
    ) -> None:
        """See ``Controller``; the grid is rebuilt from the stored scans."""
        super().reconsider(pose, correct)
        self._hopeless_since = None
        self._follower = None
        if self._grid is not None:
            self._grid.clear()
            self._scans = [correct(scan) for scan in self._scans]
            for scan in self._scans:
                self._grid.add(scan)

    def avoid(self, places: Floats) -> bool:
        """See ``Controller``; footprint paths are too narrow to avoid objects."""
        # Positions near the goal are ignored: the object will have left them, and a
        # blocked goal would have no path.
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
        """Add the scan to the grid of obstacles, and plan a path on the grid."""
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
            # The centre of the goal's cell may be up to 7 cm
            # from the goal, so the path ends at the goal.
            self._path[-1] = goal
            self._follower = None
            return
        # Planning for the footprint is slow. So a robot that drives through uncertain
        # cells plans for the footprint only before it gives up.
        is_due = since is None or self._follower is not None
        if self._is_narrow and is_due and self._plan_footprint(observation):
            return
        start, end = self._grid.cell((pose.x, pose.y)), self._grid.cell(goal)
        if self._grown < _MOST_GROWN and may_join_outside(
            np.isfinite(self._cost), start, end
        ):
            self._grid.grow()
            self._grown += 1
            # No path has been searched on the larger grid, so the wait starts again.
            self._hopeless_since = None

    def _plan_disc(self, pose: Pose2, goal: Point, *, doubts: bool = False) -> None:
        """Plan a path of a disc; with ``doubts``, also through mirror images."""
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
        # Noise or a moved obstacle may leave the robot too close to an obstacle. Nearby
        # cells are then open at a high cost, so that the robot can drive away.
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
        # Where only the footprint fits, the robot cannot follow a path of the disc.
        if doubts or not (is_near and self._is_narrow):
            self._path = self._grid.centres(shortest_path(cost, start, targets))

    def _look(self, observation: Observation) -> Twist:
        """Wait while there is no path; give up if none appears in time."""
        looked, self._looked_at = self._looked_at, observation.time
        # The robot may have waited for a moving object since the last call, so the time
        # without a path starts again after a pause.
        is_new = self._hopeless_since is None or observation.time > looked + PAUSE
        # A moving object will soon have left the path, so the wait starts again.
        if is_new or len(self._moving):
            self._hopeless_since = observation.time
        assert self._hopeless_since is not None
        if observation.time - self._hopeless_since >= SURE_AFTER:
            # There is no path for the disc, but there may be one for the footprint.
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
        """Plan a path of the footprint, if needed; return whether there is a path."""
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
        """Return the points outside the footprint, as points inside are outdated."""
        assert self._footprint is not None
        here = np.array([[pose.x, pose.y, pose.yaw]])
        outside: Floats = points[self._footprint.distances(points, here)[0] > 0]
        return outside

    def _next_point(self, pose: Pose2) -> Point:
        """Return the farthest path point that the robot reaches in a straight line."""
        distances = np.hypot(*(self._path - (pose.x, pose.y)).T)
        nearest = int(distances.argmin())
        ahead, away = self._path[nearest:], distances[nearest:]
        within = int((away > LOOKAHEAD).argmax()) if away.max() > LOOKAHEAD else None
        # The two nearest points of the path are skipped: a robot that heads for its own
        # position would turn forever.
        chosen = ahead[min(2, len(ahead) - 1)]
        for point in ahead[:within][::-1]:
            if self._is_cheap(pose, point):
                chosen = point
                break
        return float(chosen[0]), float(chosen[1])

    def _is_cheap(self, pose: Pose2, point: Floats) -> bool:
        """Return whether a straight line to a point stays far enough from obstacles."""
        assert self._grid is not None
        end = Pose2(float(point[0]), float(point[1]))
        count = max(2, math.ceil(pose.distance(end) / CELL * 2))
        line = np.linspace((pose.x, pose.y), (end.x, end.y), count)
        costs = self._cost[self._grid.cells(line)]
        # Next to a wall, the first or last point of the line may cost more than the
        # limit. So a line passes if no point costs more than its ends.
        return bool(costs.max() <= max(CHEAP, costs[0], costs[-1]))
