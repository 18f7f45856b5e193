"""A simulated robot that a program drives and reads by method calls.

The robot is a client of a host, like the clients of a server: commands are encoded as
lines, and readings are decoded from lines. Values are therefore the same as over TCP.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import (
    TYPE_CHECKING,
    Any,
    Final,
    Literal,
    NoReturn,
    TypeAlias,
    TypeVar,
    cast,
)

import numpy as np

from radarsim import plugins
from radarsim.client import Client, RobotInfo
from radarsim.client import session as requests
from radarsim.client.requests import check_kind
from radarsim.client.robot_info import ScannerDescriptions, no_return
from radarsim.client.robot_state import EchoCollector
from radarsim.client.session import RANGE_SCANNER, ROBOT, Session
from radarsim.errors import ClientError, expected_one_of
from radarsim.geometry import Floats, Pose2
from radarsim.protocol.reports import (
    EchoLine,
    GroundTruth,
    Ins,
    Odometry,
    RadarTargets,
    RangeScan,
    Report,
    RobotConf,
    RobotGeo,
    TargetEchoes,
    Touch,
    decode_report,
)
from radarsim.server.host.connection import SendQueue
from radarsim.server.host.lockstep import receive_stepwise
from radarsim.server.host.replies import configuration, geometry
from radarsim.simulation.clock import TICK
from radarsim.validation import check_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from radarsim.local.simulation import LocalSimulation
    from radarsim.simulation.config import SimulationConfig
    from radarsim.simulation.vehicle import Vehicle

AnyReport = TypeVar("AnyReport", bound=Report)

GROUP: Final = "radarsim.local"  # entry point group of plugins
MOST_REPORTS: Final = 10_000


Frame: TypeAlias = Literal["scanner", "robot", "map", "ins", "odometry"]

CENTRE: Final = Pose2(0.0, 0.0)


class LocalScan(RangeScan, eq=False):
    """A scan as clients receive it, together with the robot's poses at that time.

    Attributes:
        medium: Sensor type, ``radar`` or ``laser``.
        max_range: Range of a beam without return, m.
        mount: Pose of the scanner on the robot.
        poses: Poses of the robot at the time of the scan, by frame.
        echoes: Echoes of the beams, one entry for each object; None if echoes were not
            requested.
        targets: Targets of the detector; None for a scanner without a detector, or if
            targets were not requested.
    """

    medium: str
    max_range: float
    mount: Pose2
    poses: Mapping[str, Pose2]
    echoes: Sequence[TargetEchoes] | None
    targets: Sequence[RadarTargets] | None

    def points(self, frame: Frame = "robot") -> Floats:
        """Return the points that the scan has hit, (N, 2) m, from right to left.

        Args:
            frame: ``scanner``, ``robot``, or ``map``, which uses the true pose. ``ins``
                and ``odometry`` use the last reported poses of these sensors, in the
                map frame and relative to the spawn pose.

        Raises:
            ValueError: If there is no such frame, or the robot has no such sensor.
        """
        if frame == "scanner":
            pose = CENTRE
        elif frame in self.poses:
            pose = self.poses[frame].compose(self.mount)
        else:
            known = ["scanner", *self.poses]
            raise ValueError(f"frame {expected_one_of(frame, known)}")
        returned = self.ranges < no_return(self.max_range)
        angles, ranges = self.angles[returned] + pose.yaw, self.ranges[returned]
        ahead, aside = ranges * np.cos(angles), ranges * np.sin(angles)
        return np.column_stack([pose.x + ahead, pose.y + aside])


class LocalTransport:
    """The connection between a ``Client`` and a robot in this process.

    Attributes:
        unread: Bytes that the client has not read yet.
    """

    def __init__(self, robot: LocalRobot) -> None:
        self.unread = SendQueue()
        self._robot = robot

    def time(self) -> float:
        """Return the simulated time, s, by which the client measures timeouts."""
        return self._robot.simulation.time

    def send(self, data: bytes) -> None:
        """Send commands to the robot; ignored commands raise no error."""
        with suppress(ClientError):
            self._robot.send(data)

    def receive(self, timeout: float) -> bytes:
        """Return bytes for the client; let simulated time pass until there are some.

        Args:
            timeout: Longest wait, s of simulated time.

        Raises:
            TimeoutError: If no bytes arrive in time.
        """
        simulation = self._robot.simulation
        return receive_stepwise(
            # The buffer is read between two ticks, because the thread of the server
            # may write to it.
            lambda: simulation.call(lambda _: self.unread.take()),
            lambda: simulation.step(TICK),
            timeout,
        )

    def close(self) -> None:
        """Do nothing: the robot stays in the simulation."""


class LocalRobot:
    """A robot of a simulation in this process.

    ``LocalSimulation.spawn`` creates it. Its readings are reports of
    ``radarsim.protocol.reports``, rounded as in the protocol: in metres, radians and
    seconds, x forward, y left, yaw counter-clockwise.

    Attributes:
        simulation: The simulation of the robot.
        reports: Reports from the last call of ``step``, in order; at most the last
            ``MOST_REPORTS``.
    """

    def __init__(
        self, simulation: LocalSimulation, client: int, vehicle: Vehicle
    ) -> None:
        """Create the interface of a robot that has been spawned.

        Args:
            simulation: The simulation of the robot.
            client: Number of the robot's client at the host.
            vehicle: The robot in the simulation.
        """
        self.simulation = simulation
        self.reports: list[Report] = []
        self._client, self._vehicle = client, vehicle
        self._session = Session()
        self._info: tuple[SimulationConfig, RobotInfo] | None = None
        self._came: list[Report] = []
        self._newest: dict[type, dict[str, Report]] = {}
        self._echoes: dict[str, EchoCollector] = {}
        self._targets: dict[str, list[RadarTargets]] = {}
        self._turns: dict[str | None, Any] = {}
        self._transport: LocalTransport | None = None

    def __reduce__(self) -> NoReturn:
        self.simulation.__reduce__()

    def __repr__(self) -> str:
        pose = self.pose
        place = f"({pose.x:.2f}, {pose.y:.2f}, {pose.yaw:.2f})"
        return f"<LocalRobot {self.name}: {self._vehicle.model.name} at {place}>"

    @property
    def name(self) -> str:
        """The unique name of the robot in the simulation."""
        return self._vehicle.robot.name

    @property
    def number(self) -> int:
        """The unique number of the robot in the simulation."""
        return self._vehicle.number

    @property
    def pose(self) -> Pose2:
        """The true pose of the robot in the map frame, without rounding."""
        return self._vehicle.robot.pose

    @property
    def info(self) -> RobotInfo:
        """Dimensions, limits and scanners of the robot, rounded as by a server."""
        model, config = self._vehicle.model, self._vehicle.config
        if self._info is not None and self._info[0] is config:
            return self._info[1]
        descriptions = ScannerDescriptions()
        answers = []
        for kind in (ROBOT, RANGE_SCANNER):
            for report in (
                geometry(model, kind, None),
                configuration(model, config, kind, None),
            ):
                # Encoding and decoding a report rounds its numbers as a server does.
                line = "" if report is None else report.encode(self._vehicle.dialect)
                answer = decode_report(line) if line else None
                if answer is not None:
                    descriptions.add(answer)
                    answers.append(answer)
        geo, conf = answers[:2]
        assert isinstance(geo, RobotGeo)
        assert isinstance(conf, RobotConf)
        unit = config.wheel_unit
        info = RobotInfo.from_reports(geo, conf, descriptions.scanners({}), unit)
        self._info = config, info
        return info

    @property
    def truth(self) -> GroundTruth:
        """The newest ground truth report, which contains the true pose."""
        return self.newest(GroundTruth)

    @property
    def ins(self) -> Ins:
        """The newest pose report of the inertial navigation system, which drifts."""
        return self.newest(Ins)

    @property
    def odometry(self) -> Odometry:
        """The newest report of wheel odometry: the pose relative to the spawn pose."""
        return self.newest(Odometry)

    @property
    def touch(self) -> Touch:
        """The newest report of the touch sensor; ``touched`` tells if it is pressed."""
        return self.newest(Touch)

    @property
    def scans(self) -> list[LocalScan]:
        """The newest scan of each scanner of the robot that has made a scan."""
        return cast(list[LocalScan], list(self._newest.get(LocalScan, {}).values()))

    def scan(self, scanner: str | None = None) -> LocalScan:
        """Return the newest scan of one scanner of the robot.

        Args:
            scanner: Name of the scanner, in any case; None for the first scanner.

        Raises:
            ClientError: If the robot has no such scanner, or it has not scanned yet.
        """
        return self.newest(LocalScan, self.info.scanner(scanner).name)

    def newest(self, kind: type[AnyReport], name: str | None = None) -> AnyReport:
        """Return the robot's newest report of a class, such as ``Tachometer``.

        Args:
            kind: A class of ``radarsim.protocol.reports``.
            name: Name of the item, in any case; None for any item.

        Raises:
            ClientError: If no such report has arrived yet.
            TypeError: If the kind is no class.
        """
        check_kind(kind)
        # The readings are copied, as the server's thread may add readings meanwhile.
        known = dict(self._newest.get(LocalScan if kind is RangeScan else kind, {}))
        if name is not None:
            known = {k: v for k, v in known.items() if k.casefold() == name.casefold()}
        if not known:
            reported = RangeScan if kind is LocalScan else kind
            of = "" if name is None else f" of {name!r}"
            came = sorted({each.__name__ for each in self._newest} - {"LocalScan"})
            text = f"robot {self.name!r} has reported no {reported.__name__}{of}"
            hint = f"only {came}" if came else "expected a call of step() first"
            raise ClientError(f"{text} until {self.simulation.time:.2f} s, {hint}")
        return cast(AnyReport, list(known.values())[-1])

    def drive(self, speed: float, turn: float = 0.0) -> None:
        """Set the speed and the turn rate of the robot until the next drive command.

        If a wheel would exceed its maximum speed, both sides are slowed down by the
        same factor. A car is limited by its steering angle, and cannot turn on the
        spot.

        Args:
            speed: Forward speed, m/s.
            turn: Counter-clockwise turn rate, rad/s.

        Raises:
            ClientError: If the robot has been removed.
            TypeError: If an argument is no number.
            ValueError: If an argument is not finite.
        """
        check_number("speed in m/s", speed)
        check_number("turn in rad/s", turn)
        self._drive(*self.info.wheel_speeds(speed, turn))

    def drive_wheels(self, left: float, right: float) -> None:
        """Set the speeds of left and right wheels until the next drive command.

        Args:
            left: Speed of the left wheels, rad/s; forward is positive.
            right: Speed of the right wheels, rad/s.

        Raises:
            ClientError: If the robot has been removed.
            TypeError: If an argument is no number.
            ValueError: If an argument is not finite.
        """
        check_number("left in rad/s", left)
        check_number("right in rad/s", right)
        scale = self.info.drive_scale
        self._drive(left * scale, right * scale)

    def _drive(self, left: float, right: float) -> None:
        """Command wheel speeds in drive units; a car gets speed and steering angle."""
        model, car = self._vehicle.model, None
        if model.steering is not None:
            car = cast(RobotGeo, geometry(model, ROBOT, None))
        self.send(requests.drive(left, right, car))

    def fly(
        self, ahead: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0
    ) -> None:
        """Set the velocity of a drone until the next call; only in dialect ``compat``.

        Args:
            ahead: Forward speed, m/s; all speeds are limited to the robot's maxima.
            left: Speed to the left, m/s.
            up: Speed upwards, m/s.
            turn: Counter-clockwise turn rate, rad/s.

        Raises:
            ClientError: If the robot has been removed.
            TypeError: If an argument is no number.
            ValueError: If an argument is not finite.
        """
        for name, speed in (("ahead", ahead), ("left", left), ("up", up)):
            check_number(f"{name} in m/s", speed)
        check_number("turn in rad/s", turn)
        self.send(requests.fly(ahead, left, up, turn))

    def stop(self) -> None:
        """Stop the wheels of the robot."""
        self.drive_wheels(0.0, 0.0)

    def request_echoes(self, scanner: str | None = None, on: bool = True) -> None:
        """Request the echoes of a scanner; later scans have them in ``echoes``.

        Raises:
            ClientError: If the robot has no such scanner.
        """
        self.send(requests.echoes(self.info.scanner(scanner).name, on))

    def request_targets(self, scanner: str | None = None, on: bool = True) -> None:
        """Request the targets of a radar; later scans have them in ``targets``.

        Raises:
            ClientError: If the robot has no such scanner, or it has no detector.
        """
        name = self.info.scanner(scanner).name
        (mounted,) = (m for m in self._vehicle.scanners if m.item.name == name)
        if not mounted.scanner.settings.has_detector:
            text = f"scanner {name!r} has no detector, expected one such as"
            raise ClientError(f"{text} that of a P3AT_Navtech")
        self.send(requests.targets(name, on))

    def request_spectra(self, scanner: str | None = None) -> None:
        """Request the spectra of an FMCW radar; ``spectrum`` returns the newest one.

        Only one radar of a simulation rotates: that of the first spawned robot.

        Args:
            scanner: Name of the radar, in any case; None for the first radar.

        Raises:
            ClientError: If the robot has no such radar.
            MissingPackage: If the part of radarsim for FMCW radars is not installed.
        """
        collect = plugins.load(GROUP, "spectra")
        self._turns[scanner and scanner.casefold()] = self.simulation.call(
            lambda simulation: collect(simulation, self._vehicle, scanner)
        )

    def spectrum(self, scanner: str | None = None) -> Any:
        """Return the spectrum of the newest complete revolution of an FMCW radar.

        Args:
            scanner: Name of the radar, as in ``request_spectra``.

        Returns:
            A spectrum, as returned by ``load_sensor(...).fmcw.spectrum``: ``angles``,
            ``ranges`` and ``decibels``.

        Raises:
            ClientError: If the spectrum was not requested, or no revolution is complete
                yet.
        """
        turns = self._turns.get(scanner and scanner.casefold())
        if turns is None or turns.newest is None:
            radar = "a radar" if scanner is None else repr(scanner)
            text = f"robot {self.name!r} has no revolution of {radar} yet"
            raise ClientError(f"{text}, expected request_spectra() 0.5 s before")
        return turns.newest

    def camera(
        self, *, width: int = 640, height: int = 480, fov_deg: float | None = None
    ) -> NDArray[np.uint8]:
        """Return a picture of the robot's camera with a given size in pixels.

        Args:
            width: Width in pixels.
            height: Height in pixels.
            fov_deg: Horizontal field of view, degrees; None for that of the camera.

        Returns:
            RGB pixels, (height, width, 3).

        Raises:
            ValueError: If the picture has no pixels, or the angle is not below 180
                degrees.
        """
        from radarsim.server.views import FOV_DEG, MOUNT  # noqa: PLC0415

        vehicle, angle = self._vehicle, FOV_DEG
        pose = vehicle.robot.body.compose(MOUNT)
        if vehicle.cameras:
            camera = vehicle.cameras[0]
            pose, angle = vehicle.camera_pose(camera), vehicle.fovs[camera.name]
        angle = angle if fov_deg is None else fov_deg
        size = {"width": width, "height": height}
        return self.simulation.camera(pose, **size, fov_deg=angle, carrier=self)

    def as_client(self) -> Client:
        """Return a ``Client`` that drives this robot, as a navigator needs.

        The client receives the reports of the robot from now on, and simulated time
        passes while it waits. A client from an earlier call receives no further
        reports.
        """
        self._transport = LocalTransport(self)
        return Client(self._transport)

    def remove(self) -> None:
        """Remove the robot from the simulation."""
        self.simulation.remove(self)

    def send(self, data: bytes) -> None:
        """Send whole lines of the protocol as commands of this robot's client.

        Raises:
            ClientError: If a line has no effect, with the reason in the message, or if
                the robot has been removed.
        """
        if self.simulation.robots.get(self.name) is not self:
            raise ClientError(f"robot {self.name!r} was removed from the simulation")
        texts = self.simulation.receive(self._client, data)
        if texts:
            raise ClientError("; ".join(texts))

    def add(self, data: bytes) -> None:
        """Decode bytes that the simulation sends to this robot's client."""
        if self._transport is not None:
            self._transport.unread.put_readings(data)
        for report in self._session.receive(data):
            self._add(report)
            self._came.append(report)
        del self._came[:-MOST_REPORTS]

    def collect(self) -> None:
        """Put new reports into ``reports``; the simulation calls it after a step."""
        self.reports, self._came = self._came, []

    def _add(self, report: Report) -> None:
        name = getattr(report, "name", "")
        match report:
            case EchoLine():
                self._echoes.setdefault(name, EchoCollector()).take(report)
            case RadarTargets():
                turn = self._targets.setdefault(name, [])
                if turn and turn[0].time != report.time:
                    turn.clear()
                turn.append(report)
            case RangeScan():
                report = self._locate(report)
            case _:
                pass
        self._newest.setdefault(type(report), {})[name] = report

    def _locate(self, scan: RangeScan) -> LocalScan:
        """Add the present poses of the robot, its echoes and targets to a new scan."""
        (mounted,) = (m for m in self._vehicle.scanners if m.item.name == scan.name)
        mount, echoes = mounted.item.mount, self._echoes.get(scan.name)
        targets = self._targets.get(scan.name)
        poses = {"robot": CENTRE, "map": self.pose}
        for frame, kind in (("ins", Ins), ("odometry", Odometry)):
            for report in self._newest.get(kind, {}).values():
                assert isinstance(report, Ins | Odometry)
                reported = report.pose
                poses[frame] = Pose2(reported.x, reported.y, reported.yaw)
        return LocalScan(
            **vars(scan),
            medium=mounted.scanner.settings.medium,
            max_range=mounted.scanner.settings.max_range,
            mount=Pose2(mount.x, mount.y, mount.yaw),
            poses=poses,
            echoes=None if echoes is None else echoes.of(scan),
            targets=tuple(targets) if targets else None,
        )
