"""The readings of sensors: SEN lines, in both directions.

Each report writes and reads its own fields. Fields are read in any order, and keys and
types in any case. A time stamp that a server leaves out is NaN, in both directions.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from math import isnan
from typing import ClassVar, Final, Self

import numpy as np

from radarsim.errors import MalformedMessage
from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.line_template import (
    NO_SERIES,
    TRUTH,
    WHOLE,
    Fields,
    angle_marks,
    marks,
    reduce_text,
    series_marks,
    vector_marks,
)
from radarsim.protocol.message import (
    Message,
    parse_flipped,
    parse_triple,
    wrapped_pose,
)
from radarsim.protocol.numbers import (
    NumberFormat,
    parse_flag,
    parse_list,
    parse_number,
    parse_numbers,
)
from radarsim.protocol.periodic_reports import (
    NumberedReport,
    SensorReport,
    Split,
    find_template,
)

_SIGNS: Final = {"N": 1, "E": 1, "S": -1, "W": -1}


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

    @staticmethod
    def fields(dialect: Dialect, fixed: tuple[str, float, float, int]) -> Fields:
        """Return the fields after time and type, without what changes in them."""
        name, resolution, fov, count = fixed
        return (
            ("Name", reduce_text(name)),
            ("Resolution", dialect.angle.format(resolution)),
            ("FOV", dialect.angle.format(fov)),
            ("Range", series_marks(dialect.ranges, count)),
        )

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and its series."""
        fixed = (self.name, self.resolution, self.fov, len(self.ranges))
        line = find_template(RangeScan, dialect, isnan(self.time), fixed)
        return line, (self.time,), self.ranges


@dataclass(frozen=True, slots=True)
class GroundTruth(SensorReport, NumberedReport):
    """The true pose of the robot's body in the world."""

    sensor_type: ClassVar[str] = "GroundTruth"

    name: str
    pose: Pose3

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        return cls(message.number_or_nan("Time"), message.name, _decode_pose(message))

    @classmethod
    def build(cls, name: str, numbers: Iterator[float]) -> Self:
        """Create a reading from the time and the pose."""
        return cls(next(numbers), name, Pose3(*islice(numbers, 6)))

    @staticmethod
    def fields(dialect: Dialect, name: str) -> Fields:
        """Return the fields after time and type, without what changes in them."""
        return _pose_fields(name, dialect.truth)

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and its series."""
        line = find_template(GroundTruth, dialect, isnan(self.time), self.name)
        return line, (self.time, *self.pose.numbers()), NO_SERIES


@dataclass(frozen=True, slots=True)
class Ins(SensorReport, NumberedReport):
    """The pose in the world that the inertial navigation system estimates."""

    sensor_type: ClassVar[str] = "INS"

    name: str
    pose: Pose3

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        return cls(message.number_or_nan("Time"), message.name, _decode_pose(message))

    @classmethod
    def build(cls, name: str, numbers: Iterator[float]) -> Self:
        """Create a reading from the time and the pose."""
        return cls(next(numbers), name, Pose3(*islice(numbers, 6)))

    @staticmethod
    def fields(dialect: Dialect, name: str) -> Fields:
        """Return the fields after time and type, without what changes in them."""
        return _pose_fields(name, dialect.ins, positive=dialect.ins_angles_positive)

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and its series."""
        line = find_template(Ins, dialect, isnan(self.time), self.name)
        return line, (self.time, *self.pose.numbers()), NO_SERIES

    @staticmethod
    def has_time(dialect: Dialect) -> bool:
        """Return whether the lines of a dialect have a time stamp."""
        return dialect.ins_has_time


@dataclass(frozen=True, slots=True)
class Odometry(SensorReport, NumberedReport):
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

    @classmethod
    def build(cls, name: str, numbers: Iterator[float]) -> Self:
        """Create a reading from the time and the pose."""
        return cls(next(numbers), name, Pose2(*islice(numbers, 3)))

    @staticmethod
    def fields(dialect: Dialect, name: str) -> Fields:
        """Return the fields after time and type, without what changes in them."""
        # The yaw is flipped as y and z of a vector are.
        return (("Name", reduce_text(name)), ("Pose", vector_marks(dialect.plain)))

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and its series."""
        line = find_template(Odometry, dialect, isnan(self.time), self.name)
        pose = self.pose
        return line, (self.time, pose.x, pose.y, pose.yaw), NO_SERIES

    @staticmethod
    def has_time(dialect: Dialect) -> bool:
        """Return whether the lines of a dialect have a time stamp."""
        return dialect.odometry_has_time


@dataclass(frozen=True, slots=True)
class Tachometer(SensorReport, NumberedReport):
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

    @classmethod
    def build(cls, fixed: tuple[str, int, int], numbers: Iterator[float]) -> Self:
        """Create a reading from the time, the velocities, and the positions."""
        name, *counts = fixed
        time = next(numbers)
        velocities, positions = (tuple(islice(numbers, count)) for count in counts)
        return cls(time, name, velocities, positions)

    @staticmethod
    def fields(dialect: Dialect, fixed: tuple[str, int, int]) -> Fields:
        """Return the fields after time and type, without what changes in them."""
        name, velocities, positions = fixed
        return (
            ("Name", reduce_text(name)),
            ("Vel", marks(dialect.plain, velocities)),
            ("Pos", marks(dialect.plain, positions)),
        )

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and its series."""
        fixed = (self.name, len(self.velocities), len(self.positions))
        line = find_template(Tachometer, dialect, isnan(self.time), fixed)
        return line, (self.time, *self.velocities, *self.positions), NO_SERIES


