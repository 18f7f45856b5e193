"""Robot classes: their dimensions, and the sensors that they carry.

Each class is a file in ``robots/``. A file may be ``based_on`` another class, whose
keys and items it inherits. A key or item with the same name replaces the inherited one;
new items are appended to the inherited items.
"""

import math
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self, TypeAlias, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    ValidationError,
    model_validator,
)

from radarsim import plugins
from radarsim.errors import PresetError, expected_one_of, list_names
from radarsim.geometry import Pose3
from radarsim.presets import (
    Confidence,
    preset_names,
    preset_path,
)
from radarsim.yaml_reader import read_yaml

DialectName: TypeAlias = Literal["compat", "udk"]
Generation: TypeAlias = Literal["ut2004", "udk"]
Side: TypeAlias = Literal["left", "right"]
Vector: TypeAlias = tuple[float, float, float]
Length: TypeAlias = Annotated[float, Field(gt=0)]
_NO_SENSORS: Final = ("RangeScanner", "Camera", "Battery")  # item types without Sensor
_NOT_INHERITED: Final = {"about"}  # keys that a derived class does not inherit


def _known_type(value: str) -> str:
    if value not in _NO_SENSORS:
        known = plugins.load("radarsim.kinds", "core")()
        if value not in known:
            raise ValueError(expected_one_of(value, (*_NO_SENSORS, *known)))
    return value


class Source(BaseModel, frozen=True, extra="forbid"):
    """The source of some values in the file of a robot class.

    Attributes:
        of: Names of the keys.
        source: Origin of their values, as text.
        confidence: See ``SourcedValue``.
    """

    of: tuple[str, ...]
    source: str
    confidence: Confidence


