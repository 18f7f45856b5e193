"""The dimensions and settings of a robot and its items: GEO and CONF lines.

Generations of servers differ in how they write mounts: one segment for each item, or
one for each of its fields. Both are read. Fields that a client can do without may be
missing; such a number is NaN.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final, Self

from radarsim.geometry import Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.message import (
    Message,
    Triple,
    angles_on_wire,
    flip_axes,
    parse_flipped,
    parse_triple,
    position_on_wire,
)
from radarsim.protocol.numbers import NumberFormat, parse_number

VEHICLE: Final = "GroundVehicle"  # the type of a robot on wheels

_VEHICLES = frozenset(
    (VEHICLE.lower(), "leggedrobot", "nauticvehicle", "aerialvehicle")
)
_MOUNT_KEYS = ("Location", "Orientation", "Mount")
_RIGID = "hard"  # the kind of a mount, where other servers name what it is fixed to


@dataclass(frozen=True, slots=True)
class RobotGeo:
    """The dimensions of the robot.

    Attributes:
        name: Class of the robot, not the name that its client chose.
        dimensions: Length, width, height of the hull, m.
        cog: Centre of gravity in the body frame, m.
        wheel_radius: Radius of the wheels, m.
        wheel_separation: Distance between left and right wheels, m.
        wheel_base: Distance between front and back wheels, m.
    """

    name: str
    dimensions: Triple
    cog: Triple
    wheel_radius: float
    wheel_separation: float
    wheel_base: float

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message.

        Raises:
            MalformedMessage: If a field is missing or not readable.
        """
        unknown = (math.nan, math.nan, math.nan)
        return cls(
            name=message.name,
            dimensions=message.parse("Dimensions", parse_triple),
            cog=message.parse_optional("COG", parse_flipped) or unknown,
            wheel_radius=message.parse("WheelRadius", parse_number),
            wheel_separation=message.parse("WheelSeparation", parse_number),
            wheel_base=message.number_or_nan("WheelBase"),
        )

    def encode(self, dialect: Dialect) -> str:
        """Write the report as one line without its end.

        Raises:
            ValueError: If a number is not finite.
        """
        number = dialect.robot
        dimensions = self.dimensions
        if dialect.dimensions_are_wheels:
            dimensions = (self.wheel_base, self.wheel_separation, 0.0)
        return _line(
            "GEO",
            ("Type", VEHICLE),
            ("Name", self.name),
            ("Dimensions", number.join(dimensions)),
            ("COG", number.join(flip_axes(self.cog))),
            ("WheelRadius", number.format(self.wheel_radius)),
            ("WheelSeparation", number.format(self.wheel_separation)),
            ("WheelBase", number.format(self.wheel_base)),
        )


@dataclass(frozen=True, slots=True)
class ItemGeo:
    """The mounts of items.

    Attributes:
        type: Type of the items in the spelling of the request.
        mounts: Name and pose in the body frame of each item, in mounting order.
        robot: Class of the robot that carries them; empty if it is not reported.
    """

    type: str
    mounts: tuple[tuple[str, Pose3], ...]
    robot: str

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message.

        Raises:
            MalformedMessage: If a field is missing or not readable.
        """
        mounts: list[tuple[str, Pose3]] = []
        robot = ""
        for item in message.split_fields(*_MOUNT_KEYS).items():
            mounts.append((item.name, _decode_mount(item)))
            carrier = item.get("Mount") or ""
            robot = robot or ("" if carrier.lower() == _RIGID else carrier)
        return cls(message.require("Type"), tuple(mounts), robot)

    def encode(self, dialect: Dialect) -> str:
        """Write the report as one line without its end.

        Raises:
            ValueError: If a number is not finite.
        """
        join = dialect.mount.join
        mounts = [
            dialect.mount_form.format(
                name=name,
                location=join(position_on_wire(pose)),
                orientation=join(angles_on_wire(pose)),
                robot=self.robot,
            )
            for name, pose in self.mounts
        ]
        return " ".join([_line("GEO", ("Type", self.type)), *mounts])


@dataclass(frozen=True, slots=True)
class RobotConf:
    """The performance of the robot.

    Attributes:
        name: Class of the robot, not the name that its client chose.
        mass: Mass, kg.
        max_speed: Maximum speed of a wheel in the dialect's drive unit.
        max_torque: Maximum torque of a wheel, N m.
    """

    name: str
    mass: float
    max_speed: float
    max_torque: float

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message.

        Raises:
            MalformedMessage: If a field is missing or not readable.
        """
        return cls(
            name=message.name,
            mass=message.number_or_nan("Mass"),
            max_speed=message.parse("MaxSpeed", parse_number),
            max_torque=message.number_or_nan("MaxTorque"),
        )

    def encode(self, dialect: Dialect) -> str:
        """Write the report as one line without its end.

        Raises:
            ValueError: If a number is not finite.
        """
        values = {
            "Type": VEHICLE,
            "Name": self.name,
            "SteeringType": "SkidSteered",
            "Mass": dialect.mass.format(self.mass),
            "MaxSpeed": dialect.robot.format(self.max_speed),
            "MaxTorque": dialect.robot.format(self.max_torque),
            "MaxFrontSteer": dialect.steer,
            "MaxRearSteer": dialect.steer,
        }
        return _line("CONF", *select_fields(dialect.robot_conf_keys, values))


