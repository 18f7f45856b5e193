"""What a robot can do by itself: drive to a goal, and explore.

Both block, and so run in threads; they tell what happens as messages.
"""

import asyncio
import logging
import math
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeAlias

import numpy as np

from radarsim.addons.web.map_maker import describe_map
from radarsim.addons.web.own_robot import OwnRobot
from radarsim.addons.web.requests import BadRequest, Colours, Explore, Goto
from radarsim.addons.web.robot_client import RobotClient
from radarsim.autonomy.exploration.exploration import (
    Exploration,
    ExplorationStep,
    Outcome,
)
from radarsim.autonomy.exploration.plans import ExplorationPlan, StrategyName
from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.autonomy.navigation.mission import run_mission
from radarsim.autonomy.navigation.plans import Mission
from radarsim.autonomy.navigation.run_log import RunLog
from radarsim.autonomy.navigation.runner import NavigationStep
from radarsim.errors import RadarsimError, expected_one_of
from radarsim.geometry import Floats, Pose2
from radarsim.rng import generator_for

log = logging.getLogger("radarsim.addons.web")
MOST_TASKS: Final = 20  # at a time

Tell: TypeAlias = Callable[[dict[str, Any]], None]


class WorkFailed(Exception):
    """A robot has not done what it was to do; the message says why."""


class Work(Protocol):
    """Something that a robot does by itself."""

    def run(self, client: RobotClient, tell: Tell) -> str:
        """Do it, and return how it went, in words.

        Args:
            client: The connection to the robot.
            tell: Called with messages.

        Raises:
            RadarsimError: If the robot or its server cannot do it.
            WorkFailed: If it is not done.
        """


@dataclass(slots=True, eq=False)
class Task:
    """One task.

    Attributes:
        number: Its number.
        robot: The robot.
        kind: ``goto`` or ``explore``.
        client: Where the task reads and drives.
        state: ``running``, ``done``, ``failed`` or ``cancelled``.
        text: How it ended, or what is done.
    """

    number: int
    robot: OwnRobot
    kind: str
    client: RobotClient
    state: str = "running"
    text: str = ""

    def describe(self) -> dict[str, Any]:
        """Return the message ``task``."""
        return {
            "op": "task",
            "id": self.number,
            "robot": self.robot.name,
            "kind": self.kind,
            "state": self.state,
            "text": self.text,
        }


class TaskBoard:
    """The tasks that run, of which a robot has at most one.

    Attributes:
        running: Tasks by their numbers.
    """

    def __init__(self, tell: Callable[[dict[str, Any]], None]) -> None:
        """Create an empty board; to be called in the event loop.

        Args:
            tell: Called with messages, in the event loop.
        """
        self.running: dict[int, Task] = {}
        self._tell = tell
        self._threads: set[int] = set()  # also of cancelled tasks, until they notice
        self._loop = asyncio.get_running_loop()
        self._count = 0

    def find(self, robot: str) -> Task | None:
        """Return the task that a robot is at, if any."""
        tasks = (task for task in self.running.values() if task.robot.name == robot)
        return next(tasks, None)

    def begin(self, robot: OwnRobot, kind: str, work: Work) -> None:
        """Begin a task, instead of the one that the robot is at.

        Raises:
            BadRequest: If there are too many tasks.
        """
        self.cancel_of(robot.name)
        if len(self._threads) >= MOST_TASKS:
            raise BadRequest(f"{MOST_TASKS} tasks are running, expected no more")
        self._count += 1
        task = Task(self._count, robot, kind, RobotClient(robot))
        self.running[task.number] = task
        self._threads.add(task.number)
        self._tell(task.describe())
        threading.Thread(target=self._run, args=(task, work), daemon=True).start()

    def cancel(self, number: int) -> None:
        """Cancel a task; one that has ended stays as it is."""
        task = self.running.pop(number, None)
        if task is not None:
            task.client.cancel()
            task.robot.set_wheels(0.0, 0.0)
            task.state = "cancelled"
            self._tell(task.describe())

    def cancel_of(self, robot: str) -> None:
        """Cancel the task of a robot, if it has one."""
        task = self.find(robot)
        if task is not None:
            self.cancel(task.number)

    def tell_threadsafe(self, message: dict[str, Any]) -> None:
        """Tell a message from any thread."""
        self._call(self._tell, message)

    def _run(self, task: Task, work: Work) -> None:
        """Do the work, in its thread."""
        state, text = "failed", "an error of the program"
        try:
            text = work.run(task.client, self.tell_threadsafe)
            state = "done"
        except (RadarsimError, WorkFailed) as error:
            text = str(error)
        except Exception:
            log.exception("the %s of %s failed", task.kind, task.robot.name)
        self._call(self._end, task, state, text)

    def _end(self, task: Task, state: str, text: str) -> None:
        self._threads.discard(task.number)
        if self.running.pop(task.number, None) is None:
            return  # it was cancelled
        task.client.cancel()
        task.state, task.text = state, text
        self._tell(task.describe())

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(function, *arguments)


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
            time_limit=math.inf,
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
