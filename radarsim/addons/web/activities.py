"""Starts and ends the tasks of robots, and the maps made from their scans.

Tasks and map makers run in threads, as their calls block. They are defined in
``algorithms``, which takes a second to import. The program imports it in a thread; a
request that comes earlier waits for the import.
"""

import asyncio
import logging
import threading
from collections.abc import Callable, Set
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from radarsim.addons.web.own_robot import OwnRobot, RobotClient, TaskClock, Work
from radarsim.addons.web.requests import (
    BadRequest,
    Cancel,
    Colours,
    Explore,
    Goto,
    Map,
)
from radarsim.addons.web.robots import Robots
from radarsim.addons.web.viewers import Viewers, encode_json
from radarsim.autonomy.navigation.mission import safety_distance_for
from radarsim.autonomy.navigation.runner import least_clearance
from radarsim.errors import NavigationError, RadarsimError

if TYPE_CHECKING:
    from radarsim.addons.web.algorithms import MapMaker
    from radarsim.addons.web.scene_message import SceneMessages

log = logging.getLogger("radarsim.addons.web")
MOST_TASKS: Final = 20  # tasks that may run at the same time
MOST_MAPS: Final = 10  # maps that may be made at the same time
DEFAULT_COLOURS: Final[Colours] = "usarcommander"


