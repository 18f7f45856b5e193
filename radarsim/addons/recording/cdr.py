"""Encodes and decodes ROS 2 messages in CDR, with the package rosbags."""

import struct
from functools import cache
from typing import Any, ClassVar, Final, Protocol, TypeVar, cast

from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore
from rosbags.typesys.stores import ros2_jazzy

from radarsim.addons.recording.messages import TopicMessage

# Message types that radarsim decodes.
Header = ros2_jazzy.std_msgs__msg__Header
Image = ros2_jazzy.sensor_msgs__msg__Image
LaserScan = ros2_jazzy.sensor_msgs__msg__LaserScan
Odometry = ros2_jazzy.nav_msgs__msg__Odometry
PointCloud2 = ros2_jazzy.sensor_msgs__msg__PointCloud2
Pose = ros2_jazzy.geometry_msgs__msg__Pose
PoseStamped = ros2_jazzy.geometry_msgs__msg__PoseStamped
Twist = ros2_jazzy.geometry_msgs__msg__Twist
TwistStamped = ros2_jazzy.geometry_msgs__msg__TwistStamped
String = ros2_jazzy.std_msgs__msg__String
UInt8MultiArray = ros2_jazzy.std_msgs__msg__UInt8MultiArray

# Types that are not part of ROS 2, from https://github.com/ros-perception/radar_msgs.
_OTHER_TYPES: Final = {
    "radar_msgs/msg/RadarReturn": """
float32 range
float32 azimuth
float32 elevation
float32 doppler_velocity
float32 amplitude
""",
    "radar_msgs/msg/RadarScan": """
std_msgs/Header header
radar_msgs/RadarReturn[] returns
""",
}


class RosType(Protocol):
    """A message class of rosbags."""

    __msgtype__: ClassVar[str]


_Message = TypeVar("_Message", bound=RosType)


@cache
def typestore() -> Typestore:
    """Return the message types of ROS 2; they take 0.25 s to load and are cached."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in _OTHER_TYPES.items():
        store.register(get_types_from_msg(text, name))
    return store


def encode(message: TopicMessage) -> bytes:
    """Return a message as little-endian CDR."""
    store = typestore()
    return bytes(store.serialize_cdr(message.fields, message.type, little_endian=True))


def decode(type_: str, data: bytes, expected: type[_Message]) -> _Message:
    """Decode a message from CDR.

    Raises:
        ValueError: If the message has another type, or is truncated.
    """
    if type_ != expected.__msgtype__:
        raise ValueError(f"message of type {type_!r}, expected {expected.__msgtype__}")
    try:
        return cast(_Message, typestore().deserialize_cdr(data, type_))
    except (SerdeError, ValueError, struct.error) as error:
        raise ValueError(f"{type_}: {error}, expected a complete message") from error


def definition_of(type_: str) -> str:
    """Return the ROS 2 definition of a message type and of its nested types."""
    return typestore().generate_msgdef(type_, ros_version=2)[0]


def type_definitions(name: str) -> list[dict[str, Any]]:
    """Return a message type and its nested types, each once, as ``rosapi/TypeDef``.

    Args:
        name: Full name of the type; the list is empty if the type is unknown.
    """
    known = typestore().fielddefs
    names = [name] if name in known else []
    found = []
    for each in names:
        fields = [(field, *_type_of(desc)) for field, desc in known[each][1]]
        fieldnames, types, lengths = map(list, zip(*fields, strict=True))
        names += [type_ for type_ in types if "/" in type_ and type_ not in names]
        found.append(
            {
                "type": each,
                "fieldnames": fieldnames,
                "fieldtypes": types,
                "fieldarraylen": lengths,
                "examples": ["" if length < 0 else "[]" for length in lengths],
                "constnames": [],
                "constvalues": [],
            }
        )
    return found


def _type_of(description: Any) -> tuple[str, int]:
    """Return a field's type and array length: 0 if variable, -1 if it is no array.

    Args:
        description: Description of the field by rosbags.
    """
    kind, inner = description
    if kind == Nodetype.NAME:
        return inner, -1
    if kind == Nodetype.BASE:
        return inner[0], -1
    element, length = inner
    return _type_of(element)[0], length if kind == Nodetype.ARRAY else 0
