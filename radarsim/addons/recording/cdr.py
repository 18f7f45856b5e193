"""Messages of ROS 2 as bytes: CDR, as rosbags encodes and decodes it."""

import struct
from functools import cache
from typing import Any, ClassVar, Final, Protocol, TypeVar, cast

from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore
from rosbags.typesys.stores import ros2_jazzy

from radarsim.addons.recording.messages import TopicMessage

# Types that are read.
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

# Types that ROS 2 itself has not; of https://github.com/ros-perception/radar_msgs.
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
    """A class of messages of rosbags."""

    __msgtype__: ClassVar[str]


_Message = TypeVar("_Message", bound=RosType)


@cache
def typestore() -> Typestore:
    """Return the types of ROS 2, which take a quarter of a second to load."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in _OTHER_TYPES.items():
        store.register(get_types_from_msg(text, name))
    return store


def encode(message: TopicMessage) -> bytes:
    """Encode a message, little-endian."""
    store = typestore()
    return bytes(store.serialize_cdr(message.fields, message.type, little_endian=True))


def decode(type_: str, data: bytes, expected: type[_Message]) -> _Message:
    """Decode a message.

    Raises:
        ValueError: If it is of another type, or is not whole.
    """
    if type_ != expected.__msgtype__:
        raise ValueError(f"message of {type_!r}, {expected.__msgtype__} expected")
    try:
        return cast(_Message, typestore().deserialize_cdr(data, type_))
    except (SerdeError, ValueError, struct.error) as error:
        raise ValueError(f"{type_} {error}, expected a whole message") from error


def definition_of(type_: str) -> str:
    """Return the definition of a type and those within it, as ROS 2 has it."""
    return typestore().generate_msgdef(type_, ros_version=2)[0]


def type_definitions(name: str) -> list[dict[str, Any]]:
    """Return a type and those within it, each once, as ``rosapi/TypeDef``.

    Args:
        name: Full name of the type; there is nothing of one that is not known.
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
    """Return the type of a field, and the length of an array: 0 if it may change.

    Args:
        description: The field as rosbags describes it; -1 is the length of no array.
    """
    kind, inner = description
    if kind == Nodetype.NAME:
        return inner, -1
    if kind == Nodetype.BASE:
        return inner[0], -1
    element, length = inner
    return _type_of(element)[0], length if kind == Nodetype.ARRAY else 0
