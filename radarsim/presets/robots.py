"""Robot classes: what a client can ask for by name, and what such a robot carries.

Each class is a file in ``robots/``. A file may be ``based_on`` another: its keys
replace the other's, and so does each of its items that has the name of one there; its
other items come after them.
"""

import math
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from radarsim.errors import PresetError
from radarsim.geometry import Pose3
from radarsim.yaml_reader import read_yaml

ItemType: TypeAlias = Literal[
    "RangeScanner",
    "GroundTruth",
    "INS",
    "Odometry",
    "Tachometer",
    "Encoder",
    "Touch",
    "Battery",
]
Side: TypeAlias = Literal["left", "right"]
Vector: TypeAlias = tuple[float, float, float]
Length: TypeAlias = Annotated[float, Field(gt=0)]

_FOLDER = Path(__file__).parent / "robots"


class Item(BaseModel):
    """A thing mounted on a robot, most often a sensor.

    Attributes:
        type: The item's type on the wire, in its usual spelling.
        name: The item's name on the wire.
        position: Of its origin in the body frame, m.
        rotation_deg: Its roll, pitch, yaw in the body frame.
        sensor: Name of the sensor preset; range scanners have one, no others do.
        settings: What differs from the sensor's own settings.
        interval: Time between two readings, s; None leaves it to the dialect.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    type: ItemType
    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
    position: Vector = (0.0, 0.0, 0.0)
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    sensor: str | None = None
    settings: dict[str, Any] = {}
    interval: Length | None = None

    @model_validator(mode="after")
    def _scanners_name_a_sensor(self) -> Self:
        if (self.type == "RangeScanner") != (self.sensor is not None):
            raise ValueError("a sensor is named by range scanners, and by no others")
        return self

    @property
    def mount(self) -> Pose3:
        """Where it sits on the robot, body frame."""
        return Pose3(*self.position, *(math.radians(a) for a in self.rotation_deg))


class RobotModel(BaseModel):
    """A robot class.

    The body frame's origin is amidships, ``origin_height`` above the floor.

    Attributes:
        name: The class, as clients name it.
        length: Of the hull, m, bumpers included; centred on the origin.
        width: Of the hull, m; centred on the origin.
        height: Of the hull, m, from the floor to the top of what it carries.
        origin_height: Of the body frame's origin above the floor, m.
        wheel_radius: m.
        wheel_separation: Between the left and the right wheels, m.
        wheel_base: Between the front and the rear axle, m.
        track: The separation that turns obey, m; more than ``wheel_separation`` lets
            the robot turn less than its wheels say.
        wheels: The side that each wheel is on, in the order of the wire.
        mass: kg.
        max_torque: As reported, in the units of the original.
        cog: Centre of gravity, body frame, m.
        items: What it carries, in mounting order.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
    length: Length
    width: Length
    height: Length
    origin_height: Length
    wheel_radius: Length
    wheel_separation: Length
    wheel_base: Length
    track: Length
    wheels: Annotated[tuple[Side, ...], Field(min_length=2)]
    mass: Length
    max_torque: Length
    cog: Vector = (0.0, 0.0, 0.0)
    items: tuple[Item, ...] = ()

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        names = [item.name.casefold() for item in self.items]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two items of the name {name!r}")
        return self

    @property
    def dimensions(self) -> Vector:
        """Length, width and height of the hull, m."""
        return (self.length, self.width, self.height)

    def items_of(self, item_type: str) -> tuple[Item, ...]:
        """Give the items of one type, in any case, in mounting order."""
        wanted = item_type.casefold()
        return tuple(item for item in self.items if item.type.casefold() == wanted)


def robot_names() -> tuple[str, ...]:
    """Give the names of all robot classes, sorted."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.yaml")))


@cache
def load_robot(class_name: str) -> RobotModel:
    """Load a robot class by its name, in any case.

    Raises:
        PresetError: If there is no such class.
    """
    for name in robot_names():
        if name.casefold() == class_name.casefold():
            return read_robot(_FOLDER / f"{name}.yaml")
    names = list(robot_names())
    raise PresetError(f"robot class {class_name[:80]!r}, expected one of {names}")


def read_robot(path: Path) -> RobotModel:
    """Read the file of a robot class; what it is based on lies beside it.

    Raises:
        OSError: If it, or what it is based on, cannot be read.
        PresetError: If it is wrong; one line for each problem, with its place.
    """
    file = read_yaml(path)
    if file.problems:
        raise PresetError("\n".join(file.problems))
    try:
        return RobotModel.model_validate(_with_base(file.data, path.parent))
    except ValidationError as error:
        raise PresetError(
            "\n".join(file.validation_problems(error, known=RobotModel.model_fields))
        ) from error


def _with_base(data: Any, folder: Path) -> Any:
    if not isinstance(data, dict) or "based_on" not in data:
        return data
    own = {key: value for key, value in data.items() if key != "based_on"}
    model = read_robot(folder / f"{data['based_on']}.yaml")
    base = model.model_dump(exclude_unset=True)
    added = own.get("items", [])
    if not _are_named(added):
        return base | own  # for the validation to refuse
    items = {item["name"]: item for item in (*base.get("items", ()), *added)}
    return base | own | {"items": list(items.values())}


def _are_named(items: Any) -> bool:
    return isinstance(items, list) and all(
        isinstance(item, dict) and "name" in item for item in items
    )
