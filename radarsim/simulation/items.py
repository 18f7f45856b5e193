"""The items of a robot besides its scanners.

What the items that cast no rays read is computed for all robots together: an item has
jobs for that, and a state in the row of its robot. The rays of all sonars and GPS
receivers that are due in a tick are traced together.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.presets.robots import Item
from radarsim.presets.sensor_settings import InsNoise
from radarsim.protocol import packages, reports
from radarsim.protocol.fields import LineReport, SensorReport
from radarsim.protocol.packages import LinkOrder
from radarsim.protocol.reports import (
    Encoder,
    GroundTruth,
    Ins,
    Odometry,
    PackageState,
    Tachometer,
    Touch,
)
from radarsim.raycast.rays import Rays, Traces
from radarsim.robots.robot import Robot
from radarsim.sensors.gps import Gps
from radarsim.sensors.motion_readings import (
    DRAWN_AHEAD,
    ENCODER,
    INS,
    draw_drift,
    draw_errors,
    encoded_wheels,
    new_encoders,
    new_ins,
    overwrite_ins,
)
from radarsim.sensors.sonar import SonarArray
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.readings import (
    ACCELERATION,
    ALTITUDES,
    BODY_POSE,
    DRIFT,
    HEADING,
    INERTIA,
    INS_POSE,
    LEFT_ANGLE,
    LEFT_SPEED,
    LINK_ANGLE,
    MINUTES,
    PROPER_ACCELERATION,
    RIGHT_ANGLE,
    RIGHT_SPEED,
    TICKS,
    TIME,
    TOUCHED,
    WHEEL_POSE,
    Job,
    RobotState,
)

_TACHOMETER: Final = engine.rows["Tachometer"]
_ACCELEROMETER: Final = engine.rows["Accelerometer"]
_LINK: Final = engine.rows["Link"]
FAR: Final = 1e6  # rad; where a link without limits turns to that is told a speed


@dataclass(frozen=True, slots=True)
class Mounting:
    """What a sensor item is created from.

    Attributes:
        item: The item of the robot's class.
        robot: The robot that carries it.
        state: What the sensors of the robot remember.
        rng: The item's own random numbers.
        config: Configuration of the simulation.
        time: Time of the spawn, s.
    """

    item: Item
    robot: Robot
    state: RobotState
    rng: np.random.Generator
    config: SimulationConfig
    time: float


class Source(NamedTuple):
    """Where the numbers of a report come from.

    Attributes:
        sample: The report with any numbers.
        jobs: What computes the numbers of each attribute that has some.
    """

    sample: LineReport
    jobs: Mapping[str, Sequence[Job]]


class SensorItem:
    """An item whose readings follow from its robot and what it remembers.

    Attributes:
        name: Name of the item.
        robot: The robot that carries it.
        source: Its report, and what computes it.
    """

    source: Source

    def __init__(self, mounting: Mounting) -> None:
        self.name = mounting.item.name
        self.robot = mounting.robot
        self._state = mounting.state
        self._rng = mounting.rng

    def _report(self, sample: LineReport, **jobs: Sequence[Job]) -> None:
        """Set the source: the jobs of each attribute besides the time."""
        self.source = Source(sample, {"time": [Job(TIME)], **jobs})

    def reset(self) -> None:
        """Start counting again, if it counts."""

    def draw(self) -> None:
        """Draw random numbers, if it needs some and they are used up."""


class GroundTruthItem(SensorItem):
    """Reads the true pose of the robot's body."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        sample = GroundTruth(0.0, self.name, self.robot.body)
        self._report(sample, pose=[Job(BODY_POSE)])


class TouchItem(SensorItem):
    """Reads whether something touches the robot."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self._report(Touch(0.0, self.name, touched=False), touched=[Job(TOUCHED)])


class InsItem(SensorItem):
    """Reads the drifting pose of an inertial navigation system.

    Attributes:
        drift: What lets it drift; due every ``INS_DRIFT_INTERVAL``.
    """

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        body = self.robot.body
        sensor = body.compose(mounting.item.mount)
        noise = InsNoise.from_settings(mounting.config.settings(mounting.item))
        self._places = self._state.add(new_ins(sensor, body, noise, self._rng))
        place = self._places.start
        self._report(Ins(0.0, self.name, body), pose=[Job(INS_POSE, place)])
        self.drift = Job(DRIFT, place)

    def draw(self) -> None:
        """Draw random numbers for the drift, if they are used up."""
        if self._ins["used"] >= DRAWN_AHEAD:
            draw_drift(self._ins, self._rng)

    def overwrite(self, pose: Pose3) -> None:
        """Replace the estimated pose."""
        overwrite_ins(self._ins, pose, self.robot.body)

    @property
    def _ins(self) -> NDArray[Any]:
        return self._state[self._places].view(INS)


class OdometryItem(SensorItem):
    """Reads the pose that follows from the turns of the wheels."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self._odometry = self.robot.fleet.add_odometry(self.robot)
        place = self._state.add(np.array([float(self._odometry.row)])).start
        sample = Odometry(0.0, self.name, Pose2(0.0, 0.0))
        self._report(sample, pose=[Job(WHEEL_POSE, place)])

    def reset(self) -> None:
        """Start again from a pose of zeros."""
        self._odometry.reset()


