"""What a robot can do by itself: drive to a goal, and explore.

Both block, and so run in threads; they tell what happens as messages.
"""

import math
from typing import Any, Final

import numpy as np

from radarsim.commander.map_picture import describe_map
from radarsim.commander.requests import BadRequest, Colours, Explore, Goto
from radarsim.commander.robot_client import RobotClient
from radarsim.commander.task_board import Tell, WorkFailed
from radarsim.exploration.exploration import (
    Exploration,
    ExplorationPlan,
    ExplorationStep,
    Outcome,
)
from radarsim.exploration.options import StrategyName
from radarsim.geometry import Floats, Pose2
from radarsim.navigation.mission import Mission, run_mission
from radarsim.navigation.options import Algorithm
from radarsim.navigation.run_log import RunLog
from radarsim.navigation.runner import NavigationStep
from radarsim.rng import generator_for
from radarsim.suggestions import expected_one_of

PATH_INTERVAL: Final = 0.5  # s between two messages
MAP_INTERVAL: Final = 1.0  # s
MOST_POINTS: Final = 1000  # of a path in a message
HERE: Final = Pose2(0.0, 0.0)  # the robot is spawned; this is not looked at


class GoingTo:
    """Drives to a goal."""

    def __init__(self, request: Goto, safety_distance: float | None) -> None:
        """Plan the way.

        Args:
            request: Algorithm and goal.
            safety_distance: m; None for the least one that suits the robot.

        Raises:
            BadRequest: If there is no such algorithm.
        """
        names = [each.value for each in Algorithm]
        if request.algorithm not in names:
            raise BadRequest(f"algorithm {expected_one_of(request.algorithm, names)}")
        self._request = request
        self._mission = Mission(
            algorithm=Algorithm(request.algorithm),
            goals=(request.goal,),
            pose=HERE,
            safety_distance=safety_distance,
        )

    def run(self, client: RobotClient, tell: Tell) -> str:
        """See ``Work.run``; tells the path."""
        run_log = RunLog()
        timer = _Timer(PATH_INTERVAL, client)

        def observe(step: NavigationStep) -> None:
            run_log.add(step)
            if timer.is_due():
                tell(describe_run(self._request, run_log))

        try:
            result = run_mission(client, self._mission, observe)
        finally:
            tell(describe_run(self._request, run_log))
        if result.outcome != "reached":
            no_path = result.outcome == "no_path"
            raise WorkFailed("there is no path" if no_path else result.outcome)
        return f"reached in {result.time:.0f} s, {result.path_length:.1f} m"


class Exploring:
    """Explores and maps."""

    def __init__(self, request: Explore, colours: Colours) -> None:
        """Plan the exploration.

        Args:
            request: The strategy.
            colours: Colours of the map.

        Raises:
            BadRequest: If there is no such strategy.
        """
        names = [each.value for each in StrategyName]
        if request.strategy not in names:
            raise BadRequest(f"strategy {expected_one_of(request.strategy, names)}")
        self._robot = request.robot
        self._colours = colours
        plan = ExplorationPlan(strategy=StrategyName(request.strategy), pose=HERE)
        self._exploration = Exploration(plan, generator_for(0, request.robot))

    def run(self, client: RobotClient, tell: Tell) -> str:
        """See ``Work.run``; tells path and map."""
        paths, maps = _Timer(PATH_INTERVAL, client), _Timer(MAP_INTERVAL, client)

        def observe(_: ExplorationStep) -> None:
            self._show(tell, path=paths.is_due(), grid=maps.is_due())

        try:
            self._exploration.run(client, observe)
        finally:
            self._show(tell, path=True, grid=True)
        outcome, trip = self._exploration.outcome, self._exploration.trip
        if outcome is not Outcome.EXPLORED:
            raise WorkFailed(outcome.value.replace("_", " "))
        return f"explored in {trip.time:.0f} s, {trip.length:.1f} m"

    def _show(self, tell: Tell, *, path: bool, grid: bool) -> None:
        mapper = self._exploration.mapper
        if mapper is None or not mapper.scans:
            return
        if path:
            tell(describe_path(self._robot, mapper.trajectory.rows()))
        if grid:
            tell(describe_map(self._robot, mapper.grid, self._colours))


def describe_run(request: Goto, run_log: RunLog) -> dict[str, Any]:
    """Return the message ``path`` of a drive to a goal."""
    return {
        **describe_path(request.robot, run_log.path),
        "hits": run_log.hit_points,
        "leaves": run_log.leave_points,
        "goal": request.goal,
    }


def describe_path(robot: str, path: Floats) -> dict[str, Any]:
    """Return the message ``path``; of a long one, points that are evenly spread.

    Args:
        robot: Name of the robot.
        path: (N, 2) or more columns; x and y in m, map frame.
    """
    step = max(1, math.ceil(len(path) / MOST_POINTS))
    last = path[-1:] if len(path) and (len(path) - 1) % step else path[:0]
    points = np.concatenate([path[::step], last])[:, :2]
    return {
        "op": "path",
        "robot": robot,
        "points": np.round(points, 3).tolist(),
        "hits": [],
        "leaves": [],
        "goal": None,
    }


class _Timer:
    """Says when an interval has passed."""

    def __init__(self, interval: float, client: RobotClient) -> None:
        self._interval = interval
        self._clock = client.transport.time
        self._due = -math.inf

    def is_due(self) -> bool:
        """Return whether it has passed since this was true before."""
        now = self._clock()
        is_due = now >= self._due
        if is_due:
            self._due = now + self._interval
        return is_due
