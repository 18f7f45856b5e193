"""The commander: acts upon what browsers ask for, and tells them what there is.

Everything runs in one event loop. What takes long, such as spawning, is done beside it.

The server is asked to tell what somebody looks at, and nothing else. Copies of the
robots' lines take time of the server, echoes far more. Without a page on a screen, and
without a map that is being made, the server tells nothing.

The first message to a page says what the server and the program have.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from radarsim import __version__
from radarsim.addons.web.activities import Activities
from radarsim.addons.web.explanation import explain_beam
from radarsim.addons.web.frames import FrameSender, Owner, encode_frame
from radarsim.addons.web.offers import make_offers
from radarsim.addons.web.own_robot import OwnRobot
from radarsim.addons.web.recording import RecordingSwitch
from radarsim.addons.web.requests import (
    Ack,
    BadRequest,
    Cancel,
    Drive,
    Explain,
    Explore,
    Goto,
    Look,
    Map,
    Record,
    Remove,
    Request,
    Select,
    Setting,
    Spawn,
    Stop,
    Triangles,
)
from radarsim.addons.web.roster import Roster, Spawner
from radarsim.addons.web.scanner_settings import change_setting, undo_setting
from radarsim.addons.web.server_link import ServerLink
from radarsim.addons.web.viewer import Viewer, Viewers
from radarsim.simulation.config import SimulationConfig

if TYPE_CHECKING:
    from radarsim.addons.web.scene_message import SceneMessages
    from radarsim.addons.web.server_link import ServerState
    from radarsim.addons.web.viewer import Viewer
    from radarsim.simulation.config import SimulationConfig


def make_greeting(
    viewer: Viewer,
    state: ServerState,
    config: SimulationConfig,
    scene: SceneMessages | None,
) -> dict[str, Any]:
    """Return the message ``hello``.

    Args:
        viewer: The browser that it is for.
        state: What is known of the server.
        config: How the server was started, as far as it is known.
        scene: The map; None if it is not known.
    """
    starts = [
        {"name": name, "x": pose.x, "y": pose.y, "yaw": pose.yaw}
        for name, pose in state.starts.items()
    ]
    return {
        "op": "hello",
        "viewer": viewer.name,
        "version": __version__,
        "level": state.level,
        "dialect": config.dialect.name,
        "watch": state.watches,
        "map": scene is not None,
        "starts": starts,
        "materials": [] if scene is None else scene.materials,
        **make_offers(config),
    }


LINGER: Final = 2.0  # s that lines still come when nobody looks, as during a reload


class Attention:
    """Asks the server for what is needed, and no more for what is not."""

    def __init__(
        self,
        link: ServerLink,
        viewers: Viewers,
        roster: Roster,
        activities: Activities,
    ) -> None:
        """Ask for nothing yet; to be called in the event loop.

        Args:
            link: The connection to the server.
            viewers: The browsers.
            roster: The robots.
            activities: What goes on with the robots.
        """
        self._link = link
        self._viewers = viewers
        self._roster = roster
        self._activities = activities
        self._loop = asyncio.get_running_loop()
        self._end: asyncio.TimerHandle | None = None

    def update(self) -> None:
        """Ask for what is needed now."""
        looking, mapped = self._viewers.looking, self._activities.mapped
        if looking or mapped:
            if self._end is not None:
                self._end.cancel()
                self._end = None
            wanted = mapped | {viewer.selected for viewer in looking}
            self._link.watch(self._roster.views.keys() & wanted)
        elif self._end is None:
            self._end = self._loop.call_later(LINGER, self._link.watch, None)


NOT_OWN: Final = Owner(mine=False, driver=None, hindrance="it is another program's")


class Commander:
    """Robots, browsers, and the server between them.

    Attributes:
        roster: The robots.
        viewers: The browsers, by name.
    """

    def __init__(
        self,
        address: tuple[str, int],
        config: SimulationConfig,
        record_to: Path,
    ) -> None:
        """Create a commander that is not connected; to be called in the event loop.

        Args:
            address: Host and port of the server.
            config: How the server was started, as far as it is known.
            record_to: Folder in which each recording gets one of its own.
        """
        self.viewers = Viewers()
        self.roster = Roster(address, config)
        self._config = config
        self._scene: SceneMessages | None = None
        self._frames = FrameSender(self.viewers, self._frame)
        self._link = ServerLink(address)
        self._recording = RecordingSwitch(address, config, record_to, self.viewers)
        self._activities = Activities(self.roster, self.viewers.broadcast)
        self._attention = Attention(
            self._link, self.viewers, self.roster, self._activities
        )
        self._spawner = Spawner(self.roster, self._tell_driver)
        self._is_lost = True
        self._activities.on_mapped = self._attention.update
        self.roster.on_change = self._robots_changed
        self.roster.on_left = self._activities.forget
        self.roster.on_lost = self._tell_lost
        self.roster.on_refusal = self._tell_refusal
        self._link.on_change = self._server_changed
        self._link.on_reports = self.roster.watch
        self._handlers: Mapping[type[Request], Callable[[Viewer, Any], None]] = {
            Ack: lambda viewer, _: self._frames.acknowledge(viewer),
            Cancel: lambda _, request: self._activities.cancel(request),
            Drive: self._drive,
            Explain: self._explain,
            Explore: lambda _, request: self._activities.explore(request),
            Goto: lambda _, request: self._activities.go(request),
            Look: self._look,
            Map: lambda _, request: self._activities.switch_map(request),
            Record: lambda _, request: self._recording.switch(request.on),
            Remove: self._spawner.remove,
            Select: self._select,
            Setting: self._set,
            Spawn: self._spawner.spawn,
            Stop: self._stop,
            Triangles: self._send_triangles,
        }

    async def run(self) -> None:
        """Stay connected for ever; the commander's robots are removed at the end."""
        try:
            await self._link.run()
        finally:
            self._spawner.close()
            self._activities.close()
            await asyncio.gather(self.roster.close(), self._recording.close())

    def show_scene(self, scene: SceneMessages) -> None:
        """Show the map that the server serves."""
        self._scene = scene
        self._activities.safety_distance = scene.safety_distance
        self._activities.bounds = scene.bounds
        for viewer in self.viewers.values():
            self._greet(viewer)
            viewer.send(scene.plan, "scene")

    def join(self) -> Viewer:
        """Add a browser, and tell it what there is."""
        viewer = self.viewers.add()
        self._attention.update()
        self._greet(viewer)
        if self._scene is not None:
            viewer.send(self._scene.plan)
        viewer.send(self._recording.message(), "recording")
        self._tell_server(viewer)
        for text in self._activities.messages():
            viewer.send(text)
        self._frames.send_to(viewer)
        return viewer

    def leave(self, viewer: Viewer) -> None:
        """Remove a browser, and stop what it drives."""
        self.viewers.remove(viewer)
        self._attention.update()
        for robot in self.roster.own.values():
            if robot.driver == viewer.name:
                robot.release()
                self._tell_driver(robot)

    def act(self, viewer: Viewer, request: Request) -> None:
        """Do what a browser asks for.

        Raises:
            RadarsimError: If that is not possible; the message is for the browser.
        """
        handler = self._handlers.get(type(request))
        if handler is None:
            raise BadRequest(f"{type(request).__name__.lower()} is not possible here")
        handler(viewer, request)

    # What browsers ask for

    def _drive(self, viewer: Viewer, request: Drive) -> None:
        robot = self.roster.find_own(request.robot)
        before = robot.driver
        if before not in (None, viewer.name):
            raise BadRequest(f"{before} drives {robot.name!r}")
        if request.v or request.w:  # who drives takes over
            self._activities.stop(robot.name)
        robot.drive(viewer.name, request.v, request.w)
        if robot.driver != before:
            self._tell_driver(robot)

    def _stop(self, _: Viewer, request: Stop) -> None:
        robots = [*self.roster.own.values()]
        if request.robot is not None:
            robots = [self.roster.find_own(request.robot)]
        self._activities.stop(request.robot)
        for robot in robots:
            had_driver = robot.driver is not None
            robot.release()
            if had_driver:
                self._tell_driver(robot)

    def _select(self, viewer: Viewer, request: Select) -> None:
        viewer.selected = request.robot
        self._robots_changed()

    def _look(self, viewer: Viewer, request: Look) -> None:
        viewer.is_looking = request.on
        self._attention.update()
        self._frames.catch_up(viewer)

    def _set(self, _: Viewer, request: Setting) -> None:
        robot = self.roster.find_own(request.robot)
        if not self._link.state.watches:
            raise BadRequest("this server changes no settings")
        change_setting(robot, self.roster.find(robot.name), request)
        self._frames.changed()

    def _explain(self, viewer: Viewer, request: Explain) -> None:
        viewer.send(explain_beam(self.roster.find(request.robot), request))

    def _send_triangles(self, viewer: Viewer, _: Triangles) -> None:
        if self._scene is None:
            raise BadRequest("no map is known; start the commander with --draw")
        viewer.send(self._scene.triangles, "triangles")

    # What browsers are told

    def _greet(self, viewer: Viewer) -> None:
        greeting = make_greeting(viewer, self._link.state, self._config, self._scene)
        viewer.send(greeting, "hello")

    def _robots_changed(self) -> None:
        self._attention.update()  # echoes of robots that were selected before they came
        self._frames.changed()

    def _server_changed(self) -> None:
        state = self._link.state
        was_lost, self._is_lost = self._is_lost, bool(state.problem)
        self._spawner.starts = state.starts
        if state.problem:
            self.roster.forget_others()
            self.viewers.broadcast({"op": "lost", "text": state.problem}, "server")
            return
        for viewer in self.viewers.values():
            self._greet(viewer)
            self._tell_server(viewer)
        if was_lost:
            self.viewers.broadcast({"op": "found"}, "server")

    def _tell_server(self, viewer: Viewer) -> None:
        """Tell a browser what the server does not do."""
        state = self._link.state
        if state.problem:
            viewer.send({"op": "lost", "text": state.problem}, "server")
        elif state.refusal:
            text = f"robots of others are not shown: {state.refusal}"
            viewer.send({"op": "notice", "text": text})

    def _tell_driver(self, robot: OwnRobot) -> None:
        message = {"op": "viewer", "robot": robot.name, "driver": robot.driver}
        self.viewers.broadcast(message, ("driver", robot.name))
        self._frames.changed()

    def _tell_refusal(self, robot: OwnRobot, text: str) -> None:
        if robot.name in self.roster.views:
            undo_setting(self.roster.views[robot.name])
        self.viewers.broadcast({"op": "error", "text": f"{robot.name!r}: {text}"}, None)
        self._frames.changed()

    def _tell_lost(self, robot: OwnRobot, reason: str) -> None:
        """Tell all that a robot is gone, and who drives it that it is an error."""
        text = f"the robot {robot.name!r} is gone: {reason}"
        for viewer in self.viewers.values():
            drives = robot.driver == viewer.name
            viewer.send({"op": "error" if drives else "notice", "text": text})

    def _work_of(self, robot: str) -> str | None:
        return "task" if self._activities.is_at_work(robot) else None

    def _frame(self, selected: str | None) -> bytes:
        roster = self.roster
        own = {
            name: Owner(
                mine=True,
                driver=robot.driver or self._work_of(name),
                hindrance=robot.hindrance,
            )
            for name, robot in roster.own.items()
        }
        owners = {name: own.get(name, NOT_OWN) for name in roster.views}
        return encode_frame(roster.views.values(), owners, selected)
