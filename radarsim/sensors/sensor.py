"""What all kinds of sensors have in common, and where they are found.

A kind of sensor is a class in a module of this folder, with the types of its items and
their settings. What it reads is a report in ``protocol``. Nothing else names it: all
modules of the folder are imported to find the kinds. Range scanners, whose scans are
taken in batches, and cameras, which draw pictures, are no kinds of this sort.
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

Reading: Final = engine.enumerations["Reading"]  # ``readings.hpp`` describes them
SONAR_CLASS: Final = RayClass(SONAR)
# Types of items in the order of readings within a tick; others follow as mounted.
# Clients expect a pose before the scan that belongs to it.
_ORDER: Final = (
    *("GroundTruth", "INS", "Odometry", "Tachometer", "Encoder", "Touch", "Accel"),
    *("AcceleroMeter", "IMU", "MisPkg", "AltitudeSensor", "MagneticCompass"),
    *("MissionTime", "Sonar"),
)

# A report with any numbers, and what computes those of each attribute that has some.
Source: TypeAlias = tuple[LineReport, Mapping[str, Sequence[Job]]]
_KINDS: Final[dict[str, "type[Sensor]"]] = {}


class Mounting(NamedTuple):
    """What a sensor is created from.

    Attributes:
        item: The item of the robot's class.
        settings: Its settings, of the model of its kind.
        robot: The robot that carries it.
        state: What the sensors of the robot remember.
        rng: The item's own random numbers.
        scene: What it looks at.
        dialect: The dialect of its reports.
        time: Time of the spawn, s.
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

    Its class has the types of items that are of this kind: ``class Thermometer(Sensor,
    types=["Thermometer"])``. It overrides ``read``, and ``rays`` if it casts some.

    Attributes:
        settings: The model of its settings; None if it has none. The defaults are in
            the model, or with their sources in a file of ``presets/items``.
        is_joined: Whether one sensor reads all items of its type on a robot.
        item: The item of the robot's class, or the first of them.
        robot: The robot that carries it.
    """

    settings: ClassVar[type[BaseModel] | None] = None
    is_joined: ClassVar[bool] = False

    def __init_subclass__(cls, types: Sequence[str] = ()) -> None:
        super().__init_subclass__()
        _KINDS.update(dict.fromkeys(types, cls))

    def __init__(self, mounting: Mounting, *_others: Mounting) -> None:
        """Create a sensor from its item, or from all of them if these are joined."""
        self.item, self.robot = mounting.item, mounting.robot
        self._rng = mounting.rng

    @property
    def pose(self) -> Pose3:
        """Its pose, map frame."""
        return self.robot.body.compose(self.item.mount)

    def rays(self) -> Rays:
        """Return the rays that a reading needs; they are traced with all others."""
        return sight_rays(np.zeros((0, 3)), np.zeros((0, 3)), 0.0)

    def read(self, time: float, traces: Traces) -> Sequence[SensorReport]:
        """Return the readings that are due, if there are any.

        Args:
            time: Simulated time, s.
            traces: Of its rays, with their angles of incidence.
        """
        raise NotImplementedError

    def reset(self) -> None:
        """Start counting again, if it counts."""

    def draw(self) -> None:
        """Draw random numbers ahead, if it needs some and they are used up."""


class EngineSensor(Sensor):
    """A sensor without rays that the engine reads, together with those of all robots.

    What it remembers are structures of numbers in the row of its robot.

    Attributes:
        source: Its report, and what computes it.
    """

    source: Source

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self._state = mounting.state

    def _remember(self, start: NDArray[Any]) -> list[int]:
        """Remember numbers, or structures of some; return the place of each."""
        self._dtype, self._places = start.dtype, self._state.add(start)
        return list(range(self._places.start, self._places.stop, start.itemsize // 8))

    @property
    def _memory(self) -> NDArray[Any]:
        """What it remembers, as a view that is not to be kept."""
        return self._state[self._places].view(self._dtype)

    def _report(self, sample: LineReport, **jobs: Sequence[Job]) -> None:
        """Set the source: the jobs of each attribute besides the time."""
        self.source = sample, {"time": [Job(Reading.TIME)], **jobs}


def sight_rays(
    origins: Floats,
    directions: Floats,
    max_range: ArrayLike,
    carrier_id: ArrayLike = -1,
) -> Rays:
    """Return rays that end where something stops robots or light.

    Args:
        origins: (N, 3) m, map frame.
        directions: (N, 3) unit vectors, map frame.
        max_range: m, of all rays or of each.
        carrier_id: Id of the robot's box, which stops no ray, likewise; -1 for none.
    """
    return Rays.uniform(
        origins,
        directions,
        max_range=max_range,
        carrier_id=carrier_id,
        ray_classes=(SONAR_CLASS,),
    )


def rank(item_type: str) -> int:
    """Return the place of a type of items in the order of readings."""
    return _ORDER.index(item_type) if item_type in _ORDER else len(_ORDER)


@cache
def kinds() -> Mapping[str, type[Sensor]]:
    """Return all kinds of sensors by the types of their items."""
    for module in pkgutil.iter_modules(radarsim.sensors.__path__):
        importlib.import_module(f"radarsim.sensors.{module.name}")
    return _KINDS
