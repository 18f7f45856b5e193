"""All known robots of the server, and the robots that the commander spawned.

Reports of robots arrive over the connection that watches all robots. If the server
cannot be watched, the commander's own robots are read over their own connections.
"""

import asyncio
from collections.abc import Callable, Coroutine, Iterable, Mapping
from typing import Any, Final

from radarsim.addons.web.own_robot import OwnRobot
from radarsim.addons.web.requests import BadRequest, Remove, Spawn
from radarsim.addons.web.robot_view import RobotView
from radarsim.addons.web.viewers import Viewer, Viewers
from radarsim.client import AsyncClient
from radarsim.errors import ClientError, RadarsimError, expected_one_of
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.reports import (
    CommandError,
    Report,
    RobotJoined,
    RobotLeft,
    WatchedLine,
    Watching,
)
from radarsim.simulation.config import SimulationConfig

MOST_ROBOTS: Final = 100  # robots that the commander spawns
MOST_VIEWS: Final = 2000  # known robots; a server has at most 1024
ANSWER: Final = 5.0  # s; timeout for an answer of the server
SPAWN_TIMEOUT: Final = 120.0  # s; a server may be busy
PLAYED: Final = "a recording is played, whose robots cannot be controlled"
LONG_WAIT: Final = 4.0  # s of spawning, after which a browser is sent the reason


