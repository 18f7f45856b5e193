"""The readings of sensors: SEN lines, in both directions.

Each report writes and reads its own fields. Fields are read in any order, and keys and
types in any case. A time stamp that a server leaves out is NaN, in both directions.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Final, Self, TypeAlias

import numpy as np

from radarsim.errors import MalformedMessage
from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.message import (
    Message,
    parse_flipped,
    parse_triple,
    position_on_wire,
    wrapped_angles_on_wire,
    wrapped_pose,
)
from radarsim.protocol.numbers import (
    NumberFormat,
    format_ranges,
    parse_flag,
    parse_list,
    parse_number,
    parse_numbers,
)

Fields: TypeAlias = tuple[tuple[str, str], ...]

_SIGNS: Final = {"N": 1, "E": 1, "S": -1, "W": -1}


@dataclass(frozen=True, slots=True, eq=False)
class SensorReport(ABC):
    """One reading.

    Attributes:
        sensor_type: Value of ``Type`` on the wire.
        time: Simulated time, s; NaN if the line has none.
    """

    sensor_type: ClassVar[str]

    time: float

    @classmethod
    @abstractmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message.

        Raises:
            MalformedMessage: If a field is missing or not readable.
        """

    @abstractmethod
    def fields(self, dialect: Dialect) -> Fields:
        """Return the keys and values after time and type.

        Raises:
            ValueError: If a number is not finite.
        """

    def encode(self, dialect: Dialect) -> str:
        """Write the report as one line without its end.

        Raises:
            ValueError: If a number is not finite.
        """
        fields = (("Type", self.sensor_type), *self.fields(dialect))
        if self._has_time(dialect):
            fields = (("Time", dialect.time.format(self.time)), *fields)
        return Message("SEN", fields).encode()

    def _has_time(self, _: Dialect) -> bool:
        return not math.isnan(self.time)


@dataclass(frozen=True, slots=True, eq=False)
class RangeScan(SensorReport):
    """One scan of a laser or radar.

    Attributes:
        name: Name of the scanner.
        resolution: Angle between neighbouring beams, rad.
        fov: Angle between the first beam and the last, rad.
        ranges: (N,) m, counter-clockwise from the right, finite: a beam without
            return has the maximum range.
    """

    sensor_type: ClassVar[str] = "RangeScanner"

    name: str
    resolution: float
    fov: float
    ranges: Floats

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        return cls(
            message.number_or_nan("Time"),
            message.name,
            message.parse("Resolution", parse_number),
            message.parse("FOV", parse_number),
            np.array(message.parse("Range", parse_list)),
        )

    def fields(self, dialect: Dialect) -> Fields:
        """Return the keys and values after time and type."""
        return (
            ("Name", self.name),
            ("Resolution", dialect.angle.format(self.resolution)),
            ("FOV", dialect.angle.format(self.fov)),
            ("Range", format_ranges(self.ranges, dialect.ranges)),
        )


@dataclass(frozen=True, slots=True)
class GroundTruth(SensorReport):
    """The true pose of the robot's body in the world."""

    sensor_type: ClassVar[str] = "GroundTruth"

    name: str
    pose: Pose3

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        return cls(message.number_or_nan("Time"), message.name, _decode_pose(message))

    def fields(self, dialect: Dialect) -> Fields:
        """Return the keys and values after time and type."""
        return (
            ("Name", self.name),
            ("Location", dialect.truth.join(position_on_wire(self.pose))),
            ("Orientation", dialect.truth.join(wrapped_angles_on_wire(self.pose))),
        )


@dataclass(frozen=True, slots=True)
class Ins(SensorReport):
    """The pose in the world that the inertial navigation system estimates."""

    sensor_type: ClassVar[str] = "INS"

    name: str
    pose: Pose3

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        return cls(message.number_or_nan("Time"), message.name, _decode_pose(message))

    def fields(self, dialect: Dialect) -> Fields:
        """Return the keys and values after time and type."""
        angles = wrapped_angles_on_wire(self.pose)
        if dialect.ins_angles_positive:
            roll, pitch, yaw = angles
            angles = (roll % math.tau, pitch % math.tau, yaw % math.tau)
        return (
            ("Name", self.name),
            ("Location", dialect.ins.join(position_on_wire(self.pose))),
            ("Orientation", dialect.ins.join(angles)),
        )

    def _has_time(self, dialect: Dialect) -> bool:
        return dialect.ins_has_time and not math.isnan(self.time)


@dataclass(frozen=True, slots=True)
class Odometry(SensorReport):
    """The pose that the wheels imply, relative to the spawn pose; yaw is unwrapped."""

    sensor_type: ClassVar[str] = "Odometry"

    name: str
    pose: Pose2

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        x, y, yaw = message.parse("Pose", parse_triple)
        pose = Pose2(x, 0.0 - y, 0.0 - yaw)
        return cls(message.number_or_nan("Time"), message.name, pose)

    def fields(self, dialect: Dialect) -> Fields:
        """Return the keys and values after time and type."""
        pose = (self.pose.x, 0.0 - self.pose.y, 0.0 - self.pose.yaw)
        return (("Name", self.name), ("Pose", dialect.plain.join(pose)))

    def _has_time(self, dialect: Dialect) -> bool:
        return dialect.odometry_has_time and not math.isnan(self.time)


