"""The two dialects of the server: number formats, rates and limits in one table.

The report classes define the keys of lines and their order.

``COMPAT`` meets the needs of all known clients; ``UDK`` matches the original server of
the Unreal Development Kit byte for byte. Both dialects agree in everything that is not
listed here.
"""

import math
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

from radarsim.protocol.images import ImageType
from radarsim.protocol.line_template import NumberFormat, Rounding

DriveUnit: TypeAlias = Literal["rad_per_s", "rev_per_s"]
Generation: TypeAlias = Literal["ut2004", "udk"]

RAD_PER_S: Final[dict[DriveUnit, float]] = {
    "rad_per_s": 1.0,
    "rev_per_s": 2 * math.pi,
}
MAX_WHEEL_SPEEDS: Final[dict[DriveUnit, float]] = {"rad_per_s": 8.17, "rev_per_s": 1.3}

# The original server stores the angles of scanners as integer multiples of 1/65536
# revolution and truncates its conversion factor: 180 degrees are stored as 32767.
ROTATION_UNIT = 1 / 10430.378  # rad

# Formats with 2, 4 and 6 decimals, rounded to the nearest.
_TWO, _FOUR, _SIX = NumberFormat(2), NumberFormat(4), NumberFormat(6)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Dialect:
    """A dialect of the server: its texts, number formats, rates and limits.

    Dialects compare by identity, which makes them fast dictionary keys.

    Attributes:
        name: Name on the command line.
        time: Format of time stamps.
        ranges: Format of the ranges in a scan.
        angle: Format of a scanner's resolution and field of view, and of the angle of
            an encoder tick.
        truth: Format of ground truth.
        ins: Format of the INS pose.
        plain: Format of odometry, tachometer, intervals and echoes.
        start_pose: Format of start poses.
        mount: Format of an item's pose on the robot.
        robot: Format of the robot's dimensions, of range limits, and of the ranges of
            sonars.
        mass: Format of the robot's mass.
        no_steering: Text written for the steering angles of a robot without steering.
        dimensions_are_wheels: Whether the robot's reported dimensions are its wheel
            base and wheel separation instead of the size of its body.
        joins_mounts: Whether the mount of an item is in the segment of its name.
        joined: Types of sensors whose readings are in the segments of their names; all
            sonars, or all encoders, then share one line.
        timeless: Types of sensors whose lines have no time stamp.
        ins_angles_positive: Whether INS angles are in [0, 2 pi), not (-pi, pi].
        has_actuators: Whether mission packages are reported as actuators.
        cameras_in_degrees: Whether fields of view of cameras are in degrees.
        turns_in_degrees: Whether the commanded yaw rates of flying robots are in
            degrees per second, not rad/s.
        accepts_any_case_true: Whether ``True`` is true, and not only ``true``.
        image_type: Type of the image server's pictures.
        drive_unit: Unit of Left and Right in DRIVE and of MaxSpeed in CONF.
        battery_start: Run time of a full battery, s.
        battery_runs_out: Whether the battery runs empty; otherwise it stops at 1 s.
        scan_interval: Time between two scans of a scanner, s.
        hokuyo_scan_interval: Time between two scans of a Hokuyo, s.
        ins_interval: Time between two readings of the INS, s.
        tachometer_interval: Time between two readings of the tachometer, s.
        sonar_interval: Time between two readings of the sonars, s.
        gps_interval: Time between two readings of the GPS, s.
        laser_max_range: Range limit of radars and SICK laser scanners, m; None for the
            limit of the sensor preset.
    """

    name: str
    time: NumberFormat = _TWO
    ranges: NumberFormat = _TWO
    angle: NumberFormat = _SIX  # four decimals would skew a scan by half a degree
    truth: NumberFormat = _FOUR
    ins: NumberFormat = _FOUR
    plain: NumberFormat = _FOUR
    start_pose: NumberFormat = _TWO
    mount: NumberFormat = _FOUR
    robot: NumberFormat = _FOUR
    mass: NumberFormat = _FOUR
    no_steering: str = "0.0000"
    dimensions_are_wheels: bool = False
    joins_mounts: bool = True
    # The client "maldo" stops reading if name and reading of a touch sensor are in
    # separate segments.
    joined: frozenset[str] = frozenset(("Touch", "Sonar"))
    timeless: frozenset[str] = frozenset()
    ins_angles_positive: bool = False
    has_actuators: bool = False
    cameras_in_degrees: bool = False
    turns_in_degrees: bool = False
    accepts_any_case_true: bool = True
    image_type: ImageType = ImageType.JPEG_GOOD
    drive_unit: DriveUnit = "rad_per_s"
    battery_start: float = 3600.0
    battery_runs_out: bool = False  # UsarCommander never resumes a robot that reports 0
    scan_interval: float = 0.1  # UsarCommander skips scans in alternate 100 ms periods
    hokuyo_scan_interval: float = 0.1
    ins_interval: float = 0.1
    tachometer_interval: float = 0.1
    sonar_interval: float = 0.2
    gps_interval: float = 0.2
    laser_max_range: float | None = None

    def of_generation(self, generation: Generation) -> "Dialect":
        """Return this dialect as written for robots of one server generation."""
        return COMPAT_UT2004 if self is COMPAT and generation == "ut2004" else self

    def steering_limits(self, front: float, rear: float) -> tuple[float, float]:
        """Return front and rear steering limits, rad, as this dialect reports them.

        Args:
            front: Maximum steering angle of the front wheels to either side, rad.
            rear: Maximum steering angle of the rear wheels to either side, rad.
        """
        if self is not UDK:
            return front, rear
        # The original server reports the upper minus the lower limit of a joint, and
        # 6.28 if there is no joint.
        ranges = [2 * limit or 6.28 for limit in (front, rear)]
        return ranges[0], ranges[1]

    def scan_interval_of(self, sensor: str) -> float:
        """Return the time, s, between two scans of a scanner with a given preset."""
        return self.hokuyo_scan_interval if sensor == "hokuyo" else self.scan_interval