@dataclass(frozen=True, slots=True)
class ScannerConf:
    """The settings of scanners.

    Attributes:
        type: Type of the items in the spelling of the request.
        items: Name, maximum and minimum range, m, resolution and field of view, rad.
    """

    type: str
    items: tuple[tuple[str, float, float, float, float], ...]

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message.

        Raises:
            MalformedMessage: If a field is missing or not readable.
        """
        rows = [
            (
                item.name,
                item.parse("MaxRange", parse_number),
                item.parse_optional("MinRange", parse_number) or 0.0,
                item.number_or_nan("Resolution"),
                item.number_or_nan("Fov"),
            )
            for item in message.items()
        ]
        return cls(message.require("Type"), tuple(rows))

    def encode(self, dialect: Dialect) -> str:
        """Write the report as one line without its end.

        Raises:
            ValueError: If a number is not finite.
        """
        fields = [("Type", self.type)]
        for name, max_range, min_range, resolution, fov in self.items:
            values = {
                "Name": name,
                "MaxRange": dialect.robot.format(max_range),
                "MinRange": dialect.robot.format(min_range),
                "Resolution": dialect.angle.format(resolution),
                "Fov": dialect.angle.format(fov),
                "Panning": "True",
                "Tilting": "False",
            }
            fields += select_fields(dialect.scanner_conf_keys, values)
        return _line("CONF", *fields)


@dataclass(frozen=True, slots=True)
class SonarConf:
    """The settings of sonars.

    Attributes:
        type: Type of the items in the spelling of the request.
        items: Name, maximum and minimum range, m, angle of the cone, rad, and interval,
            s, which is NaN if it is not reported.
    """

    type: str
    items: tuple[tuple[str, float, float, float, float], ...]

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message.

        Raises:
            MalformedMessage: If a field is missing or not readable.
        """
        rows = [
            (
                item.name,
                item.parse("MaxRange", parse_number),
                item.parse_optional("MinRange", parse_number) or 0.0,
                item.parse("BeamAngle", parse_number),
                item.number_or_nan("ScanInterval"),
            )
            for item in message.items()
        ]
        return cls(message.require("Type"), tuple(rows))

    def encode(self, dialect: Dialect) -> str:
        """Write the report as one line without its end.

        Raises:
            ValueError: If a number is not finite.
        """
        fields = [("Type", self.type)]
        keys = dialect.sonar_conf_keys
        for name, max_range, min_range, beam_angle, interval in self.items:
            angle = dialect.angle.format(beam_angle)
            values = {
                "Name": name,
                "MaxRange": dialect.robot.format(max_range),
                "MinRange": dialect.robot.format(min_range),
                "BeamAngle": angle,
                "beamAngle": angle,
                # The original's numbers, which have no effect there.
                "maxAngleOfIncidence": "0.1745",
                "tracesPerCone": "16",
                "numberOfCones": "10",
            }
            if "ScanInterval" in keys:
                values["ScanInterval"] = dialect.robot.format(interval)
            fields += select_fields(keys, values)
        return _line("CONF", *fields)


