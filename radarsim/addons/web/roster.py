"""All robots that are known, and those of them that the commander spawned.

Spawns and removes robots, which takes a while; who asked is told if it fails.
"""

import asyncio
import math
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from typing import Any, Final

from radarsim.addons.web.own_robot import OwnRobot
from radarsim.addons.web.requests import BadRequest, Remove, Spawn
from radarsim.addons.web.robot_view import RobotView
from radarsim.addons.web.viewer import Viewer
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

MOST_ROBOTS: Final = 100  # that the commander spawns
MOST_VIEWS: Final = 2000  # robots that are known; a server has at most 1024
NEAR: Final = 0.8  # m from a start at which a robot occupies it


class Roster:
    """Robots by name.

    Attributes:
        views: What is known of each robot.
        own: Robots that the commander spawned.
        is_watching: Whether the server tells of all robots now, so that the own
            connections of robots need not be looked at.
        on_change: Called when there is something new to show.
        on_left: Called with the name of a robot that is gone.
        on_refusal: Called with a robot of its own, and why the server refused a
            command.
        on_lost: Called with a robot of its own whose connection was lost, and why.
    """

    def __init__(self, address: tuple[str, int], config: SimulationConfig) -> None:
        """Create an empty roster.

        Args:
            address: Host and port of the server.
            config: How the server was started, as far as it is known.
        """
        self.views: dict[str, RobotView] = {}
        self.own: dict[str, OwnRobot] = {}
        self.is_watching = False
        self.on_change: Callable[[], None] = lambda: None
        self.on_left: Callable[[str], None] = lambda _: None
        self.on_refusal: Callable[[OwnRobot, str], None] = lambda *_: None
        self.on_lost: Callable[[OwnRobot, str], None] = lambda *_: None
        self._address = address
        self._config = config
        self._spawning: set[str] = set()

    def find_own(self, name: str) -> OwnRobot:
        """Return a robot of the commander.

        Raises:
            BadRequest: If there is none of that name.
        """
        if name not in self.own:
            whose = "another client's" if name in self.views else "no"
            raise BadRequest(f"{whose} robot {expected_one_of(name, [*self.own])}")
        return self.own[name]

    def find(self, name: str) -> RobotView:
        """Return what is known of a robot.

        Raises:
            BadRequest: If there is none of that name.
        """
        if name not in self.views:
            raise BadRequest(f"no robot {expected_one_of(name, [*self.views])}")
        return self.views[name]

    def begin_spawning(self, request: Spawn) -> str:
        """Choose the name of a new robot, which no other can get any more.

        Raises:
            BadRequest: If the wanted one is taken, or there are too many robots.
        """
        if len(self.own) + len(self._spawning) >= MOST_ROBOTS:
            raise BadRequest(f"{MOST_ROBOTS} robots are there, expected no more")
        taken = {name.casefold() for name in (*self.views, *self._spawning)}
        if request.name is None:
            numbers = range(1, len(taken) + 2)
            name = next(f"R{n}" for n in numbers if f"r{n}" not in taken)
        else:
            name = " ".join(request.name.split())
            if name.casefold() in taken:
                raise BadRequest(f"there is a robot {name!r}, expected another name")
        self._spawning.add(name)
        return name

    async def spawn(
        self, name: str, request: Spawn, starts: Mapping[str, Pose3]
    ) -> OwnRobot:
        """Spawn a robot.

        Args:
            name: Its name, by ``begin_spawning``.
            request: Its class and place.
            starts: Starts of the map; the first that is free, if no place is given.

        Raises:
            BadRequest: If a text cannot be written on a line.
            ClientError: If the server spawns none.
        """
        place: str | Pose2 | None = request.start
        if request.pose is not None:
            place = Pose2(*request.pose)
        try:
            robot = await OwnRobot.spawn(
                self._address,
                request.class_name,
                name,
                self._free_start(starts) if place is None else place,
                self._config.wheel_drive().unit,
            )
        except ValueError as error:
            raise BadRequest(str(error)) from None
        finally:
            self._spawning.discard(name)
        view = self.add(name, request.class_name)
        view.describe(robot.info)
        self.own[name] = robot
        robot.listeners.append(lambda reports: self._take_own(name, reports))
        return robot

    async def run(self, robot: OwnRobot) -> None:
        """Run a robot until it is removed, or its connection is lost."""
        try:
            await robot.run()
        except ClientError as error:
            if self.own.get(robot.name) is robot:
                self._forget(robot)
                self.on_lost(robot, str(error))
                await robot.close()

    async def remove(self, robot: OwnRobot) -> None:
        """Remove a robot of the commander."""
        self._forget(robot)
        await robot.close()

    async def close(self) -> None:
        """Remove all robots of the commander."""
        await asyncio.gather(*(self.remove(robot) for robot in [*self.own.values()]))

    def add(self, name: str, class_name: str) -> RobotView:
        """Add a robot, if it is not known yet, and return what is known of it."""
        view = self.views.get(name)
        if view is None:
            config = self._config if self.is_watching else None
            view = RobotView(name, class_name, config)
            if len(self.views) < MOST_VIEWS:
                self.views[name] = view
                self.on_change()
        return view

    def watch(self, reports: Iterable[Report]) -> None:
        """Process what the server tells of all robots."""
        news = False
        for report in reports:
            match report:
                case Watching(robots):
                    self._set_watching(robots.names is None)
                case RobotJoined(robot, class_name):
                    self.add(robot, class_name).learn_presets(self._config)
                case RobotLeft(robot) if robot not in self.own:
                    # own ones by their connections: it may have been one before
                    if self.views.pop(robot, None) is not None:
                        self.on_left(robot)
                        news = True
                case WatchedLine(robot, _, line) if line is not None:
                    view = self.views.get(robot)
                    news |= view is not None and view.take(line)
        if news:
            self.on_change()

    def forget_others(self) -> None:
        """Forget robots of other clients, of which nothing more is heard."""
        self.is_watching = False
        for name in self.views.keys() - self.own.keys():
            del self.views[name]
            self.on_left(name)
        self.on_change()

    def _set_watching(self, is_watching: bool) -> None:
        """Know all robots from now on, or only those of the commander."""
        if is_watching:
            self.is_watching = True
        else:
            self.forget_others()

    def _take_own(self, name: str, reports: Iterable[Report]) -> None:
        """Process reports of a robot of the commander on its own connection."""
        for report in reports:
            if isinstance(report, CommandError) and name in self.own:
                self.on_refusal(self.own[name], report.text)
        view = self.views.get(name)
        if view is not None and not self.is_watching:
            news = [view.take(report) for report in reports]
            if any(news):
                self.on_change()

    def _free_start(self, starts: Mapping[str, Pose3]) -> str | None:
        """Return the first start at which no robot stands; the first if all have one.

        None leaves the choice to the server.
        """
        poses: Sequence[Pose2] = [
            view.pose for view in self.views.values() if view.pose is not None
        ]
        for name, start in starts.items():
            distances = (math.hypot(p.x - start.x, p.y - start.y) for p in poses)
            if min(distances, default=math.inf) > NEAR:
                return name
        return next(iter(starts), None)

    def _forget(self, robot: OwnRobot) -> None:
        self.own.pop(robot.name, None)
        if self.views.pop(robot.name, None) is not None:
            self.on_left(robot.name)
        self.on_change()


