"""GEO and CONF lines: dimensions and settings of a robot and its items.

Servers of different generations write a mount as one segment for each item, or as one
segment for each field; both forms are read. Optional fields may be missing; a missing
number is NaN.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import degrees, nan
from typing import Annotated, Any, ClassVar, Final, NamedTuple, Self

from radarsim.geometry import Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import (
    Extent,
    Field,
    Layouts,
    LineReport,
    Number,
    Point,
    RequiredText,
    Rows,
    Segment,
    Text,
    join_items,
)
from radarsim.protocol.line_template import marks, reduce_text, vector_marks
from radarsim.protocol.message import Message, Triple, parse_flipped, parse_number

_VEHICLES: Final = frozenset(
    ("groundvehicle", "leggedrobot", "nauticvehicle", "aerialvehicle")
)
_RIGID: Final = "HARD"  # value of Mount on UT2004 servers; UDK writes the robot class
_ACKERMANN: Final = "AckermanSteered"  # the spelling of servers and clients
_MAX_STEERING: Final = ("MaxFrontSteer", "MaxRearSteer")


class RobotGeo(LineReport):
    """The dimensions of a wheeled robot, as reported by the server in a GEO line.

    Attributes:
        name: Class of the robot, not the name that its client chose.
        dimensions: Length, width and height of the robot, m.
        cog: Centre of gravity in the body frame, m.
        wheel_radius: Radius of the wheels, m.
        wheel_separation: Distance between left and right wheels, m.
        wheel_base: Distance between front and back wheels, m.
    """

    verb: ClassVar[str] = "GEO"
    layouts: ClassVar[Layouts] = dict.fromkeys(
        ("compat", "udk"),
        "{Type GroundVehicle} {Name} {Dimensions} {COG} {WheelRadius}"
        " {WheelSeparation} {WheelBase}",
    )

    name: Annotated[str, Text("Name")]
    dimensions: Annotated[Triple, Extent("Dimensions", "robot")]
    cog: Annotated[Triple, Point("COG", "robot")]
    wheel_radius: Annotated[float, Number("WheelRadius", "robot")]
    wheel_separation: Annotated[float, Number("WheelSeparation", "robot")]
    wheel_base: Annotated[float, Number("WheelBase", "robot", default=nan)]

    def segments(self, dialect: Dialect) -> Sequence[Segment]:
        report = self
        if dialect.dimensions_are_wheels:
            wheels = (self.wheel_base, self.wheel_separation, 0.0)
            report = replace(self, dimensions=wheels)
        return LineReport.segments(report, dialect)


class AerialGeo(RobotGeo):
    """The dimensions of a flying robot, as reported by the server in a GEO line.

    A flying robot has no wheels. Wheel radius, separation and base are placeholders of
    1 m, with which clients convert speed and yaw rate as for a wheeled robot.
    """

    layouts: ClassVar[Layouts] = dict.fromkeys(
        ("compat", "udk"), "{Type AerialVehicle} {Name} {Dimensions} {COG}"
    )

    wheel_radius: Annotated[float, Number("WheelRadius", "robot", default=1.0)] = 1.0
    wheel_separation: Annotated[
        float, Number("WheelSeparation", "robot", default=1.0)
    ] = 1.0
    wheel_base: Annotated[float, Number("WheelBase", "robot", default=1.0)] = 1.0

    def segments(self, dialect: Dialect) -> Sequence[Segment]:
        return LineReport.segments(self, dialect)


class ItemGeo(LineReport):
    """The mounting poses of a robot's items, such as its sensors, in a GEO line.

    Attributes:
        type: Type of the items in the spelling of the request.
        mounts: Name and pose in the body frame of each item, in mounting order.
        robot: Class of the robot that carries the items; empty if it is not reported.
    """

    verb: ClassVar[str] = "GEO"

    type: str
    mounts: tuple[tuple[str, Pose3], ...]
    robot: str

    @classmethod
    def decode(cls, message: Message) -> Self:
        mounts: list[tuple[str, Pose3]] = []
        robot = ""
        fields = message.split_fields("Location", "Orientation", "Mount")
        for item in fields.items():
            place = item.parse("Location", parse_flipped)
            angles = item.parse_optional("Orientation", parse_flipped)
            mounts.append((item.name, Pose3(*place, *(angles or (0.0, 0.0, 0.0)))))
            carrier = item.get("Mount") or ""
            robot = robot or ("" if carrier.upper() == _RIGID else carrier)
        return cls(message.require("Type"), tuple(mounts), robot)

    def segments(self, dialect: Dialect) -> Sequence[Segment]:
        place = vector_marks(dialect.mount)
        # The original server writes no space between the orientation and ``{Mount``.
        angles = f"{place}}}{{Mount {reduce_text(self.robot)}"
        segments: list[Segment] = []
        for name, pose in self.mounts:
            numbers = pose.numbers()
            written = [
                Segment("Name", reduce_text(name)),
                Segment("Location", place, numbers[:3]),
            ]
            # A pose in separate segments crashes Player's driver, and makes
            # UsarCommander lose the sensor's offset; ROS reads both forms.
            if dialect.joins_mounts:
                written.append(Segment("Orientation", place, numbers[3:]))
                written.append(Segment("Mount", _RIGID))
                segments += join_items(written)
            else:
                segments += [*written, Segment("Orientation", angles, numbers[3:])]
        return [Segment("Type", reduce_text(self.type)), *segments]


class Steering(Field[tuple[float, float] | None]):
    """A field with steering type and steering limits; None for skid steering."""

    def read(self, message: Message) -> tuple[float, float] | None:
        if (message.get(self.key) or "").lower() != _ACKERMANN.lower():
            return None
        front, rear = (message.parse(key, parse_number) for key in _MAX_STEERING)
        return front, rear

    def write(
        self, value: tuple[float, float] | None, dialect: Dialect
    ) -> Sequence[Segment]:
        if value is None:
            none = [Segment(key, dialect.no_steering) for key in _MAX_STEERING]
            return [Segment(self.key, "SkidSteered"), *none]
        text = marks(dialect.robot)
        limits = zip(_MAX_STEERING, value, strict=True)
        angles = [Segment(key, text, (limit,)) for key, limit in limits]
        return [Segment(self.key, _ACKERMANN), *angles]


class RobotConf(LineReport):
    """The mass of a robot, and its limits of speed, torque and steering.

    Attributes:
        name: Class of the robot, not the name that its client chose.
        mass: Mass, kg.
        max_speed: Maximum speed of a wheel in the dialect's drive unit.
        max_torque: Maximum torque of a wheel, N m.
        max_steering: Steering limits of the front and the rear wheels, rad. ``COMPAT``
            reports the angle to either side, ``UDK`` the full range. None for a
            skid-steered robot.
    """

    verb: ClassVar[str] = "CONF"
    layouts: ClassVar[Layouts] = {
        "compat": "{Type GroundVehicle} {Name} {SteeringType} {Mass}"
        " {MaxSpeed} {MaxTorque} {MaxFrontSteer} {MaxRearSteer}",
        "udk": "{Name} {Type GroundVehicle} {SteeringType} {Mass}"
        " {MaxSpeed} {MaxTorque} {MaxFrontSteer} {MaxRearSteer}",
    }

    name: Annotated[str, Text("Name")]
    mass: Annotated[float, Number("Mass", "mass", default=nan)]
    max_speed: Annotated[float, Number("MaxSpeed", "robot")]
    max_torque: Annotated[float, Number("MaxTorque", "robot", default=nan)]
    max_steering: Annotated[tuple[float, float] | None, Steering("SteeringType")] = None


class AerialConf(RobotConf):
    """The mass of a flying robot, and its maximum forward speed, m/s."""

    layouts: ClassVar[Layouts] = {
        "compat": "{Type AerialVehicle} {Name} {Mass} {MaxSpeed}",
        "udk": "{Name} {Type AerialVehicle} {Mass} {MaxSpeed}",
    }

    max_torque: Annotated[float, Number("MaxTorque", "robot", default=nan)] = nan


class ItemConf(LineReport):
    """Base class of reports on the settings of all items of one type on a robot.

    Attributes:
        type: Type of the items in the spelling of the request.
        items: Name and settings of each item, in the order of the fields of ``rows``.
        rows: Fields of an item.
    """

    verb: ClassVar[str] = "CONF"
    rows: ClassVar[Rows]

    type: str
    items: tuple[tuple[Any, ...], ...]

    @classmethod
    def _read(cls, message: Message) -> list[Any]:
        return [message.require("Type"), cls.rows.read(message)]

    def segments(self, dialect: Dialect) -> Sequence[Segment]:
        segments = self.rows.write(self.items, dialect)
        return [Segment("Type", reduce_text(self.type)), *segments]


class ScannerConf(ItemConf):
    """The settings of a robot's range scanners.

    An item has a name, maximum and minimum range, m, resolution and field of view, rad.
    """

    rows = Rows(
        Text("Name"),
        Number("MaxRange", "robot"),
        Number("MinRange", "robot", default=0.0),
        Number("Resolution", "angle", default=nan),
        Number("Fov", "angle", default=nan),
        layouts={
            "udk": "{Name} {MaxRange} {MinRange} {Resolution} {Fov}"
            " {Panning True} {Tilting False}",
        },
    )


class SonarConf(ItemConf):
    """The settings of a robot's sonars.

    An item has a name, maximum and minimum range, m, cone angle, rad, and interval, s.
    The interval is NaN if it is not reported.
    """

    rows = Rows(
        Text("Name"),
        Number("MaxRange", "robot"),
        Number("MinRange", "robot", default=0.0),
        Number("BeamAngle", "angle"),
        Number("ScanInterval", "robot", default=nan),
        layouts={
            "compat": "{Name} {MaxRange} {MinRange} {BeamAngle}",
            # The original server writes three constants, which have no effect.
            "udk": "{Name} {MaxRange} {MinRange} {ScanInterval} {beamAngle}"
            " {maxAngleOfIncidence 0.1745} {tracesPerCone 16} {numberOfCones 10}",
        },
    )


class IntervalConf(ItemConf):
    """The names of sensors, and the time, s, between two readings of each."""

    rows = Rows(Text("Name"), Number("ScanInterval", "plain"))


class TouchConf(ItemConf):
    """The names and the diameters, m, of a robot's touch sensors."""

    rows = Rows(Text("Name"), Number("Diameter", "robot"))