@dataclass(frozen=True, slots=True)
class Encoder(SensorReport, NumberedReport):
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

    @classmethod
    def build(cls, names: tuple[str, ...], numbers: Iterator[float]) -> Self:
        """Create a reading from the time, and the ticks of all wheels."""
        return cls(next(numbers), tuple((name, int(next(numbers))) for name in names))

    @staticmethod
    def fields(dialect: Dialect, names: tuple[str, ...]) -> Fields:
        """Return the fields after time and type, without what changes in them."""
        ticks = [(reduce_text(name), WHOLE) for name in names]
        return _item_fields("Tick", ticks, joined=dialect.joins_encoders)

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and its series."""
        names, ticks = _unzip(self.ticks)
        line = find_template(Encoder, dialect, isnan(self.time), names)
        return line, (self.time, *ticks), NO_SERIES

    @staticmethod
    def has_time(dialect: Dialect) -> bool:
        """Return whether the lines of a dialect have a time stamp."""
        return dialect.encoder_has_time


@dataclass(frozen=True, slots=True)
class Touch(SensorReport, NumberedReport):
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

    @classmethod
    def build(cls, name: str, numbers: Iterator[float]) -> Self:
        """Create a reading from the time, and 1 if it is touched, else 0."""
        return cls(next(numbers), name, next(numbers) != 0)

    @staticmethod
    def fields(dialect: Dialect, name: str) -> Fields:
        """Return the fields after time and type, without what changes in them."""
        values = [(reduce_text(name), TRUTH)]
        return _item_fields("Touch", values, joined=dialect.joins_touch)

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and its series."""
        line = find_template(Touch, dialect, isnan(self.time), self.name)
        return line, (self.time, self.touched), NO_SERIES


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

    @staticmethod
    def fields(dialect: Dialect, names: tuple[str, ...]) -> Fields:
        """Return the fields after time and type, without what changes in them."""
        ranges = [(reduce_text(name), marks(dialect.robot)) for name in names]
        return _item_fields("Range", ranges, joined=dialect.joins_sonars)

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and its series."""
        names, ranges = _unzip(self.ranges)
        line = find_template(Sonar, dialect, isnan(self.time), names)
        return line, (self.time, *ranges), NO_SERIES


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

    @staticmethod
    def fields(dialect: Dialect, fixed: tuple[str, tuple[str, str] | None]) -> Fields:
        """Return the fields after time and type, without what changes in them."""
        name, letters = fixed
        position: Fields = ()
        if letters is not None:
            north, east = letters
            degrees = f"{WHOLE},{marks(dialect.robot)}"
            position = (
                ("Latitude", f"{degrees},{north}"),
                ("Longitude", f"{degrees},{east}"),
            )
        fix = ("Fix", str(int(letters is not None)))
        return (("Name", reduce_text(name)), *position, fix, ("Satellites", WHOLE))

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and its series."""
        letters: tuple[str, str] | None = None
        position: tuple[float, ...] = ()
        if self.position is not None:
            latitude, longitude = self.position
            north, *y = _split_degrees(latitude, "NS", dialect.robot)
            east, *x = _split_degrees(longitude, "EW", dialect.robot)
            letters, position = (north, east), (*y, *x)
        line = find_template(Gps, dialect, isnan(self.time), (self.name, letters))
        return line, (self.time, *position, self.satellites), NO_SERIES


def _pose_fields(
    name: str, number_format: NumberFormat, *, positive: bool = False
) -> Fields:
    return (
        ("Name", reduce_text(name)),
        ("Location", vector_marks(number_format)),
        ("Orientation", angle_marks(number_format, positive=positive)),
    )


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
        return [("Name", f"{name} {key} {value}") for name, value in values]
    pairs = [(("Name", name), (key, value)) for name, value in values]
    return [field for pair in pairs for field in pair]


def _unzip(
    values: Sequence[tuple[str, float]],
) -> tuple[tuple[str, ...], tuple[float, ...]]:
    """Return the names and the values of items."""
    names, numbers = zip(*values, strict=True) if values else ((), ())
    return names, numbers


def _split_degrees(
    angle: float, letters: str, minutes_format: NumberFormat
) -> tuple[str, float, float]:
    """Return the letter for the sign of an angle, whole degrees, and minutes.

    Raises:
        ValueError: If it is not finite.
    """
    degrees, minutes = divmod(abs(angle) * 60, 60)
    written = minutes
    if not 0.1 < minutes < 59.9:  # it may be written as 0 or 60
        written = float(minutes_format.format(minutes))
        if written == 60.0:
            degrees, minutes = degrees + 1, 0.0
    is_negative = angle < 0 and (degrees > 0 or written > 0)
    return letters[is_negative], degrees, minutes


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
