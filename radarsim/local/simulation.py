"""A simulation in the process of a program, which steps it in a loop.

Theory of operation
===================
Robots are clients of a ``Host``, which is a server without sockets. After each tick,
the bytes for each robot are passed to it. The same seed and commands therefore give the
same bytes as over TCP. Simulated time passes only in ``step``, until ``serve`` is
called. Then a thread steps the simulation by the wall clock, and ``step`` waits for the
thread. Only that thread uses the host then, so all calls of the host go through
``_call``.
"""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple, NoReturn, Self, TypeVar

import numpy as np

from radarsim import plugins
from radarsim.client import session as requests
from radarsim.errors import ClientError, RecordingError, expected_one_of
from radarsim.geometry import Pose2, Pose3
from radarsim.local.robot import GROUP, LocalRobot
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.server_thread import ServerThread
from radarsim.simulation.clock import seconds, ticks_of
from radarsim.simulation.config import SimulationConfig
from radarsim.validation import check_number, check_port

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from radarsim.presets.robots import RobotModel
    from radarsim.server.host import Diagnostic
    from radarsim.simulation.simulation import Simulation

Value = TypeVar("Value")

logger: Final = logging.getLogger(__name__)

POLL: Final = 1.0  # s between two checks whether the server's thread is alive


NOTED_TICKS: Final = 10  # ticks between two moments; doubled at ``MOST_MOMENTS``
MOST_MOMENTS: Final = 20_000  # above this, every second moment is dropped


class Moment(NamedTuple):
    """Robots and scans at one moment of a simulation, to be drawn in pictures.

    Attributes:
        time: Simulated time, s.
        robots: Class and true pose of each robot, by name.
        seen: Sensor type and points, (N, 2) m, map frame, of the newest scan of each
            scanner on the robots that the program spawned.
    """

    time: float
    robots: dict[str, tuple[RobotModel, Pose2]]
    seen: list[tuple[str, NDArray[np.float32]]]


