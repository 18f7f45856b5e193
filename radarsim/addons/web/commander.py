"""The commander executes the requests of browsers, and sends them the state.

The commander runs in one event loop; long operations, such as spawning, are asyncio
tasks.
"""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from radarsim import __version__
from radarsim.addons.web.activities import Activities
from radarsim.addons.web.recording import RecordingSwitch
from radarsim.addons.web.requests import (
    BadRequest,
    Drive,
    Look,
    Request,
    Select,
    Setting,
    Stop,
    make_offers,
)
from radarsim.addons.web.robot_view import encode_frame
from radarsim.addons.web.robots import Robots
from radarsim.addons.web.server_link import Link
from radarsim.addons.web.viewers import Viewer, Viewers
from radarsim.autonomy.navigation.runner import least_clearance
from radarsim.protocol.reports import Report
from radarsim.simulation.config import SimulationConfig

if TYPE_CHECKING:
    from radarsim.addons.web.scene_message import SceneMessages

LINGER: Final = 2.0  # s of watching after the last page is hidden, such as by a reload


class Commander:
    """Connects browsers with the robots of a server or of a recording."""

    def __init__(
        self,
        link: Link,
        config: SimulationConfig,
        record_to: Path,
        *,
        map_: str | None = None,
    ) -> None:
        """Create a commander that is not connected; call it in the event loop.

        Args:
            link: Link to the server, or to the recording that is played.
            config: How the server was started, as far as it is known.
            record_to: Folder in which each recording creates a subfolder.
            map_: Name or path of the map that is shown; None if it is not known.
        """
        self._config = config
        self._is_lost = True
        self._loop = asyncio.get_running_loop()
        self._linger: asyncio.TimerHandle | None = None
        self._viewers = Viewers(self._frame)
        self._link = link
        self._robots = Robots(link.address, config, self._viewers, self._robots_changed)
        self._activities = Activities(self._robots, self._viewers, self._robots_changed)
        self._robots.on_left = self._activities.forget
        link.on_link, link.on_reports = self._server_changed, self._show_reports
        link.on_time, link.on_damage = self._time_changed, self._send_error
        self._recording = RecordingSwitch(
            link.address, config, record_to, self._viewers, map_=map_
        )
        self._handlers: Mapping[str, Callable[[Viewer, Any], None]] = {
            "ack": lambda viewer, _: self._viewers.acknowledge(viewer),
            "cancel": lambda _, request: self._activities.cancel(request),
            "drive": self._drive,
            "explore": lambda _, request: self._activities.explore(request),
            "goto": lambda _, request: self._activities.go(request),
            "look": self._look,
            "map": lambda _, request: self._activities.switch_map(request),
            "pace": lambda _, request: link.change_pace(request),
            "record": lambda _, request: self._recording.switch(request.on),
            "remove": self._robots.remove,
            "seek": lambda _, request: link.seek(request),
            "select": self._select,
            "setting": self._set,
            "spawn": self._robots.spawn,
            "stop": self._stop,
            "triangles": self._send_triangles,
        }

    async def run(self) -> None:
        """Stay connected until cancelled, then remove the commander's robots."""
        try:
            await self._link.run()
        finally:
            self._activities.close()
            await asyncio.gather(self._robots.close(), self._recording.close())

    def show_scene(self, scene: "SceneMessages") -> None:
        """Send the map of the server to all browsers."""
        self._activities.scene = scene
        for viewer in self._viewers:
            self._greet(viewer)
            viewer.send(scene.plan, "scene")

    def join(self) -> Viewer:
        """Add a browser, and send it the state."""
        viewer = self._viewers.add()
        self._watch()
        self._greet(viewer)
        if self._activities.scene is not None:
            viewer.send(self._activities.scene.plan)
        viewer.send(self._recording.state, "recording")
        viewer.send(self._link.time_message(), "time")
        self._send_server(viewer)
        for text in self._activities.newest.values():
            viewer.send(text)
        # The browser acknowledges this frame, and then receives further frames.
        self._viewers.send_frame(viewer)
        return viewer

    def leave(self, viewer: Viewer) -> None:
        """Remove a browser, and stop the robots that it drives."""
        self._viewers.remove(viewer)
        self._watch()
        # The browser that has left no longer repeats its drive commands.
        for robot in self._robots.own.values():
            if robot.driver == viewer.name:
                robot.release()

    def act(self, viewer: Viewer, request: Request) -> None:
        """Execute a request of a browser.

        Raises:
            RadarsimError: If that is not possible; the browser is sent its message.
        """
        if request.op not in self._handlers:
            raise BadRequest(f"{request.op!r} is not possible on this page")
        self._handlers[request.op](viewer, request)

    # Handlers of requests

    def _drive(self, viewer: Viewer, request: Drive) -> None:
        robot = self._robots.find_own(request.robot)
        if robot.driver not in (None, viewer.name):
            raise BadRequest(f"{robot.driver} drives {robot.name!r}")
        if request.v or request.w:  # driving ends the robot's task
            self._activities.stop(robot.name)
        robot.drive(viewer.name, request.v, request.w)

    def _stop(self, _: Viewer, request: Stop) -> None:
        robots = [*self._robots.own.values()]
        if request.robot is not None:
            robots = [self._robots.find_own(request.robot)]
        for robot in robots:
            self._activities.stop(robot.name)
            robot.release()

    def _select(self, viewer: Viewer, request: Select) -> None:
        viewer.selected = request.robot
        self._robots_changed()

    def _look(self, viewer: Viewer, request: Look) -> None:
        viewer.is_looking = request.on
        self._watch()
        self._viewers.catch_up(viewer)

    def _set(self, _: Viewer, request: Setting) -> None:
        robot = self._robots.find_own(request.robot)
        # Only radarsim servers can be watched, and only radarsim servers have settings.
        if not self._link.state.watches:
            raise BadRequest("this server does not support changes of settings")
        scanner, value = self._robots.find(robot.name).change_setting(request)
        robot.change_setting(scanner, request.key, value)
        self._viewers.update()

    def _send_triangles(self, viewer: Viewer, _: Request) -> None:
        if self._activities.scene is None:
            raise BadRequest("no map is known; start the commander with --draw")
        viewer.send(self._activities.scene.triangles, "triangles")

    # Messages to browsers

    def _greet(self, viewer: Viewer) -> None:
        """Send a browser the server's state, and the robot classes and settings."""
        state, scene = self._link.state, self._activities.scene
        greeting = {
            "op": "hello",
            "viewer": viewer.name,
            "version": __version__,
            "level": state.level,
            "dialect": self._config.dialect.name,
            "watch": state.watches,
            "map": scene is not None,
            "played": self._link.address is None,
            "starts": [
                {"name": name, "x": pose.x, "y": pose.y, "yaw": pose.yaw}
                for name, pose in state.starts.items()
            ],
            "materials": [] if scene is None else scene.materials,
            **make_offers(self._config),
        }
        viewer.send(greeting, "hello")

    def _time_changed(self) -> None:
        link = self._link
        self._activities.clock.set_rate(0.0 if link.is_paused else link.speed)
        self._viewers.broadcast(link.time_message(), "time")

    def _send_error(self, text: str) -> None:
        self._viewers.broadcast({"op": "error", "text": text})

    def _show_reports(self, reports: Sequence[Report]) -> None:
        self._robots.watch(reports)
        if self._link.address is None:  # the time of a recording moves without reports
            self._viewers.update()

    def _robots_changed(self) -> None:
        self._watch()  # a selected robot may just have joined
        self._viewers.update()

    def _watch(self) -> None:
        """Ask the server for the reports and echoes that pages and maps need now."""
        looking = [viewer for viewer in self._viewers if viewer.is_looking]
        mapped = self._activities.mapped
        if looking or mapped:
            if self._linger is not None:
                self._linger.cancel()
                self._linger = None
            wanted = mapped | {viewer.selected for viewer in looking}
            self._link.watch(self._robots.views.keys() & wanted)
        elif self._linger is None:
            self._linger = self._loop.call_later(LINGER, self._link.watch, None)

    def _server_changed(self) -> None:
        state = self._link.state
        was_lost, self._is_lost = self._is_lost, bool(state.problem)
        # The server may have been restarted with another map.
        self._robots.starts = state.starts
        if state.problem:
            self._robots.forget_others()
            self._viewers.broadcast({"op": "lost", "text": state.problem}, "server")
            return
        for viewer in self._viewers:
            self._greet(viewer)
            self._send_server(viewer)
        # This message comes last, because the page is shown again when the message
        # arrives.
        if was_lost:
            self._viewers.broadcast({"op": "found"}, "server")

    def _send_server(self, viewer: Viewer) -> None:
        """If the server is lost or refuses to be watched, send a browser the reason."""
        state = self._link.state
        if state.problem:
            viewer.send({"op": "lost", "text": state.problem}, "server")
        elif state.refusal:
            text = f"robots of other clients are not shown: {state.refusal}"
            viewer.send({"op": "notice", "text": text})

    def _frame(self, selected: str | None) -> bytes:
        owners = {}
        for name, robot in self._robots.own.items():
            work = "task" if name in self._activities.running else None
            safety = self._activities.safety_distance(robot)
            owners[name] = {
                "mine": True,
                "driver": robot.driver or work,
                "hindrance": robot.refusal,
                "safety": safety,
                "clearance": None if safety is None else least_clearance(safety),
            }
        views = self._robots.views.values()
        return encode_frame(views, owners, selected, self._link.position)
