"""Spawns and removes robots, which takes a while; who asked is told if it fails."""

import asyncio
from collections.abc import Callable, Coroutine, Mapping
from typing import Any, Final

from radarsim.commander.own_robot import OwnRobot
from radarsim.commander.requests import BadRequest, Remove, Spawn
from radarsim.commander.roster import Roster
from radarsim.commander.viewer import Viewer
from radarsim.errors import RadarsimError
from radarsim.geometry import Pose3

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
