"""Tasks of robots, and the maps that are made of them.

Tasks and makers of maps run in threads, as their calls block. They are in
``algorithms``, which takes a second to import: the program imports it in a thread, for
which an earlier request waits.
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
MOST_TASKS: Final = 20  # at a time
MOST_MAPS: Final = 10  # that are made at a time
DEFAULT_COLOURS: Final[Colours] = "usarcommander"


class Activities:
    """Tasks and maps of robots, and the newest messages about them.

    A robot has at most one task.

    Attributes:
        scene: The map; None if it is not known.
        clock: By which tasks wait, in simulated time.
        running: Tasks that run, by the names of their robots.
        newest: What a new browser has to know, as JSON; by kind and robot.
    """

    def __init__(
        self, robots: Robots, viewers: Viewers, on_change: Callable[[], None]
    ) -> None:
        """Begin without any; to be called in the event loop.

        Args:
            robots: The robots.
            viewers: The browsers, which get the messages.
            on_change: Called when others are at work or are mapped than before.
        """
        self.scene: SceneMessages | None = None
        self._robots = robots
        self._viewers = viewers
        self._on_change = on_change
        self.clock = TaskClock()
        self.running: dict[str, RobotClient] = {}
        self._threads = 0  # also of cancelled tasks, until they notice
        self._count = 0  # of tasks so far
        self._loop = asyncio.get_running_loop()
        self._makers: dict[str, MapMaker] = {}
        self._colours: dict[str, Colours] = {}
        self.newest: dict[tuple[str, str], str] = {}

    @property
    def mapped(self) -> Set[str]:
        """Names of the robots that are mapped."""
        return self._makers.keys()

    def go(self, request: Goto) -> None:
        """Drive to a goal.

        Raises:
            BadRequest: If that is not possible.
        """
        from radarsim.addons.web.algorithms import drive_to_goal  # noqa: PLC0415

        if self.scene is not None:
            self._check_goal(self._robots.find_own(request.robot), request.goal)
        work = partial(drive_to_goal, request, self._wanted_distance)
        self._begin("goto", request.robot, work, str(request))

    def explore(self, request: Explore) -> None:
        """Explore, and show the map that is made for that.

        Raises:
            BadRequest: If that is not possible.
        """
        from radarsim.addons.web.algorithms import explore  # noqa: PLC0415

        name = request.robot
        colours = self._colours.get(name, DEFAULT_COLOURS)
        self._begin("explore", name, partial(explore, request, colours))
        # Only now, as a task that is refused leaves the map as it was.
        self._stop_map(name)  # the explorer's own is shown

    def cancel(self, request: Cancel) -> None:
        """Cancel a task; one that has ended stays as it is."""
        for robot, task in [*self.running.items()]:
            if task.number == request.task:
                self.stop(robot)

    def stop(self, robot: str) -> None:
        """Cancel the task of a robot, if it has one."""
        task = self.running.pop(robot, None)
        if task is not None:
            task.cancel()
            # Servers hold the last speeds, and the thread of the task may notice late.
            task.robot.set_wheels(0.0, 0.0)
            self._send_state(task, "cancelled")

    def switch_map(self, request: Map) -> None:
        """Make a map of a robot, or no more, or in other colours.

        Raises:
            BadRequest: If that is not possible.
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
        """End what goes on with a robot that is gone."""
        self.stop(robot)
        self._stop_map(robot)
        self._colours.pop(robot, None)
        for key in [key for key in self.newest if key[1] == robot]:
            del self.newest[key]

    def close(self) -> None:
        """End everything."""
        for robot in {*self._makers, *self._robots.own}:
            self.forget(robot)

    def safety_distance(self, robot: OwnRobot) -> float | None:
        """Return the distance that a robot keeps on its way, m; None if it has none."""
        with suppress(NavigationError):  # which a drive reports as well
            return safety_distance_for(robot.info, self._wanted_distance, 0.0)
        return None

    @property
    def _wanted_distance(self) -> float | None:
        """Distance for which the map is designed, m; None for the least that suits."""
        return None if self.scene is None else self.scene.safety_distance

    def _check_goal(self, robot: OwnRobot, goal: tuple[float, float]) -> None:
        """Refuse a goal that would be given up there.

        Raises:
            BadRequest: If it is one.
        """
        assert self.scene is not None  # it is known
        least = self.safety_distance(robot)
        distance, name = self.scene.nearest_obstacle(*goal)
        if least is not None and distance < least_clearance(least):
            raise BadRequest(
                f"goal ({goal[0]:g}, {goal[1]:g}) is {distance:.2f} m from {name!r},"
                f" expected at least the safety distance of {robot.name!r},"
                f" {least:.2f} m"
            )

    def _begin(self, kind: str, robot: str, work: Work, text: str = "") -> None:
        """Begin a task, instead of the one that the robot is at.

        Args:
            kind: Of the task, such as ``goto``.
            robot: Name of the robot.
            work: What the task does.
            text: What the task is, in words.

        Raises:
            BadRequest: If the robot cannot, or there are too many tasks.
        """
        own = self._robots.find_own(robot)
        if own.refusal is not None:
            raise BadRequest(f"{robot!r} cannot drive by itself: {own.refusal}")
        self.stop(robot)
        # Those of cancelled tasks count: they compute until they next read or drive.
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
        """Send the state of a task; ``text`` is its goal, or how it ended."""
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
        """Do the work, in its thread."""
        state, text = "failed", "an error of the program"
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
        if self.running.get(task.robot.name) is task:  # else it was cancelled
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
        """Send a message to all browsers, and to those that come later."""
        op, robot = message["op"], message["robot"]
        if op == "task":  # frames say who drives
            self._on_change()
        text = encode_json(message)
        # A thread may send a message about a robot that is gone by now.
        if robot in self._robots.views:
            self.newest[op, robot] = text
        self._viewers.broadcast(text, (op, robot, message.get("id")))
