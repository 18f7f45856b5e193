"""The two dialects of the server, as one table of what differs between them.

``COMPAT`` is the union of what clients in the field need; ``UDK`` is the original
server of the Unreal Development Kit, byte for byte. Everything else is the same.
"""

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from radarsim.protocol.numbers import NumberFormat, Rule

DriveUnit: TypeAlias = Literal["rad_per_s", "rev_per_s"]

RAD_PER_S: Final[dict[DriveUnit, float]] = {
    "rad_per_s": 1.0,
    "rev_per_s": 2 * math.pi,
}
MAX_WHEEL_SPEEDS: Final[dict[DriveUnit, float]] = {"rad_per_s": 8.17, "rev_per_s": 1.3}

# The original keeps angles of scanners as whole 1/65536 turns and cuts its own
# factor short: a field of view of 180 degrees is 32767 of them.
ROTATION_UNIT = 1 / 10430.378  # rad


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """One dialect: texts, digits, rates and limits.

    Attributes:
        name: As on the command line.
        gametype: Of the greeting.
        time_limit: Of the greeting, minutes; 0 for none.
        time: Digits of every Time.
        ranges: Digits of the ranges in a scan.
        angle: Digits of a scanner's step and field of view and an encoder's tick.
        truth: Digits of GroundTruth.
        ins: Digits of INS.
        plain: Digits of odometry, tachometer and intervals.
        start_pose: Digits of start poses.
        mount: Digits of an item's place on the robot.
        robot: Digits of the robot's numbers and of a scanner's limits.
        mass: Digits of the robot's mass.
        steer: Text of every steering angle; a skid-steer robot has none.
        light_intensity: Text while the light is off, and while it is on.
        status_keys: Fields of STA, in order.
        robot_conf_keys: Fields of the robot's CONF, in order.
        scanner_conf_keys: Fields of a scanner's CONF, in order.
        mount_form: One item of a GEO.
        dimensions_are_wheels: Whether the robot's dimensions are wheel base and
            separation instead of the hull's.
        ins_has_time: Whether INS says its time.
        ins_angles_positive: Whether INS angles are in [0, 2 pi), not (-pi, pi].
        accepts_any_case_true: Whether ``True`` is true, and not only ``true``.
        drive_unit: Unit of Left and Right in DRIVE and of MaxSpeed in CONF.
        battery_start: s.
        battery_runs_out: Whether it ends; else it stays at 1 s.
        scan_interval: Of a scanner, s.
        hokuyo_scan_interval: Of a Hokuyo, s.
        ins_interval: s.
        tachometer_interval: s.
        laser_max_range: Of a robot's radar and SICK, m; None for the preset's own.
    """

    name: str
    gametype: str
    time_limit: int
    time: NumberFormat
    ranges: NumberFormat
    angle: NumberFormat
    truth: NumberFormat
    ins: NumberFormat
    plain: NumberFormat
    start_pose: NumberFormat
    mount: NumberFormat
    robot: NumberFormat
    mass: NumberFormat
    steer: str
    light_intensity: tuple[str, str]
    status_keys: tuple[str, ...]
    robot_conf_keys: tuple[str, ...]
    scanner_conf_keys: tuple[str, ...]
    mount_form: str
    dimensions_are_wheels: bool
    ins_has_time: bool
    ins_angles_positive: bool
    accepts_any_case_true: bool
    drive_unit: DriveUnit
    battery_start: float
    battery_runs_out: bool
    scan_interval: float
    hokuyo_scan_interval: float
    ins_interval: float
    tachometer_interval: float
    laser_max_range: float | None

    def scan_interval_of(self, sensor: str) -> float:
        """Give the interval of a scanner preset, s."""
        return self.hokuyo_scan_interval if sensor == "hokuyo" else self.scan_interval


COMPAT = Dialect(
    name="compat",
    gametype="BotDeathMatch",
    time_limit=0,
    time=NumberFormat(2),
    ranges=NumberFormat(2),
    angle=NumberFormat(6),  # four digits would skew a scan by half a degree
    truth=NumberFormat(4),
    ins=NumberFormat(4),
    plain=NumberFormat(4),
    start_pose=NumberFormat(2),
    mount=NumberFormat(4),
    robot=NumberFormat(4),
    mass=NumberFormat(4),
    steer="0.0000",
    light_intensity=("0", "100"),
    status_keys=(
        *("Type", "Time", "FrontSteer", "RearSteer"),
        *("LightToggle", "LightIntensity", "Battery", "View"),
    ),
    robot_conf_keys=(
        *("Type", "Name", "SteeringType", "Mass"),
        *("MaxSpeed", "MaxTorque", "MaxFrontSteer", "MaxRearSteer"),
    ),
    scanner_conf_keys=("Name", "MaxRange", "MinRange", "Resolution", "Fov"),
    mount_form=(
        "{{Name {name} Location {location} Orientation {orientation} Mount HARD}}"
    ),
    dimensions_are_wheels=False,
    ins_has_time=True,
    ins_angles_positive=False,
    accepts_any_case_true=True,
    drive_unit="rad_per_s",
    battery_start=3600.0,
    battery_runs_out=False,  # a client that reads 0 pauses its robot for good
    scan_interval=0.1,  # one client drops every second 100 ms, by its own clock
    hokuyo_scan_interval=0.1,
    ins_interval=0.1,
    tachometer_interval=0.1,
    laser_max_range=None,
)

UDK = Dialect(
    name="udk",
    gametype="BotDeathMatch",
    time_limit=20,
    time=NumberFormat(4, Rule.ENGINE),
    ranges=NumberFormat(2, Rule.TRUNCATED),
    angle=NumberFormat(4, Rule.TRUNCATED, ROTATION_UNIT),
    truth=NumberFormat(3, Rule.TRUNCATED),
    ins=NumberFormat(2, Rule.ENGINE),
    plain=NumberFormat(4, Rule.ENGINE),
    start_pose=NumberFormat(4, Rule.ENGINE),
    mount=NumberFormat(2, Rule.ENGINE),
    robot=NumberFormat(4, Rule.TRUNCATED),
    mass=NumberFormat(4, Rule.ENGINE),  # a sum of parts, just above its digits
    steer="0",
    light_intensity=("100", "100"),
    status_keys=(
        *("Time", "Battery", "Type", "LightToggle"),
        *("LightIntensity", "FrontSteer", "RearSteer"),
    ),
    robot_conf_keys=(
        *("Name", "Type", "SteeringType", "Mass"),
        *("MaxSpeed", "MaxTorque", "MaxFrontSteer", "MaxRearSteer"),
    ),
    scanner_conf_keys=(
        *("Name", "MaxRange", "MinRange", "Resolution", "Fov", "Panning", "Tilting"),
    ),
    mount_form=(
        "{{Name {name}}} {{Location {location}}} {{Orientation {orientation}}}"
        "{{Mount {robot}}}"
    ),
    dimensions_are_wheels=True,
    ins_has_time=False,
    ins_angles_positive=True,
    accepts_any_case_true=False,
    drive_unit="rev_per_s",
    battery_start=1200.0,
    battery_runs_out=True,
    scan_interval=0.2,
    hokuyo_scan_interval=0.3,
    ins_interval=0.2,
    tachometer_interval=0.2,
    laser_max_range=20.0,
)


def get_dialect(name: str) -> Dialect:
    """Give a dialect by its name, case as written.

    Raises:
        ValueError: If there is none of that name.
    """
    for dialect in (COMPAT, UDK):
        if dialect.name == name:
            return dialect
    raise ValueError(f"dialect {name[:80]!r}, expected 'compat' or 'udk'")