class TachometerItem(SensorItem):
    """Reads speeds and angles of the wheels."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        start = np.zeros(1, _TACHOMETER)
        start["read_at"] = mounting.time
        start["angles"] = start["zero"] = self.robot.side_angles
        self._places, sides = self._state.add(start), self.robot.model.wheels
        zeros, place = (0.0,) * len(sides), self._places.start
        speeds = {"left": LEFT_SPEED, "right": RIGHT_SPEED}
        angles = {"left": LEFT_ANGLE, "right": RIGHT_ANGLE}
        self._report(
            Tachometer(0.0, self.name, velocities=zeros, positions=zeros),
            velocities=[Job(speeds[side], place) for side in sides],
            positions=[Job(angles[side], place) for side in sides],
        )

    def reset(self) -> None:
        """Count angles from zero again."""
        self._state[self._places].view(_TACHOMETER)["zero"] = self.robot.side_angles


class EncoderItem(SensorItem):
    """Reads ticks of the wheels that are in the item's name."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        sides = self.robot.model.wheels
        wheels = encoded_wheels(self.name, sides)
        are_right = [int(sides[wheel.index] == "right") for wheel in wheels]
        start = new_encoders(are_right, self._rng)
        start["sign"] = [wheel.sign for wheel in wheels]
        self._places = self._state.add(start)
        self.reset()
        self._report(
            Encoder(0.0, tuple((wheel.name, 0) for wheel in wheels)),
            ticks=_jobs(TICKS, self._places, ENCODER),
        )

    def reset(self) -> None:
        """Count ticks from zero again."""
        encoders = self._state[self._places].view(ENCODER)
        left, right = self.robot.side_angles
        encoders["zero"] = np.where(encoders["side"], right, left)

    def draw(self) -> None:
        """Draw random numbers for the errors, if they are used up."""
        encoders = self._state[self._places].view(ENCODER)
        if (encoders["used"] >= DRAWN_AHEAD).any():
            draw_errors(encoders, self._rng)


class AccelerationItem(SensorItem):
    """Reads accelerations: an accelerometer, or an inertial measurement unit."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        start = np.zeros(1, _ACCELEROMETER)
        start["axes"] = mounting.item.mount.rotation().T.ravel()
        start["read_at"] = mounting.time
        start["attitude"] = 0.0, 0.0, self.robot.pose.yaw
        kind, report, others = _ACCELERATIONS[mounting.item.type]
        sample = report(0.0, self.name, *[(0.0, 0.0, 0.0)] * (1 + len(others)))
        job = Job(kind, self._state.add(start).start)
        # The job of the first attribute writes the numbers of all of them.
        self._report(sample, acceleration=[job], **dict.fromkeys(others, ()))


# By item type: kind of the job, the report, its attributes besides the acceleration.
_Reading: TypeAlias = tuple[int, Callable[..., SensorReport], Sequence[str]]
_ACCELERATIONS: Final[dict[str, _Reading]] = {
    "Accel": (ACCELERATION, reports.Acceleration, ()),
    "AcceleroMeter": (PROPER_ACCELERATION, reports.ProperAcceleration, ()),
    "IMU": (INERTIA, reports.Imu, ("rates", "rate_changes", "angles")),
}


class AltitudeItem(SensorItem):
    """Reads how high the robot is above its spawn, and above the sea."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        place = self._state.add(np.array([self.robot.body.z])).start
        sample = reports.Altitude(0.0, self.name, 0.0, 0.0)
        # The job of the first attribute writes the numbers of both.
        self._report(sample, above_start=[Job(ALTITUDES, place)], above_sea=())


class CompassItem(SensorItem):
    """Reads the heading of the robot."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self._report(reports.Compass(0.0, self.name, 0.0), heading=[Job(HEADING)])


class MissionTimeItem(SensorItem):
    """Counts the minutes since the spawn."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        place = self._state.add(np.array([round(100 * mounting.time)], float)).start
        sample = reports.MissionTime(0.0, self.name, 0)
        self._report(sample, minutes=[Job(MINUTES, place)])


