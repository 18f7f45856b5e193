"""The base classes of sensors, and the registry of all sensor classes.

A sensor class is in a module of this folder and defines the item types that it handles,
and their settings. Its readings are reports of ``protocol``. `kinds` finds the classes
by importing all modules of this folder, so no other module lists them. Range scanners,
whose scans are computed in batches, and cameras, which render images, do not use these
base classes.
"""

import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, ClassVar, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel

import radarsim.sensors
from radarsim.engine import engine
from radarsim.geometry import Floats, Pose3
from radarsim.presets.robots import Item
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import LineReport, SensorReport
from radarsim.raycast.rays import SONAR, RayClass, Rays, Traces
from radarsim.robots.robot import Robot
from radarsim.scene.scene import Scene
from radarsim.sensors.readings import Job, RobotState

Reading: Final = engine.enumerations["Reading"]  # described in ``readings.hpp``
SONAR_CLASS: Final = RayClass(SONAR)
# Readings within a tick are in this order of item types; other types follow in the
# order of mounting. Clients expect a pose before the scan of the same time.
_ORDER: Final = (
    *("GroundTruth", "INS", "Odometry", "Tachometer", "Encoder", "Touch", "Accel"),
    *("AcceleroMeter", "IMU", "MisPkg", "AltitudeSensor", "MagneticCompass"),
    *("MissionTime", "Sonar"),
)

# A sample report, and the jobs that compute the numbers of each of its attributes.
Source: TypeAlias = tuple[LineReport, Mapping[str, Sequence[Job]]]
_KINDS: Final[dict[str, "type[Sensor]"]] = {}


class Mounting(NamedTuple):
    """The arguments from which a sensor is created.

    Attributes:
        item: The item of the robot's class.
        settings: Settings of the item, an instance of ``Sensor.settings``.
        robot: The robot that carries the sensor.
        state: The states of all sensors of the robot.
        rng: The random generator of the item.
        scene: The scene of the simulation.
        dialect: The dialect of the reports.
        time: Simulated time at which the robot was spawned, s.
    """

    item: Item
    settings: Any
    robot: Robot
    state: RobotState
    rng: np.random.Generator
    scene: Scene
    dialect: Dialect
    time: float


class Sensor:
    """A sensor of a robot.

    A subclass names the item types that it handles: ``class Thermometer(Sensor,
    types=["Thermometer"])``. It overrides ``read``, and ``rays`` if it casts rays.

    Attributes:
        settings: The model of the settings; None if there are none. The defaults are in
            the model, or with their sources in a file of ``presets/items``.
        is_joined: Whether one sensor reads all items of its type on a robot.
        item: The item of the robot's class; if joined, the first item.
        robot: The robot that carries the sensor.
    """

    settings: ClassVar[type[BaseModel] | None] = None
    is_joined: ClassVar[bool] = False

    def __init_subclass__(cls, types: Sequence[str] = ()) -> None:
        super().__init_subclass__()
        _KINDS.update(dict.fromkeys(types, cls))

    def __init__(self, mounting: Mounting, *_others: Mounting) -> None:
        """Create a sensor for one item, or for all items of a type if ``is_joined``."""
        self.item, self.robot = mounting.item, mounting.robot
        self._rng = mounting.rng

    @property
    def pose(self) -> Pose3:
        """The pose of the sensor, map frame."""
        return self.robot.body.compose(self.item.mount)

    def rays(self) -> Rays:
        """Return the rays that the caller must trace for the next reading, if any."""
        return sight_rays(np.zeros((0, 3)), np.zeros((0, 3)), 0.0)

    def read(self, time: float, traces: Traces) -> Sequence[SensorReport]:
        """Return the readings that are due, if there are any.

        Args:
            time: Simulated time, s.
            traces: Traces of the sensor's rays, with angles of incidence.
        """
        raise NotImplementedError

    def reset(self) -> None:
        """Reset the counters of the sensor to 0; does nothing by default."""

    def draw(self) -> None:
        """Refill the random numbers for later readings; does nothing by default."""


class EngineSensor(Sensor):
    """A sensor without rays; the engine computes the readings of all robots at once.

    The state of the sensor is an array of structures in the row of its robot.

    Attributes:
        source: A sample report, and the jobs that compute its attributes.
    """

    source: Source

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self._state = mounting.state

    def _remember(self, start: NDArray[Any]) -> list[int]:
        """Append a state to the robot's row; return the columns of its structures."""
        self._dtype, self._places = start.dtype, self._state.add(start)
        return list(range(self._places.start, self._places.stop, start.itemsize // 8))

    @property
    def _memory(self) -> NDArray[Any]:
        """The state of this sensor as a view, which is valid until the table grows."""
        return self._state[self._places].view(self._dtype)

    def _report(self, sample: LineReport, **jobs: Sequence[Job]) -> None:
        """Set the sample report, and the jobs for all of its attributes except time."""
        self.source = sample, {"time": [Job(Reading.TIME)], **jobs}


def sight_rays(
    origins: Floats,
    directions: Floats,
    max_range: ArrayLike,
    carrier_id: ArrayLike = -1,
) -> Rays:
    """Return rays that end at surfaces that stop robots or light.

    Args:
        origins: (N, 3) m, map frame.
        directions: (N, 3) unit vectors, map frame.
        max_range: Length of the rays, m, as one number or (N,).
        carrier_id: Id of the box that does not stop the rays, since it is the robot's
            own, as one number or (N,); -1 for none.
    """
    return Rays.uniform(
        origins,
        directions,
        max_range=max_range,
        carrier_id=carrier_id,
        ray_classes=(SONAR_CLASS,),
    )


def rank(item_type: str) -> int:
    """Return the position of an item type in the order of readings within a tick."""
    return _ORDER.index(item_type) if item_type in _ORDER else len(_ORDER)


@cache
def kinds() -> Mapping[str, type[Sensor]]:
    """Import all sensors, and return the sensor class of each item type."""
    for module in pkgutil.iter_modules(radarsim.sensors.__path__):
        importlib.import_module(f"radarsim.sensors.{module.name}")
    return _KINDS