@dataclass(frozen=True, slots=True)
class Tachometer(SensorReport):
    """The speed of each wheel, rad/s, and the angle that it has turned by, rad."""

    sensor_type: ClassVar[str] = "Tachometer"

    name: str
    velocities: tuple[float, ...]
    positions: tuple[float, ...]

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        return cls(
            message.number_or_nan("Time"),
            message.name,
            tuple(message.parse("Vel", parse_list)),
            tuple(message.parse("Pos", parse_list)),
        )

    def fields(self, dialect: Dialect) -> Fields:
        """Return the keys and values after time and type."""
        return (
            ("Name", self.name),
            ("Vel", dialect.plain.join(self.velocities)),
            ("Pos", dialect.plain.join(self.positions)),
        )


@dataclass(frozen=True, slots=True)
class Encoder(SensorReport):
    """Name and tick count of each wheel encoder."""

    sensor_type: ClassVar[str] = "Encoder"

    ticks: tuple[tuple[str, int], ...]

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        ticks = [
            (item.name, int(item.parse("Tick", parse_number)))
            for item in message.split_fields("Tick").items()
        ]
        return cls(message.number_or_nan("Time"), tuple(ticks))

    def fields(self, dialect: Dialect) -> Fields:
        """Return the keys and values after time and type."""
        ticks = [(name, str(tick)) for name, tick in self.ticks]
        return _item_fields("Tick", ticks, joined=dialect.joins_encoders)

    def _has_time(self, dialect: Dialect) -> bool:
        return dialect.encoder_has_time and not math.isnan(self.time)


@dataclass(frozen=True, slots=True)
class Touch(SensorReport):
    """Whether something touches the robot."""

    sensor_type: ClassVar[str] = "Touch"

    name: str
    touched: bool

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        fields = message.split_fields("Touch")
        touched = fields.parse("Touch", parse_flag)
        return cls(fields.number_or_nan("Time"), fields.name, touched)

    def fields(self, dialect: Dialect) -> Fields:
        """Return the keys and values after time and type."""
        touched = [(self.name, str(self.touched))]
        return _item_fields("Touch", touched, joined=dialect.joins_touch)


@dataclass(frozen=True, slots=True)
class Sonar(SensorReport):
    """The ranges of sonars.

    Attributes:
        ranges: Name and range of each sonar, m; the maximum range where nothing
            returned.
    """

    sensor_type: ClassVar[str] = "Sonar"

    ranges: tuple[tuple[str, float], ...]

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        ranges = [
            (item.name, item.parse("Range", parse_number))
            for item in message.split_fields("Range").items()
        ]
        return cls(message.number_or_nan("Time"), tuple(ranges))

    def fields(self, dialect: Dialect) -> Fields:
        """Return the keys and values after time and type."""
        ranges = [(name, dialect.robot.format(value)) for name, value in self.ranges]
        return _item_fields("Range", ranges, joined=dialect.joins_sonars)


@dataclass(frozen=True, slots=True)
class Gps(SensorReport):
    """A position on the globe.

    Attributes:
        name: Name of the receiver.
        position: Latitude and longitude, degrees, north and east positive; None without
            a fix.
        satellites: Number of satellites in sight.
    """

    sensor_type: ClassVar[str] = "GPS"

    name: str
    position: tuple[float, float] | None
    satellites: int

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        position = None
        if message.parse("Fix", parse_number) == 1:
            position = (
                message.parse("Latitude", _parse_degrees),
                message.parse("Longitude", _parse_degrees),
            )
        satellites = int(message.parse("Satellites", parse_number))
        time = message.number_or_nan("Time")
        return cls(time, message.name, position, satellites)

    def fields(self, dialect: Dialect) -> Fields:
        """Return the keys and values after time and type."""
        position: Fields = ()
        if self.position is not None:
            latitude, longitude = self.position
            position = (
                ("Latitude", _degrees(latitude, "NS", dialect.robot)),
                ("Longitude", _degrees(longitude, "EW", dialect.robot)),
            )
        fix = ("Fix", str(int(self.position is not None)))
        satellites = ("Satellites", str(self.satellites))
        return (("Name", self.name), *position, fix, satellites)


def _item_fields(
    key: str, values: Sequence[tuple[str, str]], *, joined: bool
) -> Fields:
    """Return the fields of items, each with a name and one value.

    Args:
        key: Key of the values.
        values: Name and value of each item.
        joined: Whether a value is in the segment of its item's name.
    """
    if joined:
        return tuple(("Name", f"{name} {key} {value}") for name, value in values)
    pairs = [(("Name", name), (key, value)) for name, value in values]
    return tuple(field for pair in pairs for field in pair)


def _degrees(angle: float, letters: str, minutes_format: NumberFormat) -> str:
    """Write an angle as whole degrees, minutes, and a letter for its sign.

    Raises:
        ValueError: If it is not finite.
    """
    degrees, minutes = divmod(abs(angle) * 60, 60)
    text = minutes_format.format(minutes)
    if text.startswith("60"):  # rounded up
        degrees, text = degrees + 1, minutes_format.format(0.0)
    is_negative = angle < 0 and (degrees > 0 or float(text) > 0)
    return f"{int(degrees)},{text},{letters[is_negative]}"


def _parse_degrees(text: str) -> float:
    """Read an angle as ``_degrees`` writes it.

    Raises:
        MalformedMessage: If it is not two numbers and a letter.
    """
    numbers, _, letter = text.rpartition(",")
    sign = _SIGNS.get(letter.strip().upper())
    if sign is None:
        raise MalformedMessage(
            f"{text[:80]!r}, expected degrees, minutes, and N, S, E or W"
        )
    degrees, minutes = parse_numbers(numbers, 2)
    return sign * (degrees + minutes / 60)


def _decode_pose(message: Message) -> Pose3:
    position = message.parse("Location", parse_flipped)
    return wrapped_pose(position, message.parse("Orientation", parse_flipped))