LONG_WAIT: Final = 4.0  # s for a robot, after which a browser is told why


class Spawner:
    """Spawns and removes robots of the commander, each in a task.

    Attributes:
        starts: Starts of the map, of which a robot gets the first free one.
    """

    def __init__(self, roster: Roster, on_expiry: Callable[[OwnRobot], None]) -> None:
        """Begin without any tasks.

        Args:
            roster: The robots.
            on_expiry: Called when a robot was stopped because nobody drove it any more.
        """
        self.starts: Mapping[str, Pose3] = {}
        self._roster = roster
        self._on_expiry = on_expiry
        self._tasks: set[asyncio.Task[None]] = set()

    def spawn(self, viewer: Viewer, request: Spawn) -> None:
        """Spawn a robot, and run it until it is removed.

        Raises:
            BadRequest: If it cannot have that name or place.
        """
        if request.start is not None and request.pose is not None:
            raise BadRequest("a start and a pose, expected only one of them")
        name = self._roster.begin_spawning(request)
        self._begin(viewer, self._spawn(viewer, name, request))

    def remove(self, viewer: Viewer, request: Remove) -> None:
        """Remove a robot.

        Raises:
            BadRequest: If it is none of the commander.
        """
        robot = self._roster.find_own(request.robot)
        self._begin(viewer, self._roster.remove(robot))

    def close(self) -> None:
        """End what is being done."""
        for task in self._tasks:
            task.cancel()

    async def _spawn(self, viewer: Viewer, name: str, request: Spawn) -> None:
        def tell_wait() -> None:
            text = f"{name} is not there yet: there is no free place, or the server"
            viewer.send({"op": "notice", "text": f"{text} still compiles"})

        waiting = asyncio.get_running_loop().call_later(LONG_WAIT, tell_wait)
        try:
            robot = await self._roster.spawn(name, request, self.starts)
        finally:
            waiting.cancel()
        robot.on_expiry = lambda: self._on_expiry(robot)
        self._begin(viewer, self._roster.run(robot))
        viewer.send({"op": "spawned", "robot": name})

    def _begin(self, viewer: Viewer, work: Coroutine[Any, Any, None]) -> None:
        """Do something beside all else, and tell the browser if it fails."""

        async def report() -> None:
            try:
                await work
            except RadarsimError as error:
                viewer.send({"op": "error", "text": str(error)})

        task = asyncio.ensure_future(report())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