class PackageItem(SensorItem):
    """A mission package: links that turn at their speeds to where they are told.

    Attributes:
        links: The links of the item.
    """

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self.links, self._mount = mounting.item.links, mounting.item.mount
        start = np.zeros(len(self.links), _LINK)
        angles = [link.limit(0.0) for link in self.links]
        start["from_angle"] = start["to_angle"] = angles
        self._places = self._state.add(start)
        torques = [-link.max_torque for link in self.links]
        states = tuple(zip(angles, torques, strict=True))
        self._report(
            PackageState(0.0, self.name, states),
            links=_jobs(LINK_ANGLE, self._places, _LINK),
        )

    def tip(self, ticks: int) -> Pose3:
        """Return the pose of its last link in the body frame.

        Args:
            ticks: Simulated time in ticks.
        """
        pose = self._mount
        for number, link in enumerate(self.links):
            angle = engine.angle_of_link(self._link(number), ticks)
            pose = pose.compose(link.turned(angle))
        return pose

    def move(self, number: int, order: LinkOrder, ticks: int) -> None:
        """Tell a link to move from now on; an order that is not known does nothing.

        Args:
            number: Number of the link, from 0 on.
            order: What it is told.
            ticks: Simulated time in ticks.
        """
        link, state = self.links[number], self._link(number)
        angle = engine.angle_of_link(state, ticks)
        speed = link.max_speed
        if order.order in (packages.ABSOLUTE, packages.BANG_BANG):
            target = order.value
        elif order.order == packages.RELATIVE:
            target = angle + order.value
        elif order.order == packages.RATE:
            target = math.copysign(FAR, order.value)
            speed = min(abs(order.value), speed)
        else:
            return
        state["from_angle"], state["from_tick"] = angle, ticks
        state["to_angle"], state["speed"] = link.limit(target), speed

    def _link(self, number: int) -> NDArray[Any]:
        return self._state[self._places].view(_LINK)[number : number + 1]


def _jobs(kind: int, places: slice, dtype: np.dtype[np.void]) -> list[Job]:
    """Return a job for each of some structures."""
    return [
        Job(kind, at) for at in range(places.start, places.stop, dtype.itemsize // 8)
    ]


def join_encoders(sources: Iterable[Source]) -> list[Source]:
    """Return the sources of reports, with one report of neighbouring encoders."""
    joined: list[Source] = []
    for source in sources:
        before = joined[-1] if joined else source
        one, other = before.sample, source.sample
        # Clients of the older servers read the encoders of both sides from one line.
        if joined and isinstance(one, Encoder) and isinstance(other, Encoder):
            ticks = [*before.jobs["ticks"], *source.jobs["ticks"]]
            sample = replace(one, ticks=(*one.ticks, *other.ticks))
            joined[-1] = Source(sample, {**before.jobs, "ticks": ticks})
        else:
            joined.append(source)
    return joined


# By item type, in the order of readings within a tick: clients expect a pose before the
# scan that belongs to it.
SENSOR_ITEMS: dict[str, Callable[[Mounting], SensorItem]] = {
    "GroundTruth": GroundTruthItem,
    "INS": InsItem,
    "Odometry": OdometryItem,
    "Tachometer": TachometerItem,
    "Encoder": EncoderItem,
    "Touch": TouchItem,
    **dict.fromkeys(_ACCELERATIONS, AccelerationItem),
    "MisPkg": PackageItem,
    "AltitudeSensor": AltitudeItem,
    "MagneticCompass": CompassItem,
    "MissionTime": MissionTimeItem,
}


class RayItem(Protocol):
    """An item, or several that are due together, that reads by casting rays.

    Attributes:
        item: The item, or the first of them.
    """

    item: Item

    def rays(self) -> Rays:
        """Return its rays."""
        ...

    def read(self, time: float, traces: Traces) -> tuple[SensorReport, ...]:
        """Return the readings at a simulated time in s."""
        ...


class SonarItems:
    """All sonars of a robot."""

    def __init__(
        self,
        items: Sequence[Item],
        robot: Robot,
        config: SimulationConfig,
        *,
        carrier_id: int,
    ) -> None:
        """Create the sonars; ``carrier_id`` is the id of the robot's box."""
        self.item = items[0]
        self._robot = robot
        self._joined = config.dialect.joins_sonars
        self._names = [item.name for item in items]
        self._array = SonarArray(
            [item.mount for item in items],
            [config.sonar_settings(item) for item in items],
            carrier_id,
        )

    def rays(self) -> Rays:
        """Return the rays of all cones."""
        return self._array.rays(self._robot.body)

    def read(self, time: float, traces: Traces) -> tuple[SensorReport, ...]:
        """Return all ranges in one report, or one report for each sonar."""
        ranges = self._array.ranges(traces).tolist()
        named = tuple(zip(self._names, ranges, strict=True))
        if self._joined:
            return (reports.Sonar(time, named),)
        return tuple(reports.Sonar(time, (each,)) for each in named)


class GpsItem:
    """A GPS receiver."""

    def __init__(
        self, mounting: Mounting, origin: tuple[float, float], *, carrier_id: int
    ) -> None:
        """Create the receiver.

        Args:
            mounting: What items are created from.
            origin: Latitude and longitude of the map's origin, degrees.
            carrier_id: Id of the robot's box.
        """
        self.item = mounting.item
        self._robot = mounting.robot
        self._offset = mounting.item.mount.position()
        settings = mounting.config.gps_settings(mounting.item)
        self._gps = Gps(origin, settings, mounting.rng, carrier_id)

    def rays(self) -> Rays:
        """Return a ray to each satellite."""
        return self._gps.rays(self._place())

    def read(self, time: float, traces: Traces) -> tuple[SensorReport, ...]:
        """Return a reading."""
        fix = self._gps.fix(self._place(), traces)
        return (reports.Gps(time, self.item.name, fix.position, fix.satellites),)

    def _place(self) -> Floats:
        body = self._robot.body
        return body.position() + body.rotation() @ self._offset