class Robots:
    """The robots of a server by name, some of which the commander has spawned.

    Attributes:
        views: The state of each robot.
        own: Robots that the commander spawned.
        starts: Start poses of the map by name.
        is_watching: Whether the server reports all robots now. The commander then
            ignores sensor lines on the connections of its own robots.
        on_left: Called with the name of a robot that was removed.
    """

    def __init__(
        self,
        address: tuple[str, int] | None,
        config: SimulationConfig,
        viewers: Viewers,
        on_change: Callable[[], None],
    ) -> None:
        """Create an object without robots.

        Args:
            address: Host and port of the server; None if a recording is played.
            config: How the server was started, as far as it is known.
            viewers: The browsers, which are sent messages about robots.
            on_change: Called when the shown state has changed.
        """
        self.views: dict[str, RobotView] = {}
        self.own: dict[str, OwnRobot] = {}
        self.starts: Mapping[str, Pose3] = {}
        self.is_watching = False
        self._address = address
        self._config = config
        self._viewers = viewers
        self._on_change = on_change
        self.on_left: Callable[[str], None] = lambda _: None
        self._spawning: set[str] = set()
        self._tasks: set[asyncio.Task[None]] = set()

    def find_own(self, name: str) -> OwnRobot:
        """Return a robot of the commander.

        Raises:
            BadRequest: If the commander has no robot of that name.
        """
        if name not in self.own:
            whose = "another client's" if name in self.views else "no"
            raise BadRequest(f"{whose} robot {expected_one_of(name, [*self.own])}")
        return self.own[name]

    def find(self, name: str) -> RobotView:
        """Return the state of a robot.

        Raises:
            BadRequest: If there is no robot of that name.
        """
        if name not in self.views:
            raise BadRequest(f"no robot {expected_one_of(name, [*self.views])}")
        return self.views[name]

    def spawn(self, viewer: Viewer, request: Spawn) -> None:
        """Spawn a robot in a task, and run it until it is removed.

        Raises:
            BadRequest: If the name is taken, there are too many robots, a recording is
                played, or the request has both a start and a pose.
        """
        if request.start is not None and request.pose is not None:
            raise BadRequest("a start and a pose, expected only one of them")
        if self._address is None:
            raise BadRequest(f"no robot can be added: {PLAYED}")
        if len(self.own) + len(self._spawning) >= MOST_ROBOTS:
            raise BadRequest(f"there are {MOST_ROBOTS} robots, which is the limit")
        # Servers ignore upper and lower case in names.
        taken = {name.casefold() for name in (*self.views, *self._spawning)}
        if request.name is None:
            numbers = range(1, len(taken) + 2)
            name = next(f"R{n}" for n in numbers if f"r{n}" not in taken)
        else:
            name = " ".join(request.name.split())
            if name.casefold() in taken:
                raise BadRequest(f"there is a robot {name!r}, expected another name")
        self._spawning.add(name)  # so that no other browser can take the name
        self._begin(viewer, self._spawn(viewer, name, request))

    def remove(self, viewer: Viewer, request: Remove) -> None:
        """Remove a robot of the commander.

        Raises:
            BadRequest: If the commander has no robot of that name.
        """
        self._begin(viewer, self._remove(self.find_own(request.robot)))

    async def close(self) -> None:
        """Remove all robots of the commander."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*(self._remove(robot) for robot in [*self.own.values()]))

    def watch(self, reports: Iterable[Report]) -> None:
        """Process the reports of the server about all robots."""
        news = False
        for report in reports:
            match report:
                case Watching(robots):
                    # ``names`` is None if all robots are watched. Otherwise no page is
                    # visible, and no robot is watched.
                    if robots.names is None:
                        self._switch_watching(True)
                    else:
                        self.forget_others()
                case RobotJoined(robot, class_name):
                    self._add(robot, class_name).learn_presets(self._config)
                case RobotLeft(robot) if robot not in self.own:
                    # The commander's own robots are removed when their connections end.
                    # This report may be about another client's earlier robot of the
                    # same name.
                    if self.views.pop(robot, None) is not None:
                        self.on_left(robot)
                        news = True
                case WatchedLine(robot, _, line) if line is not None:
                    view = self.views.get(robot)
                    news |= view is not None and view.take(line)
        if news:
            self._on_change()

    def forget_others(self) -> None:
        """Remove the robots of other clients, which the server no longer reports."""
        self._switch_watching(False)
        for name in self.views.keys() - self.own.keys():
            del self.views[name]
            self.on_left(name)
        self._on_change()

    def _switch_watching(self, on: bool) -> None:
        self.is_watching = on
        for robot in self.own.values():
            robot.leave_sensors(on)

    def _begin(self, viewer: Viewer, work: Coroutine[Any, Any, None]) -> None:
        """Run a coroutine as a task; if it fails, send the error to the browser."""

        async def report() -> None:
            try:
                await work
            except RadarsimError as error:
                viewer.send({"op": "error", "text": str(error)})

        task = asyncio.ensure_future(report())
        self._tasks.add(task)  # the event loop keeps only weak references
        task.add_done_callback(self._tasks.discard)

    async def _spawn(self, viewer: Viewer, name: str, request: Spawn) -> None:
        def send_wait() -> None:
            text = f"{name} is not spawned yet: no position is free, or the server"
            text += " is paused or busy"
            viewer.send({"op": "notice", "text": text})

        start, pose = request.start, request.pose and Pose2(*request.pose)
        class_name, drive_unit = request.class_name, self._config.wheel_unit
        waiting = asyncio.get_running_loop().call_later(LONG_WAIT, send_wait)
        assert self._address is not None  # ``spawn`` refuses None
        try:
            client = await AsyncClient.connect(*self._address, timeout=ANSWER)
            try:
                await client.spawn(
                    class_name, name=name, start=start, pose=pose, timeout=SPAWN_TIMEOUT
                )
                info = await client.robot_info(drive_unit=drive_unit)
            except BaseException:  # including cancellation
                await client.close()
                raise
        except ValueError as error:  # a text that cannot be written on a line
            raise BadRequest(str(error)) from None
        finally:
            waiting.cancel()
            self._spawning.discard(name)
        robot = OwnRobot(client, name, info, self._send_driver, self._take_own)
        self._add(name, class_name).learn(info)
        self.own[name] = robot
        robot.leave_sensors(self.is_watching)
        self._begin(viewer, self._run(robot))
        viewer.send({"op": "spawned", "robot": name})

    async def _run(self, robot: OwnRobot) -> None:
        """Run a robot until it is removed, or its connection is lost."""
        try:
            await robot.run()
        except ClientError as error:
            # The robot may already be removed, or replaced by another robot with the
            # same name.
            if self.own.get(robot.name) is robot:
                self._forget(robot)
                # The browser that drives the robot gets an error, and all other
                # browsers a notice.
                text = f"the robot {robot.name!r} was lost: {error}"
                for viewer in self._viewers:
                    op = "error" if robot.driver == viewer.name else "notice"
                    viewer.send({"op": op, "text": text})
                await robot.close()

    async def _remove(self, robot: OwnRobot) -> None:
        self._forget(robot)
        await robot.close()

    def _forget(self, robot: OwnRobot) -> None:
        self.own.pop(robot.name, None)
        if self.views.pop(robot.name, None) is not None:
            self.on_left(robot.name)
        self._on_change()

    def _add(self, name: str, class_name: str) -> RobotView:
        """Add a robot if it is not known yet, and return its state."""
        view = self.views.get(name)
        if view is None:
            config = self._config if self.is_watching else None
            view = RobotView(name, class_name, config)
            # The limit bounds the memory if a server reports robots endlessly.
            if len(self.views) < MOST_VIEWS:
                taken = {each.number for each in self.views.values()}
                view.number = next(n for n in range(len(taken) + 1) if n not in taken)
                self.views[name] = view
                self._on_change()
        return view

    def _take_own(self, robot: OwnRobot, reports: Iterable[Report]) -> None:
        """Process reports from the connection of one of the commander's robots."""
        view = self.views.get(robot.name)
        for report in reports:
            if isinstance(report, CommandError) and robot.name in self.own:
                if view is not None:  # the error may refuse a setting
                    view.undo_setting()
                text = f"{robot.name!r}: {report.text}"
                self._viewers.broadcast({"op": "error", "text": text})
                self._viewers.update()
        # While all robots are watched, the watching connection receives the same lines.
        if view is not None and not self.is_watching:
            news = [view.take(report) for report in reports]
            if any(news):
                self._on_change()

    def _send_driver(self, robot: OwnRobot) -> None:
        message = {"op": "viewer", "robot": robot.name, "driver": robot.driver}
        self._viewers.broadcast(message, ("driver", robot.name))
        self._viewers.update()