class LocalSimulation:
    """A simulation of robots on a map, which the program drives and steps.

    Attributes:
        host: The server without sockets. After ``serve``, only the server's thread may
            use it.
        robots: The robots that the program has spawned, by name.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        seed: int = 0,
        config: SimulationConfig | None = None,
        map_: str | None = None,
    ) -> None:
        """Create a simulation at 0 s without robots; ``simulate`` also loads a map.

        Args:
            scene: The map.
            seed: Seed of all random numbers.
            config: As in ``simulate``.
            map_: Name or path of the map, for recordings.
        """
        generator_for(seed, "")  # raises here if the seed is invalid
        self._map = map_
        self._complete_recording: Callable[[], None] | None = None
        self.host = Host(scene, config=config, seed=seed)
        self.robots: dict[str, LocalRobot] = {}
        self.seed = seed
        self._numbers: dict[str, int] = {}  # numbers of the robots' clients at the host
        self._late_texts: dict[int, list[str]] = {}  # messages, while a robot spawns
        self._noted: list[Moment] = []
        self._interval = NOTED_TICKS
        self._redraw: Callable[[], bool] | None = None  # set by ``show``
        self._drawn = 0  # tick of the last update in ``step``
        self._thread: ServerThread | None = None
        self._ticked = threading.Condition()

    def __repr__(self) -> str:
        robots = ", ".join(self.robots) or "no robots"
        return f"<LocalSimulation {self.scene.name} at {self.time:.2f} s: {robots}>"

    def __reduce__(self) -> NoReturn:
        text = "a simulation cannot be copied or pickled, expected a new one, with the"
        raise TypeError(f"{text} same map, seed and commands")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def scene(self) -> Scene:
        """The map of the simulation."""
        return self.host.scene

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.host.simulation.time

    def spawn(
        self,
        class_name: str = "P3AT",
        *,
        name: str | None = None,
        start: str | None = None,
        pose: Pose2 | Pose3 | Sequence[float] | None = None,
    ) -> LocalRobot:
        """Spawn a robot at a start pose of the map, or at any other pose.

        If the pose is occupied, the nearest free pose within 1 m is used. As on a
        server, at most four robots are spawned in a tick, and a search for a free pose
        delays the next spawn, so simulated time may pass.

        Args:
            class_name: Class of the robot, such as ``P3AT``, in any case.
            name: Name of the robot; None chooses one. Random numbers depend on it.
            start: Name of a start pose, in any case.
            pose: Pose in the map frame if ``start`` is None: a ``Pose2`` or ``Pose3``,
                ``(x, y)``, ``(x, y, yaw)`` or the six numbers of a ``Pose3``, m and
                rad. Without both, the first free start is used.

        Raises:
            PresetError: If there is no such class.
            ClientError: If there is no such start, or no free pose.
            ValueError: If both ``start`` and ``pose`` are given, the pose is malformed,
                or a name cannot be written on a line.
        """
        starts = [each.name for each in self.scene.starts]
        takes_free = start is None and pose is None
        if takes_free and starts:
            start = starts[0]
        request = requests.spawn(
            class_name, name=name, start=start, pose=pose, takes_free=takes_free
        )
        config = self.host.config
        config.check_scanners(config.robot(class_name.rpartition(".")[2]))
        if start is not None and self.scene.start(start) is None:
            raise ClientError(f"start {expected_one_of(start, starts)}")
        number = self._call(self.host.connect)
        texts = self._late_texts[number] = self.receive(number, request.data)
        while self._call(lambda: self.host.is_busy(number)):
            self.step(seconds(1))
        robot = self._call(lambda: self._find_robot(number))
        del self._late_texts[number]
        if robot is None:
            self._call(lambda: self.host.disconnect(number))
            raise ClientError("; ".join(texts) or f"no free place for {class_name!r}")
        for text in texts:  # for example that the robot was moved
            logger.warning("%s: %s", robot.name, text)
        return robot

    def remove(self, robot: LocalRobot) -> None:
        """Remove a robot from the simulation.

        Raises:
            ValueError: If the robot is not in the simulation.
        """
        if robot not in self.robots.values():
            raise ValueError(f"robot {robot!r}, expected one of {[*self.robots]}")

        def disconnect() -> None:
            del self.robots[robot.name]
            self.host.disconnect(self._numbers.pop(robot.name))

        self._call(disconnect)

    def step(self, duration: float) -> None:
        """Let simulated time pass, in which all robots move and sensors measure.

        Args:
            duration: Simulated time, s, rounded to ticks of 10 ms; at least one tick.

        Raises:
            ExceptionGroup: If the server of ``serve`` has failed.
            TypeError: If the duration is no number.
            ValueError: If the duration is not finite and above 0.
        """
        check_number("duration in s", duration, above=0.0)
        ticks = ticks_of(duration)
        if self._thread is None:
            for _ in range(ticks):
                for number, diagnostic in self.host.step():
                    self._log(number, diagnostic)
                self.host.raise_fault()
                self._pass_on()
        else:
            self._wait_until(self.host.simulation.ticks + ticks)
        self._call(self._collect)
        ticks = self.host.simulation.ticks
        if self._redraw is not None and ticks >= self._drawn + NOTED_TICKS:
            self._drawn = ticks
            self._redraw()

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the robots, their true paths and newest scans on a plan of the map.

        Args:
            ax: Axes of matplotlib, m; None for a new figure with a legend.

        Returns:
            The axes.
        """
        from radarsim.local.pictures import RunPicture  # noqa: PLC0415 - matplotlib

        return RunPicture(self.scene, self._moments(), ax).axes

    def render(self, path: str | Path, *, speed: float = 1.0) -> None:
        """Write a picture of the simulation, or a film from its start until now.

        Args:
            path: The file: ``.png``, ``.svg`` or ``.pdf`` for a picture, ``.gif`` or
                ``.mp4`` for a film. MP4 needs the extra ``film``.
            speed: Simulated seconds in one second of a film.

        Raises:
            OSError: If the file cannot be written.
            ValueError: If the file name has another ending, the speed is not above 0,
                or a package is not installed.
        """
        from radarsim.local.pictures import write_run  # noqa: PLC0415 - matplotlib

        check_number("speed", speed, above=0.0)
        write_run(self.scene, self._moments(), Path(path), speed=speed)

    def show(self) -> None:
        """Open a window that shows a picture of the simulation, updated while it runs.

        From now on ``step`` updates the window, at most every 0.1 s of simulated time,
        until it is closed. A notebook without windows shows the picture below the cell.

        Raises:
            RadarsimError: If matplotlib cannot open a window, such as without a
                display.
        """
        from radarsim.local.pictures import follow_run  # noqa: PLC0415 - matplotlib

        if self._redraw is None or not self._redraw():
            self._redraw = follow_run(self, self._moments)

    def _repr_png_(self) -> bytes:
        """Return a PNG picture of the simulation, which notebooks display."""
        from radarsim.local.pictures import draw_run  # noqa: PLC0415 - matplotlib

        return draw_run(self.scene, self._moments())

    def camera(
        self,
        pose: Pose3 | Sequence[float],
        *,
        width: int = 640,
        height: int = 480,
        fov_deg: float = 80.0,
        carrier: LocalRobot | None = None,
    ) -> NDArray[np.uint8]:
        """Return a picture of the scene, taken by a camera at any pose.

        Args:
            pose: Pose of the camera, which looks along its x axis: x, y, z, roll,
                pitch, yaw, m and rad, map frame.
            width: Width in pixels.
            height: Height in pixels.
            fov_deg: Horizontal field of view, degrees.
            carrier: Robot to leave out of the picture; None for none.

        Returns:
            RGB pixels, (height, width, 3).

        Raises:
            ValueError: If the pose does not have six finite numbers, the picture has no
                pixels, or the angle is not below 180 degrees.
        """
        from radarsim.server.camera import Renderer  # noqa: PLC0415 - matplotlib
        from radarsim.server.views import View  # noqa: PLC0415

        if not isinstance(pose, Pose3):
            pose = Pose3.from_numbers(pose)
        renderer = Renderer(self.scene, width, height, math.radians(fov_deg))
        boxes = self._call(self.host.simulation.boxes)
        return renderer.render(View(pose, boxes, carrier.number if carrier else -1))

    def record(self, folder: str | Path, *, spectra: bool = False) -> None:
        """Record the simulation as a ROS 2 bag, from now on until ``close``.

        ``radarsim.load_recording`` reads the bag, and ``radarsim replay`` can repeat
        the run if its map was loaded by name. Recording needs the extra ``record``.

        Args:
            folder: Folder to create.
            spectra: Whether to record the received power of FMCW radars as well, about
                180 MB per minute.

        Raises:
            RecordingError: If the simulation has begun already, or the folder exists.
            MissingPackage: If the part of radarsim for recordings is not installed.
        """
        record = plugins.load(GROUP, "record")
        if self.robots or self.host.simulation.ticks or self._complete_recording:
            text = "the simulation has begun, expected record() before the first robot"
            raise RecordingError(text)
        self._complete_recording = self._call(
            lambda: record(
                self.host, self._map, self.seed, Path(folder), spectra=spectra
            )
        )

    def serve(
        self, port: int = 3000, address: str = "127.0.0.1", *, speed: float = 1.0
    ) -> tuple[str, int]:
        """Start a server, to which clients connect over TCP, until ``close``.

        From now on simulated time passes by the wall clock, in a background thread, and
        ``step`` waits for it.

        Args:
            port: Port to listen on; 0 for a free one.
            address: Address to listen on.
            speed: Simulated seconds in one second of the wall clock.

        Returns:
            The address and the port on which the server listens.

        Raises:
            ServerError: If the port is taken, or the address is not of this machine.
            ValueError: If the server runs already, the port is invalid, or the speed is
                not above 0.
        """
        check_port(port)
        check_number("speed", speed, above=0.0)
        if self._thread is not None:
            raise ValueError("the simulation is already served, expected close() first")
        thread = ServerThread(self.host, speed=speed, after_tick=self._pass_on)
        try:
            listening = thread.begin(address, port)
        except ExceptionGroup as errors:
            raise errors.exceptions[0] from None
        self._thread = thread
        return listening

    def close(self) -> None:
        """End the recording and the server; the simulation can still be stepped.

        Raises:
            ExceptionGroup: If the server has failed.
            RecordingError: If the recording could not be written completely.
        """
        complete, self._complete_recording = self._complete_recording, None
        if complete is not None:
            self._call(complete)
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.finish()

    def call(self, function: Callable[[Simulation], Value]) -> Value:
        """Call a function that reads the ``Simulation``, between two ticks.

        The function may read all state, but a recording does not contain its changes.
        """
        return self._call(lambda: function(self.host.simulation))

    def receive(self, number: int, data: bytes) -> list[str]:
        """Execute the commands of a client; return why commands had no effect."""
        return [
            each.text for each in self._call(lambda: self.host.receive(number, data))
        ]

    def _call(self, function: Callable[[], Value]) -> Value:
        """Return the result of a function, called in the thread that has the host."""
        return function() if self._thread is None else self._thread.call(function)

    def _find_robot(self, number: int) -> LocalRobot | None:
        """Create the ``LocalRobot`` of a client; return None if no robot spawned."""
        if not self.host.has_robot(number):
            return None
        vehicle = self.host.simulation.vehicles[-1]
        robot = LocalRobot(self, number, vehicle)
        self.robots[robot.name], self._numbers[robot.name] = robot, number
        return robot

    def _pass_on(self) -> None:
        """Pass the bytes of a tick to the robots, and store moments for films."""
        for name, number in self._numbers.items():
            if data := self.host.take(number):
                self.robots[name].add(data)
        if self.host.simulation.ticks % self._interval == 0:
            self._noted.append(self._moment())
            if len(self._noted) > MOST_MOMENTS:
                self._noted = self._noted[1::2]  # drops every second moment
                self._interval *= 2
        with self._ticked:
            self._ticked.notify_all()

    def _moments(self) -> list[Moment]:
        """Return all stored moments of the simulation, and the present moment."""
        now = self._call(self._moment)
        return [*(m for m in self._noted if m.time < now.time), now]

    def _moment(self) -> Moment:
        """Return the present poses of all robots, and newest scans, for pictures."""
        vehicles = self.host.simulation.vehicles
        scans = [scan for robot in self.robots.values() for scan in robot.scans]
        return Moment(
            self.time,
            {v.robot.name: (v.model, v.robot.pose) for v in vehicles},
            [(each.medium, each.points("map").astype(np.float32)) for each in scans],
        )

    def _collect(self) -> None:
        for robot in self.robots.values():
            robot.collect()

    def _wait_until(self, ticks: int) -> None:
        """Wait until the simulation in the server's thread has reached a tick."""
        thread = self._thread
        assert thread is not None
        with self._ticked:
            while self.host.simulation.ticks < ticks:
                if not self._ticked.wait(POLL) and not thread.is_alive():
                    thread.finish()

    def _log(self, number: int, diagnostic: Diagnostic) -> None:
        """Log why a delayed command of a client, such as a spawn, had no effect."""
        if number in self._late_texts:
            self._late_texts[number].append(diagnostic.text)
        for name, each in self._numbers.items():
            if each == number:
                logger.warning("%s: %s", name, diagnostic.text)