class EncoderConf(ItemConf):
    """The names of a robot's wheel encoders, and the angle of one tick, rad."""

    rows = Rows(Text("Name"), Number("Resolution", "angle"))


class CameraLimits(NamedTuple):
    """The zoom limits of a camera, and the region of its image in combined pictures.

    Attributes:
        name: Name of the camera.
        corner: x and y of the upper left corner of the image in a picture, pixels.
        size: Width and height of the image in a picture, pixels.
        fovs: Horizontal fields of view: default, minimum, maximum and present, rad.
    """

    name: str
    corner: tuple[float, float]
    size: tuple[float, float]
    fovs: tuple[float, float, float, float]


_PIXEL_KEYS: Final = (
    *("TextureOffsetX", "TextureOffsetY"),
    *("TextureResolutionX", "TextureResolutionY"),
)
_FOV_KEYS: Final = ("CameraDefFov", "CameraMinFov", "CameraMaxFov", "CameraFov")


class CameraConf(LineReport):
    """The settings of a robot's cameras; this program encodes but never decodes them.

    UDK servers write degrees and no spaces between fields; UT2004 servers write
    radians.

    Attributes:
        type: Type of the items in the spelling of the request.
        cameras: The cameras, in mounting order.
    """

    verb: ClassVar[str] = "CONF"

    type: str
    cameras: tuple[CameraLimits, ...]

    def segments(self, dialect: Dialect) -> Sequence[Segment]:
        segments = [Segment("Type", reduce_text(self.type))]
        angle = marks(dialect.plain)
        for camera in self.cameras:
            whole = [str(round(each)) for each in (*camera.corner, *camera.size)]
            fields = list(zip(_PIXEL_KEYS, whole, strict=True))
            fields += [(key, angle) for key in _FOV_KEYS]
            name, fovs = reduce_text(camera.name), camera.fovs
            if dialect.cameras_in_degrees:
                # The original server writes no spaces between the segments of a camera.
                text = "".join([f"}}{{{key} {value}" for key, value in fields])
                degrees_ = [degrees(each) for each in fovs]
                segments.append(Segment("Name", name + text, degrees_))
                continue
            segments.append(Segment("Name", name))
            numbers = [(), (), (), (), *[(each,) for each in fovs]]
            segments += [
                Segment(key, value, each)
                for (key, value), each in zip(fields, numbers, strict=True)
            ]
        return segments