COMPAT = Dialect(name="compat")

# Clients for UT2004 servers read the fields of some lines by position. This dialect
# writes lines of that form for robots that these servers introduced.
COMPAT_UT2004 = replace(
    COMPAT,
    joined=COMPAT.joined | {"Encoder"},
    timeless=frozenset(("Encoder", "Odometry")),
)

UDK = Dialect(
    name="udk",
    time=NumberFormat(4, Rounding.FLOAT32),
    ranges=NumberFormat(2, Rounding.TRUNCATED),
    angle=NumberFormat(4, Rounding.TRUNCATED, ROTATION_UNIT),
    truth=NumberFormat(3, Rounding.TRUNCATED),
    ins=NumberFormat(2, Rounding.FLOAT32),
    plain=NumberFormat(4, Rounding.FLOAT32),
    start_pose=NumberFormat(4, Rounding.FLOAT32),
    mount=NumberFormat(2, Rounding.FLOAT32),
    robot=NumberFormat(4, Rounding.TRUNCATED),
    # Rounding matches the original server, whose sum of masses is slightly larger.
    mass=NumberFormat(4, Rounding.FLOAT32),
    no_steering="0",
    dimensions_are_wheels=True,
    joins_mounts=False,
    joined=frozenset(),
    timeless=frozenset(("INS",)),
    ins_angles_positive=True,
    has_actuators=True,
    cameras_in_degrees=True,
    turns_in_degrees=True,
    accepts_any_case_true=False,
    image_type=ImageType.RAW,
    drive_unit="rev_per_s",
    battery_start=1200.0,
    battery_runs_out=True,
    scan_interval=0.2,
    hokuyo_scan_interval=0.3,
    ins_interval=0.2,
    tachometer_interval=0.2,
    gps_interval=0.1,
    laser_max_range=20.0,
)


def get_dialect(name: str) -> Dialect:
    """Return the dialect with a case-sensitive name, ``compat`` or ``udk``.

    Raises:
        ValueError: If there is no such dialect.
    """
    for dialect in (COMPAT, UDK):
        if dialect.name == name:
            return dialect
    raise ValueError(f"dialect {name[:80]!r}, expected 'compat' or 'udk'")


@dataclass(frozen=True, slots=True)
class WheelDrive:
    """Converts the speeds in drive commands to wheel speeds in rad/s.

    Attributes:
        max_spin: Highest speed of a wheel in either direction, in ``unit``.
        unit: Unit of ``max_spin`` and of the commands.
    """

    max_spin: float
    unit: DriveUnit = "rad_per_s"

    @property
    def max_spin_rad_s(self) -> float:
        """The highest speed of a wheel, rad/s."""
        return self.max_spin * RAD_PER_S[self.unit]

    def spin(self, value: float, *, normalized: bool = False) -> float:
        """Convert a commanded speed to a wheel speed, rad/s, and limit it.

        Args:
            value: Commanded speed in ``unit``; forward is positive.
            normalized: Whether the value is a percentage of ``max_spin`` instead.
        """
        speed = value * self.max_spin / 100 if normalized else value
        speed = max(-self.max_spin, min(self.max_spin, speed))
        return speed * RAD_PER_S[self.unit]