class Link(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A link of an arm, flipper or camera mount, which rotates about a joint.

    Attributes:
        name: Name of the link in MULTIDRIVE commands; empty for none.
        min_angle: Smallest angle, rad; a value above ``max_angle`` means no limits.
        max_angle: Largest angle, rad.
        max_speed: Angular speed of the link, rad/s.
        max_torque: Torque as reported to clients.
        position: Position of the joint in the frame of the previous link, m.
        rotation_deg: Roll, pitch and yaw of the joint in that frame, degrees.
    """

    name: str = ""
    min_angle: float = 1.0
    max_angle: float = 0.0
    max_speed: Length = 1.571
    max_torque: Length = 20.0
    position: Vector = (0.0, 0.0, 0.0)
    rotation_deg: Vector = (0.0, 0.0, 0.0)

    def limit(self, angle: float) -> float:
        """Clip a joint angle, rad, to the limits of the link."""
        if self.min_angle > self.max_angle:
            return angle
        return max(self.min_angle, min(self.max_angle, angle))

    @cached_property
    def mount(self) -> Pose3:
        """Pose of the link's joint in the frame of the previous link."""
        return _pose(self.position, self.rotation_deg)

    def turned(self, angle: float) -> Pose3:
        """Return the pose at a joint angle, rad, in the frame of the previous link."""
        # The protocol's z axis points down, so the angle is negated.
        return self.mount.compose(Pose3(0.0, 0.0, 0.0, yaw=-angle))


class Item(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """An item mounted on a robot: a sensor, a mission package or the battery.

    Attributes:
        type: Type of the item on the wire, in its usual spelling.
        name: Name of the item on the wire.
        position: Position of the item in the body frame, m.
        rotation_deg: Roll, pitch and yaw in the body frame, degrees.
        sensor: Name of the sensor preset; only for range scanners.
        links: Links of a mission package, from the robot outwards.
        parent: Name of the mission package that carries a camera on its last link.
            Position and rotation of the camera are then in the frame of that link.
        settings: Settings that differ from the preset of the sensor, or from the
            defaults of the item's type.
        interval: Time between two readings, s; None for the interval of the dialect.
        dialect: The only dialect in which the item is mounted; None for both.
    """

    type: Annotated[str, AfterValidator(_known_type)]
    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
    position: Vector = (0.0, 0.0, 0.0)
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    sensor: str | None = None
    links: tuple[Link, ...] = ()
    parent: str | None = None
    settings: dict[str, Any] = {}
    interval: Length | None = None
    dialect: DialectName | None = None

    @model_validator(mode="after")
    def _has_the_parts_of_its_type(self) -> Self:
        if (self.type == "RangeScanner") != (self.sensor is not None):
            raise ValueError(
                "expected 'sensor' for a RangeScanner, and not for other types"
            )
        if (self.type == "MisPkg") != bool(self.links):
            raise ValueError("expected 'links' only for a MisPkg, which needs them")
        if self.parent is not None and self.type != "Camera":
            raise ValueError("only a Camera may have a parent")
        return self

    @cached_property
    def mount(self) -> Pose3:
        """Pose of the item in the body frame of the robot."""
        return _pose(self.position, self.rotation_deg)


def _pose(position: Vector, rotation_deg: Vector) -> Pose3:
    return Pose3(*position, *map(math.radians, rotation_deg))


class Steering(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """The axles of a robot with car-like (Ackermann) steering.

    Attributes:
        max_front_deg: Largest angle of the front wheels to either side, degrees.
        max_rear_deg: Largest angle of the rear wheels, degrees; 0 if they are fixed.
        rear_axle: x of the rear axle in the body frame, m; None for half the wheel base
            behind the origin.
    """

    max_front_deg: Annotated[float, Field(ge=0, lt=90)]
    max_rear_deg: Annotated[float, Field(ge=0, lt=90)] = 0.0
    rear_axle: float | None = None


class Flight(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Flight limits of a robot that hovers and moves in all directions.

    Attributes:
        max_linear: Largest forward and backward speed, m/s.
        max_lateral: Largest speed to either side, m/s.
        max_altitude: Largest vertical speed, m/s.
        max_turn_deg: Largest yaw rate, degrees per second.
        tilt_deg: Tilt during horizontal motion in the dialect ``udk``, degrees; in
            ``compat`` the robot stays level.
        tilt_rate_deg: Speed of tilting, degrees per second.
    """

    max_linear: Length
    max_lateral: Length
    max_altitude: Length
    max_turn_deg: Length
    tilt_deg: Annotated[float, Field(ge=0, le=45)] = 0.0
    tilt_rate_deg: Length = 90.0


_WHEEL_KEYS: Final = "wheel_radius", "wheel_separation", "wheel_base", "track", "wheels"


class RobotModel(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A robot class: its dimensions, limits, wheels and mounted items.

    The origin of the body frame is in the middle of the body, ``origin_height`` above
    the floor.

    Attributes:
        name: Name of the class in commands of clients.
        about: Description in a few sentences.
        sources: Sources of the keys.
        generation: Generation of the USARSim servers that had the class: in the
            dialect ``compat``, reports have the format of these servers.
        length: Length of the body with its bumpers, centred on the origin, m.
        width: Width of the body, centred on the origin, m.
        height: Height from the floor to the top of the payload, m.
        origin_height: Height of the body frame's origin above the floor, m.
        wheel_radius: Radius of the wheels, m.
        wheel_separation: Distance between the left and the right wheels, m.
        wheel_base: Distance between the front and the rear axle, m.
        track: Effective track width for rotation, m; if it is larger than
            ``wheel_separation``, the robot rotates slower than ideal wheels would.
        wheels: Side of each wheel, in the order of wheels on the wire.
        steering: Axles of a robot with car-like steering; None for skid steering.
        flight: Flight limits; None for a driving robot. A flying robot needs no wheel
            keys: the default wheels represent its speed and its yaw rate.
        max_rev_per_s: Largest speed of a wheel, revolutions per second; None for the
            limit of the dialect.
        mass: Mass, kg.
        max_torque: Torque as reported to clients, in the units of the original server.
        cog: Centre of gravity in the body frame, m.
        compat_interval: Time between two readings of the items in the dialect
            ``compat``, s; None for the intervals of the dialect.
        items: The mounted items, in mounting order.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
    about: str = ""
    sources: tuple[Source, ...] = ()
    generation: Generation = "udk"
    length: Length
    width: Length
    height: Length
    origin_height: Length
    wheel_radius: Length = 1.0
    wheel_separation: Length = 1.0
    wheel_base: Length = 1.0
    track: Length = 1.0
    wheels: Annotated[tuple[Side, ...], Field(min_length=2)] = ("right", "left")
    steering: Steering | None = None
    flight: Flight | None = None
    max_rev_per_s: Length | None = None
    mass: Length
    max_torque: Length
    cog: Vector = (0.0, 0.0, 0.0)
    compat_interval: Length | None = None
    items: tuple[Item, ...] = ()

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        for dialect in get_args(DialectName):
            carried = (each for each in self.items if each.dialect in (None, dialect))
            names = [item.name.casefold() for item in carried]
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(
                        f"two items have the name {name!r}, expected unique names"
                    )
        return self

    @model_validator(mode="after")
    def _drives_or_flies(self) -> Self:
        missing = [key for key in _WHEEL_KEYS if key not in self.model_fields_set]
        if self.flight is None and missing:
            raise ValueError(f"wheeled robots need {list_names(missing)}, or 'flight'")
        has_wheels = len(missing) < len(_WHEEL_KEYS) or self.steering is not None
        if self.flight is not None and has_wheels:
            raise ValueError("expected flight, or wheels and steering, but not both")
        return self

    @model_validator(mode="after")
    def _parents_are_packages(self) -> Self:
        packages = [item.name for item in self.items_of("MisPkg")]
        for item in self.items:
            if item.parent is not None and item.parent not in packages:
                parent = expected_one_of(item.parent, packages)
                raise ValueError(f"parent of {item.name}: {parent}")
        return self

    @model_validator(mode="after")
    def _sources_are_of_keys(self) -> Self:
        for source in self.sources:
            for key in source.of:
                if key not in type(self).model_fields:
                    known = list(type(self).model_fields)
                    raise ValueError(f"source for key {expected_one_of(key, known)}")
        return self

    @property
    def dimensions(self) -> Vector:
        """Length, width and height of the robot, m."""
        return (self.length, self.width, self.height)

    def items_of(self, item_type: str) -> tuple[Item, ...]:
        """Return the robot's items of a case-insensitive type, in mounting order."""
        wanted = item_type.casefold()
        return tuple(item for item in self.items if item.type.casefold() == wanted)

    def in_dialect(self, dialect: str) -> Self:
        """Return a copy of the robot class as it is in one dialect of the server."""
        carried = [item for item in self.items if item.dialect in (None, dialect)]
        if dialect == "compat" and self.compat_interval is not None:
            default = {"interval": self.compat_interval}
            carried = [
                item if item.interval else item.model_copy(update=default)
                for item in carried
            ]
        flight = self.flight
        if flight is not None and dialect == "compat":
            # Clients for UT2004 servers build maps from the scans of drones, so drones
            # stay level.
            flight = flight.model_copy(update={"tilt_deg": 0.0})
        return self.model_copy(update={"items": tuple(carried), "flight": flight})

    def scanner_pose(self, start: Pose3) -> Pose3:
        """Return the pose of the first range scanner of a robot at a start pose.

        Args:
            start: Pose on the floor, map frame.
        """
        lift = Pose3(0.0, 0.0, self.origin_height)
        return start.compose(lift).compose(self.items_of("RangeScanner")[0].mount)


def robot_names() -> tuple[str, ...]:
    """Return the names of all shipped robot classes, sorted."""
    return preset_names("robots")


@cache
def load_robot(class_name: str) -> RobotModel:
    """Load a shipped robot class by its name, ignoring case.

    Raises:
        PresetError: If there is no such class.
    """
    for name in robot_names():
        if name.casefold() == class_name.casefold():
            return read_robot(preset_path("robots", name))
    raise PresetError(f"robot class {expected_one_of(class_name, robot_names())}")


def read_robot(path: Path, seen: tuple[Path, ...] = ()) -> RobotModel:
    """Read a robot class from a YAML file.

    The class named by ``based_on`` is a file in the same folder, or a shipped class.

    Args:
        path: The file.
        seen: The files of the classes that are based on this file.

    Raises:
        OSError: If one of the files cannot be read.
        PresetError: If the file is invalid; one line for each problem, with its
            position in the file.
    """
    file = read_yaml(path)
    if file.problems:
        raise PresetError("\n".join(file.problems))
    try:
        return RobotModel.model_validate(_with_base(file.data, path, seen))
    except ValidationError as error:
        raise PresetError(
            "\n".join(file.validation_problems(error, known=RobotModel.model_fields))
        ) from error


def _with_base(data: object, path: Path, seen: tuple[Path, ...]) -> object:
    if not isinstance(data, dict) or "based_on" not in data:
        return data
    changed = {key: value for key, value in data.items() if key != "based_on"}
    name = str(data["based_on"])
    neighbour = path.parent / f"{name}.yaml"
    # A file may be based on the shipped class that has the same name as the file.
    if name.isidentifier() and neighbour.is_file() and neighbour not in (path, *seen):
        model = read_robot(neighbour, (path, *seen))
    else:
        model = load_robot(name)
    base = model.model_dump(exclude_unset=True, exclude=_NOT_INHERITED)
    added = changed.get("items", [])
    if not isinstance(added, list) or not all(
        isinstance(item, dict) and "name" in item for item in added
    ):
        return base | changed  # the validation reports the problems
    items = {item["name"]: item for item in (*base.get("items", ()), *added)}
    return base | changed | {"items": list(items.values())}