class ItemNames(Field[tuple[str, ...]]):
    """A field with the names of a robot's items, one segment per name."""

    def read(self, message: Message) -> tuple[str, ...]:
        return tuple(item.name for item in message.items())

    def write(self, value: tuple[str, ...], _: Dialect) -> Sequence[Segment]:
        return [Segment(self.key, reduce_text(name)) for name in value]


class NameConf(LineReport):
    """The names of a robot's items of a type that has no settings."""

    verb: ClassVar[str] = "CONF"

    type: Annotated[str, RequiredText("Type")]
    names: Annotated[tuple[str, ...], ItemNames("Name")]


_UNREAD: Final = ("JointType", *_FOV_KEYS)
# Keys that identify the kinds of CONF lines. The first of these keys that is in a line
# determines the class of its report.
_CONFS: Final[Sequence[tuple[str, type[LineReport]]]] = (
    ("BeamAngle", SonarConf),
    ("MaxRange", ScannerConf),
    ("ScanInterval", IntervalConf),
    ("Diameter", TouchConf),
    ("Resolution", EncoderConf),
)


def decode_geo(message: Message) -> LineReport | None:
    """Create the report of a GEO line; return None for a line about mission packages.

    Raises:
        MalformedMessage: If a field is missing or not readable.
    """
    if _is_of_robot(message):
        return (AerialGeo if is_aerial(message) else RobotGeo).decode(message)
    return None if message.get("Link") is not None else ItemGeo.decode(message)


def decode_conf(message: Message) -> LineReport | None:
    """Create the report of a CONF line, whose keys determine the class of the report.

    Returns:
        The report; None for a message about mission packages or cameras.

    Raises:
        MalformedMessage: If a field is missing or not readable.
    """
    if _is_of_robot(message):
        return (AerialConf if is_aerial(message) else RobotConf).decode(message)
    if any(message.get(key) is not None for key in _UNREAD):
        return None
    found = [report for key, report in _CONFS if message.get(key) is not None]
    return (found[0] if found else NameConf).decode(message)


def is_aerial(message: Message) -> bool:
    """Return whether a GEO, CONF or STA line describes a flying robot."""
    return (message.get("Type") or "").lower() == "aerialvehicle"


def _is_of_robot(message: Message) -> bool:
    return message.require("Type").lower() in _VEHICLES