class Activities:
    """Tasks and maps of robots, and the newest messages about them.

    A robot has at most one task.

    Attributes:
        scene: The messages of the map; None if it is not known.
        clock: Clock of all tasks, in simulated time.
        running: Tasks that run, by the names of their robots.
        newest: The newest message of each kind and robot, as JSON, for new browsers.
    """

    def __init__(
        self, robots: Robots, viewers: Viewers, on_change: Callable[[], None]
    ) -> None:
        """Create an object without tasks and maps; call it in the event loop.

        Args:
            robots: The robots.
            viewers: The browsers, which are sent the messages.
            on_change: Called when a task or a map of a robot begins or ends.
        """
        self.scene: SceneMessages | None = None
        self._robots = robots
        self._viewers = viewers
        self._on_change = on_change
        self.clock = TaskClock()
        self.running: dict[str, RobotClient] = {}
        self._threads = 0  # includes cancelled tasks whose threads have not ended
        self._count = 0  # number of tasks so far
        self._loop = asyncio.get_running_loop()
        self._makers: dict[str, MapMaker] = {}
        self._colours: dict[str, Colours] = {}
        self.newest: dict[tuple[str, str], str] = {}

    @property
    def mapped(self) -> Set[str]:
        """Names of the robots whose scans are being mapped."""
        return self._makers.keys()

    def go(self, request: Goto) -> None:
        """Begin to drive a robot to a goal.

        Raises:
            BadRequest: If the robot cannot drive there, or the goal is too close to an
                obstacle.
        """
        from radarsim.addons.web.algorithms import drive_to_goal  # noqa: PLC0415

        if self.scene is not None:
            self._check_goal(self._robots.find_own(request.robot), request.goal)
        work = partial(drive_to_goal, request, self._wanted_distance)
        self._begin("goto", request.robot, work, str(request))

    def explore(self, request: Explore) -> None:
        """Begin to explore with a robot, and show the map that the explorer makes.

        Raises:
            BadRequest: If the robot cannot explore.
        """
        from radarsim.addons.web.algorithms import explore  # noqa: PLC0415

        name = request.robot
        colours = self._colours.get(name, DEFAULT_COLOURS)
        self._begin("explore", name, partial(explore, request, colours))
        # The old map ends only now, because a refused task has to leave the map
        # unchanged.
        self._stop_map(name)

    def cancel(self, request: Cancel) -> None:
        """Cancel a task; do nothing if it has ended."""
        for robot, task in [*self.running.items()]:
            if task.number == request.task:
                self.stop(robot)

    def stop(self, robot: str) -> None:
        """Cancel the task of a robot, if it has one."""
        task = self.running.pop(robot, None)
        if task is not None:
            task.cancel()
            # Without this stop, the server would keep the last wheel speeds until the
            # task's thread ends.
            task.robot.set_wheels(0.0, 0.0)
            self._send_state(task, "cancelled")

    def switch_map(self, request: Map) -> None:
        """Start or end the map of a robot, or change the map's colours.

        Raises:
            BadRequest: If the robot or its scans are missing, or there are too many
                maps.
        """
        view = self._robots.find(request.robot)
        name = view.name
        self._colours[name] = request.colours
        if not request.on:
            self._stop_map(name)
            self._send({"op": "map", "robot": name, "png": None})
        elif name in self._makers:
            self._makers[name].colours = request.colours
        elif len(self._makers) >= MOST_MAPS:
            raise BadRequest(f"{MOST_MAPS} maps are being built, which is the limit")
        else:
            from radarsim.addons.web.algorithms import MapMaker  # noqa: PLC0415

            send, has_echoes = self._send_threadsafe, self._robots.is_watching
            self._makers[name] = MapMaker(view, request, send, has_echoes=has_echoes)
            self._on_change()

    def forget(self, robot: str) -> None:
        """End the task and the map of a robot that was removed."""
        self.stop(robot)
        self._stop_map(robot)
        self._colours.pop(robot, None)
        for key in [key for key in self.newest if key[1] == robot]:
            del self.newest[key]

    def close(self) -> None:
        """End all tasks and maps."""
        for robot in {*self._makers, *self._robots.own}:
            self.forget(robot)

    def safety_distance(self, robot: OwnRobot) -> float | None:
        """Return the safety distance of a robot, m; None if no distance is possible."""
        with suppress(NavigationError):  # a drive reports the same error
            return safety_distance_for(robot.info, self._wanted_distance, 0.0)
        return None

    @property
    def _wanted_distance(self) -> float | None:
        """Safety distance that the map sets, m; None for the smallest possible one."""
        return None if self.scene is None else self.scene.safety_distance

    def _check_goal(self, robot: OwnRobot, goal: tuple[float, float]) -> None:
        """Check that a goal is at least the safety distance away from obstacles.

        Raises:
            BadRequest: If the goal is too close to an obstacle.
        """
        assert self.scene is not None  # ``go`` has checked it
        least = self.safety_distance(robot)
        distance, name = self.scene.nearest_obstacle(*goal)
        if least is not None and distance < least_clearance(least):
            raise BadRequest(
                f"goal ({goal[0]:g}, {goal[1]:g}) is {distance:.2f} m from {name!r},"
                f" expected at least the safety distance of {robot.name!r},"
                f" {least:.2f} m"
            )

    def _begin(self, kind: str, robot: str, work: Work, text: str = "") -> None:
        """Begin a task of a robot, and cancel the previous task of the robot, if any.

        Args:
            kind: Kind of the task, such as ``goto``.
            robot: Name of the robot.
            work: Function that the thread of the task calls.
            text: Description of the task.

        Raises:
            BadRequest: If the robot cannot drive by itself, or too many tasks run.
        """
        own = self._robots.find_own(robot)
        if own.refusal is not None:
            raise BadRequest(f"{robot!r} cannot drive autonomously: {own.refusal}")
        self.stop(robot)
        # A cancelled task still counts, because its thread runs until its next read or
        # drive.
        if self._threads >= MOST_TASKS:
            raise BadRequest(f"{MOST_TASKS} tasks are running, which is the limit")
        self._count += 1
        task = RobotClient(own, kind, self._count, self.clock)
        self.running[robot] = task
        self._threads += 1
        self._send_state(task, "running", text)
        threading.Thread(target=self._run, args=(task, work), daemon=True).start()

    def _send_threadsafe(self, message: dict[str, Any]) -> None:
        self._call(self._send, message)

    def _send_state(self, task: RobotClient, state: str, text: str = "") -> None:
        """Send the state of a task; ``text`` is its goal or its result."""
        self._send(
            {
                "op": "task",
                "id": task.number,
                "robot": task.robot.name,
                "kind": task.kind,
                "state": state,
                "text": text,
            }
        )

    def _run(self, task: RobotClient, work: Work) -> None:
        """Run a task in its own thread, and report how it ended."""
        state, text = "failed", "an error in radarsim"
        try:
            text = work(task, self._send_threadsafe)
            state = "done"
        except RadarsimError as error:
            text = str(error)
        except Exception:
            log.exception("the %s of %s failed", task.kind, task.robot.name)
        self._call(self._end, task, state, text)

    def _end(self, task: RobotClient, state: str, text: str) -> None:
        self._threads -= 1
        if self.running.get(task.robot.name) is task:  # else the task was cancelled
            del self.running[task.robot.name]
            task.cancel()
            self._send_state(task, state, text)

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(function, *arguments)

    def _stop_map(self, robot: str) -> None:
        maker = self._makers.pop(robot, None)
        if maker is not None:
            maker.stop()
            self._on_change()

    def _send(self, message: dict[str, Any]) -> None:
        """Send a message to all browsers, and keep it for browsers that join later."""
        op, robot = message["op"], message["robot"]
        if op == "task":  # frames contain the driver, which may change with a task
            self._on_change()
        text = encode_json(message)
        # A thread may send a message about a robot that has been removed in the
        # meantime.
        if robot in self._robots.views:
            self.newest[op, robot] = text
        self._viewers.broadcast(text, (op, robot, message.get("id")))