def simulate(
    map_: str | Path | Scene,
    *,
    seed: int = 0,
    config: SimulationConfig | None = None,
) -> LocalSimulation:
    """Start a simulation in this process, without a server.

    A loop drives the robots, lets time pass and reads their sensors::

        sim = radarsim.simulate("foliage_room", seed=0)
        robot = sim.spawn("P3AT", start="RobotStart1")
        while sim.time < 10:
            robot.drive(0.4, turn=0.1)  # m/s, rad/s
            sim.step(0.1)  # s
            scan = robot.scan("lms200")  # scan.ranges, scan.angles, scan.points("map")
        print(robot.truth.pose, robot.ins.pose, robot.odometry.pose, robot.touch)

    ``radarsim.shipped_maps()`` lists the maps that come with radarsim, and
    ``radarsim.load_map(name).starts`` lists the start poses of a map. The same seed,
    map and commands give the same numbers as a server.

    Args:
        map_: The name of a shipped map, the path of a map file, or a scene.
        seed: Seed of all random numbers.
        config: Dialect, drive unit, settings of items and classes of robots; None for
            the defaults.

    Raises:
        MapError: If there is no such map, or the map is invalid.
        PresetError: If the configuration does not fit the robot classes.
        TypeError: If an argument is of another type.
        ValueError: If the seed is negative.
    """
    if isinstance(map_, Scene):
        return LocalSimulation(map_, seed=seed, config=config)
    return LocalSimulation(load_map(map_), seed=seed, config=config, map_=str(map_))