@dataclass(frozen=True, slots=True)
class _SettingConf:
    """One setting of each item of a type.

    Attributes:
        key: Key of the setting on the wire.
        type: Type of the items in the spelling of the request.
        items: Name of each item and its setting.
    """

    key: ClassVar[str]

    type: str
    items: tuple[tuple[str, float], ...]

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message.

        Raises:
            MalformedMessage: If a field is missing or not readable.
        """
        items = [
            (item.name, item.parse(cls.key, parse_number)) for item in message.items()
        ]
        return cls(message.require("Type"), tuple(items))

    def encode(self, dialect: Dialect) -> str:
        """Write the report as one line without its end.

        Raises:
            ValueError: If a number is not finite.
        """
        number_format = self._number_format(dialect)
        fields = [("Type", self.type)]
        for name, value in self.items:
            fields += [("Name", name), (self.key, number_format.format(value))]
        return _line("CONF", *fields)

    def _number_format(self, dialect: Dialect) -> NumberFormat:
        return dialect.plain


@dataclass(frozen=True, slots=True)
class IntervalConf(_SettingConf):
    """The intervals of items, s."""

    key: ClassVar[str] = "ScanInterval"


@dataclass(frozen=True, slots=True)
class TouchConf(_SettingConf):
    """The diameters of touch sensors, m."""

    key: ClassVar[str] = "Diameter"

    def _number_format(self, dialect: Dialect) -> NumberFormat:
        return dialect.robot


@dataclass(frozen=True, slots=True)
class EncoderConf(_SettingConf):
    """The angles of one tick of encoders, rad."""

    key: ClassVar[str] = "Resolution"

    def _number_format(self, dialect: Dialect) -> NumberFormat:
        return dialect.angle


@dataclass(frozen=True, slots=True)
class NameConf:
    """The names of items without settings."""

    type: str
    names: tuple[str, ...]

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message.

        Raises:
            MalformedMessage: If the type is missing.
        """
        names = tuple(item.name for item in message.items())
        return cls(message.require("Type"), names)

    def encode(self, _: Dialect) -> str:
        """Write the report as one line without its end."""
        names = [("Name", name) for name in self.names]
        return _line("CONF", ("Type", self.type), *names)


def decode_geo(message: Message) -> RobotGeo | ItemGeo:
    """Read a GEO message.

    Raises:
        MalformedMessage: If a field is missing or not readable.
    """
    return (RobotGeo if _is_of_robot(message) else ItemGeo).decode(message)


def decode_conf(
    message: Message,
) -> (
    RobotConf
    | ScannerConf
    | SonarConf
    | IntervalConf
    | TouchConf
    | EncoderConf
    | NameConf
):
    """Read a CONF message; its keys determine the kind of report.

    Raises:
        MalformedMessage: If a field is missing or not readable.
    """
    if _is_of_robot(message):
        return RobotConf.decode(message)
    if message.get("BeamAngle") is not None:
        return SonarConf.decode(message)
    if message.get("MaxRange") is not None:
        return ScannerConf.decode(message)
    for report in (IntervalConf, TouchConf, EncoderConf):
        if message.get(report.key) is not None:
            return report.decode(message)
    return NameConf.decode(message)


def select_fields(
    keys: Iterable[str], values: Mapping[str, str]
) -> list[tuple[str, str]]:
    """Return the values of some keys, in their order."""
    return [(key, values[key]) for key in keys]


def _is_of_robot(message: Message) -> bool:
    return message.require("Type").lower() in _VEHICLES


def _decode_mount(item: Message) -> Pose3:
    angles = item.parse_optional("Orientation", parse_flipped) or (0.0, 0.0, 0.0)
    return Pose3(*item.parse("Location", parse_flipped), *angles)


def _line(verb: str, *fields: tuple[str, str]) -> str:
    return Message(verb, fields).encode()
