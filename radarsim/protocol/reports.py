"""What the server tells a client, as values in the frames of the simulation.

Poses are REP-103, numbers are SI and unrounded: axes, digits and the order of the
fields on the wire belong to ``radarsim.protocol.encode``. Times are simulated s.
A ``type`` that a client asked for is echoed as it spelt it.
"""

from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose2, Pose3

Triple: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Greeting:
    """The first line on a connection; level is the name of the map."""

    level: str


@dataclass(frozen=True, slots=True)
class StartPoses:
    """The start poses of the map, by name."""

    poses: tuple[tuple[str, Pose3], ...]


@dataclass(frozen=True, slots=True)
class Status:
    """The state of a robot; battery is the time that it lasts, s."""

    time: float
    battery: int
    light: bool


@dataclass(frozen=True, slots=True, eq=False)
class RangeScan:
    """One scan of a laser or radar.

    Attributes:
        time: s.
        name: Of the item.
        resolution: Angle between neighbouring beams, rad.
        fov: Angle between the first beam and the last, rad.
        ranges: (N,) m, counter-clockwise from the right, finite: a beam without
            return reads the largest range.
    """

    time: float
    name: str
    resolution: float
    fov: float
    ranges: Floats


@dataclass(frozen=True, slots=True, eq=False)
class TargetEchoes:
    """Echoes of one object and material, and what a scanner can tell of it.

    Attributes:
        object: Its name in the map; of a robot, its name. Any text.
        material: Any text.
        density: Power that a beam loses in a metre of it; ``math.inf`` is opaque.
        transparency: Share of a beam that a metre of it, or a sheet, lets through.
        laser_passes: Whether light gets into it.
        robot_passes: Whether robots can drive through it.
        beams: (E,) the beam of each echo, counted from 0 at the right.
        ranges: (E,) m.
        kinds: E words: enter, leave, sheet, hit or spent.
        power: (E,) share of the beam's power that is left on arrival, 0 to 1.
        strength: (E,) share of the beam that comes back, 0 to 1.
    """

    object: str
    material: str
    density: float
    transparency: float
    laser_passes: bool
    robot_passes: bool
    beams: NDArray[np.int64]
    ranges: Floats
    kinds: tuple[str, ...]
    power: Floats
    strength: Floats


@dataclass(frozen=True, slots=True)
class EchoLine:
    """Echoes of one scan, as many as fit into a line.

    Attributes:
        time: s, that of the scan.
        name: Of the item.
        line: Its number, from 1 to ``lines``; 0 for a scan without echoes.
        lines: How many there are of that scan; 0 for a scan without echoes.
        echoes: None for a scan without echoes.
    """

    time: float
    name: str
    line: int
    lines: int
    echoes: TargetEchoes | None


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """Where the robot's body is."""

    time: float
    name: str
    pose: Pose3


@dataclass(frozen=True, slots=True)
class Ins:
    """Where the inertial navigation system believes to be."""

    time: float
    name: str
    pose: Pose3


@dataclass(frozen=True, slots=True)
class Odometry:
    """The pose that the wheels tell, from the place of spawning; yaw is not wrapped."""

    time: float
    name: str
    pose: Pose2


@dataclass(frozen=True, slots=True)
class Tachometer:
    """Spin of each wheel in rad/s and the angle that it has turned by in rad."""

    time: float
    name: str
    velocities: tuple[float, ...]
    positions: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Encoder:
    """Ticks of the named wheels."""

    time: float
    ticks: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class Touch:
    """Whether something touches the robot."""

    time: float
    name: str
    touched: bool


@dataclass(frozen=True, slots=True)
class RobotGeo:
    """The shape of the robot.

    Attributes:
        name: The robot's class, not the name that its client gave it.
        dimensions: Length, width, height of the hull, m.
        cog: Centre of gravity in the body frame, m.
        wheel_radius: m.
        wheel_separation: Between left and right wheels, m.
        wheel_base: Between front and back wheels, m.
    """

    name: str
    dimensions: Triple
    cog: Triple
    wheel_radius: float
    wheel_separation: float
    wheel_base: float


@dataclass(frozen=True, slots=True)
class RobotConf:
    """The abilities of the robot.

    Attributes:
        name: The robot's class, not the name that its client gave it.
        mass: kg.
        max_speed: Of a wheel, in the dialect's drive unit.
        max_torque: N m.
    """

    name: str
    mass: float
    max_speed: float
    max_torque: float


@dataclass(frozen=True, slots=True)
class ItemGeo:
    """Where items are mounted: name and pose in the body frame, in mounting order.

    ``robot`` is the class of the robot that carries them.
    """

    type: str
    mounts: tuple[tuple[str, Pose3], ...]
    robot: str


@dataclass(frozen=True, slots=True)
class ScannerConf:
    """Settings of scanners: name, longest and shortest range, m, step and fov, rad."""

    type: str
    items: tuple[tuple[str, float, float, float, float], ...]


@dataclass(frozen=True, slots=True)
class IntervalConf:
    """Settings of items that only have an interval: name and s."""

    type: str
    items: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True)
class EncoderConf:
    """Settings of encoders: name and the angle of one tick in rad."""

    type: str
    items: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True)
class TouchConf:
    """Settings of touch sensors: name and diameter in m."""

    type: str
    items: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True)
class NameConf:
    """Items that have no settings, by name."""

    type: str
    names: tuple[str, ...]


Report: TypeAlias = (
    Greeting
    | StartPoses
    | Status
    | RangeScan
    | EchoLine
    | GroundTruth
    | Ins
    | Odometry
    | Tachometer
    | Encoder
    | Touch
    | RobotGeo
    | RobotConf
    | ItemGeo
    | ScannerConf
    | IntervalConf
    | EncoderConf
    | TouchConf
    | NameConf
)


# Section from protocol.words.
# The words that tell reports apart, for who writes and for who reads them.

VEHICLE: Final = "GroundVehicle"  # the type of a robot that drives
VEHICLES: Final = frozenset((VEHICLE, "LeggedRobot", "NauticVehicle", "AerialVehicle"))

Reading: TypeAlias = (
    RangeScan | EchoLine | GroundTruth | Ins | Odometry | Tachometer | Encoder | Touch
)
Settings: TypeAlias = IntervalConf | EncoderConf | TouchConf

READING_TYPES: Final[dict[type[Reading], str]] = {
    RangeScan: "RangeScanner",
    EchoLine: "Echoes",
    GroundTruth: "GroundTruth",
    Ins: "INS",
    Odometry: "Odometry",
    Tachometer: "Tachometer",
    Encoder: "Encoder",
    Touch: "Touch",
}
SETTING_KEYS: Final[dict[type[Settings], str]] = {
    IntervalConf: "ScanInterval",
    TouchConf: "Diameter",
    EncoderConf: "Resolution",
}
